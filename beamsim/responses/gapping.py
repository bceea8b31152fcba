r"""Gapping: the level of a sine at which contact is made or lost, and the preload that keeps contact.

Until contact changes, the steady motion is the linear one about static equilibrium,

.. math:: q = (K - \omega^2 + i \omega C)^{-1} \Big(l_1 - \frac{l_2}{\omega^2}\Big) A,

with :math:`l_1` the load of a unit of base acceleration (or of the force) and :math:`l_2` that of a unit of base
displacement on springs to ground (several forces act with their levels and phases, supports that move by their
acceleration, velocity and displacement); the contacts that are closed at rest belong to K and C. The level is therefore
exact for a steady motion. While a motion builds up, contact may change at a lower level.

Closing one more contact, with :math:`\kappa = k + i \omega c`, divides the opening s there by
:math:`1 + \kappa G`, where G is the receptance at the contact.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from beamsim.results.values import hinge_key
from beamsim.scenario.quantities import acceleration_amplitude
from beamsim.system.structural import ContactUnits, StructuralSystem
from beamsim.typing import Bools, Complexes, Floats, Ints, not_none

AT_ONCE = 1e-6  # levels of contacts that change together, relative
_LEVELS = ("level", "share_of_level", "frequency_hz", "time_s", "sigmas")


@dataclass(frozen=True)
class ContactLevels(ContactUnits):
    """Levels at which the linear steady motion makes or loses one contact, at each frequency.

    A snubber that is open at equilibrium first touches at ``onset``; one that is closed first lifts off at ``loss``.
    """

    # (F,) levels of the excitation, SI
    onset: Floats  # nan where the snubber is closed at equilibrium
    loss: Floats  # nan where the snubber is open at equilibrium
    preload_needed: Floats  # N per unit of level: force at equilibrium that keeps contact, all snubbers closed
    preload_alone: Floats  # the same with the other snubbers as they are at equilibrium
    level_of_other: Floats  # level at which another contact changes first, which ends the linear motion

    @property
    def closed_at_rest(self) -> bool:
        """Whether the snubber is closed at equilibrium."""
        return bool(np.all(np.isnan(self.onset)))

    @property
    def levels_of_change(self) -> Floats:
        """(F,) level at which contact of the linear motion changes, SI."""
        return np.fmax(self.onset, self.loss)  # of which one is nan

    @property
    def predicted_levels(self) -> Floats:
        """(F,) level of change, nan if another contact changes first."""
        return np.where(self.levels_of_change <= (1.0 + AT_ONCE) * self.level_of_other, self.levels_of_change, np.nan)


def transfer(system: StructuralSystem, frequency_hz: Floats, phases: Ints | None = None) -> Complexes:
    """Steady coordinates for a unit amplitude of the sine of `SineLoads`, with all contacts staying in their phases.

    Parameters
    ----------
    system : driven by a sine.
    frequency_hz : (F,) Hz, above zero.
    phases : (m,) of the contacts; by default no contact acts.

    Returns
    -------
    (F, n) amplitudes, kg^0.5 m for the SI unit of the sine; nan at an undamped resonance.
    """
    contacts, omega = system.dynamics.contacts, 2 * np.pi * np.asarray(frequency_hz)
    phases = contacts.start if phases is None else phases
    per_unit = not_none(system.sine).at(omega) @ system.forcing.load
    if system.forcing.base_displacements:
        per_unit -= (contacts.dynamic_stiffness(phases, omega) * moved_by_base(system, omega)) @ contacts.shape
    return _solve_linear(system, omega, phases, per_unit[:, :, None])[:, :, 0]


def accelerations_by_base(system: StructuralSystem, frequency_hz: Floats) -> Complexes:
    """(F, probes) accelerations of the probes with the base, m/s^2, for a unit amplitude of the sine, at Hz (F,)."""
    number, factors = system.model.acting_loads.signals, not_none(system.sine).at(2 * np.pi * frequency_hz)
    moved = [number[path, "acceleration"] for path, _ in system.model.acting_loads.base]
    return np.asarray(factors[:, moved] @ system.base_influence.T)


def moved_by_base(system: StructuralSystem, omega: Floats) -> Complexes:
    """(F, m) displacements of the contacts relative to their mountings by the base's own motion, for a unit sine."""
    displacements, influence = list(system.forcing.base_displacements), system.dynamics.contacts.base_influence
    return np.asarray(not_none(system.sine).at(omega)[:, displacements] @ influence[:, : len(displacements)].T)


