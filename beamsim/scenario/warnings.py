"""Warnings about values that are allowed in a scenario but questionable."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from beamsim.scenario.base import Path, path_text, walk
from beamsim.scenario.contact import SnubberRatioDamping
from beamsim.scenario.damping import ModalDamping
from beamsim.scenario.distributed import DistributedLoad
from beamsim.scenario.excitation import Shock
from beamsim.scenario.joint import placed
from beamsim.scenario.parts import MANY_SAMPLES, ScenarioParts
from beamsim.scenario.place import Sited


def doubts(scenario: ScenarioParts) -> Iterator[str]:
    """Yield a sentence for each questionable value."""
    highest_hz = max(scenario.excitation.frequencies_hz, default=0.0)
    for name, body in scenario.all_bodies.items():
        yield from body.doubts(scenario.body_path(name), highest_hz)
    yield from _damping(scenario)
    yield from _snubbers(scenario)
    yield from _point_forces(scenario)
    for apart in placed(scenario.joints, scenario.all_bodies, scenario.default_body).apart:
        yield (
            f"joints[{apart.index}] joins points that lie {1e3 * apart.distance:g} mm apart, as the joints before it "
            f"place {apart.through}: it acts as if they were together; check its positions"
        )
    yield from _idle_forces(scenario)
    yield from _timing(scenario)
    reduction = scenario.reduction
    if reduction is not None and reduction.highest_frequency is not None:
        highest = scenario.excitation.highest_frequency_hz
        if reduction.highest_frequency < highest:
            yield (
                f"reduction.highest_frequency = {reduction.highest_frequency:g} Hz is below the excitation frequency, "
                f"{highest:g} Hz; the modes it excites are omitted"
            )


def large_deflections(scenario: ScenarioParts, peaks: Mapping[str, float]) -> list[str]:
    """A warning for each body whose computed deflection is beyond the theory of small ones.

    Parameters
    ----------
    peaks : m, by probe, of a structure that cannot move as a rigid body.
    """
    bodies = {probe.name: probe.place.body for probe in scenario.probes}
    largest: dict[str, tuple[float, str]] = {}
    for probe, peak in peaks.items():
        body = bodies.get(probe) or scenario.default_body
        largest[body] = max(largest.get(body, (0.0, "")), (peak, probe))
    return [
        f"the largest displacement at {probe} = {peak:.3g} m is not small for {path_text(scenario.body_path(name))} "
        f"(more than {allowed:.3g} m), and the theory does not hold: a unit such as mm or g may be wrong"
        for name, (peak, probe) in largest.items()
        if name in scenario.all_bodies and peak > (allowed := scenario.all_bodies[name].largest_deflection)
    ]


def _damping(scenario: ScenarioParts) -> Iterator[str]:
    """Overdamped modes and snubbers."""
    for path, part in walk(scenario):
        if isinstance(part, ModalDamping | SnubberRatioDamping):
            ratio = max(part.ratio) if isinstance(part.ratio, tuple) else part.ratio
            if ratio >= 1.0:
                yield f"{path_text(path)}.ratio = {ratio:g} is critical or above; was {ratio:g} % meant?"


def _point_forces(scenario: ScenarioParts) -> Iterator[str]:
    """Where forces act on points."""
    acting: list[tuple[Path, str, Any]] = [
        *((each.path, each.body, each.item) for each in scenario.located_snubbers),
        *(
            (("constant_forces", index), scenario.default_body, force)
            for index, force in enumerate(scenario.constant_forces)
        ),
    ]
    for path, part in walk(scenario.excitation, ("excitation",)):
        applied_to = getattr(part, "applied_to", "base")
        if applied_to != "base":
            acting.append(((*path, "applied_to"), scenario.default_body, applied_to))
    for path, named_body, item in acting:
        for place in item.places:
            body = scenario.all_bodies.get(place.body or named_body)
            if body is not None and place.position is not None:
                yield from body.point_force_doubts(path, place.position)


def _snubbers(scenario: ScenarioParts) -> Iterator[str]:
    """Gaps larger than the structure they are at."""
    for path, body, snubber, _ in scenario.located_snubbers:
        bodies = [scenario.all_bodies.get(place.body or body) for place in snubber.places]
        largest = min((b.largest_gap for b in bodies if b is not None), default=math.inf)
        if snubber.gap is not None and abs(snubber.gap) > largest:
            what = "gap" if snubber.gap > 0 else "prestress"
            yield (
                f"{path_text(path)}.gap = {snubber.gap:g} m is a large {what} for a beam of this size (more than "
                f"{largest:.3g} m): a unit such as mm may be missing"
            )


def _idle_forces(scenario: ScenarioParts) -> Iterator[str]:
    places: list[tuple[str, tuple[Sited | DistributedLoad, ...]]] = [
        ("constant_forces", scenario.constant_forces),
        ("probes", scenario.probes),
    ]
    for name, items in places:
        for index, item in enumerate(items):
            if isinstance(item, DistributedLoad):
                continue
            body = scenario.all_bodies.get(item.place.body or scenario.default_body)
            if body is not None and item.place.position is not None and body.holds(item.place.position):
                yield f"{name}[{index}] sits on a support, which cannot deflect"


def _timing(scenario: ScenarioParts) -> Iterator[str]:
    run, excitation = scenario.run, scenario.excitation
    if run is None:
        return
    lowest = min(excitation.frequencies_hz, default=math.inf)
    if run.duration * lowest < 1.0:
        yield f"run.duration = {run.duration:g} s is shorter than one period of the excitation, {1.0 / lowest:g} s"
    highest = max(excitation.frequencies_hz, default=0.0)
    if scenario.sample_rate < 10.0 * highest:
        yield (
            f"run.sample_rate = {scenario.sample_rate:g} Hz is {scenario.sample_rate / highest:.3g} samples a period: "
            "time histories are coarse, and of a time-stepping method superharmonics fold back into the spectrum"
        )
    for path, shock in walk(excitation, ("excitation",)):
        if isinstance(shock, Shock) and scenario.sample_rate < 20.0 * shock.highest_frequency_hz:
            yield (
                f"run.sample_rate = {scenario.sample_rate:g} Hz puts fewer than 10 samples into the pulse of "
                f"{0.5 / shock.highest_frequency_hz:g} s"
            )
        if isinstance(shock, Shock) and shock.time >= run.duration:
            yield f"{path_text(path)}.time = {shock.time:g} s lies after the end of the run, {run.duration:g} s"
    if scenario.sample_rate * run.duration > 1.01 * MANY_SAMPLES:
        yield f"{scenario.sample_rate * run.duration:.3g} output samples make a very large result file"
