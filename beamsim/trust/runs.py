"""Runs, as the command and the package call them: with the sensitivity of their values to model and disturbances.

A run is computed again with a finer model unless that is switched off.

Motions that bounce on and on may be so sensitive that the sequences of contacts diverge although both models are good.
Up to there the values are compared as they are. What comes after is compared statistically if the excitation goes on:
each value is taken in `WINDOWS` equal parts of the rest, and the change is that of its mean; it is doubtful if it
exceeds the scatter of the differences too. Where small disturbances of the stiffness leave the contacts as they are,
only the models differ, and their whole motions are compared.

After the sequences have diverged the motion is one of many. Values that what follows can change are marked, even where
a finer model happens to give the same number: shares and means, and extremes that are not above everything that follows
by more than its own spread. Small disturbances of the stiffness say whether the motion is that sensitive or only the
models differ.

Root mean squares and lines of the spectra, and the statistics of a stationary response, are found again in the
other motion. Crest factor, kurtosis and shares of peaks are those of a record: they are doubtful where they change by
more than other records of the same length would change them, too.
"""

from __future__ import annotations

import time as clock
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from beamsim.analyses.run.analysis import Solution, motion_of, solve_run
from beamsim.analyses.run.motion import MOTION_ALONE, TIME_SHARES, RunMotion, motion_in_chunks, output_times
from beamsim.analyses.run.random_response import sampling_errors, statistics_of
from beamsim.analyses.run.result import MAIN_QUANTITY, STATISTICS, RunResult, highest_of_srs, srs_over_limit
from beamsim.analyses.run.shock_response import shock_response
from beamsim.analyses.run.spectra import is_at_rest, lines_of_record, records_of
from beamsim.analyses.run.summary import (
    STATIC_ENTRIES,
    spectral_lines,
    values_of_motion,
    values_of_part,
)
from beamsim.errors import ScenarioError
from beamsim.flow.channels import channel_extrema, channel_values, outputs_of
from beamsim.flow.compiled import processor_time
from beamsim.flow.trajectory import Trajectory
from beamsim.labelled import Dataset
from beamsim.outcomes import Interrupted, Progress, Stop, check_stop, never, part_of, report_progress, stop_requests
from beamsim.responses.gapping import finite, gapping_of_sine, gapping_ratios
from beamsim.responses.histories import Histories
from beamsim.responses.jumps import peaks_after_jumps
from beamsim.results.values import ACCELERATION, DISPLACEMENT, FORCE, LIMITED, extreme_times, searched_channels
from beamsim.scenario import Source, scenario_of
from beamsim.scenario.run import OrbitStart, Run
from beamsim.scenario.units import STANDARD_GRAVITY
from beamsim.signals.filters import FilteredMotion, filter_outputs
from beamsim.signals.lines import WORTH_LISTING, bins_around
from beamsim.signals.records import LOBE, MotionRecord, SampledRecord, SpectrumRecord
from beamsim.system.build import build_system
from beamsim.system.equations import ChannelSet
from beamsim.system.reduced_model import SharedBuilds
from beamsim.system.structural import StructuralSystem
from beamsim.trust.convergence import (
    COMPARISON,
    LONGER,
    NOT_ASKED,
    Changes,
    ContactEvents,
    Convergence,
    DivergenceTimes,
    Errors,
    Values,
    comparable_values,
    divergence,
    errors_of,
    exact,
    finer_case,
    keeps_all,
    largest_changes,
    numbers_by_place,
    places,
    relative_changes,
    sensitivity,
    unconverged_values,
    with_convergence,
)
from beamsim.typing import Floats, not_none, of_kind

WINDOWS = 8  # parts of the motion after the sequences have diverged
COUNTED = ("contact_share", "contacts")  # of the whole motion; all other values of motions are extremes
SAME_VALUE = 1e-6  # relative: an extreme of a part of the motion is that of the whole
HIGHER = 1.1  # largest ratio of the frequencies of one line in two models
FEWEST_PERIODS = 8  # of the excitation, in a part whose lines are compared
RMS_OF_PROBES = (
    ("rms_displacement_m", "displacement", 1.0), ("rms_acceleration_g", MAIN_QUANTITY, STANDARD_GRAVITY)
)  # fmt: skip
"""Entries of root mean squares, the quantity of each, and its unit."""


