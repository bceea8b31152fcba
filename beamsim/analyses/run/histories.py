"""Datasets of a run at its output times: histories by place, contact events, intervals of sliding."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.analyses.run.impacts import sliding_values
from beamsim.analyses.run.layouts import BODIES, CONTACT, FRICTION_INTERVALS, HISTORIES, RINGS
from beamsim.analyses.run.motion import Evaluation, LargestContact, RunMotion
from beamsim.analyses.run.spectra import spectral
from beamsim.contacts.sliders import residual_crush
from beamsim.flow.channels import outputs_of
from beamsim.labelled import Dataset
from beamsim.responses.histories import NOTABLE, Histories, share_above_half_rate, share_of_blocks
from beamsim.results.values import DISPLACEMENT, FORCE, STRESS, extreme_times, hinge_key, largest
from beamsim.scenario.connections import HingeElement
from beamsim.structures.places import TRANSLATIONS
from beamsim.system.structural import StructuralSystem, contact_units
from beamsim.typing import Floats, not_none

if TYPE_CHECKING:
    from beamsim.system.rings import RingInfo

_SLIDING_UNITS = {
    "sliding_distance": "m", "dissipated_energy": "j", "dissipated_power": "w", "wear_power": "w", "worn_volume": "m3",
}  # fmt: skip
_FORCES = ("start_force", "static_force", "sliding_force")


def without_histories() -> dict[str, Dataset]:
    """Datasets of a run that needs only values."""
    return {"histories": HISTORIES.dataset({"time": np.zeros(0)})}


def datasets_of(motion: RunMotion, histories: Histories, evaluation: Evaluation) -> dict[str, Dataset]:
    """Datasets of all histories at the output times.

    Parameters
    ----------
    motion : motion of the run.
    histories : histories of the motion.
    evaluation : evaluation of the motion.

    Returns
    -------
    By name.
    """
    system, time = motion.system, histories.time
    friction = [each.item for each in system.scenario.listed("friction")]
    sliding = _sliding_by_contact(motion, evaluation) if friction else []
    base = np.array([moved.displacement(time) for moved in system.base]).reshape(-1, time.size)
    values: dict[str, Any] = {
        "time": time,
        "energy_work_in": histories.energy.input_work,
        "energy_dissipated": histories.energy.dissipated,
        "energy_stored": histories.energy.stored,
    }
    if system.base:
        accelerations = np.array([moved.acceleration(time) for moved in system.base])
        names = list(system.scenario.base_motion_names)
        values |= {"base_motion": names, "base_acceleration": accelerations, "base_displacement": base}
    if system.probes:
        values |= _probe_histories(motion, histories, base)
    if system.snubbers:
        values |= _snubber_variables(motion, histories)
    if springs := [spring for spring in system.springs if spring.listed_as == "springs"]:
        values |= _spring_variables(springs, histories)
    if friction:
        values |= _friction_variables(motion, histories, sliding)
    if system.outputs:
        values |= _output_histories(system, histories)
    of_members = {
        "snubber": [contact_units(snubber.gap_unit) for snubber in system.snubbers],
        "friction": [contact_units("rad" if isinstance(each, HingeElement) else "m") for each in friction],
        "output": [{"unit": each.unit, "quantity": each.quantity} for each in system.outputs],
        "base_motion": [{"base_unit": "rad" if each.rotates else "m"} for _, each in system.model.acting_loads.base],
    }
    datasets = {"histories": HISTORIES.dataset(values, of_members)}
    if system.springs and system.rings:
        datasets["rings"] = _ring_histories(motion, histories)
    if rows := [(k, row) for k, of in enumerate(sliding) for row in of.get("intervals", ())]:
        datasets["friction_intervals"] = _friction_intervals(rows)
    return datasets


def _ring_histories(motion: RunMotion, histories: Histories) -> Dataset:
    """Positions and forces of the rings, with their properties and errors."""
    rings, time = motion.system.rings, histories.time
    position, force = (histories.of(("rings", of)).T.reshape(len(rings), 2, time.size) for of in ("position", "force"))
    friction = dict.fromkeys((ring.name for ring in rings), 0.0 * time)
    rubbing = [ring for ring in rings if ring.tangents.size]
    forces = histories.of(("rings", "friction_force")).T.reshape(len(rubbing), 2, time.size)
    friction |= {ring.name: np.hypot(*both) for ring, both in zip(rubbing, forces, strict=True)}
    worn = [_wear_of_ring(motion, ring, histories) for ring in rings]
    of_rings = [ring.ring for ring in rings]
    values: dict[str, Any] = {
        "time": time,
        "ring": [ring.name for ring in rings],
        "first_direction": [ring.places[0] for ring in rings],
        "second_direction": [ring.places[1] for ring in rings],
        "first_gap": [ring.semi_axes[0] for ring in of_rings],
        "second_gap": [ring.semi_axes[1] for ring in of_rings],
        "stiffness": [ring.stiffness for ring in of_rings],
        "dashpot": [ring.dashpot for ring in of_rings],
        "largest_penetration": [ring.largest_penetration for ring in of_rings],
        "sides": [ring.sides for ring in of_rings],
        "gap_error": [ring.errors.clearance for ring in rings],
        "force_error": [ring.errors.force for ring in rings],
        "direction_error_deg": [ring.errors.direction_deg for ring in rings],
        "impulse_error": [ring.errors.impulse for ring in rings],
        **{name: [of[name] for of in worn] for name in worn[0]},
        "first_position": position[:, 0],
        "second_position": position[:, 1],
        "first_force": force[:, 0],
        "second_force": force[:, 1],
        "force": np.hypot(force[:, 0], force[:, 1]),
        "friction_force": [friction[ring.name] for ring in rings],
        "penetration": [ring.penetrations(*of) for ring, of in zip(rings, position, strict=True)],
    }
    return RINGS.dataset(values)


def _wear_of_ring(motion: RunMotion, ring: RingInfo, histories: Histories) -> dict[str, float]:
    """Contact share and wear of a ring after run.from; of a motion that is not kept whole the share of samples."""
    from beamsim.responses.rings import wear_values

    trajectory, begin = motion.trajectory, not_none(motion.system.scenario.run).from_
    if trajectory is None or motion.compared_s is not None or begin >= trajectory.end:
        share = float(histories.in_contact[:, ring.sides].any(axis=1).mean())
        unknown = ("sliding_distance", "work_rate", "worn_volume", "friction_energy")
        return {"contact_share": share, **dict.fromkeys(unknown, np.nan)}
    return wear_values(trajectory.extract(begin, trajectory.end) if begin else trajectory, ring)


def _friction_intervals(rows: Sequence[tuple[int, Any]]) -> Dataset:
    """Intervals of the statistics of friction contacts, each with the index of its contact."""
    columns = {name: [getattr(row, name) for _, row in rows] for name in ("value_name", "value", "low", "high")}
    numbers = {"number": np.arange(len(rows)), "friction": [k for k, _ in rows]}
    return FRICTION_INTERVALS.dataset(numbers | columns)


def _spring_variables(springs: Sequence[Any], histories: Histories) -> dict[str, Any]:
    """Variables of the nonlinear springs: properties and histories."""
    return {
        "spring": [spring.name for spring in springs],
        "spring_kind": [spring.kind for spring in springs],
        "spring_masses": [json.dumps(spring.masses) for spring in springs],
        "spring_extension": histories.of(("springs", "extension")).T,
        "spring_force": histories.of(("springs", "force")).T,
    }


def _numbers_or_none(values: Sequence[float | None]) -> Floats | None:
    """(k,) numbers, NaN for None; None if all are None."""
    if all(value is None for value in values):
        return None
    return np.array([np.nan if value is None else value for value in values])


def _probe_histories(motion: RunMotion, histories: Histories, base: Floats) -> dict[str, Any]:
    """Histories of the probes; ``base`` are the displacements of the base (K, nt), m."""
    system, probes, displacement = motion.system, motion.system.probes, histories.of(DISPLACEMENT).T
    bodies = system.scenario.bodies_of_places["probes"] if len(system.scenario.all_bodies) > 1 else {}
    return {
        "probe": [probe.name for probe in probes],
        "probe_body": [bodies[probe.name] for probe in probes] if bodies else None,
        "position": [probe.position for probe in probes],
        "position_y": _numbers_or_none([probe.position_y for probe in probes]),
        "displacement": displacement,
        "absolute_displacement": displacement + system.base_influence @ base,
        "velocity": histories.of(("probes", "velocity")).T,
        "absolute_acceleration": histories.of(("probes", "absolute_acceleration")).T,
        "low_passed_acceleration": None if motion.low_passed is None else motion.low_passed[: base.shape[1]].T,
    }


def _snubber_variables(motion: RunMotion, histories: Histories) -> dict[str, Any]:
    """Variables of the snubbers: properties and histories."""
    system, snubbers = motion.system, motion.system.snubbers
    bodies = system.scenario.bodies_of_places["snubbers"] if len(system.scenario.all_bodies) > 1 else {}
    described = ("position", "side", "stiffness", "dashpot", "gap", "preload", "blocked_force", "stiffness_ratio")
    yields = any(law.yields for law in system.dynamics.contacts.laws[: len(snubbers)])
    crushed = _residual_crush(motion) if yields else {}
    return {
        "snubber": [snubber.name for snubber in snubbers],
        "snubber_body": [bodies[snubber.name] for snubber in snubbers] if bodies else None,
        **{f"snubber_{name}": [getattr(snubber, name) for snubber in snubbers] for name in described},
        "snubber_position_y": _numbers_or_none([snubber.position_y for snubber in snubbers]),
        "snubber_table_misfit": _numbers_or_none([snubber.table_misfit for snubber in snubbers]),
        "snubber_residual_crush": _numbers_or_none([crushed.get(j) for j in range(len(snubbers))]),
        "snubber_closed": histories.in_contact[:, : len(snubbers)].T,
        **{
            f"snubber_{quantity}": histories.of(("snubbers", quantity)).T
            for quantity in ("force", "penetration", "displacement", "velocity")
        },
    }


def _residual_crush(motion: RunMotion) -> dict[int, float]:
    """Residual crush of the snubbers that yield at the end of the motion, m, by index; empty for time stepping."""
    contacts, trajectory = motion.system.dynamics.contacts, motion.trajectory
    yielding = [j for j in range(len(motion.system.snubbers)) if contacts.laws[j].yields]
    if trajectory is None:
        return {}
    end = trajectory.final_y
    penetration = trajectory.flow.equations.penetration
    delta = trajectory.sample(np.array([trajectory.end]), lambda _: penetration)[0]
    phases, first = trajectory.phases[-1], 2 * contacts.shape.shape[1] + contacts.first_state
    return {
        j: residual_crush(contacts.laws[j], int(phases[j]), float(delta[j]), float(end[first[j]])) for j in yielding
    }


def _sliding_by_contact(motion: RunMotion, evaluation: Evaluation) -> list[dict[str, Any]]:
    """Results of `sliding_values` for each friction contact, as far as computed."""
    system, scenario = motion.system, motion.system.scenario
    contacts = [each.item for each in scenario.listed("friction")]
    unknown: list[dict[str, Any]] = [{} if c.pressed_by is None else {"sliding_share": np.nan} for c in contacts]
    begin = 0.0 if scenario.run is None else scenario.run.from_
    if motion.trajectory is None or begin > motion.trajectory.end:
        return unknown
    random = scenario.excitation.stationary and motion.outcome.complete
    counted = motion.trajectory.extract(begin, motion.trajectory.end) if begin else motion.trajectory
    return evaluation.compute("sliding", lambda: sliding_values(system, counted, contacts, random=random), unknown)


def _friction_variables(motion: RunMotion, histories: Histories, sliding: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Variables of friction contacts: properties and histories; ``sliding`` is from `_sliding_by_contact`."""
    system = motion.system
    contacts, number = [each.item for each in system.scenario.listed("friction")], system.friction_contacts
    slides = [of.get("slides") for of in sliding]
    return {
        "friction": [c.name for c in contacts],
        "friction_normal_force": [np.nan if isinstance(c, HingeElement) else c.constant_force for c in contacts],
        "friction_static_force": [c.static_force for c in contacts],
        "friction_sliding_force": [c.sliding_force for c in contacts],
        "friction_stiffness": [c.stiffness or np.inf for c in contacts],
        "friction_start_force": [c.start_force for c in contacts],
        "friction_sliding_share": [
            of.get("sliding_share", 1.0 - float(motion.contact_share[j])) for of, j in zip(sliding, number, strict=True)
        ],
        "friction_slides": None if None in slides else slides,
        **{f"friction_{name}": _numbers_or_none([of.get(name) for of in sliding]) for name in _SLIDING_UNITS},
        "friction_displacement": histories.of(("friction", "extension")).T,
        "friction_force": histories.of(("friction", "force")).T,
        "friction_stuck": histories.in_contact[:, number].T,
    }


