"""Rules of statements: what is not converged, sensitive or exceeded, questions, and the last line."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

from tests.helpers.screens import rounds_to, rule
from tests.helpers.sentences.first_line import gravest


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
    r"The (?:best design: the )?motion is so sensitive that from <N> s on it is one of many possible ones: (.*) depend"
    r" on what follows(?:; .*)?|(?:A|Round-off).*changes the contacts.*|.*after <N> s(?:, round-off after <N> s)?",
)
def _sensitive(facts, found):
    times = [x for x in (facts.summary.get("convergence_model") or {}).values() if isinstance(x, float)]
    for text in (found[1], found[3], found[4]):
        if text and not any(rounds_to(text, x, 3) for x in times):
            yield f"{text} s: the file has {times}"
    if not facts.summary.get("after_divergence"):
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
