"""Result files that were changed on purpose, with the seal of what they then hold, and what commands make of them.

`python -m tests.helpers.crafted_results FIRST END` prints a line for each crafted file and command.
"""

import csv
import gzip
import json
import re
import sys
import tempfile
import warnings
from collections import Counter
from pathlib import Path

import h5py
import numpy as np

from beamsim.errors import BeamsimError
from beamsim.labelled import Item, parent
from beamsim.store.results import JSON_ENCODED, load, read_items, write_items
from tests.helpers.commands import invoke

SOUND = sorted((Path(__file__).parents[1] / "data" / "results").glob("*.h5.gz"))
"""A kept result of every kind, and some of the same kind."""

JSON_VALUES = (
    None, True, 0, -1, 1, 2.5, 1e308, 10**30, "", "x", "nan", "x" * 20_000, "<script>\x1b[31m", [], [1], ["a", None],
    [[]], [[[[1]]]], {}, {"a": 1}, {"a": {"b": {"c": []}}}, [{}], [{"a": None}],
)  # fmt: skip
ATTRIBUTES = (
    7.0, -1, 10**18, "text", "", "null", "{", "[]", "{}", '[1, {"a": null}]', "x" * 20_000, np.nan, np.inf,
    np.zeros(3), np.int8(3), True, np.array(["a", "b"], dtype=object), "\x1b[2J</script><!--",
)  # fmt: skip
NUMBERS = (np.nan, np.inf, -np.inf, 0.0, -1.0, 1e-320, 1e300, -1e300, 2**62)


def unpacked(packed, folder):
    """The file of a kept result."""
    path = folder / packed.name.removesuffix(".gz")
    path.write_bytes(gzip.decompress(packed.read_bytes()))
    return h5py.File(path)


def _any(rng, values):
    return values[int(rng.integers(len(values)))]


def crafted_json(value, rng):
    """A value of JSON with one change at a random place: another value, a part missing, twice, added or renamed."""
    inner = isinstance(value, (dict, list)) and len(value) > 0
    if not inner or rng.random() < 0.25:
        return _any(rng, JSON_VALUES)
    copy = dict(value) if isinstance(value, dict) else list(value)
    at = _any(rng, list(copy) if isinstance(copy, dict) else range(len(copy)))
    match int(rng.integers(8)):
        case 0:
            del copy[at]
        case 1 if isinstance(copy, dict):
            copy["unheard of"] = _any(rng, JSON_VALUES)
        case 2 if isinstance(copy, dict):
            copy[f"{at}2"] = copy.pop(at)
        case 3 if isinstance(copy, list):
            copy.append(copy[at])
        case _:
            copy[at] = crafted_json(copy[at], rng)
    return copy


def crafted_array(values, rng):
    """An array of another kind, shape or content."""
    array = np.asarray(values)
    match int(rng.integers(8)):
        case 0 if array.dtype.kind in "fi" and array.size:
            changed = array.astype(float)
            changed.flat[int(rng.integers(array.size))] = _any(rng, NUMBERS)
            return changed
        case 1 if array.dtype.kind in "fi":
            return np.full(array.shape, _any(rng, NUMBERS))
        case 2:
            return array[:-1] if array.ndim else np.full(3, 1.0)
        case 3:
            return array[..., None]
        case 4:
            return np.full(array.shape, "text", dtype=object)
        case 5:
            return array[:0] if array.ndim else np.float64(np.nan)
        case 6 if array.dtype.kind in "fi":
            return array.astype(_any(rng, ("i1", "u8", "f4", "i8"))) if np.isfinite(array).all() else array * 0
    return array[::-1] if array.ndim else np.float64(-1.0)


def crafted_scenario(text, others, rng):
    """The text of a scenario with a changed number, name or line, or that of another result."""
    lines = text.splitlines()
    at = int(rng.integers(len(lines)))
    match int(rng.integers(5)):
        case 0:
            return str(_any(rng, others))
        case 1:
            del lines[at]
        case 2:
            lines[at] = re.sub(r"\d[\d.e+-]*", str(_any(rng, (0, -1, 2, 1e9, ".nan"))), lines[at])
        case 3:
            names = re.findall(r"name: (\w+)", text)
            return text.replace(f"name: {_any(rng, names)}", "name: another") if names else text + "title: other\n"
        case _:
            lines.insert(at, _any(rng, lines))
    return "\n".join(lines)


