"""``beamsim static``: static equilibrium under weight and dead loads, and the natural frequencies about it.

It is the equilibrium from which a run starts by default. Dry friction takes no part in holding the structure, except
by the force that the case gives it at the start: where friction sticks, any state within its limits is an equilibrium.
"""

from __future__ import annotations

import time as clock
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import null_space

from beamsim.analyses.statics.result import EQUILIBRIUM, NOTHING_ACTS, StaticResult
from beamsim.contacts.snubbers import FRICTION
from beamsim.flow.compiled import processor_time
from beamsim.outcomes import COMPLETE, first_of
from beamsim.results.result import (
    check_reduction,
    compressed_beyond_tables,
    dashpots_of,
    deflection_warnings,
)
from beamsim.results.values import Extremes, by_hinge_key, margins, parse_limit, place_of_stress, values_of
from beamsim.scenario import Scenario
from beamsim.structures.modes import closed_modes
from beamsim.structures.places import TRANSLATIONS
from beamsim.system.build import build_system, static_shape_of, support_channels
from beamsim.system.equations import ChannelSet
from beamsim.system.reduced_model import SharedBuilds, gravity_loads
from beamsim.system.structural import FORCE_UNITS, RELAXED_FREQUENCY, StructuralSystem, contact_units
from beamsim.typing import Floats

_ROUND_OFF = 1e-9  # of a deflection over the compression of stops
_WAY_ROUND_OFF = 1e-13  # of a displacement over the largest one
_FORCE_ROUND_OFF = 1e-7  # of a force over the largest load or contact force; stiff springs of joints lose digits
_RIGID = 1e-7  # of the highest frequency; with rigid friction, a frequency below it is that of a rigid-body motion
FRICTION_AT_REST = (
    "friction holds nothing at this equilibrium but the force that it is given for the start ({}): while it sticks, "
    "other equilibria within its limit are possible"
)


@dataclass(frozen=True, eq=False)
class _AtRest:
    """A system at static equilibrium."""

    system: StructuralSystem
    q: Floats  # (n,) coordinates
    force: Floats  # (m,) N, of all contacts

    @cached_property
    def penetration(self) -> Floats:
        """(m,) of the contacts, negative where they are open."""
        contacts = self.system.dynamics.contacts
        return np.asarray(-contacts.gap - contacts.sign * (contacts.shape @ self.q))

    @cached_property
    def row_values(self) -> Floats:
        """(W,) values of the blocks of channel rows: coordinates, forces, openings; nothing moves."""
        cubic, sizes = self.system.cubic, self.system.channels.sizes
        values = np.zeros(sizes.slices["cubic"].stop)
        values[sizes.slices["displacement"]], values[sizes.slices["contact"]] = self.q, self.force
        values[sizes.slices["opening"]] = np.where(self.force > 0.0, 0.0, np.maximum(-self.penetration, 0.0))
        values[sizes.slices["constant"]] = 1.0
        if cubic is not None:
            values[sizes.slices["cubic"]] = cubic.stiffness * cubic.extension(self.q, None) ** 3
        return values

    @cached_property
    def extremes(self) -> Extremes:
        """Extremes of all channels, which do not change."""
        channels = self.system.channels
        return channels.split(self._repeated(channels))

    def _repeated(self, channels: ChannelSet) -> Floats:
        value = channels.values((channels.rows @ self.row_values)[None])[0]
        forces = np.repeat([c.unit in ("N", "N m") for c in channels.channels], [c.columns for c in channels.channels])
        value[forces & (np.abs(value) <= self.negligible_force)] = 0.0
        ways = np.repeat([c.unit == "m" for c in channels.channels], [c.columns for c in channels.channels])
        value[ways & (np.abs(value) <= _WAY_ROUND_OFF * np.abs(value[ways]).max(initial=0.0))] = 0.0
        return np.array([value, 0.0 * value, value, 0.0 * value])

    @cached_property
    def negligible_force(self) -> float:
        """N or N m, below which a force is round-off."""
        scenario = self.system.scenario
        mass = sum(member.body.total_mass for member in self.system.model.structure.members)
        weights = (abs(value) * mass for _, value in gravity_loads(scenario))
        dead = (abs(force.force) for force in scenario.constant_forces)
        return _FORCE_ROUND_OFF * max([*weights, *dead, *np.abs(self.force).tolist()], default=0.0)

    @cached_property
    def reactions(self) -> dict[tuple[str, str], float]:
        """By support and unit its force or moment; NaN where it is not determined."""
        return {
            (channel.name, channel.unit): self._without_round_off(channel.rows[0]) if determined else np.nan
            for channel, determined in support_channels(self.system)
        }

    def _without_round_off(self, row: Floats) -> float:
        """A force without round-off."""
        force = float(row @ self.row_values)
        return force if abs(force) > self.negligible_force else 0.0

    def frequencies_hz(self, *, stuck: bool) -> Floats:
        """(n,) undamped natural frequencies about the equilibrium with friction stuck or sliding."""
        system = self.system
        contacts, rigid_count = system.dynamics.contacts, system.model.basis.rigid_count
        friction = np.zeros(contacts.count, dtype=bool)
        if contacts.count and system.cubic is None:
            friction[system.friction_contacts] = True
        phases = contacts.start.copy()
        for j in np.flatnonzero(~friction).tolist():
            phases[j] = contacts.laws[j].resting_phase(float(self.penetration[j]))
        phases = contacts.pressed_at_start(phases, contacts.start)
        stiffness = contacts.dynamic_stiffness(phases, np.full(1, RELAXED_FREQUENCY))[0].real.copy()
        fixed = contacts.sticks_rigidly(phases)
        stiffness[fixed] = 0.0
        if not stuck:
            stiffness[friction] = 0.0
            fixed[:] = False
        shape = contacts.shape
        if system.cubic is not None:
            cubic = system.cubic
            stiffness = np.append(stiffness, 3.0 * cubic.stiffness * cubic.extension(self.q, None) ** 2)
            shape = np.vstack([shape, cubic.shape])
        if not fixed.any() and np.all(stiffness >= 0.0):
            omega = closed_modes(np.sqrt(system.dynamics.stiffness), shape, stiffness, rigid_count)[0]
            return np.asarray(omega / (2 * np.pi))
        return _constrained(system.dynamics.stiffness, shape, stiffness, contacts.shape[fixed])


