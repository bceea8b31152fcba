"""Why a result can be trusted: what was checked, with the numbers, and what was not."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from beamsim.analyses.result import Result
from beamsim.fields import figure_in_words, place_in_words
from beamsim.outcomes import STANDINGS
from beamsim.plots.style import scale_for
from beamsim.trust.convergence import named

METHODS = {
    "reference": "time stepping with located events; contacts are not certified",
    "shooting": "Periodic motions of the flow in closed form, by Newton's method with exact derivatives; stability by "
    "the multipliers of one period.",
    "harmonic_balance": "Fourier series of the motion; the energy balance and the residual say what is left out.",
    "secular": "Natural frequencies as roots of an equation in the stiffness alone.",
}
Row = tuple[str, str, str]  # what was checked, what came out, what that means


def doubts(result: Result) -> list[str]:
    """Sentences that a reader must see before any number: what is incomplete, doubtful or not reliable."""
    doubtful = STANDINGS[result.outcome.gravest].first_line
    return [str(result.outcome.displayed(scale_for))] if doubtful else []


def checks(result: Result) -> Iterator[Row]:
    """What was checked."""
    summary = result.summary
    yield "outcome", str(result.outcome.displayed(scale_for)) or "complete", "how the computation ended"
    method = summary.get("method") or getattr(result, "method", "")
    if method == "exact":
        yield (
            "method", "closed form between contacts",
            "No time step: the motion between two contact events is evaluated in closed form. The search for the next "
            "event is certified: bounds exclude that a contact is passed over.",
        )  # fmt: skip
    elif method:
        meaning = next((text for start, text in METHODS.items() if str(method).startswith(start)), "")
        yield "method", str(method).replace("_", " "), meaning
    error = summary.get("energy_error")
    if isinstance(error, (int, float)) and math.isfinite(error):
        yield (
            "energy balance", f"error {error:.2g}",
            "Work put in, energy stored and energy dissipated, each computed by itself; over the larger of the stored "
            "energy and the work exchanged.",
        )  # fmt: skip
    bound = summary.get("reduction_bound")
    if isinstance(bound, (int, float)) and math.isfinite(bound):
        kept = f"{summary['kept_modes']} modes, {summary['static_vectors']} static vectors"
        up_to = f"{summary['highest_frequency_hz']:.4g} Hz"
        yield "reduction", f"{kept}, error below {bound:.2g}", f"of the receptance at contacts and loads up to {up_to}"
    model: Any = summary.get("convergence_model") or {}
    if model:
        reason = model.get("reason")
        parted = model.get("sequences_part_s")
        elements = " and twice the elements" if result.scenario.has_mesh else ""
        text = f"not checked: {reason}" if reason else f"solved again with 1.5 times the modes{elements}"
        if not model.get("modes") and not reason:
            text = "nothing is left out: the model has all its modes and no mesh"
        if parted is not None and math.isfinite(parted):
            text += f"; the contact sequences diverge at {parted:.4g} s, later values are compared as statistics"
        yield (
            "finer model",
            text,
            "the change of every value is in the table below; more is missing of one that converges slowly",
        )
    against: Any = summary.get("against")
    if against:
        yield (
            "reference integrator",
            "compared; see the table of results",
            "integration in time by SciPy",
        )
    if result.warnings:
        yield "warnings", "\n".join(result.warnings), ""


def changes(result: Result) -> list[tuple[str, str, float, bool]]:
    """Figure, name, relative change with the finer model, and whether that makes it doubtful."""
    doubtful = set(result.summary.get("doubtful") or ())
    rows = []
    for key, change in named(result.summary.get("convergence") or {}):
        figure, _, place = key.partition(".")
        rows.append((figure_in_words(figure), place_in_words(place), change, key in doubtful))
    return rows


def versions(result: Result) -> str:
    """The program and the packages that the numbers depend on."""
    packages = ", ".join(f"{name} {version}" for name, version in result.provenance.items())
    return f"beamsim {result.beamsim_version}, {packages}"
