"""Channels of the outputs that a scenario requests."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.errors import ScenarioError
from beamsim.scenario.base import Path, problem
from beamsim.scenario.excitation import point_of
from beamsim.structures.assembly import load_site_in, site_in, snubber_site
from beamsim.structures.places import DEFLECTION, ROTATIONS, SLOPE, UPWARDS, Link, LoadSite, Place, Recovery, Site
from beamsim.structures.support_forces import Support, supports_of
from beamsim.system.equations import Channel, Forcing, Sizes
from beamsim.system.reduced_model import (
    ReducedModel,
    check_determined,
    gravity_loads,
    output_direction,
    supports_named,
)
from beamsim.typing import Floats


def output_channels(
    model: ReducedModel,
    recoveries: Sequence[Recovery],
    contact_sites: Sequence[Site],
    contacts: Contacts,
    forcing: Forcing,
) -> tuple[Channel, ...]:
    """The outputs that a scenario requests.

    Parameters
    ----------
    model : reduced model of the scenario.
    recoveries : recovered quantities of the bodies, with stations at `output_sites`.
    contact_sites : (m,) places of the contacts.
    contacts, forcing : contacts and loads of the system.

    Returns
    -------
    One channel for every output, in the order of the scenario.

    Raises
    ------
    ScenarioError
        If an output does not exist for its place or joint.
    """
    asked = _OutputContext(model, recoveries, contact_sites, contacts, forcing)
    return tuple(asked.channel(path, output) for path, output in model.scenario.requested_outputs)


def reaction_channels(
    model: ReducedModel, contact_sites: Sequence[Site], contacts: Contacts, forcing: Forcing
) -> list[tuple[Channel, bool]]:
    """The forces and moments of all supports on a structure.

    Joints between bodies are left out.

    Parameters
    ----------
    model : reduced model of the scenario.
    contact_sites : (m,) places of the contacts.
    contacts, forcing : contacts and loads of the system.

    Returns
    -------
    Each with whether it is determined; their names are those of body, support and direction where these differ.
    """
    asked, several = _OutputContext(model, (), contact_sites, contacts, forcing), len(model.structure.members) > 1
    channels = []
    for support in (each for each in asked.supports if not isinstance(each.site, Link)):
        turns = support.direction in (SLOPE, *ROTATIONS)
        words = [support.body] if several else []
        words += [support.name, *([] if support.direction in (SLOPE, DEFLECTION) else [support.direction])]
        rows = asked.sizes.rows(1, **asked.blocks_of([(1.0, support)]))
        name = " ".join(filter(None, words))
        channels.append((Channel("supports", name, "reaction", "N m" if turns else "N", rows), support.determined))
    return channels


def output_sites(model: ReducedModel) -> list[Site]:
    """Places at which moments are requested."""
    return [site_in(model.scenario, each) for _, each in model.scenario.requested_outputs if each.kind in _BENDING]


_BY_ORDER = ("displacement", "velocity", "acceleration")  # by order of the time derivative
_BENDING = ("bending_moment", "stress", "strain")


ROUND_OFF = 1e-14  # relative to the largest eigenvalue of an energy; smaller ones are omitted


@dataclass(frozen=True)
class _OutputContext:
    """Data that all outputs of a scenario need."""

    model: ReducedModel
    recoveries: Sequence[Recovery]
    contact_sites: Sequence[Site]
    contacts: Contacts
    forcing: Forcing

    @cached_property
    def supports(self) -> tuple[Support, ...]:
        """All supports of the structure."""
        return supports_of(self.model.structure)

    @cached_property
    def force_sites(self) -> list[LoadSite]:
        """Places of the excitation's forces, in the order of the signals; without base motions."""
        return [load_site_in(self.model.scenario, force.applied_to) for _, force in self.model.acting_loads.forces]

    @cached_property
    def cubic_sites(self) -> list[Site]:
        """Places of the cubic springs."""
        return [snubber_site(s) for s in self.model.scenario.nonlinear_springs if s.item.kind == "cubic"]

    @cached_property
    def sizes(self) -> Sizes:
        """Of what channels are made of."""
        return Sizes(
            self.model.basis.size, len(self.contact_sites), len(self.forcing.signal), len(self.cubic_sites)
        )  # fmt: skip

    def channel(self, path: Path, output: Any) -> Channel:
        """The channel of one output."""
        kind = output.kind
        if kind.startswith("reaction"):
            return self._reaction(path, output)
        if kind.startswith("joint"):
            return self._of_joint(path, output)
        if kind.endswith("energy"):
            return self._energy(output)
        if kind == "recovered":
            return self._recovered_channel(output)
        place = site_in(self.model.scenario, output)
        assert isinstance(place, Place)
        if kind in _BENDING:
            return self._bending(output, place)
        if kind == "rotation":
            place = replace(place, direction=SLOPE)
        shape: Any = self.model.shapes([place])
        quantity = "displacement" if kind == "rotation" else kind
        load = np.zeros((1, len(self.forcing.signal)))
        if kind == "acceleration":
            load += self._by_base([self.model.structure.base_motion_at(place, motion) for motion in self.model.base])
        for each in self.model.moving_supports:  # added to the motion of the free dofs
            load[0, self.model.acting_loads.signals[each.path, quantity]] = each.support.direct(place)
        return self._channel(output, place.label, load=load, **{quantity: shape})

    def _by_base(self, factors: Sequence[float] | Floats) -> Floats:
        """(1, L) coefficients of the load signals: factors (K,) of the accelerations of the base."""
        return self.model.of_base(
            "acceleration", np.asarray(factors, dtype=float).reshape(1, -1), len(self.forcing.signal)
        )

    def _channel(
        self, output: Any, place_text: str, count: int = 1, *, squared: bool = False, **blocks: Any
    ) -> Channel:
        rows, unit = self.sizes.rows(count, **blocks), self.model.scenario.output_unit(output)
        return Channel("outputs", output.name, output.kind, unit, rows, place_text, squared)

    def _recovered_channel(self, output: Any) -> Channel:
        name = output.body or self.model.scenario.default_body
        structure, names = self.model.structure, self.model.scenario.all_bodies[name].recovered_rows
        member = structure.member(name)
        row = member.body.recovery_row(names.index(output.row), _BY_ORDER.index(output.motion))
        on_dofs = (row @ member.body.all_dofs_map) @ member.expansion
        shape = on_dofs @ self.model.basis.vectors / np.sqrt(structure.mass_scale)
        load = np.zeros((1, len(self.forcing.signal)))
        if output.motion == "acceleration":
            load += self._by_base([float(row @ member.body.rigid_motion(motion)) for motion in self.model.base])
        for each in self.model.moving_supports:
            field = each.support.motion.fields.get(name)
            if field is not None:
                load[0, self.model.acting_loads.signals[each.path, output.motion]] = row @ field
        return self._channel(output, name, load=load, **{output.motion: shape[None]})

    def _bending(self, output: Any, place: Place) -> Channel:
        recovery = next(each for each in self.recoveries if each.body == place.body or len(self.recoveries) == 1)
        at = place.coordinate, place.position_y, output.component or "x"
        weights = recovery.strain_weights(*at) if output.kind == "strain" else recovery.moment_weights(*at)
        if output.kind == "stress":
            assert recovery.stress_per_moment is not None  # the scenario ensures this
            weights = weights * recovery.stress_per_moment
        if output.kind != "bending_moment" and output.surface != "bottom":
            weights = -weights
        assert recovery.bending_moment is not None
        assert recovery.base_moment is not None
        return self._channel(
            output, place.label, displacement=(weights @ recovery.bending_moment)[None],
            load=self._by_base(np.atleast_1d(weights @ recovery.base_moment)[: len(self.model.base)]),
        )  # fmt: skip

    def _reaction(self, path: Path, output: Any) -> Channel:
        moment = output.kind == "reaction_moment"
        if output.support == "base":
            return self._of_base(output)
        body = output.body or self.model.scenario.default_body
        held = supports_named(self.supports, body, output.support, (*path, "support"))
        direction = output.direction or ("ry" if moment else DEFLECTION)
        directions = (direction, SLOPE) if moment and output.direction is None else (direction,)
        fits = [each for each in held if each.direction in directions]
        if not fits:
            message = f"= {output.kind}: {output.support} exerts no such reaction in {direction}"
            raise ScenarioError(problem((*path, "kind"), message, "request a direction in which it restrains the body"))
        return self._summed(output, f"{body} {output.support}", [(1.0, fits[0])])

    def _of_joint(self, path: Path, output: Any) -> Channel:
        joined = [each for each in self.supports if each.site is not None and each.name == output.joint]
        direction = SLOPE if output.kind == "joint_moment" else DEFLECTION
        fits = [each for each in joined if each.direction == direction]
        if not fits:
            message = f"= {output.joint} transmits no moment"
            raise ScenarioError(problem((*path, "joint"), message, "ask for kind: joint_force"))
        fitting = check_determined(fits[0], (*path, "joint"), ": its force is not determined")
        return self._summed(output, output.joint, [(1.0, fitting)])

    def _of_base(self, output: Any) -> Channel:
        """The channel of the base: supports, joints and contacts on it, by their work along its motion."""
        structure = self.model.structure
        base = output_direction(self.model.scenario, output)
        supports = self.supports if base == UPWARDS else supports_of(structure, base)
        holding = [(each.base_motion, each) for each in supports if each.on_base and each.base_motion]
        about = f"base about {point_of(output.about)[:2]} m" if base.direction in ROTATIONS else "base"
        channel = self._summed(output, about, holding)
        levers = [
            0.0 if ground or not isinstance(site, Place) else structure.base_motion_at(site, base)
            for site, ground in zip(self.contact_sites, self.contacts.on_ground, strict=True)
        ]
        rows = channel.rows.copy()
        rows[:, self.sizes.slices["contact"]] += np.array(levers) * self.contacts.sign
        return replace(channel, rows=rows)

    def _summed(self, output: Any, place_text: str, supports: Sequence[tuple[float, Support]]) -> Channel:
        """A channel for the sum of support forces with factors."""
        blocks: dict[str, Any] = self.blocks_of(supports) if supports else {}
        return self._channel(output, place_text, **blocks)

    def blocks_of(self, supports: Sequence[tuple[float, Support]]) -> dict[str, Floats]:
        """Blocks of the row of a sum of support forces with factors, see `Sizes`."""
        scenario, structure = self.model.scenario, self.model.structure
        vectors = self.model.basis.vectors / np.sqrt(structure.mass_scale)

        def total(term: Callable[[Support], Any]) -> Any:
            return sum((factor * term(force) for factor, force in supports), 0.0)

        def share(site: LoadSite) -> float:
            return float(sum(factor * force.share(site) for factor, force in supports))

        def shares(sites: Sequence[LoadSite]) -> Floats:
            return np.array([share(site) for site in sites]).reshape(len(sites))

        by_base = [total(partial(Support.base_forces, motion=motion)) for motion in self.model.base]
        weight = 0.0
        for direction, gravity in gravity_loads(scenario):
            weight -= gravity * sum(factor * force.base_forces(direction)[0] for factor, force in supports)
        load, acting, number = (
            np.zeros(len(self.forcing.signal)),
            self.model.acting_loads,
            self.model.acting_loads.signals,
        )
        for site, (path, _) in zip(self.force_sites, acting.forces, strict=True):
            load[number[path, "force"]] = -share(site)
        for moved in self.model.moving_supports:
            forces = total(partial(Support.force_per_motion, other=moved.support))
            for quantity, force in zip(("displacement", "acceleration", "velocity"), forces, strict=True):
                load[number[moved.path, quantity]] = force
        for row, quantity in enumerate(("acceleration", "displacement")):
            load += self.model.of_base(quantity, np.array([[of[row] for of in by_base]]), load.size)[0]
        dead = sum(force.force * share(load_site_in(scenario, force)) for force in scenario.constant_forces)
        return {
            "acceleration": np.atleast_2d(total(lambda force: force.acceleration @ vectors)),
            "velocity": np.atleast_2d(total(lambda force: force.velocity @ vectors)),
            "contact": -(shares(self.contact_sites) * self.contacts.sign)[None],
            "load": load[None],
            "constant": np.array([weight - dead]),
            "cubic": shares(self.cubic_sites)[None],
        }

    def _energy(self, output: Any) -> Channel:
        """A channel for an energy: half the sum of squares of rows, including moving supports."""
        member = self.model.structure.member(output.body or self.model.scenario.default_body)
        body, whole, kinetic = member.body, member.structure, output.kind == "kinetic_energy"
        fields = (member.expansion @ self.model.basis.vectors) / np.sqrt(whole.mass_scale)
        moved = [each.support for each in self.model.moving_supports]
        part = 1 if kinetic else 0  # index of the forces of a support: by mass or stiffness
        n = fields.shape[1]
        form = np.zeros((n + len(moved), n + len(moved)))
        if kinetic:
            form[:n, :n] = fields.T @ (body.mass @ fields) * body.mass_scale
        else:
            factored = np.asarray(body.factor @ fields)
            form[:n, :n] = factored.T @ factored * body.stiffness_scale
        for k, one in enumerate(moved):
            if body.name in one.forces:
                form[:n, n + k] = form[n + k, :n] = fields.T @ one.forces[body.name][part]
                form[n + k, n:] = [one.on_body(body.name, other)[part] for other in moved]
        scale = np.ones(n + len(moved))  # moving supports have metres, coordinates sqrt(kg) m
        scale[n:] = np.sqrt(np.diag(form)[n:] / max(np.diag(form)[:n].max(), np.finfo(float).tiny))
        scale[scale == 0.0] = 1.0
        values, vectors = np.linalg.eigh((form + form.T) / (2 * np.outer(scale, scale)))
        kept = values > ROUND_OFF * values[-1]
        rows = np.sqrt(values[kept])[:, None] * vectors[:, kept].T * scale
        quantity = "velocity" if kinetic else "displacement"
        load = np.zeros((rows.shape[0], len(self.forcing.signal)))
        for k, each in enumerate(self.model.moving_supports):
            load[:, self.model.acting_loads.signals[each.path, quantity]] = rows[:, n + k]
        return self._channel(output, body.name, rows.shape[0], squared=True, load=load, **{quantity: rows[:, :n]})
