"""The exact flow: a system under its forcing, with its contact states built as they are visited."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from beamsim.flow.contact_state import ContactState, LinearOutput, build_state, state_loads
from beamsim.flow.sources import Sources, compile_sources
from beamsim.flow.state_tables import StateTables, pad
from beamsim.inputs.signal import Signal
from beamsim.system.equations import Forcing, PiecewiseLinearSystem
from beamsim.typing import Bools, Complexes, Floats, Ints

if TYPE_CHECKING:
    from beamsim.flow.kernels import Inputs, Tables

LONGEST_WINDOW_RADIANS = 64.0  # of the slowest oscillation, before the series of a segment are started anew
HIGHEST_DERIVATIVE = 6  # looked at to tell on which side a motion that starts at zero gap goes


@dataclass
class ExactFlow:
    """A system under its forcing, with the contact states diagonalised so far.

    Parameters
    ----------
    system, forcing : the structure and its loads.
    duration : longest time the flow will be asked for, s.
    observers : further signals (the base's motion) that outputs may contain; they load nothing.
    """

    system: PiecewiseLinearSystem
    forcing: Forcing
    duration: float
    observers: tuple[Signal, ...] = ()
    sources: Sources = field(init=False)
    base_channel: int = field(init=False)
    states: list[ContactState] = field(init=False, default_factory=list)

    def __post_init__(self) -> None:
        channels = list(self.forcing.signal)
        self.base_channel = -1
        if self.forcing.base_displacement is not None and bool(self.system.contacts.on_ground.any()):
            self.base_channel = len(channels)
            channels.append(self.forcing.base_displacement)
        self.first_observer = len(channels)
        channels.extend(self.observers)
        self.sources = compile_sources(tuple(channels))
        slowest = self.system.stiffness[self.system.stiffness > 0]
        period = LONGEST_WINDOW_RADIANS / float(np.sqrt(slowest.min())) if slowest.size else np.inf
        self.longest_window = min(period, max(self.duration, 1e-300))
        self._index: dict[bytes, int] = {}
        self._tables = StateTables(self.system.contacts.count)
        self._inputs: Inputs | None = None

    @property
    def has_face(self) -> Bools:
        """Snubbers that keep a compression of their own after release (m,)."""
        contacts = self.system.contacts
        return np.asarray(contacts.no_tension & (contacts.dashpot > 0))

    def state_index(self, closed: Bools) -> int:
        """Number of the contact state, built when it is first asked for."""
        key = closed.tobytes()
        if key not in self._index:
            state = build_state(self.system, self.forcing, self.sources, self.base_channel, closed, self.longest_window)
            output = self.watched(closed)
            watch = state.coefficients(output, self.sources)
            roughness = state.roughness(output, watch)[:, : closed.size]
            self._index[key] = self._tables.append(state, watch, roughness)
            self.states.append(state)
        return self._index[key]

    def follow(self, state: int, contact: int) -> int:
        """The state after one contact toggles."""
        closed = self.states[state].closed.copy()
        closed[contact] = ~closed[contact]
        following = self.state_index(closed)
        self._tables.join(state, contact, following)
        return following

    def tables(self) -> Tables:
        """The states' tables for the kernels."""
        return self._tables.arrays()

    def inputs(self) -> Inputs:
        """The sources as the kernels want them."""
        if self._inputs is None:
            from beamsim.flow.kernels import Inputs

            contacts, sources = self.system.contacts, self.sources
            with np.errstate(divide="ignore"):
                rate = np.where(contacts.dashpot > 0, contacts.stiffness / contacts.dashpot, 0.0)
            self._inputs = Inputs(
                sources.start, sources.amplitude, sources.exponent, sources.power, sources.group_last(),
                self.has_face, rate,
            )  # fmt: skip
        return self._inputs

    def output_table(self, output_of: Callable[[Bools], LinearOutput]) -> Complexes:
        """(S, T, k) coefficients of outputs that may depend on the contact state."""
        return pad([s.coefficients(output_of(s.closed), self.sources) for s in self.states])

    def empty_output(self, count: int) -> LinearOutput:
        """An all-zero output to fill in."""
        n, F, m = self.system.size, self.sources.count, self.system.contacts.count
        return LinearOutput(np.zeros((count, 2 * n)), np.zeros((count, F)), np.zeros((count, F)), np.zeros((count, m)))

    def equation_of_motion(self, closed: Bools) -> tuple[Floats, Floats, Floats, Floats]:
        """K (n, n), C (n, n), and (F, n) loads per unit of each source and of its time derivative."""
        shape = self.system.contacts.shape[closed]
        k, c = self.system.contacts.stiffness[closed], self.system.contacts.dashpot[closed]
        load, slope = state_loads(self.system, self.forcing, self.sources, self.base_channel, closed)
        stiffness = np.diag(self.system.stiffness) + (shape.T * k) @ shape
        return stiffness, self.system.damping + (shape.T * c) @ shape, load, slope

    def penetrations(self) -> tuple[LinearOutput, LinearOutput]:
        """Penetration and penetration rate of every contact."""
        n, contacts = self.system.size, self.system.contacts
        delta, rate = self.empty_output(contacts.count), self.empty_output(contacts.count)
        delta.row[:, :n] = -contacts.sign[:, None] * contacts.shape
        delta.direct[:, 0] = -contacts.gap
        rate.row[:, n:] = delta.row[:, :n]
        if self.base_channel >= 0:
            base = np.flatnonzero(self.sources.channel == self.base_channel)
            sign = np.where(contacts.on_ground, -contacts.sign, 0.0)[:, None]
            delta.direct[:, base] = sign
            rate.direct_slope[:, base] = sign
        return delta, rate

    def contact_forces(self, closed: Bools) -> LinearOutput:
        """Force of every contact, zero where open."""
        delta, rate = self.penetrations()
        k = (self.system.contacts.stiffness * closed)[:, None]
        c = (self.system.contacts.dashpot * closed)[:, None]
        return LinearOutput(
            k * delta.row + c * rate.row,
            k * delta.direct + c * rate.direct,
            k * delta.direct_slope + c * rate.direct_slope,
            np.zeros_like(delta.face),
        )

    def watched(self, closed: Bools) -> LinearOutput:
        """Functions that are positive while the state lasts, then the penetrations (2 m)."""
        delta, _ = self.penetrations()
        force = self.contact_forces(closed)
        side = np.where(closed, 1.0, -1.0)[:, None]
        by_force = (self.has_face & closed)[:, None]
        face = np.diag((self.has_face & ~closed).astype(float))
        return LinearOutput(
            np.vstack([np.where(by_force, force.row, side * delta.row), delta.row]),
            np.vstack([np.where(by_force, force.direct, side * delta.direct), delta.direct]),
            np.vstack([np.where(by_force, force.direct_slope, side * delta.direct_slope), delta.direct_slope]),
            np.vstack([face, np.zeros_like(face)]),
        )

    def starting_state(self, state: Floats, face: Floats, time: float = 0.0) -> Bools:
        """Which contacts are closed at a given motion; at zero gap the first derivative that is not zero decides.

        A derivative counts as zero when it is below the round-off of the terms that make it up.
        """
        from beamsim.flow.kernels import segment_coefficients

        m = self.system.contacts.count
        closed = np.zeros(m, dtype=bool)
        if m == 0:
            return closed
        piece = max(int(np.searchsorted(self.sources.start, time, side="right")) - 1, 0)
        undecided = np.ones(m, dtype=bool)
        for _ in range(m + 1):
            index = self.state_index(closed)
            tables = self.tables()
            gamma = segment_coefficients(tables, self.inputs(), tables.watch, index, piece, time, state, face)[:m]
            s = self.states[index]
            B = s.exponent.size
            changed = False
            for j in np.flatnonzero(undecided):
                sign = _first_sign(gamma[j, :B], s.exponent, s.power)
                undecided[j] = False
                if sign < 0:
                    closed[j] = True
                    changed = True
                    break
            if not changed:
                break
        return closed


def _first_sign(gamma: Complexes, exponent: Complexes, power: Ints) -> int:
    """Sign of the first derivative at 0 of ``Re sum gamma tau^p e^{lambda tau}`` that exceeds its round-off."""
    from math import factorial

    for k in range(HIGHEST_DERIVATIVE + 1):
        value = noise = 0.0
        for g, lam, p in zip(gamma, exponent, power, strict=True):
            if p <= k:
                factor = lam ** (k - int(p)) * (factorial(k) / factorial(k - int(p)))
                value += (g * factor).real
                noise += abs(g * factor)
        if abs(value) > 1e-13 * noise:
            return 1 if value > 0 else -1
    return 0
