"""The flow of structures with cubic springs, with its derivatives, for shooting and continuation.

No closed form exists: motion and variational equations are integrated by Taylor series of order 26 to round-off
(:mod:`beamsim.flow.taylor_kernels`). Contacts are located on the series; that none is missed is not certified.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamsim.contacts.contacts import Contacts
from beamsim.dataclass import dataclass
from beamsim.flow.passage import (
    ContactDirection,
    Frequency,
    Level,
    Parameter,
    Passage,
    PeriodicForcing,
    SpringFactor,
    WorkExceeded,
    check_finite,
)
from beamsim.flow.periodic_flow import PeriodicFlow
from beamsim.flow.stopping import check_stop
from beamsim.system.equations import PiecewiseLinearSystem
from beamsim.typing import Bools, Floats, Ints

STEPS_A_CALL = 128  # of the compiled integration, between which signals are handled
MOST_STEPS = 131072  # of a passage
RADIANS = 3.0  # of the fastest mode, the longest step


@dataclass
class SmoothFlow(PeriodicFlow):
    """A structure with cubic springs (and contacts) under periodic loads.

    Parameters
    ----------
    system : the structure and its contacts, sums of one-sided springs (no ``no_tension`` dashpots); each part is a
        contact here.
    cubic_shape, cubic : (nc, n) and (nc,) N/m^3, springs ``force = cubic (shape @ q + d)^3``.
    forcing, omega, level : periodic loads.
    on_ground : (nc,) how much of the base's displacement each spring feels (none of those between masses); all of it by
        default.
    """

    differentiates = (Frequency, Level, ContactDirection, SpringFactor)

    system: PiecewiseLinearSystem
    cubic_shape: Floats
    cubic: Floats
    forcing: PeriodicForcing | None = None
    omega: float = 1.0
    level: float = 1.0
    on_ground: Bools | Floats | None = None

    def __post_init__(self) -> None:
        n = self.system.size
        self._carried = [0]  # shared by all flows that come from this one
        if not self.system.contacts.one_sided:
            raise ValueError(
                "a no_tension snubber with a dashpot cannot be combined with cubic springs; use kelvin_voigt"
            )
        contacts = self.system.contacts.one_sided_parts()
        self.system = replace(self.system, contacts=contacts)
        self.loads = PeriodicForcing.none(n) if self.forcing is None else self.forcing
        self.size = 2 * n
        added = float(np.abs(contacts.stiffness) @ (contacts.shape**2).sum(axis=1))
        fastest = float(np.sqrt(self.system.stiffness.max(initial=0.0) + added))
        self._longest = RADIANS / fastest if fastest > 0 else np.inf
        n, m = self.system.size, self.system.contacts.count
        self._log = (
            np.empty(STEPS_A_CALL), np.empty(STEPS_A_CALL), np.empty((STEPS_A_CALL, m), dtype=np.bool_),
            np.empty((STEPS_A_CALL, 2 * n)), np.empty(STEPS_A_CALL), np.empty(STEPS_A_CALL, dtype=np.int64),
            np.empty(STEPS_A_CALL, dtype=np.bool_),
        )  # fmt: skip

    @property
    def passages(self) -> int:
        """Motions computed so far, of this flow and of those that come from it."""
        return self._carried[0]

    def under(self, omega: float | None = None, level: float | None = None) -> SmoothFlow:
        """The flow of the same structure at another frequency and level."""
        flow = copy(self)
        flow.omega = self.omega if omega is None else float(omega)
        flow.level = self.level if level is None else float(level)
        return flow

    def _arrays(self, parameters: Sequence[Parameter]) -> Any:
        from beamsim.flow.taylor_kernels import SmoothSystem

        s, c = self.system, self.system.contacts
        n, m, H, P, nc = s.size, c.count, self.loads.count, len(parameters), self.cubic.size
        force, base, d_force, d_base = self.loads.at(self.omega, self.level)
        by_force, by_base = np.zeros((P, H, n), dtype=complex), np.zeros((P, H), dtype=complex)
        by_frequency, by_cubic = np.zeros((P, H)), np.zeros((P, nc))
        by_stiffness, by_gap = np.zeros((P, m)), np.zeros((P, m))
        for i, p in enumerate(parameters):
            if isinstance(p, Frequency):
                by_force[i], by_base[i], by_frequency[i] = d_force, d_base, self.loads.multiple
            elif isinstance(p, Level):
                by_force[i], by_base[i] = self.loads.at(self.omega, 1.0)[:2]
            elif isinstance(p, SpringFactor):
                by_cubic[i], by_stiffness[i] = p.cubic, p.stiffness
            elif isinstance(p, ContactDirection) and not (np.any(p.dashpot) or np.any(p.shape)):
                by_stiffness[i], by_gap[i] = p.stiffness, p.gap
            else:
                raise ValueError("with cubic springs only stiffness and gap of the contacts can be followed")
        return SmoothSystem(
            s.stiffness.astype(float), np.ascontiguousarray(s.damping), bool(np.any(s.damping)),
            s.constant_load.astype(float),
            np.ascontiguousarray(self.cubic_shape).reshape(nc, n), self.cubic.astype(float),
            np.ones(nc) if self.on_ground is None else self.on_ground.astype(float),
            np.ascontiguousarray(c.shape), c.sign, c.stiffness, c.dashpot, c.gap, c.felt,
            self.loads.multiple * self.omega, np.ascontiguousarray(force).reshape(H, n), base.astype(complex),
            by_force, by_base, by_frequency, by_cubic, by_stiffness, by_gap,
        )  # fmt: skip

    def _starting_state(self, z: Floats, t: float) -> Ints:
        """Phases of the contacts, 1 where one is closed; at zero gap the one that is approached is."""
        n, c = self.system.size, self.system.contacts
        d, d_rate = self.base_motion(t)
        delta = -c.gap - c.sign * (c.shape @ z[:n] + c.felt * d)
        rate = -c.sign * (c.shape @ z[n : 2 * n] + c.felt * d_rate)
        near = np.abs(delta) <= 1e-13 * (np.abs(c.gap) + np.abs(c.shape) @ np.abs(z[:n]) + c.felt * abs(d))
        return np.asarray(np.where(near, rate > 0, delta > 0), dtype=np.int64)

    def carry(self, start: Floats, duration: float, parameters: Sequence[Parameter] = (), t: float = 0.0) -> Passage:
        """The state after ``duration``, with its derivatives; see :class:`beamsim.flow.periodic_flow.PeriodicFlow`."""
        from beamsim.flow import taylor_kernels

        P, N = len(parameters), self.size
        self._carried[0] += 1
        arrays = self._arrays(parameters)
        y, closed = start.copy(), self._starting_state(start, t) > 0
        sens, slope = np.eye(N, N + P), np.zeros(N)
        end, toggled, steps = t + duration, -1, 0
        parts: list[tuple[NDArray[np.generic], ...]] = []
        while True:
            check_stop()
            log = self._log
            code, t, toggled, count, events = taylor_kernels.carry_smooth(
                arrays, t, end, toggled, closed, y, sens, P, self._longest, *log, slope
            )
            rows = [count] * 4 + [events] * 3
            parts.append(tuple(column[:used].copy() for column, used in zip(log, rows, strict=True)))
            steps += count
            if code != taylor_kernels.FULL or steps >= MOST_STEPS or not np.all(np.isfinite(y)):
                break
        time, length, touching, states, *event = (np.concatenate(column) for column in zip(*parts, strict=True))
        check_finite(y)
        if code != taylor_kernels.DONE:
            raise WorkExceeded(f"no end after {steps} steps and {event[0].size} contact events")
        return Passage(
            start, y, sens[:, :N].copy(), sens[:, N:].copy(), slope, duration,
            time, length, touching.astype(np.int64), states, event[0], event[1], event[2].astype(np.int64),
        )  # fmt: skip

    def cubic_stretch(self, y: Floats, times: Floats) -> Floats:
        """(nt, nc) stretch of the cubic springs at states (nt, N)."""
        d, _ = self.loads.base_motion(self.omega, self.level, times)
        return np.asarray(y[:, : self.system.size] @ self.cubic_shape.T + np.multiply.outer(d, self.felt))

    @property
    def felt(self) -> Floats:
        """(nc,) share of the base's displacement in each cubic spring's stretch."""
        return np.ones(self.cubic.size) if self.on_ground is None else self.on_ground.astype(float)

    @property
    def fastest(self) -> float:
        """rad/s: a step of the series is at most `RADIANS` of it."""
        return RADIANS / self._longest

    def states_at(self, passage: Passage, times: Floats) -> Floats:
        """(nt, N) the state (q, q') at increasing times within a passage."""
        from beamsim.flow import taylor_kernels

        closed = passage.phases > 0
        out = np.empty((times.size, 2 * self.system.size))
        taylor_kernels.sample_smooth(
            self._arrays(()), passage.time, closed, passage.y, np.ascontiguousarray(times), out
        )
        return out

    def with_contacts(self, contacts: Contacts) -> SmoothFlow:
        """The flow of the same structure with other contacts."""
        return replace(self, system=replace(self.system, contacts=contacts))

    def with_damping(self, damping: Floats) -> SmoothFlow:
        """The flow of the same structure with another damping matrix (n, n)."""
        return replace(self, system=replace(self.system, damping=damping))