def craft(items, others, rng):
    """Change items in one to three places.

    Parameters
    ----------
    items : of a sound result; changed in place.
    others : texts of the scenarios of all results.
    rng : a random generator.
    """
    for _ in range(int(rng.integers(1, 4))):
        arrays = [place for place, item in items.items() if item.values is not None]
        place = _any(rng, list(items))
        attributes = items[place].attributes
        match int(rng.integers(8)):
            case 0 | 1 | 2:
                _craft_summary(items["/summary"].attributes, rng) if "/summary" in items else None
            case 3 if attributes:
                name = _any(rng, list(attributes))
                if rng.random() < 0.2:
                    del attributes[name]
                elif isinstance(attributes[name], str) and attributes[name][:1] in ("[", "{"):
                    attributes[name] = json.dumps(crafted_json(json.loads(attributes[name]), rng))
                else:
                    attributes[name] = _any(rng, ATTRIBUTES)
            case 4 | 5 if arrays:
                item = items[_any(rng, arrays)]
                item.array = crafted_array(item.values, rng)
                if np.ndim(item.array) != len(item.axes):
                    item.axes = ()
            case 6 if place != "/":
                gone = [each for each in items if each == place or each.startswith(f"{place}/")]
                moved = {each: items.pop(each) for each in gone}
                if rng.random() < 0.3:
                    items |= {each.replace(place, f"{place}x", 1): item for each, item in moved.items()}
            case 7:
                root = items["/"].attributes
                root["scenario"] = crafted_scenario(str(root.get("scenario", "")) or "{}", others, rng)
            case _:
                items[f"{parent(place).rstrip('/')}/more"] = Item(array=np.zeros(2))
    for item in items.values():
        item.axes = tuple(axis if axis in items and items[axis].scale else "" for axis in item.axes)


def _craft_summary(attributes, rng):
    """Change an entry of a summary, or add one."""
    encoded = set(str(attributes.get(JSON_ENCODED, "")).split())
    names = [name for name in attributes if name != JSON_ENCODED] or [""]
    name = _any(rng, names)
    if name in encoded:
        try:
            attributes[name] = json.dumps(crafted_json(json.loads(str(attributes[name])), rng))
        except ValueError:
            attributes[name] = "null"
    elif rng.random() < 0.5:
        attributes[name or "more"] = _any(rng, ATTRIBUTES)
    else:
        attributes[name or "more"] = json.dumps(_any(rng, JSON_VALUES))
        attributes[JSON_ENCODED] = " ".join(sorted({*encoded, name or "more"}))


def write_crafted(number, folder):
    """Write the crafted result of a number, of one of the kept results in turn.

    Returns
    -------
    Path
        Of the file; None where HDF5 cannot store what was crafted.
    """
    rng = np.random.default_rng(number)
    packed = SOUND[number % len(SOUND)]
    with unpacked(packed, folder) as file:
        items = read_items(file)
    with unpacked(_any(rng, SOUND), folder) as file:
        others = [str(file.attrs["scenario"])]
    craft(items, others, rng)
    path = folder / f"crafted_{packed.name.partition('.')[0]}.h5"
    path.unlink(missing_ok=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            write_items(items, path)
        except Exception:
            return path if path.exists() else None
    return path


def _measured(folder):
    """A measured acceleration, 40 s of 0.1 Hz."""
    path = folder / "measured.csv"
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["time (s)", "acceleration (m/s^2)"])
        rows.writerows((k / 20, float(np.sin(2 * np.pi * k / 200))) for k in range(800))
    return path


