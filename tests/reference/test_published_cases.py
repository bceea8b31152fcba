"""Published cases of the field against closed forms and independent solutions.

The cases, their sources and the printed numbers are those of the page of validation (`docs/site_pages/published.py`).
"""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve
from site_pages import published
from site_pages.published import CASES

G = 9.81


def printed(computed):
    (case,) = (case for case in CASES if case.computed is computed)
    return case.printed


def right(computed):
    (case,) = (case for case in CASES if case.computed is computed)
    return case.right


def assert_right(computed, values, rel=1e-8):
    """The numbers that the page compares with are those of the closed form."""
    assert right(computed) == pytest.approx(values, rel=rel)


def kelvin_voigt(mass, stiffness, dashpot, load=0.0):
    """Motion x(t), v(t) of a damped oscillator under a constant load from x0, v0; the closed form."""
    omega, zeta = math.sqrt(stiffness / mass), dashpot / (2.0 * math.sqrt(stiffness * mass))
    damped, rest = omega * math.sqrt(1.0 - zeta**2), load / stiffness

    def motion(t, x0, v0):
        a, b = x0 - rest, (v0 + zeta * omega * (x0 - rest)) / damped
        decay, c, s = np.exp(-zeta * omega * t), np.cos(damped * t), np.sin(damped * t)
        x = decay * (a * c + b * s)
        return x + rest, decay * damped * (b * c - a * s) - zeta * omega * x

    return motion


def test_backlash_of_modelica():
    """The pressed side pushes until spring and dashpot balance; then the disc flies to the other one."""
    motion, depth = kelvin_voigt(5.0, 2e4, 50.0), 1.570796326794897 - published.HALF_GAP
    left = brentq(lambda t: 2e4 * motion(t, depth, 0.0)[0] + 50.0 * motion(t, depth, 0.0)[1], 0.01, 0.04, xtol=1e-15)
    x, speed = motion(left, depth, 0.0)
    met = left - (x + 2.0 * published.HALF_GAP) / speed
    found = published.backlash()
    assert found["torque is zero at, s"] == pytest.approx(left, rel=1e-9)
    assert found["speed between, rad/s"] == pytest.approx(speed, rel=1e-9)
    assert found["the other side is met at, s"] == pytest.approx(met, rel=1e-9)
    names = ("torque is zero at, s", "the other side is met at, s", "speed between, rad/s")
    assert_right(published.backlash, dict(zip(names, (left, met, speed), strict=True)))
    for quantity, value in printed(published.backlash).items():  # the tolerance of the source's integrator
        assert found[quantity] == pytest.approx(value, rel=3e-6)


def test_elastoplastic_frame_of_vm80():
    """Elastic up to the yield force, then a constant deceleration, then elastic about the plastic displacement."""
    m, k, limit, force = 0.0259, 83.4, 45.2862, 30.0
    omega, static = math.sqrt(k / m), force / k
    yields = math.acos(1.0 - limit / k / static) / omega
    speed, deceleration = static * omega * math.sin(omega * yields), (limit - force) / m
    top, at = limit / k + speed**2 / (2.0 * deceleration), yields + speed / deceleration
    low, then = top - 2.0 * (limit - force) / k, at + math.pi / omega
    found = published.vm80()
    assert found["largest displacement, in"] == pytest.approx(top, rel=1e-6)
    assert found["smallest after it, in"] == pytest.approx(low, rel=1e-6)
    assert (found["at, s"], found["then at, s"]) == (pytest.approx(at, abs=1e-5), pytest.approx(then, abs=1e-5))
    names = ("largest displacement, in", "at, s", "smallest after it, in", "then at, s")
    assert_right(published.vm80, dict(zip(names, (top, at, low, then), strict=True)))
    for quantity, value in printed(published.vm80).items():  # from time steps
        assert found[quantity] == pytest.approx(value, rel=3e-3)


