r"""The compiled search for the first event on a segment of a motion, which passes over none.

Guards are functions :math:`g(\tau) = \mathrm{Re} \sum_b \gamma_b \tau^{p_b} e^{\lambda_b \tau}` that are positive while
the contacts stay in their phases. From value, slope and a bound on the curvature follows a step over which no guard can
reach zero; many of them lead to the first zero, or to the end of the segment.

Numbers are known to round-off, so that zero is a question of tolerances. There are three:

- The *noise* of a guard is the round-off of its terms at tau, or, where they cancel, that of the parts they are made of
  (`Guards.least`). Within it a guard counts as zero: it has an event where it is below zero by more, and only then.
- The *floor* of a guard is how far it may be below zero where the segment starts, until it rises. After an event all
  guards are positive or at zero, and what is below is round-off of the change of coordinates: at most `AT_EVENT` of
  the terms, or `AT_ONCE` of the segment. At the beginning of a motion, whose phases the first derivatives have
  decided, it is `AT_START` times the noise.
- A guard that has been at zero since its segment began, and falls (a contact at rest where an input begins), leaves
  zero late by its noise. If its first slope takes it below, the event is at tau, else at the start.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from beamsim.flow.compiled import kernel
from beamsim.flow.kernels import EPS, _exp

AT_EVENT, AT_ONCE, AT_START = 1e-9, 1e-10, 1e3  # floors, see above
BELOW = 10.0  # noises below zero, from which the lowest of several guards comes first
TAYLOR = 8  # order of the derivative that is bounded where bounds on the curvature allow short steps only
PATIENCE = 20  # steps on a segment, of which the last is such a longer one
ONWARDS, BEGINNING = -1, -2  # how a segment starts that does not start with the event of a guard
NO_EVENT, NO_STEP = -1, -2


class Guards(NamedTuple):
    """The first g guards of some tables, with the first B of their basis functions, on a segment."""

    basis: Any  # B
    count: Any  # g
    exponent: Any  # (B,) 1/s
    power: Any  # (B,)
    coefficient: Any  # (B, g)
    size: Any  # (B, g) of the coefficients
    least: Any  # (g,) round-off that cancelling parts of the coefficients leave


class SearchWork(NamedTuple):
    """Work of a search."""

    out: Any  # (4, g) value, slope, bound on the curvature, round-off
    floors: Any  # (g,)
    slopes: Any  # (g,) at the start of the segment, of what has not risen since; else -inf


@kernel
def make_search(guards):
    """Work for the search among a number of guards."""
    return SearchWork(np.empty((4, guards)), np.empty(guards), np.empty(guards))


@kernel
def first_event(guards, work, H, begins, most):
    """The first event on [0, H].

    Parameters
    ----------
    guards, work : what is searched, and room for it.
    H : s, length of the segment.
    begins : the guard whose event is at its start, `ONWARDS` without one, or `BEGINNING` of the motion.
    most : evaluations of the guards.

    Returns
    -------
    tau : s, time of the event, H without one, or how far the search came with ``most`` evaluations.
    hit : the guard; `NO_EVENT` up to tau, or `NO_STEP` where a step has no length.
    evaluations : of the guards.
    """
    out, floors, slopes = work.out, work.floors, work.slopes
    for j in range(guards.count):
        floors[j] = 0.0
    tau, evaluations = 0.0, 0
    while tau < H and evaluations <= most:
        reach = _evaluate(guards, tau, H, out)
        evaluations += 1
        if tau == 0.0 and begins != ONWARDS:
            _fill_floors(guards, out, H, begins, floors)
        step, hit = _next_step(guards, out, floors, tau, reach, evaluations % PATIENCE == 0)
        if begins < 0:
            step *= _follow_zeros(guards, out, tau, slopes, floors)
        if hit >= 0:
            if begins < 0 and slopes[hit] * tau > -0.5 * _noise(guards, out, hit):
                return 0.0, hit, evaluations
            return _crossing(out, hit, tau), hit, evaluations
        if tau + step == tau:
            return tau, NO_STEP, evaluations
        tau += step
    return min(tau, H), NO_EVENT, evaluations


@kernel
def _noise(guards, out, j):
    """What a guard is known to.

    Parameters
    ----------
    guards : Guards.
    out : (4, g) as `_evaluate` fills it.
    j : the guard.

    Returns
    -------
    float
        In units of the guard.
    """
    return max(out[3, j], guards.least[j])


@kernel
def _tolerance(guards, out, floors, j):
    """How far below zero a guard has an event: its noise, or its floor.

    Parameters
    ----------
    guards, out, j : as for `_noise`.
    floors : (g,) floors.

    Returns
    -------
    float
        In units of the guard.
    """
    return max(_noise(guards, out, j), floors[j])


@kernel
def _evaluate(guards, tau, H, out):
    """Value, slope, bound on the curvature over [tau, reach] and round-off of the guards into ``out``; returns reach.

    The bound is the triangle inequality on every term's second derivative, with decaying exponentials taken at tau.
    A high power is bounded by its value at the far end: after a first look as far as H, no further than twice tau.

    Parameters
    ----------
    guards : Guards.
    tau : s, since the start of the segment.
    H : s, length of the segment.
    out : (4, g) value, slope, bound on the curvature, round-off; written.

    Returns
    -------
    reach : s, as far as the bound holds.
    """
    values, slopes, bounds, noises = out[0], out[1], out[2], out[3]
    count, gamma, size = guards.count, guards.coefficient, guards.size
    for j in range(count):
        values[j], slopes[j], bounds[j], noises[j] = 0.0, 0.0, 0.0, 0.0
    first_value, first_slope, first_bound, first_noise = 0.0, 0.0, 0.0, 0.0
    reach = H
    for b in range(guards.basis):
        if guards.power[b] > 2 and tau > 0.0:
            reach = min(H, max(2.0 * tau, H / 64.0))
            break
    for b in range(guards.basis):
        lam, p = guards.exponent[b], guards.power[b]
        e = _exp(lam.real, lam.imag, tau)
        r2 = lam.real * lam.real + lam.imag * lam.imag
        r = math.sqrt(r2)
        level = 1.0 if lam.real == 0.0 else math.exp(lam.real * (tau if lam.real < 0.0 else reach))
        if p == 0:
            value = e
            slope = lam * e
            bound = r2 * level
            noise = EPS * (8.0 + r * tau) * level
        else:
            tp = tau ** (p - 1)
            value = e * (tp * tau)
            slope = lam * value + e * (p * tp)
            rp = reach ** max(p - 2, 0)
            if p == 1:
                bound = (r2 * reach + 2.0 * r) * level
            else:
                bound = (r2 * reach * reach + 2.0 * p * r * reach + p * (p - 1.0)) * rp * level
            noise = EPS * (8.0 + p + r * tau) * level * tp * tau
        vr, vi, sr, si = value.real, value.imag, slope.real, slope.imag
        g = gamma[b, 0]
        a = size[b, 0]
        first_value += g.real * vr - g.imag * vi
        first_slope += g.real * sr - g.imag * si
        first_bound += a * bound
        first_noise += a * noise
        for j in range(1, count):
            g = gamma[b, j]
            a = size[b, j]
            values[j] += g.real * vr - g.imag * vi
            slopes[j] += g.real * sr - g.imag * si
            bounds[j] += a * bound
            noises[j] += a * noise
    values[0], slopes[0], bounds[0], noises[0] = first_value, first_slope, first_bound, first_noise
    return reach


@kernel
def safe_step(g, slope, bound):
    """Longest step over which ``g + slope h - bound h^2 / 2`` stays positive.

    Parameters
    ----------
    g, slope : value, positive, and slope here.
    bound : on the size of the curvature from here on.

    Returns
    -------
    float
        s, infinite where it stays positive.
    """
    if bound <= 0.0:
        return np.inf if slope >= 0.0 else -g / slope
    root = math.sqrt(slope * slope + 2.0 * bound * g)
    if slope < 0.0:
        return 2.0 * g / (root - slope)
    if root == 0.0:  # the product is too small for a number: what is left of a motion that has decayed
        return math.sqrt(2.0 * g / bound)
    return (slope + root) / bound


@kernel
def _next_step(guards, out, floors, tau, reach, longer):
    """(step, hit): a step over which no guard can reach zero; the guard at zero already (`NO_EVENT`: none).

    A guard is lifted by twice its tolerance: a contact that stays at zero to round-off is ignored, and every step has a
    smallest length. Of guards that an event has put below zero the lowest comes first. A ``longer`` step takes higher
    derivatives of the guards whose curvature stops it before ``reach``.

    Parameters
    ----------
    guards : Guards.
    out : (4, g) at tau, as `_evaluate` fills it.
    floors : (g,) floors.
    tau, reach : s, where the step begins, and as far as the bounds hold.
    longer : whether to look for a longer step.

    Returns
    -------
    step : s.
    hit : the guard, or `NO_EVENT`.
    """
    step, hit = reach - tau, NO_EVENT
    for j in range(guards.count):
        tolerance = _tolerance(guards, out, floors, j)
        lifted = out[0, j] + 2.0 * tolerance
        if lifted < tolerance:
            if hit < 0 or (lifted < -BELOW * tolerance and out[0, j] < out[0, hit]):
                hit = j
        elif hit < 0:
            h = safe_step(lifted, out[1, j], out[2, j])
            if longer and h < step:
                h = max(h, _taylor_step(guards, j, tau, reach, lifted))
            step = min(step, h)
    return step, hit


@kernel
def _fill_floors(guards, out, H, begins, floors):
    """Floors of the guards that are below zero at the start of a segment, after an event or at the beginning.

    Parameters
    ----------
    guards : Guards.
    out : (4, g) at the start, as `_evaluate` fills it.
    H : s, length of the segment.
    begins : the guard whose event is there, or `BEGINNING` of the motion.
    floors : (g,) in units of the guards; written.
    """
    for j in range(guards.count):
        if out[0, j] >= 0.0:
            continue
        if begins >= 0:
            scale = 0.0
            for b in range(guards.basis):
                scale += guards.size[b, j] * H ** guards.power[b]
            floors[j] = min(-2.0 * out[0, j], max(AT_EVENT * scale, AT_ONCE * H * out[1, j]))
        elif out[1, j] > 0.0:
            floors[j] = min(-2.0 * out[0, j], AT_START * _noise(guards, out, j))


@kernel
def _follow_zeros(guards, out, tau, slopes, floors):
    """Fill in the slopes of `SearchWork`; what has risen has no floor any more.

    Returns the share of a step to take: half of the first one where a guard rises, so that it is seen above zero before
    it may come back.

    Parameters
    ----------
    guards : Guards.
    out : (4, g) at tau, as `_evaluate` fills it.
    tau : s.
    slopes, floors : (g,) of `SearchWork`; written.

    Returns
    -------
    share : of a step that is to be taken.
    """
    share = 1.0
    for j in range(guards.count):
        if out[0, j] > _noise(guards, out, j):
            slopes[j] = -np.inf
            floors[j] = 0.0
        elif tau == 0.0:
            slopes[j] = out[1, j]
            if out[1, j] > 0.0:
                share = 0.5
    return share


@kernel
def _crossing(out, hit, tau):
    """Time of the zero next to tau, by one Newton step where the curvature allows it.

    Parameters
    ----------
    out : (4, g) at tau, as `_evaluate` fills it.
    hit : the guard.
    tau : s.

    Returns
    -------
    tau : s, of the zero.
    """
    g, slope, bound = out[0, hit], out[1, hit], out[2, hit]
    if slope < 0.0 and -g * bound <= 0.1 * slope * slope:
        return max(0.0, tau - g / slope)
    return tau


@kernel
def _taylor_step(guards, j, tau, reach, value):
    """Step from value > 0 over which guard j stays positive.

    Where terms cancel, a guard and its first derivatives are small; the bound on its curvature is not. So the
    derivatives up to the seventh are evaluated, with their round-off, and the eighth is bounded.

    Parameters
    ----------
    guards : Guards.
    j : the guard.
    tau, reach : s, where the step begins, and as far as it may go.
    value : of the guard at tau, lifted.

    Returns
    -------
    step : s.
    """
    derivative, noise = np.zeros(TAYLOR), np.zeros(TAYLOR)
    bound = 0.0
    for b in range(guards.basis):
        a = guards.size[b, j]
        if a == 0.0:
            continue
        lam, p = guards.exponent[b], guards.power[b]
        r = abs(lam)
        g = guards.coefficient[b, j] * _exp(lam.real, lam.imag, tau)
        level = a * math.exp(lam.real * tau)
        doubt = EPS * (8.0 + p + r * tau) * level
        for k in range(TAYLOR):
            total, rough = 0.0j, 0.0
            factor = 1.0  # binomial coefficient times p! / (p - i)!
            for i in range(min(k, p) + 1):
                part = factor * tau ** (p - i)
                total += part * lam ** (k - i)
                rough += part * r ** (k - i)
                factor *= (k - i) * (p - i) / (i + 1.0)
            derivative[k] += (g * total).real
            noise[k] += doubt * rough
        if lam.real > 0.0:
            level = a * math.exp(lam.real * reach)
        factor = 1.0
        for i in range(min(TAYLOR, p) + 1):
            bound += level * factor * reach ** (p - i) * r ** (TAYLOR - i)
            factor *= (TAYLOR - i) * (p - i) / (i + 1.0)
    step = reach - tau
    while True:
        fall, factor = 0.0, 1.0
        for k in range(1, TAYLOR):
            factor *= step / k
            fall += (max(-derivative[k], 0.0) + noise[k]) * factor
        if fall + bound * factor * step / TAYLOR < value or step < 1e-300:
            return step
        step *= 0.5
