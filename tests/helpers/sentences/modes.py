"""Rules of nonlinear normal modes: backbones, resonances and motions along them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

from tests.helpers.screens import ResultFacts, differs, rounds_to, rule, split_mark
from tests.helpers.sentences.values import SPECIAL, extent, parameter_unit


def of_backbone(facts: ResultFacts, heading: str, name: str, text: str) -> Iterator[str]:
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