def test_cubic_spring_of_vm319():
    """A harmonic balance written for this equation gives the same amplitudes, and less beside the resonance."""
    orders, phase = np.array([1, 3, 5, 7]), 2.0 * np.pi * np.arange(64) / 64
    cosines, sines = np.cos(np.outer(orders, phase)), np.sin(np.outer(orders, phase))

    def amplitude(omega, force, guess):
        def residual(z):
            a, b = z[:4], z[4:]
            cubic = 4.6752e7 * (a @ cosines + b @ sines) ** 3
            dynamic, damping = 8766.2 - (orders * omega) ** 2, 0.46813 * orders * omega
            out = [dynamic * a + damping * b + cosines @ cubic / 32, dynamic * b - damping * a + sines @ cubic / 32]
            out[1][0] -= force
            return np.concatenate(out)

        z = fsolve(residual, np.concatenate([[-guess, 0, 0, 0], np.zeros(4)]), xtol=1e-13)
        size = np.hypot(z[:4], z[4:])
        return 1e3 * float(np.hypot(size[0], size[1]))

    found = published.vm319()
    for force in (0.125, 0.25):
        omega, value = (found[f"{of} at {force:g} N, {unit}"] for of, unit in
                        (("resonance", "rad/s"), ("sqrt(A1^2 + A3^2)", "mm")))  # fmt: skip
        assert value == pytest.approx(amplitude(omega, force, 1e-3 * value), rel=1e-5)
        assert amplitude(0.999 * omega, force, 1e-3 * value) < value
        assert right(published.vm319)[f"sqrt(A1^2 + A3^2) at {force:g} N, mm"] == pytest.approx(value, rel=1e-5)
    for quantity, value in printed(published.vm319).items():  # read from a table of frequencies
        assert found[quantity] == pytest.approx(value, rel=3e-3)


def test_rigid_friction_of_sdnd100a():
    """Each half cycle takes twice the friction force over the stiffness from the amplitude."""
    found = list(published.sdnd100a().values())
    expected = [1e3 * (-1) ** k * (0.85e-3 - 2e-4 * k) for k in range(1, 5)]
    assert found == pytest.approx(expected, abs=1e-9)
    assert found == pytest.approx(list(right(published.sdnd100a).values()), abs=1e-9)


def bar_face(t):
    """Displacement of the face of the bar that comes with 1 m/s, m, by d'Alembert, contact being rigid.

    The faces move with half the speed until the waves come back from both ends, then back until the waves return again.
    """
    passes = 1.0 / math.sqrt(2e11 / 7800.0)
    turns, leaves = 2.0 * passes, 4.0 * passes
    if t <= turns:
        return 0.5 * t
    return 0.5 * (leaves - t) if t <= leaves else leaves - t


def test_two_bars_of_sdnl111a():
    """The chain of masses approaches the waves of the continuous bars; the printed values are rounded to 0.1 mm."""
    times = np.array([2e-4, 4e-4, 6e-4, 8e-4, 1e-3])
    exact = np.array([-1e3 * bar_face(t) for t in times])
    assert exact == pytest.approx(list(right(published.sdnl111a).values()), abs=1e-8)
    found = np.array(list(published.sdnl111a().values()))
    coarse = np.array(list(published.sdnl111a(20).values()))
    assert found == pytest.approx(exact, abs=0.006)
    assert np.abs(found - exact).sum() < np.abs(coarse - exact).sum()
    assert found == pytest.approx(list(printed(published.sdnl111a).values()), abs=0.01)


@pytest.mark.parametrize("gap", [0.5, -0.5])
def test_rigid_stop_of_todd_and_virgin(gap):
    """T = 2 (pi/2 + asin(d/A)) and the time in contact with a stop of 1e8 times the stiffness."""
    stiff = 1e8
    omega, speed = math.sqrt(1.0 + stiff), math.sqrt(1.0 - gap**2)
    contact = 2.0 / omega * (math.pi / 2.0 - math.atan(gap / (1.0 + stiff) * omega / speed))
    period = 2.0 * (math.pi / 2.0 + math.asin(gap)) + contact
    found = published.todd_virgin()[f"f/f0 at d/A = {gap:g}"]
    assert found == pytest.approx(2.0 * math.pi / period, rel=1e-9)
    assert found == pytest.approx(right(published.todd_virgin)[f"f/f0 at d/A = {gap:g}"], rel=2e-4)


