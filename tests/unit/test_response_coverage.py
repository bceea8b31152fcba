"""A range covered by several branches: where they begin again, what they cost, what is told of the rest."""

from types import SimpleNamespace

import numpy as np
import pytest

from beamsim.analyses.continuation.analysis import _outcome
from beamsim.analyses.continuation.branches import Budget, missing, progress_that_grows, trace_range
from beamsim.analyses.continuation.paths import FollowedParameter
from beamsim.orbits.branch import BranchPoint, reached_end, recorded
from beamsim.orbits.continuation import Settings
from beamsim.outcomes import Outcome, OutcomeKind
from beamsim.scenario.sweep import Continuation

pytestmark = pytest.mark.quick


def point(value, x=0.0):
    return BranchPoint(np.array([x, value]), np.array([0.0, 1.0]), np.ones(2), 0.0, 1.0, 0, None)


def a_corner(end):
    return Outcome.of(OutcomeKind.STOPPED, "not_smooth", at=end)


class Walk:
    """A branch of given points."""

    settings = Settings()
    problem = None

    def __init__(self, points, outcome):
        self.points, self.outcome = points, outcome

    def __iter__(self):
        yield from self.points


class Lines:
    """Horizontal branches x = height over stretches of the parameter; nothing between them."""

    def __init__(self, *stretches, step=0.05, dead=()):
        self.stretches, self.step, self.dead, self.begun = stretches, step, dead, []
        self.problem = SimpleNamespace(multiple=1, orbit=lambda point: SimpleNamespace(stable=True))

    def begin(self, value, forward):
        self.begun.append(value)
        for k, (a, b) in enumerate(self.stretches):
            if a <= value <= b and value not in self.dead:
                start = point(value, float(k))
                return start if forward > 0 else BranchPoint(start.u, -start.tangent, start.scale, 0.0, 1.0, 0, None)
        return None

    def branch(self, start, settings):
        k = int(start.u[0])
        a, b = self.stretches[k]
        end = b if start.tangent[-1] > 0 else a
        count = max(2, int(abs(end - start.parameter) / self.step) + 1)
        points = [point(v, float(k)) for v in np.linspace(start.parameter, end, count)]
        inside = 0.0 < end < 1.0
        outcome = a_corner(end) if inside else reached_end(end)
        return Walk(points[: settings.most_points], outcome)

    def special(self, a, b, settings, failed):
        return []


def test_a_hole_is_tried_a_bounded_number_of_times_and_told():
    tracer = Lines((0.0, 0.3), (0.6, 1.0))
    found = trace_range(tracer, 0.0, 1.0, Budget(1000, 60.0))
    assert len(found) == 2
    assert 5 < len(tracer.begun) <= 12
    assert len(set(tracer.begun)) == len(tracer.begun)
    assert missing(found, 0.0, 1.0) == [pytest.approx((0.3, 0.6))]


def test_progress_never_falls():
    seen = []
    trace_range(Lines((0.0, 0.2), (0.2, 0.7), (0.7, 1.0)), 0.0, 1.0, Budget(1000, 60.0), seen.append)
    assert seen[-1] == 1.0
    assert np.all(np.diff(seen) > 0)
    assert len(seen) > 10
    told = []
    grown = progress_that_grows(told.append)
    for fraction in (0.1, 0.05, 0.3, 2.0):
        grown(fraction)
    assert told == [0.1, 0.3, 1.0]


def test_a_search_that_fails_is_told_with_the_branch():
    """The branch says which special points may be missing, and keeps its own outcome and points."""

    class Failing(Lines):
        def special(self, a, b, settings, failed):
            if a.parameter < 0.5 <= b.parameter:
                with recorded("neimark_sacker", a, failed):
                    raise np.linalg.LinAlgError
            return []

    (whole,) = trace_range(Lines((0.0, 1.0)), 0.0, 1.0, Budget(1000, np.inf))
    (branch,) = trace_range(Failing((0.0, 1.0)), 0.0, 1.0, Budget(1000, np.inf))
    assert whole.outcome.complete
    assert len(branch.points) == len(whole.points)
    assert branch.outcome.code == "reached_end"
    assert not branch.outcome.complete
    (failed,) = branch.outcome.all_of("search_failed")
    assert "(Neimark–Sacker)" in failed.sentence
    assert 0.4 < failed.place.value < 0.5
    settings = Continuation.model_construct(side_branches="limited", longest_period=2)
    model = SimpleNamespace(
        followed=FollowedParameter("level", 0.0, 1.0, "N"), scenario=SimpleNamespace(sweep=settings)
    )
    assert _outcome(model, [whole], Budget(1000, np.inf), None).complete
    assert "first at 0.45 N" in _outcome(model, [branch], Budget(1000, np.inf), None).text