@dataclass(frozen=True)
class Model:
    """A model of a case with its motion."""

    motion: RunMotion

    @property
    def settings(self) -> Run:
        """Of the run."""
        return not_none(self.motion.system.scenario.run)

    @cached_property
    def values(self) -> Values:
        """Values of the whole motion and of the model; without the frequencies of static vectors."""
        values, modes = values_of_motion(self.motion), self.motion.system.kept_modes
        return comparable_values({name: x[:modes] if isinstance(x, Sequence) else x for name, x in values.items()})

    @cached_property
    def events(self) -> ContactEvents:
        """Contact events of the snubbers; with smooth laws, whose segments differ in a finer model, only touches."""
        motion, scenario = self.motion.source_motion, self.motion.system.scenario
        events = ContactEvents.of(motion, len(self.motion.system.snubbers))
        return events.of_touching(motion) if scenario.has_force_tables and scenario.has_smooth_laws else events

    @cached_property
    def _filtered_motion(self) -> FilteredMotion | None:
        """Low-pass filtered accelerations of the run, at any time; None without a filter."""
        if self.settings.low_pass is None or self.motion.trajectory is None:
            return None
        acceleration = outputs_of(self.motion.trajectory.flow, self.motion.system.channels.of_keys(ACCELERATION).linear)
        return filter_outputs(self.motion.trajectory, acceleration, self.settings.low_pass, np.zeros(0))

    def values_between(self, begin: float, end: float) -> Values:
        """The values of a part of a motion in closed form, and of the model itself.

        Extremes are those of the continuous motion: the short force peak of a dashpot or a stiff stop lies between
        samples, so that chance would decide which part includes it.
        """
        trajectory, system, behind = not_none(self.motion.trajectory), self.motion.system, self._filtered_motion
        part, channels = trajectory.extract(begin, end), searched_channels(system.channels)
        channels = channels if behind is None else channels.without(ACCELERATION)
        extremes = channels.split(np.array(channel_extrema(part, channels)[:4]))
        if behind is not None:
            extremes[ACCELERATION] = np.array(behind.extremes(begin, end))
        inside = (trajectory.touch_changes > 0) & (trajectory.event_time >= begin) & (trajectory.event_time < part.end)
        closings = np.bincount(trajectory.event_contact[inside], minlength=part.flow.system.contacts.count)
        states = trajectory.states_at(np.sort(extreme_times(extremes)))
        return comparable_values(values_of_part(system, extremes, part.contact_share(), closings, states))

    def windows(self, begin: float, end: float) -> list[Values]:
        """The values of equal parts of the motion."""
        return [self.values_between(*edges) for edges in pairwise(np.linspace(begin, end, WINDOWS + 1).tolist())]

    def values_until(self, end: float) -> Values:
        """The values of the motion up to a time; shares are those of the whole motion's time."""
        values = self.values_between(0.0, end)
        shares = of_kind(dict, values["contact_share"])
        return {**values, "contact_share": {name: share * end / self.events.end for name, share in shares.items()}}

    def events_when_disturbed(self, share: float, end: float) -> ContactEvents:
        """Events of the motion with the stiffness changed by a share of itself, up to a time."""
        undisturbed = self.motion.system
        dynamics = replace(undisturbed.dynamics, stiffness=(1.0 + share) * undisturbed.dynamics.stiffness)
        system, settings = replace(undisturbed, dynamics=dynamics), self.settings.model_copy(update={"duration": end})
        most = 4 * self.motion.work.events + 1000
        motion, _ = motion_in_chunks(system, settings, most_events=most)
        for _ in motion.chunks():
            pass
        return ContactEvents.of(motion, len(system.snubbers))


