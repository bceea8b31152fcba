"""Rules of what stands in the first line next to the title: verdicts, and how far the values are converged."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any

from tests.helpers.screens import ResultFacts, Screen, rounds_to, rule
from tests.helpers.sentences.values import LIMITED, compared_text

EXPECTED = {"LIMITS EXCEEDED": "not held", "INCOMPLETE": "incomplete stopped failed interrupted",
            "NOT RELIABLE": "untrusted", "NOT CONVERGED": "doubtful"}  # fmt: skip

GRAVEST = ("complete", "noted", "doubtful", "not held", "incomplete", "stopped", "failed", "untrusted", "interrupted")

FIRST = ("peak_", "min_", "max_", "largest_gap", "largest_pull", "frequency_hz")  # of entries read first


def wrong_first_line(screen: Screen, facts: ResultFacts) -> Iterator[str]:
    """Contradictions of what stands beside the title; each part has a rule, and nothing may be missing."""
    parts = re.split(r"(?<!at a time), (?!but for |means within|\d+ means?)", screen.verdict) if screen.verdict else []
    parts = _joined(parts)
    for part in parts:
        yield from compared_text("verdict", part, facts)
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
    after = [key for key in facts.keys("after_divergence") if read_first(facts, key)]
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
