"""Warnings about values that are allowed in a scenario but questionable."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from beamsim.scenario.damping import ModalDamping
from beamsim.scenario.excitation import HalfSine, Step
from beamsim.scenario.place import OneOfTwoPlaces

if TYPE_CHECKING:
    from beamsim.scenario.beam import Beam
    from beamsim.scenario.scenario import Scenario

MANY_SAMPLES = 5_000_000
"""More output samples than this make a file of a gigabyte or so."""


def doubts(scenario: Scenario) -> Iterator[str]:
    """Yield a sentence for each questionable value."""
    if scenario.beam is not None:
        yield from _beam(scenario.beam, max(scenario.excitation.frequencies_hz, default=0.0))
    yield from _damping(scenario)
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


def _beam(beam: Beam, highest_hz: float) -> Iterator[str]:
    if not 1e5 <= beam.youngs_modulus <= 2e12:
        yield f"beam.youngs_modulus = {beam.youngs_modulus:g} Pa is not plausible; a unit such as GPa may be missing"
    if not 1.0 <= beam.density <= 25_000.0:
        yield f"beam.density = {beam.density:g} kg/m^3 is not plausible; a unit such as g/cm^3 may be missing"
    depth = 2.0 * beam.extreme_fibre
    if depth > beam.length / 10.0:
        yield (
            f"the beam is {depth:g} m deep and {beam.length:g} m long: Euler-Bernoulli theory (no shear) is doubtful "
            "when the depth is more than a tenth of the length"
        )
    if highest_hz > 0.0:
        omega = 2.0 * math.pi * highest_hz
        wavelength = 2.0 * math.pi * (beam.bending_stiffness / beam.mass_per_length / omega**2) ** 0.25
        per_wave = wavelength / (beam.length / beam.elements)
        if per_wave < 6.0:
            yield (
                f"beam.elements = {beam.elements} gives {per_wave:.1f} elements a bending wavelength "
                f"at {highest_hz:g} Hz: use 6 or more"
            )


def _damping(scenario: Scenario) -> Iterator[str]:
    structure = scenario.beam or scenario.chain
    damping = None if structure is None else structure.damping
    if isinstance(damping, ModalDamping):
        ratios = damping.ratio if isinstance(damping.ratio, tuple) else (damping.ratio,)
        if max(ratios) >= 1.0:
            where = "chain" if scenario.beam is None else "beam"
            yield f"{where}.damping.ratio = {max(ratios):g} is critical or above; was {max(ratios):g} % meant?"


def _idle_forces(scenario: Scenario) -> Iterator[str]:
    beam = scenario.beam
    if beam is None:
        return
    held = [
        position
        for position, support in ((0.0, beam.supports.left), (beam.length, beam.supports.right))
        if support in ("clamped", "pinned")
    ]
    places: list[tuple[str, tuple[OneOfTwoPlaces, ...]]] = [
        ("constant_forces", scenario.constant_forces),
        ("probes", scenario.probes),
    ]
    for name, items in places:
        for index, item in enumerate(items):
            if item.position in held:
                yield f"{name}[{index}] sits on a support, which cannot deflect"


def _timing(scenario: Scenario) -> Iterator[str]:
    run, excitation = scenario.run, scenario.excitation
    if run is None:
        return
    lowest = min(excitation.frequencies_hz, default=math.inf)
    if run.duration * lowest < 1.0:
        yield f"run.duration = {run.duration:g} s is shorter than one period of the excitation, {1.0 / lowest:g} s"
    highest = max(excitation.frequencies_hz, default=0.0)
    if run.output_rate < 10.0 * highest:
        yield (
            f"run.sample_rate = {run.output_rate:g} Hz is {run.output_rate / highest:.3g} samples a period: "
            "superharmonics fold back into the spectrum"
        )
    if isinstance(excitation, HalfSine) and run.output_rate < 10.0 / excitation.duration:
        yield (
            f"run.sample_rate = {run.output_rate:g} Hz puts fewer than 10 samples into the pulse of "
            f"{excitation.duration:g} s"
        )
    if isinstance(excitation, (HalfSine, Step)) and excitation.time >= run.duration:
        yield f"excitation.time = {excitation.time:g} s lies after the end of the run, {run.duration:g} s"
    if run.output_rate * run.duration > 1.01 * MANY_SAMPLES:
        yield f"{run.output_rate * run.duration:.3g} output samples make a very large result file"
