"""Tongues of internal resonance: the mode to which a backbone transfers its energy, and the branch along which it does.

Close to ``n omega = omega_r`` motions of one period exist that hold any share of the energy in mode r. They are entered
here by asking for a share instead of a parameter, and followed until the energy has been transferred.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from beamsim.orbits.branch import BranchPoint, OrbitBranch, too_many_points
from beamsim.orbits.continuation import Predictor, Settings, correct
from beamsim.orbits.free_orbits import BrakeOrbits
from beamsim.outcomes import Outcome, OutcomeKind
from beamsim.typing import Floats

FIRST_AMPLITUDES = (0.3, 0.4)  # of the other mode, against all the energy in it, at which a tongue is entered
RETURN_AMPLITUDES = (0.2, 0.1)  # the same amplitudes on the way back to the backbone
STEPS = (1.0, 0.6, 1.7, 0.3)  # of the step, tried in turn: over the thinner tongues of third modes
SHORTEST, LONGEST = 1e-3, 0.12  # steps in scaled unknowns
THIRD_MODES = 0.03  # share of third modes beyond what they had, above which a motion belongs to one of their tongues
LEAST_SHARE = 0.5  # of the energy in the requested mode: a tongue has less somewhere, a jump leads to more
SAMPLES_A_TURN = 8  # of the fastest coordinate


def harmonics(orbits: BrakeOrbits, point: BranchPoint, count: int) -> Floats:
    """(count, n) cosine amplitudes of the linear modes' coordinates, over those that carry all the energy alone.

    A motion from rest to rest is even about both instants, so that half of it makes a type-I cosine transform.

    Parameters
    ----------
    orbits, point : the motion.
    count : of harmonics, from 0.

    Returns
    -------
    (count, n) amplitudes.
    """
    period = orbits.split(point.u)[1]
    times = np.linspace(0.0, 0.5 * period, count + 1)
    x = point.data.flow.states_at(point.data.flow_map, times)[:, : orbits.n] @ orbits.vectors
    even = np.concatenate([x, x[-2:0:-1]])
    spectrum = np.fft.rfft(even, axis=0).real[:count] / count
    return np.asarray(spectrum * orbits.omega / np.sqrt(2.0 * point.data.energy))


def resonance_between(orbits: BrakeOrbits, a: BranchPoint, b: BranchPoint, mode: int) -> tuple[int, int]:
    """The other mode (from 0) and the order n of the resonance that lies between two motions of a backbone.

    It is where the harmonics of the other modes differ most: on its two sides a resonance answers in opposite phase.

    Parameters
    ----------
    orbits : the shooting problem.
    a, b : motions on both sides of the resonance.
    mode : whose backbone, from 0.

    Returns
    -------
    The other mode and n.
    """
    period = max(orbits.split(p.u)[1] for p in (a, b))
    count = min(int(np.ceil(SAMPLES_A_TURN * float(orbits.omega.max()) * period / (2 * np.pi))), 1024)
    change = np.abs(harmonics(orbits, b, count) - harmonics(orbits, a, count))
    change[0] = 0.0
    change[:, mode] = 0.0
    order, other = np.unravel_index(int(np.argmax(change)), change.shape)
    return int(other), int(order)


RIGID_BODY_RATIO = 1e-6  # of the frequency of the requested mode: a slower mode is a rigid-body mode


@dataclass
class Tongues:
    """The tongues of one mode's backbone.

    Parameters
    ----------
    orbits : the shooting problem.
    mode : whose backbone, from 0.
    low, high : the parameter's range.
    most_points : of a tongue.
    """

    orbits: BrakeOrbits
    mode: int
    low: float
    high: float
    most_points: int = 40
    settings: Settings = field(default_factory=lambda: Settings(iterations=6))

    def _row(self, u: Floats, mode: int) -> Floats:
        """A mode's coordinate at rest, over the one that would carry all the energy, as a row on scaled unknowns."""
        o = self.orbits
        row = np.zeros(u.size)
        row[: o.n] = o.vectors[:, mode] * (float(o.omega[mode]) / np.sqrt(2.0 * o.split(u)[3]))
        return row * o.scale(u)[0]

    def tongue_between(self, a: BranchPoint, b: BranchPoint, other_mode: int) -> OrbitBranch | None:
        """The tongue of another mode that a step of the backbone from a to b crosses; None where none is found.

        A disturbance of the shape in the other mode alone comes to rest again after half a period where
        ``n omega = omega_r``: there the derivative of its velocity by its own amplitude changes sign. A rigid-body mode
        has neither a multiple of the frequency nor a share of the strain energy.

        Parameters
        ----------
        a, b : neighbours on the backbone.
        other_mode : the other mode, from 0.

        Returns
        -------
        The tongue, from its first motion inwards.
        """
        if self.orbits.omega[other_mode] < RIGID_BODY_RATIO * self.orbits.omega[self.mode]:
            return None
        left, right = self.orbits.mode_slope(a, other_mode), self.orbits.mode_slope(b, other_mode)
        at = left / (left - right) if left * right < 0 else 0.5
        u = a.u + at * (b.u - a.u)
        towards = np.copysign(1.0, self._row(u, other_mode) @ ((a.u - b.u) / self.orbits.scale(u)[0]))
        for sign in (towards, -towards):
            points = self._enter(u, other_mode, float(sign)) or []
            # a thinner tongue of a third mode may stop the path from one beginning and not from another
            for begin in {len(points): points, 2: points[-2:]}.values():
                tongue = self.trace(begin, other_mode, float(u[-1])) if begin else None
                if tongue is not None:
                    return tongue
        return None

    def _enter(self, u: Floats, other_mode: int, sign: float) -> list[BranchPoint] | None:
        """Motions of growing amplitude in the other mode, from a backbone's motion u at the resonance."""
        scale = self.orbits.scale(u)[0]
        row = self._row(u, other_mode)
        q, _, factor, _ = self.orbits.split(u)
        shares = self.orbits.share(q, factor)
        most_third = 1.0 - float(shares[self.mode] + shares[other_mode]) + 2 * THIRD_MODES
        settings = replace(self.settings, iterations=12)
        direction = np.zeros(u.size)  # in scaled unknowns, of unit amplitude in the other mode alone
        direction[: self.orbits.n] = row[: self.orbits.n] / float(row @ row)

        def at(guess: Floats, amplitude: float) -> BranchPoint | None:
            w = guess / scale
            w = w + (sign * amplitude + float(row @ (u / scale - w))) * direction
            point = correct(self.orbits, Predictor(w * scale, row, scale, largest_distance=0.5), settings)
            if point is None or not self.low <= point.parameter <= self.high:
                return None
            # 0.6: of the amplitude asked for, for a motion to count as one in the tongue
            entered = self.orbits.share_at(point)[other_mode] > (0.6 * amplitude) ** 2
            return point if entered and self._third(point, other_mode) < most_third else None

        points: list[BranchPoint] = []
        for amplitude in FIRST_AMPLITUDES:
            guess = u if not points else points[-1].u
            point = at(guess, amplitude)
            if point is None:
                return None
            points.append(point)
        for amplitude in RETURN_AMPLITUDES:
            ahead = points[0].u + (points[0].u - points[1].u)
            point = at(ahead, amplitude)
            if point is None:
                break
            points.insert(0, point)
        return points

    def trace(self, begin: list[BranchPoint], other_mode: int, parameter: float) -> OrbitBranch | None:
        """A tongue followed over the thinner tongues of third modes that cross it.

        Parameters
        ----------
        begin : the first motions in it.
        other_mode : the mode to which the energy goes, from 0.
        parameter : where it leaves the backbone.

        Returns
        -------
        The tongue; None where the mode of the backbone keeps most of the energy all along.
        """
        points = list(begin)
        scale = self.orbits.scale(points[-1].u)[0]
        ds = LONGEST if len(begin) > 2 else float(np.linalg.norm((points[-1].u - points[-2].u) / scale))
        ds = min(max(ds, SHORTEST), LONGEST)
        failures = 0
        outcome = too_many_points(self.most_points)
        third = self._third(points[-1], other_mode)
        while len(points) < self.most_points:
            new = None
            for part in STEPS:
                new = self._ahead(points, scale, part * ds, other_mode, third + THIRD_MODES)
                if new is not None:
                    break
                failures += 1
            if new is None:
                ds *= 0.4
                # 12: attempts without a motion, in one tongue
                if ds < SHORTEST or failures > 12:
                    outcome = Outcome.of(
                        OutcomeKind.STOPPED, "no_further_motion",
                        "no further motion in these two modes alone was found",
                    )  # fmt: skip
                    break
                continue
            points.append(new)
            third = 0.5 * (third + self._third(new, other_mode))
            # 0.02: share of the energy in the requested mode below which a tongue ends
            if self.orbits.share_at(new)[self.mode] < 0.02:
                outcome = Outcome.of(
                    OutcomeKind.COMPLETE, "energy_transferred", "the energy has been transferred to the other mode"
                )
                break
            ds = min(LONGEST, 1.4 * ds) if part == 1.0 else min(ds, max(part, 0.5) * ds)
        shares = [float(self.orbits.share_at(p)[self.mode]) for p in points]
        if min(shares) > LEAST_SHARE:
            return None
        deepest = points[int(np.argmin(shares))]
        return OrbitBranch(
            self.orbits,
            points,
            outcome,
            kind="tongue",
            mode=other_mode,
            ratio=self.order(deepest, other_mode),
            origin=parameter,
        )

    def _third(self, point: BranchPoint, other_mode: int) -> float:
        share = self.orbits.share_at(point)
        return float(1.0 - share[self.mode] - share[other_mode])

    def _ahead(
        self, points: list[BranchPoint], scale: Floats, ds: float, other_mode: int, most_third: float
    ) -> BranchPoint | None:
        """The motion a step beyond the last one; None where there is none, or it belongs to a third mode's tongue."""
        w = [p.u / scale for p in points[-3:]]
        chord = w[-1] - w[-2]
        last = float(np.linalg.norm(chord))
        row = chord / last
        guess = w[-1] + ds * row
        if len(w) == 3:
            before = w[-2] - w[-3]
            size = float(np.linalg.norm(before))
            # Newton's form of the parabola in the length along the chords
            guess = guess + ds * (ds + last) * (row - before / size) / (last + size)
        point = correct(
            self.orbits, Predictor(guess * scale, row, scale, row, largest_distance=0.7 * ds), self.settings
        )
        if point is None or not self.low <= point.parameter <= self.high:
            return None
        return point if self._third(point, other_mode) < most_third else None

    def order(self, point: BranchPoint, other_mode: int) -> int:
        """n: the strongest harmonic of the other mode's coordinate."""
        period = self.orbits.split(point.u)[1]
        count = int(np.ceil(SAMPLES_A_TURN * (2.0 + float(self.orbits.omega[other_mode]) * period / (2 * np.pi))))
        return 1 + int(np.argmax(np.abs(harmonics(self.orbits, point, count)[1:, other_mode])))