def friction_summary(datasets: dict[str, Dataset]) -> dict[str, dict[str, Any]]:
    """Summary of each friction contact, with units in the names; None for unknown values."""
    histories, intervals = datasets["histories"], datasets.get("friction_intervals")
    summary = {}
    for k, name in enumerate(histories.labels("friction")):

        def value(quantity: str, name: str = name) -> Any:
            variable = f"friction_{quantity}"
            return histories[variable].sel(friction=name).item() if variable in histories else None

        called = hinge_key if histories["friction_displacement"].sel(friction=name).unit == "rad" else str
        known = {entry: value(entry) for entry in _SLIDING_UNITS}
        numbers: dict[str, Any] = {
            called(f"{entry}_{unit}"): None if known[entry] is None or np.isnan(known[entry]) else known[entry]
            for entry, unit in _SLIDING_UNITS.items()
        }
        numbers |= {called(f"{entry}_n"): value(entry) for entry in _FORCES}
        if intervals is not None and (rows := np.flatnonzero(intervals["friction"].values == k)).size:
            of_rows = zip(*(intervals[of].values[rows].tolist() for of in ("value_name", "low", "high")), strict=True)
            numbers["intervals"] = {called(entry): [low, high] for entry, low, high in of_rows}
        summary[name] = {"sliding_share": value("sliding_share"), "slides": value("slides"), **numbers}
    return summary


