"""Extreme values of outputs of a motion: no sample lies beyond them, and they are reached at the times given."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import beamsim
from beamsim.flow.exact import ExactFlow, exact_flow
from beamsim.flow.extrema import Sums, search_extrema
from beamsim.flow.transient import simulate
from beamsim.inputs.signal import Signal
from beamsim.system.build import build_system
from beamsim.system.equations import Forcing, PiecewiseLinearSystem
from tests.helpers.observed import all_outputs

BEAM = {"length": 0.27, "width": 0.05, "thickness": 0.005, "youngs_modulus": 69e9, "density": 2700.0, "elements": 8,
        "damping": {"kind": "modal", "ratio": 0.01}}  # fmt: skip
INPUTS = {
    "harmonic": {"kind": "harmonic", "level": "2 g", "frequency": 65.0},
    "sine sweep, with powers of time": {"kind": "swept_sine", "level": "2 g", "from": 20.0, "to": 200.0,
                                        "rate": "2000 Hz/s"},
    "random, of many equal pieces": {"kind": "random", "seed": 1, "psd": [{"frequency": 20.0, "density": 5.0},
                                                                        {"frequency": 800.0, "density": 5.0}]},
}  # fmt: skip


def motion_of(kind, snubbers=3, duration=0.08):
    row = [
        {"name": f"s{k}", "position": float(x), "side": "below", "stiffness": 5e4, "gap": 2e-5,
         "damping": {"kind": "ratio", "ratio": 0.02}}
        for k, x in enumerate(np.linspace(0.1, 0.27, snubbers), 1)
    ]  # fmt: skip
    case = {
        "beam": BEAM, "reduction": {"modes": 5}, "snubbers": row, "excitation": {**INPUTS[kind], "applied_to": "base"},
        "run": {"duration": duration, "convergence": "off"},
    }  # fmt: skip
    system = build_system(beamsim.load_scenario(case))
    flow = exact_flow(system, duration)
    return simulate(flow, system.initial_state), all_outputs(system, flow)


@pytest.fixture(scope="module", params=INPUTS)
def motion(request):
    return motion_of(request.param)


def samples(whole, outputs, count=10_001):
    times = np.linspace(0.0, whole.end, count)
    return times, whole.sample(times, outputs)


def reached(whole, outputs, when):
    """(k,) outputs at times (k,), each the limit from the side that is larger in size, as ends of segments are."""
    order = np.argsort(when)
    either = []
    for side in (-1.0, 1.0):
        values = np.empty(when.size)
        at = np.clip(when[order] * (1.0 + side * 4e-16), 0.0, whole.end)
        values[order] = whole.sample(at, outputs)[np.arange(when.size), order]
        either.append(values)
    return np.stack(either)


def test_no_sample_lies_beyond(motion):
    whole, outputs = motion
    found = whole.extrema(outputs)
    _, values = samples(whole, outputs)
    size = np.abs(values).max(axis=0)
    assert np.all(values.max(axis=0) <= found.high + 1e-10 * size)
    assert np.all(values.min(axis=0) >= found.low - 1e-10 * size)
    np.testing.assert_allclose(found.high, values.max(axis=0), atol=0.02 * size.max())  # the comparison means something


def test_they_are_reached(motion):
    whole, outputs = motion
    found = whole.extrema(outputs)
    size = np.maximum(np.abs(found.low), np.abs(found.high))
    for value, when in ((found.low, found.when_low), (found.high, found.when_high)):
        beside = np.abs(reached(whole, outputs, when) - value).min(axis=0)
        assert np.all(beside <= 1e-8 * size)


def test_extremes_between_edges_are_those_of_each_part(motion):
    """Edges at events, in segments, before the motion and after it."""
    whole, outputs = motion
    inner = np.sort(np.append(np.linspace(0.011, 0.075, 6), whole.event_time[len(whole.event_time) // 2]))
    edges = np.concatenate([[-0.02, -0.01], inner, [0.2, 0.3]])
    found = whole.extrema(outputs, edges)
    assert np.all(np.isinf(found.high[[0, -1]]))
    assert np.all(np.isinf(found.low[[0, -1]]))
    for w in range(1, edges.size - 2):
        part = whole.extract(max(edges[w], 0.0), min(edges[w + 1], whole.end))
        part = part.select(np.flatnonzero(part.length > 0.0)).extrema(outputs)
        size = np.maximum(np.abs(part.low), np.abs(part.high))
        np.testing.assert_array_less(np.abs(found.high[w] - part.high), 1e-9 * size + 1e-12)
        np.testing.assert_array_less(np.abs(found.low[w] - part.low), 1e-9 * size + 1e-12)
        assert np.all((found.when_high[w] >= edges[w] - 1e-12) & (found.when_high[w] <= edges[w + 1] + 1e-12))
    all_of_it = whole.extrema(outputs)
    np.testing.assert_allclose(found.high[1:-1].max(axis=0), all_of_it.high, rtol=1e-9)


@pytest.mark.parametrize("edges", [None, np.linspace(0.0, 0.08, 5)])
def test_of_rivals_only_the_largest_is_searched_for(motion, edges):
    """Some outputs of one quantity; the others are found as they are without them."""
    whole, outputs = motion
    found = whole.extrema(outputs, edges)
    size = np.maximum(np.abs(found.low), np.abs(found.high))
    alike = np.flatnonzero(size.reshape(-1, size.shape[-1]).max(axis=0) > 0.0)[::2]
    others = np.setdiff1d(np.arange(size.shape[-1]), alike)
    fewer = whole.extrema(outputs, edges, competitors=alike)
    least = np.maximum(np.abs(fewer.low), np.abs(fewer.high))
    assert np.all(least <= size * (1.0 + 1e-10))
    np.testing.assert_allclose(least[..., alike].max(axis=-1), size[..., alike].max(axis=-1), rtol=1e-10)
    np.testing.assert_array_equal(least[..., alike].argmax(axis=-1), size[..., alike].argmax(axis=-1))
    for one, other in zip(fewer[:4], found[:4], strict=True):
        np.testing.assert_array_equal(one[..., others], other[..., others])
    assert fewer.evaluations < found.evaluations


def test_most_of_a_random_motion_is_left_out_by_bounds_on_all_segments_at_once():
    """Each segment takes two values of each output, unless it is known to stay below the largest ones."""
    whole, outputs = motion_of("random, of many equal pieces", duration=1.0)
    found = whole.extrema(outputs)
    values = 2 * whole.time.size * found.high.size
    assert whole.time.size > 3000
    assert found.evaluations < 0.25 * values
    sampled = samples(whole, outputs)[1]
    size = np.abs(sampled).max(axis=0)
    assert np.all(sampled.max(axis=0) <= found.high + 1e-9 * size)
    assert np.all(sampled.min(axis=0) >= found.low - 1e-9 * size)


def test_the_variation_is_bounded_and_not_much_larger(motion):
    """The changes between all turning points and ends of segments add up to less than the bound."""
    whole, outputs = motion
    bounds, every = whole.variation(outputs), np.arange(whole.time.size)
    ratios = []
    for k in range(0, bounds.size, 4):
        values = whole.turning_points(lambda phases, k=k: outputs(phases)[[k]], every).value
        variation, size = np.abs(np.diff(values)).sum(), np.abs(values).max()
        assert variation <= bounds[k] * (1.0 + 1e-9) + 1e-9 * size
        ratios += [bounds[k] / variation] if size > 0.0 else []
    assert 1.0 - 1e-9 <= np.median(ratios) < 1.5


def test_turning_points_are_those_of_fine_samples(motion):
    """Between two of them every output rises or falls throughout; none is missed that samples show."""
    whole, outputs = motion
    segments = np.arange(0, whole.time.size, max(whole.time.size // 10, 1))
    for k in range(0, whole.extrema(outputs).low.size, 8):
        one = lambda phases, k=k: outputs(phases)[[k]]  # noqa: E731
        found = whole.turning_points(one, segments)
        size = np.abs(found.value).max()
        for segment in segments:
            mine = found.segment == segment
            begin, end = whole.time[segment], whole.time[segment] + whole.length[segment]
            times = np.linspace(begin, end - 1e-9 * whole.length[segment], 1001)
            values = whole.sample(times, one)[:, 0]
            at, turns = found.time[mine], found.value[mine]
            assert at[0] == begin
            assert at[-1] == end
            of_sample = np.clip(np.searchsorted(at, times, side="right") - 1, 0, at.size - 2)
            low, high = (f(turns[of_sample], turns[of_sample + 1]) for f in (np.minimum, np.maximum))
            assert np.all(values >= low - 1e-7 * size)
            assert np.all(values <= high + 1e-7 * size)
            rises = np.sign(turns[of_sample + 1] - turns[of_sample])[1:]
            inside = of_sample[1:] == of_sample[:-1]
            assert np.all((np.diff(values) * rises)[inside] >= -1e-7 * size)


@settings(max_examples=12, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1), frequency=st.floats(0.1, 60.0), decay=st.floats(0.0, 1e6),
    ratio=st.sampled_from([0.0, 1e-8, 0.1]), squares=st.booleans(),
)  # fmt: skip
def test_sums_of_any_terms(seed, frequency, decay, ratio, squares):
    """Oscillations, of which the fastest has a small amplitude, a fast decay, growth, a constant, powers of time."""
    rng, count, outputs = np.random.default_rng(seed), 4, 4
    exponent = np.array([-0.3 + 1j * frequency, -2.0 + 10j * frequency, -decay, 0.4, 0.0, 0.0, 0.0, 1j * frequency])
    power = np.array([0, 0, 0, 0, 0, 1, 4, 2])
    amplitude = rng.normal(size=(count, 8)) + 1j * rng.normal(size=(count, 8))
    amplitude[:, 1] *= ratio
    amplitude[:, 2:7] = amplitude[:, 2:7].real
    table, number = rng.normal(size=(8, outputs)) + 0j, np.arange(8)
    length, time = rng.uniform(0.2, 1.5, count), 10.0 * np.arange(count)
    place = np.stack([np.zeros(count), np.ones(count), time, length])
    sums = Sums(
        exponent, power, number, amplitude, np.zeros(amplitude.shape), table, place, np.zeros_like(number, shape=count)
    )
    first = np.array([0, 1]) if squares else None
    found = search_extrema([sums], outputs, squares=first)

    def at(segment, tau):
        terms = amplitude[segment] * tau[:, None] ** power * np.exp(tau[:, None] * exponent)
        x = (terms @ table).real
        return 0.5 * np.add.reduceat(x**2, first, axis=1) if squares else x

    fine = np.concatenate([at(g, np.linspace(0.0, length[g], 3001)) for g in range(count)])
    size = np.abs(fine).max(axis=0) if squares else np.abs(amplitude).sum(axis=1).max()
    assert np.all(found.high[0] >= fine.max(axis=0) - 1e-10 * size)
    assert np.all(found.low[0] <= fine.min(axis=0) + 1e-10 * size)
    for value, when in ((found.low[0], found.when_low[0]), (found.high[0], found.when_high[0])):
        for k in range(value.size):
            g = int(when[k] // 10.0)
            assert at(g, np.array([when[k] - time[g]]))[0, k] == pytest.approx(
                value[k], rel=1e-8, abs=1e-9 * np.max(size) + 1e-13 * decay
            )


def one_mode(omega, damping, start, end, signal=None, load=0.0):
    """The motion of one oscillator (or mass) from a state, as all its states."""
    system = PiecewiseLinearSystem(np.array([omega**2]), np.array([[damping]]), no_contacts(), np.zeros(1))
    forcing = Forcing(np.array([[load]]), (signal,)) if signal is not None else Forcing(np.zeros((0, 1)), ())
    whole = simulate(ExactFlow(system, forcing, end), np.array(start))
    return whole, lambda phases: whole.flow.equations.state


def no_contacts():
    from beamsim.contacts.contacts import Contacts

    return Contacts(np.zeros((0, 1)), np.zeros(0), np.zeros(0), np.zeros(0, dtype=bool), ())


@pytest.mark.parametrize("growth", [2.0, 20.0, 200.0])
def test_growing_motions_end_with_their_largest_value(growth):
    """``exp(growth t)`` up to 1e86, beside a term that would grow beyond all numbers but rests."""
    exponent, amplitude = np.array([growth + 0j, 2000.0]), np.array([[1.0 + 0j, 0.0]])
    found = search_extrema([sums_of(exponent, amplitude, 1.0)], 1)
    assert found.high[0, 0] == pytest.approx(np.exp(growth), rel=1e-9)
    assert found.when_high[0, 0] == 1.0
    assert found.low[0, 0] == pytest.approx(1.0, rel=1e-12)


def test_large_numbers_are_no_matter():
    """Energies of motions of 1e100 m, whose squares are numbers, and whose fourth derivatives' are none."""
    small, large = (one_mode(40.0, 0.1, [size, 0.0], 1.0) for size in (1.0, 1e100))
    for squares in (None, np.array([0])):
        one, other = (whole.extrema(outputs, squares=squares) for whole, outputs in (small, large))
        unit = 1e100 if squares is None else 1e200
        np.testing.assert_allclose(other.high / unit, one.high, rtol=1e-10)