def run(
    scenario: Source, progress: Progress = None, stop: Stop = never, *, entries: Collection[str] | None = None,
    builds: SharedBuilds | None = None,
) -> RunResult:  # fmt: skip
    """Simulate a scenario, and compare its values with those of a finer model unless ``run.convergence: off``.

    Parameters
    ----------
    scenario : with a ``run`` section, or what `beamsim.load_scenario` reads, such as the path of its file.
    progress : called from time to time with the approximate completed fraction.
    stop : called between blocks of events, and then before each evaluation of the motion; returns whether to end. The
        result then holds the motion up to there with its peaks, energies and histories, and names what is left out.
    entries : of the summary that are needed, by default all. Without a comparison nothing else is computed, and
        histories, spectra and shapes are empty; outcome, warnings and margins are the same.
    builds : keeps matrices that runs of other cases have in common with this one.

    Returns
    -------
    RunResult
        With ``convergence`` and ``doubtful`` in its summary.

    Raises
    ------
    ScenarioError
        Where the scenario cannot be run (no ``run`` section, no static equilibrium to start from, ...).

    Examples
    --------
    >>> import beamsim
    >>> result = beamsim.run("configs/stops/chain_bumpers.yaml")
    >>> result["histories"]["displacement"].dims, round(result.summary["peak_force_n"]["cable"], 2)
    (('probe', 'time'), 36.14)
    """
    scenario = scenario_of(scenario, "run")
    begin, builds = clock.perf_counter(), builds or SharedBuilds()
    alone = scenario.run is not None and scenario.run.convergence == "off"
    share = 1.0 if alone else TIME_SHARES[scenario.excitation.stationary].own_model
    solution = solve_run(scenario, part_of(progress, 0.0, share), stop, builds, entries if alone else None)
    report_progress(progress, share)
    if alone:
        return with_convergence(solution.result, Convergence(reason=NOT_ASKED))
    result = solution.result
    if not solution.motion.outcome.complete or result.outcome.interrupted:
        return result
    compare = convergence_of if solution.motion.compared_s is None else _of_first_part
    checked: Convergence | None = None
    with suppress(Interrupted), stop_requests(stop, at_once=True):
        check_stop()
        checked = compare(solution, builds, part_of(progress, share, 1.0))
    report_progress(progress, 1.0)
    if checked is None:
        result = result.interrupted(COMPARISON)
    else:
        limited = [value.entry for value in LIMITED.values() if value.entry in result.summary]
        result = with_convergence(result, checked, comparable_values({of: result.summary[of] for of in limited}))
        if checked.lines is not None:
            spectra = result["spectra"].assign(line_error=checked.lines)
            summary = {**result.summary, "spectral_lines": spectral_lines(spectra)}
            result = replace(result, datasets={**result.datasets, "spectra": spectra}, summary=summary)
    return replace(result, wall_time_s=clock.perf_counter() - begin)


def convergence_of(solution: Solution, builds: SharedBuilds, progress: Progress = None) -> Convergence:
    """The errors of a run's values, from a finer model.

    Parameters
    ----------
    solution : the run.
    builds : matrices of its system, which a finer model may share.
    progress : called from time to time with the fraction that is about done.

    Returns
    -------
    Convergence
    """
    begin, scenario = processor_time(), solution.result.scenario
    settings = not_none(scenario.run)
    first, derived = Model(solution.motion), DerivedValues(solution.result)
    if keeps_all(first.motion.system.modes) and not (scenario.rings or scenario.has_smooth_laws):
        errors, lines = _with_lines(derived, exact(first.values | derived.reported_values()))
        checked = _with_disturbance(Convergence(errors, lines=lines), first, derived)
    elif isinstance(settings.start, OrbitStart):
        reason = "the run starts from a state of this model, which a finer model does not have"
        checked = _with_disturbance(Convergence(reason=reason), first, derived)
    else:
        most = min(settings.max_events, 4 * first.motion.work.events + 1000)
        again = settings.model_copy(update={"max_events": most, "method": "exact"})
        try:
            case = finer_case(scenario, first.motion.system.modes)
            motion = motion_of(build_system(case, builds), again, output_times(case), progress, never, MOTION_ALONE)
        except ScenarioError as error:
            checked = Convergence(reason="; ".join(problem.message for problem in error.problems))
        else:
            checked = _errors_of_models(first, Model(motion), derived)
    return replace(checked, processor_time_s=processor_time() - begin)


