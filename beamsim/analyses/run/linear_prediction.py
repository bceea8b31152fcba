r"""Predictions from linear motions: structures with contacts always open or closed, and the first contact change.

*Random input.* With every snubber always open, or always closed (bilateral), the stationary response has the variance
:math:`\int |H|^2 S df`, with S the density of the input. Compared with the run, it shows the effect of the stops. The
integral uses Gauss-Legendre rules on panels that are short near resonances, where the integrand varies over a
half-power bandwidth; its error is below 1e-6.

*Gapping.* In the linear motion about equilibrium every contact keeps its phase at rest. For a sine it is the steady
motion (`beamsim.responses.gapping`). For a pulse, a record and other inputs it is marched from equilibrium: with the
penetration at rest :math:`\delta_0` and that of the linear motion :math:`\delta`, the contact opens if the input is
multiplied by

.. math:: \delta_0 / (\delta_0 - \min_t \delta)

or more, and closes if it is multiplied by :math:`\delta_0 / (\delta_0 - \max_t \delta)`. For a random input the
standard deviation of the stationary linear motion is compared with :math:`\delta_0`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from beamsim.analyses.run.motion import RunMotion
from beamsim.analyses.run.result import MAIN_QUANTITY
from beamsim.contacts.laws import ContactLaw
from beamsim.flow.channels import channel_extrema
from beamsim.flow.exact import exact_flow
from beamsim.flow.transient import simulate
from beamsim.inputs.density import SpectralDensity, clipped_mean_square, density_of
from beamsim.outcomes import check_stop
from beamsim.responses.gapping import (
    accelerations_by_base,
    moved_by_base,
    order_by_level,
    pressed_phases,
    static_penetration,
    transfer,
)
from beamsim.results.values import FORCE, PENETRATION, Extremes
from beamsim.scenario.base import Path
from beamsim.scenario.excitation import RandomInput
from beamsim.scenario.run import Run
from beamsim.system.equations import SineLoads
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, Ints

NODES = 8
NODES_OF_BINS = 3  # for means over frequency bins
PANEL_GROWTH = 4.0  # growth of the distance from a resonance, from panel to panel
BLOCK = 256  # frequencies at a time
UNDAMPED = 1e-9  # half-power bandwidth over frequency; smaller counts as undamped

Deviations = dict[tuple[str, str], float]  # by name and quantity
SIGMAS = 3.0  # standard deviations of a stationary motion that a preload should withstand
ALWAYS_CLOSED = 1e-12  # relative to the penetration at rest; a smaller change is round-off
_WATCHED = (PENETRATION, FORCE, ("springs", "extension"), ("friction", "extension"))
SnubberEntries = dict[str, dict[str, Any]]


class LinearInput(NamedTuple):
    """Structure with one random input."""

    system: StructuralSystem  # with loads for a sine
    density: SpectralDensity  # SI
    clipping: float  # ratio of mean squares of the clipped input and its density


def linear_inputs(system: StructuralSystem) -> list[LinearInput]:
    """Structure and each of its inputs; empty unless all are independent random motions of the base or forces.

    Empty also without a snubber, or with a nonlinear spring or friction.
    """
    items, acting = system.scenario.excitation.items, system.model.acting_loads
    independent = len({getattr(each, "seed", "") for _, each in items}) == len(items)
    alone = len(acting.base) + len(acting.forces) == len(items)  # supports move what is on them
    linear = system.cubic is None and not system.springs and not system.dynamics.contacts.any_sticks_rigidly
    random = all(isinstance(each, RandomInput) and not isinstance(each.seed, str) for _, each in items)
    if not (items and random and independent and alone and linear and system.snubbers):
        return []
    return [_linear_input(system, ("excitation", *at), each) for at, each in items]


def _linear_input(system: StructuralSystem, path: Path, excitation: RandomInput) -> LinearInput:
    """Structure under one of its inputs alone, at a path."""
    density = density_of(excitation, system.scenario.folder_of(*path, "psd", "file"))
    size = len(system.forcing.signal)
    coefficient, power = np.zeros(size, dtype=complex), np.zeros(size, dtype=np.int64)
    for (at, quantity), number in system.model.acting_loads.signals.items():
        if number < size:
            coefficient[number], power[number] = at == path, -2 if quantity == "displacement" else 0
    sine = SineLoads(coefficient, power)
    return LinearInput(replace(system, sine=sine), density, clipped_mean_square(excitation.clip))


def linear_responses(system: StructuralSystem, frequency_hz: Floats) -> dict[tuple[str, str], dict[str, Any]]:
    """Linear responses with every snubber always open, and always closed.

    A snubber with a table has the slope at its static penetration, or its first slope.

    Parameters
    ----------
    system : system of the run.
    frequency_hz : (F,) evenly spaced frequencies, Hz.

    Returns
    -------
    Values of `RANDOM` about linear responses, SI, by name and quantity; densities are means around the frequencies.
    Empty without `linear_inputs`, or with an undamped resonance within the input's band.
    """
    driven = linear_inputs(system)
    if not driven:
        return {}
    half = 0.5 * (frequency_hz[1] - frequency_hz[0])
    edges = np.append(np.maximum(frequency_hz - half, 0.0), frequency_hz[-1] + half)
    pressed = pressed_phases(system, static_penetration(system))
    responses: dict[tuple[str, str], dict[str, Any]] = {of: {} for of in _names(system)}
    for state, phases in (("open", system.dynamics.contacts.start), ("closed", pressed)):
        deviations, powers = stationary_deviations(driven, phases), stationary_powers(driven, phases, edges)
        if deviations is None or powers is None:
            return {}
        for of, fields in responses.items():
            fields |= {f"linear_{state}": deviations[of], f"density_{state}": powers[of] / np.diff(edges)}
    return responses


def stationary_deviations(inputs: Sequence[LinearInput], phases: Ints) -> Deviations | None:
    """Standard deviations if all contacts keep their phases (m,); None with an undamped resonance in the band."""
    powers = stationary_powers(inputs, phases)
    return None if powers is None else {of: float(np.sqrt(power[0])) for of, power in powers.items()}


def _panels(system: StructuralSystem, phases: Ints, centre_hz: Floats) -> Floats | None:
    """(P + 1,) ends of panels with smooth density and response, Hz; None if the response diverges."""
    dynamics, shape, n = system.dynamics, system.dynamics.contacts.shape, system.dynamics.size
    pushed = dynamics.contacts.dynamic_stiffness(phases, np.ones(1))[0]  # of slow motions
    stiffness = np.diag(dynamics.stiffness) + (shape.T * pushed.real) @ shape
    damping = dynamics.damping + (shape.T * pushed.imag) @ shape
    poles = np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]])) / (2 * np.pi)
    low, high = float(centre_hz[0]), float(centre_hz[-1])
    octaves = np.geomspace(low, high, max(int(np.ceil(np.log2(high / low))), 1) + 1)
    ends = [centre_hz, octaves]
    for pole in poles[poles.imag > 0]:
        centre, width = float(pole.imag), abs(float(pole.real))
        if width < UNDAMPED * centre:
            if low <= centre <= high:
                return None
            continue
        distances = width * PANEL_GROWTH ** np.arange(max(np.ceil(np.log(high / width) / np.log(PANEL_GROWTH)), 0) + 1)
        ends += [centre - distances, centre + distances]
    inside = np.concatenate(ends)
    return np.unique(np.clip(inside, low, high))


def _names(system: StructuralSystem) -> list[tuple[str, str]]:
    """Names of the responses, in order."""
    names = [(probe.name, quantity) for quantity in ("displacement", MAIN_QUANTITY) for probe in system.probes]
    return names + [(snubber.name, quantity) for quantity in ("force", "penetration") for snubber in system.snubbers]


def _squared_responses(system: StructuralSystem, phases: Ints, frequency: Floats) -> Floats:
    """(F, k) squared magnitudes of the responses to a unit input."""
    contacts, snubbers = system.dynamics.contacts, slice(len(system.snubbers))
    rows = np.array([probe.shape for probe in system.probes]).reshape(-1, system.dynamics.size)
    omega = 2 * np.pi * frequency[:, None]
    moved = transfer(system, frequency, phases)
    displacement = moved @ rows.T
    extension = moved @ contacts.shape.T
    extension = extension + moved_by_base(system, omega[:, 0])
    force = (contacts.dynamic_stiffness(phases, omega[:, 0]) * extension)[:, snubbers]
    responses = np.hstack(
        [
            displacement,
            accelerations_by_base(system, frequency) - omega**2 * displacement,
            force,
            extension[:, snubbers],
        ]
    )
    return np.asarray(np.abs(responses) ** 2)


def stationary_powers(
    inputs: Sequence[LinearInput], phases: Ints, edges: Floats | None = None
) -> dict[tuple[str, str], Floats] | None:
    """Mean squares of the stationary linear motion under independent inputs: the sum of those of each.

    Parameters
    ----------
    inputs : structure and each input.
    phases, edges : see `_powers_of_input`.

    Returns
    -------
    As `_powers_of_input`; None if one of them is.
    """
    total: dict[tuple[str, str], Floats] = {}
    for each in inputs:
        powers = _powers_of_input(each, phases, edges)
        if powers is None:
            return None
        total = {of: power + total.get(of, 0.0) for of, power in powers.items()}
    return total


def _powers_of_input(
    random_input: LinearInput, phases: Ints, edges: Floats | None
) -> dict[tuple[str, str], Floats] | None:
    """Mean squares of the stationary linear motion in parts of the band, if all contacts keep their phases.

    Parameters
    ----------
    random_input : structure and input.
    phases : (m,) phases of the contacts.
    edges : (B + 1,) increasing band edges, Hz; by default the ends of the input's band with intermediate points.

    Returns
    -------
    By name and quantity (B,) between the edges, SI, 0 outside the input's band; None with an undamped resonance
    within the band.
    """
    panels, count = (
        _panels(random_input.system, phases, random_input.density.frequency_hz),
        NODES if edges is None else NODES_OF_BINS,
    )
    if panels is None:
        return None
    edges = panels[[0, -1]] if edges is None else edges
    inside = edges[(edges > panels[0]) & (edges < panels[-1])]
    names = _names(random_input.system)
    power = np.zeros((edges.size - 1, len(names)))
    for frequency, weight in _nodes(np.unique(np.concatenate([panels, inside])), count):
        within = weight * random_input.clipping * random_input.density(frequency)
        bins = np.clip(np.searchsorted(edges, frequency) - 1, 0, edges.size - 2)
        np.add.at(power, bins, within[:, None] * _squared_responses(random_input.system, phases, frequency))
    return dict(zip(names, power.T, strict=True))


def _nodes(panels: Floats, count: int) -> Iterator[tuple[Floats, Floats]]:
    """Blocks of frequencies and weights of a quadrature rule with several nodes on every panel."""
    node, weight = np.polynomial.legendre.leggauss(count)
    half = 0.5 * np.diff(panels)[:, None]
    frequency = (panels[:-1, None] + half * (1.0 + node)).ravel()
    weights = (half * weight).ravel()
    for begin in range(0, frequency.size, BLOCK):
        check_stop()
        yield frequency[begin : begin + BLOCK], weights[begin : begin + BLOCK]


def gapping_of_motion(settings: Run, motion: RunMotion, level: float | None) -> SnubberEntries:
    """Factors on the input at which the linear motion changes contact, from its extremes."""
    system, count = motion.system, len(motion.system.snubbers)
    contacts = system.dynamics.contacts
    penetration = static_penetration(system)
    resting, pressed = contacts.resting_phases(penetration), pressed_phases(system, penetration)
    unchanged = motion.work.events == 0 and motion.extremes.keys() >= {
        key for key in _WATCHED if system.channels.of_keys(key).channels
    }
    at_rest = motion.extremes if unchanged else _linear_motion(system, settings, resting)
    same = bool(np.array_equal(resting[:count], pressed[:count]))
    shut = at_rest if same else _linear_motion(system, settings, pressed)
    if at_rest is None or shut is None:
        return {}
    factors = _factors(system, penetration, at_rest)
    changes: list[dict[str, Any]] = [
        {"share_of_level": factor} | ({} if level is None else {"level": factor * abs(level)}) | {"time_s": time}
        for factor, time in factors
    ]

    def needed(linear: Extremes) -> list[float]:
        """Contact forces at rest that a linear motion just keeps positive, N."""
        laws = enumerate(zip(contacts.laws[:count], penetration.tolist(), strict=False))
        return [
            max(law.stiffness * rest - float(linear[FORCE][0, j]), 0.0)
            if law.one_sided_springs is None
            else law.stiffness * max(rest - float(linear[PENETRATION][0, j]), 0.0)
            for j, (law, rest) in laws
        ]

    return _by_snubber(system, "share_of_level", changes, needed(shut), None if same else needed(at_rest))


def _by_snubber(
    system: StructuralSystem,
    measure: str,
    changes: Sequence[dict[str, Any]],
    preloads_together: Sequence[float],
    preloads_alone: Sequence[float] | None,
) -> SnubberEntries:
    """Assemble the summary entry ``gapping``.

    Parameters
    ----------
    system : system of the contacts.
    measure : name of the value that orders the contact changes.
    changes : predicted contact change of each contact.
    preloads_together, preloads_alone : preloads that keep each snubber closed, N: with all snubbers closed, and with
        the others as they
    are at rest; None if these are the same.

    Returns
    -------
    By snubber, without snubbers with laws other than stiffness and dashpot.
    """
    closed, of_snubber = static_penetration(system) > 0, {}
    for j, snubber in enumerate(system.snubbers):
        law = system.dynamics.contacts.laws[j]
        if law.linear_in_contact:
            kept = 0.0 if law.latches else 1.0  # a latch needs no preload
            others = preloads_together[j] if preloads_alone is None else preloads_alone[j] if closed[j] else math.nan
            preloads = {"preload_n": kept * preloads_together[j], "preload_alone_n": kept * others}
            of_snubber[snubber.name] = {"closed_at_rest": bool(closed[j])} | changes[j] | preloads
    measures = {name: of[measure] for name, of in of_snubber.items()}
    return order_by_level(of_snubber, measures, min(of[measure] for of in changes)) if of_snubber else {}


def _factors(system: StructuralSystem, penetration: Floats, linear: Extremes) -> list[tuple[float, float]]:
    """Smallest factor on the input at which each contact leaves its phase, and the time; inf if there is none.

    Parameters
    ----------
    system : system of the contacts.
    penetration : (m,) penetrations at rest, m.
    linear : extremes of the motion in which all contacts keep their phases.
    """
    extreme = {
        (channel.section, channel.quantity, channel.name): linear[key][:, k].tolist()
        for key in _WATCHED
        for k, channel in enumerate(system.channels.of_keys(key).channels)
    }
    springs = [spring for spring in system.springs if spring.law is not None]
    owners = [(*PENETRATION, snubber.name) for snubber in system.snubbers]
    owners += [("friction" if spring.kind == "friction" else "springs", "extension", spring.name) for spring in springs]
    factors = []
    for owner, law, rest in zip(owners, system.dynamics.contacts.laws, penetration.tolist(), strict=True):
        found = [(math.inf, math.nan)]
        for border in law.boundaries(rest):
            low, low_at, high, high_at = extreme[(*FORCE, owner[-1]) if border.is_force else owner]
            far, at = (high, high_at) if border.direction > 0 else (low, low_at)
            excursion = border.direction * (far - border.value_at_rest)
            if excursion > ALWAYS_CLOSED * abs(border.value_at_rest):
                found.append((border.distance / excursion, at))
        factors.append(min(found))
    return factors


def _linear_motion(system: StructuralSystem, settings: Run, phases: Ints) -> Extremes | None:
    """Extremes of the motion from equilibrium in which all contacts keep their phases; None if it was interrupted."""
    contacts = system.dynamics.contacts
    laws = tuple(
        replace(law, phases=(replace(law.phases[phase], guards=()),), start=0)
        for law, phase in zip(contacts.laws, phases.tolist(), strict=True)
    )
    linear = replace(system, dynamics=replace(system.dynamics, contacts=replace(contacts, laws=laws)))
    flow = exact_flow(linear, settings.duration, settings.most_contact_states, memory=settings.memory)
    trajectory = simulate(flow, system.initial_state, max_events=settings.max_events)
    if not trajectory.outcome.complete:
        return None
    channels = linear.channels.of_keys(*_WATCHED)
    return channels.split(np.array(channel_extrema(trajectory, channels)[:4]))


def gapping_of_random(system: StructuralSystem) -> SnubberEntries:
    """Number of standard deviations of the stationary linear motion at which contact changes."""
    driven = linear_inputs(system)
    if not driven:
        return {}
    contacts = system.dynamics.contacts
    penetration = static_penetration(system)
    resting, pressed = contacts.resting_phases(penetration), pressed_phases(system, penetration)
    at_rest = stationary_deviations(driven, resting)
    shut = at_rest if np.array_equal(resting, pressed) else stationary_deviations(driven, pressed)
    if at_rest is None or shut is None:  # an undamped resonance within the band
        return {}
    names = [snubber.name for snubber in system.snubbers]

    def deviations_to_contact(name: str, law: ContactLaw, rest: float) -> float:
        """Standard deviations."""
        of_borders = [
            (b.distance, at_rest[name, "force" if b.is_force else "penetration"]) for b in law.boundaries(rest)
        ]
        return min(distance / deviation if deviation > 0 else math.inf for distance, deviation in of_borders)

    def needed(deviations: Deviations) -> list[float]:
        """Contact forces at rest, N; a contact with tension is lost by the force of the spring alone."""
        laws = zip(names, contacts.laws, strict=True)
        return [
            SIGMAS
            * (
                deviations[name, "force"]
                if law.one_sided_springs is None
                else law.stiffness * deviations[name, "penetration"]
            )
            for name, law in laws
        ]

    each = zip(names, contacts.laws, penetration.tolist(), strict=True)
    changes = [{"sigmas": deviations_to_contact(name, law, rest)} for name, law, rest in each]
    return _by_snubber(system, "sigmas", changes, needed(shut), None if shut is at_rest else needed(at_rest))
