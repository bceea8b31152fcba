"""Rules of coexisting motions: their shares of the starts, and starts that did not settle."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any

from tests.helpers.screens import ResultFacts, cell, differs, rounds_to, rule


def _motion_of(facts: ResultFacts, name: str) -> dict[str, Any]:
    hz, number = re.fullmatch(r"([\d.]+) Hz, motion (\d+)", name).groups()
    return next(m for m in facts.summary["motions"] if m["number"] == int(number) and f"{m['frequency_hz']:.6g}" == hz)


def of_motion(facts: ResultFacts, name: str, text: str, of: tuple[str, str, str, str]) -> Iterator[str]:
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