def impact_orbit(omega, restitution, gap, periods=1):
    """Impact speed of x'' + x = cos(omega t), x < gap, and its time after an extreme of the force."""
    angle = 2.0 * math.pi * periods / omega
    turn = 0.5 * (1.0 + restitution) * math.sin(angle) / (1.0 - math.cos(angle))
    slope, size = 0.5 * (1.0 - restitution), abs(1.0 / (1.0 - omega**2))
    # (gap + turn V)^2 + (slope V / omega)^2 = size^2: what the forced part of the motion is at the impact
    a, b, c = turn**2 + (slope / omega) ** 2, gap * turn, gap**2 - size**2
    speed = (-b + math.sqrt(b * b - a * c)) / a
    forced = 1.0 / (1.0 - omega**2)
    phase = math.atan2(-slope * speed / (forced * omega), (gap + turn * speed) / forced)
    return speed, phase % math.pi / omega


def restitution_of(stiffness, dashpot):
    """Restitution of a spring and dashpot that cannot pull, of a unit mass."""
    zeta = dashpot / (2.0 * math.sqrt(stiffness))
    damped = math.sqrt(1.0 - zeta**2)
    left = (math.pi - math.atan2(2.0 * zeta * damped, 1.0 - 2.0 * zeta**2)) / damped
    return -kelvin_voigt(1.0, 1.0, 2.0 * zeta)(left, 0.0, 1.0)[1]


def test_closed_forms_of_budd_and_dux():
    """The closed form gives their numbers; a stiff stop of the same restitution approaches it."""
    assert impact_orbit(2.0, 0.4, 0.001) == pytest.approx((2.222212, 0.786898), abs=2e-6)
    assert impact_orbit(2.6, 0.8, 0.0) == pytest.approx((0.505440, 1.165147), abs=2e-6)
    assert impact_orbit(2.8, 0.8, 0.0) == pytest.approx((0.336177, 1.092635), abs=2e-6)
    found = published.budd_dux()
    contact = 2.0 * math.pi / math.sqrt(published.STOP_STIFFNESS)  # during which the force moves on, relative to 1
    for name, (omega, restitution, gap, dashpot, *values) in published.IMPACT_ORBITS.items():
        assert restitution_of(published.STOP_STIFFNESS, dashpot) == pytest.approx(restitution, rel=1e-8)
        assert values == pytest.approx(impact_orbit(omega, restitution, gap), rel=1e-8)
        assert found[f"impact speed, {name}"] == pytest.approx(values[0], rel=2.0 * contact)


def bounces(mass, gap, speed, stiffness, dashpot, until):
    """Times at which a falling mass meets and leaves the ground, and its height above that at the end, m.

    Flights and contacts are closed forms; a contact ends where the penetration does.
    """
    motion, time, height, events = kelvin_voigt(mass, stiffness, dashpot, -mass * G), 0.0, gap, []
    while True:
        flight = (speed + math.sqrt(speed**2 + 2.0 * G * height)) / G
        if time + flight > until:
            return events, height + speed * (until - time) - 0.5 * G * (until - time) ** 2
        time, down = time + flight, speed - G * flight
        longest = 2.0 * math.pi / math.sqrt(stiffness / mass)
        contact = brentq(lambda t, v=down: motion(t, 0.0, v)[0], 0.3 * longest, longest, xtol=1e-16)
        events += [time, time + contact]
        time, speed, height = time + contact, motion(contact, 0.0, down)[1], 0.0


def test_contact_coordinate_test_of_exudyn():
    events, height = bounces(0.25, 0.05, 0.0, 2e6, 200.0, 0.25)
    found = published.contact_coordinate()
    value = found.pop("height at 0.25 s + 50 mm, mm")
    assert value == pytest.approx(50.0 + 1e3 * height, rel=1e-9)
    assert list(found.values()) == pytest.approx(events, rel=1e-9)
    assert list(right(published.contact_coordinate).values()) == pytest.approx([50.0 + 1e3 * height, *events], rel=1e-8)
    assert abs(printed(published.contact_coordinate)["height at 0.25 s + 50 mm, mm"] - value) > 0.3  # not converged