def _errors_of_models(first: Model, second: Model, derived: DerivedValues) -> Convergence:
    """The errors of a run, from a finer model.

    Parameters
    ----------
    first, second : the models, the second one finer.
    derived : spectra and statistics of the first.
    """
    diverged, end = divergence(first.events, second.events), min(first.events.end, second.events.end)
    times, after, statistical = DivergenceTimes(), tuple[str, ...](), None
    if diverged < end:
        times, after, statistical = _compared_after_divergence(first, second, derived, (diverged, end))
    if statistical is not None:
        changes, scatter = statistical
    else:
        changes = relative_changes([first.values], [second.values])
        changes |= relative_changes([derived.reported_values()], derived.values_of_model(second))
        scatter = {} if "random" not in derived.result.datasets else derived.scatter()
    scenario, kept = second.motion.system.scenario, second.motion.system.kept_modes
    # the modes dataset of the second would take long
    complete = keeps_all(first.motion.system.modes, kept) and not scenario.has_smooth_laws
    errors, lines = _with_lines(derived, errors_of(changes, scenario, complete))
    if not complete:
        _demand_least(errors, first)
    for entry, quantity, _ in RMS_OF_PROBES:
        if isinstance(of_probes := errors.get(entry), dict):
            errors[entry] = {
                name: x for name, x in of_probes.items() if not is_at_rest(name, quantity, derived.result.summary)
            }
    off = tuple(unconverged_values(errors, errors_of(scatter, scenario, complete)))
    return Convergence(errors, off, kept, first.motion.system.kept_modes, diverged, after, times, lines=lines)


def _demand_least(errors: Errors, model: Model) -> None:
    """Raise the errors of peak accelerations to their distance from the exact limits just after a force jumps."""
    motion = model.motion.trajectory
    if motion is None:
        return
    for channel, limit in peaks_after_jumps(model.motion.system, motion, model.motion.jumps):
        of_probe = channel.key == ACCELERATION
        entry, unit = ("peak_acceleration_g", STANDARD_GRAVITY) if of_probe else ("peak_output", 1.0)
        of_entry = errors.get(entry)
        if isinstance(of_entry, dict) and channel.name in of_entry and not (of_probe and model.settings.low_pass):
            value = unit * of_kind(dict, model.values[entry])[channel.name]
            of_entry[channel.name] = max(of_entry[channel.name], 1.0 - value / max(limit, value))


def _compared_after_divergence(
    first: Model, second: Model, derived: DerivedValues, interval: tuple[float, float]
) -> tuple[DivergenceTimes, tuple[str, ...], tuple[Changes, Changes] | None]:
    """Compare two motions whose contact sequences diverge: before and, by statistics, after the divergence.

    Parameters
    ----------
    first, second, derived : as of `_errors_of_models`.
    interval : s, from the divergence to the end of the shorter motion.

    Returns
    -------
    times, after : when disturbances diverge, and ``entry.place`` of the values that depend on the motion after that.
    changes, scatter : of the values before, and of means of those after; None where nothing is stationary.
    """
    if first.motion.trajectory is None:
        return DivergenceTimes(), tuple(_diverging_values(first, None, (), derived)), None
    times = sensitivity(first.events, interval[0], first.events_when_disturbed)
    if not times.sensitive:  # only the models differ: compare the whole motions
        return times, (), None
    early, windows = first.values_until(interval[0]), first.windows(*interval)
    after = tuple(_diverging_values(first, early, windows, derived))
    if not first.motion.system.scenario.is_lasting or second.motion.trajectory is None:
        return times, after, None
    later, parts = second.windows(*interval), derived.parts(WINDOWS)
    before = relative_changes([early], [second.values_until(interval[0])], reference=first.values)
    changes = largest_changes(before, relative_changes(windows, later))
    scatter = relative_changes(windows, later, scatter=True)
    one, other = (derived.values_of_model(model, parts) for model in (first, second))
    changes |= relative_changes(one, other)
    if parts > 1:
        scatter |= _with_lines(derived, relative_changes(one, other, scatter=True))[0]
    return times, after, (changes, scatter)


def _with_disturbance(convergence: Convergence, first: Model, derived: DerivedValues) -> Convergence:
    """Add whether a small disturbance of the stiffness gives other contacts; this needs no finer model.

    Parameters
    ----------
    convergence : errors without this information.
    first, derived : as of `_errors_of_models`.
    """
    if first.motion.trajectory is None or first.events.time.size == 0:
        return convergence
    times = sensitivity(first.events, first.events.end / LONGER, first.events_when_disturbed)
    if not times.sensitive:
        return convergence
    windows = first.windows(times.small_change_s, first.events.end)
    after = tuple(_diverging_values(first, first.values_until(times.small_change_s), windows, derived))
    return replace(convergence, diverged_s=times.small_change_s, after_divergence=after, sensitivity=times)


