"""Rules of identifications: values with their intervals, misfits, frequencies and pads."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np

from tests.helpers.screens import ResultFacts, differs, rounds_to, rule
from tests.helpers.sentences.values import called_name, extent, si_unit


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
                called_name(path) == name or called_name(path.removeprefix("identify_stiffness.nonlinear.")) == name
            ):
                return of, ""
    raise StopIteration


@rule("heading", r"found|before|±|\d+ % interval")
def _found_value(facts, found, name, text):
    of, unit = _identified(facts, name)
    text = text.removesuffix(" at its bound")
    unit = unit or ("kg" if name.endswith("mass") else si_unit(text))
    if found[0] == "found":
        deviation = of.get("standard_deviation")
        digits = (
            4
            if not deviation or not math.isfinite(deviation)
            else max(round(math.log10(abs(of["value"]) / deviation)) + 2, 1)
        )
        yield from differs(facts, text, of["value"], unit, digits=digits)
    elif found[0] == "before":
        yield from differs(facts, text, of["initial_value"], unit)
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


@rule("line", r"an increase of 1 % changes the stiffness by: (.*)")
def _sensitive_stiffness(facts, found):
    known = {called_name(path): value for path, value in facts.summary["sensitivities"].items()}
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
