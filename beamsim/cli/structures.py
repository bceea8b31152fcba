"""Commands ``check`` and ``export-structure``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import cast

import numpy as np

from beamsim.cli.session import CommandOptions, load_case, print_json, progress_of, show
from beamsim.cli.tables import print_table
from beamsim.errors import MethodError, Problem, ScenarioError, VerdictError
from beamsim.files import output_file, replacement_file
from beamsim.matrix_files import ENDINGS, FORMATS, write_matrices
from beamsim.outcomes import Outcome, OutcomeKind, exit_code
from beamsim.scenario import Scenario
from beamsim.scenario.base import suggestion
from beamsim.scenario.matrices import SYSTEMS, UnitSystem
from beamsim.structures.assembly import acting_places, assemble, bodies_of
from beamsim.structures.check import FAILS
from beamsim.structures.check import check as check_bodies
from beamsim.structures.exported import boundary_rows, craig_bampton, named_structure, row_at, unit_row
from beamsim.structures.named_matrices import NamedMatrices, in_units, write_dof_table
from beamsim.structures.places import Place
from beamsim.structures.structure import BodyStructure


def check(options: CommandOptions) -> None:
    """Check the matrices of each body.

    Raises
    ------
    ScenarioError
        If the scenario is invalid.
    VerdictError
        If a check fails.
    """
    scenario = load_case(options)
    with scenario.locating(), progress_of(f"checking {options.case.name}", shown=not options.json):
        bodies = check_bodies(scenario)
    failed = [row.name for rows in bodies.values() for row in rows if row.verdict == FAILS]
    if options.json:
        found = {
            name: {row.name: {"value": row.value, "verdict": row.verdict} for row in rows}
            for name, rows in bodies.items()
        }
        print_json({"bodies": found, "failed": failed})
    else:
        for name, rows in bodies.items():
            print_table(name, [(row.name.replace("_", " "), f"{row.verdict:<6}{row.text}") for row in rows])
    if failed:
        outcome = Outcome.of(OutcomeKind.UNTRUSTED, "checks_failed", ", ".join(failed).replace("_", " "))
        raise VerdictError(outcome.text, exit_code(outcome))


def export(options: CommandOptions, body: str | None, modes: int | None, units: str, *, binary: bool) -> None:
    """Write the matrices of the structure.

    Parameters
    ----------
    options : shared options.
    body, modes, units, binary : see `write_export`.

    Raises
    ------
    ScenarioError
        If the scenario or an option is invalid.
    """
    case, output = options.case, options.output
    if units not in SYSTEMS:
        problem = Problem("--units", f"{units} is not a system of units", f"give one of {', '.join(SYSTEMS)}")
        raise ScenarioError(problem)
    if output is not None and output.suffix.lower() in {*FORMATS} - {*ENDINGS} and not output.is_dir():
        message = f"{output} has a format that can only be read"
        raise ScenarioError(Problem("-o", message, f"give a name that ends with {', '.join(ENDINGS)}"))
    scenario = load_case(options)
    target = output_file(output, f"{case.stem}_matrices", *ENDINGS)
    with scenario.locating(), progress_of(f"exporting the structure of {case.name}", shown=not options.json):
        files, text = write_export(scenario, target, body, modes, units, binary=binary)
    if options.json:
        print_json({"files": [str(file) for file in files], "body": text})
    else:
        show(*files, text)


def write_export(
    scenario: Scenario, target: Path, body: str | None = None, modes: int | None = None, units: str = "SI", *,
    binary: bool = False,
) -> tuple[list[Path], str]:  # fmt: skip
    """Write the matrices and the table of degrees of freedom.

    Parameters
    ----------
    scenario : scenario with the structure.
    target : file of the matrices; the table is written to the same folder.
    body : body to write without its joints; None for the whole structure.
    modes : number of modes of a Craig-Bampton model, with its boundary at all loads and contacts; None: all nodes.
    units : units of matrices and coordinates.
    binary : True for binary OP4.

    Returns
    -------
    The files, and the text of a scenario with the body.

    Raises
    ------
    ScenarioError
        If no body has this name, or the Craig-Bampton model is not possible.
    MethodError
        If OP4 is requested and pyYeti is not installed.
    ResultFileError
        If a file cannot be written.
    """
    name, named, places = _matrices(scenario, body, modes)
    named = in_units(named, SYSTEMS[cast("UnitSystem", units)])
    matrices = {"mass": named.mass, "stiff": named.stiffness}
    if named.damping is not None:
        matrices["viscous"] = named.damping
    written = write_matrices(target, matrices, binary=binary)
    table = target.with_name(f"{target.stem}_dofs.csv")
    with replacement_file(table) as temporary:
        write_dof_table(temporary, named.table)
    lines = ["bodies:", f"  {name}:", "    kind: matrices"]
    for key, matrix in (("mass", "mass"), ("stiffness", "stiff"), ("viscous", "viscous")):
        if matrix in written:
            file = written[matrix]
            matrix_name = f", name: {matrix}" if file == target else ""  # if the file has several
            lines.append(f"    {key}: {{file: {file.name}{matrix_name}}}")
    base = f"{{nodes: [{', '.join(map(str, named.base))}], direction: {named.direction}}}" if named.base else "free"
    stated = [] if units == "SI" else [f"    units: {units}"]
    lines += [f"    dofs: {table.name}", *stated, f"    base: {base}"]
    lines += [f"# {label}: {place}" for label, place in places.items()]
    return [*dict.fromkeys(written.values()), table], "\n".join(lines)


def _with_base_nodes(
    body: BodyStructure, places: Sequence[Place], modes: int | None
) -> tuple[NamedMatrices, dict[str, str]]:
    """Matrices of a body whose supports are nodes with all directions, and the new references to places on it."""
    named, rows, nodes = body.named_matrices, set[int](), {}
    for place in places:
        row = unit_row(body.unsupported_row(place))
        if row is None and modes is not None:
            raise ScenarioError(f"--modes needs nodes where something acts; {place.label} is not at a node")
        node, direction = ("", "") if row is None else named.table.dofs[row]
        nodes[place.label] = "between nodes" if row is None else f"{{node: {node}, direction: {direction}}}"
        rows |= set() if row is None else {row}
    if modes is None:
        return named, nodes
    boundary = np.array(sorted(rows | set(named.table.rows_of(named.base).tolist())), dtype=np.int64)
    try:
        return craig_bampton(named, boundary, modes), nodes
    except MethodError as error:
        raise ScenarioError(f"{error.about} {error.message}; {error.remedy}") from None


def _matrices(scenario: Scenario, name: str | None, modes: int | None) -> tuple[str, NamedMatrices, dict[str, str]]:
    """Name and matrices of one body or of the structure, and the new references to places on it."""
    bodies = {body.name: body for body in bodies_of(scenario)}
    if name is not None and name not in bodies:
        raise ScenarioError(f"--body {name} is an unknown body; {suggestion(name, bodies, 'the bodies are')}")
    if name is None and len(bodies) == 1:
        name = next(iter(bodies))
    if name is not None and modes is None and scenario.all_bodies[name].is_read_from_files:
        return name, bodies[name].named_matrices, {}  # its nodes keep their numbers
    if name is not None and bodies[name].has_base_nodes:
        return name, *_with_base_nodes(bodies[name], [p for p in acting_places(scenario) if p.body == name], modes)
    structure = assemble(scenario) if name is None else bodies[name]
    places = [place for place in acting_places(scenario) if name is None or place.body == name]
    try:
        named, to_named = named_structure(structure)
        nodes = {}
        for place in places:
            row = row_at(structure, to_named, place)
            node, direction = ("", "") if row is None else named.table.dofs[row]
            nodes[place.label] = f"{{node: {node}, direction: {direction}}}" if row is not None else "between nodes"
        if modes is not None:
            named = craig_bampton(named, boundary_rows(structure, named, to_named, places), modes)
        return name or "structure", named, nodes
    except MethodError as error:
        raise ScenarioError(f"{error.about} {error.message}; {error.remedy}") from None
