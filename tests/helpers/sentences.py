"""What each sentence, verdict and cell of a first screen means: rules that compare it with the numbers of the file."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import typer

from beamsim.cli.app import app
from tests.helpers.screens import (
    GRAVITY,
    RULES,
    ResultFacts,
    Screen,
    cell,
    differs,
    read_screen,
    rounds_to,
    rule,
    split_mark,
    unit_of,
    wrong_mark,
)

SCHEMA = json.loads((Path(__file__).parents[2] / "docs/scenario.schema.json").read_text(encoding="utf-8"))
KEYS = {key for of in (SCHEMA, *SCHEMA["$defs"].values()) for key in of.get("properties", ())}
KINDS = {
    of["properties"]["kind"]["const"]
    for of in SCHEMA["$defs"].values()
    if "const" in of.get("properties", {}).get("kind", {})
}
COMMANDS = typer.main.get_command(app).commands  # type: ignore[attr-defined]
EXPECTED = {"LIMITS EXCEEDED": "not held", "INCOMPLETE": "incomplete stopped failed interrupted",
            "NOT RELIABLE": "untrusted", "NOT CONVERGED": "doubtful"}  # fmt: skip
GRAVEST = ("complete", "noted", "doubtful", "not held", "incomplete", "stopped", "failed", "untrusted", "interrupted")
LIMITED = {
    "peak force": ("peak_force_n", 1.0, "N"), "peak moment": ("peak_moment_n_m", 1.0, "N m"),
    "gap": ("largest_gap_m", 1.0, "m"), "peak displacement": ("peak_displacement_m", 1.0, "m"),
    "peak acceleration": ("peak_acceleration_g", GRAVITY, "m/s^2"), "gapping": ("gapping_ratio", 1.0, "1"),
    "peak spring force": ("peak_spring_force_n", 1.0, "N"), "peak friction force": ("peak_friction_force_n", 1.0, "N"),
    "peak friction moment": ("peak_friction_moment_n_m", 1.0, "N m"),
    "bending stress": ("largest_bending_stress_pa", 1.0, "Pa"),
    "rms acceleration": ("rms_acceleration_g", GRAVITY, "m/s^2"), "rms displacement": ("rms_displacement_m", 1.0, "m"),
}  # fmt: skip
"""By the name of a limit the entry of the summary that it is on, SI units in one of the entry, and the SI unit."""
FIRST = ("peak_", "min_", "max_", "largest_gap", "largest_pull", "frequency_hz")  # of entries read first


def contradictions(text: str, facts: ResultFacts) -> list[str]:
    """What a screen says that its file does not, and what no rule knows.

    Parameters
    ----------
    text : as it was printed on standard output.
    facts : of the result file.
    """
    screen = read_screen(text, facts, lambda text: is_heading(facts, text))
    found = []
    for row in screen.rows:
        name, cells = (row[0], row[1:]) if screen.header[0] == "" else ("", row)
        for heading, content in zip(screen.header[-len(cells) :], cells, strict=True):
            if content not in ("-", ""):
                found += [f"{name}, {heading}: {each}" for each in _cell(facts, heading, name, content)]
    for line in screen.lines:
        found += _compared("line", line, facts)
    for text in screen.statements:  # without a table sentences stand there
        found += _compared("statement" if screen.header or text[:1].isupper() else "line", text, facts)
    for part in re.split(r"; (?!\d)", screen.understood) if screen.understood else ():
        found += _compared("understood", part, facts)
    found += _verdict(screen, facts)
    found += _compared("foot", screen.foot, facts)
    return [*found, *_remedies(text, facts)]


def is_heading(facts: ResultFacts, text: str) -> bool:
    """Whether a text is the heading of a column: those of studies are of parameters, objectives and responses too."""
    if any(each.where == "heading" and each.pattern.fullmatch(text) for each in RULES):
        return True
    if facts.kind != "designs":
        return False
    objectives = [name.replace("_", " ") for name in facts.labels("cases/objective")]
    return text in (*map(_called, facts.labels("cases/parameter")), *objectives) or bool(responses_called(facts, text))


def _cell(facts: ResultFacts, heading: str, name: str, text: str) -> list[str]:
    """Contradictions of a cell."""
    dynamic = facts.kind == "designs" and not re.fullmatch(OF_STUDIES, heading)
    return list(other_cell(facts, heading, name, text)) if dynamic else _compared("heading", heading, facts, name, text)


OF_STUDIES = (
    r"(?:smallest|largest)(?: \(at .*\))?|mean|median|5 %|95 %|margin|worst|limit|deviation|design point|"
    r"importance \(%\)|doubles.*"
)


def _compared(where: str, text: str, facts: ResultFacts, *more: str) -> list[str]:
    for each in RULES:
        if each.where == where and (match := each.pattern.fullmatch(text)):
            try:
                return [f"{text!r}: {fault}" for fault in each.check(facts, match, *more)]
            except (AttributeError, LookupError, RuntimeError, TypeError, ValueError) as error:  # a name, a form
                return [f"{text!r}: is of nothing in the file: {error!r}"]
    return [f"{text!r}: no rule knows this {where}"]


# --- The first line --------------------------------------------------------------------------------------------------


def _verdict(screen: Screen, facts: ResultFacts) -> Iterator[str]:
    """Contradictions of what stands beside the title; each part has a rule, and nothing may be missing."""
    parts = re.split(r"(?<!at a time), (?!but for |means within|\d+ means?)", screen.verdict) if screen.verdict else []
    parts = _joined(parts)
    for part in parts:
        yield from _compared("verdict", part, facts)
    worth = next((name for name, kinds in EXPECTED.items() if gravest(facts) in kinds.split()), "")
    said = next((name for name in EXPECTED if screen.verdict.startswith(name)), "")
    if worth != said:
        yield f"the first line says {said or 'nothing'!r} of a result that is {gravest(facts)!r}"
    if said and re.search(r"\bcomplete\b", " ".join((screen.verdict, *screen.statements))):
        yield f"{said} beside 'complete'"


def _joined(parts: list[str]) -> list[str]:
    """Parts of a verdict, where a reason in parentheses may have commas."""
    whole: list[str] = []
    for part in parts:
        if whole and whole[-1].count("(") > whole[-1].count(")"):
            whole[-1] += f", {part}"
        else:
            whole.append(part)
    return whole


def gravest(facts: ResultFacts) -> str:
    """The gravest kind of the outcome of a result and of its parts."""

    def kinds(outcome: dict[str, Any]) -> Iterator[str]:
        yield outcome["kind"]
        for part in outcome.get("sub_outcomes", ()):
            yield from kinds(part)

    return max(kinds(json.loads(facts.attributes["outcome_numbers"])), key=GRAVEST.index)


def read_first(facts: ResultFacts, key: tuple[str, str]) -> bool:
    """Whether a value is a displacement, acceleration, force or output, has a limit, or is the first frequency."""
    entry, place = key
    if entry.startswith(FIRST):
        return True
    for state in ("open", "closed"):
        if entry == f"{state}_frequencies_hz":
            first = facts.first_mode(state)
            return first is not None and place == str(first + 1)
    for limit, of in (facts.scenario.get("limits") or {}).items():
        places = of if isinstance(of, dict) else {"": of}
        own, _, _ = LIMITED.get(limit.replace("_", " "), ("", 0.0, ""))
        if entry == own and ("" in places or any(place.endswith(name) for name in places)):
            return True
    return False


@rule("verdict", r"(LIMITS EXCEEDED|INCOMPLETE|NOT RELIABLE|NOT CONVERGED)(?:: <N> values?)?")
def _worth(facts, found):
    if found[2]:
        count = sum(read_first(facts, key) for key in facts.keys("doubtful"))
        if int(found[2]) != count:
            yield f"{count} values that are read first are doubtful"


@rule("verdict", r"not checked with a finer model \((.*)\)")
def _not_checked(facts, found):
    model = facts.summary.get("convergence_model") or {"reason": "not known"}
    if found[1] != model["reason"] or model.get("modes"):
        yield f"the reason is {model['reason']!r}, the finer model has {model.get('modes')} modes"


@rule("verdict", r"all modes kept")
def _all_kept(facts, found):
    model = facts.summary["convergence_model"]
    if model["reason"] or model["modes"] or max(facts.convergence.values(), default=0.0) > 0.0:
        yield f"the finer model is {model}"


@rule(
    "verdict",
    r"(one of many motions, means|converged) within <N> %(?:, <N> means? within the standard error)?(, but for"
    r" what is marked \^)?",
)
def _converged(facts, found):
    after = [key for key in facts.keys("after_parting") if read_first(facts, key)]
    if bool(after) != found[1].startswith("one"):
        yield f"{len(after)} values that are read first depend on what follows after contacts diverge"
    jumps = facts.keys("without_limit")
    if bool(jumps & facts.printed) != bool(found[4]):
        yield f"values that jump are {jumps}"
    changes = [facts.convergence.get(key, 0.0) for key in facts.printed - jumps if read_first(facts, key)]
    means = [change for change in changes if change > 0.02]
    largest = max((change for change in changes if change <= 0.02), default=0.0)
    if int(found[3] or 0) != len(means):
        yield f"{len(means)} values that are printed are off by more than 2 %"
    if float(found[2]) > 2.0 or not rounds_to(found[2], 100 * largest, 2):
        yield f"the largest change of what is printed is {largest:.3%}"


@rule("verdict", r"energy error <N>")
def _energy(facts, found):
    if float(found[1]) != float(f"{facts.summary['energy_error']:.0e}"):
        yield f"the energy error is {facts.summary['energy_error']:.2g}"


# --- Cells -----------------------------------------------------------------------------------------------------------


def history(facts: ResultFacts, variable: str, coordinate: str, name: str) -> np.ndarray:
    """A history of a run by name."""
    return facts.row(f"histories/{variable}", f"histories/{coordinate}", name)


def exceeded_by_history(facts: ResultFacts, variable: str, coordinate: str, name: str, ends: tuple[float, float]):
    """Contradictions between the extremes of a run and its histories, which are samples of it."""
    if name in facts.labels(f"histories/{coordinate}"):
        values, slack = history(facts, variable, coordinate, name), 1e-9 * max(abs(x) for x in ends if math.isfinite(x))
        if values.size and (values.min() < ends[0] - slack or values.max() > ends[1] + slack):
            yield f"the history of {name} reaches from {values.min():.6g} to {values.max():.6g}"


@rule("heading", "peak (force|moment)")
def _peak_force(facts, found, name, text):
    entry, unit = ("peak_force_n", "N") if found[1] == "force" else ("peak_moment_n_m", "N m")
    if facts.kind == "sweep":
        yield from _largest_of_curve(facts, name, text, (entry, "peak_force", "snubber", unit))
    elif facts.kind == "coexisting":
        yield from _of_motion(facts, name, text, (entry, "peak_force", "snubber", unit))
    else:
        value = facts.summary[entry][name]
        yield from cell(facts, text, value, unit, (entry, name))
        yield from exceeded_by_history(facts, "snubber_force", "snubber", name, (-math.inf, value))


@rule("heading", "in contact, times")
def _contact(facts, found, name, text):
    share, times = text.split(", ")
    share, mark = split_mark(share)
    yield from differs(facts, share, facts.summary["contact_share"][name], "1")
    yield from wrong_mark(facts, text, mark, ("contact_share", name))
    times, mark = split_mark(times)
    yield from wrong_mark(facts, text, mark, ("contacts", name))
    number = facts.labels("histories/snubber").index(name)
    own = facts.data["events/snubber"] == number if "events/snubber" in facts.data else np.zeros(0, dtype=bool)
    closings = int(facts.data["events/closing"][own].sum()) if own.size else 0
    if int(times) != closings:
        yield f"{closings} events close it"
    closed = history(facts, "snubber_closed", "snubber", name)
    if abs(float(share.split()[0]) / 100 - closed.mean()) > 3.0 * (closings + 1) / closed.size + 0.005:
        yield f"{closed.mean():.1%} of the samples are in contact"


@rule("heading", "displacement")
def _displacement(facts, found, name, text):
    if facts.kind == "sweep":
        yield from _largest_of_curve(facts, name, text, ("peak_displacement_m", "peak_displacement", "probe", "m"))
        return
    if facts.kind == "coexisting":
        yield from _of_motion(facts, name, text, ("peak_displacement_m", "peak_displacement", "probe", "m"))
        return
    low, high = text.split(" to ")
    low, _ = split_mark(low)
    plain, _ = split_mark(high)
    low = low if " " in low else f"{low} {plain.partition(' ')[2]}"
    ends = tuple(facts.summary[f"{end}_displacement_m"][name] for end in ("min", "max"))
    # of two ends with one unit the smaller has as many decimals as the larger
    yield from differs(facts, low, ends[0], "m", ("min_displacement_m", name), 1)
    yield from differs(facts, plain, ends[1], "m", ("max_displacement_m", name), 1)
    yield from wrong_mark(facts, text, split_mark(high)[1], ("max_displacement_m", name))
    facts.printed.add(("min_displacement_m", name))
    yield from exceeded_by_history(facts, "displacement", "probe", name, ends)


@rule("heading", "acceleration")
def _acceleration(facts, found, name, text):
    if facts.kind == "sweep":
        of = "peak_acceleration_g", "peak_absolute_acceleration", "probe", "m/s^2"
        yield from _largest_of_curve(facts, name, text, of)
        return
    value = facts.summary["peak_acceleration_g"][name] * GRAVITY
    yield from cell(facts, text, value, "m/s^2", ("peak_acceleration_g", name))


@rule("heading", "worst")
def _worst_of_best(facts, found, name, text):
    best = _best_number(facts, name)
    if text != best["worst"]:
        yield f"it is {best['worst']}"


@rule("heading", "limit")
def _limits_of_place(facts, found, name, text):
    if facts.kind == "designs":
        return  # which limit is the closest: compared with the margin beside it
    for part in text.split("; "):
        yield from _compared("line", f"{part} at {name}", facts)


def curve_number(facts: ResultFacts, name: str) -> tuple[int, str]:
    """Number and name of the curve of a row such as ``up, 2 g``.

    Raises
    ------
    StopIteration
        If there is none.
    """
    direction, _, level = name.partition(", ")
    for k, each in enumerate(facts.labels("curves/curve")):
        if facts.data["curves/direction"][k] == direction:
            number, _, unit = re.sub(r" \(.*", "", level).partition(" ")
            value = float(facts.data["curves/level"][k])
            scale = GRAVITY if unit == "g" else None
            if scale is None:
                scale = unit_of(unit)[1]
            if rounds_to(number, value / scale, 3):
                return k, each
    raise StopIteration


def _largest_of_curve(facts: ResultFacts, name: str, text: str, of: tuple[str, str, str, str]) -> Iterator[str]:
    """A cell ``1.2 mm at 65 Hz, tip`` of a sweep, against the cycles of its curve."""
    entry, variable, coordinate, unit = of
    number, curve = curve_number(facts, name)
    size, _, where = text.partition(" at ")
    found = re.match(r"([\d.e+-]+) Hz(?: \((.*?) from equilibrium at (.*?)\))?(?:, (.*))?$", where)
    names = facts.labels(f"cycles/{coordinate}")
    own = facts.data["cycles/curve"] == number
    table = facts.data[f"cycles/{variable}"][:, own]
    if unit not in ("m", "N m") and coordinate == "snubber":
        table = np.where(np.isfinite(table), table, -np.inf)
    if found is None:
        yield f"{text!r} has no place"
        return
    place = found[4] or (names[0] if len(names) == 1 else None)
    if place is None or place not in names:
        yield f"{text!r}: no {coordinate} {place!r}"
        return
    k, _ = np.unravel_index(np.nanargmax(table), table.shape)
    yield from cell(facts, size, float(table[names.index(place)].max()), unit, (entry, f"{curve} {place}"))
    if table[names.index(place)].max() < table[k].max() * (1 - 1e-9):
        yield f"{names[k]} has more, {table[k].max():.6g}"
    frequency = float(facts.data["cycles/frequency_hz"][own][np.argmax(table[names.index(place)])])
    if not rounds_to(found[1], frequency, 4):
        yield f"the largest is at {frequency:.6g} Hz"


@rule("heading", "in contact")
def _shares_of_curve(facts, found, name, text):
    _, curve = curve_number(facts, name)
    shares = facts.summary["contact_share"][curve]
    for part, (place, share) in zip(text.split(", "), shares.items(), strict=True):
        plain, mark = split_mark(part)
        yield from differs(facts, plain, share, "1")
        yield from wrong_mark(facts, part, mark, ("contact_share", f"{curve} {place}"))


# --- Continuations ---------------------------------------------------------------------------------------------------

PARAMETER_UNITS = {
    "frequency": "Hz",
    "level": "",
    "gap": "m",
    "stiffness": "N/m",
    "position": "m",
    "length": "m",
    "side": "m",
    "y": "m",
}


def parameter_unit(facts: ResultFacts) -> str:
    """SI unit of what a continuation follows."""
    return facts.units["points/parameter"]


def of_row(facts: ResultFacts, name: str) -> np.ndarray:
    """Which points belong to the branches of a row such as ``2 g, period 2``."""
    found = re.fullmatch(r"(.*?)(?:, )?(?:period (\d+))?", name)
    levels, periods = facts.data["branches/level"], facts.data["branches/period_multiple"]
    own = periods == int(found[2] or 1)
    if found[1]:
        own &= [not list(differs(facts, found[1], float(level), level_unit(facts))) for level in levels]
    return own[facts.data["points/branch"]]


def level_unit(facts: ResultFacts) -> str:
    """SI unit of the level of the excitation."""
    return facts.units.get("branches/level") or facts.units.get("curves/level") or "1"


@rule("heading", "frequency|level|gap|stiffness|position|length|side|y|energy|stiffness factor")
def _range(facts, found, name, text):
    if facts.kind == "nnm":
        yield from _of_backbone(facts, found[0], name, text)
        return
    inside = facts.data["points/parameter"][of_row(facts, name)]
    yield from extent(facts, text, float(inside.min()), float(inside.max()), parameter_unit(facts))


def extent(facts: ResultFacts, text: str, low: float, high: float, unit: str) -> Iterator[str]:
    """Contradictions of a range ``20 to 30 Hz``."""
    first, _, last = text.partition(" to ")
    last = last or first
    first = first if " " in first or " " not in last else f"{first} {last.partition(' ')[2]}"
    yield from differs(facts, first, low, unit, digits=4)
    yield from differs(facts, last, high, unit, digits=4)


@rule("heading", "largest displacement")
def _largest_displacement(facts, found, name, text):
    size, where, place = re.fullmatch(r"(.*?) at (.*), (.*)", text).groups()
    own = of_row(facts, name)
    peaks = facts.row("points/peak_displacement", "points/probe", place)
    stable = facts.data["points/stable"] & own
    value, at = max(
        (p["value_m"], p["parameter"]) for p in facts.summary["peaks"]
        if p["probe"] == place and not list(differs(facts, size.rstrip(" *~^"), p["value_m"], "m"))
    )  # fmt: skip
    yield from differs(facts, split_mark(size)[0], value, "m")
    yield from differs(facts, where, at, parameter_unit(facts), digits=4)
    largest = float(peaks[stable].max(initial=0.0))
    if largest > value * (1 + 1e-3):
        yield f"{place} reaches {largest:.6g} m in a stable motion"


@rule("heading", "stable")
def _stable(facts, found, name, text):
    if facts.kind == "nnm":
        return
    own = of_row(facts, name)
    stable, count = int(facts.data["points/stable"][own].sum()), int(own.sum())
    if text != ("all" if stable == count else f"{stable} of {count} points"):
        yield f"{stable} of {count} points are stable"


@rule("line", r"peak (force|moment) of stable motions (.*)")
def _stable_forces(facts, found):
    for part in found[2].split(", "):
        size, _, name = part.partition(" at ")
        entry, unit = ("peak_force_n", "N") if found[1] == "force" else ("peak_moment_n_m", "N m")
        peaks = facts.row("points/peak_force", "points/snubber", name)
        value = float(peaks[facts.data["points/stable"]].max())
        yield from cell(facts, size, value, unit, (entry, name))


SPECIAL = {"Neimark–Sacker bifurcation": "neimark_sacker"}


@rule("line", r"\d+ (?:grazing|fold|period doubling|Neimark|nonsmooth|branch|symmetry|pitchfork|secondary)[^:]*? at .*")
def _special_points(facts, found):
    counted = {}
    for part in found[0].split("; "):
        count, kind, where = re.fullmatch(r"(\d+) (.*?) at (.*)", part).groups()
        kind = kind if count == "1" else kind.removesuffix("s")
        name = SPECIAL.get(kind, kind.replace(" ", "_").replace("-", "_"))
        own = np.sort(facts.data["special_points/parameter"][facts.data["special_points/kind"] == name])
        counted[name] = int(count)
        if own.size != int(count):
            yield f"the table has {own.size} of {kind}"
        places, _, more = where.partition(" and ")
        unit = " " + places.split(", ")[-1].partition(" ")[2]
        texts = [each.removesuffix(unit) + unit for each in places.split(", ")]
        if more and int(more.split()[0]) != own.size - len(texts):
            yield f"{own.size - len(texts)} more are in the table"
        for each, value in zip(texts, own, strict=False):
            yield from differs(facts, each.strip(), float(value), parameter_unit(facts))
    if missing := set(facts.data["special_points/kind"]) - counted.keys():
        yield f"{missing} are in the table"


@rule(
    "line",
    r"(\d+) stable motions from (.*?)(?: at (?!\d[^:]*, by)(.*?))?(?:: (.*) reaches (.*) at (.*), by the start"
    r" \(kind: coexisting says how likely\))?(?:; (\d+) more ranges?)?",
)
def _coexisting_range(facts, found):
    low, _, high = found[2].partition(" to ")
    points, stable = facts.data["points/parameter"], facts.data["points/stable"]
    if found[4]:
        peaks = facts.row("points/peak_displacement", "points/probe", found[4])
        sizes = found[5].split(" or ")
        if len(sizes) > int(found[1]):
            yield f"{len(sizes)} sizes of {found[1]} motions"
        for size in sizes:
            near = peaks[stable]
            if all(list(differs(facts, size, float(x), "m", digits=2)) for x in np.concatenate([near, _between(near)])):
                yield f"no stable motion of {found[4]} reaches {size}"
    ends = [float(x.split()[0]) for x in (low, high)]
    unit = high.partition(" ")[2]
    if not (points.min() <= si(ends[0], unit) * (1 + 1e-4) and si(ends[1], unit) <= points.max() * (1 + 1e-4)):
        yield f"the points are from {points.min():.6g} to {points.max():.6g}"


def _between(values: np.ndarray) -> np.ndarray:
    """Values between neighbours, as an interpolation has them."""
    return np.concatenate([values[:-1] + t * np.diff(values) for t in np.linspace(0.02, 0.98, 49)])


def si(number: float, unit: str) -> float:
    """A number of a printed unit in SI."""
    return number * unit_of(unit)[1]


@rule("statement", r"No (stable motion was found|motion was followed) from (.*)")
def _without_stable(facts, found):
    points, stable = facts.data["points/parameter"], facts.data["points/stable"]
    unit = found[2].split()[-1]
    for part in found[2].split(", "):
        low, high = (si(float(x.removesuffix(f" {unit}")), unit) for x in part.removeprefix("from ").split(" to "))
        inside = (points > low * (1 + 1e-5)) & (points < high * (1 - 1e-5))
        if found[1].startswith("stable") and (inside & stable).any():
            yield f"{int((inside & stable).sum())} stable points are between {low:.6g} and {high:.6g}"
        if not found[1].startswith("stable") and inside.any():
            yield f"{int(inside.sum())} points are between {low:.6g} and {high:.6g}"
        if not found[1].startswith("motion") and not inside.any():
            yield f"no point at all is between {low:.6g} and {high:.6g}"


@rule("line", r"folds in (.*?): (.*), at (.*)")
def _fold_curves(facts, found):
    for curve in facts.summary["fold_curves"]:
        unit = {"level": level_unit(facts)}.get(found[1].split()[-1], PARAMETER_UNITS.get(found[1].split()[-1], "1"))
        ends = (curve["smallest_parameter"], curve["largest_parameter"])
        if not [
            *extent(facts, found[2], *ends, unit),
            *extent(facts, found[3], curve["smallest_hz"], curve["largest_hz"], "Hz"),
        ]:
            return
    yield "no such curve of folds is in the summary"


@rule("line", r"peak of (.*?) at (.*)")
def _peak_of_output(facts, found):
    name = max((name for name in facts.summary["peak_output"] if found[1].startswith(f"{name} ")), key=len)
    of, unit = facts.summary["peak_output"][name], facts.summary["output_unit"][name]
    yield from cell(facts, found[1].removeprefix(f"{name} "), of["value"], unit, ("peak_output", name))
    yield from differs(facts, found[2], of["parameter"], parameter_unit(facts), digits=4)


@rule("line", r"peak of (\S+) (.*), ([a-z ]+), (.*)")
def _peak_of_curve(facts, found):
    known = facts.summary["peak_output"][found[1]]
    name = max((name for name in known if found[2].startswith(f"{name} ")), key=len)
    k = facts.labels("cycles/output").index(name)
    size, key = found[2].removeprefix(f"{name} "), ("peak_output", f"{found[1]} {name}")
    if facts.data["cycles/output_quantity"][k] != found[3].replace(" ", "_"):
        yield f"it is a {facts.data['cycles/output_quantity'][k]}"
    yield from cell(facts, size, known[name], _si_unit(split_mark(size)[0]), key)
    own = facts.data["cycles/curve"] == facts.labels("curves/curve").index(found[1])
    ends = (facts.data[f"cycles/output_{end}"][k][own] for end in ("minimum", "maximum"))
    largest = max(float(np.nanmax(np.abs(x))) for x in ends)
    if not math.isclose(largest, known[name], rel_tol=1e-9):
        yield f"its cycles reach {largest:.6g}"


# --- Coexisting motions ----------------------------------------------------------------------------------------------


def _motion_of(facts: ResultFacts, name: str) -> dict[str, Any]:
    hz, number = re.fullmatch(r"([\d.]+) Hz, motion (\d+)", name).groups()
    return next(m for m in facts.summary["motions"] if m["number"] == int(number) and f"{m['frequency_hz']:.6g}" == hz)


def _of_motion(facts: ResultFacts, name: str, text: str, of: tuple[str, str, str, str]) -> Iterator[str]:
    entry, _, _, unit = of
    size, _, place = text.partition(", ")
    sizes = _motion_of(facts, name)[entry]
    yield from cell(facts, size, sizes[place], unit, (entry, place))
    if entry == "peak_force_n" and sizes[place] < max(sizes.values()):
        yield f"the largest is {max(sizes.values()):.6g}"


@rule("heading", "share of starts")
def _share_of_starts(facts, found, name, text):
    motion = _motion_of(facts, name)
    share, low, high = re.fullmatch(r"(.*? %) \((.*) to (.*) %\)", text).groups()
    for part, key in ((share, "share"), (f"{low} %", "share_low"), (f"{high} %", "share_high")):
        yield from differs(facts, part, motion[key], "1")
    if motion["starts"] and not math.isclose(motion["share"], motion["starts"] / facts.summary["starts"], rel_tol=1e-6):
        yield f"{motion['starts']} of {facts.summary['starts']} starts come to it"
    if not motion["share_low"] <= motion["share"] <= motion["share_high"]:
        yield "the interval does not hold its value"


@rule("heading", "motion")
def _kind_of_motion(facts, found, name, text):
    motion = _motion_of(facts, name)
    if text.startswith("unstable") == motion["stable"]:
        yield f"stable is {motion['stable']}"
    if found := re.search(r"multiplier ([\d.]+)", text):
        size = motion["largest_multiplier"]
        if not rounds_to(found[1], size):
            yield f"its largest multiplier is {size:.6g}"
        if (size > 1.0 + 1e-6) == motion["stable"]:
            yield f"its largest multiplier is {size:.6g}, and stable is {motion['stable']}"


@rule("verdict", r"(\d+) starts at each of (\d+) frequenc(?:y|ies)")
def _starts(facts, found):
    if (int(found[1]), int(found[2])) != (facts.summary["starts"], len(facts.summary["not_settled"])):
        yield f"there are {facts.summary['starts']} at {len(facts.summary['not_settled'])}"


@rule("line", r"(\d+) starts? at (.*) Hz did not settle")
def _not_settled(facts, found):
    if facts.summary["not_settled"][found[2]] != int(found[1]):
        yield f"{facts.summary['not_settled']} did not"


@rule(
    "line",
    r"(.* Hz, motion \d+): (?:no (.*) up to (.*) was found that leaves it|left by the (.*) of (.*), the"
    r" smallest found \((.*) into its period\))",
)
def _left_by(facts, found):
    hz, number = re.fullmatch(r"([\d.]+) Hz, motion (\d+)", found[1]).groups()
    texts = (found[3], found[5])
    for each in facts.summary["disturbances"]:
        if each["number"] == int(number) and f"{each['frequency_hz']:.6g}" == hz:
            known = each["amplitude"] is not None and not math.isnan(each["amplitude"])
            value = abs(each["amplitude"]) if known else each["largest_tried"]
            if known == bool(found[4]) and not list(differs(facts, texts[known], value, each["unit"])):
                return
    yield "no such disturbance is in the file"


# --- Nonlinear modes -------------------------------------------------------------------------------------------------


def _of_backbone(facts: ResultFacts, heading: str, name: str, text: str) -> Iterator[str]:
    """A cell of the start, the end or a point that was asked for of a backbone."""
    points = [facts.summary[name]] if name in ("start", "end") else facts.summary["requested_points"]
    of = {"frequency": ("frequency_hz", "Hz"), "energy": ("energy_j", "J"), "stiffness factor": ("parameter", "1")}
    key, unit = of[heading]
    plain, _ = split_mark(text)
    if all(list(differs(facts, plain, point[key], unit, digits=2)) for point in points):
        yield f"the file has {[point[key] for point in points]}"
    ends = {"start": 0, "end": -1}
    if name in ends and heading in ("frequency", "energy") and not facts.summary.get("phase_resonance"):
        curve = facts.data["points/frequency_hz" if heading == "frequency" else "points/energy"]
        own = facts.data["points/branch"] == 0
        if list(differs(facts, plain, float(curve[own][ends[name]]), unit, digits=2)):
            yield f"the {name} of the first branch has {curve[own][ends[name]]:.6g}"


@rule(
    "line",
    r"mode (\d+): (\d+) points, (?:(\d+)|all) stable, in ([a-z ]+?)(?:, (.*?) at (.*?))?; linear frequency <Q>",
)
def _backbone(facts, found):
    s, stable = facts.summary, facts.data["points/stable"]
    whole = s["points"], s["stable_points"], s["mode"]
    if whole[::2] != (int(found[2]), int(found[1])) or int(found[3] or found[2]) != whole[1]:
        yield f"the file has {whole[0]} points of mode {whole[2]}, {whole[1]} stable"
    main = facts.data["branches/kind"][facts.data["points/branch"]] == facts.data["branches/kind"][0]
    if int(stable[main].sum()) != whole[1] and int(stable.sum()) != whole[1]:
        yield f"{int(stable[main].sum())} points of the backbone are stable"
    if found[4].replace(" ", "_") != s["continued_in"]:
        yield f"it is followed in {s['continued_in']}"
    yield from differs(facts, found[7], s["linear_frequency_hz"], "Hz")
    if found[5]:
        yield from extent(facts, found[5], s["start"]["frequency_hz"], s["end"]["frequency_hz"], "Hz")
        yield from extent(facts, found[6], s["start"]["energy_j"], s["end"]["energy_j"], "J")


@rule("line", r"internal resonances at ([a-z ]+) (.*)")
def _resonances(facts, found):
    text, _, more = found[2].partition(" and ")
    parts = re.findall(r"(.*?) \((.*?)\)(?:, |$)", text)
    known = facts.summary["internal_resonances"]
    count = len(parts) + (int(more.split()[0]) if more else 0)
    if count != len(known):
        yield f"the file has {len(known)}"
    for (where, cause), of in zip(parts, known, strict=False):
        yield from differs(facts, where, of["parameter"], parameter_unit(facts))
        traced = (
            f"{of['ratio']}:1 with mode {of['mode']}" if of["ratio"] and of["mode"] else "of high order, not traced"
        )
        if cause != traced:
            yield f"it is {traced}"


@rule("line", r"along the backbone: (.*)")
def _along(facts, found):
    for part in found[1].split(", "):
        count, kind = part.split(" ", 1)
        kind = kind if count == "1" else kind.removesuffix("s")
        name = SPECIAL.get(kind, kind.replace(" ", "_").replace("-", "_"))
        size = len(facts.summary["jumps"]) if kind == "jump" else int((facts.data["special_points/kind"] == name).sum())
        if size != int(count):
            yield f"the file has {size} of {kind}"


@rule("line", r"after (\d+) periods the drawn motion differs by <N> % from its start: it is unstable, and .*")
def _drift(facts, found):
    if int(found[1]) != facts.summary["motion_periods"] or not rounds_to(
        found[2], 100 * facts.summary["motion_drift"], 2
    ):
        yield f"it is {facts.summary['motion_drift']:.3g} after {facts.summary['motion_periods']}"


@rule("line", r"full period: (\d+) branch(?:es)? of motions that are never at rest")
def _never_at_rest(facts, found):
    if int(found[1]) != len(facts.summary["full_period"]["never_at_rest"]):
        yield f"there are {len(facts.summary['full_period']['never_at_rest'])}"


@rule(
    "line",
    r"multiple scales: differences (?:of the frequency|from the exact motions) (?:vanish with orders (.*)|have"
    r" no order .*)",
)
def _orders(facts, found):
    of = facts.summary["multiple_scales"]
    of = of if isinstance(of, list) else [of]
    key = "observed_order_frequency" if "observed_order_frequency" in of[0] else "observed_orders"
    for each in of:
        orders = [x for x in each[key] if x is not None and not math.isnan(x)]
        if [f"{x:.2f}" for x in orders] == [x for x in (found[1] or "").split(", ") if x not in ("", "unknown")]:
            return
    yield f"the orders are {[each[key] for each in of]}"


@rule(
    "line",
    r"relaxed minimisation: (.*) of (\d+) steps, frequency within <N> % of the exact one|relaxed minimisation: .*",
)
def _minimisation(facts, found):
    of = next((v for k, v in facts.summary.items() if "minimisation" in k or "relaxed" in k), None)
    if of is None:
        yield "the file has no minimisation"


@rule("heading", "resonance|predicted resonance|amplitude of .*|predicted amplitude|predicted level")
def _held(facts, found, name, text):
    about = facts.summary["phase_resonance"]
    level = next(x for x in about["levels"] if not list(differs(facts, name, x["level"], about["unit"])))
    keys = {"resonance": ("frequency_hz", "Hz"), "predicted resonance": ("predicted_frequency_hz", "Hz"),
            "predicted amplitude": ("predicted_amplitude_m", "m"),
            "predicted level": ("level_for_amplitude", about["unit"])}  # fmt: skip
    key, unit = keys.get(found[0], ("amplitude_m", "m"))
    if text == "not found":
        if level["found"]:
            yield "it is found"
        return
    yield from differs(facts, text, level[key], unit)


# --- Lines of runs and sweeps ----------------------------------------------------------------------------------------


@rule("line", r"bending stress <Q>((?: [*~^])?) at (?:(\S+), )?x = <Q>(?:, y = <Q>)?")
def _stress(facts, found):
    s = facts.summary
    yield from cell(facts, found[1] + found[2], s["largest_bending_stress_pa"], "Pa", ("largest_bending_stress_pa", ""))
    yield from differs(facts, _metres(found[4]), s["largest_bending_stress_position_m"], "m")
    if found[5]:
        yield from differs(facts, _metres(found[5]), s["largest_bending_stress_across_m"], "m")
    if found[3] and found[3] != s["largest_bending_stress_body"]:
        yield f"it is in {s['largest_bending_stress_body']}"
    stress = facts.data["bodies/peak_bending_stress"]
    largest = float(np.nanmax(stress))
    if largest > s["largest_bending_stress_pa"] * (1 + 1e-6):
        yield f"the stress reaches {largest:.6g} Pa"


def _metres(text: str) -> str:
    return "0 m" if text == "0" else text


@rule("line", r"((?:(?! not predicted: ).)*?) (opens?|touch(?:es)?) (.*)")
def _opening(facts, found):
    names = re.sub(r" and \d+ more$", "", found[1]).split(", ")
    for name in names:
        of = facts.summary["gapping"][name]
        if of["closed_at_rest"] != found[2].startswith("open"):
            yield f"{name} is {'closed' if of['closed_at_rest'] else 'open'} at rest"
        yield from _opening_level(facts, found[3], name, of)


COINCIDES = re.compile(r"(?P<lowest>.*?); this test comes closest there, where that is (?P<times>\S+) times its level")
CLOSEST = re.compile(
    r"(?P<lowest>.*?); this test comes closest at (?P<hz>\S+) Hz, where it (?:opens|touches) from"
    r" (?P<level>.*?), (?P<times>\S+) times the level there"
)
LEVEL = re.compile(
    r"from (?P<level>.*?) at (?P<at>\S+ \S+) in (?:steady )?linear motion(?P<above>, above the level (?:here"
    r"|there))?(?P<mark> [*~^])?"
)


def _opening_level(facts: ResultFacts, text: str, name: str, of: dict[str, Any]) -> Iterator[str]:
    """Level and place at which a contact first changes: the lowest, and the one that comes closest to a test."""
    if closest := CLOSEST.fullmatch(text):
        test = facts.summary["closest_to_test"][name]
        yield from differs(facts, f"{closest['hz']} Hz", test["frequency_hz"], "Hz")
        yield from _level(facts, closest["level"], test)
        if not rounds_to(closest["times"], test["share_of_level"]):
            yield f"it is {test['share_of_level']:.4g} times the level there"
        if test["level"] < of["level"] * (1 - 1e-9):
            yield "what comes closest is lower than the lowest"
        text = closest["lowest"]
    elif same := COINCIDES.fullmatch(text):
        test = facts.summary["closest_to_test"][name]
        if test["frequency_hz"] != of["frequency_hz"]:
            yield f"this test comes closest at {test['frequency_hz']:.4g} Hz"
        if not rounds_to(same["times"], test["share_of_level"]):
            yield f"it is {test['share_of_level']:.4g} times the level there"
        text = same["lowest"]
    elif name in facts.summary.get("closest_to_test", {}) and "; " not in text:
        yield "where the test comes closest is not named"
    text = text.split("; ")[0]
    if sigma := re.fullmatch(r"at (\S+) sigma of the stationary linear motion(, rarely or never)?(?: [*~^])?", text):
        if not rounds_to(sigma[1], of["sigmas"]) or bool(sigma[2]) != (of["sigmas"] >= 5.0):
            yield f"it does so at {of['sigmas']:.4g} sigma"
        return
    if text.split(" *")[0] in ("as soon as it moves", "at no level of this input in linear motion"):
        return
    found = LEVEL.fullmatch(text)
    if found is None:
        yield f"{text!r}: no rule knows this level"
        return
    where = ("frequency_hz", "Hz") if "frequency_hz" in of else ("time_s", "s")
    yield from differs(facts, found["at"], of[where[0]], where[1])
    if times := re.fullmatch(r"(\S+) times this input", found["level"]):
        if not rounds_to(times[1], of["share_of_level"]):
            yield f"it is {of['share_of_level']:.4g} times the input"
    else:
        yield from _level(facts, found["level"], of)
    if bool(found["above"]) != (of["share_of_level"] > 1.0):
        yield f"the level is {of['share_of_level']:.4g} of the one here"
    if "linear/frequency_hz" in facts.data and "frequency_hz" in of:
        yield from _lowest(facts, name, of)


def _level(facts: ResultFacts, text: str, of: dict[str, Any]) -> Iterator[str]:
    """A level; of a moved base also as its acceleration, in parentheses that come last."""
    found = re.fullmatch(r"(.*?)(?: \((.*)\))?", text)
    unit = "m/s^2" if (found[2] or text).endswith(" g") else level_unit_of(facts)
    yield from differs(facts, (found[2] and _acceleration_of(found)) or text, of["level"], unit)


def _acceleration_of(found: re.Match[str]) -> str:
    return found[2] if found[2].endswith(" g") else found[1]


def level_unit_of(facts: ResultFacts) -> str:
    """SI unit of the level of the excitation, which a base has in m/s^2."""
    quantity = (facts.scenario.get("excitation") or {}).get("quantity")
    applied = (facts.scenario.get("excitation") or {}).get("applied_to")
    return {None: "m/s^2" if applied == "base" else "N", "force": "N", "moment": "N m"}.get(quantity, "m/s^2")


def _lowest(facts: ResultFacts, name: str, of: dict[str, Any]) -> Iterator[str]:
    """The level of a sweep is the lowest of the curve over frequency, whose grid may miss it by its spacing."""
    numbers = facts.labels("linear/snubber")
    variable = "contact_loss" if of["closed_at_rest"] else "contact_onset"
    if name not in numbers or f"linear/{variable}" not in facts.data:
        return
    levels, hz = facts.data[f"linear/{variable}"][numbers.index(name)], facts.data["linear/frequency_hz"]
    known = np.isfinite(levels)
    if known.any() and np.nanmin(levels[known]) < of["level"] * (1 - 1e-6):
        lowest = np.nanargmin(levels[known])
        yield f"the linear motion changes it from {levels[known][lowest]:.6g} at {hz[known][lowest]:.5g} Hz"


@rule("line", r"(.*?) not predicted: (.*)")
def _not_predicted(facts, found):
    for name in re.sub(r" and \d+ more$", "", found[1]).split(", "):
        of, test = (facts.summary.get(key, {}).get(name, {}) for key in ("gapping", "closest_to_test"))
        reasons = [each.get("not_predicted") for each in (of, test) if each]
        said = re.split(r"; in this test, raised as a whole, ", split_mark(found[2])[0])
        if said != list(dict.fromkeys(reasons))[: len(said)]:
            yield f"the file says {reasons}"


@rule("line", r"compared with limits: (.*) by the (.*)")
def _statistic(facts, found):
    for label in re.sub(r" and \d+ more$", "", found[1]).split(", "):
        facts.statistics[label] = found[2]
    known = {item.get("statistic") for item in facts.summary["margins"].values()}
    if found[2] not in known:
        yield f"the file says {known}"
    tested = "test_duration" in (facts.scenario.get("run") or {})
    if not tested and "test_duration" in found[2]:
        yield "no test_duration is given"


@rule("line", r"(.*?) exceeded in (\d+) of (\d+) sweeps: (.*)")
def _exceeded_sweeps(facts, found):
    own, scale, _ = LIMITED[found[1].split(" of ")[0]]
    place = found[1].partition(" of ")[2]
    name = "_".join(found[1].split(" of ")[0].split()) + (f".{place}" if place else "")
    limit = facts.summary["margins"][name]["limit"]
    sizes = {
        curve: max(x for at, x in of.items() if place in ("", at)) * scale for curve, of in facts.summary[own].items()
    }
    over = [curve for curve, size in sizes.items() if size > limit]
    if (int(found[2]), int(found[3])) != (len(over), len(sizes)):
        yield f"{len(over)} of {len(sizes)} exceed it"
    for text, curve in zip(found[4].split("; "), over, strict=False):
        if curve_number(facts, text)[1] != curve:
            yield f"{text} does not exceed it"


VERDICT = r"(ok|EXCEEDED|NOT RELIABLE|UNDECIDED)"


@rule("line", rf"(.*?) {VERDICT}, margin (\S+(?: %| dB)?)(?: at (.*))?")
def _limit(facts, found):
    label, verdict, margin, at = found.groups()
    name, of = _margin_of(facts, label, at)
    if of is None:
        yield f"no limit is called {label}"
        return
    limit, value = _limit_of(facts, name), of["value"]
    if limit is not None and not math.isclose(limit, of["limit"], rel_tol=1e-9):
        yield f"the case limits {name} to {limit:.6g}, not to {of['limit']:.6g}"
    yield from _verdict_of(of, verdict.lower())
    if at and of["at"] and at not in (of["at"], of["at"].split(",")[0]):
        yield f"it is largest at {of['at']}"
    if margin.endswith("dB"):
        if not rounds_to(margin.split()[0], of["margin_db"], 2):
            yield f"the margin is {of['margin_db']:.3f} dB"
    elif margin not in ("infinite", "unknown") and not rounds_to(margin.split()[0], 100 * (of["limit"] / value - 1.0)):
        yield f"the margin is {of['limit'] / value - 1.0:.3%}"
    yield from _limited_value(facts, name, of)


def _margin_of(facts: ResultFacts, label: str, at: str | None = None) -> tuple[str, dict[str, Any] | None]:
    """Name and margin of a limit by what it is called, which at the place that it is on is without that."""
    for name, of in facts.summary["margins"].items():
        limit, _, place = name.partition(".")
        words = limit.upper() if limit in ("srs", "psd") else limit.replace("_", " ")
        if limit == "outputs":
            names = {f"output {place}"}
        elif place:
            names = {f"{words} of {place}", *([words] if at is not None and at.startswith(place) else ())}
        else:
            names = {words}
        if label in names:
            return name, of
    return "", None


def _limit_of(facts: ResultFacts, name: str) -> float | None:
    """What the case limits something to, SI; None of curves."""
    limit, _, place = name.partition(".")
    of = facts.scenario["limits"][limit]
    of = of.get(place, of) if isinstance(of, dict) else of
    return float(of) if isinstance(of, int | float) else None


def _verdict_of(of: dict[str, Any], verdict: str) -> Iterator[str]:
    """Contradictions between a verdict and the range, or interval, of its value."""
    low, high, limit = of.get("lowest", of["value"]), of.get("highest", of["value"]), of["limit"] * (1 + 1e-12)
    low, high = (math.nan if x is None else x for x in (low, high))
    right = {"exceeded": low > limit, "ok": high <= limit}.get(verdict)
    if "held_within" in of:
        return
    if right is False:
        yield f"the value is between {low:.6g} and {high:.6g}, the limit is {limit:.6g}"
    between = of.get("interval_low") is not None and of["interval_low"] <= of["limit"] < of["interval_high"]
    if verdict == "undecided" and not between:
        yield f"the interval {of.get('interval_low')} to {of.get('interval_high')} does not hold the limit"
    if verdict == "not reliable" and (high <= limit or low > limit) and not math.isnan(low + high):
        yield f"the value is between {low:.6g} and {high:.6g}, which decides about {limit:.6g}"


def _limited_value(facts: ResultFacts, name: str, of: dict[str, Any]) -> Iterator[str]:
    """The value of a limit is the largest of the places that it is on; of runs with a statistic what that says."""
    limit, _, place = name.partition(".")
    entry, scale, _ = LIMITED.get(limit.replace("_", " "), ("", 0.0, ""))
    found = facts.summary.get(entry)
    if facts.kind != "run" or found is None or of.get("statistic", "").startswith(("upper", "median", "mean")):
        return
    sizes = {"": found} if not isinstance(found, dict) else found if not place else {place: found[place]}
    if not math.isclose(of["value"], scale * max(sizes.values()), rel_tol=1e-9):
        yield f"the largest is {scale * max(sizes.values()):.6g}"


@rule("line", r"(.*?) is met by that value alone: the run reached <Q>")
def _met_alone(facts, found):
    _, of = _margin_of(facts, found[1])
    if of is None or of["verdict"] != "ok" or not of["reached"] > of["limit"]:
        yield f"the file says {of}"
    else:
        yield from differs(facts, found[2], of["reached"], _unit_of_limit(found[1]), digits=4)


@rule("line", r"(.*?) undecided: (.*?) to (.*?) at 95 %, the limit (.*?) between them; (.*)")
def _undecided(facts, found):
    label, low, high, limit, after = found.groups()
    _, of = _margin_of(facts, label)
    unit = _unit_of_limit(label)
    for text, key in ((low, "interval_low"), (high, "interval_high"), (limit, "limit")):
        yield from differs(facts, text, of[key], unit, digits=4)
    if of["verdict"] != "undecided" or not of["interval_low"] <= of["limit"] < of["interval_high"]:
        yield f"the verdict is {of['verdict']}"
    if longer := re.search(r"a duration of about (.*)", after):
        yield from differs(facts, longer[1], of["decided_after_s"], "s", digits=2)
        if of["decided_after_s"] <= facts.scenario["run"]["duration"]:
            yield "that is no longer run"


def _unit_of_limit(label: str) -> str:
    return next((unit for words, (_, _, unit) in LIMITED.items() if label.startswith(words)), "1")


@rule("line", r"largest in (.*?) of test: (.*)")
def _largest_of_test(facts, found):
    yield from differs(facts, found[1], float(facts.data["random/test_duration_s"]), "s")
    names = [
        f"{n} {q.replace('_', ' ')}"
        for n, q in zip(facts.labels("random/name"), facts.labels("random/quantity"), strict=True)
    ]
    for part in re.split(r", (?=[^()]*(?:\(|not reliable))|, (?=[^()]*$)", re.sub(r" and \d+ more$", "", found[2])):
        size = re.fullmatch(r"(.*?) (?:not reliable|(<Q>) \((<Q>) to (<Q>), 95 %\))".replace("(<Q>)", _QUANTITY), part)
        if size is None or size[1] not in names:
            yield f"{part!r}: no signal has this name"
            continue
        k = names.index(size[1])
        if size[2] is None:
            continue
        values = [float(facts.data[f"random/expected_peak{end}"][k]) for end in ("", "_low", "_high")]
        for text, value in zip(size.groups()[1:], values, strict=True):
            yield from differs(facts, text, value, {"g": "m/s^2"}.get(text.split()[-1], _si_unit(text)))
        yield from _holds(values)
        yield from _below_reached(facts, size[1], k, values)


def _holds(values: list[float]) -> Iterator[str]:
    if not values[1] <= values[0] <= values[2]:
        yield f"the interval {values[1]:.4g} to {values[2]:.4g} does not hold {values[0]:.4g}"


def _below_reached(facts: ResultFacts, name: str, k: int, values: list[float]) -> Iterator[str]:
    """The largest of a test that is as long as the run is no less than what the run reached."""
    place, _, quantity = name.partition(" ")
    entry = {"force": "peak_force_n", "displacement": "peak_displacement_m"}.get(quantity)
    place = facts.labels("random/name")[k]
    longer = float(facts.data["random/test_duration_s"]) >= facts.scenario["run"]["duration"]
    if entry and longer and min(values) < facts.summary[entry].get(place, 0.0) * (1 - 1e-9):
        yield f"the run reached {facts.summary[entry][place]:.6g}"


def _si_unit(text: str) -> str:
    """SI unit of a quantity, or of the last of a range."""
    return unit_of(text.rpartition(" to ")[2].partition(" ")[2])[0]


_QUANTITY = r"([-\d.e+]+(?: [^\s(),]+(?: (?:m|s)(?=[ ,)]))?)?|infinity|unknown)"


@rule("line", r"peaks of outputs: (.*)")
def _outputs(facts, found):
    for part in re.sub(r" and \d+ more$", "", found[1]).split(", "):
        plain, mark = split_mark(part)
        name = max((n for n in facts.summary["peak_output"] if plain.startswith(f"{n} ")), key=len)
        text, unit = plain.removeprefix(f"{name} "), facts.summary["output_unit"][name]
        yield from differs(facts, text, facts.summary["peak_output"][name], unit, ("peak_output", name))
        yield from wrong_mark(facts, part, mark, ("peak_output", name))


@rule("line", r"(excitation\S*): rms (.*)")
def _input(facts, found):
    number = facts.labels("inputs/path").index(found[1])
    rms, band, *_ = found[2].split(";")[0].split(", ")
    yield from differs(facts, rms, float(facts.data["inputs/rms"][number]), _si_unit(rms), digits=4)
    if " to " in band:
        yield from extent(facts, band, *(float(facts.data[f"inputs/{end}_hz"][number]) for end in ("from", "to")), "Hz")


@rule("line", r"base motion: spectrum <N> to <N> dB from the curve, (\S+) to (\S+) Hz, Q = (\S+)")
def _matched(facts, found):
    of = facts.summary["matched"]
    for text, key in zip(found.groups(), ("lowest_db", "highest_db", "from_hz", "to_hz", "quality"), strict=True):
        if not rounds_to(text, of[key], 2):
            yield f"{key} is {of[key]:.4g}"


_DAMAGE = r"([\d.e+-]+)(?: \(([\d.e+-]+) to ([\d.e+-]+), 95 %\))? in (.*?)"


@rule("line", rf"damage of (\S+) {_DAMAGE}(?:, {_DAMAGE} of test)?(?:, life (.*?))?, at (.*)")
def _damage(facts, found):
    body, run = facts.summary["fatigue"][found[1]], facts.scenario["run"]
    times = {5: float(facts.data["histories/time"][-1]), 9: run.get("test_duration") or math.nan}
    for last, duration in times.items():
        if found[last] is None:
            continue
        yield from differs(facts, found[last], duration, "s")
        sizes = [body[name] for name in ("damage", "damage_low", "damage_high") if name in body]
        for text, size in zip(found.groups()[last - 4 : last - 1], sizes, strict=False):
            if text is None or not rounds_to(text, size * duration / times[5], 2):
                yield f"the damage in {duration:g} s is {size * duration / times[5]:.3g}"
    if (found[9] is None) != ("test_duration" not in run):
        yield "damage of the test goes with run.test_duration"
    if found[10]:
        yield from differs(facts, found[10], body["life_s"], "s")
        yield from differs(facts, found[10], times[5] / body["damage"], "s")
    if (place := re.fullmatch(r"x = (.*)", found[11])) is not None:
        yield from differs(facts, "0 m" if place[1] == "0" else place[1], body["position"], "m")


@rule("line", r"(peak (?:[a-z ]|of \S+)*): (\S+ \+.*)")
def _sensitivity(facts, found):
    columns = ("path", "change", "response", "tolerance", "change_below")
    rows = list(zip(*(facts.data[f"sensitivities/{column}"] for column in columns), strict=True))  # fmt: skip
    quantity, _, place = found[1].partition(" of ")
    own = [row for row in rows if place in row[2].split("/") and quantity.replace(" ", "_") in row[2]]
    sizes, path = [], ""
    for part in re.sub(r" and \d+ more$", "", found[2]).split(", "):
        named, side, tolerance, change = re.fullmatch(r"(?:(\S+) )?([+-])(.*?): (.*)", part).groups()
        path = named or path
        near = [row for row in own if row[0] == path]
        if not near:
            yield f"{path} is not in the file"
            continue
        changed = float(near[0][1 if side == "+" else 4])
        if list(differs(facts, change.replace("+", ""), changed, _si_unit(change))):
            yield f"{path} changes it by {changed:.4g}"
        yield from differs(facts, tolerance, float(near[0][3]), _si_unit(tolerance))
        if named:
            sizes.append(_size_of_change(near[0]))
    if sizes != sorted(sizes, reverse=True) or (
        own and sizes and sizes[0] < max(map(_size_of_change, own)) * (1 - 1e-9)
    ):
        yield "the largest change does not come first"


def _size_of_change(row):
    """The larger change of a value where a number is larger and where it is smaller by its tolerance."""
    return max(abs(float(row[1])), abs(float(row[4])))


@rule("line", r"\* off by more than 2 %")
def _star(facts, found):
    if not facts.printed & facts.keys("doubtful"):
        yield "nothing that is printed does"


@rule("line", r"~ one of many motions: .*")
def _tilde(facts, found):
    if not facts.printed & facts.keys("after_parting"):
        yield "nothing that is printed is"


@rule("line", r"\^ has no limit, it grows with the modes, since a force jumps at a point with little mass: .*")
def _caret(facts, found):
    if not facts.printed & facts.keys("without_limit"):
        yield "nothing that is printed does"


@rule("line", r"(\S+): displacements differ by at most <N> %(?: until (\S+) s, where the contact sequences diverge)?")
def _against(facts, found):
    of = facts.summary["against"]
    if not rounds_to(found[2], 100 * of["largest_state_difference"], 2):
        yield f"they differ by {of['largest_state_difference']:.3g}"


@rule("line", r"(\S+) (.*) at most (.*) at (\S+) Hz, (.*) of (.*)")
def _notch_limit(facts, found):
    names = [k for k in facts.data if k.startswith("notch") and k.endswith("largest")]
    if names and not any(
        rounds_to(found[3].split()[0], float(x) / s, 3)
        for name in names
        for x in facts.data[name].ravel()
        for s in (1.0, 1e-3, GRAVITY, 1e3)
    ):
        yield "no such largest value is in the file"


@rule("line", r"(\S+) range (\d+) (\S+) to (\S+) Hz by (.*), lowest level (.*) at (\S+) Hz")
def _notch_range(facts, found):
    low, high, at = (float(found[k]) for k in (3, 4, 7))
    if not low <= at <= high:
        yield "the lowest level is outside its range"


@rule(
    "line",
    r"(sweep|excitation)\S*: the level of the profile jumps at <N> Hz from <Q> to <Q> \(([-+]\d+\.\d) dB\); let the"
    r" levels meet(?: \(they meet at <N> Hz\))?",
)
def _jump(facts, found):
    points = facts.scenario[found[1]]["profile"]
    if not any(rounds_to(found[2], float(point["frequency"]), 4) for point in points):
        yield "no point of the profile has this frequency"
    before, after = (float(text.split()[0]) * unit_of(text.partition(" ")[2])[1] for text in found.groups()[2:4])
    if abs(20 * math.log10(after / before) - float(found[5])) > 0.06:
        yield f"it is {20 * math.log10(after / before):+.2f} dB"


@rule("line", r"\d+ more levels and periods in the file")
def _more_levels(facts, found):
    keys = {
        (float(a) if not math.isnan(a) else None, int(b))
        for a, b in zip(facts.data["branches/level"], facts.data["branches/period_multiple"], strict=True)
    }
    if int(found[0].split()[0]) != len(keys) - 8:
        yield f"there are {len(keys)}"


# --- Studies ---------------------------------------------------------------------------------------------------------

CASES = (
    r"(grid of (?:[\d x]+ = )?|one parameter at a time, |search of |Latin-hypercube sample of |Sobol' sample of |"
    r"ensemble of |)(\d+) cases?"
)


@rule("verdict", CASES)
def _cases(facts, found):
    if int(found[2]) != facts.data["cases/case"].size:
        yield f"the table has {facts.data['cases/case'].size}"
    if (sides := re.findall(r"\d+(?= x| =)", found[1])) and math.prod(map(int, sides)) != int(found[2]):
        yield "its sides do not multiply to that"
    begins = {
        "grid": "grid of",
        "optimise": "search of",
        "latin_hypercube": "Latin",
        "sobol": "Sobol'",
        "one_at_a_time": "one parameter",
    }
    if not found[1].startswith(begins.get(str(facts.data["cases/kind"]), "")):
        yield f"the study is a {facts.data['cases/kind']}"


@rule("verdict", r"each a ([a-z ]+)")
def _each(facts, found):
    if found[1].replace(" ", "_") != facts.summary["analysis"]:
        yield f"each is a {facts.summary['analysis']}"


@rule("verdict", r"(\d+) (solved|FAILED|not reliable)")
def _counts(facts, found):
    counts = {"solved": facts.data["cases/solved"].sum(), "FAILED": facts.summary["failed"],
              "not reliable": facts.summary["not_reliable"]}  # fmt: skip
    if int(found[1]) != counts[found[2]]:
        yield f"the table has {counts[found[2]]}"


@rule(
    "verdict",
    r"(?:(\d+) of (\d+) cases meet|no case meets) (the limit|every limit)(?: in all realisations| at the <N> %"
    r" quantile of its realisations)?",
)
def _passing(facts, found):
    passing = int(facts.data["cases/passing"].sum())
    if int(found[1] or 0) != passing or int(found[2] or facts.data["cases/case"].size) != facts.data["cases/case"].size:
        yield f"{passing} of {facts.data['cases/case'].size} pass"
    if (found[3] == "every limit") != (len(facts.labels("cases/limit")) > 1):
        yield f"there are {len(facts.labels('cases/limit'))} limits"
    if found[4] and not rounds_to(found[4], 100 * facts.summary["tolerances"]["quantile"]):
        yield f"the quantile is {facts.summary['tolerances']['quantile']}"


@rule("verdict", r"probability of exceeding (?:every|a) limit (.*)")
def _probability(facts, found):
    of = facts.summary["reliability"]
    number = re.match(r"(below )?([\d.e+-]+)", found[1])
    value = of["high"] if number and number[1] else of["probability"]
    if number is None or not rounds_to(number[2], value, 1):
        yield f"it is {of['probability']}"
    often = re.search(r"\(one in ([\d ]+)\)", found[1])
    if often and float(often[1].replace(" ", "")) != float(f"{1 / of['probability']:.2g}"):
        yield f"it is one in {1 / of['probability']:.4g}"


@rule("verdict", r"(\d+) histories")
def _histories(facts, found):
    if int(found[1]) != facts.summary["reliability"]["histories"]:
        yield f"there are {facts.summary['reliability']['histories']}"


@rule("line", r"95 % interval <N> to <N>, coefficient of variation <N> %")
def _interval_of_probability(facts, found):
    of = facts.summary["reliability"]
    for text, value in zip(found.groups(), (of["low"], of["high"], 100 * of["coefficient_of_variation"]), strict=True):
        if not rounds_to(text, value, 1):
            yield f"{text} is printed of {value:.4g}"
    if not of["low"] <= of["probability"] <= of["high"]:
        yield "the interval does not hold its value"


@rule("line", r"reliability index <N>, design point at a distance of <N> \((.*)\)")
def _index(facts, found):
    of = facts.summary["reliability"]
    if not rounds_to(found[1], of["reliability_index"]) or not rounds_to(found[2], of["distance"]):
        yield f"they are {of['reliability_index']:.4g} and {of['distance']:.4g}"


@rule(
    "line",
    r"(?:(\d+) failure regions? found(?:, with (.*) of the probability)?)?(?:; )?(?:subset simulation finds <N>)?",
)
def _regions(facts, found):
    shares = facts.data.get("regions/share", np.zeros(0))
    if not found[0] or (found[1] and int(found[1]) != shares.size):
        yield f"the file has {shares.size}"
    for text, share in zip(re.findall(r"(\d+) %", found[2] or ""), shares, strict=False):
        if abs(float(text) - 100 * share) > 0.5 + 1e-9:
            yield f"{text} % is printed of {share:.3%}"
    if found[3] and not rounds_to(found[3], facts.summary["reliability"]["cross_check"], 2):
        yield f"it finds {facts.summary['reliability']['cross_check']:.3g}"


@rule("line", r"(?:(\d+)|none|all)(?: of (\d+))? cases compared with a finer model(?:, the other (\d+ )?not)?")
def _compared_cases(facts, found):
    compared, count = int(facts.data["cases/compared"].sum()), facts.data["cases/case"].size
    said = count if found[0].startswith("all") else int(found[1] or 0)
    if (
        said != compared
        or int(found[2] or count) != count
        or ("other" in found[0] and int(found[3] or 1) != count - compared)
    ):
        yield f"{compared} of {count} are"


@rule("line", r"best: (.*)")
def _objective(facts, found):
    if not found[1].startswith(facts.summary["objective"]):
        yield f"it is the {facts.summary['objective']}"


def responses_called(facts: ResultFacts, label: str) -> list[str]:
    """Responses that a label stands for: place and quantity, of a sweep also the curve."""

    def called(parts: list[str]) -> str:
        return " ".join(part.removesuffix("_hz").replace("_", " ") for part in parts)

    wanted = label.replace("_", " ")
    names = {name: name.split("/") for name in facts.labels("cases/response")}
    whole = {name: called([part for part in parts if part not in SECTIONS]) for name, parts in names.items()}
    return [name for name, parts in names.items() if wanted in (called(parts[-2:]), whole[name])]


def values_called(facts: ResultFacts, label: str) -> Any:
    """(cases,) values of the response with a label; None where not exactly one has it."""
    names = responses_called(facts, label)
    return facts.data["cases/value"][facts.labels("cases/response").index(names[0])] if len(names) == 1 else None


SECTIONS = ("probes", "snubbers", "outputs", "springs", "friction")


@rule("line", r"all cases(?: without their tolerances)?: (.*)")
def _all_cases(facts, found):
    if ("tolerances" in facts.summary) != ("without their tolerances" in found[0]):
        yield "limits and the objective are compared with their quantiles, these ranges are not"
    for label, low, high in re.findall(
        r"([a-z][^,]*?) (-?[\d.e+-]+(?: [^\s,]+)?)(?: to (-?[\d.e+-]+[^,]*))?(?:, |$)", found[1]
    ):
        values = values_called(facts, label)
        if values is None:
            yield f"{label!r} is no response"
            continue
        text = f"{low} to {high}" if high else low
        yield from extent(
            facts, text, float(np.nanmin(values)), float(np.nanmax(values)), _si_unit((high or low).strip())
        )


LIMIT_OF_CASES = (
    rf"(.*?) {VERDICT} in "
    r"(?:(all|\d+ of \d+) cases(?: at the \S+ % quantile of its realisations| in all realisations)?|"
    r"the best design|the design nearest to the limits):(?: at most)? "
    r"<Q>(?: \((.*?)\))?(?: at (.*?))?, limit <Q>, margin (\S+(?: %| dB)?)(.*)"
)


@rule("line", LIMIT_OF_CASES)
def _limit_of_cases(facts, found):
    label, verdict, cases, value, _, at, limit, margin, _ = found.groups()
    name, of = _margin_of(facts, label, at)
    if of is None:
        yield f"no limit is called {label}"
        return
    yield from _verdict_of(of, verdict.lower())
    yield from differs(facts, value, of["value"], _si_unit(value))
    yield from differs(facts, limit, of["limit"], _si_unit(limit))
    if margin.endswith("%") and not rounds_to(margin.split()[0], 100 * (of["limit"] / of["value"] - 1.0)):
        yield f"the margin is {of['limit'] / of['value'] - 1.0:.3%}"
    if "cases/verdict" in facts.data and cases:
        verdicts = facts.data["cases/verdict"][facts.labels("cases/limit").index(name)]
        own, count = int(np.sum(verdicts == verdict.lower())), facts.data["cases/case"].size
        if own != (count if cases == "all" else int(cases.split()[0])):
            yield f"{own} of {count} have this verdict"
    if ("quantile" in found[0]) != (
        "tolerances" in facts.summary and facts.summary["tolerances"]["quantile"] < 1.0 and bool(cases)
    ):
        yield "the value is that of a quantile" if "quantile" not in found[0] else "the value is that of no quantile"


@rule("line", r"worst of the best case within its tolerances: (.*?)(?: with (\d+) further cases? of at most (\d+))?")
def _kind_of_worst(facts, found):
    worst = facts.summary["worst"]
    if found[1] != worst["kind"] or (found[2] and int(found[2]) != worst["further_cases"]):
        yield f"it is {worst['kind']} with {worst['further_cases']}"


@rule("line", r"worst (.*) <Q>, in the sample <Q>; at (.*)")
def _worst_within(facts, found):
    of = facts.summary["worst"]["by"].get(found[1].replace(" ", "_"))
    if of is None:
        yield f"nothing that judges is called {found[1]}"
        return
    yield from differs(facts, found[2], of["value"], _si_unit(found[2]))
    yield from differs(facts, found[3], of["of_sample"], _si_unit(found[3]))


@rule(
    "line",
    r"all limits met with a probability of .*|best case within its tolerances: .*|case within its tolerances: .*",
)
def _met_with(facts, found):
    share, low, high = map(float, re.search(r"([\d.]+) % \(95 % interval ([\d.]+) to ([\d.]+) %\)", found[0]).groups())
    if not low <= share <= high:
        yield "the interval does not hold its value"
    of = facts.summary.get("probability") if found[0].startswith("all") else facts.summary["scatter"]["probability"]
    if not rounds_to(f"{share:g}", 100 * of["share"], 1):
        yield f"the share is {of['share']:.4%}"


@rule("line", r"(\d+) more responses? in the table of -v")
def _more_responses(facts, found):
    if int(found[1]) >= len(facts.labels("cases/response")):
        yield f"there are {len(facts.labels('cases/response'))}"


@rule("line", r"(.*) has (\d+) populations: (.*); its mean of (.*) describes none of them")
def _populations(facts, found):
    names = responses_called(facts, found[1])
    values = np.sort(facts.data["cases/value"][facts.labels("cases/response").index(names[0])])
    counts = [int(x) for x in re.findall(r"in (\d+) cases?", found[3])]
    if len(counts) != int(found[2]) or sum(counts) != values.size:
        yield f"{sum(counts)} cases in {len(counts)} populations of {values.size} cases"
        return
    begin = 0
    for count, part in zip(counts, re.split(r" in \d+ cases?(?:, |$)", found[3]), strict=False):
        yield from extent(facts, part, float(values[begin]), float(values[begin + count - 1]), _si_unit(part))
        begin += count
    yield from differs(facts, found[4], float(values.mean()), _si_unit(found[4]))


@rule("line", r"(.*) goes with (.*)|variance of (.*?): (.*)")
def _goes_with(facts, found):
    label, ranked = (found[1], found[2]) if found[1] else (found[3], found[4])
    shares = facts.summary["sensitivity"][responses_called(facts, label)[0]]
    key = "rank_correlation" if found[1] else "total_order"
    known = sorted((abs(each.get(key) or 0.0) for each in shares.values()), reverse=True)
    said = [float(x) for x in re.findall(r"\(?([-+]?[\d.]+)(?:\)| %)(?=, |$)", ranked)]
    said = [abs(x) if found[1] else x / 100 for x in said]
    if any(not any(abs(x - y) <= 0.0051 for y in known) for x in said) or said != sorted(said, reverse=True):
        yield f"the file has {known}"


@rule(
    "line",
    r"within 1 % of the best: .*|the best .* is an end of its range; a wider range may have a better one|\d+"
    r" designs? of the front: none is better in both objectives",
)
def _near_best(facts, found):
    if found[0].startswith("within") and "near_best" not in facts.summary:
        yield "the file has no such ranges"
    if found[0].startswith("the best") and not any(of.get("at_end") for of in facts.summary["near_best"].values()):
        yield "no best value is an end of its range"
    if "front:" in found[0] and int(found[0].split()[0]) != int(facts.data["cases/front"].sum()):
        yield f"the table has {int(facts.data['cases/front'].sum())}"


@rule("line", r"the front has a gap, (\d+) % of its length, at an? (.*?) of (.*): no design found there is in it")
def _gap_of_front(facts, found):
    front = np.asarray(facts.data["cases/front"]) == 1
    values = facts.data["cases/objective_value"][:, front]
    values = values[:, np.argsort(values[0])]
    steps = np.linalg.norm(np.diff(values / np.ptp(values, axis=1, keepdims=True), axis=1), axis=0)
    near = [k for k, share in enumerate(100 * steps / steps.sum()) if abs(share - float(found[1])) <= 0.5 + 1e-9]
    ends = [sorted(values[0, k : k + 2]) for k in near]
    if not any(not list(extent(facts, found[3], float(low), float(high), _si_unit(found[3]))) for low, high in ends):
        yield f"the front has no such gap; of this share {ends}"


def _best_number(facts: ResultFacts, name: str) -> dict[str, Any] | None:
    if name == "as it is":
        return facts.summary.get("as_it_is")
    return facts.summary["best"][int(name.split(".")[0]) - 1]


@rule("heading", "margin")
def _margin_of_best(facts, found, name, text):
    best = _best_number(facts, name)
    if text not in ("infinite", "unknown") and not rounds_to(text.split()[0], 100 * best["margin"]):
        yield f"the margin is {best['margin']:.3%}"


@rule("heading", r"(smallest|largest|median|mean|5 %|95 %)(?: \(at (.*)\))?")
def _statistics(facts, found, name, text):
    if "random_numbers/number" in facts.data and found[1] == "mean":
        yield from _random_number(facts, "mean", name, text)
        return
    values = values_called(facts, name)
    if values is None:
        yield f"{name!r} is no response"
        return
    functions = {"smallest": np.nanmin, "largest": np.nanmax, "mean": np.nanmean, "median": np.nanmedian,
                 "5 %": lambda x: np.nanquantile(x, 0.05), "95 %": lambda x: np.nanquantile(x, 0.95)}  # fmt: skip
    size = re.sub(r" \(.*", "", text)
    yield from differs(facts, size, float(functions[found[1]](values)), _si_unit(size))


@rule("heading", r"deviation|design point")
def _random_number(facts, found, name, text):
    known = {"deviation": "deviation", "design point": "design", "mean": "mean"}
    column = known[found if isinstance(found, str) else found[0]]
    yield from differs(facts, text, float(_of_number(facts, column, name)), _si_unit(text))


def _of_number(facts: ResultFacts, column: str, name: str) -> Any:
    """A column of the numbers that scatter, of the one that is called so."""
    path = next(path for path in facts.labels("random_numbers/number") if _called(path) == name)
    return facts.row(f"random_numbers/{column}", "random_numbers/number", path)


@rule("heading", r"importance \(%\)")
def _importance(facts, found, name, text):
    share, low, high = (100 * float(_of_number(facts, f"importance{end}", name)) for end in ("", "_low", "_high"))
    if text.startswith("below "):
        if float(text.split()[1]) < high:
            yield f"it may be {high:.3g} %"
        return
    for part, value in zip(re.findall(r"\d+", text), (share, low, high), strict=False):
        if abs(float(part) - max(value, 0.0)) > 0.5 + 1e-9:
            yield f"{part} is printed of {value:.4g}"
    if not math.isnan(low) and not low <= share <= high:
        yield "the interval does not hold its value"


@rule("heading", r"doubles with the mean")
def _doubles(facts, found, name, text):
    sign, size, low, high = re.fullmatch(r"([-+±]?)(\S+ \S+|\S+)(?: \((.*) to (.*)\))?", text).groups()
    ways = [_of_number(facts, f"doubles{end}", name) for end in ("", "_low", "_high")]
    unit = _si_unit(size)
    unit = "kg" if facts.units["random_numbers/doubles"] == "kg" else unit
    for value, *ends in zip(*ways, strict=True):
        texts = [(size, abs(value)), *zip((low, high), map(abs, ends), strict=True)]
        if not any(list(differs(facts, each, float(x), unit)) for each, x in texts if each):
            if sign != "±" and (sign == "-") != (value < 0.0):
                yield f"it is {value:.4g}"
            if low and not abs(ends[0]) <= abs(value) <= abs(ends[1]):
                yield "the interval does not hold its value"
            return
    yield f"the file has {ways[0]}"


def _called(path: str) -> str:
    """A path of a scenario as screens call it."""
    first, *others = path.split(".")
    named = first in (
        "snubbers",
        "probes",
        "bodies",
        "joints",
        "springs_to_ground",
        "springs_between",
        "friction",
        "outputs",
        "tests",
    )
    parts = others if len(others) > 1 and named else [first, *others]
    texts = []
    for part in parts:
        stem, _, index = part.partition("[")
        if index not in ("", "*]"):
            stem = (
                f"{stem.removesuffix('es') if stem.endswith('ses') else stem.removesuffix('s')} {int(index[:-1]) + 1}"
            )
        texts.append("Young's modulus" if stem == "youngs_modulus" else stem.replace("_", " "))
    return " ".join(texts)


def other_cell(facts: ResultFacts, heading: str, name: str, text: str) -> Iterator[str]:
    """A cell below a parameter, an objective or a response of a study."""
    if name[:1].isdigit() or (name == "as it is" and "best" in facts.summary):
        best = _best_number(facts, name) or {}
        path = next((p for p in best.get("parameters", ()) if _called(p) == heading), None)
        value = best["parameters"][path] if path else best.get("value", math.nan)
        values = [value, *(best.get("values") or {}).values()]
        if isinstance(value, str):
            if value != text:
                yield f"it is {value}"
        elif not any(not list(differs(facts, text, x, _si_unit(text))) for x in values):
            yield f"the file has {values}"
        return
    values = values_called(facts, heading)
    if values is None:
        yield f"{heading!r} is no response"
        return
    if name == "as it is":
        yield from differs(facts, text, float(values[0]), _si_unit(text))
        return
    path = next(p for p in facts.labels("cases/parameter") if _called(p) == name)
    own = facts.row("cases/parameter_value", "cases/parameter", path)
    varied = own != own[0]
    of = np.append(values[varied], values[0])
    yield from extent(facts, text, float(np.nanmin(of)), float(np.nanmax(of)), _si_unit(text))


# --- Identification --------------------------------------------------------------------------------------------------


@rule("verdict", r"frequencies within .*")
def _agreement(facts, found):
    for text, words in re.findall(r"([\d.e+-]+) % (with contact|without the stop)", found[0]):
        of = facts.summary[f"difference_{words.split()[0]}_percent"]
        largest = max(abs(x) for x in of if x is not None and not math.isnan(x))
        if not rounds_to(text, largest, 2):
            yield f"they differ by {largest:.4g} % {words}"


def _identified(facts: ResultFacts, name: str) -> tuple[dict[str, Any], str]:
    """Value, deviation, interval and value before of a row, and their unit."""
    s = facts.summary
    if name.startswith("stiffness of ") and s.get("snubber") == name.removeprefix("stiffness of "):
        return {"value": s["stiffness_n_per_m"], "standard_deviation": s["standard_deviation_n_per_m"],
                "interval": s["interval_n_per_m"]}, "N/m"  # fmt: skip
    for section in ("updated", "estimated"):
        for path, of in (s.get(section) or {}).items():
            if isinstance(of, dict) and (
                _called(path) == name or _called(path.removeprefix("identify_stiffness.nonlinear.")) == name
            ):
                return of, ""
    raise StopIteration


@rule("heading", r"found|before|±|\d+ % interval")
def _found_value(facts, found, name, text):
    of, unit = _identified(facts, name)
    text = text.removesuffix(" at its bound")
    unit = unit or ("kg" if name.endswith("mass") else _si_unit(text))
    if found[0] == "found":
        deviation = of.get("standard_deviation")
        digits = (
            4
            if not deviation or not math.isfinite(deviation)
            else max(round(math.log10(abs(of["value"]) / deviation)) + 2, 1)
        )
        yield from differs(facts, text, of["value"], unit, digits=digits)
    elif found[0] == "before":
        yield from differs(facts, text, of["before"], unit)
    elif found[0] == "±":
        yield from differs(facts, text, of["standard_deviation"], unit, digits=2)
    else:
        yield from extent(facts, text, *of["interval"], unit)
        if not of["interval"][0] <= of["value"] <= of["interval"][1]:
            yield "the interval does not hold its value"


@rule("heading", "from")
def _from(facts, found, name, text):
    if text != f"mode {', '.join(map(str, facts.summary['fit_to']))}, {facts.summary['method']}":
        yield f"it is from mode {facts.summary['fit_to']}, {facts.summary['method']}"


@rule("line", r"frequencies (with contact|without the stop): (.*) Hz; measured (.*) Hz")
def _frequencies(facts, found):
    words = found[1].split()[0]
    for text, key in ((found[2], f"frequencies_{words}_hz"), (found[3], f"measured_{words}_hz")):
        for each, value in zip(text.replace(", …", "").split(", "), facts.summary[key], strict=False):
            if each != "-" and not rounds_to(each, value, 4):
                yield f"{each} is printed of {value:.6g}"


@rule("line", r"misfit <N> before, <N> after")
def _misfit(facts, found):
    pairs = [facts.summary[name] for name in ("update_misfit", "nonlinear_misfit") if name in facts.summary]
    if not any(all(rounds_to(text, x) for text, x in zip(found.groups(), pair, strict=True)) for pair in pairs):
        yield f"the file has {pairs}"


@rule("line", r"(.*) has <N> % of the misfit; without it <N> would be left")
def _worst_test(facts, found):
    names = facts.labels("tests/name")
    own, without = facts.data["tests/misfit"], facts.data["tests/misfit_without"]
    k = names.index(found[1])
    share = 100 * float(own[k]) / facts.summary["nonlinear_misfit"][1]
    if (
        not rounds_to(found[2], share, 2)
        or not rounds_to(found[3], float(without[k]))
        or np.nanmin(without) < without[k]
    ):
        yield f"its share is {share:.3g} %, without it {without[k]:.4g} is left; the least is {np.nanmin(without):.4g}"


@rule("line", r"(\d+) of (\d+) starts reached the same minimum, (\d+) degrees? of freedom")
def _starts_agree(facts, found):
    s = facts.summary
    if [int(x) for x in found.groups()] != [*s["starts_agreeing"], s["nonlinear_degrees_of_freedom"]]:
        yield f"the file has {s['starts_agreeing']} and {s['nonlinear_degrees_of_freedom']}"


@rule("line", r"1 % more changes the stiffness: (.*)")
def _sensitive_stiffness(facts, found):
    known = {_called(path): value for path, value in facts.summary["sensitivities"].items()}
    said = [re.fullmatch(r"(.*) ([-+][\d.e-]+) %", part).groups() for part in found[1].split(", ")]
    for name, text in said:
        if name not in known or not rounds_to(text, known[name], 2):
            yield f"{name} changes it by {known.get(name)} %"
    largest = sorted(map(abs, known.values()), reverse=True)[: len(said)]
    if [abs(known.get(name, 0.0)) for name, _ in said] != largest:
        yield "the largest do not come first"


@rule("line", r"MAC of paired shapes: (.*)")
def _mac(facts, found):
    for text, value in zip(found[1].split(", "), np.diagonal(facts.data["shapes/mac"]), strict=False):
        if text != "…" and not rounds_to(text, float(value)):
            yield f"{text} is printed of {value:.4g}"


@rule("line", r"pad (.*?) \((.*?)\) at rest, (\d+) relaxation times?, misfit <N> % rms")
def _pad(facts, found):
    yield from differs(facts, found[1], float(facts.data["pad/stiffness"]), "N/m", digits=4)
    low, high = facts.data["pad/stiffness_interval"]
    if found[2] != "not known":
        yield from extent(facts, found[2], float(low), float(high), "N/m")
        if not low <= facts.data["pad/stiffness"] <= high:
            yield "the interval does not hold its value"
    if int(found[3]) != len(facts.labels("pad/branch")) or not rounds_to(
        found[4], 100 * float(facts.data["pad/misfit"]), 2
    ):
        yield f"it has {len(facts.labels('pad/branch'))} and a misfit of {facts.data['pad/misfit']:.3%}"


@rule("line", r"(?:\S+ )+(?:clamped|pinned|free|sprung|guided)(?:, .*)?")
def _supports(facts, found):
    if not any(isinstance(x, str) for x in facts.summary.get("updated", {}).values()):
        yield "no support was chosen"


# --- What was understood ---------------------------------------------------------------------------------------------


@rule("understood", r"first mode (.*)")
def _first_modes(facts, found):
    states = {"open": "open", "closed": "closed", "at rest": "resting"}
    said = set()
    for part in re.split(r", (?=[\d.e+-]+ Hz)", found[1]):
        hz, names, damping = re.fullmatch(r"(\S+ Hz) (.*?)(?: \((\S+) %\))?", part).groups()
        for name in names.split(" and "):
            state = states[name]
            first = facts.first_mode(state)
            yield from differs(facts, hz, float(facts.data[f"modes/{state}_frequencies_hz"][first]), "Hz")
            ratios = "damping_ratios" if state == "open" else f"{state}_damping_ratios"
            if damping and not rounds_to(damping, 100 * float(facts.data[f"modes/{ratios}"][first]), 2):
                yield f"the damping {name} is {facts.data[f'modes/{ratios}'][first]:.3%}"
            said.add(name)


@rule("understood", r"low-pass filter <N> Hz(?:, <N> times the excitation's <N> Hz)?")
def _filter(facts, found):
    if not rounds_to(found[1], facts.scenario["run"]["low_pass"], 4):
        yield f"the case has {facts.scenario['run']['low_pass']:.6g}"
    if found[2] and not rounds_to(found[2], float(found[1]) / float(found[3])):
        yield f"it is {float(found[1]) / float(found[3]):.4g} times that"


def _excitations(facts: ResultFacts) -> list[dict[str, Any]]:
    """The motions and forces of a case, as written in its file."""
    excitation = facts.scenario.get("excitation") or {}
    parts = excitation.get("forces") or excitation.get("sines") or excitation.get("sum")
    return parts if isinstance(parts, list) else [excitation]


@rule(
    "understood",
    r"(harmonic|random|sampled|matched|step|half sine|trapezoid|sawtooth|swept sine|steady sine|stepped sine"
    r"|sine at phase resonance|tones|several|polynomials?)(?:, (.*))?, at (.*)",
)
def _excitation(facts, found):
    kind, words, _ = found.groups()
    parts = _excitations(facts)
    if kind.split()[0] not in ("swept", "steady", "stepped", "sine") and not any(
        p.get("kind", "").replace("_", " ") == kind for p in parts
    ):
        yield f"the case has {[p.get('kind') for p in parts]}"
    numbers = json.dumps([facts.scenario.get(k) for k in ("excitation", "sweep", "nnm", "vary")])
    known = [float(x) for x in re.findall(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?", numbers)] + _derived(facts, parts)
    words = (words or "").replace("less than 1 cycle", "0 cycles")
    for text in re.findall(r"(?<![\w./])(-?\d+(?:\.\d+)?(?:e[-+]?\d+)?)( [a-zA-Zµ%][\w/^]*)?(?![\w.]*\.csv)", words):
        number, unit = text[0], text[1].strip()
        open_unit = unit in ("and", "to")  # that of the next number
        scales = [1.0, 1e-3, 1e-6, 1e3, GRAVITY] if open_unit else [_scale(unit)]
        if not any(rounds_to(number, x / s, 1 if unit.startswith("cycle") else 3) for x in known for s in scales):
            yield f"{number} {unit} is no number of the case"


def _scale(unit: str) -> float:
    if unit in ("oct/min", "decades/min", "Hz/min"):
        return 1.0 / 60.0
    try:
        return unit_of(unit)[1]
    except KeyError:
        return 1.0


def _derived(facts: ResultFacts, parts: list[dict[str, Any]]) -> list[float]:
    """Sizes that follow from what is written: areas under pulses, root mean squares and peaks, cycles and rates."""
    found = [
        float(x)
        for name in ("rms", "peak")
        if f"inputs/{name}" in facts.data
        for x in np.ravel(facts.data[f"inputs/{name}"])
    ]
    shares = {"half_sine": 2 / math.pi, "sawtooth": 0.5, "trapezoid": 0.9, "step": 1.0}
    for part in parts:
        if part.get("duration") is not None and isinstance(part.get("level"), int | float):
            rise = part.get("rise") or part.get("fall") or 0.0
            share = (
                1 - rise / part["duration"] if part["kind"] == "trapezoid" and rise else shares.get(part["kind"], 1.0)
            )
            found += [abs(part["level"]) * part["duration"] * share]
        if isinstance(part.get("srs"), list):
            found += [max(level for _, level in (tuple(p.values()) if isinstance(p, dict) else p for p in part["srs"]))]
    sweep = facts.scenario.get("sweep") or {}
    for section in (sweep, *parts):
        if "rate" in section:
            found += _cycles(section)
    return [*found, *(2 * math.pi * x for x in found)]


def _cycles(section: dict[str, Any]) -> list[float]:
    """Rate a minute and cycles of a sweep, by the integral of its frequency."""
    rate = section["rate"]
    value, unit = (
        (rate, "oct/s") if isinstance(rate, int | float) else (float(str(rate).split()[0]), str(rate).split()[1])
    )
    value = value / 60.0 if unit.endswith("/min") else value
    low, high = sorted((float(section["from"]), float(section["to"])))
    per = {"oct": math.log(2.0), "decade": math.log(10.0), "decades": math.log(10.0)}.get(unit.split("/")[0])
    once = (high - low) / (value * per) if per else (high**2 - low**2) / (2 * value)
    return [
        60.0 * value,
        value,
        once,
        2 * once,
        len(section.get("levels") or [1]) * once,
        2 * len(section.get("levels") or [1]) * once,
    ]


@rule("understood", r"no excitation")
def _unexcited(facts, found):
    if facts.scenario.get("excitation"):
        yield f"the case has {facts.scenario['excitation']}"


# --- Statements ------------------------------------------------------------------------------------------------------


@rule(
    "statement",
    r"(?:Not converged: |Not reliable: |The best design: not converged: |The first is case (\d+): not"
    r" converged: )?(?:values|displacements or forces) are off by more than (?:2|50) % \(seen with (?:3 times the|all)"
    r" modes.*?\): (.*)",
)
def _not_converged(facts, found):
    known = {_figure(entry, place): change for (entry, place), change in facts.convergence.items()}
    for text in re.sub(r" and \d+ more$", "", found[2]).split(", "):
        name, size = re.fullmatch(r"(.*) by (\S+) %", text).groups()
        if float(size) < 2.0:
            yield f"{size} % is not more than 2 %"
        if facts.kind != "designs" and (name not in known or not rounds_to(size, 100 * known[name], 2)):
            yield f"{name} is off by {100 * known.get(name, math.nan):.3g} %"


def _figure(entry: str, place: str) -> str:
    words = re.sub(r"_(n_m|m_s2|n_s|m_s|hz|pa|rad|m|n|g|s)$", "", entry).replace("_", " ")
    return f"{words} of {place}" if place and entry != "random" else f"{place} {''}".strip() or words


@rule("statement", r"Not converged: (\d+) of (\d+) cases (?:is|are) not converged")
def _cases_not_converged(facts, found):
    outcomes = facts.data["cases/outcome"]
    count = sum(str(x).startswith("not converged") for x in outcomes)
    if int(found[2]) != outcomes.size or int(found[1]) != count:
        yield f"{count} of {outcomes.size} are"


@rule(
    "statement",
    r"(?:Raise|For|Give|Ask|Take|Lower|Leave|Run|Follow|Start|Try|Look|Check|Compare|Add|Measure|Limits) .*",
)
def _remedy(facts, found):
    if (more := re.search(r"[Rr]aise reduction\.modes to (\d+)", found[0])) and int(more[1]) <= facts.kept_modes:
        yield f"the model keeps {facts.kept_modes} modes already"
    if "run.low_pass" in found[0] and (facts.scenario.get("run") or {}).get("low_pass") is not None:
        yield "the case has a filter"


@rule(
    "statement",
    r"The (?:best design: the )?motion is so sensitive that from <N> s on it is one of many: (.*) depend on"
    r" what follows(?:; .*)?|(?:A|Round-off).*gives other contacts.*|.*from <N> s on(?:, round-off from <N> s on)?",
)
def _sensitive(facts, found):
    times = [x for x in (facts.summary.get("convergence_model") or {}).values() if isinstance(x, float)]
    for text in (found[1], found[3], found[4]):
        if text and not any(rounds_to(text, x, 3) for x in times):
            yield f"{text} s: the file has {times}"
    if not facts.summary.get("after_parting"):
        yield "no value depends on that"


@rule("statement", r"Limits? (.*)|The level .*|Swept too fast.*|The notched .*|.* exceeds? .*")
def _exceeded(facts, found):
    if gravest(facts) in ("complete", "noted"):
        yield "the outcome is complete"


@rule(
    "statement",
    r"Interrupted.*|.*interrupts the backbone.*|.*internal resonance.*|There mode \d+ holds .*|Coexisting and"
    r" side branches end .*|Special points .*|Not every largest .*",
)
def _others(facts, found):
    if found[0].startswith("Interrupted") != (gravest(facts) == "interrupted") and found[0].startswith("Interrupted"):
        yield "the outcome is no interruption"
    if found[0].startswith("Not every") and gravest(facts) != "incomplete":
        yield "every one is"


@rule("statement", r"warning: .* meant\?.*")
def _question(facts, found):
    if found[0].removeprefix("warning: ") not in json.loads(facts.attributes["warnings"]):
        yield "the file has no such warning"


@rule("statement", r"From (\d+) bifurcations no branch was followed: (?:sweep\.side_branches is (\w+)|.*)")
def _not_branched(facts, found):
    if int(found[1]) > facts.data["special_points/kind"].size:
        yield f"the table has {facts.data['special_points/kind'].size} special points"
    if found[2] and facts.scenario["sweep"].get("side_branches") != found[2]:
        yield f"the case has {facts.scenario['sweep'].get('side_branches')}"


@rule("foot", r"(?:(\d+) notes? \(-v shows them\); )?(.*)")
def _foot(facts, found):
    notes = [text for text in json.loads(facts.attributes["warnings"]) if "meant?" not in text]
    if int(found[1] or 0) != len(notes):
        yield f"the file has {len(notes)} other warnings"
    if not any(Path(name).name == facts.path.name for name in found[2].split(", ")):
        yield f"the result is in {facts.path.name}"


# --- Remedies --------------------------------------------------------------------------------------------------------


def _remedies(text: str, facts: ResultFacts) -> Iterator[str]:
    """Keys, kinds and options that a screen names and that do not exist, or not for its command."""
    for path in re.findall(
        r"(?<![\w./-])((?:run|sweep|nnm|reduction|vary|optimise|identify_stiffness|excitation"
        r"|limits)(?:\.[a-z_]{2,})+)(?!\.h5)",
        text,
    ):
        if not has_key({"$ref": "#/$defs/Scenario"}, path.split(".")):
            yield f"{path}: no scenario has this key"
        section = path.split(".")[0]
        if (
            section in ("run", "sweep", "nnm", "identify_stiffness")
            and COMMANDS_OF[section] != facts.command
            and section not in facts.scenario
        ):
            yield f"{path}: `{facts.command}` does not use it"
    for kind in re.findall(r"\(kind: (\w+)", text):
        if kind not in KINDS:
            yield f"kind: {kind} does not exist"
    options = {option for parameter in COMMANDS[facts.command].params for option in parameter.opts}
    yield from (
        f"{option}: `{facts.command}` has no such option"
        for option in re.findall(r"(?<![\w-])(--[a-z][a-z-]+)", text)
        if option not in options
    )
    for command in re.findall(r"`beamsim ([a-z-]+)", text):
        if command not in COMMANDS:
            yield f"there is no command {command}"


COMMANDS_OF = {"run": "run", "sweep": "sweep", "nnm": "nnm", "identify_stiffness": "identify-stiffness"}


def has_key(schema: Any, path: list[str]) -> bool:
    """Whether a path of keys exists below a part of the JSON Schema."""
    if isinstance(schema, list):
        return any(has_key(each, path) for each in schema)
    if not isinstance(schema, dict):
        return False
    if "$ref" in schema:
        return has_key(SCHEMA["$defs"][schema["$ref"].rsplit("/", 1)[1]], path)
    if not path:
        return True
    if path[0] in schema.get("properties", {}):
        return has_key(schema["properties"][path[0]], path[1:])
    others = [schema.get("additionalProperties")] if "additionalProperties" in schema else []
    inside = any(has_key(each, path[1:]) for each in others)
    return inside or any(
        has_key(schema[key], path) for key in ("anyOf", "oneOf", "allOf", "items", "prefixItems") if key in schema
    )
