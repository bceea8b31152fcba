"""The channel of a file that is meant: by its name, or by where and what it measures; in SI units."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from beamsim.errors import InputFileError, Problem, ScenarioError
from beamsim.measurements.conditioning import clipping_warnings, condition, with_even_times
from beamsim.measurements.functions import RATIOS, FunctionType, is_unit_of
from beamsim.measurements.read import read_file
from beamsim.measurements.signal import MeasuredSignal, in_si, split_heading
from beamsim.scenario import Scenario, Source, scenario_of
from beamsim.scenario.base import closest_name
from beamsim.scenario.excitation import quantity_text
from beamsim.scenario.files import DecimalMark, RecordPreparation
from beamsim.scenario.identification import SteadyTest, TransientTest
from beamsim.scenario.quantities import level_unit, meant, motion_dimension

AXIS_UNIT = "axis_unit (--axis-unit)"  # where a user can give the unit of an axis


def read_tests(scenario: Source, folder: Path | str | None = None) -> list[MeasuredSignal]:
    """The signal of every test of ``identify_stiffness.nonlinear`` that is used and has a file, in SI units.

    A transient is not filtered yet: the part that is compared is, together with the motion.

    Parameters
    ----------
    scenario : with the tests, or what `beamsim.load_scenario` reads, such as the path of its file.
    folder : that paths are relative to; by default that of the scenario's file.

    Raises
    ------
    ScenarioError
        For every file that is missing or empty, has non-finite values or lacks the channel.

    Examples
    --------
    >>> import beamsim
    >>> tests = beamsim.read_tests("configs/identification/identify_nonlinear.yaml")
    >>> [(signal.name, signal.unit, signal.x.size) for signal in tests]
    [('tip (g)', 'm/s^2', 1500), ('tip (g)', 'm/s^2', 1500)]
    """
    scenario = scenario_of(scenario, "identify-stiffness")
    section = scenario.identify_stiffness
    if section is None or section.nonlinear is None:
        return []
    signals: list[MeasuredSignal] = []
    problems: list[Problem] = []
    default = scenario.effective_probes[0].name
    where = "identify_stiffness", "nonlinear", "tests"
    for index, test in section.nonlinear.tests_with_files.items():
        at = f"identify_stiffness.nonlinear.tests[{index}]"
        try:
            path = (scenario.folder_of(*where, index, "file") if folder is None else Path(folder)) / test.file
            name = test.channel or test.probe or default
            channels = read_signals(path, test.axis_unit, test.decimal)
            required = test.channel is not None
            signal = channel_named(channels, name, test.quantity, path, required=required, key=f"{at}.channel")
            signal = _usable_in(test, signal, scenario, f"{at}.level")
            _check_quantity(test, signal, at)
            signal = in_si(signal, test.unit, motion_dimension(test.quantity), f"{at}.unit")
            filtered_later = isinstance(test, TransientTest)  # with the motion, in the part that is compared
            how = RecordPreparation(factor=test.factor) if filtered_later else test
            signals.append(condition(signal, how))
        except InputFileError as fault:
            problems.append(Problem(f"{at}.file", f"= {test.file} {fault.message}", fault.remedy))
        except ScenarioError as error:
            problems += [
                p if p.path else Problem(f"{at}.file", f"= {test.file}: {p.message}", p.remedy) for p in error.problems
            ]
    if problems:
        raise scenario.located(ScenarioError(problems))
    return signals


NEAR = 0.05  # of the frequency: lines further away are other vibrations, and no noise of this one


def _check_quantity(test: SteadyTest | TransientTest, signal: MeasuredSignal, path: str) -> None:
    """Refuse a record of another quantity than the test states: another unit would make it that in name alone.

    Raises
    ------
    ScenarioError
    """
    own = motion_dimension(test.quantity)
    for unit in filter(None, (signal.unit, test.unit)):
        fits = [each for each in _MEASURED if is_unit_of(unit, motion_dimension(each))]
        if fits and motion_dimension(fits[0]) != own:
            message = f"= {test.quantity} does not fit {split_heading(signal.name)[0]}, which is in {unit}"
            raise ScenarioError.at(f"{path}.quantity", message, f"write quantity: {fits[0]}")


_MEASURED = ("absolute_acceleration", "displacement", "velocity")


def _usable_in(
    test: SteadyTest | TransientTest, signal: MeasuredSignal, scenario: Scenario, key: str
) -> MeasuredSignal:
    """The signal as a test takes it: of a frequency response the fundamental at the frequency and level of the test.

    Parameters
    ----------
    test, signal : the test, and its channel.
    scenario : whose excitation has the frequency, and the quantity of the level, that the test does not state.
    key : of the level of the test, for messages.

    Raises
    ------
    InputFileError
        If the channel is of a function type that the test does not take, or its level is not stated.
    """
    if test.kind == "transient":
        return signal.require((FunctionType.TIME_HISTORY,), "the test of a transient")
    if signal.function not in RATIOS:
        return signal.require((FunctionType.TIME_HISTORY, FunctionType.SPECTRUM), "the test of a steady vibration")
    if test.harmonics != 1:
        raise InputFileError(
            f"has {signal.function.with_article} in {signal.name}, which has no harmonics of a vibration",
            "give harmonics: 1 and the level of the test, or a time history or an amplitude spectrum",
        )
    excitation: Any = scenario.excitation
    quantity = meant(test.level) or excitation.quantity
    level = None if test.level is None else f"{float(test.level)!r} {level_unit(quantity)}"
    amplitude = signal.at_level(level, key)
    frequency = excitation.frequency if test.frequency is None else test.frequency
    near = np.abs(amplitude.x / frequency - 1.0) <= NEAR
    if np.count_nonzero(near) < 2:
        raise InputFileError(f"has no lines about {frequency:g} Hz in {signal.name}", "export it with finer lines")
    return replace(amplitude, x=amplitude.x[near], y=amplitude.y[near])


def read_signals(path: Path, axis_unit: str | None = None, decimal: DecimalMark | None = None) -> list[MeasuredSignal]:
    """All channels of a file that are on an axis, which is in s or Hz then.

    Parameters
    ----------
    path : of the file.
    axis_unit : of times or frequencies; by default the one that the file states.
    decimal : decimal mark of a text file, where the user states it.

    Returns
    -------
    list
        Values are in the units of the file.

    Raises
    ------
    ScenarioError
        If the file cannot be read, or has an axis without unit or no channel.
    """
    try:
        signals = [
            with_even_times(each).on_si_axis(axis_unit, AXIS_UNIT) for each in read_file(path, decimal) if each.axis
        ]
    except InputFileError as fault:
        raise measurement_error(f"{path} {fault.message}", fault.remedy) from None
    if not signals:
        raise measurement_error(
            f"{path} contains no signal", "it needs a time or frequency axis and at least one channel"
        )
    return signals


def channel_named(
    signals: Sequence[MeasuredSignal],
    name: str,
    quantity: str,
    path: Path,
    *,
    required: bool = False,
    key: str = "",
) -> MeasuredSignal:
    """The channel of that name, which may leave out the unit; else that of probe and quantity, or the only one.

    Parameters
    ----------
    signals : channels of the file.
    name : of the channel, or of the probe where it was measured.
    quantity : that is measured.
    path : of the file, for messages.
    required : whether the name is that of a channel, so that no other will do.
    key : key of the scenario that names it, for messages.

    Returns
    -------
    MeasuredSignal

    Raises
    ------
    ScenarioError
        If no channel or several match, or values are not finite.
    """
    words = quantity_text(quantity)
    exact = [s for s in signals if name in (s.name, split_heading(s.name)[0])]
    named = [s for s in signals if contains_word(s.name, name)]
    loose = [s for s in named if _is_of(s.name, words)]
    if not loose and quantity == "absolute_acceleration":  # accelerometers know no other
        loose = [s for s in named if _is_of(s.name, "acceleration")]
    loose = exact or loose or ([] if required else named)
    histories = [s for s in loose if not s.is_over_frequency] or loose
    chosen = histories or ([] if required or len(signals) > 1 else list(signals))
    if len(chosen) > 1 and all(_same(chosen[0], other) for other in chosen[1:]):
        chosen = chosen[:1]
    if len(chosen) != 1:
        names = [s.name for s in signals]
        close = closest_name(name, names)
        listed = ", ".join(names[:12]) + (", ..." if len(names) > 12 else "")
        verdict = "has no channel" if not chosen else f"has {len(chosen)} channels that could be"
        remedy = f"did you mean {close}?" if close and not chosen else f"name one: {listed}"
        raise ScenarioError.at(key, f"{path} {verdict} {name} {words}", remedy)
    return _refuse_unusable_samples(chosen[0], path)


def history_named(
    path: Path, name: str, axis_unit: str | None = None, decimal: DecimalMark | None = None
) -> MeasuredSignal:
    """The time history of that name.

    Parameters
    ----------
    path : of the file.
    name : of the channel.
    axis_unit : of its times; by default the one that the file states.
    decimal : decimal mark of a text file, where the user states it.

    Returns
    -------
    MeasuredSignal
        Over times in s, in the unit of the file.

    Raises
    ------
    ScenarioError
        If the file cannot be used, there is none, or the channel is a function of frequency.
    """
    signal = channel_named(read_signals(path, axis_unit, decimal), name, "", path, required=True)
    try:
        return signal.require((FunctionType.TIME_HISTORY,), "the excitation of a tracked sweep")
    except InputFileError as fault:
        raise measurement_error(f"{path} {fault.message}", fault.remedy) from None


def _refuse_unusable_samples(signal: MeasuredSignal, path: Path) -> MeasuredSignal:
    if signal.x.size < 2:
        raise measurement_error(f"{path}: {signal.name} has {signal.x.size} samples", "export the whole signal")
    try:
        checked = signal.check()
    except InputFileError as fault:
        raise measurement_error(f"{path}: {signal.name} {fault.message}", fault.remedy) from None
    return replace(checked, warnings=(*checked.warnings, *clipping_warnings(checked)))


def _same(a: MeasuredSignal, b: MeasuredSignal) -> bool:
    return np.array_equal(a.x, b.x) and np.array_equal(a.y, b.y)


def contains_word(name: str, word: str) -> bool:
    """Whether a channel's name holds a word."""
    return bool(
        re.search(
            rf"(?<![a-z0-9]){re.escape(word.lower().replace('_', ' '))}(?![a-z0-9])", name.lower().replace("_", " ")
        )
    )


def _is_of(name: str, quantity: str) -> bool:
    text = name.lower().replace("_", " ")
    other = {"displacement": "absolute displacement", "acceleration": "relative acceleration"}.get(quantity)
    return quantity in text and (other is None or other not in text)


def demand_amplitudes(signals: Iterable[MeasuredSignal], purpose: str) -> None:
    """Refuse signals that are neither time histories nor amplitude spectra.

    Parameters
    ----------
    signals : in SI units; frequency responses at a level are amplitude spectra.
    purpose : what needs them, for the message.

    Raises
    ------
    ScenarioError
        About the first that is of another function type.
    """
    for signal in signals:
        try:
            signal.require((FunctionType.TIME_HISTORY, FunctionType.SPECTRUM), purpose)
        except InputFileError as fault:
            raise measurement_error(f"{signal.source or 'a signal'} {fault.message}", fault.remedy) from None


def measurement_error(message: str, remedy: str) -> ScenarioError:
    """A fault of a measurement, or of what is asked of it, that no key of the scenario names."""
    return ScenarioError.at("", message, remedy)