def test_post_newton_test_of_exudyn():
    events, height = bounces(0.25, 0.01, -1.0, 2e4, 0.0, 0.5)
    found = published.post_newton()
    value = found["height at 0.5 s + 50 mm, mm"]
    assert value == pytest.approx(50.0 + 1e3 * height, rel=1e-9)
    assert found["flight, s"] == pytest.approx(events[2] - events[1], rel=1e-9)
    assert found["flight, s"] == pytest.approx(2.0 * math.sqrt(1.0 + 2.0 * G * 0.01) / G, rel=1e-9)  # without losses
    flight = events[2] - events[1]
    assert list(right(published.post_newton).values()) == pytest.approx([50.0 + 1e3 * height, flight], rel=1e-8)
    assert abs(printed(published.post_newton)["height at 0.5 s + 50 mm, mm"] - value) > 3.0  # not converged


def rig_determinant(frequency, stiffness):
    """Zero at the natural frequencies, Hz, of the continuous cantilever with a spring to the ground."""
    beam, place = published.RUBBER_BEAM, published.RUBBER_PLACE
    rigidity = beam["youngs_modulus"] * beam["width"] * beam["thickness"] ** 3 / 12
    line = beam["density"] * beam["width"] * beam["thickness"]
    beta = (line * (2.0 * math.pi * frequency) ** 2 / rigidity) ** 0.25
    length, rest = beta * beam["length"], beta * (beam["length"] - place)
    columns = []
    for even in (True, False):  # cosh - cos and sinh - sin, and what the spring's force adds behind it
        z = beta * place
        w = math.cosh(z) - math.cos(z) if even else math.sinh(z) - math.sin(z)
        added = -stiffness * w / (rigidity * beta**3)
        bending = math.cosh(length) + math.cos(length) if even else math.sinh(length) + math.sin(length)
        shear = math.sinh(length) - math.sin(length) if even else math.cosh(length) + math.cos(length)
        columns.append((
            bending + 0.5 * added * (math.sinh(rest) + math.sin(rest)),
            shear + 0.5 * added * (math.cosh(rest) + math.cos(rest)),
        ))  # fmt: skip
    (a, b), (c, d) = columns
    return (a * d - b * c) / math.cosh(length) ** 2


def test_virtual_rubber_rig():
    """Sticking and sliding of the friction contact against the continuous beam."""
    found = published.rubber()
    for name, stiffness in (("stuck", published.RUBBER_STIFFNESS), ("sliding", 0.0)):
        for k in (1, 2, 3):
            value = found[f"{name}, mode {k}, Hz"]
            exact = brentq(rig_determinant, 0.98 * value, 1.02 * value, args=(stiffness,), xtol=1e-9)
            assert right(published.rubber)[f"{name}, mode {k}, Hz"] == pytest.approx(exact, rel=1e-8)
            assert value == pytest.approx(exact, rel=1e-4)  # 14 elements, as in the source
            assert value > exact * (1.0 - 1e-9)
    assert found["stuck, mode 1, Hz"] == pytest.approx(printed(published.rubber)["stuck, mode 1, Hz"], rel=1e-5)


def test_resonances_of_the_virtual_rubber_rig():
    """From a level at which the contact sticks to one at which it slides nearly all the time."""
    stuck, sliding = (published.rubber()[f"{name}, mode 1, Hz"] for name in ("stuck", "sliding"))
    small, middle, large = (published.rubber_resonance(level) for level in (0.2, 5.0, 50.0))
    assert small == pytest.approx(stuck, abs=0.25)
    assert large == pytest.approx(sliding, abs=0.25)
    assert large <= middle < small


