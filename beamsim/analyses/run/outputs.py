"""The quantities a run reports, as linear outputs of the state and the inputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from beamsim.contacts.springs import SpringInfo
from beamsim.errors import Problem, ScenarioError
from beamsim.flow.contact_state import LinearOutput, OutputOf
from beamsim.flow.exact import ExactFlow, states_in_memory
from beamsim.inputs.streamed import StreamedSignal, common_record
from beamsim.structures.stations import StressRows
from beamsim.system.outputs import OutputRows
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, Ints

MOST_PIECES = 4_000_000  # of an input, in motions that are kept as a whole
MEMORY = 2e9  # bytes, that a run may keep unless it says otherwise
TABLES_SHARE, MOTION_SHARE = 0.2, 0.5  # of it: tables of contact states, the motion between events

SEARCHED = (  # for their extremes
    "displacement", "acceleration", "force", "penetration", "stretch", "spring_force", "output",
)  # fmt: skip


def displacements(flow: ExactFlow, shape: Floats) -> LinearOutput:
    """``shape @ q`` for every row of ``shape`` (k, n)."""
    output = flow.empty_output(shape.shape[0])
    output.row[:, : flow.system.size] = shape
    return output


def stretches(flow: ExactFlow, springs: Sequence[SpringInfo]) -> LinearOutput:
    """Stretch of nonlinear springs; to the ground absolute, as far as the flow knows the base's displacement."""
    output = displacements(flow, np.array([s.shape for s in springs]).reshape(-1, flow.system.size))
    if flow.base_channel >= 0:
        base = flow.sources.channel == flow.base_channel
        output.direct[:, base] += np.array([s.felt for s in springs])[:, None]
    return output


def events_in_memory(flow: ExactFlow, memory: float) -> int:
    """Number of events that fit into the share of ``memory``, bytes, of the motion between them; joined, it is there
    twice."""
    return int(MOTION_SHARE * memory / (2 * 8 * (flow.size + 8)))


def velocities(flow: ExactFlow, shape: Floats) -> LinearOutput:
    """``shape @ q'`` for every row of ``shape`` (k, n)."""
    output = flow.empty_output(shape.shape[0])
    output.row[:, flow.system.size : 2 * flow.system.size] = shape
    return output


def accelerations(flow: ExactFlow, shape: Floats, phases: Ints, carried: Floats | None = None) -> LinearOutput:
    """``shape @ q''`` from the equation of motion, and ``carried`` (k,) times the base's acceleration, observer 0."""
    output = flow.empty_output(shape.shape[0])
    n = flow.system.size
    stiffness, damping, internal, load, load_slope = flow.equation_of_motion(phases)
    output.row[:, :n] = -shape @ stiffness
    output.row[:, n : 2 * n] = -shape @ damping
    output.row[:, 2 * n :] = shape @ internal
    output.direct[:] = shape @ load.T
    output.direct_slope[:] = shape @ load_slope.T
    if carried is not None and flow.observers:
        output.direct[:, flow.sources.channel == flow.first_observer] += carried[:, None]
    return output


def bending_stress(flow: ExactFlow, stress: StressRows) -> LinearOutput:
    """Stress at the extreme fibre at every station that has one, Pa, from the base's acceleration (observer 0) too."""
    output = displacements(flow, stress.row)
    if flow.observers:
        base = flow.sources.channel == flow.first_observer
        output.direct[:, base] += stress.base[:, None]
    return output


def asked_for(flow: ExactFlow, rows: Sequence[OutputRows], phases: Ints) -> LinearOutput:
    """The outputs that a run asks for, all rows of one after those of the other."""
    n, forces = flow.system.size, flow.contact_forces(phases)
    displacement, velocity, acceleration, contact, load = (
        np.vstack([getattr(each, name) for each in rows])
        for name in ("displacement", "velocity", "acceleration", "contact", "load")
    )
    output = accelerations(flow, acceleration, phases) + forces.combined(contact)
    output.row[:, :n] += displacement
    output.row[:, n : 2 * n] += velocity
    output.direct[:, 0] += np.concatenate([each.constant for each in rows])
    for signal in range(load.shape[1]):
        output.direct[:, flow.sources.channel == signal] += load[:, signal : signal + 1]
    if flow.observers:
        base = np.concatenate([each.base_acceleration for each in rows])
        output.direct[:, flow.sources.channel == flow.first_observer] += base[:, None]
    return output


def energies_of_rows(rows: Sequence[OutputRows], values: Floats) -> Floats:
    """(nt, outputs) energies from the values (nt, k) of all of their rows: half the sums of their squares."""
    ends = np.cumsum([each.count for each in rows])[:-1]
    return np.column_stack([0.5 * np.sum(part**2, axis=1) for part in np.split(values, ends, axis=1)])


