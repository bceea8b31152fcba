"""Multiple scales: closed-form coefficients, and the orders in which the remainders vanish."""

from dataclasses import replace

import numpy as np
import pytest
from expansions import free_remainder, steady

from beamsim.contacts.equilibrium import CubicSprings
from beamsim.errors import MethodError
from beamsim.flow.periodic_flow import PeriodicForcing
from beamsim.flow.variational import VariationalFlow
from beamsim.orbits.continuation import Settings, solve_at
from beamsim.orbits.expansions.forced import ResonantForcing
from beamsim.orbits.expansions.free import ModeAtEnergy, expand_mode, observed_orders, weaken
from beamsim.orbits.shooting import ForcedOrbits
from beamsim.orbits.spring_families import SpringFamily

CHAIN = 2 * np.eye(6) - np.eye(6, k=1) - np.eye(6, k=-1)
W2, V = np.linalg.eigh(CHAIN)
FACTORS = 0.02 * 0.5 ** np.arange(5)


@pytest.fixture(scope="module")
def oscillator(make_system):
    def make(damping=0.0, **contact):
        return make_system([1.0], [damping], **({"shape": [[1.0]], "stiffness": 1.0} | contact))

    return make


@pytest.fixture(scope="module")
def six(make_system):
    def make(mass, damping=None, **contact):
        damping = np.zeros(6) if damping is None else damping
        return make_system(np.sqrt(W2), damping, **({"shape": V[mass - 1 : mass], "stiffness": 1.0} | contact))

    return make


def harmonic(load):
    """Re(load e^{i omega t})."""
    none = np.zeros(1)
    at_rest = np.zeros((1, 0), dtype=complex)
    return PeriodicForcing(np.ones(1, dtype=int), np.asarray(load, dtype=complex)[None, :], none, at_rest, none, 1.0)


def steady_motion(system, load, omega, guess):
    """The exact periodic response: times over a period, states, orbit."""
    orbits = ForcedOrbits(VariationalFlow(system, harmonic(load), omega))
    point = solve_at(orbits, np.append(guess, omega), Settings(iterations=20), omega)
    assert point is not None
    t = np.linspace(0, point.data.duration, 401)[:-1]
    return t, orbits.flow.states_at(point.data, t), orbits.orbit(point)


def test_bilinear_oscillator(oscillator):
    """omega = 2 sqrt(1+e) / (1 + sqrt(1+e)) = 1 + e/4 - e²/8 + …, whatever the amplitude and its sign."""
    for amplitude in (1.0, -3.7):
        e = expand_mode(oscillator(), 0, amplitude)
        assert e.omega1 == pytest.approx(0.25, abs=1e-14)
        assert e.omega2 == pytest.approx(-0.125, abs=1e-12)
    exact = 2 * np.sqrt(1 + FACTORS) / (1 + np.sqrt(1 + FACTORS))
    for order in (0, 1, 2):
        orders = observed_orders(FACTORS, [abs(e.frequency(x, order) - y) for x, y in zip(FACTORS, exact, strict=True)])
        np.testing.assert_allclose(orders, order + 1, atol=0.05)


def test_first_order_of_the_shape_in_closed_form(oscillator):
    """(cos)_- = 1/pi - cos/2 + …: mean -A/pi below, and cos 2 theta with -2/(3 pi) / (1 - 4)."""
    e = expand_mode(oscillator(sign=-1.0), 0, 1.0)  # pushes down while u > 0
    assert e.first[0, 0] == pytest.approx(-1 / np.pi, rel=1e-13)
    assert e.first[1, 0] == 0.0
    assert e.first[2, 0] == pytest.approx(2 / (9 * np.pi), rel=1e-13)
    assert e.first[3, 0] == pytest.approx(0.0, abs=1e-15)


def test_duffing_oscillator(make_system):
    """w = 1 + 3/8 e A² - 15/256 e² A⁴ in the amplitude of the fundamental; q1 = e A³/32 cos 3 theta."""
    system = make_system([1.0], [0.0], shape=np.zeros((0, 1)), stiffness=[])
    e = expand_mode(system, 0, 1.3, cubic=CubicSprings(np.eye(1), np.ones(1)))
    assert e.omega1 == pytest.approx(3 / 8 * 1.3**2, rel=1e-14)
    assert e.omega2 == pytest.approx(-15 / 256 * 1.3**4, rel=1e-12)
    assert e.first[3, 0] == pytest.approx(1.3**3 / 32, rel=1e-14)


def test_frequency_of_a_gap_in_closed_form(oscillator):
    """First order with clearance g < A: k / (2 pi w) (arccos r - r sqrt(1 - r²)), r = g / A."""
    r = 0.4
    e = expand_mode(oscillator(gap=r * 2.0), 0, 2.0)
    assert e.omega1 == pytest.approx((np.arccos(r) - r * np.sqrt(1 - r**2)) / (2 * np.pi), rel=1e-13)
    assert expand_mode(oscillator(gap=3.0), 0, 2.0).omega1 == 0.0
    # never leaves: linear, omega = sqrt(1 + e), about a static shift
    pressed = expand_mode(oscillator(gap=-3.0), 0, 2.0)
    assert pressed.omega1 == pytest.approx(0.5, rel=1e-14)
    assert pressed.omega2 == pytest.approx(-0.125, rel=1e-12)
    assert pressed.first[0, 0] == pytest.approx(3.0, rel=1e-14)


