r"""Response to stationary random inputs: densities, RMS, statistics of peaks and levels, transmissibility.

Densities are one-sided, by Welch's method (P. D. Welch, IEEE Trans. Audio Electroacoust. 15, 1967) with Hann windows
and half overlap. The transmissibility is :math:`H_1 = S_{xy} / S_{xx}`. The coherence is 1 for a linear structure, and
below 1 where contact transfers energy to other frequencies.

*Confidence.* The mean square of a record of duration T of a Gaussian process has the variance
:math:`\int S^2 df / T` (J. S. Bendat, A. G. Piersol, Random Data, ch. 8), as a chi-square variable with
:math:`n = 2 T (\int S df)^2 / \int S^2 df` degrees of freedom. The lines :math:`p_k` of the periodogram, with the full
resolution 1/T, give :math:`n = 4 (\sum p_k)^2 / \sum p_k^2 - 2`, as the mean of :math:`p_k^2` is twice the square of
that of :math:`p_k`. Where the kurtosis exceeds that of a Gaussian signal, the mean square scatters more, and n is
divided by half of the kurtosis less 1. The interval is valid for repeated records of a Gaussian input, also if the
amplitudes of this record are fixed.

*The largest value of a test.* The record is cut into N segments. The energies at their peaks follow E. J. Gumbel's
distribution (Statistics of Extremes, 1958), since energy is exponentially distributed: in the limit for a Gaussian
signal (A. G. Davenport, Proc. ICE 28, 1964), and in stationary white noise for an oscillator with any spring (T. K.
Caughey, J. Acoust. Soc. Am. 35, 1963). The energy is the square of the distance from the mean, and of a snubber's force
F the stored energy at the turning point: with the penetration :math:`\delta` of its law after a long rest,
means :math:`\bar\delta, \bar F` and the static stiffness k of the structure at the snubber,

.. math:: \int_0^\delta F d\delta - \bar F (\delta - \bar\delta) + k (\delta - \bar\delta)^2 / 2.

Stops, friction and softening springs change that law. Therefore the shape of a generalised extreme value distribution
is not fixed; it lies between -0.3 (bounded) and 0.25 (a heavy tail), and is 0 for Gumbel's. The first two L-moments
(J. R. M. Hosking, J. R. Stat. Soc. B 52, 1990) give location and scale, and the ratio of the third to the second
estimates the shape. Of 20,000 random records of N energies, each with the largest energy of a test, the tenth with the
closest ratio gives median and interval of (largest - location) / scale; this includes the uncertainty of N segments. A
segment has eight degrees of freedom, so that neighbouring peaks are independent. If the frequency depends on the
amplitude they may seem so but are not: segments are merged in pairs while neighbours have high peaks together.

*When no value is given.* The test must be statistically like its record. If the stiffness of a contact changes by half
between the median of the segments' deflections and the upper end of the interval of that deflection in the test, only
the force of that snubber is given, which follows its law.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from beamsim.analyses.run.impacts import CONFIDENCE, SKIPPED_SHARE
from beamsim.analyses.run.layouts import RANDOM
from beamsim.analyses.run.linear_prediction import linear_responses
from beamsim.analyses.run.motion import RunMotion
from beamsim.analyses.run.result import MAIN_QUANTITY, RunResult
from beamsim.contacts.laws import ContactLaw
from beamsim.flow.channels import outputs_of
from beamsim.inputs.measured import limit_curve
from beamsim.labelled import Dataset
from beamsim.outcomes import Outcome, OutcomeKind, check_stop
from beamsim.results.values import LIMITED, OPENING, STRESS, Margins, largest, margin_of, parse_limit, with_verdicts
from beamsim.scenario import Scenario
from beamsim.scenario.quantities import amplitude_unit
from beamsim.scenario.reporting import INPUT
from beamsim.scenario.run import Run
from beamsim.scenario.units import ACCELERATION_PSD, FORCE_PSD, MOMENT_PSD
from beamsim.system.reduced_model import ActingLoads
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Complexes, Floats, not_none

INPUT_SECTION = "excitation"  # of the signals that are inputs
_DENSITY_OF = {"m/s^2": ACCELERATION_PSD.name, "N": FORCE_PSD.name, "N m": MOMENT_PSD.name}
SEGMENTS = 16  # of the record, overlapping by half
LEAST_SAMPLES = 64
SEGMENT_FREEDOM = 8  # per segment, so that each has an independent peak
FEWEST_SEGMENTS, MOST_SEGMENTS = 5, 50
EXPECTED_PEAK_KEYS = "expected_peak", "expected_peak_low", "expected_peak_high"
UNKNOWN_PEAK_KEY = "expected_peak_unknown"
SAME_PEAK = 1e-9  # relative difference up to which the largest peaks of two segments count as the same, a bound
LARGEST_STIFFNESS_CHANGE = 0.5  # relative change of a contact's stiffness that makes a test unlike its record
DRAWS = 20_000  # random records for the interval of a largest value
REACHED_TEXT = "largest value that the run reached"  # compared with limits if no value of the test is known
LARGEST_DURATION_RATIO = 1000  # longest record that is recommended to decide on a limit
LEVELS = np.linspace(-12.0, 12.0, 97)  # levels with counted crossings, in standard deviations above the mean


class StationarySignal(NamedTuple):
    """History of a run with a stationary input: the input, or a response."""

    section: str
    name: str
    quantity: str
    unit: str
    history: Floats  # (nt,)

    @property
    def label(self) -> str:
        """Name and quantity of the signal."""
        return f"{self.name} {self.quantity}"


def random_response(result: RunResult, motion: RunMotion, found: Mapping[str, Any]) -> Dataset | None:
    """Analyse a run with a stationary input as a sample of a random process.

    Of several inputs all motions of the base are analysed, or else the first force or support; there is no
    transmissibility.

    Parameters
    ----------
    result : result of the run.
    motion : motion of the run.
    found : values of the motion, by entry of the summary.

    Returns
    -------
    Dataset or None
        Layout `RANDOM`; None if the run is too short.
    """
    times, system = result["histories"]["time"].values, motion.system
    if times.size - int(SKIPPED_SHARE * times.size) < LEAST_SAMPLES:
        return None
    record = StationaryRecord(result, system, found)
    entered, *others = _inputs_of(system, result["histories"])
    shaken, alone = bool(system.base), len(result.scenario.excitation.items) == 1
    signals = [record.statistics(each) for each in (entered, *others)]
    of_probes = dict[str, tuple[Complexes, Floats]]()
    for signal in _responses(result, motion):
        check_stop()
        signals.append(record.statistics(signal))
        if alone and signal.section == "probes" and signal.quantity == (MAIN_QUANTITY if shaken else "displacement"):
            densities = signals[0]["density"], signals[-1]["density"]
            of_probes[signal.name] = record.transmissibility(entered.history, signal.history, *densities)
    known: dict[str, Any] = {
        "start_s": float(times[record.first]),
        "test_duration_s": record.tested,
        "frequency_hz": record.frequency,
        "level": LEVELS,
        **_columns(signals),
    }
    if of_probes:
        transmissibility, coherence = (np.array(values) for values in zip(*of_probes.values(), strict=True))
        known |= {
            "probe": list(of_probes),
            "transmissibility_real": transmissibility.real,
            "transmissibility_imag": transmissibility.imag,
            "coherence": coherence,
        }
    units = [{"unit": signal["unit"], "quantity": signal["quantity"]} for signal in signals]
    over = "1" if entered.unit == "m/s^2" else "m/N"
    return RANDOM.dataset(known, {"signal": units}, transmissibility_unit=over)


class StationaryRecord:
    """Stationary part of a run, a sample of a possibly longer test.

    Parameters
    ----------
    result : result of the run.
    system : system of the run.
    found : values of the motion, by entry of the summary.
    """

    def __init__(self, result: RunResult, system: StructuralSystem, values: Mapping[str, Any]) -> None:
        self._histories, self._scenario, self._system, self._found = (
            result["histories"],
            result.scenario,
            system,
            values,
        )
        times, settings = self._histories["time"].values, not_none(result.scenario.run)
        self.first = int(SKIPPED_SHARE * times.size)  # first sample of the stationary part
        self._end, self._rate = float(times[-1]), (times.size - 1) / float(times[-1] - times[0])  # s, Hz
        self._segment = max(2 * (times.size - self.first) // (SEGMENTS + 1), LEAST_SAMPLES // 2)  # samples
        self.frequency: Floats = np.asarray(np.fft.rfftfreq(self._segment, 1.0 / self._rate), dtype=float)  # Hz
        self.tested = settings.test_duration or settings.duration  # s
        self._outlasts = self.tested >= settings.duration  # the test includes the computed motion
        self._linear = linear_responses(system, self.frequency)
        self._beyond = _changes_beyond_record(result, system, self.first, self.tested * self._rate)

    def statistics(self, signal: StationarySignal) -> dict[str, Any]:
        """Values of `RANDOM` for a signal, by name; missing ones are omitted."""
        x = signal.history[self.first :]
        of_record: dict[str, Any] = statistics_of(x, self._rate) | rms_interval(x)
        psd_limit = limit_curve(
            self._scenario, "psd", signal.name, _DENSITY_OF.get(signal.unit, ""), self.frequency
        )  # fmt: skip
        return {
            "signal": signal.label, **signal._asdict(),
            "density": cross_density(x, x, self._rate, self._segment).real, "limit": psd_limit,
            "crossings_hz": crossing_rates(x, self._rate), **of_record,
            **self._of_test(signal, of_record.get("degrees_of_freedom", 0.0)),
            **self._linear.get((signal.name, signal.quantity), {}),
        }  # fmt: skip

    def _of_test(self, signal: StationarySignal, freedom: float) -> dict[str, Any]:
        """Expected largest value of a signal in the test, or the reason why it is unknown; mean and 3 sigma.

        Parameters
        ----------
        signal : signal with its history.
        freedom : degrees of freedom of its mean square.
        """
        name, quantity = signal.name, signal.quantity
        seen = _filtered_history(self._histories, signal)[self.first :]
        pressed = _compression(self._system, self._histories, name, self.first) if quantity == "force" else None
        measured, samples = Magnitude(seen, quantity == "opening", pressed), self.tested * self._rate
        others = [why for of, why in self._beyond.items() if of != (name, quantity) and signal.section != INPUT_SECTION]
        expected: dict[str, Any] = (
            {UNKNOWN_PEAK_KEY: others[0]} if others else largest_of_test(measured, freedom, samples)
        )
        if not expected and (name, quantity) in self._beyond:
            expected[UNKNOWN_PEAK_KEY] = self._beyond[name, quantity]  # a stop that only the test may reach
        mean = float(seen.mean())
        expected["three_sigma"] = (mean if measured.one_sided else abs(mean)) + 3.0 * float(seen.std())
        if EXPECTED_PEAK_KEYS[0] in expected:
            limit = _limit_on_peak(self._scenario, signal._asdict())
            if expected[EXPECTED_PEAK_KEYS[1]] <= limit < expected[EXPECTED_PEAK_KEYS[2]]:
                expected["decided_after_s"] = self._end * deciding_share(measured, freedom, samples, limit)
            if self._outlasts:
                reached = _largest_in_run(self._found, signal._asdict())
                expected |= {each: max(expected[each], reached) for each in EXPECTED_PEAK_KEYS}
        return expected

    def transmissibility(
        self, input_history: Floats, response_history: Floats, input_density: Floats, density: Floats
    ) -> tuple[Complexes, Floats]:
        """H1 from the input's history (nt,) to that of a response, and their coherence, (nf,) each.

        Parameters
        ----------
        input_history, response_history : histories.
        input_density, density : (nf,) densities of the two.
        """
        cross = cross_density(input_history[self.first :], response_history[self.first :], self._rate, self._segment)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(cross / input_density), np.asarray(np.abs(cross) ** 2 / (input_density * density))


def _columns(signals: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Values of signals as variables along them; NaN if a signal has no such value."""
    columns: dict[str, Any] = {}
    for name, declared in RANDOM.variables.items():
        if declared.dims[:1] != ("signal",):
            continue
        values = [signal.get(name) for signal in signals]
        given = [value for value in values if value is not None]
        if given and len(declared.dims) > 1:
            unknown = np.full(given[0].size, np.nan)
            columns[name] = np.array([unknown if value is None else value for value in values])
        else:
            columns[name] = values if given else None
    return columns