def stack(*outputs: LinearOutput) -> LinearOutput:
    """One output with the rows of several."""
    return LinearOutput(
        np.concatenate([o.row for o in outputs]),
        np.concatenate([o.direct for o in outputs]),
        np.concatenate([o.direct_slope for o in outputs]),
    )


@dataclass(frozen=True)
class OutputSet:
    """Named groups of outputs, evaluated together; called with the phases of the contacts, all rows at once."""

    groups: dict[str, OutputOf]

    def __call__(self, phases: Ints) -> LinearOutput:
        """All groups' rows, stacked."""
        return stack(*(output_of(phases) for output_of in self.groups.values()))

    def split(self, values: Floats, phases: Ints) -> dict[str, Floats]:
        """The columns of ``values`` (nt, k) of each group."""
        sizes = [output_of(phases).row.shape[0] for output_of in self.groups.values()]
        parts = np.split(values, np.cumsum(sizes)[:-1], axis=1)
        return dict(zip(self.groups, parts, strict=True))


def exact_flow(
    system: StructuralSystem, duration: float, most_states: int | None = None, memory: float = MEMORY,
    pieces: tuple[int, int] | None = None,
) -> ExactFlow:  # fmt: skip
    """The exact flow of a built system; its first observer is the base's acceleration. ``pieces``: see `ExactFlow`.

    ``most_states`` contact states are kept at once, by default those that fit into their share of ``memory``, bytes.

    Raises
    ------
    ScenarioError
        For a record of too many pieces to be taken as a whole.
    """
    observers = () if system.base_acceleration is None else (system.base_acceleration,)
    most = most_states or states_in_memory(system.dynamics, TABLES_SHARE * memory)
    if pieces is None:
        for record in (s.record for s in (*system.forcing.signal, *observers) if isinstance(s, StreamedSignal)):
            if record.pieces > MOST_PIECES:
                raise ScenarioError(
                    Problem(
                        "excitation",
                        f"has {record.pieces:.3g} pieces, too many for this command or method (at most "
                        f"{MOST_PIECES:.0e})",
                        "shorten run.duration, or give a lower excitation.sample_rate; beamsim run with one random "
                        "excitation and method: exact takes any number",
                    )
                )
    return ExactFlow(system.dynamics, system.forcing, duration, observers, most, pieces)


def pieces_of(system: StructuralSystem) -> int:
    """Number of pieces of the record of which all loads are made; 0 where they are not made of one, or it is short."""
    record = common_record(system.forcing.signal)
    return 0 if record is None else record.pieces


def output_groups(system: StructuralSystem, flow: ExactFlow) -> OutputSet:
    """Everything that is sampled; the stress is only searched for extremes."""
    probe_shapes = np.array([p.shape for p in system.probes]).reshape(-1, flow.system.size)
    snubber_shapes = flow.system.contacts.shape
    penetration, _ = flow.penetrations
    fixed: dict[str, LinearOutput] = {
        "displacement": displacements(flow, probe_shapes),
        "velocity": velocities(flow, probe_shapes),
        "penetration": penetration,
        "snubber_displacement": displacements(flow, snubber_shapes),
        "snubber_velocity": velocities(flow, snubber_shapes),
    }
    if system.springs:
        fixed["stretch"] = stretches(flow, system.springs)
    groups = {name: in_every_state(output) for name, output in fixed.items()}
    groups["acceleration"] = lambda phases: accelerations(flow, probe_shapes, phases, system.carried)
    groups["force"] = flow.contact_forces
    if any(spring.relaxes for spring in system.springs):
        groups["spring_force"] = lambda phases: spring_forces(system, flow, phases)
    if system.linear_outputs:
        groups["output"] = lambda phases: asked_for(flow, system.linear_outputs, phases)
    if system.energy_outputs:
        groups["energy"] = lambda phases: asked_for(flow, system.energy_outputs, phases)
    return OutputSet(groups)


def searched_outputs(system: StructuralSystem, flow: ExactFlow, groups: OutputSet) -> dict[str, OutputOf]:
    """What is searched for its extremes: of what is sampled, and the stress."""
    searched = {name: groups.groups[name] for name in SEARCHED if name in groups.groups}
    if system.stress is not None:
        searched["stress"] = in_every_state(bending_stress(flow, system.stress))
    return searched


def spring_forces(system: StructuralSystem, flow: ExactFlow, phases: Ints) -> LinearOutput:
    """Forces of the springs with laws of phases, N, none of them cubic: of their linear part and their law."""
    stretch, of_law = stretches(flow, system.springs), flow.contact_forces(phases)
    linear = np.array([spring.linear for spring in system.springs])[:, None]
    return stretch.scaled(linear) + of_law.some(slice(len(system.snubbers), None))


def in_every_state(output: LinearOutput) -> OutputOf:
    """An output that does not depend on the contact state."""
    return lambda phases: output
