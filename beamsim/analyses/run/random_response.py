r"""Response to stationary inputs, random or measured: densities, RMS, statistics of peaks and levels, transmissibility.

Densities are one-sided, by Welch's method (P. D. Welch, IEEE Trans. Audio Electroacoust. 15, 1967) with Hann windows
and half overlap. The transmissibility is :math:`H_1 = S_{xy} / S_{xx}`; the coherence says where it means something:
it is 1 for a linear structure, and below 1 where contact scatters energy to other frequencies.

*Confidence.* The mean square of a record of duration T of a Gaussian process has the variance
:math:`\int S^2 df / T` (J. S. Bendat, A. G. Piersol, Random Data, ch. 8), as a chi-square variable with
:math:`n = 2 T (\int S df)^2 / \int S^2 df` degrees of freedom. The lines :math:`p_k` of the periodogram, with the full
resolution 1/T, give :math:`n = 4 (\sum p_k)^2 / \sum p_k^2 - 2`, as the mean of :math:`p_k^2` is twice the square of
that of :math:`p_k`. Where the kurtosis exceeds that of a Gaussian signal, the mean square scatters more, and n is
divided by half of the kurtosis less 1. The interval is that of repeated records of a Gaussian input, whether the
amplitudes of this one are random or fixed.

*The largest value of a test.* The record is cut into N segments. The energies at their peaks follow E. J. Gumbel's
distribution (Statistics of Extremes, 1958), since energy is exponentially distributed: in the limit for a Gaussian
signal (A. G. Davenport, Proc. ICE 28, 1964), and in stationary white noise for an oscillator with any spring (T. K.
Caughey, J. Acoust. Soc. Am. 35, 1963). The energy is the square of the distance from the mean, and of a snubber's force
F what is stored where the structure is turned back: with the penetration :math:`\delta` of its law after a long rest,
means :math:`\bar\delta, \bar F` and the static stiffness k of the structure at the snubber,

.. math:: \int_0^\delta F d\delta - \bar F (\delta - \bar\delta) + k (\delta - \bar\delta)^2 / 2.

Stops, friction and springs that grow softer change that law. So the shape of a generalised extreme value distribution
is left open, from -0.3, which has an end, to 0.25, a heavy tail; Gumbel's is 0. The first two L-moments (J. R. M.
Hosking, J. R. Stat. Soc. B 52, 1990) are location and scale; the ratio of the third to the second says what it can of
the shape. Of 20,000 drawn records of N energies, each with the largest one of a test, the tenth closest in that ratio
gives median and interval of (largest - location) / scale, with how little N segments say. A segment has eight degrees
of freedom, so that its peak says nothing of the next one. Where the frequency changes with the amplitude they seem to
be more than they are: segments are joined in pairs as long as neighbours have high peaks together.

*When it is not stated.* The test has to be more of the same. Where the stiffness of a contact changes by half of it
between the median of the segments' deflections and the upper end of the interval of that deflection in the test, only
the force of that snubber is stated, which follows its law.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from beamsim.analyses.run.impacts import CONFIDENCE, SKIPPED
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
from beamsim.scenario.run import Run
from beamsim.scenario.units import ACCELERATION_PSD, FORCE_PSD, MOMENT_PSD
from beamsim.system.reduced_model import ActingLoads
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Complexes, Floats, not_none

_DENSITY_OF = {"m/s^2": ACCELERATION_PSD.name, "N": FORCE_PSD.name, "N m": MOMENT_PSD.name}
SEGMENTS = 16  # of the record, overlapping by half
LEAST_SAMPLES = 64
FREEDOM_OF_SEGMENT = 8  # degrees of freedom of a segment that has a peak of its own
FEWEST_SEGMENTS, MOST_SEGMENTS = 5, 50
EXPECTED = "expected_peak", "expected_peak_low", "expected_peak_high"
UNKNOWN = "expected_peak_unknown"
SAME_PEAK = 1e-9  # relative, within which the largest peaks of two segments are one, which none exceeds
OTHER_STIFFNESS = 0.5  # of the largest: a change of a contact's stiffness that makes a test unlike its record
DRAWS = 20_000  # of records, for the interval of a largest value
REACHED = "largest value that the run reached"  # with which limits are compared where no test is known
MOST_TIMES_AS_LONG = 1000  # a record that is to decide on a limit
LEVELS = np.linspace(-12.0, 12.0, 97)  # whose crossings are counted, in standard deviations above the mean


class StationarySignal(NamedTuple):
    """A history of a run with a stationary input: the input, or a response."""

    section: str
    name: str
    quantity: str
    unit: str
    history: Floats  # (nt,)

    @property
    def label(self) -> str:
        """Name and quantity."""
        return f"{self.name} {self.quantity}"


def random_response(result: RunResult, motion: RunMotion, found: Mapping[str, Any]) -> Dataset | None:
    """Analyse a run with a stationary input, a process of which the run is a sample.

    Of several inputs the base's is shown, or else that of the first force or support; they have no transmissibility.

    Parameters
    ----------
    result : of the run.
    motion : it came from.
    found : values of the motion, by entry of the summary.

    Returns
    -------
    Dataset or None
        Of the layout `RANDOM`; None where the run is too short.
    """
    times, system = result["histories"]["time"].values, motion.system
    if times.size - int(SKIPPED * times.size) < LEAST_SAMPLES:
        return None
    record = StationaryRecord(result, system, found)
    entered = _input_of(system, result["histories"])
    shaken, alone = system.base_acceleration is not None, len(result.scenario.excitation.items) == 1
    signals, of_probes = [record.statistics(entered)], dict[str, tuple[Complexes, Floats]]()
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
    """The stationary part of a run, a sample of a test that may be longer.

    Parameters
    ----------
    result : of the run.
    system : of it.
    found : values of the motion, by entry of the summary.
    """

    def __init__(self, result: RunResult, system: StructuralSystem, found: Mapping[str, Any]) -> None:
        self._histories, self._scenario, self._system, self._found = result["histories"], result.scenario, system, found
        times, settings = self._histories["time"].values, not_none(result.scenario.run)
        self.first = int(SKIPPED * times.size)  # sample with which it begins
        self._end, self._rate = float(times[-1]), (times.size - 1) / float(times[-1] - times[0])  # s, Hz
        self._segment = max(2 * (times.size - self.first) // (SEGMENTS + 1), LEAST_SAMPLES // 2)  # samples of a density
        self.frequency: Floats = np.asarray(np.fft.rfftfreq(self._segment, 1.0 / self._rate), dtype=float)  # Hz
        self.tested = settings.test_duration or settings.duration  # s
        self._outlasts = self.tested >= settings.duration  # what was seen, its beginning included
        self._linear = linear_responses(system, self.frequency)
        self._beyond = _beyond_record(result, system, self.first, self.tested * self._rate)

    def statistics(self, signal: StationarySignal) -> dict[str, Any]:
        """Values of `RANDOM` of a signal, by name; those that it does not have are left out."""
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
        """The largest value that a signal is expected to reach in the test, or why that is unknown; mean and 3 sigma.

        Parameters
        ----------
        signal : with its history.
        freedom : degrees of freedom of its mean square.
        """
        name, quantity = signal.name, signal.quantity
        seen = _behind_filter(self._histories, signal)[self.first :]
        pressed = _compression(self._system, self._histories, name, self.first) if quantity == "force" else None
        measured, samples = Magnitude(seen, quantity == "opening", pressed), self.tested * self._rate
        others = [why for of, why in self._beyond.items() if of != (name, quantity) and name != "input"]
        expected: dict[str, Any] = {UNKNOWN: others[0]} if others else largest_of_test(measured, freedom, samples)
        if not expected and (name, quantity) in self._beyond:
            expected[UNKNOWN] = self._beyond[name, quantity]  # of a stop that only the test may reach
        mean = float(seen.mean())
        expected["three_sigma"] = (mean if measured.one_sided else abs(mean)) + 3.0 * float(seen.std())
        if EXPECTED[0] in expected:
            limit = _limit_on_peak(self._scenario, signal._asdict())
            if expected[EXPECTED[1]] <= limit < expected[EXPECTED[2]]:
                expected["decided_after_s"] = self._end * deciding_share(measured, freedom, samples, limit)
            if self._outlasts:
                reached = _largest_in_run(self._found, signal._asdict())
                expected |= {each: max(expected[each], reached) for each in EXPECTED}
        return expected

    def transmissibility(
        self, given: Floats, response: Floats, input_density: Floats, density: Floats
    ) -> tuple[Complexes, Floats]:
        """H1 from the input's history (nt,) to a response's, and their coherence, (nf,) each.

        Parameters
        ----------
        given, response : histories.
        input_density, density : (nf,) of the two.
        """
        cross = cross_density(given[self.first :], response[self.first :], self._rate, self._segment)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(cross / input_density), np.asarray(np.abs(cross) ** 2 / (input_density * density))


def _columns(signals: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """What is known of signals, as variables along them: NaN where one has not what others have."""
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


def _input_of(system: StructuralSystem, histories: Dataset) -> StationarySignal:
    """The input that is shown: the base's, or else that of the first force or support."""
    acting = ActingLoads.of(system.scenario)
    _, shown = acting.base or (*acting.forces, *acting.supports)[0]
    shaken = system.base_acceleration is not None
    history = histories["base_acceleration"].values if shaken else system.forcing.signal[0](histories["time"].values)
    quantity = str(shown.level_quantities[0])
    return StationarySignal("excitation", "input", quantity, amplitude_unit(quantity), history)


