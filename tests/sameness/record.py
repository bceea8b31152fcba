"""Records what every shipped config gives, number by number, and compares with what was recorded.

Run ``python tests/sameness/record.py`` to write the table, ``--check`` to compare with it. Only the command line and
the result files are used, so that the modules behind them may be moved and renamed. `entries` says what is run.

An entry of the table holds the exit code, every value of the ``--json`` summary, and checksums of every dataset and
attribute of the result file. Numbers agree when they differ by less than 1e-10 of their size; integers agree exactly.
Recording also repeats every entry with the level, and with the structure's stiffness, changed by 1e-15 of itself. Where
that alone changes a value by more than 1e-12, the entry keeps a wider tolerance for that value, and says why. Code that
was only moved gives the same numbers to the last digit: ``--check --strict`` widens no tolerance. Kernels of BLAS for
another processor are such a change as well: ``--widen``, on another processor or with ``OPENBLAS_CORETYPE=Haswell``,
adds what they change to the tolerances of the table.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import math
import multiprocessing
import os
import re
import runpy
import signal
import sys
import tempfile
import warnings
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("MKL_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # before a version that is installed
sys.path.insert(0, str(Path(__file__).resolve().parent))

from entries import CONFIGS, Entry, all_entries
from reading import digest, flattened, is_text, kept, stored

__all__ = ["all_entries", "compare", "digest", "load", "record", "text_changes"]

TABLE = Path(__file__).resolve().with_name("table.json")
TOLERANCE = 1e-10
SENSITIVE = 1e-12  # a change by round-off larger than this widens the tolerance
MARGIN = 100.0  # from the measured change to the tolerance
OTHER_PROCESSOR = 10.0  # the same of changes by another processor

RENAMED: dict[str, tuple[str, str]] = {}
"""Deliberate renamings: pattern of the recorded path -> (new path, reason); a ``*`` is the same text in both."""

MENDED: dict[str, str] = {}
"""Deliberate changes of numbers, not compared: pattern of an entry, or of ``entry path``, -> reason."""

ROUND_OFF = {"energy_error", "residual", "largest_residual", "drift", "motion_drift"}
"""Names of measures of error, round-off themselves: both sides must be below `ROUND_OFF_BOUND`."""
ROUND_OFF_BOUND = 1e-8
CHOSEN_BY_ROUND_OFF = re.compile(r"json/(peak_times_s/|gapping/.*/time_s$)")
"""When peaks are reached: of equal ones round-off chooses; not recorded."""


def call(arguments: list[str]) -> tuple[int, str]:
    """``python -m beamsim`` in this process: exit code and standard output."""
    out, before, handler = io.StringIO(), sys.argv, signal.getsignal(signal.SIGTERM)
    sys.argv = ["beamsim", *arguments]
    code: Any = 0
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()):
            runpy.run_module("beamsim", run_name="__main__")
    except SystemExit as end:
        code = end.code or 0
    finally:
        sys.argv = before
        signal.signal(signal.SIGTERM, handler)
    return int(code), out.getvalue()


def record(entry: Entry, changes: Iterable[str] = ()) -> dict[str, Any]:
    """Do what an entry says, with further changes of the scenario; return what the table holds of it."""
    with tempfile.TemporaryDirectory() as folder:
        for index, step in enumerate(entry.commands(Path(folder), changes)):
            target = Path(folder) / str(index)
            target.mkdir()
            code, out = call([*step, "--json", "--no-plots", "-o", f"{target}/"])
        values = kept(flattened("", json.loads(out)), "json/") if out.strip() else {}
        for path in sorted(target.glob("*.h5")):
            values |= kept(stored(path), "file/")
    return {
        "exit": code,
        "values": {path: value for path, value in values.items() if not is_text(value) and not is_chosen(path)},
        "texts": {path: without_folder(value) for path, value in values.items() if is_text(value)},
    }


def without_folder(text: str) -> str:
    """A text without the place of this checkout."""
    return text.replace(f"{CONFIGS}{os.sep}", "configs/")


def difference(old: Any, new: Any) -> float:
    """Largest difference of two values over their size; infinite where they are not of a kind."""
    if old == new:
        return 0.0
    if isinstance(old, list) and isinstance(new, list):
        if old[0] != "f" or old[:3] != new[:3]:
            return math.inf
        size = [max(a, b) for a, b in zip(old[3:5], new[3:5], strict=True)]
        pairs = zip(old[3:], new[3:], (*size, size[1]), strict=True)
        return max(abs(a - b) / scale for a, b, scale in pairs if a != b)
    if isinstance(old, str | list) or isinstance(new, str | list):
        return math.inf
    return abs(old - new) / max(abs(old), abs(new))


def is_chosen(path: str) -> bool:
    """Whether round-off chooses the value among several that are equally right."""
    return CHOSEN_BY_ROUND_OFF.match(path) is not None


def is_round_off(path: str, *values: Any) -> bool:
    """Whether a path names a measure of error, and both values of it are small enough not to be compared."""
    if not ROUND_OFF & set(path.replace("@", "/").split("/")) or any(isinstance(value, str) for value in values):
        return False
    shapes = [value[:3] if isinstance(value, list) else None for value in values]
    sizes = [abs(value[4] if isinstance(value, list) else value) for value in values]
    return shapes[0] == shapes[1] and max(sizes) < ROUND_OFF_BOUND


def translated(pattern: str, new: str, path: str) -> str | None:
    """The new path of one that a pattern matches."""
    match = re.fullmatch(re.escape(pattern).replace(r"\*", "(.*)"), path)
    for text in match.groups() if match else ():
        new = new.replace("*", text, 1)
    return new if match else None


def renamed(values: dict[str, Any]) -> dict[str, Any]:
    """Recorded values by the paths they have now."""
    result = {}
    for path, value in values.items():
        found = (translated(pattern, new, path) for pattern, (new, _) in RENAMED.items())
        result[next((new for new in found if new is not None), path)] = value
    return result


def is_mended(name: str, path: str) -> bool:
    """Whether a value was changed deliberately."""
    return any(translated(pattern, "", place) is not None for pattern in MENDED for place in (name, f"{name} {path}"))


def compare(name: str, old: dict[str, Any], new: dict[str, Any], strict: bool = False) -> list[str]:
    """What differs between two records of an entry, a line each; strictly, no tolerance is widened."""
    found = []
    if old["exit"] != new["exit"]:
        found.append(f"{name}: exit code {old['exit']} -> {new['exit']}")
    loose = {} if strict else renamed(old.get("loose", {}))
    before, after = renamed(old["values"]), new["values"]
    for path in dict.fromkeys([*before, *after]):
        if is_mended(name, path):
            continue
        if path not in before or path not in after:
            if loose.get(path) != "any":
                found.append(f"{name} {path}: {'is new' if path in after else 'is missing'}")
        elif not is_round_off(path, before[path], after[path]):
            size, allowed = difference(before[path], after[path]), loose.get(path, TOLERANCE)
            if allowed != "any" and size > allowed:
                found.append(f"{name} {path}: {before[path]} -> {after[path]} (by {size:.1e}, {allowed:.0e} allowed)")
    return found


def text_changes(name: str, old: dict[str, Any], new: dict[str, Any]) -> list[str]:
    """Texts that differ between two records of an entry, a line each."""
    before, after = renamed(old["texts"]), new["texts"]
    paths = [p for p in dict.fromkeys([*before, *after]) if before.get(p) != after.get(p) and not is_mended(name, p)]
    return [f"{name} {path}: {before.get(path)!r} -> {after.get(path)!r}" for path in paths]


def measured(entry: Entry) -> dict[str, Any]:
    """Record an entry, and widen the tolerance of what round-off in the scenario changes."""
    base = record(entry)
    largest: dict[str, float] = {}
    for change in entry.perturbations():
        for path, size in sizes(base["values"], record(entry, [change])["values"]).items():
            largest[path] = max(largest.get(path, 0.0), size)
    loose = {path: size for path, size in largest.items() if size > SENSITIVE}
    if loose:
        worst = max(loose, key=lambda path: (loose[path] < 1e-2, loose[path]))
        changes = " or ".join(change.partition("=")[0] for change in entry.perturbations())
        base["reason"] = (
            f"round-off: a change of 1e-15 in {changes} changes {len(loose)} values; {worst} by {loose[worst]:.1e}, "
            f"and {sum(size >= 1e-2 for size in loose.values())} by more than 1 %, which are not compared"
        )
        base["loose"] = {path: tolerance(size) for path, size in loose.items()}
    return base


def sizes(values: dict[str, Any], other: dict[str, Any]) -> dict[str, float]:
    """Relative differences between two records' values; infinite where one has no such value."""
    found = {}
    for path in dict.fromkeys([*values, *other]):
        if path not in values or path not in other:
            found[path] = math.inf
        elif not is_round_off(path, values[path], other[path]):
            found[path] = difference(values[path], other[path])
    return found


