"""Rules of continuations: ranges, special points, folds and peaks along a branch."""

from __future__ import annotations

import math
import re

import numpy as np

from tests.helpers.screens import cell, differs, rule, split_mark
from tests.helpers.sentences.modes import of_backbone
from tests.helpers.sentences.values import (
    PARAMETER_UNITS,
    SPECIAL,
    extent,
    level_unit,
    of_row,
    parameter_unit,
    si,
    si_unit,
)


@rule("heading", "frequency|level|gap|stiffness|position|length|side|y|energy|stiffness factor")
def _range(facts, found, name, text):
    if facts.kind == "nnm":
        yield from of_backbone(facts, found[0], name, text)
        return
    inside = facts.data["points/parameter"][of_row(facts, name)]
    yield from extent(facts, text, float(inside.min()), float(inside.max()), parameter_unit(facts))


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


@rule(
    "line",
    r"(?:[A-Za-z–]+ )*(?:folds|doublings|bifurcations|grazings|points) in (.*?): (.*), at ([^(]*)"
    r"(?: \(.*just touches\))?",
)
def _special_curves(facts, found):
    for curve in facts.summary["special_curves"]:
        unit = {"level": level_unit(facts)}.get(found[1].split()[-1], PARAMETER_UNITS.get(found[1].split()[-1], "1"))
        ends = (curve["smallest_parameter"], curve["largest_parameter"])
        if not [
            *extent(facts, found[2], *ends, unit),
            *extent(facts, found[3], curve["smallest_hz"], curve["largest_hz"], "Hz"),
        ]:
            return
    yield "no such curve of folds is in the summary"


@rule("line", r"isola at the (\S+) of (.*): (.*)")
def _isola(facts, found):
    for curve in facts.summary["special_curves"]:
        of = curve["smallest_parameter"] if curve["kind"] == "isola" else np.nan
        unit = {"level": level_unit(facts)}.get(found[1], PARAMETER_UNITS.get(found[1], "1"))
        if not [
            *differs(facts, found[2], of, unit),
            *extent(facts, found[3], curve["smallest_hz"], curve["largest_hz"], "Hz"),
        ]:
            return
    yield "no such isola is in the summary"


@rule(
    "line",
    r"(?:birth of an isola|joining branches|cusp|extreme of the second parameter|\d:\d resonance) at (.*), (.*)",
)
def _event_of_curves(facts, found):
    events = [event for curve in facts.summary["special_curves"] for event in curve["events"]]
    unit = {"level": level_unit(facts)}.get(kind := facts.summary["second_parameter"], PARAMETER_UNITS.get(kind, "1"))
    if all(
        [*differs(facts, found[1], event["parameter"], unit), *differs(facts, found[2], event["frequency_hz"], "Hz")]
        for event in events
    ):
        yield "no curve has such a special point"


@rule("line", r"(\d+) more special points? of these curves in the file")
def _more_events_of_curves(facts, found):
    events = [event for curve in facts.summary["special_curves"] for event in curve["events"]]
    if int(found[1]) >= len(events):
        yield f"the curves have {len(events)} special points"


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
    yield from cell(facts, size, known[name], si_unit(split_mark(size)[0]), key)
    own = facts.data["cycles/curve"] == facts.labels("curves/curve").index(found[1])
    ends = (facts.data[f"cycles/output_{end}"][k][own] for end in ("minimum", "maximum"))
    largest = max(float(np.nanmax(np.abs(x))) for x in ends)
    if not math.isclose(largest, known[name], rel_tol=1e-9):
        yield f"its cycles reach {largest:.6g}"
