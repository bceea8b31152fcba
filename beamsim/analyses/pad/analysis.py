"""``beamsim pad``: a snubber's numbers from a material, a measured curve or an impact, and back."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from beamsim.analyses.pad.restitution import (
    contact_time,
    damping_ratio,
    largest_penetration,
    peak_force,
    restitution,
)
from beamsim.analyses.pad.rubber_block import LARGEST_STRAIN, block_modulus, block_stiffness
from beamsim.contacts.pads import ForceCurve, fit_curve
from beamsim.errors import Problem, ScenarioError
from beamsim.measurements.signal import MeasurementError
from beamsim.system.force_tables import read_forces
from beamsim.typing import Floats

Law = Literal["kelvin_voigt", "no_tension"]


@dataclass(frozen=True, kw_only=True)
class PadInput:
    """What is known, in SI units."""

    modulus: float | None = None  # Pa
    shape_factor: float | None = None
    area: float | None = None  # m^2
    height: float | None = None  # m
    factor: float = 1.0  # kappa of the shape factor
    bulk_modulus: float | None = None  # Pa
    curve: Path | None = None  # measured force over deflection
    segments: int = 5
    stiffness: float | None = None  # N/m
    contact_time: float | None = None  # s
    restitution: float | None = None
    dashpot: float | None = None  # N s/m
    loss_factor: float | None = None
    frequency: float | None = None  # Hz
    mass: float | None = None  # kg, that the pad stops
    speed: float | None = None  # m/s, of it
    law: Law = "kelvin_voigt"


@dataclass(frozen=True, kw_only=True)
class PadNumbers:
    """The numbers of a snubber and what follows from them, in SI units; None where it is not known."""

    stiffness: float  # N/m; of a curve that of the same energy at its largest deflection
    dashpot: float  # N s/m
    law: Law
    points: tuple[tuple[float, float], ...] | None = None  # m, N of a curve of several segments
    misfit: float | None = None  # N, of the curve
    loop_restitution: float | None = None  # of the measured loop
    modulus: float | None = None  # Pa
    damping_ratio: float | None = None  # of the mass on the closed pad
    restitution: float | None = None
    contact_time: float | None = None  # s
    penetration: float | None = None  # m, largest
    peak_force: float | None = None  # N
    strain: float | None = None  # largest
    notes: tuple[str, ...] = ()


def pad(known: PadInput) -> PadNumbers:
    """The snubber that has what is known.

    Raises
    ------
    ScenarioError
        Where too little or too much is known.
    """
    _check_sources(known)
    curve, misfit, loop, notes = None, None, None, list[str]()
    stiffness = known.stiffness
    if known.curve is not None:
        curve, misfit, loop = _measured(known.curve, known.segments)
        stiffness = 2.0 * _work(curve.deflection, curve.force) / float(curve.deflection[-1]) ** 2
    elif known.modulus is not None:
        assert known.area is not None
        assert known.height is not None
        shape = known.shape_factor or 0.0
        stiffness = block_stiffness(known.modulus, known.area, known.height, shape, known.factor, known.bulk_modulus)
    elif known.contact_time is not None:
        stiffness = _stiffness_of_time(known)
    assert stiffness is not None
    target = known.restitution
    if target is None and known.dashpot is None and known.loss_factor is None and loop is not None and known.mass:
        target = loop
        notes.append("the dashpot gives the restitution of the measured loop")
    dashpot = _dashpot(known, stiffness, target)
    out = PadNumbers(
        stiffness=stiffness,
        dashpot=dashpot,
        law=known.law,
        points=None if curve is None or curve.slopes.size == 1 else _points(curve),
        misfit=misfit,
        loop_restitution=loop,
        modulus=_modulus(known, stiffness),
        **_impact(known, stiffness, dashpot),
    )
    if out.points is not None and known.mass is not None:
        notes.append("damping ratio, restitution and contact time are those of a spring of the curve's energy")
    if out.restitution is not None and math.isnan(out.restitution):
        notes.append("damped beyond critical, the mass does not come back from a Kelvin-Voigt pad: see --no-tension")
    if out.strain is not None and out.strain > LARGEST_STRAIN:
        notes.append(
            f"the strain of {100 * out.strain:.3g} % is beyond {100 * LARGEST_STRAIN:g} %, up to which the stiffness "
            "of a block is about constant: measure a curve"
        )
    return PadNumbers(**{**vars(out), "notes": tuple(notes)})


def _check_sources(known: PadInput) -> None:
    """One source of the stiffness, one at most of the damping, and what each needs.

    Raises
    ------
    ScenarioError
    """
    problems = []
    elastic = [name for name in ("modulus", "curve", "stiffness", "contact_time") if getattr(known, name) is not None]
    lossy = [name for name in ("restitution", "dashpot", "loss_factor") if getattr(known, name) is not None]
    if len(elastic) != 1:
        what = "is missing" if not elastic else f"and {_option(elastic[1])} exclude each other"
        remedy = "give one of --modulus, --curve, --stiffness, --contact-time"
        problems.append(Problem(_option(elastic[0] if elastic else "stiffness"), what, remedy))
    if len(lossy) > 1:
        remedy = "give at most one of --restitution, --dashpot, --loss-factor"
        problems.append(Problem(_option(lossy[0]), f"and {_option(lossy[1])} exclude each other", remedy))
    needs = {
        "modulus": ("area", "height"),
        "restitution": ("mass",),
        "contact_time": ("mass",),
        "loss_factor": ("frequency",),
        "speed": ("mass",),
    }
    examples = {"area": "'4 cm^2'", "height": "'6 mm'", "mass": "'50 g'", "frequency": "'65 Hz'"}
    for name, others in needs.items():
        for other in others if getattr(known, name) is not None else ():
            if getattr(known, other) is None:
                remedy = f"give for example {_option(other)} {examples[other]}"
                problems.append(Problem(_option(other), f"is missing, which {_option(name)} needs", remedy))
    if known.modulus is not None and known.bulk_modulus is not None and known.modulus > 3.0 * known.bulk_modulus:
        what = f"= {known.bulk_modulus:g} Pa is less than a third of --modulus = {known.modulus:g} Pa"
        remedy = "check both and their units: Poisson's ratio would be negative"
        problems.append(Problem(_option("bulk_modulus"), what, remedy))
    if known.contact_time is not None and (known.dashpot is not None or known.loss_factor is not None):
        other = _option("dashpot" if known.dashpot is not None else "loss_factor")
        problems.append(Problem(_option("contact_time"), f"and {other} do not go together", "give --restitution"))
    if problems:
        raise ScenarioError(problems)


def _option(name: str) -> str:
    return "--" + name.replace("_", "-")


def _measured(file: Path, segments: int) -> tuple[ForceCurve, float, float | None]:
    """Fitted curve, misfit in N, and the restitution of the loop where the pad is unloaded too.

    Raises
    ------
    ScenarioError
    """
    try:
        deflection, force, _ = read_forces(file)
        curve, misfit = fit_curve(deflection, force, segments)
    except MeasurementError as fault:
        raise ScenarioError(Problem("--curve", f"= {file} {fault.message}", fault.remedy)) from None
    except ValueError as error:
        remedy = "it needs a column of deflections and one of forces, from zero on"
        raise ScenarioError(Problem("--curve", f"= {file} cannot be used: {error}", remedy)) from None
    top = int(np.argmax(deflection))
    loop = None
    if 0 < top < deflection.size - 1 and deflection[-1] < 0.5 * deflection[top]:
        given = _work(deflection[: top + 1], force[: top + 1])
        back = -_work(deflection[top:], force[top:])
        if 0.0 < back <= given:
            loop = math.sqrt(back / given)
    # 1e-12: misfit of a curve, over its largest force, that is round-off
    exact = misfit <= 1e-12 * float(np.abs(force).max())
    return curve, 0.0 if exact else misfit, loop


def _work(deflection: Floats, force: Floats) -> float:
    return float(np.trapezoid(force, deflection))


def _points(curve: ForceCurve) -> tuple[tuple[float, float], ...]:
    return tuple(zip(curve.deflection.tolist(), curve.force.tolist(), strict=True))


def _stiffness_of_time(known: PadInput) -> float:
    """From the time in contact of the mass."""
    assert known.mass is not None
    assert known.contact_time is not None
    ratio = damping_ratio(1.0 if known.restitution is None else known.restitution, known.law)
    omega = contact_time(ratio, 1.0, known.law) / known.contact_time
    return known.mass * omega**2


def _dashpot(known: PadInput, stiffness: float, target: float | None) -> float:
    if target is not None:
        assert known.mass is not None
        return 2.0 * damping_ratio(target, known.law) * math.sqrt(stiffness * known.mass)
    if known.loss_factor is not None:
        assert known.frequency is not None
        return known.loss_factor * stiffness / (2.0 * math.pi * known.frequency)
    return known.dashpot or 0.0


def _modulus(known: PadInput, stiffness: float) -> float | None:
    """Of a block with this stiffness, where its size is known."""
    if known.modulus is not None or known.area is None or known.height is None:
        return known.modulus
    return block_modulus(
        stiffness, known.area, known.height, known.shape_factor or 0.0, known.factor, known.bulk_modulus
    )


def _impact(known: PadInput, stiffness: float, dashpot: float) -> dict[str, Any]:
    """What the mass does, where it is known."""
    if known.mass is None:
        return {}
    omega = math.sqrt(stiffness / known.mass)
    ratio = dashpot / (2.0 * math.sqrt(stiffness * known.mass))
    out = {
        "damping_ratio": ratio,
        "restitution": restitution(ratio, known.law),
        "contact_time": contact_time(ratio, omega, known.law),
    }
    if known.speed is not None:
        out["penetration"] = largest_penetration(ratio, omega, known.speed)
        out["peak_force"] = peak_force(ratio, omega, known.mass, known.speed)
        if known.height is not None:
            out["strain"] = out["penetration"] / known.height
    return out
