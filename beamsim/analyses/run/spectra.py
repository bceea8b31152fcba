"""The spectra of a run: which part is analysed, through which window, up to which frequency."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from beamsim.analyses.run.histories import Histories
from beamsim.analyses.run.records import MotionRecord
from beamsim.analyses.run.result import Spectrum
from beamsim.analyses.run.spectrum import spectrum, spectrum_of
from beamsim.analyses.values import ACCELERATION, DISPLACEMENT
from beamsim.flow.channels import Observed
from beamsim.flow.fourier import MotionPart
from beamsim.flow.trajectory import Trajectory
from beamsim.scenario import Scenario, SpectrumSettings
from beamsim.system.channels import ChannelSet
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats

SAMPLES_OF_A_PERIOD = 2.56  # of the highest frequency shown
HIGHEST_ORDER = 12.5  # of the excitation frequency that is shown at least
MANY_PIECES = 8  # of the inputs: more are those of a sampled signal
FLOOR_LINES = 16  # beyond the highest content: a line is told by what lies beside it
FEWEST_SAMPLES, MOST_SAMPLES = 256, 2**17
DECAYED = 0.25  # rms of the last quarter of a free motion over that of the first, below which it decays


def spectral(system: StructuralSystem) -> ChannelSet:
    """The channels of which there are spectra: of probes and of the outputs that are no energies."""
    outputs = (c.key for c in system.channels.channels if c.section == "outputs" and not c.squared)
    return system.channels.of_keys(ACCELERATION, DISPLACEMENT, *dict.fromkeys(outputs))


def spectra_of_samples(
    scenario: Scenario, system: StructuralSystem, histories: Histories
) -> dict[tuple[str, str], Spectrum]:
    """Spectra of a motion that is known at the output times alone.

    Parameters
    ----------
    scenario, system : what was asked for, and of what.
    histories : there.
    """
    assert scenario.run is not None
    channels = spectral(system)
    samples = np.hstack([histories.of(key) for key in channels.places])
    return {
        (channel.name, channel.quantity): spectrum(
            histories.time,
            x,
            scenario.run.spectrum,
            system.excitation_frequency_hz,
            channel.name,
            channel.quantity,
            channel.unit,
        )
        for channel, x in zip(channels.channels, samples.T, strict=True)
    }


def coverage_notes(
    system: StructuralSystem, spectra: Mapping[tuple[str, str], Spectrum], *, closed_form: bool
) -> list[str]:
    """A note where samples of spectra do not cover every mode kept."""
    highest = float(system.modes.closed_frequencies_hz[: system.modes.kept_modes].max(initial=0.0))
    rate = min((s.rate_hz for s in spectra.values() if s.rate_hz is not None), default=np.inf)
    if rate >= 2.0 * highest:
        return []
    remedy = "analyse a shorter part of the run (run.spectrum.last)" if closed_form else "raise run.sample_rate"
    return [
        f"spectra are made of samples at {rate:g} Hz, and the highest mode kept has {highest:.4g} Hz: what moves "
        f"faster than {0.5 * rate:g} Hz shows at lower frequencies; {remedy}"
    ]


def spectra_of_motion(
    scenario: Scenario, system: StructuralSystem, trajectory: Trajectory
) -> dict[tuple[str, str], Spectrum]:
    """Spectra of a motion in closed form, whatever the output rate.

    Parameters
    ----------
    scenario, system : what was asked for, and of what.
    trajectory : the motion, or its last part.
    """
    assert scenario.run is not None
    settings, excitation_hz = scenario.run.spectrum, system.excitation_frequency_hz
    begin = trajectory.end - _duration(settings, trajectory.end, excitation_hz)
    kept, modes = system.modes.kept_modes, system.modes
    residual = (*modes.open_frequencies_hz[kept:], *modes.closed_frequencies_hz[kept:])
    spectra, channels = {}, spectral(system)
    records = records_of(scenario, system, trajectory, channels, (begin, trajectory.end))
    for channel, (record, at_end) in zip(channels.channels, records, strict=True):
        window = settings.window or _suited_window(scenario, record.x)
        if window == "rectangular":
            record.x[0] = 0.5 * (record.x[0] + at_end)  # both ends of the part are one sample of the periodic record
        spectra[channel.name, channel.quantity] = spectrum_of(
            record, window, excitation_hz, channel.name, channel.quantity, channel.unit, residual, settings.frequencies
        )
    return spectra


def records_of(
    scenario: Scenario,
    system: StructuralSystem,
    trajectory: Trajectory,
    channels: ChannelSet,
    span: tuple[float, float],
) -> Iterator[tuple[MotionRecord, float]]:
    """Records of a part of a motion; samples cover the modes kept.

    Parameters
    ----------
    scenario, system : what was asked for, and of what.
    trajectory : the motion.
    channels : linear ones.
    span : s, begin and end of the part.

    Returns
    -------
    A record of each channel, and its value at the end of the part.
    """
    assert scenario.run is not None
    begin, end = span
    duration = end - begin
    content = _highest_content(scenario, system, trajectory, duration)
    highest = max(scenario.run.spectrum.to or content, *scenario.run.spectrum.frequencies, 0.0)
    rate = SAMPLES_OF_A_PERIOD * max(highest, content)
    size = _even_size(min(max(rate * duration, FEWEST_SAMPLES), MOST_SAMPLES))
    rate = size / duration
    highest = min(highest, rate / SAMPLES_OF_A_PERIOD)
    part = MotionPart.of(trajectory, Observed(trajectory.flow, channels).linear, begin, end, np.pi * rate)
    samples, at_end = part.samples(size), part.at_end()
    time = begin + np.arange(size) / rate
    for column, last in enumerate(at_end):
        x = np.ascontiguousarray(samples[:, column])
        yield MotionRecord(part, column, begin, duration, time, x, rate, highest), float(last)


def _duration(settings: SpectrumSettings, available: float, excitation_hz: float) -> float:
    """Length of the part at the end of the run that is analysed, s."""
    if settings.last is not None:
        return min(settings.last, available)
    if settings.periods is not None and np.isfinite(excitation_hz) and excitation_hz > 0:
        whole = min(settings.periods, int(available * excitation_hz * (1 + 1e-12)))
        if whole >= 1:
            return min(available, whole / excitation_hz)
    return available


def _highest_content(scenario: Scenario, system: StructuralSystem, trajectory: Trajectory, duration: float) -> float:
    """Frequency, Hz, up to which the motion has a meaning: of the modes kept, and of the excitation."""
    modes = system.modes
    if modes.static_vectors == 0:
        structure = trajectory.flow.highest_frequency / (2.0 * np.pi)
    else:
        structure = float(modes.closed_frequencies_hz[modes.kept_modes - 1]) if modes.kept_modes else 0.0
    highest = max(1.05 * structure, structure + FLOOR_LINES / duration, 2.0 * scenario.excitation.highest_frequency_hz)
    if np.isfinite(system.excitation_frequency_hz):
        highest = max(highest, HIGHEST_ORDER * system.excitation_frequency_hz)
    pieces = np.diff(trajectory.flow.sources.start)
    if pieces.size > MANY_PIECES:
        highest = max(highest, 0.5 / float(np.median(pieces)))
    return highest


def _even_size(samples: float) -> int:
    """A number of samples, not less, whose largest prime factor is small."""
    size = int(np.ceil(samples))
    step = 1 << max(size.bit_length() - 5, 0)
    return -(-size // step) * step


def _suited_window(scenario: Scenario, x: Floats) -> str:
    """Hann for a motion that lasts, ``decaying`` for a shock and for what dies away, of which the beginning counts."""
    if scenario.excitation.shock:
        return "decaying"
    if scenario.excitation.kind in ("none", "sampled") and x.size >= 4:
        quarter, y = x.size // 4, x - np.mean(x)
        first, last = (float(np.sqrt(np.mean(part**2))) for part in (y[:quarter], y[-quarter:]))
        if last < DECAYED * first:
            return "decaying"
    return "hann"