def _output_histories(system: StructuralSystem, histories: Histories) -> dict[str, Any]:
    """Outputs that the run requests, in its order."""
    met: Counter[str] = Counter()
    values = []
    for output in system.outputs:
        values.append(histories.of(output.key)[:, met[output.quantity]])
        met[output.quantity] += 1
    return {
        "output": [output.name for output in system.outputs],
        "output_quantity": [output.quantity for output in system.outputs],
        "output_unit": [output.unit for output in system.outputs],
        "output_at": [output.at for output in system.outputs],
        "output_value": np.array(values),
    }


def aliased_in_histories(motion: RunMotion, histories: Histories) -> dict[str, float]:
    """Notable shares of the root mean squares above half the output rate.

    For a time-stepped motion, which is unknown between the output times, the share above a quarter of the rate.

    Parameters
    ----------
    motion : motion of the run.
    histories : histories of the run.

    Returns
    -------
    By place and quantity, such as ``"tip absolute_acceleration"``.
    """
    keys = (*spectral(motion.system).places, ("probes", "velocity"), FORCE)
    channels = motion.system.channels.of_keys(*dict.fromkeys(keys))
    time, trajectory = histories.time, motion.trajectory
    if not (channels.places and time.size):
        return {}
    order = np.argsort(np.hstack([channels.places[key] for key in channels.places]))
    columns = np.hstack([histories.channels.places[key] for key in channels.places])[order]
    if trajectory is None:
        shares = share_above_half_rate(histories.values[: time.size - 1 + time.size % 2, columns], 0.5)
    else:
        first, output_of = np.searchsorted(time, trajectory.time[0]), outputs_of(trajectory.flow, channels.linear)
        shares = share_of_blocks(
            time[first:], histories.values[first:], columns,
            lambda times: trajectory.sample(times, output_of)[:, channels.order],
        )  # fmt: skip
    names = [f"{channel.name} {channel.quantity}" for channel in channels.channels]
    return {name: float(share) for name, share in zip(names, shares, strict=True) if share > NOTABLE}


