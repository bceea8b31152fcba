r"""Pads: force-deflection curves (given or fitted), no-tension laws, and parallel Maxwell branches.

The curve has slopes :math:`s_i \ge 0` on segments between knots :math:`0 = b_0 < b_1 < \dots`: :math:`N(x) = \sum_i s_i
\min(\max(x - b_i, 0), b_{i+1} - b_i)`; the last slope continues. For given knots the best slopes follow from
non-negative least squares. Initial knots come from dynamic programming (independent straight lines on intervals of the
points), or are spaced evenly among the points; then all knots move together to a local minimum of the squared misfit.
With at most ten segments, each knot is then moved between its neighbours until no move reduces the misfit.

With :math:`N_t` the curve's force, a dashpot c and branches of stiffness :math:`k_j` and relaxation time
:math:`\tau_j`, the force in contact is

.. math:: N = N_t(\delta) + c\,\dot\delta + \sum_j k_j (\delta - p_j), \qquad \tau_j \dot p_j = \delta - p_j .

Contact ends where N reaches zero. The released pad recovers by itself: its face is at the compression u at which the
same force, with u in place of :math:`\delta`, is zero, and the contact closes where :math:`\delta` reaches u. Without a
dashpot u is linear in the p of its segment; with one it is an internal state. There is a closed and a released phase
for each segment of the curve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from beamsim.contacts.laws import (
    NORMAL_FORCE,
    PENETRATION_ROW,
    ContactLaw,
    Guard,
    LawRow,
    LawSpring,
    Phase,
    kelvin_voigt,
    piecewise_linear,
)
from beamsim.typing import Floats

COMPARED_SEGMENTS = 8  # largest number of segments in a comparison of curves
OWN_COLUMNS = NORMAL_FORCE  # number of quantities of a law that belong to the contact itself: penetration, rate, 1


@dataclass(frozen=True)
class ForceCurve:
    """A continuous force-deflection curve from zero; it continues with its last slope."""

    deflection: Floats  # (p,) m, increasing, the first zero
    force: Floats  # (p,) N, the first zero, not falling except in a stop that stays crushed

    @classmethod
    def line(cls, stiffness: float) -> ForceCurve:
        """The curve of a spring with a stiffness, N/m."""
        return cls(np.array([0.0, 1.0]), np.array([0.0, stiffness]))

    @property
    def slopes(self) -> Floats:
        """(p - 1,) slopes, N/m."""
        return np.asarray(np.diff(self.force) / np.diff(self.deflection))

    @property
    def stiffness(self) -> float:
        """First nonzero slope, N/m."""
        return float(self.slopes[self.slopes > 0][0])

    def at(self, deflection: Floats) -> Floats:
        """Forces at deflections, N; zero at negative ones."""
        beyond = np.maximum(deflection - self.deflection[-1], 0.0) * self.slopes[-1]
        return np.asarray(np.interp(deflection, self.deflection, self.force) + beyond)


class TabulatedPower(NamedTuple):
    """A table of a power law, with its error."""

    curve: ForceCurve
    force_error: float  # largest error of the force, relative to the force at the end of the table
    work_error: float  # error of the work up to the end of the table, relative to that work


MOST_SEGMENTS = 200  # of a table that is generated


def power_curve(exponent: float, reach: float, force: float, segments: int) -> TabulatedPower:
    """A table of ``force (x / reach)^exponent``, whose errors are nearly equal on all segments.

    The ends of the segments are at :math:`(i/m)^{2/n}` of the range, where chords of the curve have nearly equal
    distances from it. All ends except zero are moved by half the largest of these distances, so that errors of both
    signs occur.

    Parameters
    ----------
    exponent : n, positive, not 1.
    reach, force : end of the table, m and N.
    segments : their number m.

    Examples
    --------
    >>> curve, force_error, _ = power_curve(1.5, 1e-3, 100.0, 4)
    >>> curve.slopes.size, round(force_error, 4)
    (4, 0.0071)
    """
    x = np.linspace(0.0, 1.0, segments + 1) ** (2.0 / exponent)
    y = x**exponent
    chords = _chord_errors(x, y, exponent)
    y[1:] -= 0.5 * chords[np.argmax(np.abs(chords))]
    errors = np.concatenate([y - x**exponent, _chord_errors(x, y, exponent)])
    work = float(np.sum(0.5 * (y[1:] + y[:-1]) * np.diff(x))) * (exponent + 1.0) - 1.0
    return TabulatedPower(ForceCurve(reach * x, force * y), float(np.abs(errors).max()), work)


def power_curve_within(exponent: float, reach: float, force: float, tolerance: float) -> TabulatedPower:
    """The table of a power law with the fewest segments whose force error is within a tolerance.

    Parameters
    ----------
    exponent, reach, force : see :func:`power_curve`.
    tolerance : of the error of the force, relative to ``force``.

    Raises
    ------
    ValueError
        If it needs more than `MOST_SEGMENTS`.
    """
    for segments in range(1, MOST_SEGMENTS + 1):
        table = power_curve(exponent, reach, force, segments)
        if table.force_error <= tolerance:
            return table
    raise ValueError(f"{MOST_SEGMENTS} segments give {table.force_error:.2g} of the largest force")


def _chord_errors(x: Floats, y: Floats, exponent: float) -> Floats:
    """(s,) largest distance of each segment from the curve ``x^exponent`` where both are parallel, with its sign."""
    slope = np.diff(y) / np.diff(x)
    at = np.clip((slope / exponent) ** (1.0 / (exponent - 1.0)), x[:-1], x[1:])
    return np.asarray(y[:-1] + slope * (at - x[:-1]) - at**exponent)


NEGLIGIBLE_SLOPE = 1e-9  # relative to the steepest slope; a smaller one is round-off


def fit_curve(deflection: Floats, force: Floats, segments: int) -> tuple[ForceCurve, float]:
    """Fit a rising curve through zero to points, with the least mean square error.

    Parameters
    ----------
    deflection, force : (p,) points, m and N; points at negative deflections have no contact.
    segments : largest number of segments.

    Returns
    -------
    ForceCurve, float
        The curve, and the root mean square of the residuals, N.

    Raises
    ------
    ValueError
        If no force is positive, or the force does not rise.
    """
    used = deflection > 0.0
    x, y = deflection[used], force[used]
    order = np.argsort(x, kind="stable")
    x, y = x[order], y[order]
    if not x.size or not np.any(y > 0.0):
        raise ValueError("no point has a positive deflection and a positive force")
    knots = _best_knots(x, y, segments)
    slopes, square = _slopes(x, y, knots)
    slopes[slopes < NEGLIGIBLE_SLOPE * slopes.max()] = 0.0
    edges = np.append(knots, x[-1])
    curve = ForceCurve(edges, np.concatenate([[0.0], np.cumsum(slopes * np.diff(edges))]))
    if curve.force[-1] <= 0.0:
        raise ValueError("the force does not rise with the deflection")
    return _merge_segments(curve), float(np.sqrt(square / x.size))


def _best_knots(x: Floats, y: Floats, segments: int) -> Floats:
    """Knots of at most this number of segments, the first at zero."""
    places = np.unique(x)
    if places.size <= segments:  # no rising curve fits better than one with knots at the points
        return np.concatenate([[0.0], places[:-1]])
    even = np.concatenate([[0.0], places[np.arange(1, segments) * places.size // segments]])
    starts = [_optimise_knots_together(x, y, knots) for knots in (_starting_knots(x, y, segments), even)]
    knots = min(starts, key=lambda knots: _slopes(x, y, knots)[1])
    return _optimise_knots_singly(x, y, knots) if knots.size <= 10 else knots


def _merge_segments(curve: ForceCurve) -> ForceCurve:
    """Merge neighbouring segments with equal slopes."""
    slopes = curve.slopes
    bends = np.flatnonzero(np.abs(np.diff(slopes)) > 1e-9 * slopes.max()) + 1
    kept = np.concatenate([[0], bends, [slopes.size]])
    return ForceCurve(curve.deflection[kept], curve.force[kept])


def hinges(x: Floats, knots: Floats) -> Floats:
    """(points, knots) deflection within each segment, whose factors are the slopes."""
    width = np.append(np.diff(knots), np.inf)
    return np.asarray(np.clip(x[:, None] - knots, 0.0, width))


def fitted_numbers(matrix: Floats, target: Floats) -> tuple[Floats, float]:
    """Non-negative factors of the columns with the smallest squared misfit to a target, and this misfit."""
    from scipy.optimize import nnls

    scale = np.linalg.norm(matrix, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    numbers = nnls(matrix / scale, target)[0] / scale
    return numbers, float(np.sum((matrix @ numbers - target) ** 2))


def _slopes(x: Floats, y: Floats, knots: Floats) -> tuple[Floats, float]:
    """Best slopes for given knots, and the squared misfit."""
    return fitted_numbers(hinges(x, knots), y)


def _starting_knots(x: Floats, y: Floats, segments: int) -> Floats:
    """Initial knots, between intervals of points that are best fitted by straight lines; the first is zero."""
    edge = np.unique(np.linspace(0, x.size, min(120, x.size) + 1).astype(int))  # candidate ends of intervals
    count = edge.size - 1
    segments = min(segments, count)
    # cumulative sums give the misfit of a line on any interval
    total = np.vstack([np.zeros(6), np.cumsum(np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1), axis=0)])
    total = total[edge]
    n, sx, sy, sxx, sxy, syy = np.moveaxis(total[None] - total[:, None], 2, 0)  # [first, last]
    with np.errstate(divide="ignore", invalid="ignore"):
        cxx, cxy, cyy = sxx - sx**2 / n, sxy - sx * sy / n, syy - sy**2 / n
        misfit = np.where(cxx > 1e-12 * sxx, cyy - cxy**2 / cxx, cyy)
    misfit = np.where(np.triu(np.ones_like(misfit), 1) > 0, np.maximum(np.nan_to_num(misfit), 0.0), np.inf)
    best = misfit[0].copy()
    chosen = []
    for _ in range(segments - 1):
        through = best[:, None] + misfit
        chosen.append(np.argmin(through, axis=0))
        best = through[chosen[-1], np.arange(count + 1)]
    at, knots = count, [0.0]
    for last in reversed(chosen):
        at = int(last[at])
        if 0 < edge[at] < x.size:
            knots.append(0.5 * float(x[edge[at] - 1] + x[edge[at]]))
    return np.unique(knots)


def _optimise_knots_together(x: Floats, y: Floats, knots: Floats) -> Floats:
    """Knots and slopes at a local minimum of the squared misfit."""
    from scipy.optimize import least_squares

    if knots.size == 1:
        return knots
    reach, top = float(x[-1]), float(np.abs(y).max())
    count = knots.size - 1

    def parts(unknowns: Floats) -> tuple[Floats, Floats]:
        return np.concatenate([[0.0], np.cumsum(unknowns[:count])]), unknowns[count:]

    def residual(unknowns: Floats) -> Floats:
        at, slopes = parts(unknowns)
        return np.asarray(hinges(x / reach, at) @ slopes - y / top)

    def jacobian(unknowns: Floats) -> Floats:
        at, slopes = parts(unknowns)
        by_knot = (slopes[:-1] - slopes[1:]) * (x[:, None] / reach > at[1:])
        return np.hstack([np.cumsum(by_knot[:, ::-1], axis=1)[:, ::-1], hinges(x / reach, at)])

    slopes, square = _slopes(x, y, knots)
    start = np.concatenate([np.diff(knots) / reach, slopes * reach / top])
    low = np.concatenate([np.full(count, 1e-9), np.zeros(count + 1)])
    fit = least_squares(residual, np.maximum(start, low + 1e-12), jacobian, bounds=(low, np.inf), max_nfev=200)
    moved = parts(fit.x)[0] * reach
    moved = moved[moved < reach]
    return moved if _slopes(x, y, moved)[1] < square else knots


def _optimise_knots_singly(x: Floats, y: Floats, knots: Floats) -> Floats:
    """Knots after each was moved between its neighbours until the misfit no longer decreased."""
    from scipy.optimize import minimize_scalar

    square = _slopes(x, y, knots)[1]
    floor = 1e-24 * float(y @ y)
    for _ in range(20):
        before = square
        for i in range(1, knots.size):
            low = knots[i - 1]
            high = knots[i + 1] if i + 1 < knots.size else x[-1]

            def misfit(position: float, below: Floats = knots[:i], above: Floats = knots[i + 1 :]) -> float:
                return _slopes(x, y, np.concatenate([below, [position], above]))[1]

            # the misfit has a minimum in each gap between points: try a few positions before a local search
            places = np.linspace(low, high, 12)[1:-1]
            values = [misfit(place) for place in places]
            k = int(np.argmin(values))
            bounds = (low if k == 0 else places[k - 1], high if k == places.size - 1 else places[k + 1])
            lowest = minimize_scalar(misfit, bounds=bounds, method="bounded", options={"xatol": 1e-9 * x[-1]})
            for at, value in ((places[k], values[k]), (float(lowest.x), float(lowest.fun))):
                if value < square and low < at < high:
                    knots, square = np.concatenate([knots[:i], [at], knots[i + 1 :]]), value
        if square <= floor or before - square <= 1e-7 * before:
            break
    return knots


@dataclass(frozen=True)
class MaxwellBranch:
    """A spring in series with a dashpot."""

    stiffness: float  # N/m
    relaxation_time: float  # s, dashpot over stiffness


def table_law(curve: ForceCurve, dashpot: float = 0.0) -> ContactLaw:
    """A force-deflection curve with a parallel dashpot, active while there is penetration: one phase for each segment.

    Examples
    --------
    >>> law = table_law(ForceCurve(np.array([0.0, 1.0, 3.0]), np.array([0.0, 2.0, 10.0])))
    >>> [(phase.name, spring.stiffness, spring.force) for phase in law.phases for spring in phase.springs]
    [('open', 0.0, 0.0), ('segment 1', 2.0, 0.0), ('segment 2', 4.0, -2.0)]
    """
    law = piecewise_linear(curve.deflection[:-1].tolist(), [0.0, *curve.slopes.tolist()], 0)
    names = ["open", *(f"segment {i + 1}" for i in range(len(law.phases) - 1))]
    phases = tuple(
        replace(phase, name=name, dissipative_force=LawRow(rate=dashpot if phase.closed else 0.0))
        for name, phase in zip(names, law.phases, strict=True)
    )
    assert law.one_sided_springs is not None
    parts = (replace(law.one_sided_springs[0], dashpot=dashpot), *law.one_sided_springs[1:])
    return replace(law, phases=phases, one_sided_springs=parts, stiffness=curve.stiffness, dashpot=dashpot)


def recovering_law(curve: ForceCurve, dashpot: float = 0.0, branches: Sequence[MaxwellBranch] = ()) -> ContactLaw:
    """A no-tension pad that recovers by itself; see the module's equations.

    Parameters
    ----------
    curve : force-deflection curve.
    dashpot : parallel dashpot, N s/m.
    branches : Maxwell branches parallel to both.

    Returns
    -------
    ContactLaw
        The internal states are the compression u of the released face (only with a dashpot), then the p of the
        branches. In contact u has no meaning; it is reset at release.
    """
    count = curve.slopes.size
    pad = _Pad(curve, dashpot, tuple(branches))
    phases = [pad.separated_phase(i) for i in range(count)] + [pad.contact_phase(i) for i in range(count)]

    def relax(penetration: float) -> tuple[float, ...]:
        return (0.0,) * pad.first_branch_state + (max(penetration, 0.0),) * len(branches)

    return ContactLaw(
        tuple(phases),
        internal_states=pad.states,
        stiffness=curve.stiffness,
        dashpot=dashpot,
        static=table_law(curve).one_sided_springs,
        relaxed_states=relax,
        undamped_law=None if branches else table_law(curve),
    )


@lru_cache(maxsize=1024)
def no_tension(stiffness: float, dashpot: float = 0.0) -> ContactLaw:
    """As :func:`kelvin_voigt`, but contact ends when the force would become tensile; the released snubber then relaxes.

    It is a pad with a linear curve. The compression p of the released snubber, ``p' = -(k/c) p``, starts from the
    penetration at release; the contact closes when the penetration reaches it. Without a dashpot it is the Kelvin–Voigt
    law.
    """
    undamped = replace(kelvin_voigt(stiffness), rebuild=no_tension)
    if dashpot == 0.0:
        return undamped
    return replace(recovering_law(ForceCurve.line(stiffness), dashpot), rebuild=no_tension, undamped_law=undamped)


def relaxing_law(law: ContactLaw | None, branches: Sequence[MaxwellBranch]) -> ContactLaw:
    """Maxwell branches parallel to a two-sided law without internal states, or alone.

    Examples
    --------
    >>> arrays = relaxing_law(None, [MaxwellBranch(3.0, 0.5)]).arrays
    >>> arrays.force[0, [0, 6]].tolist(), arrays.rates[0, 0, [0, 6]].tolist()
    ([3.0, -3.0], [2.0, -2.0])
    """
    pad = _Pad(ForceCurve(np.zeros(1), np.zeros(1)), 0.0, tuple(branches))
    phases = (Phase("stretched", (), closed=False),) if law is None else law.phases
    return ContactLaw(
        tuple(
            replace(
                phase,
                springs=(*phase.springs, *pad.of_branches(pad.delta)),
                rates=pad.relaxing(pad.delta),
                state_dashpots=pad.state_dashpots,
            )
            for phase in phases
        ),
        internal_states=pad.states,
        start=0 if law is None else law.start,
        static=() if law is None else law.one_sided_springs,
        relaxed_states=lambda extension: (extension,) * pad.states,
    )


@dataclass(frozen=True)
class _Pad:
    """Rows of a pad's phases: factors of the penetration, its rate, 1, and the internal states."""

    curve: ForceCurve
    dashpot: float
    branches: tuple[MaxwellBranch, ...]

    @property
    def first_branch_state(self) -> int:
        """Index of the first branch's state; with a dashpot the state of the face comes before it."""
        return 1 if self.dashpot > 0.0 else 0

    @property
    def states(self) -> int:
        return self.first_branch_state + len(self.branches)

    @property
    def delta(self) -> Floats:
        """(3 + r,) row of the penetration."""
        return self.unit(0)

    def unit(self, column: int) -> Floats:
        """(3 + r,) row of one quantity."""
        return np.asarray(np.eye(OWN_COLUMNS + self.states)[column])

    @property
    def state_dashpots(self) -> tuple[float, ...]:
        """Dashpots of the face and of the branches, N s/m."""
        return (self.dashpot,) * self.first_branch_state + tuple(b.stiffness * b.relaxation_time for b in self.branches)

    def offset(self, i: int) -> float:
        """Force at zero deflection of the extended line of a segment, N."""
        return float(self.curve.force[i] - self.curve.slopes[i] * self.curve.deflection[i])

    def of_branches(self, compression: Floats) -> tuple[LawSpring, ...]:
        """Springs of the branches, for a compression given as a row."""
        extensions = [
            _row(compression - self.unit(OWN_COLUMNS + j)) for j in range(self.first_branch_state, self.states)
        ]
        return tuple(LawSpring(b.stiffness, extension) for b, extension in zip(self.branches, extensions, strict=True))

    def springs(self, i: int, compression: Floats) -> tuple[LawSpring, ...]:
        """Springs of curve and branches on a segment, for a compression given as a row."""
        x, force, slope = self.curve.deflection[: i + 1], self.curve.force[: i + 1], float(self.curve.slopes[i])
        below = float(np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(x)))
        energy = below - 0.5 * slope * float(x[i]) ** 2 - self.offset(i) * float(x[i])
        return (LawSpring(slope, _row(compression), self.offset(i), energy), *self.of_branches(compression))

    def force(self, i: int, compression: Floats) -> Floats:
        """(3 + r,) row of the force of curve and branches on a segment, for a compression given as a row."""
        k = np.array([b.stiffness for b in self.branches])
        row = (float(self.curve.slopes[i]) + k.sum()) * compression
        row[2] += self.offset(i)
        row[OWN_COLUMNS + self.first_branch_state :] -= k
        return np.asarray(row)

    def face(self, i: int) -> Floats:
        """(3 + r,) row of u in the released phase of a segment."""
        if self.first_branch_state:
            return self.unit(OWN_COLUMNS)
        without = self.force(i, np.zeros(OWN_COLUMNS + self.states))
        return np.asarray(-without / self.force(i, self.delta)[0])

    def relaxing(self, compression: Floats) -> tuple[LawRow, ...]:
        """Rates of the branches' states, for a compression given as a row."""
        return tuple(
            _row((compression - self.unit(OWN_COLUMNS + j)) / branch.relaxation_time)
            for j, branch in enumerate(self.branches, start=self.first_branch_state)
        )

    def recovery_rows(self, i: int, *, released: bool) -> tuple[LawRow, ...]:
        """The rate of u if it is a state: when released the dashpot moves under the force; in contact it decays."""
        if not self.first_branch_state:
            return ()
        force = self.force(i, self.unit(OWN_COLUMNS))
        return (_row(-(force if released else force[OWN_COLUMNS] * self.unit(OWN_COLUMNS)) / self.dashpot),)

    def crossings(self, i: int, compression: Floats, first_phase: int) -> list[Guard]:
        """Guards at the ends of a segment; ``first_phase`` is the number of the first segment's phase."""
        guards = []
        if i > 0:
            guards.append(Guard(i - 1 + first_phase, _row(compression, -self.curve.deflection[i])))
        if i + 1 < self.curve.slopes.size:
            guards.append(Guard(i + 1 + first_phase, _row(-compression, self.curve.deflection[i + 1])))
        return guards

    def reset(self, face: LawRow) -> tuple[LawRow, ...] | None:
        """The states after the contact closes or opens; those of the branches are continuous."""
        return (
            (face, *(_row(self.unit(OWN_COLUMNS + j)) for j in range(1, self.states)))
            if self.first_branch_state
            else None
        )

    def separated_phase(self, i: int) -> Phase:
        face = self.face(i)
        meets = Guard(self.curve.slopes.size + i, _row(face - self.delta), self.reset(LawRow()))
        return Phase(
            f"released {i + 1}", (meets, *self.crossings(i, face, 0)), closed=False, springs=self.springs(i, face),
            rates=(*self.recovery_rows(i, released=True), *self.relaxing(face)), state_dashpots=self.state_dashpots,
        )  # fmt: skip

    def contact_phase(self, i: int) -> Phase:
        force = self.force(i, self.delta)
        force[1] = self.dashpot
        lets_go = Guard(i, _row(force), self.reset(PENETRATION_ROW))
        return Phase(
            f"segment {i + 1}", (lets_go, *self.crossings(i, self.delta, self.curve.slopes.size)), closed=True,
            springs=self.springs(i, self.delta), dissipative_force=LawRow(rate=self.dashpot),
            rates=(*self.recovery_rows(i, released=False), *self.relaxing(self.delta)),
            state_dashpots=(0.0,) * self.first_branch_state + self.state_dashpots[self.first_branch_state :],
        )  # fmt: skip


