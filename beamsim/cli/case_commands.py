"""The commands around scenarios and structures: what they are given, each with the import of what does it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from beamsim.cli.options import Case, Debug, Json, Output, Overrides, Quiet
from beamsim.kinds import TemplateKind


def validate(
    case: Case,
    set_: Overrides = None,
    sketch: Annotated[
        bool, typer.Option("--sketch", help="Draw the model: bodies, supports, masses, springs and stops.")
    ] = False,
    output: Output = None,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Check a case without running it. Reports every problem with file, line and remedy."""
    from beamsim.cli import cases

    cases.validate(case, set_ or (), output, sketch=sketch, as_json=json)


def schema(output: Output = None, json: Json = False, debug: Debug = False) -> None:
    """Print the JSON Schema of scenario files. Editors complete and check them by it."""
    from beamsim.cli import cases

    cases.write_schema(output)


def new(
    file: Annotated[Path, typer.Argument(metavar="CASE.YAML", help="File to write.")] = Path("case.yaml"),
    kind: Annotated[TemplateKind, typer.Option("--kind", help="What to simulate.")] = TemplateKind.beam,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Write a commented scenario to start from. The schema by which editors check and complete it is put beside it."""
    from beamsim.cli import cases

    cases.write_template(file, kind, force=force, as_json=json)


def check(case: Case, set_: Overrides = None, json: Json = False, debug: Debug = False) -> None:
    """Check the matrices of each body. Mass, rigid motions, symmetry, frequencies. Exit code 3 if a check fails."""
    from beamsim.cli import structures

    structures.check(case, set_ or (), as_json=json)


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
    from beamsim.cli import structures

    form = structures.MatrixForm(body, modes, units, binary)
    structures.export(case, set_ or (), output, form, as_json=json)


def warmup(quiet: Quiet = False, json: Json = False, debug: Debug = False) -> None:
    """Compile the numerical kernels beforehand, for images and installers. Prints the folder where they are kept."""
    from beamsim.cli.warmup import compile_kernels

    compile_kernels(shown=not (quiet or json), as_json=json)


def _quantity(name: str, text: str) -> Any:
    return typer.Option(name, metavar="QUANTITY", help=text)


def pad(
    modulus: Annotated[str | None, _quantity("--modulus", "Young's modulus of the pad, e.g. '5 MPa'.")] = None,
    shape_factor: Annotated[
        str | None, _quantity("--shape-factor", "Loaded over free area of a pad whose faces are held; 0 by default.")
    ] = None,
    area: Annotated[str | None, _quantity("--area", "Loaded area, e.g. '4 cm^2'.")] = None,
    height: Annotated[str | None, _quantity("--height", "Height, e.g. '6 mm'.")] = None,
    factor: Annotated[str, _quantity("--kappa", "Factor of the shape factor: 1 soft rubber, 0.5 hard.")] = "1",
    bulk_modulus: Annotated[
        str | None, _quantity("--bulk-modulus", "Bulk modulus, for thin pads, e.g. '1.1 GPa'.")
    ] = None,
    curve: Annotated[Path | None, typer.Option("--curve", help="CSV file of force over deflection.")] = None,
    segments: Annotated[
        int, typer.Option("--segments", min=1, max=50, help="Number of straight lines fitted to the curve.")
    ] = 5,
    stiffness: Annotated[str | None, _quantity("--stiffness", "Stiffness, e.g. '150 kN/m'.")] = None,
    contact_time: Annotated[str | None, _quantity("--contact-time", "Duration of the contact, e.g. '3 ms'.")] = None,
    restitution: Annotated[str | None, _quantity("--restitution", "Coefficient of restitution of the mass.")] = None,
    dashpot: Annotated[str | None, _quantity("--dashpot", "Dashpot, e.g. '12 N s/m'.")] = None,
    loss_factor: Annotated[str | None, _quantity("--loss-factor", "Loss factor at --frequency.")] = None,
    frequency: Annotated[str | None, _quantity("--frequency", "Frequency of the loss factor, e.g. '120 Hz'.")] = None,
    mass: Annotated[str | None, _quantity("--mass", "Mass that the pad stops, e.g. '50 g'.")] = None,
    speed: Annotated[str | None, _quantity("--speed", "Speed of the mass, e.g. '0.3 m/s'.")] = None,
    no_tension: Annotated[
        bool, typer.Option("--no-tension", help="Write law: no_tension, of a pad that never pulls.")
    ] = False,
    name: Annotated[str, typer.Option("--name", help="Name of the snubber.")] = "pad",
    position: Annotated[str, _quantity("--position", "Where the snubber is on the beam.")] = "100 %",
    on_mass: Annotated[
        int | None, typer.Option("--on-mass", help="Number of the mass of a chain, instead of --position.")
    ] = None,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Find stiffness and damping of a snubber's pad. From a material, a measured curve or an impact; prints YAML."""
    from beamsim.cli import pad as pads

    texts = {
        "modulus": modulus, "shape_factor": shape_factor, "area": area, "height": height, "factor": factor,
        "bulk_modulus": bulk_modulus, "stiffness": stiffness, "contact_time": contact_time,
        "restitution": restitution, "dashpot": dashpot, "loss_factor": loss_factor, "frequency": frequency,
        "mass": mass, "speed": speed,
    }  # fmt: skip
    law = "no_tension" if no_tension else "kelvin_voigt"
    snubber = {"name": name, "position": position, "on_mass": on_mass, "law": law}
    pads.pad(texts, snubber, curve, segments, as_json=json)


COMMANDS = (validate, schema, new, check, export_structure, pad, warmup)