@pytest.mark.parametrize(("mass", "mode", "gap"), [(5, 3, 0.0), (1, 0, 0.0), (5, 3, 0.1), (5, 3, -0.1)])
def test_free_remainders(six, mass, mode, gap):
    """Order k, its frequency to order k: e^(k+1) over a fixed time, e^k over 1/e; a better frequency mends that."""
    system = six(mass, gap=gap)
    for order, frequency_order, fixed, long in ((0, 1, 1, 1), (1, 1, 2, 1), (1, 2, 2, 2), (2, 2, 3, 2)):
        short_times = [free_remainder(system, mode, 1.0, e, 15.0, order, frequency_order) for e in FACTORS[1:]]
        assert observed_orders(FACTORS[1:], short_times)[-1] == pytest.approx(fixed, abs=0.15)
        if order < 2:
            long_times = [free_remainder(system, mode, 1.0, e, 1.0 / e, order, frequency_order) for e in FACTORS[1:]]
            assert observed_orders(FACTORS[1:], long_times)[-1] == pytest.approx(long, abs=0.15)


@pytest.mark.parametrize("case", ["oscillator", "six", "gap", "dashpot"])
def test_steady_motion_near_resonance(oscillator, six, case):
    """Against shooting: O(e), then O(e²) with the correction; decay rates of the slow flow are Floquet's."""
    damping = 0.3 * np.eye(6) + 0.05
    system, mode = {
        "oscillator": (oscillator(1.0), 0),
        "six": (six(5, damping), 3),
        "gap": (six(5, damping, gap=0.1), 3),
        "dashpot": (six(5, damping, gap=0.1, dashpot=0.5), 3),
    }[case]
    n, sigma = system.size, 0.1
    resonant = ResonantForcing(system, mode, np.full(n, 0.7))
    (motion,) = steady(resonant, sigma)
    assert motion.stable
    off, rates = [[], []], []
    for e in FACTORS:
        omega = resonant.omega + e * sigma
        guess = resonant.states(resonant.response(motion, e, 1), omega, np.zeros(1))[0]
        t, exact, orbit = steady_motion(weaken(system, e), e * resonant.load, omega, guess)
        for order in (0, 1):
            found = resonant.states(resonant.response(motion, e, order), omega, t)
            off[order].append(np.abs(found - exact)[:, :n].max())
        growth = np.log(orbit.multipliers.astype(complex)) / orbit.period / e
        rates.append(np.min(np.abs(growth.real - motion.exponents[0].real)))
    assert observed_orders(FACTORS, off[0])[-1] == pytest.approx(1.0, abs=0.1)
    assert observed_orders(FACTORS, off[1])[-1] == pytest.approx(2.0, abs=0.15)
    assert rates[-1] < 1e-2 * abs(motion.exponents[0].real)


def test_energy_chooses_the_amplitude(six):
    for gap in (0.0, 0.1, -0.1):
        system = six(5, gap=gap)
        for order in (0, 1, 2):
            e = ModeAtEnergy(SpringFamily(system), 3, 0.7, -1.0).expand(0.05, order)
            assert e.amplitude < 0
            q, c = e.initial(0.05, order), system.contacts
            pressed = np.maximum(-c.gap - c.sign * (c.shape @ q), 0.0)
            energy = 0.5 * (system.stiffness @ q**2 + 0.05 * c.stiffness @ pressed**2)
            assert energy == pytest.approx(0.7, rel=1e-12)


def test_refusals(make_system, oscillator):
    resonant = make_system([1.0, 2.0], [0.0, 0.0], shape=[[1.0, 0.7]], stiffness=1.0)
    with pytest.raises(MethodError, match="2 times the frequency of mode 1 is that of mode 2"):
        expand_mode(resonant, 0, 1.0)
    expand_mode(resonant, 1, 1.0)  # 2 w2 and w1 / w2 are no matter
    floating = make_system([0.0, 1.0], [0.0, 0.0], shape=[[1.0, 0.7]], stiffness=1.0)
    with pytest.raises(MethodError, match="rigid-body mode"):
        expand_mode(floating, 0, 1.0)
    with pytest.raises(MethodError, match="has 1 modes"):
        expand_mode(oscillator(), 1, 1.0)
    with pytest.raises(MethodError, match="no motion"):
        ModeAtEnergy(SpringFamily(oscillator()), 0, -1.0).expand(0.1)
    with pytest.raises(MethodError, match="not a flexible mode"):
        ResonantForcing(floating, 0, np.ones(2))
    with pytest.raises(MethodError, match="grows"):
        steady(ResonantForcing(oscillator(), 0, np.ones(1)), 0.25)
    assert steady(ResonantForcing(replace(oscillator(), damping=np.eye(1)), 0, np.zeros(1)), 0.25) == ()
