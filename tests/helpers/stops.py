"""A second opinion on stops with memory: one mass, small steps, forces from springs that are clipped.

It is written apart from the package, which is not imported here.
"""

from dataclasses import dataclass

import numpy as np


class CrushableStop:
    """Bilinear with kinematic hardening: two springs side by side, one behind a slider; it never pulls."""

    def __init__(self, stiffness, yield_force, hardening):
        self.soft, self.stiff = hardening, stiffness - hardening
        self.limit, self.slider = yield_force * self.stiff / stiffness, 0.0

    @property
    def face(self):
        return self.stiff * self.slider / (self.soft + self.stiff)

    def force(self, delta, rate, step):
        if delta <= self.face:
            return 0.0
        held = min(max(self.stiff * (delta - self.slider), -self.limit), self.limit)
        self.slider = delta - held / self.stiff
        return self.soft * delta + held if delta > self.face else 0.0


class FoamStop:
    """Force up one curve and down another: between them a spring whose force is clipped to their distance."""

    def __init__(self, loading, stiffness, recovery=None, pressed=0.0):
        self.loading, self.stiffness = np.array(loading).T, stiffness
        self.recovery = None if recovery is None else np.array(recovery).T
        self.recovers, self.before = recovery is not None, pressed
        self.held = self.distance(pressed)

    def up(self, delta):
        x, f = self.loading
        beyond = max(delta - x[-1], 0.0) * (f[-1] - f[-2]) / (x[-1] - x[-2])
        return float(np.interp(delta, x, f)) + beyond

    def down(self, delta):
        if not self.recovers:
            return 0.0
        x, f = self.recovery
        return float(np.interp(delta, x, f)) if delta <= x[-1] else self.up(delta) - (self.up(x[-1]) - f[-1])

    def distance(self, delta):
        return self.up(delta) - self.down(delta)

    @property
    def face(self):
        return 0.0 if self.recovers else self.before - self.held / self.stiffness

    def force(self, delta, rate, step):
        at = max(delta, 0.0) if self.recovers else delta
        if not self.recovers and delta <= self.face:
            return 0.0
        self.held = min(max(self.held + self.stiffness * (at - self.before), 0.0), self.distance(max(at, 0.0)))
        self.before = at
        return self.down(max(at, 0.0)) + self.held


class LatchingStop:
    """A spring that holds in both directions once it was met."""

    def __init__(self, stiffness, *, held=False):
        self.stiffness, self.held, self.face = stiffness, held, 0.0

    def force(self, delta, rate, step):
        self.held = self.held or delta > 0.0
        self.face = -np.inf if self.held else 0.0
        return self.stiffness * delta if self.held else 0.0


class RelaxingStop:
    """A curve beside one spring behind a dashpot, relaxed at the beginning; it never pulls and recovers by itself."""

    def __init__(self, curve, stiffness, time, pressed=0.0):
        self.curve, self.stiffness, self.time, self.slow = FoamStop(curve, 1.0), stiffness, time, max(pressed, 0.0)
        self.face = self._face()

    def _face(self):
        """Where the force of curve and branch together is zero."""
        x, f = self.curve.loading
        return float(np.interp(self.stiffness * max(self.slow, 0.0), f + self.stiffness * x, x))

    def force(self, delta, rate, step):
        at = delta if delta > self.face else self.face
        self.slow += (at - self.slow) * -np.expm1(-step / self.time)
        self.face = self._face()
        return (
            max(self.curve.up(max(delta, 0.0)) + self.stiffness * (delta - self.slow), 0.0)
            if delta > self.face
            else 0.0
        )


@dataclass(frozen=True)
class StoppedMass:
    """What a mass on a spring did at one stop."""

    closings: list  # s
    openings: list
    push: float  # N, largest
    pull: float
    gap: float  # m, largest distance to the face as it was then
    approach: list  # m/s, speeds of the closings
    force: np.ndarray  # (steps + 1,) N


def mass_at_a_stop(stop, *, mass, spring, gap, position, speed, load, duration, steps, touches):
    """Velocity Verlet of one mass whose positive motion presses the stop.

    ``load`` is a function of time, N; ``touches`` says whether it touched before.
    """
    h, x, v = duration / steps, position, speed
    push, pull, widest, closings, openings, approach = 0.0, 0.0, 0.0, [], [], []
    forces = np.empty(steps + 1)
    force = stop.force(x - gap, v, 0.0)
    a = (load(0.0) - spring * x - force) / mass
    for k in range(steps):
        forces[k] = force
        push, pull = max(push, force), max(pull, -force)
        widest = max(widest, stop.face - (x - gap))
        v += 0.5 * h * a
        x += h * v
        force = stop.force(x - gap, v, h)
        a = (load((k + 1) * h) - spring * x - force) / mass
        v += 0.5 * h * a
        now = x - gap >= stop.face
        if now != touches:
            (closings if now else openings).append((k + 1) * h)
            if now:
                approach.append(v)
        touches = now
    forces[steps] = force
    return StoppedMass(closings, openings, push, pull, widest, approach, forces)
