r"""Standard deviations of the linear structures between which contact switches, under the density of a random input.

With every snubber always open, or always closed as if it were glued, the stationary response has the variance
:math:`\int |H|^2 S df`, with S the density of the input. Beside the figures of the run they show how much the stops
change. The integral is taken by Gauss-Legendre rules on panels that are short near the resonances, where the integrand
varies over a half-power bandwidth; its error is below 1e-6.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from beamsim.analyses.gapping import pressed_phases, static_penetration, transfer
from beamsim.analyses.run.result import MAIN_QUANTITY
from beamsim.inputs.random_input import density
from beamsim.scenario import Scenario
from beamsim.scenario.excitation import RandomInput
from beamsim.system.equations import SineLoads
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, Ints

NODES = 8
NODES_OF_BINS = 3  # whose means are drawn
GROWTH = 4.0  # of the distance from a resonance, from panel to panel
BLOCK = 256  # frequencies at a time
UNDAMPED = 1e-9  # half-power bandwidth over frequency

Deviations = dict[tuple[str, str], float]  # by name and quantity


class LinearInput(NamedTuple):
    """A structure with one random input."""

    system: StructuralSystem  # whose loads follow a sine
    frequency_hz: Floats  # (p,) of the points of the density
    density: Floats  # (p,) SI


def linear_input(scenario: Scenario, system: StructuralSystem) -> LinearInput | None:
    """The structure and its input; None where the input is not one random base motion or force.

    Nor where there is no snubber, or a nonlinear spring or friction beside them.
    """
    excitation = scenario.excitation
    alone = system.base_acceleration is not None or system.forcing.load.shape[0] == 1
    linear = not system.cubic.count and not system.springs and not system.dynamics.contacts.ever_hold
    if not isinstance(excitation, RandomInput) or not alone or not linear or not system.snubbers:
        return None
    at = np.array([point.frequency for point in excitation.psd])
    value = np.array([point.density for point in excitation.psd])
    loads = system.forcing.load.shape[0]  # of the base: its acceleration, and its displacement where springs feel it
    sine = SineLoads(np.ones(loads, dtype=complex), np.array([0, -2])[:loads])
    return LinearInput(replace(system, sine=sine), at, value)


class LinearStructures(NamedTuple):
    """The linear structures between which contact switches: every snubber always open, and always closed."""

    driven: LinearInput
    open_phases: Ints
    closed_phases: Ints
    of_open: Deviations
    of_closed: Deviations

    def densities(self, frequency_hz: Floats) -> tuple[dict[tuple[str, str], Floats], dict[tuple[str, str], Floats]]:
        """Densities of both, means about evenly spaced frequencies (F,), Hz."""
        half = 0.5 * (frequency_hz[1] - frequency_hz[0])
        edges = np.append(np.maximum(frequency_hz - half, 0.0), frequency_hz[-1] + half)
        of_open = stationary_densities(self.driven, self.open_phases, edges)
        of_closed = stationary_densities(self.driven, self.closed_phases, edges)
        assert of_open is not None  # as neither has an undamped resonance
        assert of_closed is not None
        return of_open, of_closed


def linear_structures(scenario: Scenario, system: StructuralSystem) -> LinearStructures | None:
    """The structures with their standard deviations, SI.

    None where there is no `linear_input`, and where one of the two structures has an undamped resonance within the
    input's band. A snubber with a table has the slope at its static penetration, or its first one.
    """
    driven = linear_input(scenario, system)
    if driven is None:
        return None
    contacts = system.dynamics.contacts
    pressed = pressed_phases(system, static_penetration(system))
    of_open = stationary_deviations(driven, contacts.start)
    of_closed = None if of_open is None else stationary_deviations(driven, pressed)
    if of_open is None or of_closed is None:
        return None
    return LinearStructures(driven, contacts.start, pressed, of_open, of_closed)


def stationary_deviations(driven: LinearInput, phases: Ints) -> Deviations | None:
    """Standard deviations with all contacts staying in phases (m,); None with an undamped resonance in the band."""
    panels = _panels(driven.system, phases, driven.frequency_hz)
    return None if panels is None else _deviations(driven, phases, panels)


def _panels(system: StructuralSystem, phases: Ints, at_hz: Floats) -> Floats | None:
    """(P + 1,) Hz, ends of panels on each of which density and response are smooth; None where they have no limit."""
    dynamics, shape, n = system.dynamics, system.dynamics.contacts.shape, system.dynamics.size
    pushed = dynamics.contacts.dynamic_stiffness(phases, np.ones(1))[0]  # that of Maxwell branches: of slow motions
    stiffness = np.diag(dynamics.stiffness) + (shape.T * pushed.real) @ shape
    damping = dynamics.damping + (shape.T * pushed.imag) @ shape
    poles = np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]])) / (2 * np.pi)
    low, high = float(at_hz[0]), float(at_hz[-1])
    octaves = np.geomspace(low, high, max(int(np.ceil(np.log2(high / low))), 1) + 1)
    ends = [at_hz, octaves]
    for pole in poles[poles.imag > 0]:
        centre, width = float(pole.imag), abs(float(pole.real))
        if width < UNDAMPED * centre:
            if low <= centre <= high:
                return None
            continue
        distances = width * GROWTH ** np.arange(max(np.ceil(np.log(high / width) / np.log(GROWTH)), 0) + 1)
        ends += [centre - distances, centre + distances]
    inside = np.concatenate(ends)
    return np.unique(np.clip(inside, low, high))


def _deviations(driven: LinearInput, phases: Ints, panels: Floats) -> Deviations:
    names = _names(driven.system)
    variance = np.zeros(len(names))
    for frequency, weight in _nodes(panels, NODES):
        power = weight * density(frequency, driven.frequency_hz, driven.density)
        variance += power @ _squared_responses(driven.system, phases, frequency)
    return dict(zip(names, np.sqrt(variance).tolist(), strict=True))


def _names(system: StructuralSystem) -> list[tuple[str, str]]:
    """Of the responses in order."""
    names = [(probe.name, quantity) for quantity in ("displacement", MAIN_QUANTITY) for probe in system.probes]
    return names + [(snubber.name, quantity) for quantity in ("force", "penetration") for snubber in system.snubbers]


def _squared_responses(system: StructuralSystem, phases: Ints, frequency: Floats) -> Floats:
    """(F, k) squared magnitudes for a unit of the input."""
    contacts, snubbers = system.dynamics.contacts, slice(len(system.snubbers))
    rows = np.array([probe.shape for probe in system.probes]).reshape(-1, system.dynamics.size)
    omega = 2 * np.pi * frequency[:, None]
    moved = transfer(system, frequency, phases)
    displacement = moved @ rows.T
    stretch = moved @ contacts.shape.T
    if system.base_acceleration is not None:
        stretch = stretch - contacts.felt / omega**2
    force = (contacts.dynamic_stiffness(phases, omega[:, 0]) * stretch)[:, snubbers]
    responses = np.hstack([displacement, system.carried - omega**2 * displacement, force, stretch[:, snubbers]])
    return np.asarray(np.abs(responses) ** 2)


def stationary_densities(driven: LinearInput, phases: Ints, edges: Floats) -> dict[tuple[str, str], Floats] | None:
    """(B,) densities, SI, by name and quantity: their means between the edges (B + 1,), Hz, 0 outside the input's band.

    All contacts stay in phases (m,). None with an undamped resonance within the band.
    """
    panels = _panels(driven.system, phases, driven.frequency_hz)
    if panels is None:
        return None
    inside = edges[(edges > panels[0]) & (edges < panels[-1])]
    names = _names(driven.system)
    power = np.zeros((edges.size - 1, len(names)))
    for frequency, weight in _nodes(np.unique(np.concatenate([panels, inside])), NODES_OF_BINS):
        within = weight * density(frequency, driven.frequency_hz, driven.density)
        bins = np.clip(np.searchsorted(edges, frequency) - 1, 0, edges.size - 2)
        np.add.at(power, bins, within[:, None] * _squared_responses(driven.system, phases, frequency))
    return dict(zip(names, (power / np.diff(edges)[:, None]).T, strict=True))


def _nodes(panels: Floats, count: int) -> Iterator[tuple[Floats, Floats]]:
    """Blocks of frequencies and weights of the rule with some nodes on every panel."""
    node, weight = np.polynomial.legendre.leggauss(count)
    half = 0.5 * np.diff(panels)[:, None]
    frequency = (panels[:-1, None] + half * (1.0 + node)).ravel()
    weights = (half * weight).ravel()
    for begin in range(0, frequency.size, BLOCK):
        yield frequency[begin : begin + BLOCK], weights[begin : begin + BLOCK]
