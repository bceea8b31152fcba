"""Parts of a motion: their events, ends and states are those of the whole, and nothing is known outside of them."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import expm

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.laws import kelvin_voigt
from beamsim.contacts.sliders import rigid_friction_law
from beamsim.flow.exact import ExactFlow
from beamsim.flow.transient import simulate
from beamsim.inputs.signal import CubicRecord, Signal, StreamedSignal
from beamsim.system.equations import Forcing, PiecewiseLinearSystem


@pytest.fixture(scope="module")
def motion():
    """Of two modes between a stop and a face that sticks, with several events at one instant."""
    shape = np.array([[1.0, 0.6], [0.8, -0.5], [0.8, -0.5]])
    laws = kelvin_voigt(60.0, 0.2), rigid_friction_law(0.2, 0.1), rigid_friction_law(0.1, 0.1)
    contacts = Contacts(shape, np.array([1.0, -1.0, -1.0]), np.array([0.1, 0, 0]), np.zeros(3, dtype=bool), laws)
    system = PiecewiseLinearSystem(np.array([1.0, 9.0]), np.diag([0.05, 0.1]), contacts, np.zeros(2))
    flow = ExactFlow(system, Forcing(np.array([[1.0, 0.4]]), (Signal.harmonic(2.0, 1.7),)), 40.0)
    whole = simulate(flow, np.array([0.4, -0.1, 0.3, 0.2]))
    assert whole.event_time.size > 40
    assert np.any(np.diff(whole.event_time) == 0.0)
    return whole


@pytest.mark.parametrize("seed", range(12))
def test_the_events_of_a_part_are_those_within_it(motion, seed):
    begin, end = np.sort(np.random.default_rng(seed).uniform(0.0, motion.end, 2))
    expected = (motion.event_time > begin) & (motion.event_time <= end)
    part = motion.extract(begin, end)
    np.testing.assert_array_equal(part.event_time, motion.event_time[expected])
    np.testing.assert_array_equal(part.event_phase, motion.event_phase[expected])
    np.testing.assert_array_equal(part.touch_changes, motion.touch_changes[expected])
    assert part.end == end
    np.testing.assert_allclose(part.final_y, motion.states_at(np.array([end]))[0], rtol=0, atol=1e-14)
    times = np.linspace(begin, end, 7)
    np.testing.assert_allclose(part.states_at(times), motion.states_at(times), rtol=0, atol=1e-12)


@pytest.mark.parametrize("seed", range(6))
def test_parts_together_have_every_event_once(motion, seed):
    """Of segments in a row, those between two parts apart; also where segments of no length are left out."""
    cuts = np.unique(np.random.default_rng(seed).integers(1, motion.time.size, 4))
    edges = [0, *cuts.tolist(), motion.time.size]
    parts = [motion.select(slice(a, b)) for a, b in pairwise(edges)]
    inside = sum(part.event_time.size for part in parts)
    between = sum(motion.state[cut] != motion.state[cut - 1] for cut in cuts.tolist())
    assert inside + between == motion.event_time.size
    assert parts[0].end == motion.time[cuts[0]]
    np.testing.assert_array_equal(parts[0].final_y, motion.y[cuts[0]])
    lasting = motion.select(np.flatnonzero(motion.length > 0.0))
    assert lasting.time.size < motion.time.size
    np.testing.assert_array_equal(lasting.event_time, motion.event_time)


def test_every_event_leads_to_a_segment_in_its_phase(motion):
    begun = motion.select(slice(0, motion.time.size))
    assert begun.event_time.size == motion.event_time.size
    for k in range(1, motion.time.size):
        pair = motion.select(slice(k - 1, k + 1))
        assert pair.event_time.size == int(motion.state[k] != motion.state[k - 1])
        after = motion.phases[k]
        np.testing.assert_array_equal(after[pair.event_contact], pair.event_phase)


def test_nothing_is_known_outside(motion):
    part = motion.extract(3.0, 7.0)
    for outside in (part.time[0] - 1e-6, 7.0 + 1e-6):
        with pytest.raises(ValueError, match="is not known at"):
            part.states_at(np.array([outside]))
    gap = motion.select(np.array([0, motion.time.size - 1]))
    with pytest.raises(ValueError, match="is not known at"):
        gap.states_at(np.array([0.5 * motion.end]))
    with pytest.raises(ValueError, match="is not known at"):
        motion.states_at(np.array([motion.end + 1e-6]))
    assert motion.extract(38.0, 99.0).end == motion.end


# -- a record that is shorter than the motion: its last cubic goes on -----------------------------------------------

STEP, AT_START = 0.2, np.array([0.03, 0.0])


def forced_by(record, omega, times):
    """(nt, 2) motion of a unit mass under piecewise cubics: each is the end of a chain of four integrators."""
    out, ends = [], np.append(record.start[1:], np.inf)
    chain = np.diag([1.0] * 5, 1)
    chain[1, 0] = -(omega**2)
    for t in times:
        y = AT_START
        for begin, end, cubic in zip(record.start, ends, record.coefficient[:, 0].real, strict=True):
            if begin < t:
                derivatives = cubic * np.array([1.0, 1.0, 2.0, 6.0])
                y = (expm(chain * (min(end, t) - begin)) @ np.append(y, derivatives))[:2]
        out.append(y)
    return np.array(out)


@pytest.mark.parametrize(
    ("pieces", "omega", "duration"), [(5, 1.0, 3.0), (2, 5.0, 20.0), (3, 1.0, 50.0), (4, 30.0, 0.9)]
)
def test_a_motion_goes_on_under_the_last_cubic_of_a_short_record(pieces, omega, duration):
    """Its response was a series that holds for one step of the record: after a hundred steps it was wrong by 1e15."""
    samples = 10.0 * np.random.default_rng(pieces).normal(size=200)
    record = StreamedSignal(CubicRecord(lambda number: samples[number + 40], STEP, pieces, (0.0, 0.0)), 0)
    contacts = Contacts(np.zeros((0, 1)), np.zeros(0), np.zeros(0), np.zeros(0, dtype=bool), ())
    system = PiecewiseLinearSystem(np.array([omega**2]), np.zeros((1, 1)), contacts, np.zeros(1))
    whole = simulate(ExactFlow(system, Forcing(np.ones((1, 1)), (record,)), duration), AT_START)
    for begin, end in ((0.0, duration), (0.3 * duration, 0.8 * duration), (0.93 * duration, duration)):
        part, times = whole.extract(begin, end), np.linspace(begin, end, 7)
        expected = forced_by(record, omega, times)
        size = np.abs(expected).max(axis=0)
        np.testing.assert_allclose(part.states_at(times) / size, expected / size, rtol=0, atol=1e-12)
        assert (part.time[0], part.end) == (begin, end)
        assert part.length.sum() == pytest.approx(end - begin, rel=1e-13)