def tolerance(size: float, margin: float = MARGIN) -> float | str:
    """What is allowed of a value that round-off changes by so much."""
    return 10.0 ** math.ceil(math.log10(margin * size)) if size < 1e-2 else "any"


def widen(entry: dict[str, Any], other: dict[str, Any]) -> int:
    """Widen the tolerances of an entry of the table to what another processor gives; how many."""
    differ = {path: size for path, size in sizes(entry["values"], other["values"]).items() if size > SENSITIVE}
    loose = dict(entry.get("loose", {}))
    wider = {
        path: tolerance(size, OTHER_PROCESSOR)
        for path, size in sorted(differ.items())
        if loose.get(path) != "any" and OTHER_PROCESSOR * size > loose.get(path, TOLERANCE)
    }
    if wider:
        entry["loose"] = loose | wider
        entry["reason"] = "; ".join(
            filter(None, [entry.get("reason"), f"another processor changes {len(wider)} values"])
        )
    return len(wider)


def timed(work: tuple[Entry, bool]) -> tuple[str, float, dict[str, Any]]:
    """Record an entry in a worker; name, processor time, record."""
    entry, measure = work
    warnings.simplefilter("ignore")
    begin = sum(os.times()[:4])
    result = measured(entry) if measure else record(entry)
    return entry.name, sum(os.times()[:4]) - begin, result


