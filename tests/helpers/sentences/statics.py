"""Rules of static equilibria: stops, supports and natural frequencies."""

from __future__ import annotations

import numpy as np

from tests.helpers.screens import cell, differs, rule, split_mark, wrong_mark


def of_snubber(facts, variable, name):
    """A value of a snubber at rest."""
    return facts.row(f"equilibrium/{variable}", "equilibrium/snubber", name)


@rule("heading", "stop")
def _state(facts, found, name, text):
    if text == "support":
        if not {name, f"{name} moment"} & set(facts.labels("equilibrium/support")):
            yield "no support is called that"
    elif name in facts.summary.get("peak_ring_force_n", ()):
        if (facts.summary["peak_ring_force_n"][name] > 0.0) != (text == "touches"):
            yield "its force says otherwise"
    elif (of_snubber(facts, "force", name) > 0.0) != (text == "touches"):
        yield f"its force is {of_snubber(facts, 'force', name):.6g}"


@rule("heading", "(force|moment)")
def _force(facts, found, name, text):
    of_supports, of_stops = {
        "force": (("reaction_n", "N"), ("peak_force_n", "N")),
        "moment": (("reaction_moment_n_m", "N m"), ("peak_moment_n_m", "N m")),
    }[found[1]]
    if name in facts.summary.get("peak_ring_force_n", ()):
        of_stops = "peak_ring_force_n", "N"
    entry, unit = of_supports if name in facts.summary.get(of_supports[0], ()) else of_stops
    yield from cell(facts, text, facts.summary[entry][name], unit, (entry, name))


@rule("heading", "gap left")
def _gap(facts, found, name, text):
    turns = name in facts.summary.get("gap_rad", ())
    entry, unit = ("largest_gap_rad", "rad") if turns else ("largest_gap_m", "m")
    yield from cell(facts, text, float(of_snubber(facts, "gap_left", name)), unit, (entry, name))


@rule("heading", "deflection")
def _deflection(facts, found, name, text):
    if name in facts.labels("equilibrium/snubber"):
        turns = name in facts.summary.get("gap_rad", ())
        value = float(of_snubber(facts, "snubber_displacement", name))
        yield from differs(facts, text, value, "rad" if turns else "m", digits=4)
        return
    value = float(facts.row("equilibrium/displacement", "equilibrium/probe", name))
    yield from cell(facts, text, value, "m", ("max_displacement_m", name))


@rule("line", r"natural frequencies(?:, friction (stuck|sliding))?: (.*)")
def _frequencies(facts, found):
    entry = f"{found[1] or 'stuck'}_frequencies_hz"
    known = [(k, hz) for k, hz in enumerate(facts.data[f"equilibrium/{entry}"], 1) if np.isfinite(hz)]
    for text, (k, hz) in zip(found[2].split(", ") if found[2] != "none" else (), known, strict=False):
        plain, mark = split_mark(text)
        yield from differs(facts, plain, float(hz), "Hz", (entry, str(k)))
        yield from wrong_mark(facts, text, mark, (entry, str(k)))


@rule(
    "line", r"friction is taken as that at the start: (.*); while it sticks, other equilibria within its limit are .*"
)
def _friction(facts, found):
    names = facts.labels("equilibrium/friction")
    if not names or not found[1].startswith(names[0]):
        yield f"the friction contacts are {names}"


@rule("line", "nothing acts on the structure at rest: .*")
def _nothing(facts, found):
    if np.any(facts.data["equilibrium/deflection"]):
        yield "the structure is deflected"