def _of_first_part(solution: Solution, builds: SharedBuilds, progress: Progress) -> Convergence:
    """The errors of a motion that does not fit into the memory, from its first part.

    A disturbance is followed over the whole motion. If the contact sequences diverge, all values depend on the long
    motion after that, which reaches higher extremes by chance.

    Parameters
    ----------
    solution, builds, progress : as of `convergence_of`.
    """
    scenario, compared_s = solution.result.scenario, not_none(solution.motion.compared_s)
    settings = not_none(scenario.run)
    same = scenario.excitation.model_copy(
        update={"period": getattr(scenario.excitation, "period", None) or settings.duration}
    )
    shorter = settings.model_copy(update={"duration": compared_s})
    share = TIME_SHARES[scenario.excitation.stationary].own_model
    shorter_scenario = scenario.model_copy(update={"excitation": same, "run": shorter})
    part = solve_run(shorter_scenario, part_of(progress, 0.0, share), never, builds)
    if not part.motion.outcome.complete:
        return Convergence(reason=part.motion.outcome.text)
    datasets = {name: of for name, of in part.result.datasets.items() if name not in ("random", "srs")}
    part = part._replace(result=replace(part.result, datasets=datasets))
    checked = convergence_of(part, builds, part_of(progress, share, 1.0))
    checked = replace(checked, compared_s=compared_s, lines=None)
    whole, times = Model(solution.motion), checked.sensitivity
    if not times.sensitive:
        times = sensitivity(whole.events, compared_s, whole.events_when_disturbed)
    if not times.sensitive:
        return replace(checked, after_divergence=())
    moving = {name: x for name, x in whole.values.items() if name not in STATIC_ENTRIES}
    after = tuple(key for key, _ in numbers_by_place(moving))
    return replace(
        checked, diverged_s=min(checked.diverged_s, times.small_change_s), after_divergence=after, sensitivity=times
    )


def _diverging_values(
    first: Model, values_before: Values | None, windows: Sequence[Values], derived: DerivedValues
) -> Iterator[str]:
    """``entry.place`` of the values that the motion after the divergence can change.

    Parameters
    ----------
    first : the model of the run.
    values_before : values of the motion before the divergence; None if unknown.
    windows : those of equal parts of the motion after; an extreme before has to exceed them by their spread.
    derived : spectra and statistics.
    """
    of_parts = [] if values_before is None else [dict(numbers_by_place(values)) for values in (values_before, *windows)]
    for key, whole in numbers_by_place({name: x for name, x in first.values.items() if name not in STATIC_ENTRIES}):
        if of_parts:
            before, *later = (values[key] for values in of_parts)
            sign = -1.0 if key.startswith("min_") else 1.0
            highest, lowest = max(sign * x for x in later), min(sign * x for x in later)
            exceeded = not key.startswith(COUNTED) and 2.0 * highest - lowest > sign * whole
            if not exceeded and abs(whole - before) <= SAME_VALUE * max(abs(whole), abs(before)):
                continue
        yield key
    yield from (f"spectral_lines.{signal}" for signal in derived.lines)
    yield from (key for key, _ in numbers_by_place(derived.reported_values()) if not key.startswith("line_"))


def _with_lines(derived: DerivedValues, errors: Errors) -> tuple[Errors, Floats | None]:
    """The errors with the largest of the lines of each spectrum, over its strongest line, and those of each line.

    The error of a line is that of its amplitude, or of its frequency if that is larger. A line at the frequency of a
    static vector is no property of the structure, and has none (nan); neither has a mean below the least amplitude
    of the other lines, which may be leakage, nor a line of an output.
    """
    errors = dict(errors)
    amplitudes, frequencies = (dict(places(errors.pop(f"line_{of}", {}))) for of in ("amplitude", "frequency"))
    if not derived.lines:
        return {**errors, "spectral_lines": {}}, None
    of_lines, largest = np.full(derived.result["spectra"]["line"].values.size, np.nan), dict[str, float]()
    for signal, lines in derived.lines.items():
        names, physical = derived.places(signal), lines["line_kind"].values != "residual"
        sizes = lines["line_amplitude"].values * physical
        if not sizes.any():
            continue
        amplitude = np.array([amplitudes.get(name, np.nan) for name in names])
        both = np.maximum(amplitude, [frequencies.get(name, 0.0) for name in names])
        shown = physical & (sizes >= np.where(lines["line_kind"].values == "mean", WORTH_LISTING * sizes.max(), 0.0))
        of_lines[lines["line"].values - 1] = np.where(shown, both, np.nan)
        largest[signal] = float(np.nanmax(np.where(physical, amplitude, 0.0) * sizes) / sizes.max())
    return {**errors, "spectral_lines": largest}, of_lines


