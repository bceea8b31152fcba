r"""Equations of motion of a system, as arrays in mass-normalised coordinates, and its channels.

With every contact in one phase of its law, the system is linear,

.. math:: \ddot q + C_s \dot q + K_s q = f_0 + \sum_l L_l\, a_l(t) + \text{contact constants},

where :math:`M = I` and the open structure's stiffness is diagonal. Nothing here knows files, units
or what the coordinates stand for.

A channel is an observable, a linear row on the motion and on what acts on it,

.. math:: y = D q + V q' + A q'' + a\, \ddot d + b\, d + F f + G g + S s(t) + c + P p(q)

with the coordinates q relative to the base, the base's displacement d, the forces f of the contacts and their openings
g, the signals s of the loads and the pulls p of cubic springs. Whoever evaluates channels needs to know no more of them
than this.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.laws import PRESSING
from beamsim.inputs.signal import Signal
from beamsim.typing import Complexes, Floats, Ints


@dataclass(frozen=True)
class PiecewiseLinearSystem:
    """A structure in n mass-normalised coordinates (M = I) with m contacts."""

    stiffness: Floats  # (n,) diagonal of K of the open structure, rad^2/s^2; exact zeros for rigid-body modes
    damping: Floats  # (n, n) symmetric C of the open structure, 1/s
    contacts: Contacts
    constant_load: Floats  # (n,) gravity and dead loads, N per sqrt(kg)

    @property
    def size(self) -> int:
        """n."""
        return int(self.stiffness.size)

    @cached_property
    def fastest(self) -> float:
        """rad/s, that no natural frequency with all contacts closed exceeds."""
        contacts = self.contacts
        closed = np.abs(contacts.arrays.force[:, :, 0]).max(axis=1, initial=0.0) @ (contacts.shape**2).sum(axis=1)
        return float(np.sqrt(self.stiffness.max(initial=0.0) + closed))

    @cached_property
    def coupled_by_damping(self) -> bool:
        """Whether C of the open structure has entries beside its diagonal."""
        return bool(np.count_nonzero(self.damping) > np.count_nonzero(np.diag(self.damping)))

    def acts(self, phases: Ints) -> bool:
        """Whether contacts act on the structure in given phases, or move by themselves."""
        arrays, every = self.contacts.arrays, np.arange(self.contacts.count)
        pushing = arrays.force[every, phases, :PRESSING].any() or arrays.holds[every, phases].any()
        return self.contacts.internal_states > 0 or bool(pushing)

    def one_sided(self) -> PiecewiseLinearSystem:
        """The same with one-sided springs as the only contacts; see `Contacts.one_sided_parts`."""
        parts = self.contacts.one_sided_parts()
        return self if parts is self.contacts else replace(self, contacts=parts)


@dataclass(frozen=True)
class Forcing:
    """Time-dependent loads: ``sum_l load[l] * signal[l](t)``, and the base's own displacement d(t).

    ``base_displacement`` is needed only by contacts on the ground (``None`` means d = 0), ``influence`` by contacts on
    what moves by signals of its own.
    """

    load: Floats  # (L, n)
    signal: tuple[Signal, ...]  # (L,)
    base_displacement: Signal | None = None
    influence: Floats | None = (
        None  # (m, L) displacement of each contact's place from its stand by a unit of each signal
    )


@dataclass(frozen=True)
class SineLoads:
    """The loads of a forcing as multiples of one sine: load l is ``coefficient[l] (i omega)^power[l]`` times it.

    The sine is the acceleration of the base or of a support that moves, the force, or what multiplies several forces.
    """

    coefficient: Complexes  # (L,)
    power: Ints  # (L,)

    def at(self, omega: Floats) -> Complexes:
        """(F, L) multiples at angular frequencies (F,), rad/s."""
        return np.asarray(self.coefficient * (1j * omega[:, None]) ** self.power)


Key = tuple[str, str]  # section and quantity


class Sizes(NamedTuple):
    """Numbers of coordinates, contacts, signals and cubic springs, which give the columns of the rows of channels.

    The parts of a row, by name: ``displacement``, ``velocity`` and ``acceleration`` for a unit of each coordinate;
    ``contact`` for the force of each contact, N; ``opening`` for the distance of each contact to its face as it is now,
    m, 0 while it touches; ``load`` for each signal of the forcing; ``base_acceleration`` and ``base_displacement``, for
    m/s^2 and m of the base; ``constant``; ``cubic`` for the pull of each cubic spring, N, beside what that does to the
    acceleration.
    """

    coordinates: int  # n
    contacts: int  # m
    signals: int  # L
    cubic: int  # c

    @property
    def parts(self) -> dict[str, slice]:
        """Columns of each part."""
        n, m, signals, cubic = self
        sizes = {
            "displacement": n, "velocity": n, "acceleration": n, "contact": m, "opening": m, "load": signals,
            "base_acceleration": 1, "base_displacement": 1, "constant": 1, "cubic": cubic,
        }  # fmt: skip
        ends = np.cumsum([0, *sizes.values()]).tolist()
        return {name: slice(first, last) for name, first, last in zip(sizes, ends, ends[1:], strict=False)}

    def rows(self, count: int, **given: Floats | float) -> Floats:
        """Rows of channels of which some parts are given, the others being zero.

        Parameters
        ----------
        count : k.
        given : by name of the part, arrays (k, width of the part) or what broadcasts to it; (k,) of a part of one
            column.

        Returns
        -------
        (k, W) array
        """
        parts = self.parts
        rows = np.zeros((count, parts["cubic"].stop))
        for name, values in given.items():
            part = rows[:, parts[name]]
            part[:] = np.reshape(values, (-1, 1)) if part.shape[1] == 1 else values
        return rows

    def part(self, rows: Floats, name: str) -> Floats:
        """(k, width) one part of rows (k, W), a view."""
        return rows[:, self.parts[name]]


@dataclass
class Channel:
    """One observable: of which item of which section of the scenario, what it is, in which unit.

    The value is that of its row; of an energy, half the sum of the squares of several; along a body there are many.
    """

    section: str
    name: str
    quantity: str
    unit: str
    rows: Floats  # (k, W), see `Sizes`
    at: str = ""  # for people
    squared: bool = False
    both_ways: bool = False  # a contact force that counts where it pulls as where it pushes: what it met is held
    key: Key = field(init=False)  # section and quantity, which channels that are alike have in common
    columns: int = field(init=False)  # number of its values at one time

    def __post_init__(self) -> None:
        self.key = self.section, self.quantity
        self.columns = 1 if self.squared else self.rows.shape[0]


class Places(dict[Key, Ints]):
    """Columns by section and quantity; none of what there is not."""

    def __missing__(self, key: Key) -> Ints:
        return np.zeros(0, dtype=np.int64)


@dataclass(eq=False)
class ChannelSet:
    """Some channels of a system, which are evaluated together; C columns of values."""

    channels: tuple[Channel, ...]
    sizes: Sizes
    linear: Floats = field(init=False)  # rows of the linear channels, of which each is a value
    squared: Floats = field(init=False)  # rows of the energies
    squares: Ints = field(init=False)  # first of the rows of each energy
    order: Ints = field(init=False)  # (C,) numbers of the columns among those of linear channels, then of energies
    located: list[tuple[Channel, int]] = field(init=False)  # each channel with its first column
    places: Places = field(init=False)  # columns of the values by section and quantity

    def __post_init__(self) -> None:
        none, energies = self.sizes.rows(0), [channel for channel in self.channels if channel.squared]
        self.linear = np.concatenate([none, *(channel.rows for channel in self.channels if not channel.squared)])
        self.squared = np.concatenate([none, *(channel.rows for channel in energies)])
        self.squares = np.cumsum([0, *(channel.rows.shape[0] for channel in energies)])[:-1]
        ends = np.cumsum([0, *(channel.columns for channel in self.channels)])
        self.located = list(zip(self.channels, ends.tolist(), strict=False))
        places: dict[Key, list[int]] = {}
        squared = np.zeros(ends[-1], dtype=bool)
        for channel, first in self.located:
            squared[first : first + channel.columns] = channel.squared
            places.setdefault(channel.key, []).extend(range(first, first + channel.columns))
        self.order = np.argsort(np.argsort(squared, kind="stable"), kind="stable")
        self.places = Places({key: np.array(columns, dtype=np.int64) for key, columns in places.items()})

    def only(self, wanted: Callable[[Channel], bool]) -> ChannelSet:
        """Those that are wanted."""
        return ChannelSet(tuple(filter(wanted, self.channels)), self.sizes)

    def of_keys(self, *keys: Key) -> ChannelSet:
        """Those of some sections and quantities, key after key."""
        return ChannelSet(tuple(c for key in keys for c in self.channels if c.key == key), self.sizes)

    def without(self, *keys: Key) -> ChannelSet:
        """All but those of some sections and quantities."""
        return self.only(lambda channel: channel.key not in keys)

    def values(self, of_rows: Callable[[bool], Floats]) -> Floats:
        """(nt, C) values from those of the rows (nt, k): of the linear channels, or (True) of the energies."""
        values = of_rows(False)
        if self.squares.size:
            energies = np.add.reduceat(0.5 * of_rows(True) ** 2, self.squares, axis=1)
            values = np.hstack([values, energies])
        return np.asarray(values[:, self.order])

    def split(self, values: Floats) -> dict[Key, Floats]:
        """Values (..., C) by section and quantity."""
        return {key: values[..., columns] for key, columns in self.places.items()}
