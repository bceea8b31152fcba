"""Rules of lines below the tables of runs and sweeps: levels that change contact, limits, damage, outputs, marks."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from tests.helpers.screens import GRAVITY, ResultFacts, cell, differs, rounds_to, rule, split_mark, unit_of, wrong_mark
from tests.helpers.sentences.values import LIMITED, curve_number, extent, si_unit


@rule("line", r"bending stress <Q>((?: [*~^])?) at (?:(\S+), )?x = <Q>(?:, y = <Q>)?")
def _stress(facts, found):
    s = facts.summary
    yield from cell(facts, found[1] + found[2], s["largest_bending_stress_pa"], "Pa", ("largest_bending_stress_pa", ""))
    yield from differs(facts, _metres(found[4]), s["largest_bending_stress_position_m"], "m")
    if found[5]:
        yield from differs(facts, _metres(found[5]), s["largest_bending_stress_y_m"], "m")
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
    name, of = margin_of(facts, label, at)
    if of is None:
        yield f"no limit is called {label}"
        return
    limit, value = _limit_of(facts, name), of["value"]
    if limit is not None and not math.isclose(limit, of["limit"], rel_tol=1e-9):
        yield f"the case limits {name} to {limit:.6g}, not to {of['limit']:.6g}"
    yield from verdict_of(of, verdict.lower())
    if at and of["at"] and at not in (of["at"], of["at"].split(",")[0]):
        yield f"it is largest at {of['at']}"
    if margin.endswith("dB"):
        if not rounds_to(margin.split()[0], of["margin_db"], 2):
            yield f"the margin is {of['margin_db']:.3f} dB"
    elif margin not in ("infinite", "unknown") and not rounds_to(margin.split()[0], 100 * (of["limit"] / value - 1.0)):
        yield f"the margin is {of['limit'] / value - 1.0:.3%}"
    yield from _limited_value(facts, name, of)


def margin_of(facts: ResultFacts, label: str, at: str | None = None) -> tuple[str, dict[str, Any] | None]:
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


def verdict_of(of: dict[str, Any], verdict: str) -> Iterator[str]:
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
    _, of = margin_of(facts, found[1])
    if of is None or of["verdict"] != "ok" or not of["reached"] > of["limit"]:
        yield f"the file says {of}"
    else:
        yield from differs(facts, found[2], of["reached"], _unit_of_limit(found[1]), digits=4)


@rule("line", r"(.*?) undecided: (.*?) to (.*?) at 95 %, the limit (.*?) between them; (.*)")
def _undecided(facts, found):
    label, low, high, limit, after = found.groups()
    _, of = margin_of(facts, label)
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
            yield from differs(facts, text, value, {"g": "m/s^2"}.get(text.split()[-1], si_unit(text)))
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
    yield from differs(facts, rms, float(facts.data["inputs/rms"][number]), si_unit(rms), digits=4)
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
        if list(differs(facts, change.replace("+", ""), changed, si_unit(change))):
            yield f"{path} changes it by {changed:.4g}"
        yield from differs(facts, tolerance, float(near[0][3]), si_unit(tolerance))
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
    if not facts.printed & facts.keys("after_divergence"):
        yield "nothing that is printed is"


@rule("line", r"\^ has no limit: it grows with the number of modes, because a force jumps at a point with .*")
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
