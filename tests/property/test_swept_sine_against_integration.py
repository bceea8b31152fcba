"""The swept-sine flow against independent time stepping (DOP853, restarted at every event and every window cut)."""

import math
from bisect import bisect_right

import numpy as np
import pytest
from independent import Stop, Structure
from independent import integrate as integrate_with_restarts
from sampling import first_apart
from sweep_windows import frequency_at

from beamsim.analyses.sweep.cycles import CycleRecord, SinePhase, record_cycles
from beamsim.flow.swept_motion import SweptMotion
from beamsim.inputs.profiles import Leg, Profile
from beamsim.inputs.swept import cut_into_windows, swept_signals
from beamsim.system.equations import Forcing
from tests.helpers.observed import rows


def phase_of(legs, t):
    """SinePhase from the law of the sweep itself, without windows; t within the legs."""
    t = np.asarray(t, dtype=float)
    phase, before, turns = np.zeros(t.shape), 0.0, 0.0
    for leg in legs:
        r, f = leg.signed_rate, leg.first_hz
        here = t >= before
        x = t - before
        own = f * np.expm1(r * x) / r if leg.logarithmic else f * x + 0.5 * r * x**2
        phase = np.where(here, 2 * np.pi * (turns + own), phase)
        before, turns = before + leg.duration, turns + leg.cycles
    return phase


def sine_of(legs):
    """``t -> sin(phase)`` of a number, by the same law: called at every stage of every step."""
    pieces, before, turns = [], 0.0, 0.0
    for leg in legs:
        pieces.append((before, turns, leg.first_hz, leg.signed_rate, leg.logarithmic))
        before, turns = before + leg.duration, turns + leg.cycles
    starts = [piece[0] for piece in pieces]

    def sine(t):
        before, turns, f, r, logarithmic = pieces[max(bisect_right(starts, t) - 1, 0)]
        x = t - before
        own = f * math.expm1(r * x) / r if logarithmic else f * x + 0.5 * r * x * x
        return math.sin(2 * math.pi * (turns + own))

    return sine


def integrate(system, load, force, base, start, cuts, times):
    """States at ``times`` and the number of events; ``force(t)`` and ``base(t) -> (d, d')`` are plain functions."""
    c = system.contacts
    faces = [law.internal_states > 0 for law in c.laws]
    numbers = zip(c.shape, c.stiffness, c.dashpot, c.gap, c.sign, c.on_ground, faces, strict=True)
    stops = [Stop(*stop) for stop in numbers]
    structure = Structure(np.eye(system.size), system.damping, np.diag(system.stiffness), load)
    motion = integrate_with_restarts(
        structure, stops, lambda t: system.constant_load + load * force(t), start, times,
        base=base, breaks=cuts, most_step=STEP,
    )  # fmt: skip
    return motion.state, motion.event_time.size


class Swept:
    """The motion through a sweep, with outputs of each cycle, and its states at times."""

    def __init__(self, system, load, windows, start, *, on_ground=False, output_of=None, orders=(), **limits):
        def loads(windows, carrier):
            acceleration, *others = swept_signals(windows, carrier)
            if not on_ground:
                return Forcing(load[None], (acceleration,))
            return Forcing(np.vstack([load, 0.0 * load]), (acceleration, others[-1]), (1,))

        self.windows, self.output_of = windows, output_of or (lambda flow: lambda phases: flow.equations.rows(0))
        self.march = SweptMotion(system, loads, windows, start, **limits)
        self.stretches = list(self.march.chunks())
        parts = [
            record_cycles(
                s.motion, s.edges, self.output_of(s.motion.flow), orders, SinePhase.of_windows(s.windows)
            ).select(slice(s.cycle_count))
            for s in self.stretches
        ]
        self.record = CycleRecord.join(parts)
        self.events, self.outcome = self.march.events, self.march.outcome

    def begin(self, stretch):
        return float(self.windows.edge[stretch.first])

    def event_times(self):
        return np.concatenate([self.begin(s) + s.motion.event_time for s in self.stretches])

    def sample(self, times, output_of):
        """Outputs (nt, K) at increasing times; ``output_of`` is written for a flow."""
        out, done = [], 0
        for stretch in self.stretches:
            last = int(np.searchsorted(times, self.begin(stretch) + stretch.edges[-1], side="right"))
            here = np.maximum(times[done:last] - self.begin(stretch), 0.0)
            out.append(stretch.motion.sample(here, output_of(stretch.motion.flow)))
            done = last
        return np.concatenate(out)

    def states(self, times):
        def whole(flow):
            return lambda phases: flow.equations.state[: 2 * flow.system.size]

        return self.sample(times, whole)


def frequency_of(legs, t):
    """Frequency from the law of the sweep itself."""
    t, before = np.asarray(t, dtype=float), 0.0
    frequency = np.zeros(t.shape)
    for leg in legs:
        x = t - before
        law = leg.first_hz * np.exp(leg.signed_rate * x) if leg.logarithmic else leg.first_hz + leg.signed_rate * x
        frequency = np.where(x >= 0, law, frequency)
        before += leg.duration
    return frequency


