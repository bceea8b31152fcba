"""Largest values of sums of exponentials: no sample exceeds them, and they are reached at the times given."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beamsim.flow import peak_search
from beamsim.flow.cubic import Cubic
from beamsim.flow.peak_search import Intervals, Sums, search

OUTPUTS, SEGMENTS, TERMS = 3, 4, 5


def random_sums(rng, frequency, decay, ratio):
    """Oscillations, of which the fastest has a small amplitude, a fast decay, a growing exponential and a constant."""
    exponent = np.zeros((SEGMENTS, TERMS), dtype=complex)
    exponent[:, 0] = -0.3 + 1j * frequency * rng.uniform(0.5, 1.0, SEGMENTS)
    exponent[:, 1] = -2.0 + 10j * frequency
    exponent[:, 2] = -decay
    exponent[:, 3] = rng.uniform(0.0, 0.5, SEGMENTS)
    amplitude = rng.normal(size=(SEGMENTS, TERMS)) + 1j * rng.normal(size=(SEGMENTS, TERMS))
    amplitude[:, 1] *= ratio
    amplitude[:, 2:] = amplitude[:, 2:].real
    segment, output = np.repeat(np.arange(SEGMENTS), OUTPUTS), np.tile(np.arange(OUTPUTS), SEGMENTS)
    coefficient = rng.normal(size=(segment.size, TERMS)) * amplitude[segment]
    return Sums(exponent, 10.0 * np.arange(SEGMENTS), segment, output, coefficient)


def whole(sums, length):
    count = sums.output.size
    return Intervals(np.arange(count), np.zeros(count), np.full(count, length), np.full(count, 1e300))


def value(sums, number, times):
    g = sums.segment[number]
    terms = sums.coefficient[number] * np.exp(np.multiply.outer(times, sums.exponent[g]))
    return terms.real.sum(axis=-1)


@given(
    seed=st.integers(0, 2**32 - 1), frequency=st.floats(0.1, 60.0), decay=st.floats(0.0, 1e6),
    ratio=st.sampled_from([0.0, 1e-8, 0.1]),
)  # fmt: skip
@settings(max_examples=40, deadline=None)
def test_largest_values_are_those_of_fine_samples(seed, frequency, decay, ratio):
    sums = random_sums(np.random.default_rng(seed), frequency, decay, ratio)
    highest, when = np.full(OUTPUTS, -np.inf), np.zeros(OUTPUTS)
    search(sums, whole(sums, 1.0), highest, when)
    fine = np.linspace(0.0, 1.0, 4001)
    for k in range(OUTPUTS):
        of_output = np.flatnonzero(sums.output == k)
        sampled = max(value(sums, number, fine).max() for number in of_output)
        assert highest[k] >= sampled - 1e-11 * abs(sampled) - 1e-13
        number = of_output[int(when[k] // 10.0)]
        reached = value(sums, number, np.array([when[k] % 10.0]))[0]
        assert reached == pytest.approx(highest[k], rel=1e-9, abs=1e-12 + 1e-14 * decay)


def test_a_peak_between_samples_is_found_to_round_off():
    """``cos(w t) + 0.5 cos(3 w t)`` has its maximum at a time that is known, and others that are lower by 1e-6."""
    w, first = 40.0, 0.123456789
    exponent = np.array([[1j * w, 3j * w, -1e-6 + 1j * w]])
    amplitude = np.array([[np.exp(-1j * w * first), 0.5 * np.exp(-3j * w * first), 0.0]])
    sums = Sums(exponent, np.zeros(1), np.zeros(1, int), np.zeros(1, int), amplitude)
    highest, when = np.full(1, -np.inf), np.zeros(1)
    evaluations = search(sums, whole(sums, 2.0), highest, when)
    assert highest[0] == pytest.approx(1.5, rel=2e-16 * 8)
    turns = (when[0] - first) * w / (2.0 * np.pi)
    assert turns == pytest.approx(round(turns), abs=1e-7)
    assert evaluations < 1500  # 13 periods, some 110 points each


def test_a_motion_at_rest_but_for_round_off_is_not_searched_from_end_to_end():
    """Of 10,000 periods of something small one peak is found, and what may exceed it by less than peaks may differ."""
    exponent, amplitude = np.array([[0.0, 6e6j, 300j]]), np.array([[-2.0 + 0j, 1e-7j, 1e-12]])
    sums = Sums(exponent, np.zeros(1), np.zeros(1, int), np.zeros(1, int), amplitude)
    highest, when = np.full(1, -np.inf), np.zeros(1)
    evaluations = search(sums, whole(sums, 0.01), highest, when)
    assert highest[0] == pytest.approx(-2.0 + 1e-7, abs=1e-11)
    assert evaluations < 10_000


@pytest.mark.parametrize("level", [2.0, 0.0, -2.0])
def test_a_constant_takes_one_look(level):
    zero = np.zeros(1, int)
    sums = Sums(np.zeros((1, 1), dtype=complex), np.zeros(1), zero, zero, np.array([[level + 0j]]))
    highest, when = np.full(1, -np.inf), np.zeros(1)
    assert search(sums, whole(sums, 1.0), highest, when) == peak_search.MOST_PARTS + 1
    assert highest[0] == level


def test_few_intervals_at_a_time_give_the_same(monkeypatch):
    sums = random_sums(np.random.default_rng(3), 50.0, 1e4, 0.1)
    found = []
    for most in (peak_search.VALUES_AT_ONCE, 1):
        monkeypatch.setattr(peak_search, "VALUES_AT_ONCE", most)
        found.append((np.full(OUTPUTS, -np.inf), np.zeros(OUTPUTS)))
        search(sums, whole(sums, 1.0), *found[-1])
    np.testing.assert_allclose(found[1][0], found[0][0], rtol=1e-14)
    np.testing.assert_allclose(found[1][1], found[0][1], atol=1e-9)


def test_the_cubic_is_that_of_its_ends():
    rng = np.random.default_rng(1)
    d, c, e = rng.normal(size=(3, 200))
    cubic = Cubic(np.zeros(200), d + c + e, d, d + 2.0 * c + 3.0 * e)
    u = np.linspace(0.0, 1.0, 2001)[:, None]
    fine, slope = u * (d + u * (c + u * e)), d + u * (2.0 * c + 3.0 * u * e)
    top, place = cubic.top()
    np.testing.assert_allclose(top, fine.max(axis=0), atol=1e-5)
    assert np.all(top >= fine.max(axis=0) - 1e-14)
    inside = place > 0.0
    assert inside.sum() > 20
    at_place = place * (d + place * (c + place * e))
    np.testing.assert_allclose(np.maximum(at_place, np.maximum(0.0, d + c + e)), top, atol=1e-13)
    assert np.all(np.abs(d + place * (2.0 * c + 3.0 * place * e))[inside] < 1e-12)
    assert np.all((c + 3.0 * place * e)[inside] < 0.0)
    for error in (0.0, 0.3):
        keeps = np.all(slope > error, axis=0) | np.all(slope < -error, axis=0)
        differ = cubic.climbs(np.full(200, error)) != keeps
        near = np.minimum(np.abs(slope - error).min(axis=0), np.abs(slope + error).min(axis=0)) < 1e-3
        assert not np.any(differ & ~near)
        assert keeps.any()