def _constrained(own: Floats, shape: Floats, stiffness: Floats, fixed: Floats) -> Floats:
    """(n,) Hz, natural frequencies with springs of any sign and motions that are held; NaN for those that are held.

    Parameters
    ----------
    own : (n,) stiffness of the coordinates.
    shape, stiffness : (m, n) and (m,) of springs.
    fixed : (h, n) deflections that are zero.
    """
    unit = np.linalg.norm(fixed, axis=1, keepdims=True)
    free = null_space(fixed / np.where(unit > 0.0, unit, 1.0)) if fixed.size else np.eye(own.size)
    held = free.T @ (own[:, None] * free) + (free.T @ (shape.T * stiffness)) @ (shape @ free)
    squared = np.linalg.eigvalsh(held)
    squared[np.abs(squared) <= _RIGID**2 * np.abs(squared).max(initial=0.0)] = 0.0
    found = np.full(own.size, np.nan)
    found[: squared.size] = np.where(squared >= 0.0, np.sqrt(np.abs(squared)), np.nan) / (2 * np.pi)
    return found


def static(scenario: Scenario, builds: SharedBuilds | None = None) -> StaticResult:
    """Find the static equilibrium of a scenario under weight and dead loads.

    Parameters
    ----------
    scenario : any case; its excitation does not act.
    builds : cache of parts built for other cases.

    Returns
    -------
    StaticResult

    Raises
    ------
    ScenarioError
        If there is no static equilibrium, or many.
    """
    begin, used = clock.perf_counter(), processor_time()
    # a start other than from equilibrium does not matter here
    run = None if scenario.run is None else scenario.run.model_copy(update={"start": "rest"})
    system = build_system(scenario.model_copy(update={"run": run}), builds)
    contacts = system.dynamics.contacts
    resting = np.array([law.resting_force for law in contacts.laws])
    q, pressed = static_shape_of(system), np.abs(contacts.gap[contacts.gap < 0.0]).max(initial=0.0)
    if np.abs(system.deflection @ q).max(initial=0.0) <= _ROUND_OFF * pressed:
        q = np.zeros(q.size)  # preloads balance each other
    found = _AtRest(system, q, np.asarray(system.static_forces + resting))
    summary = _summary(found)
    compared = margins(scenario.limits, summary)
    known = {name: item for name, item in compared.items() if parse_limit(name)[0].entry in summary}
    warnings = tuple(dict.fromkeys(_warnings(found, [name for name in compared if name not in known])))
    result = StaticResult(
        scenario=scenario,
        outcome=check_reduction(COMPLETE, scenario, system.modes),
        datasets={"equilibrium": EQUILIBRIUM.dataset(*_columns(found)), "modes": system.modes},
        warnings=warnings,
    ).with_summary(
        **summary, margins=known, dashpots=dashpots_of(system.modes), processor_time_s=processor_time() - used
    )
    # limits are those of motions, whose values are larger: none is too far above
    return replace(result, warnings=warnings, wall_time_s=clock.perf_counter() - begin)