def _row(factors: Floats, constant: float = 0.0) -> LawRow:
    return LawRow(
        float(factors[0]), float(factors[1]), float(factors[2] + constant), tuple(factors[OWN_COLUMNS:].tolist())
    )


def loop_width(deflection: Floats, force: Floats) -> float:
    """Mean difference between loading and unloading, relative to the largest force; 0 without unloading."""
    step = np.diff(deflection)
    middle, push = 0.5 * (deflection[1:] + deflection[:-1]), 0.5 * (force[1:] + force[:-1])
    rising, falling = step > 0, step < 0
    try:
        up, down = (fit_curve(middle[way], push[way], COMPARED_SEGMENTS)[0] for way in (rising, falling))
    except ValueError:
        return 0.0
    common = np.linspace(0.0, min(up.deflection[-1], down.deflection[-1]), 201)
    return float(np.mean(np.abs(up.at(common) - down.at(common))) / np.abs(force).max())


def relaxed_part(time: Floats, deflection: Floats, relaxation_time: float | Floats) -> Floats:
    """Solution p of ``tau p' = delta - p``, with the deflection linear between its samples, initially relaxed.

    Parameters
    ----------
    time, deflection : (t,) samples, s and m.
    relaxation_time : tau, s; or (n,) values.

    Returns
    -------
    (t,) or (t, n) array
        m.
    """
    tau = np.asarray(relaxation_time)
    p = np.empty((time.size, *tau.shape))
    p[0] = deflection[0]
    h = np.diff(time).reshape(-1, *(1,) * tau.ndim) / tau
    decay = np.exp(-h)
    ramp = -np.expm1(-h) / h  # mean of the decay over the step
    for i in range(time.size - 1):
        p[i + 1] = decay[i] * p[i] + (ramp[i] - decay[i]) * deflection[i] + (1.0 - ramp[i]) * deflection[i + 1]
    return p