def bodies_of_run(motion: RunMotion, evaluation: Evaluation) -> dict[str, Dataset]:
    """Dataset of results along each body with a continuous axis, by its name; empty without such a body.

    Parameters
    ----------
    motion : motion of the run.
    evaluation : evaluation of the motion.
    """
    system, times = motion.system, extreme_times(motion.extremes)
    equilibrium, stresses, von_mises = system.static_equilibrium, dict[str, Floats](), dict[str, Floats]()
    if system.stress is not None:
        peaks, whose = largest(motion.extremes[STRESS]), np.array(system.stress.bodies)
        for body in (body for body in system.bodies if body.body in system.stress.bodies):
            stresses[body.body] = peaks[whose == body.body].reshape(body.moments, -1).max(axis=0)
    if motion.plates is not None:
        von_mises = evaluation.compute("the von Mises stress of plates", motion.plates.result, von_mises)
    bodies = [body for body in system.bodies if body.axis.continuous]
    if not bodies:
        return {}
    unknown = [np.full(body.position.size, np.nan) for body in bodies]
    static = unknown if equilibrium is None else [body.deflection @ equilibrium for body in bodies]
    moved = motion.extreme_states[:, : system.dynamics.size]
    extreme = [moved @ body.deflection.T + system.with_supports(body.places, times) for body in bodies]
    optional = {
        "position_y": [body.position_y for body in bodies],
        "peak_bending_stress": [stresses.get(body.body) for body in bodies],
        "peak_von_mises_stress": [von_mises.get(body.body) for body in bodies],
    }
    values = {
        "body": [body.body for body in bodies],
        "station": np.arange(1, sum(nan.size for nan in unknown) + 1),
        "station_body": np.repeat(np.arange(len(bodies)), [nan.size for nan in unknown]),
        "position": np.concatenate([body.position for body in bodies]),
        "static_shape": np.concatenate(static),
        "extreme_time": times,
        "extreme_shape": np.hstack(extreme),
    }
    for name, known in optional.items():
        if any(of_body is not None for of_body in known):
            parts = zip(known, unknown, strict=True)
            values[name] = np.concatenate([nan if of_body is None else of_body for of_body, nan in parts])
    return {"bodies": BODIES.dataset(values)}


def contact_of_run(system: StructuralSystem, largest: LargestContact) -> Dataset:
    """Dataset of the motion at the largest contact force, for pictures of several bodies and of bodies in space.

    Parameters
    ----------
    system : system with several bodies, or with bodies in space.
    largest : largest contact force of its motion.
    """
    places = [place for body in system.bodies for place in body.places]
    supports = system.with_supports(places, np.array([largest.time]))[0]
    deflection = largest.state[: system.dynamics.size] @ system.deflection.T
    values = {
        "time": largest.time,
        "contact_snubber": largest.snubber,
        "force": largest.force,
        "station": np.arange(1, deflection.size + 1),
        "deflection": deflection + supports if supports.any() else deflection,
        "snubber": [snubber.name for snubber in system.snubbers],
        "opening": largest.opening[: len(system.snubbers)],
    }
    in_space = system.stations.in_space
    if in_space is not None and not system.model.moving_supports:
        values |= {"direction": TRANSLATIONS, "deflection_in_space": in_space @ largest.state[: system.dynamics.size]}
    return CONTACT.dataset(values, {"snubber": [contact_units(snubber.gap_unit) for snubber in system.snubbers]})