def commands(path, folder):
    """Commands that read a result file, by name: their arguments."""
    out = folder / "out"
    last = ("-q", "--no-plots", "-o", out / "computed.h5")

    def case(text):
        written = folder / f"case{len(text)}.yaml"
        written.write_text(text.replace("RESULT", str(path)))
        return written

    probe = {"run_random": "tip", "run_springs": "first"}.get(path.stem.removeprefix("crafted_"), "one")
    curve = ("--curve", "up_0") if path.stem.removeprefix("crafted_") in ("sweep", "stepped") else ()
    return {
        "info": ("info", path),
        "info --json": ("info", path, "--json"),
        "plot": ("plot", path, "-q", "-o", out),
        "plot svg": ("plot", path, "-q", "--format", "svg", "-o", out),
        "report": ("report", path, "-q", "-o", out / "report.html"),
        "export csv": ("export", path, "-q", "-o", out / "tables.csv"),
        "export mat": ("export", path, "-q", "-o", out / "result.mat"),
        "export uff": ("export", path, "-q", "-o", out / "result.uff"),
        "animate": ("animate", path, "-q", "-o", out / "motion.html"),
        "compare": ("compare", path, _measured(folder), "--probe", probe, *curve, *last),
        "sweep --overlay": ("sweep", case(CONTINUATION), "--overlay", path, *last),
        "run from orbit": ("run", case(ORBIT), *last),
        "record of a result": ("run", case(RECORD), *last),
    }  # fmt: skip


CHAIN = """
chain:
  masses: [1.0, 1.0]
  springs: [1.0, 1.0]
  dashpots: [0.05, 0.05]
  snubbers: [{name: stop, mass: 1, stiffness: 5.0, gap: 0.2, law: kelvin_voigt, side: above, mounted_on: base}]
gravity: 0.0
"""
FORCE = """
excitation: {kind: harmonic, applied_to: {mass: 1}, level: 0.4, frequency: 0.1, quantity: force}
"""
CONTINUATION = (
    CHAIN
    + FORCE
    + """
probes: [{name: one, mass: 1}, {name: the other, mass: 2}]
sweep: {kind: continuation, from: 0.085, to: 0.086, convergence: off}
"""
)
ORBIT = (
    CHAIN
    + FORCE
    + """
run: {duration: 5.0, start: {orbit: RESULT, branch: 0, point: 1}, convergence: off}
"""
)
RECORD = (
    CHAIN
    + """
excitation:
  {kind: sampled, applied_to: base, quantity: acceleration, file: RESULT, column: histories/one/absolute_acceleration}
run: {duration: 1.0, convergence: off}
"""
)


def outcomes(number, folder):
    """What each command makes of a crafted result: by name ``right``, ``refused``, or what went wrong.

    A file that is refused when it is opened is given to ``info`` and to one other command alone; one of three is drawn.
    """
    path = write_crafted(number, folder)
    if path is None:
        return {}
    chosen = commands(path, folder)
    try:
        load(path)
    except BeamsimError:
        names = list(chosen)
        chosen = {name: chosen[name] for name in ("info", names[1 + number % (len(names) - 1)])}
    except Exception as error:
        return {"opening": f"{type(error).__name__}: {error}"[:300]}
    else:
        for left_out in {"plot", "plot svg"} - {("plot", "plot svg", "")[number // len(SOUND) % 3]}:
            del chosen[left_out]
    return {name: outcome(arguments) for name, arguments in chosen.items()}


def outcome(arguments):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        done = invoke(*arguments)
    if done.exit_code == 0:
        return "right"
    if done.exit_code == 2 and "Traceback" not in done.output:
        return "refused"
    return f"exit code {done.exit_code}: {done.output[-300:]}"


def main(first, end):
    """Print the outcome of each command with each of some crafted results, and how often each came."""
    found = Counter()
    for number in range(int(first), int(end)):
        with tempfile.TemporaryDirectory() as folder:
            for name, result in outcomes(number, Path(folder)).items():
                kind = result if result in ("right", "refused") else "wrong"
                found[kind] += 1
                print(number, SOUND[number % len(SOUND)].name.partition(".")[0], name, result, sep="\t", flush=True)
    print(dict(found))


if __name__ == "__main__":
    main(*sys.argv[1:])
