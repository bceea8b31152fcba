"""The flow of a run, and what of it fits into the memory."""

from __future__ import annotations

from beamsim.errors import Problem, ScenarioError
from beamsim.flow.exact import ExactFlow, states_in_memory
from beamsim.inputs.streamed import StreamedSignal, common_record
from beamsim.system.structural import StructuralSystem

MOST_PIECES = 4_000_000  # of an input, in motions that are kept as a whole
MEMORY = 2e9  # bytes, that a run may keep unless it says otherwise
TABLES_SHARE, MOTION_SHARE = 0.2, 0.5  # of it: tables of contact states, the motion between events


def events_in_memory(flow: ExactFlow, memory: float) -> int:
    """Number of events that fit into the share of ``memory``, bytes, of the motion between them; joined, it is there
    twice."""
    return int(MOTION_SHARE * memory / (2 * 8 * (flow.size + 8)))


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
