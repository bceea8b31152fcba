"""What rules of several files need: names, units and extents by their words on a screen, and the rule of a text."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from tests.helpers.screens import GRAVITY, RULES, ResultFacts, differs, rounds_to, unit_of

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


def compared_text(where: str, text: str, facts: ResultFacts, *more: str) -> list[str]:
    """Contradictions of a text with the file, by the first rule that knows it.

    Parameters
    ----------
    where : part of the screen that the text stands in, as rules name it.
    text, facts : what is compared.
    more : of a cell its name and its text; the text is that of its heading then.
    """
    for each in RULES:
        if each.where == where and (match := each.pattern.fullmatch(text)):
            try:
                return [f"{text!r}: {fault}" for fault in each.check(facts, match, *more)]
            except (AttributeError, LookupError, RuntimeError, TypeError, ValueError) as error:  # a name, a form
                return [f"{text!r}: is of nothing in the file: {error!r}"]
    return [f"{text!r}: no rule knows this {where}"]


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


def extent(facts: ResultFacts, text: str, low: float, high: float, unit: str) -> Iterator[str]:
    """Contradictions of a range ``20 to 30 Hz``."""
    first, _, last = text.partition(" to ")
    last = last or first
    first = first if " " in first or " " not in last else f"{first} {last.partition(' ')[2]}"
    yield from differs(facts, first, low, unit, digits=4)
    yield from differs(facts, last, high, unit, digits=4)


SPECIAL = {"Neimark–Sacker bifurcation": "neimark_sacker"}


def si(number: float, unit: str) -> float:
    """A number of a printed unit in SI."""
    return number * unit_of(unit)[1]


def si_unit(text: str) -> str:
    """SI unit of a quantity, or of the last of a range."""
    return unit_of(text.rpartition(" to ")[2].partition(" ")[2])[0]


def called_name(path: str) -> str:
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