def _summary(found: _AtRest) -> dict[str, Any]:
    """Summary entries that do not repeat a variable of the modes."""
    system, extremes = found.system, found.extremes
    values: dict[str, Any] = {
        "touching": {s.name: bool(f > 0.0) for s, f in zip(system.snubbers, found.force, strict=False)},
        **by_hinge_key("static_force_n", system.snubbers, lambda s: s.preload),
        **by_hinge_key("gap_m", system.snubbers, lambda s: s.gap),
        **values_of(system.channels, extremes),
        "reaction_n": {name: x for (name, unit), x in found.reactions.items() if unit == "N"},
        "reaction_moment_n_m": {name: x for (name, unit), x in found.reactions.items() if unit != "N"},
    }
    if system.outputs:
        values["output_unit"] = {output.name: output.unit for output in system.outputs}
    if system.stress is not None:
        values |= place_of_stress(system.stress, extremes, several=len(system.bodies) > 1)
    return values


def _columns(found: _AtRest) -> tuple[dict[str, Any], dict[str, list[dict[str, str]]]]:
    """Variables of the dataset of a system at rest, and the words of their members."""
    system, extremes = found.system, found.extremes
    snubbers, friction = system.snubbers, [spring for spring in system.springs if spring.kind == FRICTION]
    count, reactions = len(snubbers), found.reactions
    on_plates = any(s.position_y is not None for s in snubbers)
    values = {
        "snubber": [s.name for s in snubbers],
        "side": [s.side for s in snubbers],
        "snubber_position": [s.position for s in snubbers],
        "snubber_position_y": [np.nan if s.position_y is None else s.position_y for s in snubbers]
        if on_plates else None,
        "gap": [s.gap for s in snubbers],
        "touches": found.force[:count] > 0.0,
        "force": found.force[:count],
        "gap_left": found.row_values[system.channels.sizes.slices["opening"]][:count],
        "snubber_displacement": (system.dynamics.contacts.shape @ found.q)[:count],
        "probe": [probe.name for probe in system.probes],
        "displacement": extremes.get(("probes", "displacement"), np.zeros((4, 0)))[0],
        "support": [f"{name} moment" if (name, "N") in reactions and unit != "N" else name for name, unit in reactions],
        "reaction": list(reactions.values()),
        "friction": [spring.name for spring in friction],
        "friction_force": extremes.get(("friction", "force"), np.zeros((4, 0)))[0],
        "mode": 1 + np.arange(found.q.size),
        "stuck_frequencies_hz": found.frequencies_hz(stuck=True),
        "sliding_frequencies_hz": found.frequencies_hz(stuck=False),
        "station": 1 + np.arange(system.deflection.shape[0]),
        "deflection": system.deflection @ found.q,
    }  # fmt: skip
    in_space = system.stations.in_space
    if in_space is not None:
        values |= {"direction": TRANSLATIONS, "deflection_in_space": in_space @ found.q}
    words = {
        "snubber": [contact_units(s.gap_unit) for s in snubbers],
        "support": [{"reaction_unit": unit} for _, unit in reactions],
        "friction": [{"friction_unit": FORCE_UNITS[spring.gap_unit]} for spring in friction],
    }
    return values, words


def _warnings(found: _AtRest, others: list[str]) -> Iterator[str]:
    """Warnings about the scenario, its system and the equilibrium; ``others`` are limits that it does not concern."""
    system = found.system
    scenario = system.scenario
    yield from (*scenario.warnings, *system.warnings)
    if not (gravity_loads(scenario) or scenario.constant_forces or found.force.any()):
        yield NOTHING_ACTS
    names = [spring.name for spring in system.springs if spring.kind == FRICTION]
    if names:
        yield FRICTION_AT_REST.format(first_of(names, 4))
    if others:
        yield f"limits on motions are not compared: {first_of(others, 4)}"
    depth = {s.name: float(x) for s, x in zip(system.snubbers, found.penetration, strict=False)}
    if scenario.has_force_tables:
        yield from compressed_beyond_tables(scenario, depth)
    peaks = {probe.name: np.abs(probe.shape @ found.q) for probe in system.probes}
    yield from deflection_warnings(scenario, system.modes, [peaks])