def test_a_parabola_and_its_flat_top():
    """A thrown mass: powers of time alone."""
    whole, outputs = one_mode(0.0, 0.0, [0.0, 3.0], 1.0, Signal.polynomial_pieces([0.0], [[1.0]]), -10.0)
    found = whole.extrema(outputs)
    assert found.high[0] == pytest.approx(0.45, rel=1e-12)
    assert found.when_high[0] == pytest.approx(0.3, abs=1e-6)
    assert found.low[0] == pytest.approx(-2.0, rel=1e-12)
    assert found.low[1] == pytest.approx(-7.0, rel=1e-12)


def sums_of(exponent, amplitude, length):
    """One output on one segment."""
    number, table = np.arange(exponent.size), np.ones((exponent.size, 1), dtype=complex)
    place, noise = np.array([[0.0], [1.0], [0.0], [length]]), np.zeros(amplitude.shape)
    return Sums(exponent, np.zeros_like(number), number, amplitude, noise, table, place, np.zeros_like(number, shape=1))


def test_a_peak_between_samples_is_found_to_round_off():
    """``cos(w t) + 0.5 cos(3 w t)`` has its maximum at a time that is known, and others that are lower by 1e-6."""
    w, first = 40.0, 0.123456789
    exponent = np.array([1j * w, 3j * w, -1e-6 + 1j * w])
    amplitude = np.array([[np.exp(-1j * w * first), 0.5 * np.exp(-3j * w * first), 0.0]])
    found = search_extrema([sums_of(exponent, amplitude, 2.0)], 1)
    assert found.high[0, 0] == pytest.approx(1.5, rel=2e-15)
    turns = (found.when_high[0, 0] - first) * w / (2.0 * np.pi)
    assert turns == pytest.approx(round(turns), abs=1e-7)
    assert found.evaluations < 4000  # of both signs, on 13 periods