def _inputs_of(system: StructuralSystem, histories: Dataset) -> Iterator[StationarySignal]:
    """Analysed inputs: those of the base, or else the first force or support."""
    acting = ActingLoads.of(system.scenario)
    if not acting.base:
        _, shown = (*acting.forces, *acting.supports)[0]
        quantity, values = str(shown.level_quantities[0]), system.forcing.signal[0](histories["time"].values)
        yield StationarySignal(INPUT_SECTION, INPUT, quantity, amplitude_unit(quantity), values)
    moved = histories.by_label("base_acceleration").values()
    for name, history, (_, shown) in zip(system.scenario.input_names, moved, acting.base, strict=False):
        quantity = str(shown.level_quantities[0])
        yield StationarySignal(INPUT_SECTION, name, quantity, amplitude_unit(quantity), history.values)


def _filtered_history(histories: Dataset, signal: StationarySignal) -> Floats:
    """History of a signal for the expected largest value: an acceleration after run.low_pass."""
    if signal.section == "probes" and signal.quantity == MAIN_QUANTITY and "low_passed_acceleration" in histories:
        return histories["low_passed_acceleration"].sel(probe=signal.name).values
    return signal.history


def _responses(result: RunResult, motion: RunMotion) -> Iterator[StationarySignal]:
    """Responses; openings and the largest stress only if they have limits."""
    histories = result["histories"]
    for name in histories.labels("probe"):
        for quantity in (MAIN_QUANTITY, "displacement"):
            history = histories[quantity].sel(probe=name)
            yield StationarySignal("probes", name, quantity, history.unit, history.values)
    for name, force in histories.by_label("snubber_force").items():
        yield StationarySignal("snubbers", name, "force", force.unit, force.values)
    for name, output in histories.by_label("output_value").items():
        quantity = histories["output_quantity"].sel(output=name).item()
        yield StationarySignal("outputs", name, quantity, output.unit, output.values)
    limits = {} if result.scenario.limits is None else result.scenario.limits.values_by_name
    if any(parse_limit(name)[0].key == OPENING for name in limits) and motion.histories is not None:
        for snubber, opening in zip(motion.system.snubbers, motion.histories.of(OPENING).T, strict=False):
            yield StationarySignal(OPENING[0], snubber.name, OPENING[1], snubber.gap_unit, opening)
    trajectory = motion.trajectory
    if (
        any(parse_limit(name)[0].key == STRESS for name in limits)
        and trajectory is not None
        and trajectory.time[0] == 0.0
    ):
        worst = int(largest(motion.extremes[STRESS]).argmax())
        row = outputs_of(trajectory.flow, motion.system.channels.of_keys(STRESS).linear[[worst]])
        at = np.minimum(histories["time"].values, trajectory.end)
        yield StationarySignal(STRESS[0], "largest", STRESS[1], "Pa", trajectory.sample(at, row)[:, 0])


