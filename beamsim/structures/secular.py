r"""A structure with a spring at one point: frequencies from the stiffness, and stiffness from a frequency.

With the structure's modes (natural angular frequencies :math:`\omega_i`, mass-normalised deflections
:math:`\varphi_i` at the point) a grounded spring of stiffness k changes the eigenvalues to the roots of

.. math:: \frac{1}{k} = g(\lambda) = \sum_i \frac{\varphi_i^2}{\lambda - \omega_i^2} = -H(\sqrt\lambda),

where H is the receptance at the point. Between two poles g decreases from :math:`+\infty` to :math:`-\infty`, so that
there is one root between neighbouring natural frequencies (interlacing). It does not decrease with k; its upper limit
at g = 0 is the frequency with the point pinned. Solved for k, the equation gives the stiffness for a frequency in
closed form (H. Hazim, thesis, 2010, proposition 1.3.1, corrected: :math:`d\lambda/dk = u_r^2` with the mass-normalised
deflection :math:`u_r` at the spring).

Differences :math:`\lambda - \omega_i^2` are computed as products :math:`(\omega - \omega_i)(\omega + \omega_i)`, so
accuracy is limited only by the conditioning.

Derivatives of the stiffness for a given frequency with respect to any number of the structure follow from a stationary
form. At a fixed frequency :math:`k = -1 / (s^T D^{-1} s)` with the dynamic stiffness :math:`D = K - \omega^2 M` and the
deflection row s of the spring's point. Let :math:`v = k D^{-1} s` be the mode of the closed structure, with separate
fields for the bodies, springs between them in D, and rigid joints as constraints :math:`G v = 0` with forces
:math:`\mu`. The form

.. math:: F = 2 k\, s^T v - v^T D v - 2 \mu^T G v

is stationary in v and :math:`\mu`, so that :math:`\partial k / \partial p = \partial F / \partial p` with fixed v and
:math:`\mu`: one linear solve for all parameters. The derivatives are central differences on an unchanged mesh; since
the fields are fixed, they are accurate to about nine digits.

A spring between two otherwise uncoupled substructures has :math:`1/k = 1/k_1 + 1/k_2`, where :math:`k_i` would give
substructure i alone the frequency.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse.linalg import spsolve

from beamsim.scenario import Scenario
from beamsim.scenario.base import Path, walk
from beamsim.scenario.parameters import replace_values, side_at, value_at
from beamsim.scenario.quantities import Share
from beamsim.structures.assembly import assemble, combine_structures, couplings_of, snubber_site
from beamsim.structures.places import Site
from beamsim.structures.structure import BodyStructure, Structure
from beamsim.typing import Floats

_EPS = float(np.finfo(float).eps)
POLE_ROUND_OFF = 1e-13  # relative distance of natural frequencies that count as one pole
NEGLIGIBLE_WEIGHT = 1e-26  # weight relative to the largest, below which a mode has a node at the spring
NODE_MOTION = 1e-8  # relative to the largest motion of a mode; finite elements locate nodes to 1e-12


class SpringPoint:
    """Frequencies of a structure and deflections of its modes at the point where a spring acts.

    Parameters
    ----------
    omega : (n,) natural angular frequencies without the spring, rad/s, in any order; zeros are rigid-body modes.
    shape : (n,) mass-normalised deflections at the point, 1/sqrt(kg).
    """

    def __init__(self, omega: ArrayLike, shape: ArrayLike) -> None:
        order = np.argsort(omega, kind="stable")
        self.omega: Floats = np.asarray(omega, dtype=float)[order]
        self.shape: Floats = np.asarray(shape, dtype=float)[order]
        weight = self.shape**2
        # a mode with a node there does not load the spring
        loaded = weight > NEGLIGIBLE_WEIGHT * weight.max(initial=0.0)
        frequency = self.omega[loaded]
        first = np.diff(frequency, prepend=-np.inf) > POLE_ROUND_OFF * frequency  # the first of the modes at one pole
        poles, of_pole = frequency[first], np.cumsum(first) - 1
        # poles of g, their weights, and the natural frequencies that no spring changes (repeated, or with a node)
        unchanged = np.concatenate([self.omega[~loaded], poles[of_pole[~first]]])
        self._poles = poles, np.bincount(of_pole, weight[loaded]), unchanged

    def mode_number(self, omega: float) -> int:
        """Number, from 1, of the mode that a spring can raise to omega: the number of free modes at or below omega.

        It is unique because of interlacing: mode j stays between the free frequencies j and j + 1.
        """
        return int(np.searchsorted(self.omega, omega, side="right"))

    def stiffness(self, omega: ArrayLike) -> Floats:
        """Spring stiffness, N/m, that makes each omega a natural frequency; negative if no positive stiffness does.

        Exact (closed form 1 / g) for the given modes; 0 at a free frequency, infinite at a pinned one.
        """
        poles, weights, _ = self._poles
        omega = np.asarray(omega, dtype=float)
        difference = (omega[..., None] - poles) * (omega[..., None] + poles)
        at_pole = difference == 0
        g = np.sum(weights / np.where(at_pole, 1.0, difference), axis=-1)
        with np.errstate(divide="ignore"):
            return np.where(at_pole.any(axis=-1), 0.0, 1.0 / g)

    def frequencies(self, stiffness: ArrayLike, count: int | None = None) -> Floats:
        """(..., count) natural angular frequencies, ascending, with a spring of each given stiffness (any shape).

        Every root is bracketed by neighbouring poles and found to machine precision.
        """
        shape, k = np.shape(stiffness), np.asarray(stiffness, dtype=float).ravel()
        count = self.omega.size if count is None else min(count, self.omega.size)
        poles, _, fixed = self._poles
        with np.errstate(divide="ignore"):
            level = np.where(k > 0, 1.0 / k, np.inf)
        roots = [self._roots(j, level) for j in range(min(count, poles.size))]
        unchanged = [np.full(k.shape, omega) for omega in fixed]
        return np.sort(np.stack([*roots, *unchanged], axis=-1), axis=-1)[:, :count].reshape(*shape, count)

    def reach(self, mode: int) -> tuple[float, float]:
        """Lowest and highest angular frequency that mode number `mode` (from 1) can have with a spring.

        The highest is that with the point pinned; infinite for a mode that pinning removes.
        """
        return float(self.omega[mode - 1]), float(self.frequencies(np.inf, mode)[mode - 1])

    def on_node(self, mode: int) -> bool:
        """Whether the point is a node of free mode number `mode`, so that a spring does not change this mode."""
        return bool(abs(self.shape[mode - 1]) <= NODE_MOTION * np.abs(self.shape).max(initial=0.0))

    def slope(self, omega: ArrayLike) -> Floats:
        """d omega / dk, rad/s per N/m, of the mode that the spring raises to omega (> 0): u_r^2 / (2 omega).

        The squared mass-normalised deflection u_r^2 at the spring, d lambda / dk, is continuous down to the free modes
        (k = 0). It is 0 at the frequency of a mode with a node at the point: a mode that the spring raises to there, in
        ascending order, stays there.
        """
        poles, weights, fixed = self._poles
        omega = np.asarray(omega, dtype=float)
        difference = (omega[..., None] - poles) * (omega[..., None] + poles)
        nearest = np.min(np.abs(difference), axis=-1, keepdims=True)
        # g^2 / g'^2 with both sums scaled by the distance to the nearest pole: 0 / 0 only at the pole itself
        scaled = np.where(difference == 0, 1.0, nearest / np.where(difference == 0, 1.0, difference))
        scaled = np.where(nearest == 0, (difference == 0).astype(float), scaled)
        participation = np.sum(weights * scaled, axis=-1) ** 2 / np.sum(weights * scaled**2, axis=-1)
        participation = np.where(np.isin(omega, np.setdiff1d(fixed, poles)), 0.0, participation)
        return np.asarray(participation / (2 * omega))

    def _roots(self, j: int, level: Floats) -> Floats:
        """Angular frequencies where g = level (s,) between poles j and j + 1, or above the last pole."""
        from scipy.optimize.elementwise import find_root

        poles, weights, _ = self._poles
        lower, last = poles[j], j + 1 == poles.size
        rest, others = np.delete(poles, [j] if last else [j, j + 1]), np.delete(weights, [j] if last else [j, j + 1])
        with np.errstate(divide="ignore"):
            reach = np.sqrt(lower**2 + weights.sum() / level * (1 + 4 * _EPS))  # no root is further above the last pole
        upper = reach if last else np.full(level.shape, poles[j + 1])
        known = np.isfinite(level) & np.isfinite(upper)

        def value(omega: Floats, level: Floats) -> Floats:
            """(level - g) times the distances to the poles in lambda: negative at the lower end, then positive."""
            below = (omega - lower) * (omega + lower)
            g = np.sum(others / ((omega[..., None] - rest) * (omega[..., None] + rest)), axis=-1)
            least = (level - g) * below - weights[j]
            if last:
                return np.asarray(least)
            return np.asarray(least * (poles[j + 1] - omega) * (poles[j + 1] + omega) + weights[j + 1] * below)

        bracket = (np.full(level.shape, lower), np.where(known, upper, lower + 1.0))
        found = find_root(value, bracket, args=(np.where(known, level, 0.0),))
        root = np.where(found.success, found.x, upper)
        return np.asarray(np.where(np.isinf(level), lower, np.where(known, root, np.inf)), dtype=float)


_STEP = 1e-5  # relative, of central differences


def stiffness_sensitivities(scenario: Scenario, snubber: str, omega: float) -> dict[Path, float]:
    """d ln k / d ln p for each number p, where k is the snubber stiffness that makes omega a natural frequency.

    The numbers are those of the bodies at the snubber, and of their joints. Items at the end or edge of a body move
    with it when its size changes; the segments of a beam scale with its length.

    Parameters
    ----------
    scenario : a validated scenario.
    snubber : name of the snubber.
    omega : angular frequency, rad/s.

    Returns
    -------
    dict
        By path; numbers without influence on k are omitted.
    """
    contact = scenario.located_snubber(snubber)
    structure = assemble(scenario, contact.bodies)
    site = snubber_site(contact)
    parts = [each.structure for each in structure.substructures] or [structure]
    loaded = [_LoadedSubstructure.of(part, site, omega) for part in parts if part.own_row(site).any()]
    total = sum(1 / part.stiffness for part in loaded)
    rates: dict[Path, float] = {}
    for path, along in _parameters(scenario, snubber, [member.body for member in structure.members]):
        scaled = (
            replace_values(scenario, {at: value_at(scenario, at) * (1 + step) for at in along})
            for step in (_STEP, -_STEP)
        )
        up, down = (sum(part.form(each, snubber, omega) / part.stiffness**2 for part in loaded) for each in scaled)
        if up != down:
            rates[path] = (up - down) / (2 * _STEP * total)
    return rates


@dataclass(frozen=True)
class _LoadedSubstructure:
    """A substructure at the spring, with its motion at the frequency."""

    bodies: Structure  # the separate bodies
    stiffness: float  # N/m, spring stiffness that gives this substructure alone the frequency
    field: Floats  # (dofs of the bodies,) v
    forces: Floats  # forces of the constraints among the couplings, in order

    @classmethod
    def of(cls, part: Structure, site: Site, omega: float) -> _LoadedSubstructure:
        """Compute the motion of a substructure."""
        row, squared = part.own_row(site), (omega / part.frequency_scale) ** 2
        mode = np.asarray(spsolve((part.factor.T @ part.factor - squared * part.mass).tocsc(), row))
        scaled = -1.0 / float(row @ mode)
        stiffness, bodies = scaled * part.stiffness_scale, combine_structures([m.body for m in part.members])
        field = np.concatenate([member.expansion @ (scaled * mode) for member in part.members])
        left = stiffness * bodies.own_row(site) + omega**2 * bodies.mass_scale * (bodies.mass @ field)
        left -= bodies.stiffness_scale * (bodies.factor.T @ (bodies.factor @ field))
        for spring in part.couplings:
            if spring.stiffness:
                pull = bodies.own_row(spring.site)
                left -= spring.stiffness * (pull @ field) * pull
        held = [bodies.own_row(each.site) for each in part.couplings if each.stiffness is None]
        forces = np.linalg.lstsq(np.array(held).reshape(-1, field.size).T, left, rcond=None)[0]
        return cls(bodies, stiffness, field, np.asarray(forces, dtype=float))

    def form(self, scenario: Scenario, snubber: str, omega: float) -> float:
        """The form F, N/m, of the motion, with the numbers of another scenario."""
        sections, v = scenario.all_bodies, self.field
        before = [member.body for member in self.bodies.members]
        bodies = combine_structures(
            [each if each.section is None else each.reassemble(sections[each.name]) for each in before]
        )
        bent = bodies.factor @ v
        total = 2 * self.stiffness * float(bodies.own_row(snubber_site(scenario.located_snubber(snubber))) @ v)
        total += omega**2 * bodies.mass_scale * float(v @ (bodies.mass @ v))
        total -= bodies.stiffness_scale * float(bent @ bent)
        forces, names = iter(self.forces), {each.name for each in before}
        for coupling in couplings_of(scenario):
            if coupling.ends[0].body in names:
                extension = float(bodies.own_row(coupling.site) @ v)
                held = coupling.stiffness is None
                total -= 2 * next(forces) * extension if held else (coupling.stiffness or 0.0) * extension**2
        return total


def _parameters(scenario: Scenario, snubber: str, bodies: list[BodyStructure]) -> Iterator[tuple[Path, set[Path]]]:
    """Yield every number that k may depend on, with the numbers that change with it."""
    contact = scenario.located_snubber(snubber)
    sides = {body.name: body.sides for body in bodies}
    for body in bodies:
        if body.section is None:
            continue
        base = scenario.body_path(body.name)
        described = scenario.all_bodies[body.name]
        for path in _numbers(described):
            if set(path[2:]) & set(described.keys_of_shape):
                continue
            along = {(*base, *path)}
            if len(path) == 1 and path[0] in body.sides:  # items at the end or edge move with it
                side, edge = (body.name, body.sides.index(str(path[0]))), value_at(scenario, (*base, *path))
                along |= {
                    at for at in _numbers(scenario) if side_at(scenario, at) == side and value_at(scenario, at) == edge
                }
                segments = getattr(described, "segments", ())
                along |= {(*base, "segments", i, key) for i, _ in enumerate(segments) for key in ("from", "to")}
            yield (*base, *path), along
    for place, path in zip(contact.item.places, contact.item.place_paths, strict=True):
        for axis in range(len(sides[place.body or contact.body])):
            number = (*contact.path, *path, "position", *((axis,) if isinstance(place.position, tuple) else ()))
            yield number, {number}
    for section in ("joints", "springs_to_ground", "springs_between"):
        for index, item in enumerate(getattr(scenario, section)):
            for key in ("stiffness", "rotational_stiffness"):
                if (
                    getattr(item, "kind", "") not in ("cubic", "piecewise_linear", "shock_arrestor")
                    and getattr(item, key, 0.0) > 0.0
                ):
                    yield (section, index, key), {(section, index, key)}


def _numbers(section: Any) -> Iterator[Path]:
    """Yield the paths of the nonzero numbers in a section, except segment ends."""
    for path, part in walk(section):
        for key, name in type(part).keys().items():
            value: Any = getattr(part, name)
            items = {(*path, key, i): item for i, item in enumerate(value)} if isinstance(value, tuple) else {}
            for place, number in (items or {(*path, key): value}).items():
                bound = "segments" in place and place[-1] in ("from", "to")
                if isinstance(number, (float, Share)) and number not in (0.0, Share(0.0)) and not bound:
                    yield place
