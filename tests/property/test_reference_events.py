"""Time stepping finds all events: random systems against the exact march, an integration by hand, and twins."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from beamsim.contacts.branches import MaxwellBranch
from beamsim.contacts.contacts import Contacts
from beamsim.contacts.laws import kelvin_voigt, latch, piecewise_linear
from beamsim.contacts.pads import no_tension, relaxing_law
from beamsim.contacts.sliders import friction_law, hardening_law, pressed_friction_law, rigid_friction_law
from beamsim.flow import reference
from beamsim.flow.exact import ExactFlow
from beamsim.flow.transient import simulate
from beamsim.inputs.signal import Signal
from beamsim.system.equations import Forcing, PiecewiseLinearSystem

# -- one mass on a face without a spring -----------------------------------------------------------------------------

STATIC, SLIDING, SPRING, LOAD, OMEGA = 3.0, 2.0, 2000.0, 20.0, 2 * np.pi * 13.0


def one_mass(duration, *tones):
    """Of tones of amplitude and frequency, N and rad/s."""
    contacts = Contacts(
        np.ones((1, 1)), -np.ones(1), np.zeros(1), np.zeros(1, dtype=bool), (rigid_friction_law(STATIC, SLIDING),)
    )
    system = PiecewiseLinearSystem(np.array([SPRING]), np.zeros((1, 1)), contacts, np.zeros(1))
    signals = tuple(Signal.harmonic(*tone) for tone in tones)
    return ExactFlow(system, Forcing(np.ones((len(tones), 1)), signals), duration)


def pull(t, x):
    """N, on a face that does not rub."""
    return LOAD * np.sin(OMEGA * t) - SPRING * x


def next_piece(t, y, direction, duration):
    """The motion up to where the face lets go or stops, by hand."""
    if direction == 0:
        rates, event = (lambda _t, _y: np.zeros(2)), (lambda t, y: STATIC - abs(pull(t, y[0])))
    else:
        rates = lambda t, y: [y[1], pull(t, y[0]) - direction * SLIDING]  # noqa: E731
        event = lambda s, y: direction * y[1] if s > t + 1e-9 else 1.0  # noqa: E731
    event.terminal = True
    return solve_ivp(rates, (t, duration), y, "DOP853", events=event, rtol=1e-11, atol=1e-14, max_step=1e-3,
                     dense_output=True)  # fmt: skip


@cache
def by_hand():
    """Times up to 0.5 s, and displacements: the mass sticks until the force exceeds the limit, and slides until it
    turns."""
    times = np.linspace(0.0, 0.5, 501)
    t, y, direction, out = 0.0, np.zeros(2), 0, np.zeros(times.size)
    while t < times[-1]:
        run = next_piece(t, y, direction, times[-1])
        inside = (times >= t) & (times <= run.t[-1])
        out[inside] = run.sol(times[inside])[0]
        t, y = float(run.t[-1]), np.array([run.y[0, -1], 0.0])
        force = pull(t, y[0])
        direction = int(np.sign(force)) if direction == 0 or abs(force) > STATIC else 0
    return times, out


@pytest.mark.parametrize(
    ("integrator", "rtol"),
    [("DOP853", 1e-9), ("LSODA", 1e-9), ("BDF", 1e-6), ("Radau", 1e-6)],  # implicit ones take long
)
def test_a_face_without_a_spring_as_by_hand(integrator, rtol):
    """A face that stopped and could not hold was missed: 13.98 mm in place of 9.816 mm."""
    stepping = reference.TimeStepping(one_mass(0.5, (LOAD, OMEGA)), integrator, rtol=rtol)
    times, expected = by_hand()
    motion = reference.integrate(stepping, np.zeros(2), times)
    assert np.abs(expected).max() == pytest.approx(9.816e-3, rel=1e-3)
    assert motion.outcome.complete
    np.testing.assert_allclose(motion.y[:, 0], expected, atol=1e-4 * np.abs(expected).max())


def test_what_the_integrator_leaves_of_the_velocity_of_faces_that_stick_is_removed():
    """Two faces hold one mass; without the removal a guard is below zero at the 24th event and the integration ends."""
    laws = (
        rigid_friction_law(1.435602805223716, 1.435602805223716),
        rigid_friction_law(1.433244281278417, 1.433244281278417),
    )
    shape = np.array([[0.44637457], [-0.53695324]])
    contacts = Contacts(shape, np.ones(2), np.zeros(2), np.zeros(2, dtype=bool), laws)
    system = PiecewiseLinearSystem(np.array([64.45046779]), np.array([[0.40140524]]), contacts, np.zeros(1))
    flow = ExactFlow(system, Forcing(np.array([[0.54671299]]), (Signal.harmonic(2.64865858, 12.03800185),)), 3.0)
    exact, times = simulate(flow, np.zeros(2)), np.linspace(0.0, 3.0, 61)
    motion = reference.integrate(reference.TimeStepping(flow, "BDF", rtol=1e-5, atol=1e-8), np.zeros(2), times)
    assert motion.outcome.complete, motion.outcome.text
    assert motion.event_time.size == exact.event_time.size > 40
    expected = exact.states_at(times)[:, 0]
    np.testing.assert_allclose(motion.y[:, 0], expected, atol=1e-3 * np.abs(expected).max())


def test_a_contact_does_not_return_at_once_to_the_phase_that_it_left():
    """A sliding mass that turns beside a stop. Without the check round-off makes 29 events of 11."""
    laws = kelvin_voigt(200.0, 0.5), rigid_friction_law(1.4155089061047565, 1.4155089061047565)
    shape, gap = np.array([[0.0033085746743845325], [-1.4230297964925127]]), np.array([0.02, 0.0])
    omega = 8.484450852997494
    contacts = Contacts(shape, np.ones(2), gap, np.zeros(2, dtype=bool), laws)
    system = PiecewiseLinearSystem(np.array([omega**2]), np.array([[0.05 * omega]]), contacts, np.zeros(1))
    load = Signal.harmonic(5.521845087384639, 13.129445546469997)
    flow = ExactFlow(system, Forcing(np.ones((1, 1)), (load,)), 1.5)
    stepping = reference.TimeStepping(flow, "Radau", rtol=1e-4, atol=1e-7)
    motion = reference.integrate(stepping, np.zeros(2), np.linspace(0.0, 1.5, 31))
    assert motion.outcome.complete
    assert motion.event_time.size == simulate(flow, np.zeros(2)).event_time.size == 11


BEATING = (1.6, OMEGA), (-1.6, 1.01 * OMEGA)


def beating():
    """A face that sticks for hundreds of periods of its loads, whose sum exceeds the limit for a time."""
    stepping = reference.TimeStepping(one_mass(3.2, *BEATING), "DOP853")
    return reference.integrate(stepping, np.zeros(2), np.linspace(0.0, 3.2, 11))


def test_steps_are_bounded_by_what_loads_a_face_that_sticks(monkeypatch):
    """And the twin: without that bound the integrator steps over the whole time."""
    within, exact = beating(), simulate(one_mass(3.2, *BEATING), np.zeros(2))
    assert exact.event_time[0] > 2.5
    assert exact.event_time.size > 5
    np.testing.assert_allclose(within.event_time, exact.event_time, rtol=1e-5)
    monkeypatch.setattr(reference, "RADIANS", np.inf)
    assert beating().event_time.size != exact.event_time.size


def test_an_event_that_the_search_misses_is_no_silent_error(monkeypatch):
    """Twin: a search that finds nothing ends the integration."""
    monkeypatch.setattr(reference, "falls_through_zero", lambda coefficient, after_rise=False: np.inf)
    flow = one_mass(0.3, (LOAD, OMEGA))
    motion = reference.integrate(reference.TimeStepping(flow, "DOP853"), np.zeros(2), np.linspace(0.0, 0.3, 11))
    assert motion.outcome.code == "guard_below_zero"
    assert "contact 1 is past a border of its phase" in motion.outcome.text
    assert motion.end < 0.1


# -- polynomials -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(20))
def test_the_first_fall_through_zero(seed):
    """Of polynomials with known roots, by where their sign changes from above to below."""
    rng = np.random.default_rng(seed)
    roots = np.sort(rng.uniform(-1.2, 1.2, int(rng.integers(1, 12))))
    polynomial = np.polynomial.Chebyshev.fromroots(roots) * rng.choice([-1.0, 1.0])
    inside = roots[(roots > -1.0) & (roots < 1.0)]
    falls = [r for r in inside if polynomial.deriv()(r) < 0.0]
    found = reference.falls_through_zero(polynomial.coef, after_rise=True)
    assert found == pytest.approx(falls[0] if falls else np.inf, abs=1e-7)
    if polynomial(-1.0) < 0.0:
        assert reference.falls_through_zero(polynomial.coef) == -1.0


def test_a_dip_between_two_samples_is_found():
    """A millionth of the step below zero, by a billionth; its twin just stays above."""
    middle, width = 0.3712345, 1e-6
    for depth, falls in ((width**2, True), (-1e-9, False)):
        polynomial = np.polynomial.Chebyshev.fromroots([middle, middle]) - depth
        found = reference.falls_through_zero(polynomial.coef)
        assert np.isfinite(found) == falls
        assert not falls or found == pytest.approx(middle - width, abs=1e-8)


def test_extremes_of_steps_lie_between_the_ends_of_steps():
    """Of a free vibration in steps of a quarter of a period, and the twin: no end of a step comes as close."""
    contacts = Contacts(np.zeros((0, 1)), np.zeros(0), np.zeros(0), np.zeros(0, dtype=bool), ())
    system = PiecewiseLinearSystem(np.array([1.0]), np.zeros((1, 1)), contacts, np.zeros(1))
    flow, found, ends = ExactFlow(system, Forcing(np.zeros((0, 1)), ()), 6.0), reference.StepExtremes(), []

    def observe(piece, _phases):
        found.add(piece, lambda times, y: y[:, :2])
        ends.append(piece.sol(piece.t).T[:, 0])

    stepping = reference.TimeStepping(flow, "DOP853", rtol=1e-8)
    reference.integrate(stepping, np.array([1.0, 0.5]), np.linspace(0.0, 6.0, 3), observe=observe)
    size, phase = np.hypot(1.0, 0.5), np.arctan2(0.5, 1.0)
    np.testing.assert_allclose(found.found.high, size, rtol=1e-6)
    np.testing.assert_allclose(found.found.low, -size, rtol=1e-6)
    assert found.found.when_high[0] == pytest.approx(phase, abs=1e-3)
    assert np.concatenate(ends).max() < size * (1 - 1e-3)


# -- random systems --------------------------------------------------------------------------------------------------


def random_law(rng):
    static, k = rng.uniform(0.1, 1.0), 10 ** rng.uniform(0.5, 3.5)
    sliding = static * rng.choice([1.0, rng.uniform(0.3, 1.0)])
    laws = (
        lambda: rigid_friction_law(static, sliding),
        lambda: rigid_friction_law(static, sliding),
        lambda: friction_law(k, static, sliding),
        lambda: friction_law(k, static, sliding),
        lambda: kelvin_voigt(k, rng.choice([0.0, 0.3])),
        lambda: latch(k, 0.2),
        lambda: piecewise_linear([-0.1, 0.2], [k, 0.0, 2 * k], 1),
        lambda: hardening_law(k, 0.3, 0.2 * k),
        lambda: no_tension(k, 0.5),
        lambda: relaxing_law(kelvin_voigt(k), [MaxwellBranch(k, 0.2)]),
    )
    return laws[rng.integers(len(laws))]()


def random_system(seed):
    """A flow of up to four modes with up to five contacts, some pressed by others, and a start."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 5)), int(rng.integers(1, 4))
    omega = np.sort(rng.uniform(0.5, 8.0, n))
    if rng.random() < 0.2:
        omega[-1] = 200.0
    laws = [random_law(rng) for _ in range(m)]
    shape, sign = rng.normal(size=(m, n)), rng.choice([1.0, -1.0], m)
    gap = np.where([law.slides_or_yields and not law.yields for law in laws], 0.0, rng.uniform(0, 0.3, m))
    pressed = None
    if rng.random() < 0.4:
        laws += [
            pressed_friction_law(rng.choice([None, 30.0, 1000.0]), 0.4, rng.choice([0.4, 0.3])),
            kelvin_voigt(100.0),
        ]
        shape, sign = np.vstack([shape, rng.normal(size=(2, n))]), np.append(sign, [1.0, 1.0])
        gap = np.append(gap, [0.0, rng.uniform(-0.1, 0.1)])
        pressed = np.append(np.full(m, -1), [m + 1, -1])
    contacts = Contacts(shape, sign, gap, np.zeros(len(laws), dtype=bool), tuple(laws), pressed_by=pressed)
    damping = 2 * rng.choice([0.0, 0.02, 0.1]) * omega
    system = PiecewiseLinearSystem(omega**2, np.diag(damping), contacts, 0.2 * rng.normal(size=n) * rng.integers(0, 2))
    signals = (
        Signal.harmonic(10 ** rng.uniform(-1, 1), rng.uniform(0.3, 10)),
        Signal.harmonic(float(rng.integers(0, 2)), rng.uniform(0.3, 20)),
    )
    flow = ExactFlow(system, Forcing(rng.normal(size=(2, n)), signals), 8.0)
    start = np.zeros(2 * n) if rng.random() < 0.5 else 0.5 * rng.normal(size=2 * n)
    return flow, np.append(start, contacts.relaxed_states(-gap - sign * (shape @ start[:n])))