STEP = 0.03  # s; contacts shorter than the integrator's steps would be missed by it; these last a quarter of a second
THROUGH_RESONANCE = [Leg(0.1, 0.45, 0.1, True)]
CASES = {
    "no dashpot": {"stiffness": [20.0], "gap": [0.1]},
    "dashpot, just touching": {"stiffness": [20.0], "dashpot": [0.5], "gap": [0.0]},
    "strong dashpot, prestress, above": {"stiffness": [20.0], "dashpot": [2.5], "gap": [-0.1], "sign": [-1.0]},
    "two snubbers": {"stiffness": [20.0, 50.0], "dashpot": [0.5, 0.1], "gap": [0.1, -0.1], "sign": [1.0, -1.0]},
    "no tension": {"stiffness": [20.0], "dashpot": [0.8], "gap": [0.1], "no_tension": [True]},
}


@pytest.mark.parametrize("rigid", [0, 1])
@first_apart("case", 3, CASES)
def test_random_structure(make_system, case, rigid):
    rng = np.random.default_rng(len(case) + rigid)
    n, legs = 3, THROUGH_RESONANCE
    omega = np.array([1.2, 2.9, 6.0])
    omega[:rigid] = 0.0
    m = len(CASES[case]["stiffness"])
    shape = 0.5 + rng.random(size=(m, n))
    system = make_system(omega, 0.02 * omega, 0.05 * rng.normal(size=n), shape=shape, **CASES[case])
    load = rng.normal(size=n)
    windows = cut_into_windows(legs, Profile.constant(1.0))
    start = 0.3 * rng.normal(size=2 * n)
    record = Swept(system, load, windows, start)
    times = np.linspace(0.0, windows.duration, 1001)
    expected, events = integrate(system, load, sine_of(legs), None, start, (), times)
    assert record.outcome.complete
    assert record.events == events
    assert events > 1 or rigid
    assert np.abs(record.states(times) - expected).max() < 1e-9 * np.abs(expected).max()


@pytest.mark.parametrize(
    "legs",
    [
        [Leg(0.05, 3.0, 0.3, False), Leg(3.0, 0.2, 0.2, True)],
        [Leg(2.0, 0.1, 3.0, False)],
        [Leg(1.0, 0.02, 1.0, True)],
    ],
    ids=["up linear, down logarithmic", "very fast, linear", "very fast, logarithmic"],
)
def test_laws_and_profiles(make_system, legs):
    """Fast sweeps (the frequency changes within a cycle), both laws, levels that step and bend."""
    system = make_system([1.0, 5.0], [0.02, 0.1], shape=[[1.0, 0.4]], stiffness=[15.0], dashpot=[0.3], gap=[0.05])
    profile = Profile.from_steps([(0.05, 0.2, "displacement"), (0.3, 0.7, "acceleration"), (1.5, 0.05, "velocity")])
    profile = profile.with_notch(0.5, 0.9, 0.3, "acceleration")
    windows = cut_into_windows(legs, profile)
    load, start = np.array([1.0, 0.5]), np.array([-0.3, 0.0, 0.2, 0.0])
    record = Swept(system, load, windows, start)
    times = np.linspace(0.0, windows.duration, 1001)
    sine = sine_of(legs)
    expected, events = integrate(
        system, load, lambda t: float(profile(frequency_of(legs, t))) * sine(t), None,
        start, windows.start, times,
    )  # fmt: skip
    assert record.events == events > 0
    assert np.abs(record.states(times) - expected).max() < 1e-9 * np.abs(expected).max()


@first_apart("kind", 2, ["undamped", "coupled damping", "hardly damped", "near-critical", "coincident"])
def test_awkward_damping(make_system, kind):
    """Through the resonance of undamped modes, clusters of eigenvalues, couplings."""
    omega = np.array([1.0, 2.2, 5.0])
    rng = np.random.default_rng(3)
    damping = {
        "undamped": np.zeros((3, 3)),
        "hardly damped": np.diag(1e-7 * omega),
        "near-critical": np.diag(2 * omega * np.array([1.0, 1 - 1e-9, 0.01])),
        "coupled damping": (lambda B: B @ B.T)(0.2 * rng.normal(size=(3, 3))),
        "coincident": np.diag(0.02 * omega),
    }[kind]
    if kind == "coincident":
        omega[:2] = 2.0
    system = make_system(omega, damping, shape=[[1.0, 0.7, -0.4]], stiffness=[9.0], dashpot=[0.2], gap=[0.3])
    legs = [Leg(0.1, 0.5, 0.05, True)]
    windows = cut_into_windows(legs, Profile.constant(0.2))
    load = np.array([1.0, -0.6, 0.4])
    start = np.zeros(6)
    record = Swept(system, load, windows, start)
    times = np.linspace(0.0, windows.duration, 801)
    sine = sine_of(legs)
    expected, events = integrate(
        system, load, lambda t: 0.2 * sine(t), None, start, (), times,
    )  # fmt: skip
    assert record.events == events
    assert np.abs(record.states(times) - expected).max() < 1e-9 * np.abs(expected).max()


