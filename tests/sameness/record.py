"""Records what every shipped config gives, number by number, and compares with what was recorded.

Run ``python tests/sameness/record.py`` to write the table, ``--check`` to compare with it. Only the command line and
the result files are used, so that the modules behind them may be moved and renamed. `entries` says what is run.

An entry of the table holds the exit code, every value of the ``--json`` summary, and checksums of every dataset and
attribute of the result file. Numbers agree when they differ by less than 1e-10 of their size; integers agree exactly.
Recording also repeats every entry with the level, and with the structure's stiffness, changed by 1e-15 of itself. Where
that alone changes a value by more than 1e-12, the entry keeps a wider tolerance for that value, and says why.
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
import zlib
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("MKL_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # before a version that is installed
sys.path.insert(0, str(Path(__file__).resolve().parent))

import h5py
import numpy as np
from entries import Entry, all_entries

__all__ = ["all_entries", "compare", "digest", "load", "record", "text_changes"]

TABLE = Path(__file__).resolve().with_name("table.json")
TOLERANCE = 1e-10
SENSITIVE = 1e-12  # a change by round-off larger than this widens the tolerance
MARGIN = 100.0  # from the measured change to the tolerance

RENAMED: dict[str, tuple[str, str]] = {}
"""Deliberate renamings: pattern of the recorded path -> (new path, reason); a ``*`` is the same text in both."""

MENDED: dict[str, str] = {}
"""Deliberate changes of numbers, not compared: pattern of an entry, or of ``entry path``, -> reason."""

LEFT_OUT = {
    *("files", "created", "provenance", "scenario", "schema_version", "beamsim_version", "json_encoded"),
    *("wall_time_s", "processor_time_s", "shooting_processor_time_s", "cost_ratio"),
    *("CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST"),
}
"""Names of values that depend on time, machine or version, and of what HDF5 needs itself."""

ROUND_OFF = {"energy_error", "residual", "largest_residual", "drift", "motion_drift"}
"""Names of measures of error, round-off themselves: both sides must be below `ROUND_OFF_BOUND`."""
ROUND_OFF_BOUND = 1e-8

SORTED = ("floquet_multipliers",)
"""Beginnings of the names of datasets whose rows have no order of their own."""

GATHERED = ("long_name", "units", "flag_meanings")
"""Texts that are gathered by the last part of a path, as they are the same for every probe and branch."""


# What a value is in the table: a number (float or integer), a text, or a list
#   ["f", shape, not finite, sum of absolute values, Euclidean norm, product with a fixed vector]  of many numbers
#   ["i", shape, sum of absolute values, CRC32]  of many integers or booleans


def rounded(value: float) -> float | str:
    """A number to 12 significant digits; text where JSON has none for it."""
    return float(f"{value:.12g}") if math.isfinite(value) else str(value)


def digest(array: Any) -> Any:
    """What the table holds of a number or an array of numbers."""
    array = np.asarray(array)
    if array.dtype.kind in "biu":
        whole = array.astype(np.int64)
        if whole.ndim == 0:
            return int(whole)
        return ["i", list(whole.shape), int(np.abs(whole).sum()), zlib.crc32(np.ascontiguousarray(whole).tobytes())]
    if array.dtype.kind == "c":
        array = np.stack([array.real, array.imag])
    array = array.astype(float)
    if array.ndim == 0:
        return rounded(float(array))
    finite = np.isfinite(array)
    flat = np.where(finite, array, 0.0).ravel()
    product = flat @ np.cos(1.0 + 0.7 * np.arange(flat.size))
    sums = [rounded(float(x)) for x in (np.abs(flat).sum(), np.sqrt(flat @ flat), product)]
    return ["f", list(array.shape), int((~finite).sum()), *sums]


def flattened(path: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Paths and leaves of a JSON value; lists of records become columns, lists of numbers checksums."""
    if isinstance(value, dict):
        for name, part in value.items():
            yield from flattened(f"{path}/{name}" if path else name, part)
    elif isinstance(value, list):
        scalar = (bool, int, float, type(None))
        if value and all(isinstance(part, scalar) for part in value):
            yield path, digest([math.nan if part is None else part for part in value])
        elif value and all(isinstance(part, str | None) for part in value):
            yield path, " ".join(map(str, value))
        elif (
            value
            and all(isinstance(part, dict) for part in value)
            and not any(isinstance(leaf, dict | list) for part in value for leaf in part.values())
        ):
            yield f"{path}/count", len(value)
            for name in dict.fromkeys(name for part in value for name in part):
                yield from flattened(f"{path}/{name}", [part.get(name) for part in value])
        else:
            yield f"{path}/count", len(value)
            for index, part in enumerate(value):
                yield from flattened(f"{path}/{index}", part)
    else:
        yield path, value if isinstance(value, str) else "none" if value is None else digest(value)


