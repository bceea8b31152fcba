"""What ``export-structure`` writes and prints."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from beamsim.errors import MethodError, ScenarioError
from beamsim.files import replacing
from beamsim.matrix_files.formats import write_matrices
from beamsim.scenario.base import suggestion
from beamsim.scenario.matrices import SYSTEMS
from beamsim.structures.assembly import acting_places, assemble, bodies_of
from beamsim.structures.converted import in_units
from beamsim.structures.dof_table import write_dof_table
from beamsim.structures.exported import boundary_rows, craig_bampton, named_structure, row_at

if TYPE_CHECKING:
    from beamsim.scenario import Scenario
    from beamsim.scenario.matrices import UnitSystem
    from beamsim.structures.named_matrices import NamedMatrices


def exported(
    scenario: Scenario, name: str | None, target: Path, *, binary: bool, modes: int | None, units: UnitSystem = "SI"
) -> tuple[list[Path], str]:
    """Write matrices and table; the files, and the body as a scenario has it.

    Parameters
    ----------
    name : of one body by itself, without its joints; None for the whole structure.
    modes : of a Craig-Bampton model, whose boundary is where something acts or is recorded; None for all nodes.
    units : of matrices and coordinates.

    Raises
    ------
    ScenarioError
        If no body has this name, or there is no such Craig-Bampton model.
    """
    called, given, places = _matrices(scenario, name, modes)
    given = in_units(given, SYSTEMS[units])
    matrices = {"mass": given.mass, "stiff": given.stiffness}
    if given.damping is not None:
        matrices["viscous"] = given.damping
    written = write_matrices(target, matrices, binary=binary)
    table = target.with_name(f"{target.stem}_dofs.csv")
    with replacing(table) as temporary:
        write_dof_table(temporary, given.table)
    lines = ["bodies:", f"  {called}:", "    kind: matrices"]
    for key, matrix in (("mass", "mass"), ("stiffness", "stiff"), ("viscous", "viscous")):
        if matrix in written:
            file = written[matrix]
            named = f", name: {matrix}" if file == target else ""  # where it holds several
            lines.append(f"    {key}: {{file: {file.name}{named}}}")
    base = f"{{nodes: [{', '.join(map(str, given.base))}], direction: {given.direction}}}" if given.base else "free"
    stated = [] if units == "SI" else [f"    units: {units}"]
    lines += [f"    dofs: {table.name}", *stated, f"    base: {base}"]
    lines += [f"# {label}: {place}" for label, place in places.items()]
    return [*dict.fromkeys(written.values()), table], "\n".join(lines)


def _matrices(scenario: Scenario, name: str | None, modes: int | None) -> tuple[str, NamedMatrices, dict[str, str]]:
    """Name and matrices of one body, or of the structure, and how places on it are written now."""
    bodies = {body.name: body for body in bodies_of(scenario)}
    if name is not None and name not in bodies:
        raise ScenarioError(f"--body {name} is an unknown body; {suggestion(name, bodies, 'the bodies are')}")
    if name is None and len(bodies) == 1:
        name = next(iter(bodies))
    if name is not None and modes is None and scenario.all_bodies[name].is_read_from_files:
        return name, bodies[name].named_matrices, {}  # whose nodes keep their numbers
    structure = assemble(scenario) if name is None else bodies[name]
    places = [place for place in acting_places(scenario) if name is None or place.body == name]
    try:
        given, to_named = named_structure(structure)
        nodes = {}
        for place in places:
            row = row_at(structure, to_named, place)
            node, direction = ("", "") if row is None else given.table.dofs[row]
            nodes[place.label] = f"{{node: {node}, direction: {direction}}}" if row is not None else "between nodes"
        if modes is not None:
            given = craig_bampton(given, boundary_rows(structure, given, to_named, places), modes)
        return name or "structure", given, nodes
    except MethodError as error:
        raise ScenarioError(f"{error.about} {error.message}; {error.remedy}") from None
