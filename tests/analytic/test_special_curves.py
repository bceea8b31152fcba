"""Curves of special points in two parameters: closed forms, published numbers, and a shooting code of its own."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

from beamsim import Contact, System, continue_motion
from beamsim.errors import ScenarioError

STEPS = 240  # of a period, between which a change of contact is looked for


class Shooting:
    """Motions under ``load sin(omega t) + mean`` with linear stops, by matrix exponentials, and their monodromy matrix.

    A linear stop's force has no jump, so that the derivative of the state is continuous at events, and the monodromy
    matrix is the product of the exponentials of the pieces.
    """

    def __init__(self, mass, stiffness, damping, load, stops, mean=0.0):
        self.M, self.K, self.C = (np.atleast_2d(x).astype(float) for x in (mass, stiffness, damping))
        self.load, self.stops, self.n = np.atleast_1d(load).astype(float), stops, len(self.M)
        self.mean = mean * np.atleast_1d(load)

    def matrix(self, omega, level, closed):
        """Rate of (q, q', sin, cos, 1)."""
        n, K, constant = self.n, self.K.copy(), self.mean.astype(float)
        for (row, stiffness, gap), touches in zip(self.stops, closed, strict=True):
            if touches:
                K, constant = K + stiffness * np.outer(row, row), constant + stiffness * gap * np.asarray(row)
        inverse, A = np.linalg.inv(self.M), np.zeros((2 * n + 3, 2 * n + 3))
        A[:n, n : 2 * n], A[n : 2 * n, :n], A[n : 2 * n, n : 2 * n] = np.eye(n), -inverse @ K, -inverse @ self.C
        A[n : 2 * n, 2 * n], A[n : 2 * n, -1] = level * inverse @ self.load, inverse @ constant
        A[2 * n, 2 * n + 1], A[2 * n + 1, 2 * n] = omega, -omega
        return A

    def openings(self, y):
        return np.array([gap - np.asarray(row) @ y[: self.n] for row, _, gap in self.stops])

    def period(self, z, omega, level, share=1.0):
        """State after a share of a period from phase zero, and its derivative by the state (the monodromy matrix)."""
        y, whole, n = np.concatenate([z, [0.0, 1.0, 1.0]]), np.eye(2 * self.n + 3), self.n
        h, known = share * 2 * np.pi / omega / STEPS, {}
        closed = tuple(bool(d < 0.0) for d in self.openings(y + 1e-12 * np.pad(y[n : 2 * n], (0, n + 3))))
        for _ in range(STEPS):
            left = h
            while left > 0.0:
                A = known.setdefault(closed, self.matrix(omega, level, closed))
                step = known.setdefault((closed, h), expm(A * h)) if left == h else expm(A * left)
                after, changed, at = self.openings(step @ y), -1, left
                for j, opening in enumerate(after):
                    if bool(opening < 0.0) == closed[j]:
                        continue

                    def gap(t, j=j, A=A, y=y):
                        return self.openings(expm(A * t) @ y)[j]

                    begin = 1e-9 * h  # beyond the round-off of an event just passed
                    when = brentq(gap, begin, left, xtol=1e-15) if gap(begin) * gap(left) < 0.0 else 0.0
                    if when < at:
                        changed, at = j, when
                part = step if changed < 0 else expm(A * at)
                y, whole, left = part @ y, part @ whole, left - at
                closed = tuple(c != (k == changed) for k, c in enumerate(closed))
        return y[: 2 * n], whole[: 2 * n, : 2 * n]

    def omega_where(self, test, z, omega, level):
        """Newton for a periodic motion whose monodromy matrix makes a test vanish: its omega."""

        def equations(u):
            after, M = self.period(u[:-1], u[-1], level)
            return np.append(after - u[:-1], test(M))

        u = np.append(z, omega * (1.0 + 1e-6))
        for _ in range(8):
            value = equations(u)
            steps = 1e-6 * np.maximum(np.abs(u), 0.1)
            slope = [(equations(u + h) - equations(u - h)) / (2 * h.sum()) for h in np.diag(steps)]
            change = np.linalg.solve(np.array(slope).T, -value)
            u = u + change
            if np.abs(change).max() < 1e-11:
                return u[-1]
        raise AssertionError(f"no convergence, the last change is {np.abs(change).max():.2g}")


TESTS = {
    "fold": lambda M: np.linalg.det(M - np.eye(len(M))),
    "period_doubling": lambda M: np.linalg.det(M + np.eye(len(M))),
}


def one_sided(gap=2.0):
    return System([[1.0]], [[1.0]], [[0.1]], [Contact(row=[1], law=2.0, gap=gap, name="stop")], {"f": [1.0]})


def curves_of(system, frequencies, kinds, second, **settings):
    settings = {"seek_at": 0, "side_branches": "none"} | settings
    return continue_motion(
        system, frequencies, {"f": {"level": 1.0}}, follow_points_in=second, follow_points=kinds, **settings
    )


def point_of(result, curve, k):
    """Frequency in Hz, second parameter, and state in displacements and velocities of a point."""
    shapes = result["modes"]["shapes"].values
    state = [curve[name].values[k] @ shapes for name in ("coordinates", "coordinate_velocities")]
    hz, parameter = (float(curve[name].values[k]) for name in ("frequency_hz", "parameter"))
    return hz, parameter, np.concatenate(state)


def test_a_linear_oscillator_grazes_where_its_amplitude_is_the_gap():
    result = curves_of(one_sided(), (0.193, 0.195), ["grazing"], {"kind": "gap", "from": 1.5, "to": 2.5})
    (curve,) = result.special_curves
    assert (curve["kind"].item(), curve["touching"].item()) == ("grazing", "stop")
    w, gap = 2 * np.pi * curve["frequency_hz"].values, curve["parameter"].values
    np.testing.assert_allclose(gap, 1.0 / np.abs(1.0 - w**2 + 0.1j * w), rtol=1e-9)
    np.testing.assert_allclose(np.sort(gap)[[0, -1]], [1.5, 2.5], rtol=1e-9)
    assert np.isnan(curve["angle"].values).all()


@pytest.fixture(scope="module")
def one_sided_curves():
    second = {"kind": "level", "from": 0.9, "to": 1.1}
    return curves_of(one_sided(), (0.112, 0.2), ["fold", "period_doubling"], second)


@pytest.mark.parametrize("kind", ["fold", "period_doubling"])
def test_points_of_the_one_sided_oscillator_are_those_of_another_shooting_code(one_sided_curves, kind):
    code = Shooting(1.0, 1.0, 0.1, 1.0, [([1.0], 2.0, 2.0)])
    curves = [c for c in one_sided_curves.special_curves if c["kind"].item() == kind]
    assert curves
    for curve in curves:
        k = int(np.argmax(curve["parameter"].values))
        hz, level, z = point_of(one_sided_curves, curve, k)
        omega = code.omega_where(TESTS[kind], z, 2 * np.pi * hz, level)
        assert omega / (2 * np.pi) == pytest.approx(hz, rel=1e-8)
        assert level == pytest.approx(1.1, rel=1e-9)


def test_period_doublings_of_duan_and_singh():
    """Springs of slope 0.25 within 4 and 1 beyond, under a mean load that shifts the rest by 4.8."""
    stops = [Contact(row=[1], law=0.75, gap=-0.8, name="up"), Contact(row=[-1], law=0.75, gap=8.8, name="down")]
    system = System([[1.0]], [[0.25]], [[0.04]], stops, {"f": [1.0]})
    second = {"kind": "level", "from": 0.95, "to": 1.05}
    result = curves_of(system, (0.063, 0.34), ["period_doubling"], second)
    curves = result.special_curves
    started = sorted(c["start_hz"].item() for c in curves)
    np.testing.assert_allclose(started, [0.06457, 0.07396, 0.1960, 0.3112], rtol=0.0, atol=5e-5)
    code = Shooting(1.0, 0.25, 0.04, 1.0, [([1.0], 0.75, -0.8), ([-1.0], 0.75, 8.8)])
    for curve in curves[-2:]:
        k = int(np.argmin(curve["parameter"].values))
        hz, level, z = point_of(result, curve, k)
        omega = code.omega_where(TESTS["period_doubling"], z, 2 * np.pi * hz, level)
        assert omega / (2 * np.pi) == pytest.approx(hz, rel=1e-8)
        np.testing.assert_allclose(curve["angle"].values, np.pi)


# --- Neimark–Sacker points ------------------------------------------------------------------------------------------


TWO_MASSES = {"mass": np.eye(2), "stiffness": [[1.0, -1.0], [-1.0, 2.0]], "damping": [[0.03, -0.03], [-0.03, 0.06]]}


def two_masses():
    stop = Contact(row=[1, 0], law=100.0, gap=1.0, name="stop")
    return System(*(TWO_MASSES[name] for name in ("mass", "stiffness", "damping")), [stop], {"f": [0.0, 1.0]})


@pytest.fixture(scope="module")
def neimark_sacker():
    return continue_motion(
        two_masses(), (0.0978, 0.0995), {"f": {"level": 0.1}}, seek_at=0, side_branches="none",
        follow_points_in={"kind": "level", "from": 0.03, "to": 0.3}, follow_points=["neimark_sacker"],
    )  # fmt: skip


def test_neimark_sacker_points_end_at_strong_resonances(neimark_sacker):
    (curve,) = neimark_sacker.special_curves
    assert "reached the strong resonance 1:4" in curve["status"].item()
    assert "reached the strong resonance 1:3" in curve["status"].item()
    assert sorted(curve["angle"].values)[0] == pytest.approx(np.pi / 2, abs=1e-9)
    assert sorted(curve["angle"].values)[-1] == pytest.approx(2 * np.pi / 3, abs=1e-9)
    kinds = [event["kind"] for event in neimark_sacker["special_curve_events"].rows("event")]
    assert sorted(kinds) == ["extremum", "resonance_1_3", "resonance_1_4"]


@pytest.mark.parametrize("end", [0, -1])
def test_at_a_strong_resonance_a_power_of_the_monodromy_matrix_has_a_multiplier_one(neimark_sacker, end):
    """By the other code: a periodic motion, and two multipliers i and -i, or at 120 degrees."""
    (curve,) = neimark_sacker.special_curves
    hz, level, z = point_of(neimark_sacker, curve, end)
    code = Shooting(*TWO_MASSES.values(), [0.0, 1.0], [([1.0, 0.0], 100.0, 1.0)])
    after, M = code.period(z, 2 * np.pi * hz, level)
    np.testing.assert_allclose(after, z, atol=1e-8)
    pair = np.exp(1j * curve["angle"].values[end])
    assert np.abs(np.linalg.eigvals(M) - pair).min() < 1e-7


def test_neimark_sacker_points_are_those_of_another_shooting_code(neimark_sacker):
    """Its Newton method asks for a pair of the product 1, without the angle as an unknown."""
    (curve,) = neimark_sacker.special_curves
    k = int(np.argmax(curve["parameter"].values))
    hz, level, z = point_of(neimark_sacker, curve, k - 3)
    code = Shooting(*TWO_MASSES.values(), [0.0, 1.0], [([1.0, 0.0], 100.0, 1.0)])

    def product(M):
        mu = np.linalg.eigvals(M)
        return np.abs(mu[np.argmax(mu.imag)]) - 1.0

    omega = code.omega_where(product, z, 2 * np.pi * hz, level)
    assert omega / (2 * np.pi) == pytest.approx(hz, rel=1e-8)


# --- Isolas ---------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def isola():
    stop = Contact(row=[1], law=20.0, gap=1.0, name="stop")
    system = System([[1.0]], [[1.0]], [[0.05]], [stop], {"f": [1.0]})
    second = {"kind": "level", "from": 0.99, "to": 1.33}
    return curves_of(system, (0.0605, 0.0635), ["fold"], second, follow_isolas=True)


def test_an_isola_is_a_closed_curve_of_motions_next_to_its_birth(isola):
    (birth,) = (event for event in isola["special_curve_events"].rows("event") if event["kind"] == "isola")
    (curve,) = (curve for curve in isola.special_curves if curve["kind"].item() == "isola")
    assert curve["status"].item() == "closed curve"
    level, hz = curve["parameter"].values, curve["frequency_hz"].values
    assert np.ptp(level) == 0.0
    assert 0.0 < birth["parameter"] - level[0] < 0.02
    assert hz.min() < birth["frequency_hz"] < hz.max()
    assert hz[0] == pytest.approx(hz[-1], rel=1e-12)
    code = Shooting(1.0, 1.0, 0.05, 1.0, [([1.0], 20.0, 1.0)])
    sides = []
    for k in range(0, hz.size, hz.size // 6):
        z = point_of(isola, curve, k)[2]
        after, M = code.period(z, 2 * np.pi * hz[k], level[k])
        np.testing.assert_allclose(after, z, atol=1e-8)
        sides.append(np.sign(np.linalg.det(M - np.eye(2))))
    assert set(sides) == {-1.0, 1.0}  # two motions at a frequency, of which one is unstable


def test_at_the_birth_of_an_isola_the_folds_of_its_two_sides_meet(isola):
    """By the other code: folds at both sides of the extreme, which come closer with the square root of the distance."""
    (birth,) = (event for event in isola["special_curve_events"].rows("event") if event["kind"] == "isola")
    curve = isola.special_curves[0]
    code = Shooting(1.0, 1.0, 0.05, 1.0, [([1.0], 20.0, 1.0)])
    k = int(np.argmax(curve["parameter"].values))
    assert curve["parameter"].values[k] == birth["parameter"]
    for neighbour in (k - 1, k + 1):
        hz, level, z = point_of(isola, curve, neighbour)
        omega = code.omega_where(TESTS["fold"], z, 2 * np.pi * hz, level)
        assert omega / (2 * np.pi) == pytest.approx(hz, rel=1e-8)


# --- Branch points --------------------------------------------------------------------------------------------------


def pair_of_stops():
    stops = [Contact(row=[1], law=20.0, gap=1.0, name="up"), Contact(row=[-1], law=20.0, gap=1.0, name="down")]
    return System([[1.0]], [[1.0]], [[0.05]], stops, {"f": [1.0]})


def test_a_branch_point_is_followed_where_a_symmetry_preserves_it():
    result = curves_of(pair_of_stops(), (0.0645, 0.0655), ["branch_point"], {"kind": "level", "from": 0.98, "to": 1.02})
    curve = result.special_curves[0]
    assert curve["kind"].item() == "branch_point"
    np.testing.assert_allclose(np.sort(curve["parameter"].values)[[0, -1]], [0.98, 1.02], rtol=1e-9)
    code = Shooting(1.0, 1.0, 0.05, 1.0, [([1.0], 20.0, 1.0), ([-1.0], 20.0, 1.0)])
    for k in (0, -1):
        hz, level, z = point_of(result, curve, k)
        after, half = code.period(z, 2 * np.pi * hz, level, share=0.5)
        np.testing.assert_allclose(after, -z, atol=1e-8)
        assert np.linalg.det(np.eye(2) - half) == pytest.approx(0.0, abs=1e-7)


def test_a_branch_point_without_a_symmetry_is_refused():
    second = {"kind": "gap", "snubber": "up", "from": 0.9, "to": 1.1}
    with pytest.raises(ScenarioError, match="follow_points asks for branch points, but no symmetry preserves"):
        curves_of(pair_of_stops(), (0.0645, 0.0655), ["branch_point"], second)


def test_kinds_that_are_not_found_are_named():
    second = {"kind": "level", "from": 0.9, "to": 1.1}
    result = curves_of(one_sided(), (0.193, 0.1935), ["neimark_sacker"], second)
    assert "no Neimark–Sacker bifurcation was found that could be followed in the level" in result.status
    assert result.special_curves == ()
