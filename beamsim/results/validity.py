"""What may be wrong with a result: a reduced model that is not accurate, deflections that are too large for the theory,
stops that are pressed further than their tables of force and deflection go."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from beamsim.contacts.pads import ForceCurve
from beamsim.inputs.statements import InputStatement
from beamsim.outcomes import Outcome, OutcomeKind
from beamsim.scenario import Scenario
from beamsim.scenario.base import path_text
from beamsim.system.force_tables import curves_of
from beamsim.system.modes import ModeTable
from beamsim.typing import Floats

WORTHLESS_REDUCTION = 0.1
"""Bound of the receptance's error over the static compliance above which a result is not to be trusted."""
LINES_OF_BANDWIDTH = 0.25  # largest distance of the sines of a random input, over the half-power bandwidth of a mode
_REST = "; the last slope continues beyond it, which may be too soft: measure further, or add points"


def reduction_checked(outcome: Outcome, scenario: Scenario, modes: ModeTable) -> Outcome:
    """The outcome, which is not to be trusted where the reduced receptance has no useful bound.

    Parameters
    ----------
    outcome : of the computation.
    scenario, modes : of its structure.

    Returns
    -------
    Outcome
    """
    if not modes.reduction_bound > WORTHLESS_REDUCTION:
        return outcome
    return Outcome.of(
        OutcomeKind.UNTRUSTED, "reduction_not_accurate",
        "the error of the reduced model's receptance at contacts and loads up to "
        f"{modes.highest_frequency_hz:.6g} Hz is bounded only by {modes.reduction_bound:.2g} of its size, more than "
        f"{WORTHLESS_REDUCTION:g}",
        *outcome.unless_complete,
        remedy=scenario.more_modes(modes.kept_modes), bound=modes.reduction_bound,
    )  # fmt: skip


def deflection_warnings(scenario: Scenario, modes: ModeTable, motions: Iterable[Mapping[str, Floats]]) -> list[str]:
    """A warning for each body whose deflection is not small; none where rigid-body modes carry it as far as they like.

    Parameters
    ----------
    scenario : of the motions.
    modes : of its structure.
    motions : m, largest displacements by probe, of each curve or branch.

    Returns
    -------
    One sentence a body.
    """
    if np.isnan(modes.damping_ratios).any():
        return []
    body_of = {probe.name: probe.place.body for probe in scenario.probes}
    largest: dict[str, tuple[float, str]] = {}  # by body, with the probe
    for motion in motions:
        for probe, values in motion.items():
            body, peak = body_of.get(probe) or scenario.default_body, float(np.nanmax(values, initial=0.0))
            largest[body] = max(largest.get(body, (0.0, "")), (peak, probe))
    return [
        f"the largest displacement at {probe} = {peak:.3g} m is not small for {path_text(scenario.body_path(name))} "
        f"(more than {allowed:.3g} m), and the theory does not hold: a unit such as mm or g may be wrong"
        for name, (peak, probe) in largest.items()
        if name in scenario.all_bodies and peak > (allowed := scenario.all_bodies[name].largest_deflection)
    ]


def line_warnings(inputs: Iterable[InputStatement], modes: ModeTable) -> list[str]:
    """A warning for each random input whose sines are too far apart for the resonances in its band.

    Parameters
    ----------
    inputs : of the run.
    modes : of its structure; as it rests, where that is known, else with open contacts.

    Returns
    -------
    One sentence an input, about the mode with the smallest bandwidth.
    """
    frequency, ratio = modes.resting_frequencies_hz, modes.resting_damping_ratios
    if frequency is None or ratio is None:
        frequency, ratio = modes.open_frequencies_hz, modes.damping_ratios
    width = 2.0 * np.asarray(ratio) * frequency
    warnings = []
    for each in inputs:
        within = np.flatnonzero((frequency >= each.from_hz) & (frequency <= each.to_hz) & (width > 0.0))
        if within.size == 0:
            continue
        k = within[np.argmin(width[within])]
        if each.line_spacing_hz > LINES_OF_BANDWIDTH * width[k]:
            warnings.append(
                f"{each.path}: the sines of the random input are {each.line_spacing_hz:.4g} Hz apart, which is "
                f"{each.line_spacing_hz / width[k]:.2g} of the half-power bandwidth of mode {k + 1}, {width[k]:.3g} Hz "
                f"at {frequency[k]:.4g} Hz (at most {LINES_OF_BANDWIDTH:g}): the response depends on where they lie; "
                f"give a run.duration or excitation.period of {1.0 / (LINES_OF_BANDWIDTH * width[k]):.3g} s"
            )
    return warnings


def curve_warnings(scenario: Scenario, modes: ModeTable, curves: Sequence[Any]) -> list[str]:
    """What `deflection_warnings` and `forces_beyond_tables` say of curves or branches.

    Parameters
    ----------
    scenario, modes : as of these.
    curves : with ``displacement`` and ``force`` by name, each with its peaks.
    """
    deflections = ({name: x.peak for name, x in curve.displacement.items()} for curve in curves)
    forces = ({name: x.peak for name, x in curve.force.items()} for curve in curves)
    return [*deflection_warnings(scenario, modes, deflections), *forces_beyond_tables(scenario, forces)]


def forces_beyond_tables(scenario: Scenario, forces: Iterable[Mapping[str, Floats]]) -> list[str]:
    """A warning for each stop whose force exceeds the last one of its table.

    Parameters
    ----------
    forces : N, largest contact forces by snubber, of each curve, branch or study.
    """
    largest: dict[str, float] = {}
    for curve in forces:
        for name, values in curve.items():
            largest[name] = max(largest.get(name, 0.0), float(np.nanmax(values, initial=0.0)))
    return [
        f"{scenario.located_snubber(name).label}: its force reaches {largest[name]:.4g} "
        f"{scenario.located_snubber(name).item.units[1]}, its table ends at {_end(scenario, name, curve)}{_REST}"
        for name, curve in _tables(scenario).items()
        if largest.get(name, 0.0) > curve.force[-1]
    ]


def compressed_beyond_tables(scenario: Scenario, compression: Mapping[str, float]) -> list[str]:
    """A warning for each stop that is compressed further than its table goes.

    Parameters
    ----------
    compression : m, the largest of each snubber.
    """
    return [
        f"{scenario.located_snubber(name).label}: it is compressed by up to {_way(scenario, name, compression[name])}, "
        f"its table ends at {_end(scenario, name, curve)}{_REST}"
        for name, curve in _tables(scenario).items()
        if compression[name] > curve.deflection[-1]
    ]


def _way(scenario: Scenario, name: str, penetration: float) -> str:
    return f"{1e3 * penetration:.4g} m{scenario.located_snubber(name).item.units[0]}"


def _end(scenario: Scenario, name: str, curve: ForceCurve) -> str:
    unit = scenario.located_snubber(name).item.units[1]
    return f"{_way(scenario, name, curve.deflection[-1])}, {curve.force[-1]:.4g} {unit}"


def _tables(scenario: Scenario) -> dict[str, ForceCurve]:
    if all(snubber.force_deflection is None for snubber in scenario.all_snubbers):
        return {}
    named = zip(scenario.located_snubbers, curves_of(scenario), strict=True)
    return {snubber.name: curve for (_, _, snubber, _), curve in named if curve is not None}