def test_elastic_gap_of_modelica():
    """The first flight: the pressed side pushes until spring and dashpot balance. Behind it the laws differ."""
    motion, depth = kelvin_voigt(1.0, 10.0, 1.5), 1.5
    left = brentq(lambda t: 10.0 * motion(t, depth, 0.0)[0] + 1.5 * motion(t, depth, 0.0)[1], 0.3, 0.6, xtol=1e-15)
    x, speed = motion(left, depth, 0.0)
    found, given = published.elasto_gap(), printed(published.elasto_gap)
    exact = (speed, left - x / speed, left - (x + 1.0) / speed)
    for (quantity, value), right_value in zip(found.items(), exact, strict=False):
        assert value == pytest.approx(right_value, rel=1e-8)
        assert value == pytest.approx(given[quantity], rel=3e-6)  # the tolerance of the source's integrator
    assert abs(found["s(0.95 s), m"] - given["s(0.95 s), m"]) > 0.01  # the law of the source is another one


def elastoplastic(mass, stiffness, dashpot, limit, forces, step):
    """Displacements of a damped elastoplastic mass at the points of a piecewise linear force, from event to event."""
    times = step * np.arange(len(forces))

    def rate(t, z, slides):
        push = slides * limit if slides else stiffness * (z[0] - z[2])
        return [z[1], (np.interp(t, times, forces) - dashpot * z[1] - push) / mass, z[1] if slides else 0.0]

    def yields(t, z, slides):
        return z[1] * slides if slides else limit - stiffness * abs(z[0] - z[2])

    yields.terminal, yields.direction = True, -1
    state, slides, out = [0.0, 0.0, 0.0], 0, []
    for begin, end in itertools.pairwise(times):
        while begin < end:
            piece = solve_ivp(
                rate, (begin, end), state, "DOP853", rtol=1e-11, atol=1e-13, events=yields, args=(slides,)
            )
            begin, state = float(piece.t[-1]), piece.y[:, -1].tolist()
            if piece.status == 1:
                slides = 0 if slides else int(np.sign(state[0] - state[2]))
        out.append(state[0])
    return out


def test_elastoplastic_mass_of_clough_and_penzien():
    exact = elastoplastic(0.1, 5.0, 0.2, 6.0, [0, 5, 8, 7, 5, 3, 2, 1, 0, 0, 0], 0.1)
    assert list(published.clough_penzien().values()) == pytest.approx(exact, abs=1e-8)
    assert list(right(published.clough_penzien).values()) == pytest.approx(exact, abs=1e-8)


def clutch_period(frequency, start):
    """State of the clutch of Duan and Singh a period after a start, and the derivatives of this (2, 2)."""

    def rate(t, z):
        slope = 0.25 if abs(z[0]) < 4.0 else 1.0
        force = 0.25 * z[0] if abs(z[0]) < 4.0 else math.copysign(abs(z[0]) - 3.0, z[0])
        load = 1.2 + math.sin(2.0 * math.pi * frequency * t)
        return [z[1], load - 0.04 * z[1] - force, z[3], -slope * z[2] - 0.04 * z[3], z[5], -slope * z[4] - 0.04 * z[5]]

    whole = solve_ivp(rate, (0.0, 1.0 / frequency), [*start, 1.0, 0.0, 0.0, 1.0], "DOP853", rtol=1e-10, atol=1e-11,
                      max_step=0.05 / frequency)  # fmt: skip
    return whole.y[:2, -1], whole.y[2:, -1].reshape(2, 2).T


def test_period_doublings_of_duan_and_singh():
    """At the recorded frequencies a multiplier of the periodic motion is -1."""
    starts = ((0.70770, 0.63955), (1.48988, 0.99905), (3.75510, -1.37624), (4.38765, -1.00625))
    computed, exact = published.clutch(), right(published.clutch)
    assert list(computed.values()) == pytest.approx(list(exact.values()), rel=1e-7)
    for frequency, start in zip(exact.values(), starts, strict=True):
        state = np.array(start)
        for _ in range(8):
            after, slope = clutch_period(frequency, state)
            state = state - np.linalg.solve(slope - np.eye(2), after - state)
        assert np.linalg.det(slope + np.eye(2)) == pytest.approx(0.0, abs=1e-5)


def test_every_case_names_its_source_and_computes_what_is_printed():
    assert len({case.computed for case in CASES}) == len(CASES) == 15
    for case in CASES:
        assert case.source
        assert case.printed or case.right