def cross_density(x: Floats, y: Floats, rate: float, length: int) -> Complexes:
    """One-sided cross-spectral density of two signals by Welch's method.

    Segments overlap by half and have a Hann window; their means are removed.

    Parameters
    ----------
    x, y : (nt,) samples at equal steps.
    rate : of the samples, Hz.
    length : samples in a segment.

    Returns
    -------
    (length // 2 + 1,) product of the signals' units over Hz, at frequencies from 0 to half the rate.
    """
    from scipy.signal import csd

    return np.asarray(csd(x, y, rate, "hann", length, length // 2, detrend="constant")[1], dtype=complex)


def statistics_of(x: Floats, rate: float) -> dict[str, float]:
    """Values of `RANDOM` for samples (nt,) at a rate in Hz, without the density."""
    mean, deviation = float(x.mean()), float(x.std())
    unknown = float("nan")
    y = (x - mean) / deviation if deviation > 0 else np.zeros(x.size)
    inner = y[1:-1]
    maxima = inner[(inner >= y[:-2]) & (inner > y[2:])]
    ups = int(np.sum((y[:-1] < 0) & (y[1:] >= 0)))
    return {
        "mean": mean,
        "rms": float(np.sqrt(np.mean(x**2))),
        "standard_deviation": deviation,
        "highest": float(x.max()),
        "lowest": float(x.min()),
        "crest_factor": float(np.abs(y).max()) if deviation > 0 else unknown,
        "kurtosis": float(np.mean(np.square(y * y))) if deviation > 0 else unknown,
        "crossing_rate_hz": ups * rate / (x.size - 1),
        "peaks_over_2_sigma": float(np.mean(maxima > 2.0)) if maxima.size else unknown,
        "peaks_over_3_sigma": float(np.mean(maxima > 3.0)) if maxima.size else unknown,
    }


def sampling_errors(signal: Mapping[str, Any]) -> dict[str, float]:
    """Half the relative 95 % interval of values that few peaks decide, by name; empty for a signal at rest.

    A Gaussian signal has half as many independent peaks as degrees of freedom.

    Parameters
    ----------
    signal : values of the signal by name; degrees_of_freedom is None or NaN at rest.
    """
    n = signal.get("degrees_of_freedom")
    if n is None or not n > 0.0:
        return {}
    errors = {
        "crest_factor": np.pi / np.sqrt(6.0) / (2.0 * np.log(max(0.5 * n, 2.0))),
        "kurtosis": np.sqrt(24.0 / n) / signal["kurtosis"],
    }
    for name in ("peaks_over_2_sigma", "peaks_over_3_sigma"):
        share = max(float(signal[name]), 1.0 / n)
        errors[name] = np.sqrt((1.0 - min(share, 1.0)) / (0.5 * n * share))
    return {name: 2.0 * float(error) for name, error in errors.items()}


def crossing_rates(x: Floats, rate: float) -> Floats:
    """Upward crossings per second of each of `LEVELS` by samples (nt,) at a rate in Hz; zero without motion."""
    deviation = float(x.std())
    if deviation == 0.0:
        return np.zeros(LEVELS.size)
    below = np.searchsorted(LEVELS, (x - x.mean()) / deviation, side="right")  # number of levels below each sample
    rising = below[1:] > below[:-1]
    crossed = np.bincount(below[:-1][rising], minlength=LEVELS.size + 1).cumsum()
    passed = np.bincount(below[1:][rising], minlength=LEVELS.size + 1).cumsum()
    return np.asarray((crossed - passed)[:-1] * (rate / (x.size - 1)), dtype=float)


_LONG_RECORD = 2**16  # samples


def rms_interval(x: Floats) -> dict[str, float]:
    """Equivalent degrees of freedom of the mean square of samples (nt,), and the interval of the root mean square."""
    from scipy.fft import prev_fast_len
    from scipy.special import chdtri

    y = x - x.mean()
    # a transform takes up to ten times as long if the number of samples has large prime factors
    of_spectrum = y if y.size < _LONG_RECORD else y[: prev_fast_len(y.size, real=True)]
    lines = np.fft.rfft(of_spectrum)[1:]
    power = lines.real**2 + lines.imag**2
    squares = y * y
    square, fourth = float(np.mean(squares)), float(np.mean(squares * squares))
    if square == 0.0:
        return {}
    freedom = 4.0 * float(power.sum()) ** 2 / float(power @ power) - 2.0
    freedom = float(max(freedom / max(1.0, 0.5 * (fourth / square**2 - 1.0)), 1.0))
    tail = 0.5 * (1.0 - CONFIDENCE)
    low, high = (
        float(np.sqrt(x.mean() ** 2 + square * freedom / chdtri(freedom, share))) for share in (tail, 1 - tail)
    )
    return {"degrees_of_freedom": freedom, "rms_low": low, "rms_high": high}


class Compression(NamedTuple):
    """Snubber between a structure and its mounting: stored energy at a turning point."""

    law: ContactLaw
    stiffness: float  # N/m, static stiffness of the structure at the snubber; 0 if it moves freely
    penetration: float  # m, mean
    force: float  # N, mean

    def energy(self, force: float) -> float:
        """Energy at a peak of the force (N), J; see the module."""
        return self._stored_energy(self.law.static_penetration(force))

    def largest(self, energy: float) -> float:
        """Force at the peak with a given energy (J), N; the force of least energy if the energy is smaller."""
        from scipy.optimize import brentq

        # from the larger one on, the energy grows with penetration, since no law softens
        low = max(self.penetration, self.law.static_penetration(self.force) if self.force > 0.0 else 0.0)
        high, step = low, abs(self.penetration)
        while self._stored_energy(high) < energy:
            high, step = high + step, 2.0 * step
        if high > low:
            high = brentq(lambda penetration: self._stored_energy(penetration) - energy, low, high)
        return float(self.law.static_force(np.array(high)))

    def _stored_energy(self, penetration: float) -> float:
        moved = penetration - self.penetration
        springs = self.law.static_springs
        pressed = (0.5 * s.stiffness * max(s.direction * penetration - s.offset, 0.0) ** 2 for s in springs)
        return sum(pressed) - self.force * moved + 0.5 * self.stiffness * moved**2


def _compression(system: StructuralSystem, histories: Dataset, name: str, first: int) -> Compression | None:
    """Snubber of a run with the structure's stiffness, and means from a sample on; None if there is none."""
    if name not in histories.labels("snubber"):
        return None
    contacts, omega2 = system.dynamics.contacts, system.dynamics.stiffness
    j = [each.name for each in system.snubbers].index(name)
    with np.errstate(divide="ignore", invalid="ignore"):
        compliance = float(np.nansum(contacts.shape[j] ** 2 / omega2))  # infinite for a body that moves freely there
    of_snubber = (histories[f"snubber_{each}"].sel(snubber=name).values for each in ("penetration", "force"))
    means = [float(values[first:].mean()) for values in of_snubber]
    return Compression(contacts.laws[j], 1.0 / compliance, *means)


class Magnitude(NamedTuple):
    """Signal whose largest value is estimated."""

    samples: Floats  # (nt,)
    one_sided: bool = False  # True: largest value; False: largest magnitude
    compression: Compression | None = None  # of the snubber, if the signal is its force

    def peaks(self, freedom: float) -> tuple[float, Floats]:
        """Mean of the signal, and the largest values of the (N,) segments."""
        mean = float(self.samples.mean())
        if self.one_sided:
            return mean, _segment_peaks(self.samples, freedom)
        return abs(mean), _segment_peaks(np.abs(self.samples), freedom)


def largest_of_test(signal: Magnitude, freedom: float, samples: float) -> dict[str, Any]:
    """Expected largest magnitude of a stationary signal in a test, with its interval.

    Parameters
    ----------
    signal : signal of the record.
    freedom : degrees of freedom of its mean square.
    samples : number of samples of the whole test.

    Returns
    -------
    Values of `RANDOM`, or the reason if the record is not sufficient; empty for a signal at rest.
    """
    (x, _, compression), (mean, peaks) = signal, signal.peaks(freedom)
    if peaks.size == 0 and freedom:
        return {UNKNOWN_PEAK_KEY: f"the record has fewer than {FEWEST_SEGMENTS} independent peaks"}
    if peaks.max(initial=0.0) <= 0.0:
        return {}
    if peaks.min() <= (mean if compression is None else 0.0):
        return {UNKNOWN_PEAK_KEY: "it is zero in a part of the record"}
    bounded = np.sort(peaks)[-2:]
    if np.ptp(bounded) <= SAME_PEAK * bounded[1]:  # a force that yields has a bound
        return dict.fromkeys(EXPECTED_PEAK_KEYS, float(bounded[1]))
    if compression is None:
        found = mean + np.sqrt(_extrapolate((peaks - mean) ** 2, samples / x.size))
        return dict(zip(EXPECTED_PEAK_KEYS, found.tolist(), strict=True))
    energies = np.array([compression.energy(peak) for peak in peaks.tolist()])
    if not np.isfinite(energies).all():  # more than the law can produce
        return {UNKNOWN_PEAK_KEY: "most of it is the force of a dashpot"}
    return {
        name: compression.largest(energy)
        for name, energy in zip(EXPECTED_PEAK_KEYS, _extrapolate(energies, samples / x.size).tolist(), strict=True)
    }


def deciding_share(signal: Magnitude, freedom: float, samples: float, limit: float) -> float:
    """Factor by which a record must be longer so that the interval of the largest value does not contain a limit.

    A longer record has more segments, up to the largest number, and then longer ones, whose largest value grows like
    that of exponential energies. Location, scale and shape are those of this record.

    Parameters
    ----------
    signal, freedom, samples : as in `largest_of_test`, whose result has the interval.
    limit : limit inside the interval, in the unit of the signal.

    Returns
    -------
    float
        Above 1; infinite if the largest value itself varies so much between tests that no record is long enough.
    """
    (x, _, compression), (mean, peaks) = signal, signal.peaks(freedom)
    if compression is None:
        energies, energy = (peaks - mean) ** 2, (limit - mean) ** 2
    else:
        energies = np.array([compression.energy(peak) for peak in peaks.tolist()])
        energy = compression.energy(limit)
    segments = energies.size
    energies = _independent_peaks(energies)
    joined = segments / energies.size  # number of segments with one independent peak each
    place, scale, skewness = _moments(np.sort(energies))
    for share in 2.0 ** np.arange(0.5, np.log2(LARGEST_DURATION_RATIO), 0.5):
        count = int(min(share * freedom / SEGMENT_FREEDOM, MOST_SEGMENTS) / joined)
        longer = share * energies.size / count  # number of segments
        pivot = _pivots(count, count * samples / x.size / share, skewness)
        low, high = place + scale * (np.log(longer) / np.log(2.0) + pivot[1:])
        if not low <= energy < high:
            return float(share)
    return math.inf


def _limit_on_peak(scenario: Scenario, signal: Mapping[str, Any]) -> float:
    """Lowest limit on the peaks of a signal, SI; nan without a limit."""
    limits = {} if scenario.limits is None else scenario.limits.values_by_name
    return min((limit for name, limit in limits.items() if _applies_to_peak(name, signal)), default=math.nan)


def _largest_in_run(values: Mapping[str, Any], signal: Mapping[str, Any]) -> float:
    """Largest magnitude of a signal in the run, also between samples; 0 for the input."""
    for name, value in LIMITED.items():
        if _applies_to_peak(name, signal) and value.entry in values:
            of_places = values[value.entry]
            return float(of_places if value.single else of_places.get(signal["name"], 0.0) * value.scale)
    return 0.0


def _applies_to_peak(limit: str, signal: Mapping[str, Any]) -> bool:
    """True if a limit (given by name) applies to the peaks of a signal."""
    value, place = parse_limit(limit)
    return value.on_peak_of(signal) and place in ("", signal["name"])


def margins_in_test(scenario: Scenario, margins: Margins, random: Dataset | None) -> Margins:
    """Margins of a run with a stationary input; limits on peaks use the largest values of the test.

    Without run.test_duration they use the values of the run, and are marked so.

    Parameters
    ----------
    scenario : scenario with a stationary input.
    margins : margins of the values of the run.
    random : statistics of the record; None if it is too short.

    Returns
    -------
    Margins
        If the largest value of a test is not known, and the run does not exceed the limit, the range is open.
    """
    run, found = not_none(scenario.run), dict(margins)
    rows = [] if random is None else random.rows("signal")
    signals = [signal for signal in rows if signal["section"] != INPUT_SECTION]
    for name, item in margins.items():
        if parse_limit(name)[0].from_extreme is None:  # root mean squares and densities
            continue
        if run.test_duration is None:
            found[name] = item | {"statistic": REACHED_TEXT}
            continue
        of_limit = [signal for signal in signals if _applies_to_peak(name, signal)]
        known = [_margin_in_test(run, item, signal) for signal in of_limit if not signal.get(UNKNOWN_PEAK_KEY)]
        if known and len(known) == len(of_limit):
            found[name] = item | max(known, key=itemgetter("value"))
        else:  # the largest value of the test is unknown
            found[name] = item | {"statistic": REACHED_TEXT, "highest": math.inf}
    return with_verdicts(found)


def _is_known(value: float | None) -> bool:
    return value is not None and not math.isnan(value)


def _margin_in_test(run: Run, item: Mapping[str, Any], signal: Mapping[str, Any]) -> dict[str, Any]:
    """Margin of one signal whose largest value in the test is known."""
    rests = not _is_known(signal.get(EXPECTED_PEAK_KEYS[0]))  # the signal is at rest
    still = max(abs(float(signal["highest"])), abs(float(signal["lowest"])))
    median, low, high = (still if rests else float(signal[name]) for name in EXPECTED_PEAK_KEYS)
    test = "largest value in run.test_duration"
    if run.test_peak == "interval":
        size, statistic = high, f"upper end of the 95 % interval of the {test}"
    elif run.test_peak == "median":
        size = low = high = median
        statistic = f"median of the {test}"
    else:
        size = low = high = float(signal["three_sigma"])
        statistic = "mean and three standard deviations"
    limit = item["limit"]
    of_place = {"value": size, "lowest": low, "highest": high, "margin": margin_of(limit, size), "statistic": statistic}
    of_place["reached"] = item["value"]
    of_place |= {"at": str(signal["name"])} if item["at"] and signal["section"] != STRESS[0] else {}
    if run.test_peak == "interval":
        of_place |= {"interval_low": low, "interval_high": high}
        if low <= limit < high:
            after = signal.get("decided_after_s")
            of_place["decided_after_s"] = after if after is not None and math.isfinite(after) else math.nan
    return of_place


def with_test_outcome(outcome: Outcome, random: Dataset | None, settings: Run) -> Outcome:
    """Mark the outcome of a run as incomplete if requested largest values of the test are not reliable.

    Parameters
    ----------
    outcome : outcome of the motion.
    random : statistics of the record; None if it is too short.
    settings : settings of the run.
    """
    unknown = {} if random is None else random.by_label(UNKNOWN_PEAK_KEY)
    reasons = {why.item(): signal for signal, why in reversed(unknown.items()) if why.item()}
    reason = "; ".join(f"{signal}: {why}" for why, signal in reasons.items()).replace("_", " ")
    reason = "the record is too short" if random is None else reason
    if settings.test_duration is None or not reason:
        return outcome
    sentence, remedy = f"not every largest value of the test is reliable: {reason}", "run longer (run.duration)"
    of_motion = outcome.unless_complete
    return Outcome.of(OutcomeKind.INCOMPLETE, "largest_of_test_unknown", sentence, *of_motion, remedy=remedy)


def _changes_beyond_record(
    result: RunResult, system: StructuralSystem, first: int, samples: float
) -> dict[tuple[str, str], str]:
    """Reasons why a test may be unlike its record, by name and quantity of the contact force that changes.

    Parameters
    ----------
    result, system : result and system of the run.
    first : first sample of the record.
    samples : number of samples of the whole test.
    """
    reasons = {}
    for name, unit, values, law in _motions_of_contacts(result, system):
        x = values[first:]
        mean, freedom = float(x.mean()), rms_interval(x).get("degrees_of_freedom", 0.0)
        for direction in (1.0, -1.0):
            peaks = _segment_peaks(direction * (x - mean), freedom)
            if peaks.size == 0:
                continue
            low = mean + direction * float(np.median(peaks))
            high = mean + direction * float(_extrapolate(peaks**2, samples / x.size)[2]) ** 0.5
            phases = [law.phases[law.resting_phase(at)] for at in np.linspace(low, high, 33).tolist()]
            stiffness = [phase.stiffness for phase in phases]
            if np.ptp(stiffness) > LARGEST_STIFFNESS_CHANGE * np.abs(stiffness).max():
                reasons[name.removeprefix("snubber "), "force"] = (
                    f"the stiffness of {name} changes between {1e3 * low:.3g} m{unit}, which half of the record does "
                    f"not exceed, and {1e3 * high:.3g} m{unit}, which the test may reach"
                )
    return reasons


def _motions_of_contacts(result: RunResult, system: StructuralSystem) -> Iterator[tuple[str, str, Floats, ContactLaw]]:
    """Name, unit, penetration or extension (nt,) and law of each contact whose motion is in the result file.

    Sides of rings are contacts, too: their penetration follows from the position in the ring. Friction in a ring is
    left out: its stiffness changes with the normal force of its side, which is judged.
    """
    histories, laws = result["histories"], system.dynamics.contacts.laws
    pressed = histories.by_label("snubber_penetration")
    for (name, penetration), law in zip(pressed.items(), laws[: len(pressed)], strict=True):
        yield f"snubber {name}", penetration.unit, penetration.values, law
    stretched = histories.by_label("spring_extension") | histories.by_label("friction_displacement")
    for spring in system.springs:
        if spring.law is not None and spring.part is None:
            yield f"spring {spring.name}", "m", stretched[spring.name].values, spring.law
    for ring in system.rings:
        first, second = (result["rings"].by_label(f"{of}_position")[ring.name].values for of in ("first", "second"))
        beyond = np.column_stack([first, second]) @ ring.normals.T - ring.support
        for side, penetration in zip(ring.sides.tolist(), beyond.T, strict=True):
            yield f"ring {ring.name}", "m", penetration, laws[side]


def _segment_peaks(x: Floats, freedom: float) -> Floats:
    """(N,) largest values of the segments of samples (nt,); empty if there are too few."""
    count = int(min(freedom // SEGMENT_FREEDOM, MOST_SEGMENTS))
    return np.array([part.max() for part in np.array_split(x, count)] if count >= FEWEST_SEGMENTS else [])


def _extrapolate(energies: Floats, duration_ratio: float) -> Floats:
    """(3,) median and interval of the largest energy of a test, from those of segments (N,) of a record.

    Parameters
    ----------
    energies : energies in order of time, J or the square of a unit.
    duration_ratio : duration of the test over that of the record.
    """
    energies = _independent_peaks(energies)
    place, scale, skewness = _moments(np.sort(energies))
    return np.asarray(np.maximum(place + scale * _pivots(energies.size, energies.size * duration_ratio, skewness), 0.0))


def _pivots(count: int, segments: float, skewness: Floats) -> Floats:
    """(3,) median and interval of (largest of a test - location) / scale, for random records of similar skewness.

    Parameters
    ----------
    count : number of segments of the record.
    segments : number of segments of the test.
    skewness : ratio of the third to the second L-moment of the record.
    """
    of_draws, pivots = _drawn_records(count, segments)
    alike, tail = DRAWS // 10, 0.5 * (1.0 - CONFIDENCE)
    first = int(np.clip(np.searchsorted(of_draws, skewness) - alike // 2, 0, DRAWS - alike))
    return np.asarray(np.quantile(pivots[first : first + alike], [0.5, tail, 1.0 - tail]))


def _independent_peaks(peaks: Floats) -> Floats:
    """Peaks of segments (N,), merged in pairs while neighbours are high together."""
    while peaks.size >= 2 * FEWEST_SEGMENTS:
        about = peaks - peaks.mean()
        if about[1:] @ about[:-1] <= 0.0:
            break
        pairs = peaks[: 2 * (peaks.size // 2)].reshape(-1, 2)
        peaks = pairs.max(axis=1)
    return peaks


def _moments(x: Floats) -> tuple[Floats, Floats, Floats]:
    """First two L-moments, and the ratio of the third to the second, of sorted samples (..., N)."""
    count = x.shape[-1]
    i = np.arange(count)
    mean, first = x.mean(axis=-1), x @ i / (count * (count - 1))
    second, scale = x @ (i * (i - 1)) / (count * (count - 1) * (count - 2)), 2.0 * first - mean
    return mean, scale, (6.0 * second - 6.0 * first + mean) / scale


@cache
def _drawn_records(count: int, segments: float) -> tuple[Floats, Floats]:
    """(DRAWS,) sorted ratios of the third to the second L-moment of random records, and scaled largest values."""
    generator = np.random.default_rng(0)
    shape = generator.uniform(-0.3, 0.25, size=(DRAWS, 1))
    passed = generator.exponential(size=(DRAWS, count + 1))
    passed[:, -1] /= segments
    values = (passed**-shape - 1.0) / shape
    place, scale, skewness = _moments(np.sort(values[:, :-1]))
    order = np.argsort(skewness)
    return skewness[order], ((values[:, -1] - place) / scale)[order]
