"""Limits on responses and forces to which the level of a swept sine is lowered."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from beamsim.errors import Problem
from beamsim.scenario.base import path_text, suggestion
from beamsim.scenario.limits import output_dimension, unit_of_dimension
from beamsim.scenario.output import ReactionOutput
from beamsim.scenario.parts import ScenarioParts
from beamsim.scenario.quantities import meant
from beamsim.scenario.units import ACCELERATION, FORCE, LENGTH, Dimension

BASE_FORCE = ReactionOutput.model_construct(
    name="base_force", kind="reaction_force", support="base", body=None, direction=None, about=None
)
"""The output that a limit on the base's force stands for where the scenario has none."""
_QUANTITIES = {
    "probes": {"acceleration": ACCELERATION, "displacement": LENGTH},
    "snubbers": {"force": FORCE},
}
_EXAMPLES = "probes.tip.acceleration, snubbers.tip.force, base.force or outputs.gauge"


@dataclass(frozen=True)
class LimitedQuantity:
    """What a limit applies to."""

    section: str  # probes, snubbers or outputs
    item: str
    quantity: str  # acceleration, displacement or force; empty of an output


def limited_quantity(name: str, base_force: str = BASE_FORCE.name) -> LimitedQuantity | None:
    """What a name stands for; None where it is none of the forms. ``base_force`` is the output of that force.

    >>> limited_quantity("probes.tip.acceleration")
    LimitedQuantity(section='probes', item='tip', quantity='acceleration')
    """
    if name == "base.force":
        return LimitedQuantity("outputs", base_force, "")
    section, _, rest = name.partition(".")
    if section == "outputs" and rest:
        return LimitedQuantity(section, rest, "")
    item, _, quantity = rest.rpartition(".")
    return LimitedQuantity(section, item, quantity) if item and quantity in _QUANTITIES.get(section, ()) else None


def base_force_of(scenario: ScenarioParts) -> str | None:
    """Name of the output that is the force of the whole base, vertically; None where there is none."""
    reactions = (each for each in outputs_of_sweeps(scenario).values() if isinstance(each, ReactionOutput))
    of_base = (each for each in reactions if each.kind == "reaction_force" and each.support == "base")
    return next((each.name for each in of_base if each.direction in (None, "z")), None)


def outputs_of_sweeps(scenario: ScenarioParts) -> dict[str, Any]:
    """The outputs by name, but for those of the run alone."""
    return {output.name: output for path, output in scenario.requested_outputs if path[0] == "outputs"}


def notch_problems(scenario: ScenarioParts, limits: Mapping[str, float]) -> Iterator[Problem]:
    """Limits on what this structure does not have, and limits in a unit of something else."""
    outputs = outputs_of_sweeps(scenario)
    names = {
        "probes": [probe.name for probe in scenario.effective_probes],
        "snubbers": [snubber.name for snubber in scenario.all_snubbers],
        "outputs": list(outputs),
    }
    for name, limit in limits.items():
        path = path_text(("sweep", "notch_to", name))
        of = limited_quantity(name, base_force_of(scenario) or BASE_FORCE.name)
        if of is None:
            yield Problem(path, "names nothing that can be limited", f"write for example {_EXAMPLES}")
            continue
        dimension: Dimension | None = FORCE
        if name != "base.force":
            if of.item not in names[of.section]:
                known = names[of.section]
                remedy = suggestion(of.item, known, f"the {of.section} are") if known else f"there are no {of.section}"
                yield Problem(path, f"limits {of.item}, which is none of the {of.section}", remedy)
                continue
            if of.section == "outputs":
                if outputs[of.item].kind in ("kinetic_energy", "strain_energy"):
                    yield Problem(path, "is an energy, which sweeps do not follow", "limit another quantity")
                    continue
                dimension = output_dimension(outputs[of.item], scenario.all_bodies, scenario.default_body)
            else:
                dimension = _QUANTITIES[of.section][of.quantity]
        elif BASE_FORCE.name in outputs and base_force_of(scenario) is None:
            yield Problem(path, f"needs the name {BASE_FORCE.name}, which another output has", "rename that output")
            continue
        yield from unit_problems(
            path, limit, dimension, "" if dimension is None else f"which is none of {dimension.name}"
        )


def unit_problems(path: str, limit: float, dimension: Dimension | None, but: str) -> Iterator[Problem]:
    """A limit in a unit of something else.

    Parameters
    ----------
    path : of the limit.
    limit : its value, which remembers its unit.
    dimension : of what is limited; None of rows of recovery matrices, which have units of their own.
    but : what is limited, for the message.
    """
    said = meant(limit)
    if dimension is None and said is not None:
        yield Problem(path, "has a unit, and the output has one of its own", "give a plain number in that unit")
    elif dimension is not None and said not in (None, unit_of_dimension(dimension)):
        yield Problem(path, f"is in {said or 'no unit'}, {but}", f"write {dimension.example}")
