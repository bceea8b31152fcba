"""Rings of a system: which contacts are their sides, and what is observed of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from beamsim.contacts.rings import RingErrors, ring_table
from beamsim.contacts.snubbers import SpringInfo
from beamsim.scenario.rings import AXIAL, RING, TANGENT, RingStop
from beamsim.system.equations import Channel, ChannelSet, Sizes
from beamsim.system.reduced_model import ReducedModel
from beamsim.typing import Floats, Ints

POSITION, FORCE, RADIAL_FORCE, PENETRATION = "position", "force", "radial_force", "penetration"
FRICTION_FORCE = "friction_force"


@dataclass(frozen=True)
class RingInfo:
    """A ring of a system."""

    ring: RingStop
    places: tuple[str, ...]  # both, for people
    sides: Ints  # (N,) its contacts
    shapes: Floats  # (N, n) motion along the normals for a unit of each coordinate, 1/sqrt(kg)
    base_influence: Floats  # (N, K) of each displacement of the base on these
    tangents: Ints  # (N,) contacts of the friction along the wall; (0,) without friction
    axials: Ints  # (N,) contacts of the friction along the axis; (0,) without

    @property
    def name(self) -> str:
        """Name of the ring."""
        return self.ring.name

    @cached_property
    def normals(self) -> Floats:
        """(N, 2) unit normals of the sides."""
        angle = 2.0 * np.pi * np.arange(self.sides.size) / self.sides.size
        return np.column_stack([np.cos(angle), np.sin(angle)])

    def penetrations(self, first: Floats, second: Floats) -> Floats:
        """(nt,) distances beyond the clearance of positions relative to the centre, m; 0 inside of it."""
        a, b = self.ring.semi_axes
        if a == b:
            return np.asarray(np.maximum(np.hypot(first, second) - a, 0.0))
        beyond = np.column_stack([first, second]) @ self.normals.T - self.support
        return np.asarray(np.maximum(beyond.max(axis=1), 0.0))

    @property
    def support(self) -> Floats:
        """(N,) distance of each side from the centre, m."""
        (a, b), (c, s) = self.ring.semi_axes, self.normals.T
        return np.asarray(np.hypot(a * c, b * s))

    @property
    def errors(self) -> RingErrors:
        """Error bounds, of an ellipse those where it is flattest."""
        a, b = self.ring.semi_axes
        flattest = max(a, b) ** 2 / min(a, b)
        return ring_table(self.sides.size, self.ring.largest_penetration / flattest).errors

    def channels(self, sizes: Sizes, model: ReducedModel) -> list[Channel]:
        """Position relative to the centre and force along both directions; force and penetration in many directions.

        The last two have a value for each direction, of which the largest is that of the ring: at most
        ``1 - cos(pi / N)`` of the force below it, and a quarter of that of the distance from the centre.
        """
        both, half = [0, self.sides.size // 4], self.sides.size // 2
        pushes = np.zeros((2, sizes.contacts))
        pushes[:, self.sides] = -self.normals.T
        by_base = model.of_base("displacement", self.base_influence, sizes.signals)
        position = {"displacement": self.shapes[both], "load": by_base[both], "constant": -np.array(self.ring.offset)}
        between = {"displacement": _with_middles(self.shapes), "load": _with_middles(by_base)}
        angle = np.pi * np.arange(2 * self.sides.size) / self.sides.size
        (a, b), (x, y) = self.ring.semi_axes, self.ring.offset
        c, s = np.cos(angle), np.sin(angle)
        between["constant"] = -(np.hypot(a * c, b * s) + c * x + s * y)
        rubs = np.zeros((2, sizes.contacts))
        if self.tangents.size:
            rubs[:, self.tangents] = -np.array([-self.normals[:, 1], self.normals[:, 0]])
        friction = Channel("rings", self.name, FRICTION_FORCE, "N", sizes.rows(2, contact=rubs))
        return [
            *([friction] if self.tangents.size else []),
            Channel("rings", self.name, POSITION, "m", sizes.rows(2, **position)),
            Channel("rings", self.name, FORCE, "N", sizes.rows(2, contact=pushes)),
            Channel("rings", self.name, RADIAL_FORCE, "N", sizes.rows(half, contact=self.normals[:half] @ pushes)),
            Channel("rings", self.name, PENETRATION, "m", sizes.rows(angle.size, **between)),
        ]


def _with_middles(rows: Floats) -> Floats:
    """Rows (2 N, ...) in the directions of N sides and of the middles between them, from rows (N, ...)."""
    middles = (rows + np.roll(rows, -1, axis=0)) / (2.0 * np.cos(np.pi / rows.shape[0]))
    return np.stack([rows, middles], axis=1).reshape(2 * rows.shape[0], *rows.shape[1:])


def ring_columns(rings: Sequence[RingInfo], channels: ChannelSet, high: Floats, low: Floats) -> dict[str, Any]:
    """Largest force and penetration of each ring, as variables of sweeps and branches.

    Parameters
    ----------
    rings : the rings of the system.
    channels : C columns, with those of the rings.
    high, low : (points, C) largest and smallest values.
    """
    force, penetration = [], []
    columns = {(each.quantity, each.name): slice(k, k + each.columns) for each, k in channels.first_columns}
    for ring in rings:
        of_force = columns[RADIAL_FORCE, ring.name]
        force.append(np.maximum(np.abs(high[:, of_force]), np.abs(low[:, of_force])).max(axis=1))
        penetration.append(np.maximum(high[:, columns[PENETRATION, ring.name]].max(axis=1), 0.0))
    names = [ring.name for ring in rings]
    return {"ring": names, "peak_radial_force": np.array(force), "ring_penetration": np.array(penetration)}


def rings_of(springs: Sequence[SpringInfo], first: int) -> tuple[RingInfo, ...]:
    """The rings among springs with laws, whose contacts begin at an index.

    Parameters
    ----------
    springs : springs, friction contacts and sides of rings, in the order of their contacts.
    first : index of the contact of the first of them.
    """
    parts: dict[str, dict[str, list[tuple[int, SpringInfo]]]] = {}
    for contact, spring in enumerate((each for each in springs if each.law is not None), start=first):
        if spring.part is not None:
            parts.setdefault(spring.name, {}).setdefault(spring.part.kind, []).append((contact, spring))

    def contacts(by_kind: dict[str, list[tuple[int, SpringInfo]]], kind: str) -> Ints:
        """Contacts of one kind, of which there may be none."""
        return np.array([contact for contact, _ in by_kind.get(kind, ())], dtype=np.int64)

    rings = []
    for of in parts.values():
        sides = [spring for _, spring in of[RING]]
        assert sides[0].part is not None
        rings.append(
            RingInfo(
                sides[0].part.ring, sides[0].places, contacts(of, RING), np.array([side.shape for side in sides]),
                np.array([side.base_influence for side in sides]), contacts(of, TANGENT), contacts(of, AXIAL),
            )
        )  # fmt: skip
    return tuple(rings)