def _behind_filter(histories: Dataset, signal: StationarySignal) -> Floats:
    """The history of a signal of which the largest value is expected: an acceleration behind run.low_pass."""
    if signal.section == "probes" and signal.quantity == MAIN_QUANTITY and "low_passed_acceleration" in histories:
        return histories["low_passed_acceleration"].sel(probe=signal.name).values
    return signal.history


def _responses(result: RunResult, motion: RunMotion) -> Iterator[StationarySignal]:
    """The responses; openings and the largest stress where they have limits."""
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

    Segments overlap by half, lose their means and are seen through a Hann window.

    Parameters
    ----------
    x, y : (nt,) samples at equal steps.
    rate : of the samples, Hz.
    length : of a segment, samples.

    Returns
    -------
    (length // 2 + 1,) product of the signals' units over Hz, at frequencies from 0 to half the rate.
    """
    from scipy.signal import csd

    return np.asarray(csd(x, y, rate, "hann", length, length // 2, detrend="constant")[1], dtype=complex)


def statistics_of(x: Floats, rate: float) -> dict[str, float]:
    """Values of `RANDOM` of samples (nt,) at a rate in Hz, the density apart."""
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
    """Half of the 95 % interval of what few peaks decide, over its size, by its name; none of a signal that rests.

    A Gaussian signal has half as many independent peaks as degrees of freedom.

    Parameters
    ----------
    signal : its values by name, degrees_of_freedom None or NaN where it rests.
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
    """Upward crossings per second of each of `LEVELS` by samples (nt,) at a rate in Hz; zeros without any motion."""
    deviation = float(x.std())
    if deviation == 0.0:
        return np.zeros(LEVELS.size)
    below = np.searchsorted(LEVELS, (x - x.mean()) / deviation, side="right")  # levels that are not above each sample
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
    # a transform takes up to ten times as long where the number of samples has large prime factors
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
    """A snubber between a structure and its stand: what is stored where the structure is turned back."""

    law: ContactLaw
    stiffness: float  # N/m, static, of the structure at the snubber; 0 where it moves freely
    penetration: float  # m, mean
    force: float  # N, mean

    def energy(self, force: float) -> float:
        """J, at a peak of the force, N; see the module."""
        return self._stored_energy(self.law.static_penetration(force))

    def largest(self, energy: float) -> float:
        """Force, N, at the peak that has an energy, J; that where the energy is least for a smaller one."""
        from scipy.optimize import brentq

        # from the larger of the two on it grows with the penetration, as no law becomes weaker
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
    """A snubber of a run, and the structure behind it, with means from a sample on; None without one."""
    if name not in histories.labels("snubber"):
        return None
    contacts, omega2 = system.dynamics.contacts, system.dynamics.stiffness
    j = [each.name for each in system.snubbers].index(name)
    with np.errstate(divide="ignore", invalid="ignore"):
        compliance = float(np.nansum(contacts.shape[j] ** 2 / omega2))  # infinite of a body that moves freely there
    of_snubber = (histories[f"snubber_{each}"].sel(snubber=name).values for each in ("penetration", "force"))
    means = [float(values[first:].mean()) for values in of_snubber]
    return Compression(contacts.laws[j], 1.0 / compliance, *means)


class Magnitude(NamedTuple):
    """A signal of which the largest value is expected."""

    samples: Floats  # (nt,)
    one_sided: bool = False  # whether the largest value counts, and not the largest magnitude
    compression: Compression | None = None  # of the snubber whose force it is

    def peaks(self, freedom: float) -> tuple[float, Floats]:
        """The mean from which it departs, and the largest values of (N,) segments."""
        mean = float(self.samples.mean())
        if self.one_sided:
            return mean, _segment_peaks(self.samples, freedom)
        return abs(mean), _segment_peaks(np.abs(self.samples), freedom)


def largest_of_test(signal: Magnitude, freedom: float, samples: float) -> dict[str, Any]:
    """Largest magnitude that a stationary signal is expected to reach in a test, and its interval.

    Parameters
    ----------
    signal : in the record.
    freedom : degrees of freedom of its mean square.
    samples : of the whole test.

    Returns
    -------
    Values of `RANDOM`: the reason where the record does not say enough; none of a signal that rests.
    """
    (x, _, compression), (mean, peaks) = signal, signal.peaks(freedom)
    if peaks.size == 0 and freedom:
        return {UNKNOWN: f"the record has fewer than {FEWEST_SEGMENTS} independent peaks"}
    if peaks.max(initial=0.0) <= 0.0:
        return {}
    if peaks.min() <= (mean if compression is None else 0.0):
        return {UNKNOWN: "a part of the record is without it"}
    bounded = np.sort(peaks)[-2:]
    if np.ptp(bounded) <= SAME_PEAK * bounded[1]:  # the limit of a force that gives way
        return dict.fromkeys(EXPECTED, float(bounded[1]))
    if compression is None:
        found = mean + np.sqrt(_extrapolate((peaks - mean) ** 2, samples / x.size))
        return dict(zip(EXPECTED, found.tolist(), strict=True))
    energies = np.array([compression.energy(peak) for peak in peaks.tolist()])
    if not np.isfinite(energies).all():  # more than the law gives
        return {UNKNOWN: "most of it is the force of a dashpot"}
    return {
        name: compression.largest(energy)
        for name, energy in zip(EXPECTED, _extrapolate(energies, samples / x.size).tolist(), strict=True)
    }


def deciding_share(signal: Magnitude, freedom: float, samples: float, limit: float) -> float:
    """How many times as long a record has to be for the interval of the largest value not to span a limit.

    A longer record has more segments, up to the most that are taken, and then longer ones, of which the largest value
    grows as that of exponential energies does. Location, scale and shape are those of this record.

    Parameters
    ----------
    signal, freedom, samples : as of `largest_of_test`, which knows the interval.
    limit : inside the interval, in the unit of the signal.

    Returns
    -------
    float
        Above 1; infinite where the largest value itself scatters so much from test to test that no record decides.
    """
    (x, _, compression), (mean, peaks) = signal, signal.peaks(freedom)
    if compression is None:
        energies, energy = (peaks - mean) ** 2, (limit - mean) ** 2
    else:
        energies = np.array([compression.energy(peak) for peak in peaks.tolist()])
        energy = compression.energy(limit)
    segments = energies.size
    energies = _independent(energies)
    joined = segments / energies.size  # of which one peak each is independent
    place, scale, skewness = _moments(np.sort(energies))
    for share in 2.0 ** np.arange(0.5, np.log2(MOST_TIMES_AS_LONG), 0.5):
        count = int(min(share * freedom / FREEDOM_OF_SEGMENT, MOST_SEGMENTS) / joined)
        longer = share * energies.size / count  # segments
        pivot = _pivots(count, count * samples / x.size / share, skewness)
        low, high = place + scale * (np.log(longer) / np.log(2.0) + pivot[1:])
        if not low <= energy < high:
            return float(share)
    return math.inf


def _limit_on_peak(scenario: Scenario, signal: Mapping[str, Any]) -> float:
    """The lowest limit on the peaks of a signal, SI; nan without any."""
    limits = {} if scenario.limits is None else scenario.limits.values_by_name
    return min((limit for name, limit in limits.items() if _on_peak(name, signal)), default=math.nan)


def _largest_in_run(found: Mapping[str, Any], signal: Mapping[str, Any]) -> float:
    """The largest magnitude of a signal in the run, between samples, too; 0 of the input, which is known anyway."""
    for name, value in LIMITED.items():
        if _on_peak(name, signal) and value.entry in found:
            of_places = found[value.entry]
            return float(of_places if value.single else of_places.get(signal["name"], 0.0) * value.scale)
    return 0.0


def _on_peak(limit: str, signal: Mapping[str, Any]) -> bool:
    """Whether a limit, by its name, is on the peaks of a signal."""
    value, place = parse_limit(limit)
    return value.on_peak_of(signal) and place in ("", signal["name"])


def margins_in_test(scenario: Scenario, compared: Margins, random: Dataset | None) -> Margins:
    """Margins of a run with a stationary input, with those on peaks by the largest values of the test.

    Without run.test_duration they are by what the run reached, and marked so.

    Parameters
    ----------
    scenario : with a stationary input.
    compared : margins of the values that the run reached.
    random : statistics of the record; None of one that is too short.

    Returns
    -------
    Margins
        Where the largest value of a test is not known, and the run has not exceeded the limit, the range is open.
    """
    run, found = not_none(scenario.run), dict(compared)
    signals = [] if random is None else random.rows("signal")[1:]
    for name, item in compared.items():
        if parse_limit(name)[0].of is None:  # root mean squares and densities
            continue
        if run.test_duration is None:
            found[name] = item | {"statistic": REACHED}
            continue
        of_limit = [signal for signal in signals if _on_peak(name, signal)]
        known = [_in_test(run, item, signal) for signal in of_limit if not signal.get(UNKNOWN)]
        if known and len(known) == len(of_limit):
            found[name] = item | max(known, key=itemgetter("value"))
        else:  # the largest value of the test is not known
            found[name] = item | {"statistic": REACHED, "highest": math.inf}
    return with_verdicts(found)


def _known(value: float | None) -> bool:
    return value is not None and not math.isnan(value)


def _in_test(run: Run, item: Mapping[str, Any], signal: Mapping[str, Any]) -> dict[str, Any]:
    """Margin of one signal whose largest value in the test is known."""
    rests = not _known(signal.get(EXPECTED[0]))  # at what it reached
    still = max(abs(float(signal["highest"])), abs(float(signal["lowest"])))
    median, low, high = (still if rests else float(signal[name]) for name in EXPECTED)
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


def largest_known(outcome: Outcome, random: Dataset | None, settings: Run) -> Outcome:
    """The outcome of a run, which is incomplete where largest values of a test were asked for and are not reliable.

    Parameters
    ----------
    outcome : of the motion.
    random : statistics of the record; None of one that is too short.
    settings : of the run.
    """
    unknown = {} if random is None else random.by_label(UNKNOWN)
    reasons = {why.item(): signal for signal, why in reversed(unknown.items()) if why.item()}
    reason = "; ".join(f"{signal}: {why}" for why, signal in reasons.items()).replace("_", " ")
    reason = "the record is too short" if random is None else reason
    if settings.test_duration is None or not reason:
        return outcome
    sentence, remedy = f"not every largest value of the test is reliable: {reason}", "run longer (run.duration)"
    of_motion = outcome.unless_complete
    return Outcome.of(OutcomeKind.INCOMPLETE, "largest_of_test_unknown", sentence, *of_motion, remedy=remedy)


def _beyond_record(
    result: RunResult, system: StructuralSystem, first: int, samples: float
) -> dict[tuple[str, str], str]:
    """Why a test may be unlike its record, by name and quantity of the force of the contact that is the reason.

    Parameters
    ----------
    result, system : of the run.
    first : sample with which the record begins.
    samples : of the whole test.
    """
    histories = result["histories"]
    pressed = histories.by_label("snubber_penetration")
    moved = [(f"snubber {name}", penetration.unit, penetration.values) for name, penetration in pressed.items()]
    stretched = histories.by_label("spring_extension") | histories.by_label("friction_displacement")
    moved += [(f"spring {s.name}", "m", stretched[s.name].values) for s in system.springs if s.law is not None]
    reasons = {}
    for (name, unit, values), law in zip(moved, system.dynamics.contacts.laws, strict=True):
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
            if np.ptp(stiffness) > OTHER_STIFFNESS * np.abs(stiffness).max():
                reasons[name.removeprefix("snubber "), "force"] = (
                    f"the stiffness of {name} changes between {1e3 * low:.3g} m{unit}, which half of the record does "
                    f"not exceed, and {1e3 * high:.3g} m{unit}, which the test may reach"
                )
    return reasons


def _segment_peaks(x: Floats, freedom: float) -> Floats:
    """(N,) largest values of the segments of samples (nt,); empty where there are too few."""
    count = int(min(freedom // FREEDOM_OF_SEGMENT, MOST_SEGMENTS))
    return np.array([part.max() for part in np.array_split(x, count)] if count >= FEWEST_SEGMENTS else [])


def _extrapolate(energies: Floats, longer: float) -> Floats:
    """(3,) median and interval of the largest energy of a test from those of segments (N,) of a record.

    Parameters
    ----------
    energies : in the order of time, J or the square of a unit.
    longer : the test over the record.
    """
    energies = _independent(energies)
    place, scale, skewness = _moments(np.sort(energies))
    return np.asarray(np.maximum(place + scale * _pivots(energies.size, energies.size * longer, skewness), 0.0))


def _pivots(count: int, segments: float, skewness: Floats) -> Floats:
    """(3,) median and interval of (largest of a test - location) / scale, of drawn records with alike skewness.

    Parameters
    ----------
    count : of segments of the record.
    segments : of the test.
    skewness : of the record, the ratio of its third to its second L-moment.
    """
    of_draws, pivots = _drawn_records(count, segments)
    alike, tail = DRAWS // 10, 0.5 * (1.0 - CONFIDENCE)
    first = int(np.clip(np.searchsorted(of_draws, skewness) - alike // 2, 0, DRAWS - alike))
    return np.asarray(np.quantile(pivots[first : first + alike], [0.5, tail, 1.0 - tail]))


def _independent(peaks: Floats) -> Floats:
    """Peaks of segments (N,), joined in pairs as long as neighbours are high together."""
    while peaks.size >= 2 * FEWEST_SEGMENTS:
        about = peaks - peaks.mean()
        if about[1:] @ about[:-1] <= 0.0:
            break
        pairs = peaks[: 2 * (peaks.size // 2)].reshape(-1, 2)
        peaks = pairs.max(axis=1)
    return peaks


def _moments(x: Floats) -> tuple[Floats, Floats, Floats]:
    """The first two L-moments and the ratio of the third to the second, of samples (..., N) in rising order."""
    count = x.shape[-1]
    i = np.arange(count)
    mean, first = x.mean(axis=-1), x @ i / (count * (count - 1))
    second, scale = x @ (i * (i - 1)) / (count * (count - 1) * (count - 2)), 2.0 * first - mean
    return mean, scale, (6.0 * second - 6.0 * first + mean) / scale


@cache
def _drawn_records(count: int, segments: float) -> tuple[Floats, Floats]:
    """(DRAWS,) ratio of the third to the second L-moment of drawn records, rising, and the largest value of a test less
    the mean of the record, over the second."""
    generator = np.random.default_rng(0)
    shape = generator.uniform(-0.3, 0.25, size=(DRAWS, 1))
    passed = generator.exponential(size=(DRAWS, count + 1))
    passed[:, -1] /= segments
    values = (passed**-shape - 1.0) / shape
    place, scale, skewness = _moments(np.sort(values[:, :-1]))
    order = np.argsort(skewness)
    return skewness[order], ((values[:, -1] - place) / scale)[order]
