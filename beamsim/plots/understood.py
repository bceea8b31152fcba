"""What was understood of a case, in a line with units: excitation, filter, and the first modes open and closed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from beamsim.inputs.density import SpectralDensity
from beamsim.labelled import Dataset
from beamsim.outcomes import first_of
from beamsim.plots.style import amount, extent, is_known, percent
from beamsim.scenario import Scenario
from beamsim.scenario.base import Path, count_text, path_text
from beamsim.scenario.body import MovedStop, MovedSupport
from beamsim.scenario.excitation import Forces
from beamsim.scenario.files import CurveFile
from beamsim.scenario.quantities import LEVEL_DIMENSIONS, Rate, amplitude_unit
from beamsim.scenario.sweep import LevelPath, swept_cycles
from beamsim.structures.assembly import load_site_in
from beamsim.system.structural import SnubberNumbers

Inputs = Mapping[str, Mapping[str, Any]]
"""By path of the excitation what is known of a random input or record: rms, peak and unit."""
AREAS = {
    "acceleration": ("velocity change", "m/s"), "angular_acceleration": ("velocity change", "rad/s"),
    "force": ("impulse", "N s"),
}  # fmt: skip
"""What the area under a pulse is, and its unit, by the quantity of the pulse."""


def interpretation(scenario: Scenario, modes: Dataset | None, inputs: Inputs, command: str = "") -> str:
    """What was understood of a case: excitation, filter against it, and first modes.

    Parameters
    ----------
    scenario : of the case.
    modes : of its structure; None where they are not known.
    inputs : random inputs and records, as far as they are known.
    command : run, or another one, of a case for several; by default those that it has sections for.

    Returns
    -------
    One line, empty where there is nothing to say.
    """
    command = command or _command_of(scenario)
    held = command == "nnm" and scenario.nnm is not None and scenario.nnm.phase_resonance is not None
    excited = bool(scenario.excitation.items) and (held or command not in ("nnm", "identify-stiffness", "static"))
    parts = excitation_text(scenario, inputs, command).split("\n") if excited else []
    low_pass = None if scenario.run is None or command not in ("", "run") else scenario.run.low_pass
    if low_pass is not None:
        highest = max([scenario.excitation.highest_frequency_hz, *(of["to_hz"] for of in inputs.values())])
        parts.append(_low_pass_text(low_pass, highest))
    return "; ".join([*parts, *(() if modes is None else first_modes(scenario, modes))])


def _command_of(scenario: Scenario) -> str:
    """The command of a case that is for one alone which hardly uses an excitation; empty of any other case."""
    if scenario.run is not None or scenario.sweep is not None or scenario.study is not None:
        return ""
    return "nnm" if scenario.nnm is not None else "identify-stiffness" if scenario.identify_stiffness else ""


def _low_pass_text(low_pass: float, highest: float) -> str:
    """A low-pass filter, Hz, against the highest frequency of the excitation, Hz; 0 where there is none."""
    against = f", {low_pass / highest:.3g} times the excitation's {highest:.4g} Hz" if highest > 0.0 else ""
    return f"low-pass filter {low_pass:.6g} Hz{against}"


def first_modes(scenario: Scenario, table: Dataset) -> Iterator[str]:
    """The first natural frequency with its damping: contacts open, closed, and as at rest."""
    states = {"open": ("open_frequencies_hz", "damping_ratios")}
    if scenario.located_snubbers:
        states["closed"] = "closed_frequencies_hz", "closed_damping_ratios"
        if "resting_frequencies_hz" in table:
            states["at rest"] = "resting_frequencies_hz", "resting_damping_ratios"
    texts: dict[str, str] = {}
    for state, names in states.items():
        frequencies, ratios = (table[name].values for name in names)
        elastic = [k for k, hz in enumerate(frequencies[: table["kept_modes"].item()]) if hz > 0.0]
        if elastic:
            damping = f" ({percent(ratios[elastic[0]], 2)})" if is_known(ratios[elastic[0]]) else ""
            hz = frequencies[elastic[0]]
            texts[state] = f"{hz:{'.3g' if hz < 999.5 else '.0f'}} Hz {{}}{damping}"
    if texts:  # once where it is the same in several states
        alike = {text: " and ".join(state for state, each in texts.items() if each == text) for text in texts.values()}
        yield f"first mode {', '.join(text.format(states) for text, states in alike.items())}"


def excitation_text(scenario: Scenario, inputs: Inputs | None = None, command: str = "") -> str:
    """What excites the model, in a line; of a case with both a run and a sweep a line for each.

    Parameters
    ----------
    scenario, inputs : as of `interpretation`.
    command : run, sweep or nnm, to say only what that does.
    """
    if command == "nnm":
        return "; ".join(_phase_resonance_text(scenario, part) for _, part in scenario.excitation.items)
    swept = "" if scenario.sweep is None else _SWEEPS.get(scenario.sweep.kind, "steady sine")
    ways = {"run: ": "", "sweep: ": swept} if swept and scenario.run is not None else {"": swept}
    if command and len(ways) > 1:
        ways = {"": "" if command == "run" else swept}
    texts = {
        label: "; ".join(
            dict.fromkeys(
                _excitation_text(scenario, part, way, (inputs or {}).get(path_text(("excitation", *at)), {}))
                for at, part in _sections(scenario.excitation)
            )
        )
        for label, way in ways.items()
    }
    return "\n".join(label + text for label, text in texts.items() if text) or "no excitation"


def _sections(excitation: Any) -> list[tuple[Path, Any]]:
    """The excitations as they are written, with their paths: several columns of one record are one."""
    if isinstance(excitation, Forces):
        return [(("forces", index), each) for index, each in enumerate(excitation.forces)]
    return [((), excitation)] if excitation.items else []


def _phase_resonance_text(scenario: Scenario, excitation: Any) -> str:
    """The sine that holds a nonlinear mode at phase resonance: its levels and place."""
    resonance: Any = None if scenario.nnm is None else scenario.nnm.phase_resonance
    levels = getattr(resonance, "levels", ()) or [level for _, level in excitation.levels()]
    sizes = " and ".join(amplitude_text(excitation, level) for level in levels)
    return f"sine at phase resonance, {sizes}{_place(scenario, excitation)}"


_SWEEPS = {"swept_sine": "swept sine", "stepped": "stepped sine"}


def _swept(scenario: Scenario, part: Any) -> Iterator[str]:
    """Levels, range and rate of a sweep."""
    sweep: Any = scenario.sweep
    path = sweep.parameter.in_metres(scenario) if sweep.kind == "continuation" else sweep
    points = [
        f"{amplitude_text(point if point.quantity else part, point.level)} from {point.frequency:.6g} Hz"
        for point in getattr(sweep, "profile", ())
    ]
    file = getattr(sweep, "profile_file", None)
    if profile := first_of(points, 4) or (file and file.file):
        yield f"profile of {profile}"
    if sweep.levels and scenario.level_unit:
        yield " and ".join(amplitude_text(part, level) for level in sweep.levels)
    elif sweep.levels:  # they multiply a profile, or the levels of several forces
        yield f"times {' and '.join(f'{level:g}' for level in sweep.levels)}"
    unit = scenario.level_unit if path.kind == "level" else getattr(path, "unit", "Hz")
    ends = extent(float(min(path.ends)), float(max(path.ends)), unit)
    yield ends if unit == "Hz" else f"{path.kind} {ends}, {' and '.join(f'{f:.6g} Hz' for f in part.frequencies_hz)}"
    if rate := getattr(sweep, "rate", None):
        yield f"{_rate_text(rate)}, {_cycles_text(sweep.cycles)}"


def _excitation_text(scenario: Scenario, excitation: Any, sweep_text: str, input_values: Mapping[str, Any]) -> str:
    """One motion or force: its kind, size, frequencies, duration and place."""
    sweep: Any = scenario.sweep
    words = [sweep_text or excitation.kind.replace("_", " ")]
    levels = [level for _, level in excitation.levels()]
    given = sweep_text and (sweep.levels or isinstance(getattr(sweep, "continue_in", None), LevelPath))
    if levels and not (given if scenario.level_unit else sweep_text and excitation is scenario.excitation):
        words.append(amplitude_text(excitation, max(levels, key=abs)))
    if sweep_text:
        words += _swept(scenario, excitation)
    tones = () if sweep_text else excitation.frequencies_hz
    if excitation.kind in _INPUTS:
        run = {} if scenario.run is None else {"duration": scenario.run.duration}
        words += _INPUTS[excitation.kind](excitation, run if excitation.kind == "swept_sine" else input_values)
    elif 0 < len(tones) <= 3:
        words.append(" and ".join(f"{tone:.6g} Hz" for tone in tones))
    return f"{', '.join(words)}{_place(scenario, excitation)}"


def _place(scenario: Scenario, excitation: Any) -> str:
    """Where a motion or force acts, behind what it is."""
    if excitation.on_base:
        columns = getattr(excitation, "columns", None)
        along = excitation.direction if columns is None else ", ".join(columns.by_direction)
        at = "the base" + (f" in {along}" if along else "")
    elif isinstance(excitation.applied_to, MovedSupport | MovedStop):
        at = excitation.applied_to.label
    else:
        at = load_site_in(scenario, excitation.applied_to).label
    return f", at {at}"


def _random(excitation: Any, input_values: Mapping[str, Any]) -> Iterator[str]:
    """Root mean square and band of a random input."""
    psd, unit = excitation.psd, amplitude_unit(excitation.quantity)
    if excitation.table or input_values:
        rms = input_values["rms"] if input_values else SpectralDensity.from_points(excitation.table).rms
        yield f"rms {amount(rms, unit)}"
    yield psd.file if isinstance(psd, CurveFile) else f"{psd[0].frequency:.6g} to {psd[-1].frequency:.6g} Hz"


def _record(excitation: Any, input_values: Mapping[str, Any]) -> Iterator[str]:
    """Peak and root mean square of a record, where it has been read."""
    sizes = ((name, input_values.get(name)) for name in ("peak", "rms"))
    yield from (f"{name} {amount(size, input_values['unit'])}" for name, size in sizes if is_known(size))
    yield excitation.file


def _pulse(excitation: Any, _: Mapping[str, Any]) -> Iterator[str]:
    """Duration of a pulse, and what it leaves."""
    if excitation.duration is not None:
        yield amount(excitation.duration, "s")
        if excitation.quantity in AREAS:
            of, unit = AREAS[excitation.quantity]
            yield f"{of} {amount(excitation.area, unit)}"


def _matched_text(excitation: Any, _: Mapping[str, Any]) -> Iterator[str]:
    """Largest level of the spectrum, and duration of the record."""
    if isinstance(excitation.srs, CurveFile):
        yield excitation.srs.file
    else:
        highest_hz, level = max(excitation.srs, key=lambda point: point[1])
        yield f"spectrum up to {amount(level, 'm/s^2')} at {highest_hz:.6g} Hz"
    yield amount(excitation.duration, "s")


def _swept_input(excitation: Any, input_values: Mapping[str, Any]) -> Iterator[str]:
    """Range and rate of a swept sine, and the cycles of a run."""
    yield f"{excitation.from_:.6g} to {excitation.to:.6g} Hz"
    low, high = sorted((excitation.from_, excitation.to))
    cycles = swept_cycles(low, high, excitation.rate, "")
    if "duration" in input_values:
        cycles = min(cycles, excitation.cycles_in(input_values["duration"]))
    yield f"{_rate_text(excitation.rate)}, {_cycles_text(cycles)}"


def _rate_text(rate: Rate) -> str:
    """How fast a sweep is: octaves in a minute; Hz in a second, or in a minute where it is slow."""
    slow = rate.unit != "Hz/s" or rate.value < 0.1
    return f"{60.0 * rate.value:.4g} {rate.unit.replace('/s', '/min')}" if slow else f"{rate.value:.4g} Hz/s"


def _cycles_text(cycles: float) -> str:
    """How many cycles a sweep has."""
    return count_text(round(cycles), "cycle") if cycles >= 1.0 else "less than 1 cycle"


_INPUTS = {
    "random": _random, "sampled": _record, "matched": _matched_text, "swept_sine": _swept_input,
    **dict.fromkeys(("step", "half_sine", "trapezoid", "sawtooth"), _pulse),
}  # fmt: skip
"""Text about an input in addition to its level, by its kind."""


def amplitude_text(excitation: Any, level: float) -> str:
    """A level in the unit of its quantity."""
    unit = LEVEL_DIMENSIONS[excitation.quantity].unit if excitation.quantity else ""
    return amount(level, unit)


def stop_text(name: str, stop: SnubberNumbers) -> str:
    """Name, stiffness, and gap or force at rest of a stop."""
    way, push = stop.gap_unit, stop.force_unit
    rest = f"gap {amount(stop.gap, way)}" if stop.gap > 0.0 else "just touching"
    if stop.gap < 0.0:
        rest = f"preload {amount(stop.preload, push)}" if stop.preload > 0.0 else f"prestress {amount(-stop.gap, way)}"
    return f"{name}: {amount(stop.stiffness, f'{push}/{way}')}, {rest}"


def level_or_kind(excitation: Any) -> str:
    """The level of an excitation with a single level, else its kind."""
    levels = [amplitude_text(excitation, level) for _, level in excitation.levels()]
    return levels[0] if len(levels) == 1 else str(excitation.kind).replace("_", " ")