def contact_levels(system: StructuralSystem, frequency_hz: Floats) -> dict[str, ContactLevels]:
    """Levels at which contact is made or lost, from the linear motion about static equilibrium.

    Snubbers whose law is more than a stiffness and a dashpot have no levels: a table changes its stiffness under load,
    and the forces of Maxwell branches depend on the frequency. Nor has a system with friction that sticks without a
    spring, or whose normal force comes from a snubber. A latch that is open at equilibrium has an onset like other
    stops; an engaged one is lost at no level (infinite) and needs no preload.
    """
    contacts, count = system.dynamics.contacts, len(system.snubbers)
    if system.static_equilibrium is None or count == 0 or contacts.any_sticks_rigidly or contacts.pressed_contacts.size:
        return {}
    penetration = static_penetration(system)
    closed = penetration > 0
    omega = 2 * np.pi * frequency_hz
    moved = moved_by_base(system, omega) if system.forcing.base_displacements else 0.0
    resting, pressed = contacts.resting_phases(penetration), pressed_phases(system, penetration)
    at_rest, shut = (  # openings
        transfer(system, frequency_hz, phases) @ contacts.shape.T + moved for phases in (resting, pressed)
    )
    stiffness, first = np.abs(contacts.dynamic_stiffness(resting, omega)), np.full(at_rest.T.shape, np.inf)
    for j, law in enumerate(contacts.laws):  # levels at which the linear motion takes each contact out of its phase
        for border in law.boundaries(float(penetration[j])):
            size = np.abs(at_rest[:, j]) * (stiffness[:, j] if border.is_force else 1.0)
            with np.errstate(divide="ignore", invalid="ignore"):
                first[j] = np.minimum(first[j], border.distance / size)
    impedance = contacts.dynamic_stiffness(pressed, omega)
    receptance = _receptances(system, omega, resting, ~closed[:count])
    unknown = np.full(omega.size, np.nan)
    levels = {}
    for j, snubber in enumerate(system.snubbers):
        law = contacts.laws[j]
        if not law.linear_in_contact:
            continue
        # a contact that can pull is lost when the penetration vanishes, one without tension when the force does
        losing = np.abs(impedance[:, j]) if law.one_sided_springs is None else law.stiffness
        if law.latches:  # keeps contact without a preload
            losing = np.zeros(omega.size)
        onset, loss = (unknown, first[j]) if closed[j] else (first[j], unknown)
        with np.errstate(invalid="ignore"):
            alone = at_rest[:, j] if closed[j] else at_rest[:, j] / (1.0 + impedance[:, j] * receptance[:, j])
        levels[snubber.name] = ContactLevels(
            onset, loss, losing * np.abs(shut[:, j]), losing * np.abs(alone),
            np.fmin.reduce(np.delete(first, j, axis=0), axis=0, initial=np.inf), gap_unit=snubber.gap_unit,
        )  # fmt: skip
    return levels


def static_penetration(system: StructuralSystem) -> Floats:
    """(m,) penetration of the contacts at static equilibrium, m; nan where there is none."""
    contacts = system.dynamics.contacts
    if system.static_equilibrium is None:
        return np.full(contacts.count, np.nan)
    return np.asarray(-contacts.gap - contacts.sign * (contacts.shape @ system.static_equilibrium))


def pressed_phases(system: StructuralSystem, penetration: Floats) -> Ints:
    """(m,) phases with every snubber closed; piecewise-linear springs and friction stay as they are at rest."""
    contacts = system.dynamics.contacts
    phases = contacts.resting_phases(penetration)
    for k in np.flatnonzero(~(penetration[: len(system.snubbers)] > 0)).tolist():
        phases[k] = contacts.laws[k].closed_phase  # also where there is no equilibrium
    return phases


def gapping(
    levels: dict[str, ContactLevels], frequency_hz: Floats, amplitude: Floats, level: Floats
) -> dict[str, dict[str, Any]]:
    """The level at which a sine first changes each contact, and the preload that keeps contact, for the summary.

    Parameters
    ----------
    levels : by snubber, from `contact_levels`.
    frequency_hz : (F,) of the levels.
    amplitude : (F,) of the excitation there, SI.
    level : (F,) amplitude of a sine whose level is the same at all frequencies, SI; above zero.

    Returns
    -------
    By snubber whether it is closed at rest; the lowest level that changes its contact, SI, over the amplitude there
    (nan if that is zero) and its frequency, Hz, unless another contact changes first (`order_by_level`); and the
    largest preload needed at any frequency, N, with all snubbers closed and with the others as they are at rest.
    """
    changes = first_changes(levels, frequency_hz, amplitude, level)
    for name, of in levels.items():
        for entry, needed in (("preload_n", of.preload_needed), ("preload_alone_n", of.preload_alone)):
            forces = needed * amplitude
            changes[name][entry] = max(forces[np.isfinite(forces)].tolist(), default=math.nan)
    return changes


def first_changes(
    levels: dict[str, ContactLevels], frequency_hz: Floats, amplitude: Floats, reference_amplitude: Floats
) -> dict[str, dict[str, Any]]:
    """The frequency at which a sine first changes each contact, where its level relative to another sine is smallest.

    Parameters
    ----------
    levels : by snubber, from `contact_levels`.
    frequency_hz : (F,) of the levels.
    amplitude : (F,) of the excitation there, SI.
    reference_amplitude : (F,) amplitude of the other sine, SI; zero where nothing changes.

    Returns
    -------
    By snubber the entries of `gapping` without preloads.
    """
    changes, measures = {}, {}
    loud, driven = (np.where(of > 0, of, np.nan) for of in (amplitude, reference_amplitude))
    for name, of in levels.items():
        measure = of.levels_of_change / driven
        k = int(np.nanargmin(measure)) if np.isfinite(measure).any() else 0
        measures[name] = float(measure[k])
        changes[name] = {
            "closed_at_rest": of.closed_at_rest,
            "level": float(of.levels_of_change[k]),
            "frequency_hz": float(frequency_hz[k]),
            "share_of_level": float(of.levels_of_change[k] / loud[k]),
        }
    before = [of.level_of_other / driven for of in levels.values()]
    return order_by_level(changes, measures, float(np.nanmin(before, initial=np.inf)))