@dataclass(frozen=True)
class DerivedValues:
    """The spectra of probes and the statistics of a run, and the same values of the motions of other models.

    Parameters
    ----------
    result : of the run.
    """

    result: RunResult

    @cached_property
    def lines(self) -> dict[str, Dataset]:
        """The spectra of probes by signal, each with its lines alone."""
        spectra, probes = self.result.datasets.get("spectra"), set(self.result["histories"].labels("probe"))
        if spectra is None:
            return {}
        of_signals = zip(spectra.groups("line_signal").items(), spectra["name"].values.tolist(), strict=True)
        return {signal: lines.sel(signal=signal) for (signal, lines), name in of_signals if name in probes}

    def places(self, signal: str) -> list[str]:
        """Names of the lines of a signal in the changes, the mean first."""
        return [f"{signal} {k}" for k in range(self.lines[signal]["line"].values.size)]

    def reported_values(self) -> Values:
        """The values of the result."""
        figures = self._of_spectra(
            {
                signal: (of["line_frequency_hz"].values, of["line_amplitude"].values, of["rms"].item())
                for signal, of in self.lines.items()
            }
        )
        if "random" in self.result.datasets:
            signals = self.result["random"].rows("signal")[1:]
            figures["random"] = {f"{of['signal']} {key}": of[key] for of in signals for key in STATISTICS}
        if (srs := self.result.datasets.get("srs")) is not None:
            figures |= _of_shock(srs)
        return figures | {"gapping_ratio": finite(self.result.summary.get("gapping_ratio", {}))}

    def scatter(self) -> Changes:
        """Scatter between records of statistics of the response that depend on few peaks."""
        signals = self.result["random"].rows("signal")[1:]
        return {"random": {f"{of['signal']} {key}": x for of in signals for key, x in sampling_errors(of).items()}}

    def values_of_model(self, model: Model, count: int = 1) -> list[Values]:
        """The values of another model's motion.

        Parameters
        ----------
        model : whose motion is in closed form, or known at its output times.
        count : number of equal parts of what is analysed; 1 for histories.

        Returns
        -------
        list of Values
            One for each part.
        """
        system, motion = model.motion.system, model.motion.available_motion
        of_parts = [
            self._of_spectra(
                {name: (*lines_of_record(of[name], lines), of[name].rms()) for name, lines in self.lines.items()}
            )
            for of in self._records(system, motion, count)
        ]
        if self.result.datasets.keys() & {"random", "srs"}:
            self._add_statistics(of_parts, system, motion)
        known = self.result.summary.get("gapping_ratio")
        ratios = finite(gapping_ratios(gapping_of_sine(system))) if known else {}
        return [{**figures, "gapping_ratio": ratios} for figures in of_parts]

    def _add_statistics(
        self, part_values: list[Values], system: StructuralSystem, motion: Trajectory | Histories
    ) -> None:  # fmt: skip
        """Add statistics of random responses, of each part, and the peaks of shock spectra, of all alike."""
        if "random" in self.result.datasets:
            for values, statistics in zip(part_values, self._statistics(system, motion, len(part_values)), strict=True):
                values["random"] = statistics
        if "srs" in self.result.datasets:
            shock = _of_shock(shock_response(system, motion))
            for values in part_values:
                values |= shock

    def parts(self, largest: int) -> int:
        """Largest number of equal parts of a motion that are long enough for the lines of a spectrum."""
        spectra = self.result["spectra"] if self.lines else None
        periods = np.nan if spectra is None else spectra["duration_s"].item() * spectra["excitation_hz"].item()
        return min(largest, max(int(periods / FEWEST_PERIODS), 1)) if np.isfinite(periods) else largest

    def _records(
        self, system: StructuralSystem, motion: Trajectory | Histories, count: int
    ) -> list[dict[str, SpectrumRecord]]:
        """Records of the signals of probes in equal parts of what is analysed."""
        if not self.lines:
            return [{} for _ in range(count)]
        spectra, channels = self.result["spectra"], system.channels.of_keys(ACCELERATION, DISPLACEMENT)
        signals, start_s = [f"{of.name} {of.quantity}" for of in channels.channels], spectra["start_s"].item()
        if isinstance(motion, Histories):
            return [dict(zip(signals, _sampled_records(motion, start_s, channels), strict=True))]
        span = start_s, min(start_s + spectra["duration_s"].item(), motion.end)
        highest = max(float(spectra[name].values.max(initial=0.0)) for name in ("frequency_hz", "line_frequency_hz"))
        if "decaying" not in spectra["window"].values:  # that window needs an octave on either side of a line
            part_s, line_hz = (span[1] - span[0]) / count, float(spectra["line_frequency_hz"].values.max(initial=0.0))
            around = 2 * LOBE + bins_around(part_s, spectra["excitation_hz"].item())
            highest = min(highest, HIGHER * line_hz + around / part_s)
        records = records_of(system, motion, channels, span, highest)
        divided = [records] if count == 1 else [
            [MotionRecord(part, r.column, r.highest_hz, r.size // count) for r in records]
            for part in records[0].part.equal_parts(count)
        ]  # fmt: skip
        return [dict(zip(signals, pieces, strict=True)) for pieces in divided]

    def _of_spectra(self, spectra: Mapping[str, tuple[Floats, Floats, float]]) -> Values:
        """Values from frequencies and amplitudes of lines and the root mean square, by signal."""
        values: Values = {
            f"line_{name}": {
                place: float(x)
                for signal, columns in spectra.items()
                for place, x in zip(self.places(signal), columns[:2][k], strict=True)
            }
            for k, name in enumerate(("frequency", "amplitude"))
        }
        for entry, quantity, unit in RMS_OF_PROBES:
            values[entry] = {
                signal.removesuffix(f" {quantity}"): rms / unit
                for signal, (_, _, rms) in spectra.items()
                if signal.endswith(f" {quantity}")
            }
        return values

    def _statistics(
        self, system: StructuralSystem, motion: Trajectory | Histories, count: int
    ) -> Iterator[dict[str, float]]:
        channels = system.channels.of_keys(ACCELERATION, DISPLACEMENT, FORCE)
        if isinstance(motion, Histories):
            times, values = motion.time, np.hstack([motion.of(key) for key in (ACCELERATION, DISPLACEMENT, FORCE)])
        else:
            times = self.result["histories"]["time"].values
            times = times[times <= motion.end]
            values = channel_values(motion, channels, times)
        after = times >= self.result["random"]["start_s"].item()
        rate = (times.size - 1) / float(times[-1] - times[0])
        names = (f"{channel.name} {channel.quantity}" for channel in channels.channels)
        signals = dict(zip(names, values[after].T, strict=True))
        divided = {name: np.array_split(x, count) for name, x in signals.items()}
        for k in range(count):
            statistics = {name: statistics_of(pieces[k], rate) for name, pieces in divided.items()}
            yield {f"{name} {key}": values[key] for name, values in statistics.items() for key in STATISTICS}


def _sampled_records(motion: Histories, start_s: float, channels: ChannelSet) -> list[SampledRecord]:
    """The records of channels from a time on, s."""
    inside = motion.time >= start_s * (1 - 1e-12)
    rate = (motion.time.size - 1) / float(motion.time[-1] - motion.time[0])
    samples = np.hstack([motion.of(key)[inside] for key in channels.places])
    return [SampledRecord(motion.time[inside], x, rate) for x in samples.T]


def _of_shock(srs: Dataset) -> Values:
    """The highest point of each spectrum, and the largest ratio of those that have limits to these."""
    values: Values = {"srs": {name: point["maximax_g"] for name, point in highest_of_srs(srs).items()}}
    if over := srs_over_limit(srs):
        values["srs_over_limit"] = {name: ratio for name, (ratio, _) in over.items()}
    return values