def write(table: dict[str, Any]) -> None:
    """Write the table, a line for every value; what is equal to another entry's values names that entry."""
    blocks = []
    first: dict[str, str] = {}
    for name, entry in sorted(table.items()):
        same = first.setdefault(json.dumps([entry[key] for key in ("values", "loose") if key in entry]), name)
        parts = []
        for key, value in entry.items():
            if same != name and key in ("values", "loose"):
                parts.append(f"  {json.dumps(key)}: {json.dumps(same)}")
            elif isinstance(value, dict):
                lines = ",\n".join(f"   {json.dumps(path)}: {json.dumps(leaf)}" for path, leaf in value.items())
                parts.append(f"  {json.dumps(key)}: {{\n{lines}\n  }}")
            else:
                parts.append(f"  {json.dumps(key)}: {json.dumps(value)}")
        blocks.append(f" {json.dumps(name)}: {{\n" + ",\n".join(parts) + "\n }")
    TABLE.write_text("{\n" + ",\n".join(blocks) + "\n}\n", encoding="utf-8")


def load() -> dict[str, Any]:
    """The recorded table; empty before the first record."""
    table = json.loads(TABLE.read_text(encoding="utf-8")) if TABLE.exists() else {}
    for entry in table.values():
        entry |= {
            key: table[value][key]
            for key, value in entry.items()
            if key in ("values", "loose") and isinstance(value, str)
        }
    return table


def main() -> int:
    """Record, or compare with what was recorded; exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="compare with the table, exit code 1 if anything differs")
    parser.add_argument("--texts", action="store_true", help="with --check: changed texts count as differences")
    parser.add_argument("--strict", action="store_true", help="with --check: no tolerance is widened")
    parser.add_argument(
        "--widen", action="store_true", help="widen the table's tolerances to what this processor gives"
    )
    parser.add_argument("--only", metavar="GLOB", default="*", help="entries, e.g. 'nnm_*' or '* sweep*'")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--times", action="store_true", help="print the processor time of every entry")
    options = parser.parse_args()
    entries = [entry for entry in all_entries() if fnmatchcase(entry.name, options.only)]
    table, found, notes, spent = load(), [], [], 0.0
    compares = options.check or options.widen
    if compares:
        found = [f"{name}: is not run any more" for name in table if name not in {e.name for e in all_entries()}]
    work = [(entry, not compares) for entry in entries]
    with ProcessPoolExecutor(options.jobs, mp_context=multiprocessing.get_context("spawn")) as pool:
        for name, seconds, result in pool.map(timed, work):
            spent += seconds
            if options.times:
                print(f"{seconds:6.1f} s  {name}", flush=True)
            if not compares:
                table[name] = result
                notes += [f"{name}: exit code {result['exit']}"] if result["exit"] else []
            elif name not in table:
                found.append(f"{name}: is not in the table")
            elif options.widen:
                count = widen(table[name], result)
                notes += [f"{name}: {count} tolerances widened"] if count else []
            else:
                differences = compare(name, table[name], result, options.strict)
                within = len(compare(name, table[name], result, strict=True)) - len(differences)
                found += differences
                notes += [f"{name}: {within} values changed within widened tolerances"] if within else []
                changed = [f"text: {line}" for line in text_changes(name, table[name], result)]
                found += changed if options.texts else []
                notes += [] if options.texts else changed
    if not options.check:  # recorded or widened
        write({name: entry for name, entry in table.items() if name in {e.name for e in all_entries()}})
    for line in notes:
        print(f"note: {line}")
    for line in found:
        print(line)
    if not compares:
        print(f"{len(entries)} entries recorded, {spent:.0f} s of processor time")
    else:
        print(f"{len(entries)} entries compared, {len(found)} differences, {spent:.0f} s of processor time")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
