r"""``beamsim pad``: a snubber's numbers from a material, a measured curve or an impact, and back.

**Blocks.** A rubber block of height h and loaded area A, bonded to both plates or held by friction, cannot spread at
its faces. Its apparent modulus in compression is (A. N. Gent, P. B. Lindley, The compression of bonded rubber blocks,
Proc. Inst. Mech. Eng. 173 (1959) 111–122)

.. math:: E_c = E\,(1 + 2 \kappa S^2), \qquad \frac{1}{E_c'} = \frac{1}{E_c} + \frac{1}{B}, \qquad k = E_c' A / h,

with the shape factor S, loaded area over the area that is free to bulge, a factor :math:`\kappa` (1 for soft unfilled
rubber, down to 0.5 for hard filled rubber), and the bulk modulus B where it is given. It holds for small strains, to
about 10 %, and compact blocks (circular or square). Lubricated faces: S = 0.

**Impacts.** With :math:`m\ddot\delta + c\dot\delta + k\delta = 0`, :math:`\omega^2 = k/m`,
:math:`\zeta = c/(2 m \omega)` and :math:`s = \sqrt{1 - \zeta^2}`, contact of a mass begins at :math:`\delta = 0` with
the speed v and ends

* after half a damped period, where :math:`\delta = 0` (Kelvin–Voigt): :math:`e = \exp(-\pi\zeta/s)`, which needs
  :math:`\zeta < 1`;
* where the force vanishes (no tension): after :math:`2\arccos\zeta / (s\omega)` with
  :math:`e = \exp(-2 \zeta \arccos(\zeta) / s)`, which holds for :math:`\zeta \ge 1` too, with
  :math:`\arccos(\zeta)/s = \operatorname{arcosh}(\zeta)/\sqrt{\zeta^2 - 1}`.

T. Schwager, T. Pöschel, Coefficient of restitution and linear-dashpot model revisited, Granular Matter 9 (2007)
465–469, derive both. Gravity and other forces on the mass are left out: they must be small against the contact force.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

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


LARGEST_STRAIN = 0.1  # for which the stiffness is taken as constant


def block_stiffness(
    modulus: float, area: float, height: float, shape_factor: float, factor: float = 1.0, bulk: float | None = None
) -> float:
    """Stiffness in N/m; modulus and bulk in Pa, area in m^2, height in m.

    >>> block_stiffness(2e6, 1e-4, 0.01, 0.5)
    30000.0
    """
    apparent = modulus * (1.0 + 2.0 * factor * shape_factor**2)
    if bulk is not None:
        apparent = 1.0 / (1.0 / apparent + 1.0 / bulk)
    return apparent * area / height


def block_modulus(
    stiffness: float, area: float, height: float, shape_factor: float, factor: float = 1.0, bulk: float | None = None
) -> float:
    """The modulus, Pa, of a block of this stiffness; infinite where the bulk modulus alone is too soft.

    >>> block_modulus(30000.0, 1e-4, 0.01, 0.5)
    2000000.0
    """
    apparent = stiffness * height / area
    if bulk is not None:
        apparent = 1.0 / (1.0 / apparent - 1.0 / bulk) if apparent < bulk else float("inf")
    return apparent / (1.0 + 2.0 * factor * shape_factor**2)


def angle(ratio: float) -> float:
    """Arccos(zeta) / sqrt(1 - zeta^2), continued beyond critical damping.

    >>> angle(0.0) == math.pi / 2, angle(1.0)
    (True, 1.0)
    """
    distance = ratio - 1.0
    # 1e-5: distance of the damping ratio from 1 within which the quotient is taken by its series
    if abs(distance) < 1e-5:
        return 1.0 - distance / 3.0 + 2.0 / 15.0 * distance**2
    if ratio < 1.0:
        return math.acos(ratio) / math.sqrt(1.0 - ratio**2)
    return math.acosh(ratio) / math.sqrt(ratio**2 - 1.0)


def restitution(ratio: float, law: str) -> float:
    """Separation over approach speed at a damping ratio; nan where Kelvin–Voigt is damped so much that the mass stays.

    >>> restitution(1.0, "no_tension") == math.exp(-2.0)
    True
    """
    if law == "no_tension":
        return math.exp(-2.0 * ratio * angle(ratio))
    return math.exp(-math.pi * ratio / math.sqrt(1.0 - ratio**2)) if ratio < 1.0 else math.nan


def damping_ratio(value: float, law: str) -> float:
    """The damping ratio that gives a restitution between 0 and 1.

    >>> round(damping_ratio(restitution(0.3, "no_tension"), "no_tension"), 12)
    0.3
    """
    if value == 1.0:
        return 0.0
    if law == "no_tension":
        from scipy.optimize import brentq

        high = 1.0 + 1.0 / math.sqrt(value)  # e tends to 1 / (4 zeta^2)
        return float(brentq(lambda ratio: 2.0 * ratio * angle(ratio) + math.log(value), 0.0, high, xtol=1e-15))
    return -math.log(value) / math.hypot(math.pi, math.log(value))


def contact_time(ratio: float, omega: float, law: str) -> float:
    """Time in contact, s, with omega = sqrt(k / m) in rad/s; infinite where the mass stays."""
    if law == "no_tension":
        return 2.0 * angle(ratio) / omega
    return math.pi / (omega * math.sqrt(1.0 - ratio**2)) if ratio < 1.0 else math.inf


def largest_penetration(ratio: float, omega: float, speed: float) -> float:
    """M, where the speed is zero."""
    return speed / omega * math.exp(-ratio * angle(ratio))


def peak_force(ratio: float, omega: float, mass: float, speed: float) -> float:
    """Largest force, N: at the beginning from zeta = 0.5 on, where the dashpot's is the largest."""
    if ratio >= 0.5:
        return 2.0 * ratio * omega * mass * speed
    turned = 0.5 * math.pi - 3.0 * math.asin(ratio)
    return mass * speed * omega * math.exp(-ratio * turned / math.sqrt(1.0 - ratio**2))
