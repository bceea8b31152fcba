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

SAMPLES_OF_A_PERIOD = 2.56  # samples per period of the highest frequency
HIGHEST_ORDER = 12.5  # of the excitation: least end of a spectrum
MANY_PIECES = 8  # of the inputs; more belong to a sampled signal
FLOOR_LINES = 16  # frequencies beyond the highest content: lines are recognised by their neighbours
FEWEST_SAMPLES = 256
DECAYED = 0.25  # rms of the last quarter of a free motion over that of the first, below which it decays
PERSISTING = 0.8  # the same after a shock, above which the motion persists, such as stick-slip on a belt
NEARBY, NEARBY_BINS = 0.01, 3.0  # relative distance, and bins, within which a line is matched


def spectral(system: StructuralSystem) -> ChannelSet:
    """Channels with spectra: probes, and outputs other than energies."""
    outputs = (c.key for c in system.channels.channels if c.section == "outputs" and not c.squared)
    return system.channels.of_keys(ACCELERATION, DISPLACEMENT, *dict.fromkeys(outputs))


def is_at_rest(name: str, quantity: str, values: Mapping[str, Any]) -> bool:
    """True if a quantity of a probe is zero up to round-off and therefore has no lines.

    Parameters
    ----------
    name, quantity : as in a spectrum.
    values : values of the motion or the summary, in which peaks at rest are 0.

    Returns
    -------
    False for quantities other than displacement, absolute acceleration and those of outputs.
    """
    peak = {"displacement": "peak_displacement_m", MAIN_QUANTITY: "peak_acceleration_g"}.get(quantity, "peak_output")
    return bool(values.get(peak, {}).get(name) == 0.0)


class Label(NamedTuple):
    """Signal of a spectrum."""

    name: str  # name of the probe or output
    quantity: str
    unit: str

    @property
    def signal(self) -> str:
        """Name and quantity of the signal."""
        return f"{self.name} {self.quantity}"


def spectra_of(motion: RunMotion, values: Mapping[str, Any]) -> Dataset | None:
    """Spectra of every probe and output, at any output rate; for a time-stepped motion those of its samples.

    Parameters
    ----------
    motion : motion; its last part is analysed as its scenario requests.
    values : values of the motion; signals at rest have no lines.

    Returns
    -------
    Layout `SPECTRA`; None without probes and outputs.
    """
    system = motion.system
    settings, excitation_hz = not_none(system.scenario.run).spectrum, system.excitation_frequency_hz
    channels, trajectory = spectral(system), motion.trajectory
    labels = [Label(channel.name, channel.quantity, channel.unit) for channel in channels.channels]
    if not labels:
        return None
    if trajectory is None or trajectory.end <= 0.0:
        return _stepped_spectra(not_none(motion.histories), system, labels, values)
    begin = trajectory.end - analysed_duration(trajectory.end, excitation_hz, settings.last, settings.periods)
    records = records_of(system, trajectory, channels, (begin, trajectory.end))
    filtered = not_none(system.scenario.run).low_pass is not None  # the extremes of accelerations are filtered, too
    if begin == trajectory.time[0] == 0.0 and not filtered and motion.extremes.keys() >= channels.places.keys():
        low, when_low, high, when_high = np.hstack([motion.extremes[key] for key in channels.places])
        records[0].part.extrema = Extrema(low, when_low, high, when_high, 0)  # no second search
    windows = [settings.window or _suited_window(system.scenario, record) for record in records]
    kept = system.kept_modes
    residual = np.append(system.open_frequencies_hz[kept:], system.closed_frequencies_hz[kept:])
    return _spectra(labels, records, windows, excitation_hz, values, residual, settings.frequencies)


