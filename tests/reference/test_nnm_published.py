"""Nonlinear normal modes: closed forms, published chains and the beam's backbone with its tongues."""

import itertools

import numpy as np
import pytest
from independent import free_beam
from sampling import first_apart
from scipy.linalg import eigh
from scipy.special import ellipk

from beamsim.contacts.equilibrium import CubicSprings
from beamsim.orbits.backbone import Backbone
from beamsim.orbits.continuation import Branch, BranchStep, Settings, solve_at
from beamsim.orbits.free_orbits import BrakeOrbits, FreeOrbits, linear_mode
from beamsim.orbits.special_points import special_points
from beamsim.orbits.spring_families import SpringFamily

CHAIN = 2 * np.eye(6) - np.eye(6, k=1) - np.eye(6, k=-1)


def cantilever(elements=10, k=107e3, masses=()):
    """The thesis's beam: stiffness, tip deflection, mass-normalised."""
    L, b, h, E, rho = 0.27, 0.05, 0.005, 69e9, 2700.0
    A, inertia, ell = b * h, b * h**3 / 12, 0.27 / elements
    M, K = free_beam(E * inertia, rho * A, ell, elements)
    for place, mass in masses:
        M[2 * round(place * elements), 2 * round(place * elements)] += mass
    w2, V = eigh(K[2:, 2:], M[2:, 2:])
    assert L > 0
    return np.sqrt(w2), V[-2], k


def backbone_of(make_system, omega, shape, k, mode=0, end=1.0, points=90, energy=1.0, tolerance=1e-11, **contact):
    system = make_system(omega, np.zeros(omega.size), shape=[shape], stiffness=k, **contact)
    orbits = BrakeOrbits(SpringFamily(system), energy=energy)
    start = solve_at(orbits, linear_mode(orbits, mode, 0.0, shape), Settings(), 0.0)
    settings = Settings(iterations=6, tolerance=tolerance)
    backbone = Backbone(orbits, start, end, mode, points=points, settings=settings)
    return orbits, backbone, list(backbone)


@first_apart("k", 1, [50.0, 1e-3])
def test_bilinear_oscillator(make_system, k):
    """2 w1 w2 / (w1 + w2), to 1e-12, all along the way."""
    orbits, backbone, points = backbone_of(make_system, np.array([1.0]), np.array([1.0]), k, points=8, tolerance=1e-13)
    assert backbone.outcome.text == "complete: reached the end of the range at parameter 1"
    for p in points:
        w2 = np.sqrt(1.0 + k * p.parameter)
        assert 2 * np.pi / orbits.orbit(p).period == pytest.approx(2 * w2 / (1 + w2), rel=1e-12)


@pytest.mark.parametrize(("mass", "period"), [(5, 4.0098), (1, 3.9697)])
def test_six_masses_with_a_unilateral_spring(make_system, mass, period):
    """Thesis chapter 3, epsilon = 0.5: 4.011 s and 3.97 s printed (computed apart: 4.0098 and 3.9697 s)."""
    w2, V = np.linalg.eigh(CHAIN)
    orbits, backbone, points = backbone_of(make_system, np.sqrt(w2), V[mass - 1], 0.5, mode=3, points=25)
    assert backbone.outcome.text == "complete: reached the end of the range at parameter 1"
    assert orbits.orbit(points[-1]).period == pytest.approx(period, abs=6e-5)


def test_six_masses_with_a_cubic_spring(make_system):
    """Fourth mode; the printed 3.93 s lies on the path in energy."""
    w2, V = np.linalg.eigh(CHAIN)
    system = make_system(np.sqrt(w2), np.zeros(6), shape=np.zeros((0, 6)), stiffness=[])
    family = SpringFamily(system, cubic=CubicSprings(V[5:6], np.array([0.5])))
    orbits = BrakeOrbits(family, energy=0.5)
    start = solve_at(orbits, linear_mode(orbits, 3, 0.0), Settings(), 0.0)
    backbone = Backbone(orbits, start, 1.0, 3, points=25)
    points = list(backbone)
    assert backbone.outcome.text == "complete: reached the end of the range at parameter 1"
    assert len(points) >= 25
    assert max(p.residual for p in points) < 1e-10
    higher = BrakeOrbits(family, "energy", factor=1.0)
    q = points[-1].u
    up = solve_at(higher, np.append(q[:-1], np.log(0.5)), Settings(), np.log(0.5))
    growing = Backbone(higher, up, np.log(20.0), 3, points=20)
    periods = [higher.orbit(p).period for p in growing]
    assert growing.outcome.complete
    assert np.all(np.diff(periods) < 0)
    assert periods[-1] < 3.93 < periods[0]


