"""The command ``warmup``."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import typer

from beamsim.cli.failures import guarded
from beamsim.cli.options import Debug, Json, Quiet

# analyses of short forms of the templates: between them they call every kernel
CASES: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("run", "beam", {}),
    ("run", "random", {"run.duration": "1 s"}),
    ("sweep", "sweep", {"sweep.to": "22 Hz", "sweep.direction": "up", "sweep.levels": ["0.5 g"]}),
    ("continuation", "sweep", {"sweep": {"kind": "continuation", "from": "20 Hz", "to": "22 Hz"}}),
    ("nnm", "nnm", {}),
)


@guarded
def warmup(quiet: Quiet = False, json: Json = False, debug: Debug = False) -> None:
    """Compile the numerical kernels beforehand, for images and installers. Prints the folder where they are kept."""
    from beamsim.cli.printing import print_json
    from beamsim.cli.progress import progress_of
    from beamsim.flow.compiled import cache_folder
    from beamsim.kinds import KINDS, named
    from beamsim.scenario import load_scenario, template

    shown = not (quiet or json)
    with progress_of("compiling the numerical kernels", shown=shown) as progress, TemporaryDirectory() as at:
        for done, (kind, name, changes) in enumerate(CASES):
            case = Path(at) / f"{name}.yaml"
            case.write_text(template(name), encoding="utf-8")
            progress(done / len(CASES))
            named(KINDS[kind].analysis)(load_scenario(case, changes))
    folder = cache_folder()
    if json:
        print_json({"folder": None if folder is None else str(folder)})
    else:
        print(folder or "compiled code cannot be kept here")


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(warmup)