def test_what_repeats_a_part_that_was_searched_is_left_out_and_what_exceeds_it_by_little_is_found():
    """Twenty thousand equal parts of a steady motion, of which one is 1e-8 larger."""
    rate, number, count = np.array([-3.0 + 400.0j, -20.0 + 2500.0j]), np.arange(2), 20_000
    table, batch = np.array([[1.0, 2.0], [0.5, -1.0]], dtype=complex), 250

    def batches(larger):
        for first in range(0, count, batch):
            amplitude = np.tile([1.0 + 0.3j, 0.2 - 0.1j], (batch, 1))
            amplitude[np.arange(first, first + batch) == larger] *= 1.0 + 1e-8
            begin = 0.01 * np.arange(first, first + batch)
            place = np.stack([np.zeros(batch), np.ones(batch), begin, np.full(batch, 0.01)])
            noise, window = np.zeros(amplitude.shape), np.zeros(batch, dtype=np.int64)
            yield Sums(rate, 0 * number, number, amplitude, noise, table, place, window)

    time = np.linspace(0.0, 0.01, 1001)
    samples = (np.exp(np.multiply.outer(time, rate)) * [1.0 + 0.3j, 0.2 - 0.1j] @ table).real
    alike, other = (search_extrema(batches(larger), 2) for larger in (-1, 15_377))
    np.testing.assert_allclose(alike.high[0], samples.max(axis=0), rtol=1e-4)
    np.testing.assert_allclose(other.high[0] / alike.high[0], 1.0 + 1e-8, rtol=1e-10)
    np.testing.assert_allclose(other.low[0] / alike.low[0], 1.0 + 1e-8, rtol=1e-10)
    assert (np.floor(other.when_high[0] / 0.01) == 15_377).all()
    assert alike.evaluations < count  # 38 a part, if all were looked at