def stored(path: Path) -> Iterator[tuple[str, Any]]:
    """Paths and leaves of a result file: datasets by their names, attributes after an ``@``."""

    def attributes(name: str, holder: Any) -> Iterator[tuple[str, Any]]:
        for key, value in holder.attrs.items():
            text = value.decode() if isinstance(value, bytes) else value
            place = f"{name.split('/')[-1] if key in GATHERED else name}@{key}"
            if isinstance(text, np.ndarray) and text.dtype.kind in "OSU":
                yield place, " ".join(x.decode() if isinstance(x, bytes) else str(x) for x in text.ravel())
            elif isinstance(text, str):
                if text[:1] not in ("[", "{"):
                    yield place, text
                elif name != "summary":  # printed as well
                    yield from flattened(place, json.loads(text))
            elif isinstance(text, np.ndarray | np.generic) and text.dtype.kind in "biufc":
                yield place, digest(text)

    names: list[str] = []
    with h5py.File(path) as file:
        file.visit(names.append)
        yield from attributes("", file)
        for name in names:
            item = file[name]
            if isinstance(item, h5py.Dataset):
                stem = name.removesuffix("_real")
                if item.dtype.kind == "O":
                    yield name, " ".join(map(str, item.asstr()[...].ravel()))
                elif stem != name and f"{stem}_imag" in file:
                    both = np.stack([item[...], file[f"{stem}_imag"][...]])
                    yield f"{stem}_complex", digest(np.sort(both) if stem.split("/")[-1].startswith(SORTED) else both)
                elif item.dtype.kind in "biufc" and not (name.endswith("_imag") and f"{name[:-5]}_real" in file):
                    yield name, digest(item[...])
            yield from attributes(name, item)


def kept(pairs: Iterable[tuple[str, Any]], prefix: str) -> dict[str, Any]:
    """The values that the table holds; different texts of one path are joined."""
    result: dict[str, Any] = {}
    for path, value in pairs:
        place = prefix + path
        if LEFT_OUT & set(path.replace("@", "/").split("/")):
            continue
        if place in result and value not in result[place].split(" | "):
            result[place] = f"{result[place]} | {value}"
        result.setdefault(place, value)
    return result


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
        "values": {path: value for path, value in values.items() if not is_text(value)},
        "texts": {path: value for path, value in values.items() if is_text(value)},
    }


def is_text(value: Any) -> bool:
    return isinstance(value, str) and value not in ("nan", "inf", "-inf", "none")


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
        other = record(entry, [change])["values"]
        for path in dict.fromkeys([*base["values"], *other]):
            if path not in base["values"] or path not in other:
                largest[path] = math.inf
            elif not is_round_off(path, base["values"][path], other[path]):
                largest[path] = max(largest.get(path, 0.0), difference(base["values"][path], other[path]))
    loose = {path: size for path, size in largest.items() if size > SENSITIVE}
    if loose:
        finite = max((size for size in loose.values() if size < math.inf), default=0.0)
        changes = " or ".join(change.partition("=")[0] for change in entry.perturbations())
        base["reason"] = f"a change of 1e-15 in {changes} changes {len(loose)} values, by up to {finite:.1e}"
        base["loose"] = {
            path: 10.0 ** math.ceil(math.log10(MARGIN * size)) if size < 1e-2 else "any" for path, size in loose.items()
        }
    return base


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
    parser.add_argument("--only", metavar="GLOB", default="*", help="entries, e.g. 'nnm_*' or '* sweep*'")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--times", action="store_true", help="print the processor time of every entry")
    options = parser.parse_args()
    entries = [entry for entry in all_entries() if fnmatchcase(entry.name, options.only)]
    table, found, notes, spent = load(), [], [], 0.0
    if options.check:
        found = [f"{name}: is not run any more" for name in table if name not in {e.name for e in all_entries()}]
    work = [(entry, not options.check) for entry in entries]
    with ProcessPoolExecutor(options.jobs, mp_context=multiprocessing.get_context("spawn")) as pool:
        for name, seconds, result in pool.map(timed, work):
            spent += seconds
            if options.times:
                print(f"{seconds:6.1f} s  {name}", flush=True)
            if not options.check:
                table[name] = result
                notes += [f"{name}: exit code {result['exit']}"] if result["exit"] else []
            elif name not in table:
                found.append(f"{name}: is not in the table")
            else:
                differences = compare(name, table[name], result, options.strict)
                within = len(compare(name, table[name], result, strict=True)) - len(differences)
                found += differences
                notes += [f"{name}: {within} values changed within widened tolerances"] if within else []
                changed = [f"text: {line}" for line in text_changes(name, table[name], result)]
                found += changed if options.texts else []
                notes += [] if options.texts else changed
    if not options.check:
        write({name: entry for name, entry in table.items() if name in {e.name for e in all_entries()}})
    for line in notes:
        print(f"note: {line}")
    for line in found:
        print(line)
    if not options.check:
        print(f"{len(entries)} entries recorded, {spent:.0f} s of processor time")
    else:
        print(f"{len(entries)} entries compared, {len(found)} differences, {spent:.0f} s of processor time")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
