"""First screen of static equilibria."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from beamsim.analyses.statics.result import NOTHING_ACTS, StaticResult
from beamsim.cli.screens import MOST_ROWS, MOST_SHOWN, Errors, Screen, limit_lines, limits_by_place, more_rows
from beamsim.outcomes import first_of
from beamsim.plots.style import amount, is_known

_FREQUENCIES = 3  # that are printed of each kind
_HEADINGS = ("", "stop", "force", "moment", "gap left", "deflection", "limit")


def static_screen(result: StaticResult) -> Screen:
    """Stops with force, gap and deflection, probes, supports with their reactions; natural frequencies and limits."""
    errors, equilibrium = Errors(result), result["equilibrium"]
    limits = limits_by_place(result) if result.summary.get("margins") else {}
    rows = [*_stops(result, errors), *_rings(result, errors), *_probes(result, errors), *_supports(result, errors)]
    rows = [dict.fromkeys(_HEADINGS, "") | row | {"limit": "; ".join(limits.get(row[""], ()))} for row in rows]
    shown = [*rows[:MOST_ROWS], *more_rows(len(rows))]
    names = [row[""] for row in rows[:MOST_ROWS]]
    lines = [text for text in result.warnings if text == NOTHING_ACTS]
    lines += [*_frequencies(result, errors), *(limit_lines(result, names) if limits else ())]
    if "friction" in equilibrium:
        given = equilibrium.by_label("friction_force")
        texts = [f"{name} {amount(force.item(), force.unit)}" for name, force in given.items()]
        lines.append(
            f"friction is taken as that at the start: {first_of(texts, MOST_SHOWN)}; while it sticks, other equilibria "
            "within its limit are possible"
        )
    return Screen(errors.verdict(), shown, [*lines, *errors.legend()])


def _stops(result: StaticResult, errors: Errors) -> Iterator[dict[str, str]]:
    """Rows of the snubbers."""
    for row in result["equilibrium"].rows("snubber"):
        name = row["snubber"]
        turns = name in result.summary.get("gap_rad", ())
        peak, gap = ("peak_moment_n_m", "largest_gap_rad") if turns else ("peak_force_n", "largest_gap_m")
        way = "rad" if turns else "m"
        force = errors.number(row["force"], "N m" if turns else "N", peak, name)
        yield {
            "": name,
            "stop": "touches" if row["touches"] else "open",
            "moment" if turns else "force": force if row["touches"] else "",
            "gap left": "" if row["touches"] else errors.number(row["gap_left"], way, gap, name),
            "deflection": amount(row["snubber_displacement"], way),
        }


def _rings(result: StaticResult, errors: Errors) -> Iterator[dict[str, str]]:
    """Rows of the rings."""
    for name, force in result.summary.get("peak_ring_force_n", {}).items():
        touches = force > 0.0
        number = errors.number(force, "N", "peak_ring_force_n", name) if touches else ""
        yield {"": name, "stop": "touches" if touches else "open", "force": number}


def _probes(result: StaticResult, errors: Errors) -> Iterator[dict[str, str]]:
    """Rows of the probes that do not have the name of a snubber at the same place."""
    stops = {row["snubber"]: row["snubber_displacement"] for row in result["equilibrium"].rows("snubber")}
    for name, value in result["equilibrium"].by_label("displacement").items():
        if not np.isclose(stops.get(name, np.nan), value.item(), rtol=1e-9, atol=0.0):
            yield {"": name, "deflection": errors.number(value.item(), "m", "max_displacement_m", name)}


def _supports(result: StaticResult, errors: Errors) -> Iterator[dict[str, str]]:
    """Rows of the supports: force and moment."""
    force, moment = (result.summary.get(entry, {}) for entry in ("reaction_n", "reaction_moment_n_m"))
    for name in dict.fromkeys((*force, *moment)):
        row = {"": name, "stop": "support"}
        if name in force:
            row["force"] = errors.number(force[name], "N", "reaction_n", name)
        if name in moment:
            row["moment"] = errors.number(moment[name], "N m", "reaction_moment_n_m", name)
        yield row


def _frequencies(result: StaticResult, errors: Errors) -> Iterator[str]:
    """Natural frequencies about the equilibrium, with friction stuck and sliding."""
    friction = "friction" in result["equilibrium"]
    for entry, words in (("stuck_frequencies_hz", "friction stuck"), ("sliding_frequencies_hz", "friction sliding")):
        if friction or entry.startswith("stuck"):
            numbered = [(k, hz) for k, hz in enumerate(result.summary[entry], 1) if is_known(hz)][:_FREQUENCIES]
            texts = [errors.number(hz, "Hz", entry, str(k)) for k, hz in numbered]
            yield f"natural frequencies{f', {words}' if friction else ''}: {', '.join(texts) or 'none'}"
