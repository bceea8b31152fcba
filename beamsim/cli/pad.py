"""The command ``pad``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from beamsim.cli.failures import guarded
from beamsim.cli.options import Debug, Json

if TYPE_CHECKING:
    from beamsim.analyses.pad.analysis import PadNumbers


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("pad")(pad)


def _quantity(name: str, text: str) -> Any:
    return typer.Option(name, metavar="QUANTITY", help=text)


@guarded
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
    from beamsim.analyses.pad.analysis import PadInput
    from beamsim.analyses.pad.analysis import pad as designed
    from beamsim.cli.pad_numbers import check_found, check_written, read_numbers
    from beamsim.cli.printing import print_json

    texts = {
        "modulus": modulus, "shape_factor": shape_factor, "area": area, "height": height, "factor": factor,
        "bulk_modulus": bulk_modulus, "stiffness": stiffness, "contact_time": contact_time,
        "restitution": restitution, "dashpot": dashpot, "loss_factor": loss_factor, "frequency": frequency,
        "mass": mass, "speed": speed,
    }  # fmt: skip
    check_written({"name": name} | ({"position": position} if on_mass is None else {"on_mass": on_mass}))
    numbers = read_numbers({key: text for key, text in texts.items() if text is not None})
    result = designed(
        PadInput(curve=curve, segments=segments, law="no_tension" if no_tension else "kelvin_voigt", **numbers)
    )
    check_found(result)
    place = f"position: {position}" if on_mass is None else f"mass: {on_mass}"
    lines = list(_snubber(result, name, place))
    if json:
        print_json({**vars(result), "snubber": "\n".join(lines) + "\n"})
        return
    print(*(f"# {line}" for line in _comments(result)), *lines, sep="\n")


def _snubber(pad: PadNumbers, name: str, place: str) -> Iterator[str]:
    """The section of a scenario."""
    yield "snubbers:"
    yield f"  - name: {name}"
    yield f"    {place}"
    yield "    side: below"
    yield "    gap: 0 mm"
    if pad.points is None:
        yield f"    stiffness: {pad.stiffness:.12g}  # N/m"
    else:
        points = ", ".join(f"[{x:.12g}, {force:.12g}]" for x, force in pad.points)
        yield f"    force_deflection: [{points}]  # m, N"
    if pad.dashpot > 0.0:
        yield f"    damping: {{kind: viscous, coefficient: {pad.dashpot:.12g}}}  # N s/m"
    yield f"    law: {pad.law}"


_SHOWN = (
    ("stiffness", "stiffness", "N/m"),
    ("dashpot", "dashpot", "N s/m"),
    ("Young's modulus", "modulus", "Pa"),
    ("misfit of the curve", "misfit", "N"),
    ("restitution of the measured loop", "loop_restitution", "1"),
    ("damping ratio of the mass", "damping_ratio", "1"),
    ("restitution", "restitution", "1"),
    ("time in contact", "contact_time", "s"),
    ("largest penetration", "penetration", "m"),
    ("peak force", "peak_force", "N"),
    ("largest strain", "strain", "1"),
)


def _comments(pad: PadNumbers) -> Iterator[str]:
    """What is known of the pad, a line each."""
    from beamsim.plots.style import amount

    for label, name, unit in _SHOWN:
        value = getattr(pad, name)
        if value is not None:
            yield f"{label}: {amount(value, unit)}"
    yield from pad.notes