@pytest.mark.parametrize("energy", [0.01, 100.0])
def test_duffing_oscillator(make_system, energy):
    """q'' + q + g q^3 = 0: T = 4 K(m) / sqrt(1 + g a^2), m = g a^2 / (2 (1 + g a^2))."""
    g = 0.7
    system = make_system([1.0], [0.0], shape=np.zeros((0, 1)), stiffness=[])
    orbits = BrakeOrbits(SpringFamily(system, cubic=CubicSprings(np.eye(1), np.array([g]))), energy=energy)
    start = solve_at(orbits, linear_mode(orbits, 0, 0.0), Settings(), 0.0)
    last = orbits.orbit(list(Backbone(orbits, start, 1.0, 0, points=20))[-1])
    a2 = (-1 + np.sqrt(1 + 4 * g * energy)) / g
    m = g * a2 / (2 * (1 + g * a2))
    assert last.state[0] ** 2 == pytest.approx(a2, rel=1e-11)
    assert last.period == pytest.approx(4 * ellipk(m) / np.sqrt(1 + g * a2), rel=1e-11)


@pytest.fixture(scope="module")
def beam_backbone(make_system):
    omega, tip, k = cantilever(20, 151.1e3, [(0.5, 4.2e-3), (0.75, 4.2e-3), (1.0, 4.2e-3)])
    return backbone_of(make_system, omega[:7], tip[:7], k, points=100)


def test_first_mode_of_the_beam(beam_backbone):
    """75 points or more, each converged and with most of its energy in mode 1, past its tongues."""
    orbits, backbone, points = beam_backbone
    assert backbone.outcome.text == "complete: reached the end of the range at parameter 1"
    assert len(points) >= 75
    assert max(p.residual for p in points) < 1e-10
    assert min(backbone.share(p) for p in points) > 0.5
    factors = np.array([p.parameter for p in points])
    assert np.all(np.diff(factors) > 0)
    assert factors[0] == 0.0
    assert factors[-1] == 1.0
    frequency = np.array([orbits.orbit(p).frequency_hz for p in points])
    assert frequency[0] == pytest.approx(52.4, abs=0.1)
    assert 81 < frequency[-1] < 83
    w = orbits.family.omega
    bilinear = np.array([2 * np.pi / orbits.family.period_estimate(0, f, 1.0) for f in factors]) / (2 * np.pi)
    np.testing.assert_allclose(frequency, bilinear, rtol=0.02)
    assert w.size == 7


def test_tongues_of_the_beam(beam_backbone):
    """6:1 near epsilon = 0.005 and 5:1 near 0.07, with the second mode; each point of a tongue is a motion too."""
    _, backbone, _ = beam_backbone
    found = {(t.mode + 1, t.ratio): t for t in backbone.tongues}
    assert (2, 6) in found
    assert (2, 5) in found
    assert found[2, 6].origin == pytest.approx(0.005, abs=0.004)
    assert found[2, 5].origin == pytest.approx(0.07, abs=0.02)
    for tongue in found.values():
        assert min(backbone.share(p) for p in tongue.points) < 0.5
        assert max(p.residual for p in tongue.points) < 1e-10
    assert {(j.mode + 1, j.ratio) for j in backbone.jumps} >= {(2, 6), (2, 5)}


def test_first_mode_of_figure_3_16(make_system):
    """The thesis's figure 3.16: 10 elements, every degree of freedom, 107 kN/m, 75 steps; 20 hours in 2010."""
    omega, tip, k = cantilever()
    orbits, backbone, points = backbone_of(make_system, omega, tip, k, points=75)
    assert backbone.outcome.text == "complete: reached the end of the range at parameter 1"
    assert len(points) >= 75
    assert max(p.residual for p in points) < 1e-10
    assert orbits.orbit(points[0]).frequency_hz == pytest.approx(56.0, abs=0.1)


def test_energy_dependence_with_backlash(make_system, no_forcing):
    """Linear until the gap is reached, at the energy in closed form; the frequency then grows with energy to that of z
    = 0."""
    w2, V = np.linalg.eigh(CHAIN)
    gap = 0.4
    system = make_system(np.sqrt(w2), np.zeros(6), shape=V[5:6], stiffness=1.0, gap=gap)
    orbits = BrakeOrbits(SpringFamily(system), "energy")
    first, last = np.log(1e-3), np.log(1e4)
    start = solve_at(orbits, linear_mode(orbits, 0, first, V[5]), Settings(), first)
    backbone = Backbone(orbits, start, last, 0, points=120)
    points = list(backbone)
    assert backbone.outcome.complete
    energies = np.array([orbits.orbit(p).energy for p in points])
    frequency = np.array([2 * np.pi * orbits.orbit(p).frequency_hz for p in points])
    touching = 0.5 * w2[0] * (gap / V[5, 0]) ** 2
    linear = energies < touching
    np.testing.assert_allclose(frequency[linear], np.sqrt(w2[0]), rtol=1e-12)
    assert np.all(np.diff(frequency[~linear]) > 0)
    special = [s for a, b in itertools.pairwise(points) for s in special_points(BranchStep(orbits, a, b))]
    grazing = [np.exp(s.parameter) for s in special if s.kind == "grazing"]
    assert min(abs(np.array(grazing) / touching - 1)) < 1e-8
    _, _, zero = backbone_of(make_system, np.sqrt(w2), V[5], 1.0, mode=0, points=40)
    limit = zero[-1].u[-2]
    assert 2 * np.pi / frequency[-1] == pytest.approx(limit, rel=1e-2)


