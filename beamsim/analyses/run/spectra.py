"""Single-sided spectra of time histories and of motions in closed form, and the table of their lines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from beamsim.analyses.run.layouts import SPECTRA
from beamsim.analyses.run.motion import RunMotion
from beamsim.analyses.run.result import ALLOWED_REMAINDER, MAIN_QUANTITY
from beamsim.flow.channels import MotionPart, outputs_of
from beamsim.flow.extrema import Extrema
from beamsim.flow.trajectory import Trajectory
from beamsim.labelled import Dataset
from beamsim.outcomes import check_stop
from beamsim.responses.histories import Histories
from beamsim.results.values import ACCELERATION, DISPLACEMENT
from beamsim.scenario import Scenario
from beamsim.scenario.run import MOST_FREQUENCIES, SpectrumSettings
from beamsim.signals.lines import ROUND_OFF, LineFit, SpectralLine, lines_of, view_of
from beamsim.signals.records import (
    LOBE,
    Levels,
    MotionRecord,
    Remainder,
    SpectrumRecord,
    Window,
    amplitude_db,
    analysed_duration,
    sampled_records,
)
from beamsim.system.equations import ChannelSet
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, Ints, not_none

SAMPLES_OF_A_PERIOD = 2.56  # of the highest frequency: as many as would cover a curve
HIGHEST_ORDER = 12.5  # of the excitation frequency that is shown at least
MANY_PIECES = 8  # of the inputs: more are those of a sampled signal
FLOOR_LINES = 16  # beyond the highest content: a line is recognised by its neighbours
FEWEST_SAMPLES = 256
DECAYED = 0.25  # rms of the last quarter of a free motion over that of the first, below which it decays
LASTING = 0.8  # the same after a shock, from which on the motion lasts, as stick and slip on a belt that was started
NEARBY, NEARBY_BINS = 0.01, 3.0  # share of its frequency, and bins, within which a line is found again


def spectral(system: StructuralSystem) -> ChannelSet:
    """The channels of which there are spectra: of probes and of the outputs that are no energies."""
    outputs = (c.key for c in system.channels.channels if c.section == "outputs" and not c.squared)
    return system.channels.of_keys(ACCELERATION, DISPLACEMENT, *dict.fromkeys(outputs))


def is_at_rest(name: str, quantity: str, values: Mapping[str, Any]) -> bool:
    """Whether a quantity of a probe is 0 but for round-off, of which lines and root mean squares say nothing.

    Parameters
    ----------
    name, quantity : as a spectrum names them.
    values : values of the motion or the summary, in which such a peak is 0.

    Returns
    -------
    False of other quantities than displacement, absolute acceleration and those of outputs.
    """
    peak = {"displacement": "peak_displacement_m", MAIN_QUANTITY: "peak_acceleration_g"}.get(quantity, "peak_output")
    return bool(values.get(peak, {}).get(name) == 0.0)


class Label(NamedTuple):
    """Signal to which a spectrum belongs."""

    name: str  # of the probe or output
    quantity: str
    unit: str

    @property
    def signal(self) -> str:
        """Name and quantity."""
        return f"{self.name} {self.quantity}"


def spectra_of(motion: RunMotion, values: Mapping[str, Any]) -> Dataset | None:
    """Spectra of every probe and output, whatever the output rate; of a time-stepped motion those of its samples.

    Parameters
    ----------
    motion : of which the last part is looked at; its scenario says what is asked for.
    values : values of the motion; what rests by them has no lines.

    Returns
    -------
    `SPECTRA`; None without a probe and an output.
    """
    system = motion.system
    settings, excitation_hz = not_none(system.scenario.run).spectrum, system.excitation_frequency_hz
    channels, trajectory = spectral(system), motion.trajectory
    labels = [Label(channel.name, channel.quantity, channel.unit) for channel in channels.channels]
    if not labels:
        return None
    if trajectory is None or trajectory.end <= 0.0:
        return _of_stepped(not_none(motion.histories), system, labels, values)
    begin = trajectory.end - analysed_duration(trajectory.end, excitation_hz, settings.last, settings.periods)
    records = records_of(system, trajectory, channels, (begin, trajectory.end))
    filtered = not_none(system.scenario.run).low_pass is not None  # so are the extremes of accelerations
    if begin == trajectory.time[0] == 0.0 and not filtered and motion.extremes.keys() >= channels.places.keys():
        low, when_low, high, when_high = np.hstack([motion.extremes[key] for key in channels.places])
        records[0].part.extrema = Extrema(low, when_low, high, when_high, 0)  # of the whole motion: no second search
    windows = [settings.window or _suited_window(system.scenario, record) for record in records]
    kept = system.kept_modes
    residual = np.append(system.open_frequencies_hz[kept:], system.closed_frequencies_hz[kept:])
    return _spectra(labels, records, windows, excitation_hz, values, residual, settings.frequencies)


def _of_stepped(
    histories: Histories, system: StructuralSystem, labels: Sequence[Label], values: Mapping[str, Any]
) -> Dataset:  # fmt: skip
    """Spectra of a time-stepped motion; see `spectra_of`."""
    samples = np.hstack([histories.of(key) for key in spectral(system).places]).T
    settings = not_none(system.scenario.run).spectrum
    return spectra_of_samples(histories.time, samples, labels, settings, system.excitation_frequency_hz, values)


def spectra_of_samples(
    time: Floats, samples: Floats, labels: Sequence[Label], settings: SpectrumSettings, excitation_hz: float,
    values: Mapping[str, Any],
) -> Dataset:  # fmt: skip
    """Spectra of the last part of records of samples.

    Parameters
    ----------
    time, samples, excitation_hz : as of `sampled_records`.
    settings : which part; a Hann window if they name none.
    labels : (K,) of the signals.
    values : as of `spectra_of`.

    Returns
    -------
    `SPECTRA`.
    """
    records = sampled_records(time, samples, excitation_hz, settings.last, settings.periods)
    windows = [settings.window or "hann"] * len(records)
    unknown, rate = np.zeros(0), records[0].rate
    return _spectra(labels, records, windows, excitation_hz, values, unknown, settings.frequencies, rate)


def _spectra(
    labels: Sequence[Label], records: Sequence[SpectrumRecord], windows: Sequence[str], excitation_hz: float,
    values: Mapping[str, Any], residual_hz: Floats, chosen_hz: Sequence[float], rate_hz: float | None = None,
) -> Dataset:  # fmt: skip
    r"""Single-sided peak-amplitude spectra of records of one part of a motion, and the table of their lines.

    With the window :math:`w` of the N samples of the record and :math:`\bar x` their weighted mean,

    .. math:: A_j = \frac{2}{\sum_n w_n} \Big| \sum_n w_n (x_n - \bar x) e^{-2 \pi i j n / N} \Big|, \quad
              A_0 = |\bar x|, \quad L_j = 20 \log_{10} \frac{A_j}{\max |x|}

    (the line at half the sample rate is not doubled); of a motion in closed form the sums are integrals. The division
    by :math:`\sum w` corrects the window's coherent gain: a sinusoid on a bin shows its own amplitude with every
    window. The mean is taken out first, since it would leak into the first bins. Spectra end where the records do.

    Phases of lines are those of :math:`A \sin(2 \pi f t + \varphi)` with the run's own time; that of the mean is
    0 or 180 degrees, its sign. The mean is the first line, the others follow by frequency. There are none where a
    record is not finite.

    Parameters
    ----------
    labels, records, windows : of each signal, the part that is analysed, and the window of its curve.
    excitation_hz, rate_hz : Hz, nan where there is no single excitation frequency; Hz, of samples.
    values : as of `spectra_of`.
    residual_hz : (r,) Hz, frequencies that the vectors of a reduction's static deflections have, which mean nothing.
    chosen_hz : Hz, frequencies that are projected on and listed in any case, of the kind "chosen" where no order of the
        excitation has this frequency; they replace what is nearer than a bin.
    """
    duration = records[0].duration
    curves, levels = [], [record.levels() for record in records]
    columns: dict[str, list[Any]] = {name: [] for name in SPECTRA.variables if name.startswith("line_")}
    shapes = [Window.of_name(window) for window in windows]
    for number, (label, record, shape) in enumerate(zip(labels, records, shapes, strict=True)):
        check_stop()
        curves.append(np.abs(record.amplitudes(shape)))
        if is_at_rest(label.name, label.quantity, values) or not np.isfinite(levels[number].peak):
            continue
        fit = lines_of(record, levels[number], shape.one_sided, excitation_hz, chosen_hz)
        kinds = ["mean", *(_kind_of(line, chosen_hz, residual_hz, 2.0 / duration) for line in fit.lines)]
        numbers = _line_columns(fit, levels[number].peak, excitation_hz, duration)
        numbers |= {"signal": [number] * len(kinds), "kind": kinds}
        for name, column in numbers.items():
            columns[f"line_{name}"].extend(column)
    amplitude, units = np.array(curves), [{"unit": label.unit} for label in labels]
    variables = {
        "excitation_hz": excitation_hz, "start_s": records[0].start, "duration_s": duration,
        "resolution_hz": LOBE / duration, "rate_hz": rate_hz,
        **{name: [getattr(label, name) for label in labels] for name in ("signal", "name", "quantity")},
        "window": windows, "rms": [level.rms for level in levels],
        "frequency_hz": np.arange(amplitude.shape[1]) / duration, "amplitude": amplitude,
        "amplitude_db": np.array([amplitude_db(x, level.peak) for x, level in zip(curves, levels, strict=True)]),
        "line": 1 + np.arange(len(columns["line_signal"])), **columns,
    }  # fmt: skip
    return SPECTRA.dataset(variables, {"signal": units, "line": [units[k] for k in columns["line_signal"]]})


def _line_columns(fit: LineFit, peak: float, excitation_hz: float, duration: float) -> dict[str, Any]:
    """Columns of the table of lines for those of one signal, the mean first.

    Parameters
    ----------
    fit : of the signal.
    peak : its largest magnitude.
    excitation_hz : Hz, nan where there is no single excitation frequency.
    duration : s, of the record.
    """
    size, remainder, separating = _steadiness(fit, duration)
    frequency = np.array([0.0, *fit.frequency_hz])
    return {
        "order": frequency / (excitation_hz if 0.0 < excitation_hz < np.inf else np.nan),
        "frequency_hz": frequency,
        "amplitude": size,
        "amplitude_db": amplitude_db(size, peak),
        "phase_deg": np.degrees(np.angle(np.append(fit.mean + 0j, fit.amplitude))),
        "remainder": remainder,
        "separating_duration_s": separating,
        "error": np.full(size.size, np.nan),
    }


def _steadiness(fit: LineFit, duration: float) -> tuple[Floats, Floats, Floats]:
    """(k + 1,) amplitudes of the mean and of lines, what is left near each over it, and s that tell two lines apart."""
    size = np.abs(np.append(fit.mean, fit.amplitude))
    remainder, separating = np.full(size.size, np.nan), np.full(size.size, np.nan)
    if fit.remainder is not None:
        remainder[1:] = fit.remainder.size / size[1:]
        many = np.flatnonzero(remainder > ALLOWED_REMAINDER)
        if many.size:
            separating[many] = _separating_durations(fit.remainder, many - 1, duration)
    return size, remainder, separating


def _separating_durations(remainder: Remainder, lines: Ints, duration: float) -> Floats:
    """Durations, s, that tell two lines apart where each of some lines (numbers) is; nan where two explain nothing."""
    pairs, _ = remainder.best_pairs([[k] for k in lines.tolist()], [np.nan] * lines.size)
    apart = np.abs(np.diff(pairs)[:, 0])
    return np.asarray(np.where(apart < LOBE, LOBE / apart * duration, np.nan))


def coverage_notes(motion: RunMotion) -> list[str]:
    """A note where spectra do not cover every mode kept.

    Parameters
    ----------
    motion : of which there are, or would be, spectra.

    Returns
    -------
    One sentence, or none.
    """
    system, trajectory = motion.system, motion.trajectory
    if trajectory is None or trajectory.end <= 0.0:
        return _aliasing_notes(motion)
    settings = not_none(system.scenario.run).spectrum
    duration = analysed_duration(trajectory.end, system.excitation_frequency_hz, settings.last, settings.periods)
    shown, highest = MOST_FREQUENCIES / duration, _highest_mode_hz(system)
    if shown >= highest or _highest_shown(system, trajectory, duration) < shown or not spectral(system).channels:
        return []
    ends = f"spectra end at {shown:.4g} Hz, their {MOST_FREQUENCIES}th frequency, and the highest mode kept has"
    return [f"{ends} {highest:.4g} Hz; analyse a shorter part of the run (run.spectrum.last)"]


def _highest_mode_hz(system: StructuralSystem) -> float:
    """Frequency of the highest mode kept, Hz."""
    return float(system.closed_frequencies_hz[: system.kept_modes].max(initial=0.0))


def _aliasing_notes(motion: RunMotion) -> list[str]:
    """A note where spectra are made of samples of a time-stepped motion that do not cover every mode kept."""
    time, highest = not_none(motion.histories).time, _highest_mode_hz(motion.system)
    rate = float((time.size - 1) / (time[-1] - time[0])) if time.size > 1 else 1.0
    if rate >= 2.0 * highest or motion.trajectory is not None or not spectral(motion.system).channels:
        return []
    return [
        f"spectra are made of samples at {rate:g} Hz, and the highest mode kept has {highest:.4g} Hz: content "
        f"above {0.5 * rate:g} Hz is aliased; raise run.sample_rate"
    ]


def records_of(
    system: StructuralSystem, trajectory: Trajectory, channels: ChannelSet, span: tuple[float, float],
    up_to_hz: float | None = None,
) -> list[MotionRecord]:  # fmt: skip
    """Records of a part of a motion, whose spectra cover the retained modes unless a limit is given.

    Parameters
    ----------
    system : whose scenario says what is asked for.
    trajectory : the motion.
    channels : linear ones.
    span : s, begin and end of the part.
    up_to_hz : Hz, where the spectra end.

    Returns
    -------
    A record of each channel.
    """
    duration = span[1] - span[0]
    highest = _highest_shown(system, trajectory, duration) if up_to_hz is None else up_to_hz
    part = MotionPart(trajectory.extract(*span), outputs_of(trajectory.flow, channels.linear), 2.0 * np.pi * highest)
    size = max(int(SAMPLES_OF_A_PERIOD * highest * duration), FEWEST_SAMPLES)
    return [MotionRecord(part, k, highest, size) for k in range(channels.order.size)]


def _highest_shown(system: StructuralSystem, trajectory: Trajectory, duration: float) -> float:
    """Frequency, Hz, at which the spectra of a part of a motion, s, end: where the motion has a meaning, or as asked.

    It has one up to the modes kept, and to the excitation.
    """
    settings, kept = not_none(system.scenario.run).spectrum, system.kept_modes
    if kept == system.dynamics.size:  # no static vectors
        structure = trajectory.flow.highest_frequency / (2.0 * np.pi)
    else:
        structure = float(system.closed_frequencies_hz[kept - 1]) if kept else 0.0
    highest = max(
        1.05 * structure, structure + FLOOR_LINES / duration, 2.0 * system.scenario.excitation.highest_frequency_hz
    )
    if np.isfinite(system.excitation_frequency_hz):
        highest = max(highest, HIGHEST_ORDER * system.excitation_frequency_hz)
    pieces = np.diff(trajectory.flow.sources.start)
    if pieces.size > MANY_PIECES:
        highest = max(highest, 0.5 / float(np.median(pieces)))
    return min(max(settings.to or highest, *settings.frequencies, 0.0), MOST_FREQUENCIES / duration)


def _suited_window(scenario: Scenario, record: MotionRecord) -> str:
    """Hann for a motion that lasts, ``decaying`` after a shock and for what dies away: its beginning counts."""
    shock = scenario.excitation.shock
    if shock or scenario.excitation.highest_frequency_hz == 0.0:  # the others: none, or records
        first, last = record.deviations_of_quarters()
        if last < (LASTING if shock else DECAYED) * first:
            return "decaying"
    return "hann"


def lines_of_record(record: SpectrumRecord, known: Dataset) -> tuple[Floats, Floats]:
    """Frequencies (k,), Hz, and amplitudes (k,) of the lines of a signal, the mean first, in another record.

    The lines of the other record are found as those of the signal were. Orders of the excitation keep their frequency,
    and those that are not locked to it are the same.
    Any other line is the nearest one of at least half its size, since a natural frequency depends on the model, but no
    nearer to another line. A line that the other record does not have is fitted at its old frequency, together with
    those found.

    Parameters
    ----------
    record : of the other motion.
    known : `SPECTRA` with the lines of the signal alone.
    """
    size, level, every_hz = (known[f"line_{name}"].values for name in ("amplitude", "amplitude_db", "frequency_hz"))
    if not size.any():  # of a signal that rests
        return every_hz, size
    excitation_hz, one_sided = known["excitation_hz"].item(), Window.of_name(known["window"].item()).one_sided
    peak = float(size.max() / 10.0 ** (level[size.argmax()] / 20.0))
    frequency, free = every_hz[1:], np.isin(known["line_kind"].values[1:], ("other", "residual"))
    fit = lines_of(record, Levels(peak, peak, peak), one_sided, excitation_hz, (), frequency[free].tolist())
    found = np.array(fit.frequency_hz)
    away = np.abs(found - frequency[:, None])
    reach = np.where(free, np.maximum(NEARBY_BINS / record.duration, NEARBY * frequency), ROUND_OFF * frequency)
    between = np.concatenate([[-np.inf], 0.5 * (frequency[1:] + frequency[:-1]), [np.inf]])[:, None]
    own = (found > between[:-1]) & (found < between[1:]) & (np.abs(fit.amplitude) >= 0.5 * size[1:, None])
    away = np.where((away <= reach[:, None]) & (own | ~free[:, None]), away, np.inf)
    partner = away.argmin(axis=1) if found.size else np.zeros(frequency.size, dtype=np.int64)
    missing, mean, amplitude = np.isinf(away.min(axis=1, initial=np.inf)), fit.mean, fit.amplitude
    if missing.any():
        partner[missing] = found.size + np.arange(np.count_nonzero(missing))
        found = np.append(found, frequency[missing])
        view = view_of(record, excitation_hz, one_sided)
        mean, amplitude = record.project(found, None if view is None else view.window)
    return np.append(0.0, found[partner]), np.abs(np.append(mean, amplitude[partner]))


def _kind_of(line: SpectralLine, chosen_hz: Sequence[float], residual_hz: Floats, near_hz: float) -> str:
    """The kind of a line; one is "residual" that is near to a frequency of a static vector."""
    if line.order is not None:  # every order that is not whole is a subharmonic one
        whole = "fundamental" if line.order == 1 else "superharmonic"
        return "subharmonic" if line.order.denominator > 1 else whole
    if line.frequency_hz in chosen_hz:
        return "chosen"
    return "residual" if np.abs(residual_hz - line.frequency_hz).min(initial=np.inf) <= near_hz else "other"
