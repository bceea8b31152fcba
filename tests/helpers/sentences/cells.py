"""Rules of the cells in the tables of runs and sweeps."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

import numpy as np

from tests.helpers.screens import GRAVITY, ResultFacts, cell, differs, rounds_to, rule, split_mark, wrong_mark
from tests.helpers.sentences.coexisting import of_motion
from tests.helpers.sentences.studies import best_number
from tests.helpers.sentences.values import compared_text, curve_number


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
        yield from of_motion(facts, name, text, (entry, "peak_force", "snubber", unit))
    elif name in facts.summary.get("rings", {}):
        value = facts.summary["peak_ring_force_n"][name]
        yield from cell(facts, text, value, "N", ("peak_ring_force_n", name))
        samples = facts.row("rings/force", "rings/ring", name)
        if samples.max() > 1.01 * value:  # the peak is the largest of many directions, which is lower by up to 1 %
            yield f"the history of {name} reaches {samples.max():.6g}"
    else:
        value = facts.summary[entry][name]
        yield from cell(facts, text, value, unit, (entry, name))
        yield from exceeded_by_history(facts, "snubber_force", "snubber", name, (-math.inf, value))


@rule("heading", "penetration")
def _penetration(facts, found, name, text):
    yield from cell(facts, text, facts.summary["ring_penetration_m"][name], "m", ("ring_penetration_m", name))


@rule("heading", "in contact, times")
def _contact(facts, found, name, text):
    if name in facts.summary.get("rings", {}):
        yield from differs(facts, text, facts.summary["rings"][name]["contact_share"], "1")
        return
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
        yield from of_motion(facts, name, text, ("peak_displacement_m", "peak_displacement", "probe", "m"))
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
    best = best_number(facts, name)
    if text != best["worst"]:
        yield f"it is {best['worst']}"


@rule("heading", "limit")
def _limits_of_place(facts, found, name, text):
    if facts.kind == "designs":
        return  # which limit is the closest: compared with the margin beside it
    for part in text.split("; "):
        yield from compared_text("line", f"{part} at {name}", facts)


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
