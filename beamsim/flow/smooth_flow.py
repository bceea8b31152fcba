"""The flow of structures with cubic springs, with its derivatives, for shooting and continuation.

No closed form exists: motion and variational equations are integrated by Taylor series of order 26 to round-off
(:mod:`beamsim.flow.taylor_kernels`), twenty to eighty times faster than by DOP853 of SciPy at a tolerance of 1e-12. On
a step the series is a polynomial, on which the search of the exact flow misses no contact (:mod:`.kernels`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamsim.contacts.equilibrium import CubicSprings
from beamsim.flow.exact import HIGHEST_DERIVATIVE, ROUND_OFF, certain_signs
from beamsim.flow.kernels import BEGINNING
from beamsim.flow.periodic_flow import (
    ContactDirection,
    FlowMap,
    Frequency,
    Level,
    Parameter,
    PeriodicFlow,
    WorkExceeded,
    check_finite,
)
from beamsim.flow.taylor_kernels import (
    DONE,
    FULL,
    SmoothMotion,
    SmoothSystem,
    Steps,
    carry_smooth,
    make_series,
    sample_smooth,
    series_at,
)
from beamsim.typing import Bools, Floats

RADIANS = 3.0  # of the fastest mode, the longest step
STEPS_OF_LOG = 128  # of the compiled integration, for which its log has room
MOST_STEPS = 131072  # in a period of the loads
_FACTORIAL = np.cumprod(np.maximum(np.arange(HIGHEST_DERIVATIVE + 1.0), 1.0))


@dataclass
class SmoothFlow(PeriodicFlow):
    """The flow of a structure with cubic springs, and contacts, by power series.

    The contacts are sums of one-sided springs (no ``no_tension`` dashpots); each part is a contact here.

    Parameters
    ----------
    springs : the cubic springs.
    """

    springs: CubicSprings = field(kw_only=True)

    def _prepare(self) -> None:
        if not self.system.contacts.one_sided:
            raise ValueError(
                "a no_tension snubber with a dashpot cannot be combined with cubic springs; use kelvin_voigt"
            )
        contacts = self.system.contacts.one_sided_springs()
        self.system = replace(self.system, contacts=contacts)
        self._longest = RADIANS / self.system.fastest if self.system.fastest > 0 else np.inf

    def _arrays(self, parameters: Sequence[Parameter]) -> Any:
        s, c, loads = self.system, self.system.contacts, self.loads
        P, (force, base, d_force, d_base) = len(parameters), loads.at(self.omega, self.level)
        # the numbers, and below them their derivatives by each parameter
        forces, rising = np.zeros((2, 1 + P, *force.shape), dtype=complex)
        bases, base_rising = np.zeros((2, 1 + P, loads.count, c.base_influence.shape[1]), dtype=complex)
        cubic, stiffness, gap = (np.zeros((1 + P, of.size)) for of in (self.springs.stiffness, c.stiffness, c.gap))
        moved = bases[..., : base.shape[1]]  # a base at rest may have no motion
        forces[0], moved[0], cubic[0], stiffness[0], gap[0] = force, base, self.springs.stiffness, c.stiffness, c.gap
        for i, p in enumerate(parameters, 1):
            if isinstance(p, Frequency):
                turned = 1j * loads.multiple[:, None]
                forces[i], moved[i] = d_force, d_base
                rising[i], base_rising[i, :, : base.shape[1]] = turned * force, turned * base
            elif isinstance(p, Level):
                forces[i], moved[i] = loads.at(self.omega, 1.0)[:2]
            elif isinstance(p, ContactDirection) and not (np.any(p.dashpot) or np.any(p.shape)):
                stiffness[i], gap[i] = p.stiffness, p.gap
                cubic[i] = 0.0 if p.cubic is None else p.cubic
            else:
                raise ValueError("with cubic springs only stiffness and gap of the contacts can be followed")
        return SmoothSystem(
            s.stiffness.astype(float), s.damping[np.nonzero(s.damping)], np.array(np.nonzero(s.damping)),
            s.constant_load.astype(float), np.ascontiguousarray(self.springs.shape).reshape(cubic.shape[1], s.size),
            cubic, self.springs.base_influence, np.ascontiguousarray(c.shape), c.sign, stiffness, c.dashpot, gap,
            c.base_influence, loads.multiple * self.omega, forces, rising, bases, base_rising, self._longest,
        )  # fmt: skip

    def _closed_at(self, arrays: Any, z: Floats, t: float) -> Bools:
        """(m,) whether each contact is closed at the start of a motion; see `beamsim.flow.exact.certain_signs`.

        While penetration and rate are zero a contact has no force, so that the derivatives that decide do not depend on
        whether it is closed. Their parts are as large as those of motions with the modes' frequencies.
        """
        c, n, orders = self.system.contacts, self.system.size, np.arange(HIGHEST_DERIVATIVE + 1)[:, None]
        (penetration,), _ = self.penetration_of(z[None], np.array([t]))
        series = make_series(arrays, 1)
        series_at(arrays, penetration > 0, t, z[:, None], series)
        q, base = series.q[orders[:, 0], :, 0], series.d[orders[:, 0], :, 0]
        omega = np.sqrt(np.abs(self.system.stiffness))
        size = np.abs(z[:n]) * omega**orders + np.abs(z[n:]) * omega ** np.maximum(orders - 1, 0) * (orders > 0)
        gap = np.where(orders == 0, c.gap, 0.0)
        value = -gap - c.sign * (q @ c.shape.T + base @ c.base_influence.T)
        parts = (np.abs(q) + size / _FACTORIAL[orders]) @ np.abs(c.shape).T + np.abs(gap)
        parts += np.abs(base) @ np.abs(c.base_influence).T
        return certain_signs(value, ROUND_OFF * parts)[0] > 0

    def flow_map(self, start: Floats, duration: float, parameters: Sequence[Parameter] = (), t: float = 0.0) -> FlowMap:
        """The state after ``duration``, with its derivatives.

        Parameters
        ----------
        start, duration, t : see `PeriodicFlow.flow_map`.
        parameters : frequency, level, or directions in which only stiffness and gap of the springs and contacts change.

        Returns
        -------
        FlowMap
            The motion with the derivatives of its end; its segments are the steps of the series.

        Raises
        ------
        WorkExceeded
            Where it takes more steps than allowed (chattering).
        NotFinite
            Where the motion leaves the range of floating-point numbers.
        ValueError
            Where a parameter changes a dashpot, a shape or the structure.
        """
        return self._flow_map(start, duration, parameters, t, np.eye(self.size))

    def end(self, start: Floats, duration: float, t: float = 0.0) -> Floats:
        """(N,) the state after ``duration``; see `PeriodicFlow.end`."""
        return self._flow_map(start, duration, (), t, np.empty((self.size, 0))).end

    def _flow_map(
        self, start: Floats, duration: float, parameters: Sequence[Parameter], t: float, by_start: Floats
    ) -> FlowMap:
        """A motion with its derivatives by parameters, and those by the start times a matrix (N, any)."""
        N, m, P, room = self.size, self.system.contacts.count, len(parameters), STEPS_OF_LOG
        self._march_count[0] += 1
        arrays = self._arrays(parameters)
        columns = np.hstack([start[:, None], np.zeros((N, P)), by_start])  # the motion, and its derivatives
        motion = SmoothMotion(columns, self._closed_at(arrays, start, t), np.zeros(N))
        end, begins, steps = t + duration, BEGINNING, 0
        parts: list[tuple[NDArray[np.generic], ...]] = []
        log = Steps(
            np.empty(room), np.empty(room), np.empty((room, m), dtype=np.bool_), np.empty((room, N)), np.empty(room),
            np.empty(room, dtype=np.int64), np.empty(room, dtype=np.bool_),
        )  # fmt: skip
        while True:
            code, t, begins, count, events = carry_smooth(arrays, t, end, begins, motion, log)
            rows = [count] * 4 + [events] * 3
            parts.append(tuple(column[:used].copy() for column, used in zip(log, rows, strict=True)))
            steps += count
            if (
                code != FULL
                or steps >= MOST_STEPS * (1.0 + duration * self.omega / (2.0 * np.pi))
                or not np.all(np.isfinite(columns[:, 0]))
            ):
                break
        time, length, touching, states, *event = (np.concatenate(column) for column in zip(*parts, strict=True))
        check_finite(columns[:, 0])
        if code != DONE:
            raise WorkExceeded(f"no end after {steps} steps and {event[0].size} contact events")
        reached, by_parameters, transition = np.split(columns, (1, 1 + P), axis=1)
        closing = event[2].astype(np.int64)
        return FlowMap(
            start, reached[:, 0].copy(), transition.copy(), by_parameters.copy(), motion.slope, duration, time, length,
            touching.astype(np.int64), states, event[0], event[1], 1 - closing, closing,
        )  # fmt: skip

    def cubic_extension(self, y: Floats, times: Floats) -> Floats:
        """(nt, nc) extension of the cubic springs at states (nt, N)."""
        moves = self.loads.base.any()
        base = self.loads.base_motion(self.omega, self.level, times)[0] if moves else None
        return self.springs.extension(y[:, : self.system.size], base)

    @property
    def fastest(self) -> float:
        """rad/s: a step of the series is at most `RADIANS` of it."""
        return RADIANS / self._longest

    def states_at(self, flow_map: FlowMap, times: Floats) -> Floats:
        """(nt, N) the state (q, q') at increasing times within a motion."""
        out = np.empty((times.size, 2 * self.system.size))
        sample_smooth(
            self._arrays(()), flow_map.time, flow_map.phases > 0, flow_map.y, np.ascontiguousarray(times), out
        )
        return out
