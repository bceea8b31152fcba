"""Swept sines of a scenario: direction, level and phase of the sweep, and its windows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from beamsim.errors import Problem, ScenarioError
from beamsim.inputs.drift import Correction, jumps
from beamsim.inputs.legs import Leg
from beamsim.inputs.profiles import Profile, power_of
from beamsim.inputs.swept import SweepWindows, cut_into_windows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from beamsim.scenario.broadband import SweptSineInput
    from beamsim.scenario.level_profile import Notch, ProfilePoint
    from beamsim.scenario.quantities import Rate

MOST_PIECES = 4_000_000


def make_leg(first_hz: float, last_hz: float, rate: Rate) -> Leg:
    """One direction of a sweep.

    Parameters
    ----------
    first_hz, last_hz : Hz, from and to.
    rate : of the scenario, in octaves or Hz per second.
    """
    if rate.unit == "oct/s":
        return Leg(first_hz, last_hz, float(rate.value * np.log(2.0)), True)
    return Leg(first_hz, last_hz, float(rate.value), False)


def make_profile(
    level: float,
    quantity: str,
    points: Sequence[ProfilePoint] = (),
    between: str = "held",
    notches: Sequence[Notch] = (),
) -> Profile:
    """The level over frequency, with its notches.

    Parameters
    ----------
    level : in SI units; with a table a factor of its levels.
    quantity : of the level, and of points and notches that name none where it is a force.
    points : the table.
    between : its points, ``held`` or log-log interpolation.
    notches : ranges with a limit of their own.
    """
    default = "acceleration" if power_of(quantity) else quantity
    if points:
        table = [(p.frequency, p.level, p.quantity or default) for p in points]
        profile = (Profile.held(table) if between == "held" else Profile.interpolated(table)).scaled(abs(level))
    else:
        profile = Profile.constant(abs(level), quantity)
    for notch in notches:
        profile = profile.notched(notch.from_, notch.to, notch.level, notch.quantity or default)
    return profile


def phase_of_acceleration(quantity: str, level: float, points: Sequence[ProfilePoint] = ()) -> float:
    """Phase by which the acceleration leads the prescribed quantity (a sine), rad.

    With a table of levels that is the quantity of its first point: a displacement is X sin(phase) however it is given,
    and the phase of the acceleration runs on through the table.

    Parameters
    ----------
    quantity, level : as of `make_profile`; a negative level turns the phase.
    points : the table of levels, where there is one.
    """
    if points:
        quantity = points[0].quantity or "acceleration"
    return float(0.5 * np.pi * power_of(quantity) + (np.pi if level < 0 else 0.0))


def sweep_windows(
    excitation: SweptSineInput, duration: float | None
) -> tuple[SweepWindows, tuple[Correction, ...] | None]:
    """The windows of a swept sine up to a duration in s, and the corrections of a base's acceleration.

    Raises
    ------
    ScenarioError
        If the sweep ends before the run, or has too many cycles.
    """
    quantity = excitation.quantity or "acceleration"
    level = 1.0 if excitation.level is None else excitation.level
    profile = make_profile(level, quantity, excitation.profile, excitation.between, excitation.notches)
    phase = excitation.phase + phase_of_acceleration(quantity, level, excitation.profile)
    leg = make_leg(excitation.from_, excitation.to, excitation.rate)
    corrections = jumps([leg], profile, phase) if excitation.on_base else None  # whatever part of the sweep is run
    if duration is not None:
        if duration > leg.duration * (1 + 1e-9):
            raise ScenarioError(
                Problem(
                    "run.duration",
                    f"= {duration:g} s is longer than the sweep, which ends at {leg.duration:g} s",
                    f"use at most {np.floor(leg.duration * 1e4) / 1e4:g} s, or a wider or slower sweep",
                )
            )
        turns = float(leg.turns_after(np.array(leg.first_hz), np.array(duration)))
        last = float(leg.frequency(np.array(min(turns + 1.0, leg.cycles))))
        leg = Leg(leg.first_hz, last, leg.rate, leg.logarithmic)
    if leg.cycles * 8 > MOST_PIECES:
        raise ScenarioError(
            Problem(
                "excitation", f"has {leg.cycles:.3g} cycles, too many for a run", "use `beamsim sweep` or a shorter run"
            )
        )
    return cut_into_windows([leg], profile, phase=phase, corrections=corrections), corrections
