"""``beamsim sweep``, kind swept_sine: a continuous sweep, evaluated cycle by cycle."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any

import numpy as np

from beamsim.analyses.run.outputs import accelerations, bending_stress, displacements, first_rows, stack
from beamsim.analyses.sweep.peaks import bent
from beamsim.analyses.sweep.result import Envelope, SweepCurve, SweepHistory
from beamsim.errors import Problem, ScenarioError
from beamsim.flow.contact_state import LinearOutput
from beamsim.flow.swept_sine import CycleRecord, SweptFlow, sweep
from beamsim.inputs.broadband import make_leg, make_profile, phase_of_acceleration
from beamsim.inputs.profiles import Profile
from beamsim.inputs.swept import Leg, SweepWindows, cut_into_windows
from beamsim.scenario.excitation import Harmonic
from beamsim.scenario.sweep import SweptSine
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, Ints

MOST_CYCLES = 5_000_000


@dataclass(frozen=True)
class SweptRun:
    """One level, all its directions."""

    curves: tuple[SweepCurve, ...]
    record: CycleRecord
    truncation: float
    history: SweepHistory | None


def legs_of(settings: SweptSine) -> list[Leg]:
    """The legs of the sweep, up or down, in order."""
    up = make_leg(settings.from_, settings.to, settings.rate)
    down = make_leg(settings.to, settings.from_, settings.rate)
    legs = {"up": [up], "down": [down], "both": [up, down]}[settings.direction]
    cycles = sum(leg.cycles for leg in legs)
    if cycles > MOST_CYCLES:
        raise ScenarioError(
            Problem(
                "sweep.rate",
                f"= {settings.rate} makes a sweep of {cycles:.3g} cycles (at most {MOST_CYCLES:.0e})",
                "sweep faster or over fewer frequencies",
            )
        )
    if cycles < 2:
        raise ScenarioError(
            Problem("sweep.rate", f"= {settings.rate} covers the range in {cycles:.2g} cycles", "sweep more slowly")
        )
    return legs


def profile_of(settings: SweptSine, excitation: Harmonic, level: float) -> Profile:
    """Amplitude of acceleration or force against frequency; with a table ``level`` is a factor."""
    quantity = excitation.quantity or "acceleration"
    if settings.profile:
        profile = make_profile(None, quantity, settings.profile, settings.between).scaled(abs(level))
    else:
        profile = make_profile(level, quantity)
    for notch in settings.notches:
        default = "force" if quantity == "force" else "acceleration"
        profile = profile.notched(notch.from_, notch.to, notch.level, notch.quantity or default)
    return profile


def swept_flow(system: StructuralSystem, windows: SweepWindows) -> SweptFlow:
    """The flow of a built system whose one excitation is replaced by the swept sine."""
    sine = windows.coefficient
    if system.base_acceleration is None:
        return SweptFlow(system.dynamics, system.forcing.load, sine[None], windows)
    displacement = windows.integrated(2)
    channels = [sine if signal is system.base_acceleration else displacement for signal in system.forcing.signal]
    ground = system.forcing.base_displacement is not None
    if ground:
        channels.append(displacement)
    channels.append(sine)  # observed: the base's own acceleration
    return SweptFlow(system.dynamics, system.forcing.load, np.stack(channels), windows, base_displacement=ground)


def sweep_outputs(
    system: StructuralSystem, flow: SweptFlow, with_accelerations: bool, limited: Collection[str] = ()
) -> Callable[[Ints], LinearOutput]:
    """Displacements of the probes, forces of the snubbers, absolute accelerations of the probes, quantities of limits.

    The last are the penetrations of the snubbers where ``limited`` holds "gap", and the stress along the beam where it
    holds "bending_stress"; see :func:`limited_values`.
    """
    template = flow.template
    shapes = np.array([p.shape for p in system.probes]).reshape(-1, system.dynamics.size)
    moved = displacements(template, shapes)
    count = len(system.snubbers)

    def output_of(phases: Ints) -> LinearOutput:
        parts = [moved, first_rows(template.contact_forces(phases), count)]
        if with_accelerations:
            parts.append(accelerations(template, shapes, phases, absolute=system.base_acceleration is not None))
        return stack(*parts, *extra)

    extra = []
    if "gap" in limited:
        extra.append(first_rows(template.penetrations()[0], count))
    if "bending_stress" in limited and system.stress is not None:
        extra.append(bending_stress(template, system.stress))
    return output_of


def limited_values(
    system: StructuralSystem, with_accelerations: bool, limited: Collection[str], high: Floats, low: Floats
) -> dict[str, Any]:
    """Fields of a curve that are computed only for limits, from the extremes (C, K) of `sweep_outputs`."""
    P, S = len(system.probes), len(system.snubbers)
    first = P + S + (P if with_accelerations else 0)
    fields: dict[str, Any] = {}
    if "gap" in limited:
        fields["peak_gap"] = {s.name: -low[:, first + k] for k, s in enumerate(system.snubbers)}
        first += S
    if "bending_stress" in limited and system.stress is not None:
        fields["peak_bending_stress"] = np.maximum(np.abs(high[:, first:]), np.abs(low[:, first:])).max(axis=1)
    return fields


def run_level(
    system: StructuralSystem,
    settings: SweptSine,
    excitation: Harmonic,
    level: float,
    level_index: int,
    progress: Callable[[float], None] | None = None,
    limited: Collection[str] = (),
) -> SweptRun:
    """Sweep at one level in all directions; each direction starts from the final motion of the previous one."""
    legs = legs_of(settings)
    profile = profile_of(settings, excitation, level)
    lead = 0.0 if settings.profile else phase_of_acceleration(excitation.quantity or "acceleration", level)
    windows = cut_into_windows(legs, profile, phase=excitation.phase + lead, tolerance=settings.tolerance)
    flow = swept_flow(system, windows)
    output_of = sweep_outputs(system, flow, settings.accelerations, limited)
    orders = (0.0, *settings.orders)
    record = sweep(
        flow, system.initial_state, output_of, orders=orders, keep_history=settings.history_rate is not None,
        progress=progress,
    )  # fmt: skip
    curves = _curves(system, settings, excitation, level, level_index, legs, profile, record, limited)
    history = None if settings.history_rate is None else _history(system, settings, record, output_of)
    return SweptRun(curves, record, windows.truncation, history)


def _curves(
    system: StructuralSystem,
    settings: SweptSine,
    excitation: Harmonic,
    level: float,
    level_index: int,
    legs: list[Leg],
    profile: Profile,
    record: CycleRecord,
    limited: Collection[str],
) -> tuple[SweepCurve, ...]:
    windows = record.flow.windows
    tracked = np.stack([record.tracked(order) for order in (0.0, *settings.orders)])  # (1 + R, C, K)
    curves = []
    for index, leg in enumerate(legs):
        direction = "up" if leg.last_hz > leg.first_hz else "down"
        here = np.flatnonzero((windows.cycle_leg == index) & windows.cycle_complete)
        here = here[here < record.reached]

        def envelope(k: int, quantity: str, unit: str, here: Ints = here) -> Envelope:
            return Envelope(
                quantity,
                unit,
                record.high[here, k],
                record.low[here, k],
                np.sqrt(np.maximum(record.mean_square[here, k], 0.0)),
                tracked[0, here, k].real,
                tracked[1:, here, k],
            )

        probes, snubbers = [p.name for p in system.probes], [s.name for s in system.snubbers]
        P, S = len(probes), len(snubbers)
        curves.append(
            SweepCurve(
                name=f"{direction}_{level_index}",
                direction=direction,
                level_index=level_index,
                level=level,
                quantity=excitation.quantity or "acceleration",
                frequency_hz=windows.frequency_hz[here],
                time=windows.cycle_start[here],
                excitation_amplitude=profile(windows.frequency_hz[here]),
                orders=np.array(settings.orders),
                displacement={name: envelope(k, "displacement", "m") for k, name in enumerate(probes)},
                acceleration={
                    name: envelope(P + S + k, "absolute_acceleration", "m/s^2") for k, name in enumerate(probes)
                }
                if settings.accelerations
                else {},
                force={name: envelope(P + k, "force", "N") for k, name in enumerate(snubbers)},
                contact_share={name: record.contact_share[here, k] for k, name in enumerate(snubbers)},
                contacts={name: record.closings[here, k] for k, name in enumerate(snubbers)},
                **limited_values(system, settings.accelerations, limited, record.high[here], record.low[here]),
                bent=bent(record.contact_share[here, S:]),
            )
        )
    return tuple(curves)


MOST_SAMPLES = 50_000_000


def _history(
    system: StructuralSystem, settings: SweptSine, record: CycleRecord, output_of: Callable[[Ints], LinearOutput]
) -> SweepHistory:
    assert settings.history_rate is not None
    count = int(np.floor(record.end * settings.history_rate * (1 + 1e-12))) + 1
    if count > MOST_SAMPLES:
        raise ScenarioError(
            Problem(
                "sweep.history_rate",
                f"= {settings.history_rate:g} Hz over {record.end:g} s gives {count:.3g} samples",
                "lower it, or leave it out: envelopes and harmonics are exact without it",
            )
        )
    times = np.arange(count) / settings.history_rate
    values = record.sample(times, output_of)
    probes, snubbers = [p.name for p in system.probes], [s.name for s in system.snubbers]
    P, S = len(probes), len(snubbers)
    return SweepHistory(
        times,
        {name: values[:, k] for k, name in enumerate(probes)},
        {name: values[:, P + S + k] for k, name in enumerate(probes)} if settings.accelerations else {},
        {name: values[:, P + k] for k, name in enumerate(snubbers)},
    )
