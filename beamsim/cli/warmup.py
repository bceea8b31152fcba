"""Command ``warmup``: compile all kernels."""

from __future__ import annotations

from pathlib import Path
from pkgutil import resolve_name
from tempfile import TemporaryDirectory
from typing import Any

from beamsim.cli.session import print_json, progress_of
from beamsim.flow.compiled import cache_folder
from beamsim.kinds import KINDS
from beamsim.scenario import load_scenario, template

# short versions of the templates that together call every kernel
CASES: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("run", "beam", {}),
    ("run", "random", {"run.duration": "0.1 s", "run.spectrum.last": "0.05 s"}),
    ("sweep", "sweep", {"sweep.to": "22 Hz", "sweep.direction": "up", "sweep.levels": ["0.5 g"]}),
    ("continuation", "sweep", {"sweep": {"kind": "continuation", "from": "20 Hz", "to": "22 Hz"}}),
    ("nnm", "nnm", {"nnm.continue_in.to": "0.1 mJ"}),
)


def compile_kernels(*, shown: bool, as_json: bool) -> None:
    """Compile every kernel, and print the folder where they are kept."""
    with progress_of("compiling the numerical kernels", shown=shown) as progress, TemporaryDirectory() as at:
        for done, (kind, name, changes) in enumerate(CASES):
            case = Path(at) / f"{name}.yaml"
            case.write_text(template(name), encoding="utf-8")
            progress(done / len(CASES))
            resolve_name(KINDS[kind].analysis)(load_scenario(case, changes))
    folder = cache_folder()
    if as_json:
        print_json({"folder": None if folder is None else str(folder)})
    else:
        print(folder or "compiled code cannot be kept here")