def gapping_of_sine(system: StructuralSystem) -> dict[str, dict[str, Any]]:
    """The entries of `gapping` for a sine of one frequency; empty for other inputs."""
    if system.sine is None:
        return {}
    excitation = system.scenario.sine
    frequency = np.array([excitation.frequency])
    levels = contact_levels(system, frequency)
    amplitude = acceleration_amplitude(abs(excitation.level), excitation.quantity, excitation.frequency)
    return gapping(levels, frequency, np.array([amplitude]), np.ones(1)) if levels else {}


def gapping_ratios(snubbers: Mapping[str, Mapping[str, Any]]) -> dict[str, float]:
    """By snubber the level over the predicted level of the first change of contact, from a summary's ``gapping``."""
    shares = {name: of["share_of_level"] for name, of in snubbers.items() if not math.isnan(of["share_of_level"])}
    return {name: 1.0 / share if share > 0.0 else math.inf for name, share in shares.items()}


def finite(ratios: Mapping[str, float]) -> dict[str, float]:
    """The finite ratios; contacts that change at any level have none."""
    return {name: ratio for name, ratio in ratios.items() if math.isfinite(ratio)}


def in_their_units(snubbers: dict[str, dict[str, Any]], units: Mapping[str, str]) -> dict[str, dict[str, Any]]:
    """The entries of a summary's ``gapping``, with angles and moments in the names of those of hinges."""
    turned = {name: {hinge_key(key): x for key, x in of.items()} for name, of in snubbers.items()}
    return {name: turned[name] if units[name] == "rad" else of for name, of in snubbers.items()}


def order_by_level(
    snubbers: dict[str, dict[str, Any]], measures: Mapping[str, float], smallest: float
) -> dict[str, dict[str, Any]]:
    """The entries of a summary's ``gapping``; only the contact that changes first keeps its level.

    After that change the linear motion no longer predicts the other contacts.

    Parameters
    ----------
    snubbers : by name, the prediction from the linear motion.
    measures : by name the quantity that orders them.
    smallest : smallest measure of all contacts, including those without an entry.

    Returns
    -------
    By name; contacts that change later have nan as level, and ``not_predicted`` names the first change.
    """
    least, cause = float(np.fmin.reduce(list(measures.values()), initial=np.inf)), ""
    if not np.isfinite(min(least, smallest)):
        return snubbers
    if smallest * (1.0 + AT_ONCE) < least:
        least, cause = smallest, "a table, branch, spring or friction changes first"
    first = {name for name in snubbers if measures[name] <= least * (1.0 + AT_ONCE)}
    if not cause:
        name = next(name for name in snubbers if name in first)
        cause = f"{name} {'opens' if snubbers[name]['closed_at_rest'] else 'touches'} first"
    void = {key: float("nan") for key in _LEVELS}
    return {
        name: of if name in first else {key: void.get(key, of[key]) for key in of} | {"not_predicted": cause}
        for name, of in snubbers.items()
    }


def _receptances(system: StructuralSystem, omega: Floats, phases: Ints, snubbers: Bools) -> Complexes:
    """(F, m) receptance at the chosen snubbers, with contacts in fixed phases; nan at others."""
    shape = system.dynamics.contacts.shape[: snubbers.size][snubbers]
    out = np.full((omega.size, snubbers.size), np.nan, dtype=complex)
    push = np.broadcast_to(shape.T.astype(complex), (omega.size, *shape.T.shape))
    out[:, snubbers] = np.einsum("kn,fnk->fk", shape, _solve_linear(system, omega, phases, push))
    return out


def _solve_linear(system: StructuralSystem, omega: Floats, phases: Ints, loads: Complexes) -> Complexes:
    """(F, n, k) coordinates under loads (F, n, k); nan at an undamped resonance."""
    dynamics, shape = system.dynamics, system.dynamics.contacts.shape
    pushed = dynamics.contacts.dynamic_stiffness(phases, omega)
    inertia = np.diag(dynamics.stiffness) - omega[:, None, None] ** 2 * np.eye(dynamics.size)
    matrix = inertia + 1j * omega[:, None, None] * dynamics.damping + (shape.T * pushed[:, None, :]) @ shape
    with suppress(np.linalg.LinAlgError):
        return np.asarray(np.linalg.solve(matrix, loads))
    solution = np.full(loads.shape, np.nan, dtype=complex)
    for of, one, load in zip(solution, matrix, loads, strict=True):  # at some frequency there is none
        with suppress(np.linalg.LinAlgError):
            of[:] = np.linalg.solve(one, load)
    return solution