def test_the_comparison_can_fail(make_system):
    """Twin of the tests above: one part in a million of the rate is far above the tolerance."""
    system = make_system([1.0, 2.5], [0.02, 0.05], shape=[[1.0, 0.7]], stiffness=[20.0], gap=[0.1])
    motions = []
    for factor in (1.0, 1.0 + 1e-6):
        windows = cut_into_windows([Leg(0.1, 0.4, 0.05 * factor, True)], Profile.constant(1.0))
        record = Swept(system, np.array([1.0, 0.5]), windows, np.zeros(4))
        motions.append(record.states(np.linspace(0, 20.0, 300)))
    assert np.abs(motions[0] - motions[1]).max() > 1e-8 * np.abs(motions[0]).max()


def outputs(shape):
    def of_flow(flow):
        k, m = shape.shape[0], flow.system.contacts.count
        none, first, last = np.zeros((k + m, shape.shape[1])), slice(k), slice(k + m, None)
        moved, accelerated, contact = np.vstack([none, 0.0 * shape]), np.vstack([none, shape]), np.zeros((2 * k + m, m))
        moved[first], contact[k : k + m] = shape, np.eye(m)
        carried = np.zeros((2 * k + m, len(flow.forcing.signal)))
        carried[last, 0] = 1.0  # the acceleration of the base is the first signal
        return rows(flow, 2 * k + m, displacement=moved, acceleration=accelerated, contact=contact, load=carried)

    return of_flow


@pytest.mark.parametrize(("rigid", "more"), [(0, 8), (1, 0)])
def test_envelopes_and_harmonics_of_cycles_against_dense_samples(make_system, rigid, more):
    omega = np.concatenate([[1.0, 2.5, 14.0], 4.0 + 1.1 * np.arange(more)])
    omega[:rigid] = 0.0
    loaded, stop, probe = (
        np.append(part, np.full(more, 0.2)) for part in ([1, 0.5, 0.2], [1, 0.7, 0.3], [1, -0.3, 0.2])
    )
    weight = np.append(-0.1, np.zeros(omega.size - 1))
    system = make_system(omega, 0.02 * omega, weight, shape=[stop], stiffness=[40.0], gap=[0.05])
    legs = [Leg(0.1, 0.35, 0.05, True)]
    windows = cut_into_windows(legs, Profile.constant(0.3))
    out = outputs(probe[None])
    orders = [0.0, 0.5, 1.0, 2.0, 3.0]
    swept = Swept(system, loaded, windows, np.zeros(2 * omega.size), output_of=out, orders=orders)
    record = swept.record
    assert swept.events > 0
    node, weight = np.polynomial.legendre.leggauss(12)
    for cycle in (0, 3, windows.cycles // 2, windows.cycles - 2):
        begin, end = windows.edge[cycle], windows.edge[cycle + 1]
        dense = np.linspace(begin, end, 20001)
        values = swept.sample(dense[:-1], out)
        extent = np.ptp(values, axis=0) + 1e-12
        assert np.all(record.high[cycle] >= values.max(axis=0) - 1e-9 * extent)
        assert np.all(record.low[cycle] <= values.min(axis=0) + 1e-9 * extent)
        assert np.all(record.high[cycle] - values.max(axis=0) < 1e-3 * extent)
        assert np.all(values.min(axis=0) - record.low[cycle] < 1e-3 * extent)
        inside = swept.event_times()[(swept.event_times() > begin) & (swept.event_times() < end)]
        cuts = np.unique(np.concatenate([np.linspace(begin, end, 60), inside]))
        width = np.diff(cuts)[:, None]
        t = (cuts[:-1, None] + 0.5 * width * (1 + node)).ravel()
        w = (0.5 * width * weight).ravel()
        values = swept.sample(t, out)
        square = w @ values**2 / (end - begin)
        np.testing.assert_allclose(record.mean_square[cycle], square, rtol=1e-8, atol=1e-12 * square.max())
        phase = phase_of(legs, t)
        rate = 2 * np.pi * frequency_at(windows, t)
        for i, order in enumerate(orders):
            expected = (w * rate * np.exp(-1j * order * phase)) @ values / np.pi
            if order == 0:  # the mean is one over time, as the mean square
                expected = w @ values / (end - begin)
            np.testing.assert_allclose(record.harmonic[cycle, :, i], expected, atol=1e-9 * np.sqrt(square.max()))
    shares = record.contact_share
    assert np.all((shares >= 0) & (shares <= 1 + 1e-12))
    assert record.closings.sum() == sum(int(np.sum(s.motion.event_phase)) for s in swept.stretches)