def agrees(seed, integrator="DOP853", rtol=1e-10):
    """Compare the events and states of a random system by both methods; how many events there are."""
    flow, start = random_system(seed)
    exact = simulate(flow, start, max_events=3000)
    if not exact.outcome.complete:  # several faces at one place that cannot decide which of them holds
        return 0
    times = np.linspace(0.0, 8.0, 301)
    stepping = reference.TimeStepping(flow, integrator, rtol=rtol, atol=1e-3 * rtol, max_events=3000)
    stepped = reference.integrate(stepping, start, times)
    assert stepped.outcome.complete, stepped.outcome.text
    size = 2 * flow.system.size
    expected = exact.states_at(times)[:, :size]
    np.testing.assert_allclose(stepped.y[:, :size], expected, atol=1e-5 * np.abs(expected).max())
    assert stepped.event_time.size == exact.event_time.size
    return exact.event_time.size


RANDOM = [3, 7, 9, 18, 19, 24]


@pytest.mark.parametrize("seed", RANDOM)
def test_random_systems(seed):
    assert agrees(seed) > 0


def test_many_random_systems():
    """At 1e-10 the integrator's error in seed 109 is 3.5e-4 at two times just after contacts; at 1e-12 it is 3e-7."""
    assert sum(agrees(seed, rtol=1e-12) for seed in (101, 104, 107, 109, 110)) > 300


def test_the_comparison_of_random_systems_can_fail(monkeypatch):
    """Twin: with events sought at eight places of a step alone, some are missed."""

    def sampled(coefficient, after_rise=False):
        x = np.linspace(-1.0, 1.0, 9)
        values = np.polynomial.chebyshev.chebval(x, coefficient)
        falls = np.flatnonzero((values[1:] <= 0.0) & (values[:-1] >= 0.0))
        return float(x[falls[0] + 1]) if falls.size else np.inf

    monkeypatch.setattr(reference, "falls_through_zero", sampled)
    with pytest.raises(AssertionError):
        sum(agrees(seed) for seed in RANDOM)
