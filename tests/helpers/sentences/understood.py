"""Rules of the line that says what was understood of a case: modes, filter, excitation."""

from __future__ import annotations

import json
import math
import re
from typing import Any

import numpy as np

from tests.helpers.screens import GRAVITY, ResultFacts, differs, rounds_to, rule, unit_of


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