def _stepped_spectra(
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
    """Spectra of the last part of sampled records.

    Parameters
    ----------
    time, samples, excitation_hz : as in `sampled_records`.
    settings : the analysed part; a Hann window by default.
    labels : (K,) labels of the signals.
    values : see `spectra_of`.

    Returns
    -------
    Layout `SPECTRA`.
    """
    records = sampled_records(time, samples, excitation_hz, settings.last, settings.periods)
    windows = [settings.window or "hann"] * len(records)
    unknown, rate = np.zeros(0), records[0].rate
    return _spectra(labels, records, windows, excitation_hz, values, unknown, settings.frequencies, rate)


def _spectra(
    labels: Sequence[Label], records: Sequence[SpectrumRecord], windows: Sequence[str], excitation_hz: float,
    values: Mapping[str, Any], residual_hz: Floats, requested_hz: Sequence[float], rate_hz: float | None = None,
) -> Dataset:  # fmt: skip
    r"""Single-sided peak-amplitude spectra of records of one part of a motion, and the table of their lines.

    With the window :math:`w` of the N samples of the record and :math:`\bar x` their weighted mean,

    .. math:: A_j = \frac{2}{\sum_n w_n} \Big| \sum_n w_n (x_n - \bar x) e^{-2 \pi i j n / N} \Big|, \quad
              A_0 = |\bar x|, \quad L_j = 20 \log_{10} \frac{A_j}{\max |x|}

    (the line at half the sample rate is not doubled); for a motion in closed form the sums are integrals. The division
    by :math:`\sum w` corrects the window's coherent gain: a sinusoid on a bin has its own amplitude with every window.
    The mean is removed first, since it would leak into the first bins. Spectra end where the records do.

    Phases of lines are those of :math:`A \sin(2 \pi f t + \varphi)` with the time of the run; that of the mean is 0 or
    180 degrees (its sign). The mean is the first line, the others follow by frequency. A record that is not finite has
    no lines.

    Parameters
    ----------
    labels, records, windows : label, analysed part and window of each signal.
    excitation_hz, rate_hz : Hz, nan without a single excitation frequency; sample rate, Hz.
    values : see `spectra_of`.
    residual_hz : (r,) frequencies of static vectors, Hz, which have no physical meaning.
    requested_hz : requested frequencies, Hz. They are always listed, with the kind "chosen" unless they are an order of
        the
    excitation, and replace lines closer than a bin.
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
        fit = lines_of(record, levels[number], shape.one_sided, excitation_hz, requested_hz)
        kinds = ["mean", *(_kind_of(line, requested_hz, residual_hz, 2.0 / duration) for line in fit.lines)]
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
    """Columns of the table of lines for one signal, the mean first.

    Parameters
    ----------
    fit : fitted lines of the signal.
    peak : largest magnitude of the signal.
    excitation_hz : Hz, nan without a single excitation frequency.
    duration : duration of the record, s.
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
    """(k + 1,) amplitudes of the mean and of lines, their relative remainder, and durations that separate two lines."""
    size = np.abs(np.append(fit.mean, fit.amplitude))
    remainder, separating = np.full(size.size, np.nan), np.full(size.size, np.nan)
    if fit.remainder is not None:
        remainder[1:] = fit.remainder.size / size[1:]
        many = np.flatnonzero(remainder > ALLOWED_REMAINDER)
        if many.size:
            separating[many] = _separating_durations(fit.remainder, many - 1, duration)
    return size, remainder, separating


def _separating_durations(remainder: Remainder, lines: Ints, duration: float) -> Floats:
    """Durations, s, that would separate two lines at each given line (by index); nan if two lines do not explain it."""
    pairs, _ = remainder.best_pairs([[k] for k in lines.tolist()], [np.nan] * lines.size)
    apart = np.abs(np.diff(pairs)[:, 0])
    return np.asarray(np.where(apart < LOBE, LOBE / apart * duration, np.nan))


def coverage_notes(motion: RunMotion) -> list[str]:
    """Note if spectra do not cover every retained mode.

    Parameters
    ----------
    motion : motion with, or without, computed spectra.

    Returns
    -------
    One sentence, or empty.
    """
    system, trajectory = motion.system, motion.trajectory
    if trajectory is None or trajectory.end <= 0.0:
        return _aliasing_notes(motion)
    settings = not_none(system.scenario.run).spectrum
    duration = analysed_duration(trajectory.end, system.excitation_frequency_hz, settings.last, settings.periods)
    shown, highest = MOST_FREQUENCIES / duration, _highest_mode_hz(system)
    if shown >= highest or _highest_shown(system, trajectory, duration) < shown or not spectral(system).channels:
        return []
    ends = f"spectra end at {shown:.4g} Hz, their {MOST_FREQUENCIES}th frequency, but the highest mode has"
    return [f"{ends} {highest:.4g} Hz; analyse a shorter part of the run (run.spectrum.last)"]


def _highest_mode_hz(system: StructuralSystem) -> float:
    """Highest retained natural frequency, Hz."""
    return float(system.closed_frequencies_hz[: system.kept_modes].max(initial=0.0))


def _aliasing_notes(motion: RunMotion) -> list[str]:
    """Note if spectra of samples of a time-stepped motion do not cover every retained mode."""
    time, highest = not_none(motion.histories).time, _highest_mode_hz(motion.system)
    rate = float((time.size - 1) / (time[-1] - time[0])) if time.size > 1 else 1.0
    if rate >= 2.0 * highest or motion.trajectory is not None or not spectral(motion.system).channels:
        return []
    return [
        f"spectra are made of samples at {rate:g} Hz, but the highest mode has {highest:.4g} Hz: content "
        f"above {0.5 * rate:g} Hz is aliased; raise run.sample_rate"
    ]


def records_of(
    system: StructuralSystem, trajectory: Trajectory, channels: ChannelSet, span: tuple[float, float],
    end_hz: float | None = None,
) -> list[MotionRecord]:  # fmt: skip
    """Records of a part of a motion; their spectra cover the retained modes unless an end is given.

    Parameters
    ----------
    system : system with the settings of its scenario.
    trajectory : motion.
    channels : linear channels.
    span : start and end of the part, s.
    end_hz : end of the spectra, Hz.

    Returns
    -------
    One record for each channel.
    """
    duration = span[1] - span[0]
    highest = _highest_shown(system, trajectory, duration) if end_hz is None else end_hz
    part = MotionPart(trajectory.extract(*span), outputs_of(trajectory.flow, channels.linear), 2.0 * np.pi * highest)
    size = max(int(SAMPLES_OF_A_PERIOD * highest * duration), FEWEST_SAMPLES)
    return [MotionRecord(part, k, highest, size) for k in range(channels.order.size)]


def _highest_shown(system: StructuralSystem, trajectory: Trajectory, duration: float) -> float:
    """End of the spectra of a part of a motion (duration in s), Hz: as requested, or where the model ends.

    The model covers the retained modes and the excitation.
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
    """Hann for a persistent motion; ``decaying`` after a shock and for decaying motions, whose beginning matters."""
    shock = scenario.excitation.shock
    if shock or scenario.excitation.highest_frequency_hz == 0.0:  # none, or records
        first, last = record.deviations_of_quarters()
        if last < (PERSISTING if shock else DECAYED) * first:
            return "decaying"
    return "hann"


def lines_of_record(record: SpectrumRecord, lines: Dataset) -> tuple[Floats, Floats]:
    """Match the lines of a signal in another record: (k,) frequencies, Hz, and amplitudes, the mean first.

    The lines of the other record are found by the same method. Orders of the excitation keep their frequency. Any other
    line corresponds to the closest line of at least half its amplitude (a natural frequency depends on the model) that
    is not closer to another line. A line without a match is fitted at its old frequency, together with those found.

    Parameters
    ----------
    record : record of the other motion.
    lines : `SPECTRA` with the lines of this signal only.
    """
    size, level, every_hz = (lines[f"line_{name}"].values for name in ("amplitude", "amplitude_db", "frequency_hz"))
    if not size.any():  # a signal at rest
        return every_hz, size
    excitation_hz, one_sided = lines["excitation_hz"].item(), Window.of_name(lines["window"].item()).one_sided
    peak = float(size.max() / 10.0 ** (level[size.argmax()] / 20.0))
    frequency, free = every_hz[1:], np.isin(lines["line_kind"].values[1:], ("other", "residual"))
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


def _kind_of(line: SpectralLine, requested_hz: Sequence[float], residual_hz: Floats, near_hz: float) -> str:
    """Kind of a line; "residual" if it is near the frequency of a static vector."""
    if line.order is not None:  # every order that is not an integer is subharmonic
        whole = "fundamental" if line.order == 1 else "superharmonic"
        return "subharmonic" if line.order.denominator > 1 else whole
    if line.frequency_hz in requested_hz:
        return "chosen"
    return "residual" if np.abs(residual_hz - line.frequency_hz).min(initial=np.inf) <= near_hz else "other"
