"""How far a branch is followed beyond a range: the curve ``parameter = x^3 - 3 x``, which turns back at 2 and at -2."""

from dataclasses import dataclass

import numpy as np
import pytest

from beamsim.orbits.continuation import Settings, solve_at
from beamsim.orbits.tracing import Budget, Tracer, missing, trace_range

FIRST, LAST = -1.0, 3.0  # of the range; at -1 the curve passes three times


class Cubic:
    """The curve as a continuation problem."""

    bifurcates = False

    def residual(self, u):
        x, value = u
        return np.array([x**3 - 3.0 * x - value]), np.array([[3.0 * x**2 - 3.0, -1.0]]), None

    def scale(self, u):
        return np.ones(2), np.ones(1)

    def same_events(self, a, b):
        return True


@dataclass(frozen=True)
class KnownStarts(Tracer):
    """Begins at given points of the curve."""

    starts: dict

    def begin(self, value, forward):
        x = self.starts.get(value)
        return None if x is None else solve_at(self.problem, np.array([x, value]), Settings(), value, forward)


def branches_from(starts):
    tracer = KnownStarts(Cubic(), (-10.0, 10.0), starts)
    branches = trace_range(tracer, FIRST, LAST, Budget(2000, np.inf))
    assert not missing(branches, FIRST, LAST)
    for branch in branches:
        x, value = np.array([point.u for point in branch.points]).T
        assert value == pytest.approx(x**3 - 3.0 * x, abs=1e-10)
    return branches


def test_nothing_beyond_a_range_that_both_ends_fill():
    near, far = branches_from({FIRST: -1.9, LAST: 2.1})
    for branch in (near, far):
        assert branch.span[0] >= FIRST - 1e-12
        assert branch.span[1] <= LAST + 1e-12
        assert branch.outcome.code == "reached_end"
    assert [event.kind for event in near.special] == ["fold"]
    assert near.span[1] == pytest.approx(2.0)
    assert near.points[-1].u == pytest.approx([0.3472963553, FIRST])  # x = 2 cos(80 deg)
    assert far.points[-1].u == pytest.approx([1.5320888862, FIRST])  # 2 cos(40 deg)


def test_a_loop_beyond_the_range_where_the_far_end_has_no_motion():
    (branch,) = branches_from({FIRST: -1.9})
    assert [event.kind for event in branch.special] == ["fold", "fold"]
    assert [event.parameter for event in branch.special] == pytest.approx([2.0, -2.0])
    chords = np.linalg.norm(np.diff([point.u for point in branch.points], axis=0), axis=1)
    assert chords.min() > 0.0  # no point twice
    assert chords.max() < 0.2  # no jump
    assert branch.outcome.code == "reached_end"
    assert branch.points[-1].parameter == 10.0
