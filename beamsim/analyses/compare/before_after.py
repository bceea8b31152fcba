r"""Resonances before and after a test: their frequency, amplitude and damping, and which changes are significant.

A change of a value v is :math:`v_\mathrm{after} / v_\mathrm{before} - 1`. Two parts of it
need no change of the structure:

- a sweep displaces, lowers and widens a resonance (`beamsim.signals.sweep_rate`);
- the resolution: half the step of both responses and twice the standard deviation of their noise.

What remains without the first is significant if it is larger than the second.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from math import inf, nan
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from beamsim.analyses.compare.recorded_responses import TestResponse, common_responses, plain_name
from beamsim.analyses.compare.result import SHIFTED, Comparison, RecordPair, ResonanceShift, Shift, pair_datasets
from beamsim.errors import ScenarioError
from beamsim.measurements.signal import split_heading
from beamsim.outcomes import COMPLETE
from beamsim.results.values import margin_of, with_verdicts
from beamsim.scenario import Source, scenario_of
from beamsim.scenario.before_after import BeforeAfter
from beamsim.scenario.reporting import Limits
from beamsim.signals.noise import FEWEST_VALUES, white_noise
from beamsim.signals.resonance_peaks import LEAST_PROMINENCE, QualityPeak, pair_peaks, peaks_of
from beamsim.signals.sweep_rate import (
    NO_EFFECT,
    SweepEffect,
    is_beat,
    is_too_narrow,
    largest_displacement,
    sweep_effect,
)
from beamsim.typing import TINY, Floats

DEFAULT_LIMITS = {"frequency_shift": 0.05, "amplitude_shift": 0.20}
MOST_CANDIDATES = 24  # peaks of a response, of which those that stand out of the noise are resonances
NOISE_DEVIATIONS = 8.0  # standard deviations by which a peak stands out of thousands of noisy values
CONFIDENCE = 2.0  # standard deviations of the noise that the resolution contains
LEAST_LEVEL = 1e-3  # of the highest peak: lower ones are beyond the dynamic range of tests
LEAST_SHARE = 0.1  # of the highest peak: lower ones that have no partner are left out
FEWEST_OF_FIT = 10  # values within a half-power band from which its noise is estimated


class Resonance(NamedTuple):
    """A peak of a response with its errors, relative to its values."""

    frequency_hz: float
    level: float
    damping: float  # ratio; nan where it is not known
    steps: tuple[float, float, float]  # largest error by the step, of frequency, level and damping
    noise: tuple[float, float, float]  # standard deviation by the noise
    effect: SweepEffect  # of the sweep rate


def compare_tests(scenario: Source) -> Comparison:
    """Compare the resonances of test data before and after another test.

    Parameters
    ----------
    scenario : with the section ``before_after``, or what `beamsim.load_scenario` reads.

    Returns
    -------
    Comparison
        Its ``pairs`` has one for each channel; changes are compared with ``limits``, by default 5 % in frequency and
        20 % in amplitude.

    Raises
    ------
    ScenarioError
        If a file cannot be used, no channel is in both, or their units do not agree.

    Examples
    --------
    >>> import beamsim
    >>> files = {side: f"configs/measurements/search_{side}.csv" for side in ("before", "after")}
    >>> comparison = beamsim.compare_tests({"before_after": files})
    >>> first = comparison.pairs[0].resonances[0]
    >>> print(f"{first.before_hz:.0f} Hz, {first.after_hz:.0f} Hz, {100 * first.frequency.change:.1f} %")
    198 Hz, 185 Hz, -6.3 %
    >>> first.frequency.significant, comparison.summary["margins"]["frequency_shift"]["verdict"]
    (True, 'exceeded')
    """
    begin = perf_counter()
    scenario = scenario_of(scenario, "compare")
    if (section := scenario.before_after) is None:
        message = "is missing"
        raise ScenarioError.at("before_after", message, "add before_after: {before: a.csv, after: b.csv}")
    responses = list(common_responses(scenario, section))
    pairs = [_compared(section, *each) for each in responses]
    limits = _limits(scenario.limits, [pair.channel for pair in pairs])
    warnings = [
        f"{side}: {response.channel}: {text}"
        for both in responses
        for side, response in zip(("before", "after"), both, strict=True)
        for text in response.warnings
    ]
    return Comparison(
        scenario=scenario, outcome=COMPLETE, datasets=pair_datasets(pairs),
        warnings=tuple(dict.fromkeys([*_rate_warnings(responses), *warnings, *_pair_warnings(pairs)])),
        wall_time_s=perf_counter() - begin,
    ).with_summary(
        resonances=[_resonance_summary(pair, each) for pair in pairs for each in pair.resonances],
        margins=_margins(limits, pairs),
    )  # fmt: skip


# --- Resonances ------------------------------------------------------------------------------------------------------


def resonances_of(response: TestResponse) -> list[Resonance]:
    """Resonances of a response: its peaks that stand out of its noise and are no beats of a sweep, by frequency.

    Parameters
    ----------
    response : over frequency.

    Returns
    -------
    list of Resonance
    """
    f, amplitude = response.frequency_hz, response.amplitude
    logarithm = np.log(np.maximum(amplitude, TINY + 1e-12 * float(np.max(amplitude, initial=0.0))))
    scatter = white_noise(logarithm) if f.size > FEWEST_VALUES else 0.0
    found = []
    for peak in peaks_of(f, amplitude, most=MOST_CANDIDATES):
        noise = _relative_noise(response, peak, logarithm, scatter)
        if peak.prominence >= max(LEAST_PROMINENCE, np.exp(NOISE_DEVIATIONS * noise)):
            found.append((peak, noise))
    least = LEAST_LEVEL * max((peak.level for peak, _ in found), default=0.0)
    found = [(peak, noise) for peak, noise in found if peak.level >= least]
    beats = [peak for peak, _ in found if any(_is_beat(response, peak, other) for other, _ in found)]
    return [_resonance(response, peak, noise) for peak, noise in found if peak not in beats]


def _is_beat(response: TestResponse, peak: QualityPeak, other: QualityPeak) -> bool:
    """Whether a peak may be a beat that a sweep leaves behind a higher one."""
    if response.sweep is None or other.level <= peak.level:
        return False
    rate = response.sweep.rate_at(other.frequency_hz)
    narrow = [
        is_too_narrow(each.frequency_hz, each.quality, response.sweep.rate_at(each.frequency_hz))
        for each in (peak, other)
    ]
    follows = (peak.frequency_hz - other.frequency_hz) * rate > 0.0
    if narrow[0] or (narrow[1] and follows and not peak.quality > 0.0):  # the later, lower ones of beats have no band
        return True
    return is_beat(peak.frequency_hz, other.frequency_hz, other.quality, rate)


def _relative_noise(response: TestResponse, peak: QualityPeak, logarithm: Floats, scatter: float) -> float:
    """Relative standard deviation of the response at a peak.

    It is known of spectral densities. Else it follows from a polynomial that is fitted within the half-power band, or
    from the scatter of the whole response if that has too few values.
    """
    f = response.frequency_hz
    if response.noise is not None:
        return float(np.interp(peak.frequency_hz, f, response.noise))
    top = int(np.argmin(np.abs(f - peak.frequency_hz)))
    lower = np.flatnonzero(response.amplitude < peak.level / np.sqrt(2.0))
    ends = [int(end[0]) for end in (lower[lower < top][-1:], lower[lower > top][:1]) if end.size]
    if len(ends) < 2 or ends[1] - ends[0] <= FEWEST_OF_FIT:
        return scatter
    band = slice(ends[0] + 1, ends[1])
    x = 2.0 * (f[band] - peak.frequency_hz) / (f[ends[1]] - f[ends[0]])
    fitted = np.polyval(np.polyfit(x, logarithm[band], 4), x)
    return float(np.sqrt(np.sum((logarithm[band] - fitted) ** 2) / (x.size - 5)))


def _resonance(response: TestResponse, peak: QualityPeak, noise: float) -> Resonance:
    """A resonance with its errors.

    Near its peak the amplitude falls as :math:`1 / \\sqrt{1 + \\xi^2}`, where the half-power band is from -1 to 1. A
    value that is lower than the peak by its noise is at :math:`\\xi^2 = 2 \\sigma`. The ends of the band move by twice
    the relative error of the amplitude there, and by that of the peak.
    """
    f, quality = peak.frequency_hz, peak.quality
    step = float(np.interp(f, response.frequency_hz, response.step_hz))
    share = step * quality / f  # step over the half-power band
    unknown = not quality > 0.0
    steps = (
        0.5 * step / f + response.clock_error,
        0.0 if unknown else 1.0 - 1.0 / np.sqrt(1.0 + share**2),
        nan if unknown else share**2,
    )
    of_frequency = 0.5 * step / f if unknown else 0.5 / quality * np.sqrt(2.0 * noise)
    errors = (float(of_frequency), noise, nan if unknown else np.sqrt(6.0) * noise)
    if response.sweep is None:
        return Resonance(f, peak.level, 0.5 / quality, steps, errors, NO_EFFECT)
    rate = response.sweep.rate_at(f)
    effect = sweep_effect(f, quality, rate)
    if np.isnan(effect.frequency):  # the displacement lies between nothing and the largest possible
        half = 0.5 * largest_displacement(rate) / f
        effect, steps = effect._replace(frequency=1.0 + half), (steps[0] + abs(half), *steps[1:])
    else:  # the theory is of first order in the displacement; the width of the band, and what follows, has errors
        first_order = abs(effect.frequency - 1.0)
        doubt = 1.0 + min(CONFIDENCE * errors[2] + steps[2] + first_order, 0.5)
        ends = [sweep_effect(f, quality * factor, rate) for factor in (doubt, 1.0 / doubt)]
        spread = [0.5 * abs(float(np.log(a / b))) for a, b in zip(*ends, strict=True)]
        of_theory = (first_order**2, first_order, first_order)
        of_frequency, of_amplitude, of_damping = map(sum, zip(steps, spread, of_theory, strict=True))
        steps = of_frequency, of_amplitude, of_damping
    return Resonance(f, peak.level, 0.5 / quality, steps, errors, effect)


def _compared(section: BeforeAfter, before: TestResponse, after: TestResponse) -> RecordPair:
    """Resonances of a channel in both tests."""
    found = [resonances_of(each) for each in (before, after)]
    first, second = ([each.frequency_hz for each in side] for side in found)
    partner = pair_peaks(first, second, section.pairing)
    lacking = Resonance(nan, nan, nan, (nan,) * 3, (nan,) * 3, NO_EFFECT)
    pairs = [(each, found[1][partner[i]] if i in partner else lacking) for i, each in enumerate(found[0])]
    pairs += [(lacking, each) for j, each in enumerate(found[1]) if j not in partner.values()]
    highest = [max((each.level for each in side), default=0.0) for side in found]
    shown = [
        (a, b)
        for a, b in pairs
        if (a.level == a.level and b.level == b.level)
        or max(np.nan_to_num(a.level) / max(highest[0], TINY), np.nan_to_num(b.level) / max(highest[1], TINY))
        >= LEAST_SHARE
    ]
    shown.sort(key=lambda both: both[1].frequency_hz if np.isnan(both[0].frequency_hz) else both[0].frequency_hz)
    ends = float(before.frequency_hz[0]), float(before.frequency_hz[-1])
    return RecordPair(
        channel=before.channel, channel_after=after.channel, unit=before.unit,
        source=before.source, source_after=after.source,
        before=(before.frequency_hz, before.amplitude), after=(after.frequency_hz, after.amplitude),
        resonances=tuple(_shift_of(*both, section.pairing, ends) for both in shown),
    )  # fmt: skip


def _shift_of(before: Resonance, after: Resonance, pairing: float, ends: tuple[float, float]) -> ResonanceShift:
    """Changes of a resonance; one without a partner moved by more than `pairing`, or out of the range, or vanished."""
    values = [(each.frequency_hz, each.level, each.damping) for each in (before, after)]
    shifts = []
    for k in range(len(SHIFTED)):
        ratio = np.log(values[1][k] / values[0][k])
        swept = np.log(after.effect[k] / before.effect[k])
        spread = before.steps[k] + after.steps[k] + CONFIDENCE * float(np.hypot(before.noise[k], after.noise[k]))
        shifts.append(_shift(float(ratio), float(swept), spread))
    if np.isnan(values[0][0]) or np.isnan(values[1][0]):
        f = values[1][0] if np.isnan(values[0][0]) else values[0][0]
        least = min(pairing, ends[1] / f - 1.0, 1.0 - ends[0] / f)
        shifts = [Shift(nan, 0.0, nan, least if k == 0 else nan, inf if k == 0 else nan, k == 0) for k in range(3)]
    return ResonanceShift(*values[0], *values[1], *shifts)


def _shift(ratio: float, swept: float, spread: float) -> Shift:
    """A change from the logarithms of its ratio, of the part of the sweep and of the resolution.

    If the part of the sweep is not known, the change may be any.
    """
    if np.isnan(ratio):
        return Shift(nan, nan, nan, nan, nan, False)
    if np.isnan(swept) or np.isnan(spread):
        return Shift(float(np.expm1(ratio)), nan, inf, 0.0, inf, False)
    rest = ratio - swept
    ends = np.abs(np.expm1([rest - spread, rest + spread]))
    significant = abs(rest) > spread
    return Shift(
        float(np.expm1(ratio)), float(np.expm1(swept)), float(np.expm1(spread)),
        float(ends.min()) if significant else 0.0, float(ends.max()), significant,
    )  # fmt: skip


def _rate_warnings(responses: Iterable[tuple[TestResponse, ...]]) -> Iterator[str]:
    """Warnings about responses to a sine whose sweep rate is not given."""
    for k, side in enumerate(("before", "after")):
        if any(each[k].may_be_swept and each[k].sweep is None for each in responses):
            yield (
                f"{side}: the sweep rate is not given, so that its part of a change is not known; give sweep (--sweep) "
                "if the sine was swept"
            )


def _pair_warnings(pairs: Iterable[RecordPair]) -> Iterator[str]:
    """Warnings about channels without resonances, and about sweeps whose effect is not known."""
    for pair in pairs:
        if not pair.resonances:
            yield f"{pair.channel}: neither test has a peak that stands out of its noise"
        for each in pair.resonances:
            if each.is_paired and np.isnan(each.amplitude.of_sweep):
                yield (
                    f"{pair.channel}: the sweep is too fast, or the half-power band is not known, to tell how much it "
                    f"lowered the resonance at {each.before_hz:.5g} Hz: its amplitude is not judged"
                )


# --- Limits ----------------------------------------------------------------------------------------------------------


def _limits(given: Limits | None, channels: Sequence[str]) -> Limits:
    """Limits with those that apply by default.

    Raises
    ------
    ScenarioError
        If a limit is on a channel that is not compared.
    """
    limits = Limits.model_validate(DEFAULT_LIMITS) if given is None else given
    missing = {name: value for name, value in DEFAULT_LIMITS.items() if getattr(limits, name) is None}
    limits = limits.model_copy(update=missing)
    known = {plain_name(channel) for channel in channels}
    for name in limits.values_by_name:
        limit, _, place = name.partition(".")
        if place and place.lower() not in known:
            message = f"limits {place}, which is not compared"
            raise ScenarioError.at(f"limits.{limit}", message, f"name one of {', '.join(sorted(known))}")
    return limits


def _margins(limits: Limits, pairs: Sequence[RecordPair]) -> dict[str, dict[str, Any]]:
    """Margins of all limits, each of the change that decides: exceeded, else doubtful, else the largest."""
    margins = {}
    for name, limit in limits.values_by_name.items():
        limited, _, place = name.partition(".")
        quantity = limited.removesuffix("_shift")
        found = [
            (f"{split_heading(pair.channel)[0]}, {_where(each)}", getattr(each, quantity))
            for pair in pairs
            for each in pair.resonances
            if not place or plain_name(pair.channel) == place.lower()
        ]
        found = [each for each in found if not np.isnan(each[1].highest)]
        if not found:
            margins[name] = _margin(limit, "", nan, nan, nan)  # nothing is known of it
            continue
        at, shift = max(found, key=lambda each: _decides(each[1], limit))
        margins[name] = _margin(limit, at, _size(shift), shift.lowest, shift.highest)
    return with_verdicts(margins)


def _decides(shift: Shift, limit: float) -> tuple[bool, bool, float]:
    """Order of changes by what they decide."""
    return shift.lowest > limit, shift.highest > limit, _size(shift)


def _size(shift: Shift) -> float:
    """Magnitude of a change without the part of the sweep; of a missing resonance the least that it can be."""
    if np.isnan(shift.change):
        return shift.lowest
    of_sweep = 0.0 if np.isnan(shift.of_sweep) else shift.of_sweep
    return abs((1.0 + shift.change) / (1.0 + of_sweep) - 1.0)


def _margin(limit: float, at: str, value: float, lowest: float, highest: float) -> dict[str, Any]:
    return {
        "limit": limit,
        "value": value,
        "lowest": lowest,
        "highest": highest,
        "margin": margin_of(limit, value),
        "at": at,
    }


def _where(resonance: ResonanceShift) -> str:
    """Frequency of a resonance, and in which test it is missing."""
    if resonance.is_paired:
        return f"{resonance.before_hz:.5g} Hz"
    vanished = resonance.before_hz == resonance.before_hz
    return f"{resonance.before_hz:.5g} Hz vanished" if vanished else f"{resonance.after_hz:.5g} Hz appeared"


def _resonance_summary(pair: RecordPair, resonance: ResonanceShift) -> dict[str, Any]:
    """Summary of one resonance."""
    values = {name: getattr(resonance, name) for name in ResonanceShift._fields[:6]}
    shifts = {
        f"{name}_{key}": value
        for name in SHIFTED
        for key, value in getattr(resonance, name)._asdict().items()
        if key in ("change", "of_sweep", "resolution", "significant")
    }
    return {"channel": pair.channel, **values, **shifts}
