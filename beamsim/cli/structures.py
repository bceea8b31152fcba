"""The commands ``check`` and ``export-structure``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, cast

import typer

from beamsim.cli.failures import guarded
from beamsim.cli.options import Case, Debug, Json, Output, Overrides

if TYPE_CHECKING:
    from beamsim.scenario.matrices import UnitSystem


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.command("check")(check)
    app.command("export-structure")(export_structure)


@guarded
def check(case: Case, set_: Overrides = None, json: Json = False, debug: Debug = False) -> None:
    """Check the matrices of each body. Mass, rigid motions, symmetry, frequencies. Exit code 3 if a check fails."""
    from beamsim.analyses.check.analysis import FAILS
    from beamsim.analyses.check.analysis import check as check_bodies
    from beamsim.cli.conclusion import located
    from beamsim.cli.printing import print_json, print_table
    from beamsim.cli.progress import progress_of
    from beamsim.errors import ExitCode
    from beamsim.scenario import load_scenario

    scenario = load_scenario(case, set_ or ())
    with located(scenario), progress_of(f"checking {case.name}", shown=not json):
        bodies = check_bodies(scenario)
    failed = [row.name for rows in bodies.values() for row in rows if row.verdict == FAILS]
    if json:
        print_json(
            {
                "bodies": {
                    name: {row.name: {"value": row.value, "verdict": row.verdict} for row in rows}
                    for name, rows in bodies.items()
                },
                "failed": failed,
            }
        )
    else:
        for name, rows in bodies.items():
            print_table(name, [(row.name.replace("_", " "), f"{row.verdict:<6}{row.text}") for row in rows])
    if failed:
        raise typer.Exit(ExitCode.NOT_CONVERGED)


@guarded
def export_structure(
    case: Case,
    set_: Overrides = None,
    output: Output = None,
    body: Annotated[str | None, typer.Option("--body", help="Write one body by itself, without its joints.")] = None,
    modes: Annotated[
        int | None,
        typer.Option(
            "--modes",
            min=1,
            help="Write a Craig-Bampton model with this many modes; its boundary is where something acts.",
        ),
    ] = None,
    units: Annotated[
        str, typer.Option("--units", help="Units of the files: SI, mm-t-s, mm-kg-ms, in-lbf-s, ... as in the scenario.")
    ] = "SI",
    binary: Annotated[bool, typer.Option("--binary", help="Write OP4 in binary instead of ASCII.")] = False,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Write the matrices of the structure. OP4 (default), MATLAB, MatrixMarket or NumPy files, and a table of nodes."""
    from beamsim.cli.conclusion import located
    from beamsim.cli.output import output_file
    from beamsim.cli.printing import print_json
    from beamsim.cli.progress import progress_of
    from beamsim.cli.structure_export import exported
    from beamsim.errors import Problem, ScenarioError
    from beamsim.matrix_files.formats import ENDINGS, FORMATS
    from beamsim.scenario import load_scenario
    from beamsim.scenario.matrices import SYSTEMS

    if units not in SYSTEMS:
        raise ScenarioError(Problem("--units", f"{units} is no system of units", f"give one of {', '.join(SYSTEMS)}"))
    if output is not None and output.suffix.lower() in {*FORMATS} - {*ENDINGS} and not output.is_dir():
        message = f"{output} is of a format that is read, not written"
        raise ScenarioError(Problem("-o", message, f"give a name that ends with {', '.join(ENDINGS)}"))
    scenario = load_scenario(case, set_ or ())
    target = output_file(output, f"{case.stem}_matrices", *ENDINGS)
    with located(scenario), progress_of(f"exporting the structure of {case.name}", shown=not json):
        files, text = exported(scenario, body, target, binary=binary, modes=modes, units=cast("UnitSystem", units))
    if json:
        print_json({"files": [str(file) for file in files], "body": text})
    else:
        print(*files, sep="\n")
        print(text)
