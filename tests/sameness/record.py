"""Numbers that users read, of some shipped configs: records them in ``numbers.yaml`` and compares with it.

``python tests/sameness/record.py`` writes the numbers that are listed there, ``--check`` compares with them,
``--list "NAME"`` prints every number that a case can record. The file says what is run and which numbers are kept. A
number is named as in the ``--json`` summary: ``peak_force_n/tip``; of an ensemble by its column, then the draw. To add
one, write its name with the value ``null`` and record.

Only the command line and `beamsim.ensemble` are used, so that the modules behind them may be moved and renamed.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import math
import runpy
import shlex
import signal
import sys
import tempfile
import warnings
from collections.abc import Iterable, Iterator
from difflib import get_close_matches
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import yaml

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
sys.path.insert(0, str(CONFIGS.parent))  # before a version that is installed

import beamsim  # noqa: E402

NUMBERS = Path(__file__).resolve().with_name("numbers.yaml")
DIGITS = 12
LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

TOLERANCES = {"closed form": 1e-8, "iterated": 1e-6}
"""By the word under ``agrees``: what numbers may differ by, relative to their size. Whole numbers, flags and words are
equal. Round-off is 1e-16; an impact multiplies it, so that a case ends before its motion is more sensitive than this.
``iterated`` is what a search leaves at its own tolerance: least squares, or the place of a maximum, where the curve is
flat."""


def load() -> dict[str, Any]:
    """The cases by name: what is run, how well it agrees, and the numbers by name."""
    cases: dict[str, Any] = yaml.load(NUMBERS.read_text(encoding="utf-8"), LOADER)
    return cases


def write(cases: dict[str, Any]) -> None:
    """Write the cases, a number a line, below the comment at the head of the file."""
    lines = NUMBERS.read_text(encoding="utf-8").splitlines(keepends=True)
    head = "".join(line for line in lines if line.startswith("#"))
    blocks = (yaml.safe_dump({name: case}, sort_keys=False, width=110) for name, case in cases.items())
    NUMBERS.write_text(head + "".join(f"\n{block}" for block in blocks), encoding="utf-8")


def call(arguments: list[str]) -> dict[str, Any]:
    """The summary that ``python -m beamsim`` prints, in this process."""
    out, before, handler = io.StringIO(), sys.argv, signal.getsignal(signal.SIGTERM)
    sys.argv = ["beamsim", *arguments]
    code: Any = 0
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()), contextlib.chdir(CONFIGS):
            runpy.run_module("beamsim", run_name="__main__")
    except SystemExit as end:
        code = end.code
    finally:
        sys.argv = before
        signal.signal(signal.SIGTERM, handler)
    if code:
        raise RuntimeError(f"beamsim {shlex.join(arguments)} ended with exit code {code}")
    summary: dict[str, Any] = json.loads(out.getvalue())
    return summary


def answer(case: dict[str, Any], changes: Iterable[str] = ()) -> dict[str, Any]:
    """Every number that a case can record, by name; the first command has the overrides, the last one counts."""
    overrides = [*case.get("set", []), *changes]
    if "ensemble" in case:
        scenario = beamsim.load_scenario(CONFIGS / case["ensemble"], overrides=overrides)
        table = beamsim.ensemble(scenario, case["draws"], workers=1).table
        return dict(leaves({name: list(map(float, column)) for name, column in table.items()}))
    with tempfile.TemporaryDirectory() as folder:
        further = [word for override in overrides for word in ("--set", override)]
        for command in case["run"]:
            words = [word.replace("{out}", folder) for word in shlex.split(command)]
            summary = call([*words, *further, "--json", "--no-plots", "-o", f"{folder}/"])
            further = []
    return dict(leaves(summary))


def leaves(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Names and values of nested mappings and lists; numbers to `DIGITS` digits."""
    if isinstance(value, dict | list):
        yield f"{path}/count".lstrip("/"), len(value)
        for name, part in value.items() if isinstance(value, dict) else enumerate(value):
            yield from leaves(part, f"{path}/{name}".lstrip("/"))
    else:
        yield path, float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def chosen(case: dict[str, Any], found: dict[str, Any]) -> dict[str, Any]:
    """Of what was found the numbers that a case records; ``missing`` for those that are no more."""
    return {name: found.get(name, "missing") for name in case["numbers"]}


def compare(case: dict[str, Any], found: dict[str, Any]) -> list[str]:
    """A line for every number that differs by more than the case's tolerance."""
    tolerance = TOLERANCES[case["agrees"]]
    pairs = ((name, old, found[name]) for name, old in case["numbers"].items())
    return [f"{name}: {old} recorded, {new} found" for name, old, new in pairs if not agree(old, new, tolerance)]


def agree(old: Any, new: Any, tolerance: float) -> bool:
    """Whether two values are the same, or two decimal numbers the same within a tolerance."""
    if isinstance(old, float) and isinstance(new, float):
        return math.isclose(old, new, rel_tol=tolerance)
    return bool(old == new)


def main() -> int:
    """Record, compare, or list; exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="compare, exit code 1 if anything differs")
    parser.add_argument("--list", action="store_true", help="print all that the cases can record")
    parser.add_argument("only", metavar="NAME", nargs="?", default="*", help="cases, by name or pattern")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    cases, differences = load(), 0
    named = [name for name in cases if fnmatchcase(name, options.only)]
    if not named:
        near = get_close_matches(options.only, cases, n=3, cutoff=0.4)
        others = f"near it are {', '.join(near)}" if near else "the cases are in numbers.yaml"
        parser.error(f"no case is called {options.only}; {others}")
    for name in named:
        found = answer(cases[name])
        if options.list:
            print(f"{name}:", *(f"  {path}: {value}" for path, value in found.items()), sep="\n")
            continue
        found = chosen(cases[name], found)
        lines = compare(cases[name], found)
        differences += len(lines)
        print(f"{name}: {'as recorded' if not lines else ''}", *lines, sep="\n  " if lines else "", flush=True)
        cases[name]["numbers"] = found
    if not (options.check or options.list):
        write(cases)
    return 1 if options.check and differences else 0


if __name__ == "__main__":
    sys.exit(main())