def test_prestress_starts_from_the_closed_modes(make_system):
    """While contact is never lost the motion is that of the closed structure about static equilibrium."""
    w2, V = np.linalg.eigh(CHAIN)
    k, z = 1.0, 0.3
    system = make_system(np.sqrt(w2), np.zeros(6), shape=V[5:6], stiffness=k, gap=-z)

    def rest(s):
        phi, kk = s.contacts.shape[0], s.contacts.stiffness[0]
        return np.linalg.solve(np.diag(w2) + kk * np.outer(phi, phi), kk * z * phi)

    family = SpringFamily(system, rest)
    orbits = BrakeOrbits(family, "energy", basis=family.modes_at_rest())
    first = np.log(1e-6)
    start = solve_at(orbits, linear_mode(orbits, 0, first), Settings(), first)
    points = list(Backbone(orbits, start, np.log(1.0), 0, points=30))
    closed = np.sqrt(np.linalg.eigvalsh(np.diag(w2) + k * np.outer(V[5], V[5])))[0]
    assert orbits.orbit(points[0]).frequency_hz * 2 * np.pi == pytest.approx(closed, rel=1e-12)
    assert orbits.orbit(points[0]).energy == pytest.approx(1e-6, rel=1e-10)
    assert orbits.orbit(points[-1]).frequency_hz * 2 * np.pi < closed * 0.999


def test_continuation_in_frequency(make_system):
    w2, V = np.linalg.eigh(CHAIN)
    system = make_system(np.sqrt(w2), np.zeros(6), shape=V[5:6], stiffness=1.0, gap=0.4)
    family = SpringFamily(system)
    by_energy = BrakeOrbits(family, "energy")
    first = np.log(1e-3)
    start = solve_at(by_energy, linear_mode(by_energy, 0, first, V[5]), Settings(), first)
    points = list(Backbone(by_energy, start, np.log(10.0), 0, points=30))
    orbits = BrakeOrbits(family, "frequency")
    first = next(i for i, p in enumerate(points) if p.data.flow_map.event_time.size)
    contacting, later = points[first], points[first + 3]
    w = 2 * np.pi / contacting.u[-2]
    begin = solve_at(orbits, orbits.unknowns(contacting.u[:6], contacting.u[-2], w), Settings(), w)
    branch = Branch(orbits, begin, 0.0, 2 * np.pi / later.u[-2])
    last = list(branch)[-1]
    assert branch.outcome.code == "reached_end"
    assert last.data.energy == pytest.approx(np.exp(later.parameter), rel=1e-6)


def test_a_non_brake_orbit(make_system):
    """Three cubic springs 60 degrees apart make an isotropic potential: circles, omega^2 = 1 + 9/8 g r^2 in closed
    form."""
    system = make_system([1.0, 1.0], np.zeros(2), shape=np.zeros((0, 2)), stiffness=[])
    angle = np.arange(3) * np.pi / 3
    family = SpringFamily(system, cubic=CubicSprings(np.column_stack([np.cos(angle), np.sin(angle)]), np.ones(3)))
    energy = 1.0

    def circle(g):
        r2 = (-2.0 + np.sqrt(4.0 + 4 * (27 / 16) * g * 2 * energy)) / (2 * (27 / 16) * g)
        return np.sqrt(r2), np.sqrt(1 + 9 / 8 * g * r2)

    r, w = circle(0.3)
    guess = np.array([r, 0.0, 0.0, r * w])
    orbits = FreeOrbits(family, energy=energy, factor=0.3, reference=guess)
    near = np.append(guess + 0.02, [2 * np.pi / w * 1.01, 0.3])
    start = solve_at(orbits, near, Settings(iterations=12), 0.3)
    branch = Branch(orbits, start, 0.1, 1.0, Settings(step=0.05, largest_step=0.1))
    points = list(branch)
    assert branch.outcome.text == "complete: reached the end of the range at parameter 1"
    for point in points:
        y, period, g, _ = orbits.split(point.u)
        r, w = circle(g)
        assert period == pytest.approx(2 * np.pi / w, rel=1e-9)
        assert np.hypot(*y[:2]) == pytest.approx(r, rel=1e-8)
    speeds = point.data.flow.states_at(point.data.flow_map, np.linspace(0, period, 50))[:, 2:]
    np.testing.assert_allclose(np.linalg.norm(speeds, axis=1), r * w, rtol=1e-8)
    mu = orbits.multipliers(point)
    assert np.sort(np.abs(mu - 1))[1] < 1e-5
