"""What ``export-structure`` writes and prints."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from beamsim.errors import ScenarioError
from beamsim.files import replacing
from beamsim.matrix_files.write import write_matrices
from beamsim.scenario.base import suggestion
from beamsim.structures.assembly import bodies_of
from beamsim.structures.dof_table import write_dof_table

if TYPE_CHECKING:
    from beamsim.scenario import Scenario


def exported(scenario: Scenario, name: str | None, target: Path, *, binary: bool) -> tuple[list[Path], str]:
    """Write matrices and table; the files, and the body as a scenario has it.

    Raises
    ------
    ScenarioError
        If there are several bodies and none is named, or none has this name.
    """
    bodies = {body.name: body for body in bodies_of(scenario)}
    if name is None and len(bodies) > 1:
        raise ScenarioError(f"there are several bodies; choose one with --body: {', '.join(bodies)}")
    if name is not None and name not in bodies:
        raise ScenarioError(f"--body {name} is an unknown body; {suggestion(name, bodies, 'the bodies are')}")
    body = bodies[name] if name is not None else next(iter(bodies.values()))
    given = body.named_matrices
    matrices = {"mass": given.mass, "stiff": given.stiffness}
    if given.damping is not None:
        matrices["viscous"] = given.damping
    written = write_matrices(target, matrices, binary=binary, replacing=replacing)
    table = target.with_name(f"{target.stem}_dofs.csv")
    with replacing(table) as temporary:
        write_dof_table(temporary, given.table)
    lines = ["bodies:", f"  {body.name}:", "    kind: matrices"]
    for key, matrix in (("mass", "mass"), ("stiffness", "stiff"), ("viscous", "viscous")):
        if matrix in written:
            file, called = written[matrix]
            lines.append(f"    {key}: {{file: {file.name}{f', name: {called}' if called else ''}}}")
    base = f"{{nodes: [{', '.join(map(str, given.base))}], direction: {given.direction}}}" if given.base else "free"
    lines += [f"    dofs: {table.name}", f"    base: {base}"]
    return [*dict.fromkeys(file for file, _ in written.values()), table], "\n".join(lines)
