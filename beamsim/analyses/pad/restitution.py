r"""A mass that meets a spring with a dashpot: restitution, time in contact, largest penetration and force.

With :math:`m\ddot\delta + c\dot\delta + k\delta = 0`, :math:`\omega^2 = k/m`, :math:`\zeta = c/(2 m \omega)` and
:math:`s = \sqrt{1 - \zeta^2}`, contact begins at :math:`\delta = 0` with the speed v and ends

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
