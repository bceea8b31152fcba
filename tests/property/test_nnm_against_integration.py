"""Nonlinear modes of random chains, in physical coordinates, against an integration written apart from the program."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from beamsim.analyses.nnm.analysis import nnm
from beamsim.scenario import load_scenario
from tests.helpers.branches import multipliers


def random_chain(rng):
    """Stops, bumpers and cables with gap, without, or pressed; walls on both sides, on one, or none."""
    n = int(rng.integers(2, 5))
    springs = rng.uniform(0.5, 3, n + 1)
    springs[0] *= rng.choice([0, 1], p=[0.2, 0.8])
    snubbers = []
    for _ in range(int(rng.integers(1, 4))):
        gap = rng.choice([0, 1, -1]) * 10 ** rng.uniform(-2, 0)
        snubber = {"stiffness": float(10 ** rng.uniform(-1, 1.5)), "gap": float(gap)}
        if rng.random() < 0.3:
            a, b = (int(k) + 1 for k in rng.choice(n, 2, replace=False))
            snubber |= {"between": [a, b], "resists": str(rng.choice(["approach", "separation"]))}
        else:
            snubber |= {"mass": int(rng.integers(1, n + 1)), "side": str(rng.choice(["below", "above"]))}
        snubbers.append(snubber)
    chain = {"masses": rng.uniform(0.5, 2, n).tolist(), "springs": springs.tolist(), "snubbers": snubbers}
    if rng.random() < 0.25:
        chain["springs_to_ground"] = [{"mass": n, "kind": "cubic", "stiffness": float(rng.uniform(0.1, 2))}]
        for snubber in snubbers:
            snubber["gap"] = abs(snubber["gap"])
    energy = float(10 ** rng.uniform(-1.5, 0.5))
    mode = int(rng.integers(1, n + 1))
    if rng.random() < 0.5 and any(s["gap"] for s in snubbers):
        return {
            "chain": chain,
            "nnm": {"mode": mode, "continue_in": {"kind": "energy", "from": energy / 100, "to": energy}},
        }
    return {"chain": chain, "nnm": {"mode": mode, "energy": energy}}


class Chain:
    """The chain of a scenario's mapping, its snubbers and cubic spring multiplied by a factor."""

    def __init__(self, chain, factor):
        self.mass = np.array(chain["masses"])
        n = self.n = self.mass.size
        link = np.eye(n + 1, n) - np.eye(n + 1, n, -1)  # stretches of the springs in the row, wall to wall
        self.K = link.T @ (np.array(chain["springs"])[:, None] * link)
        self.stops = []
        for s in chain["snubbers"]:
            row = np.zeros(n)
            if "mass" in s:
                row[s["mass"] - 1] = 1.0 if s["side"] == "above" else -1.0
            else:
                low, high = sorted(s["between"])
                row[high - 1], row[low - 1] = 1.0, -1.0
                row *= 1.0 if s["resists"] == "separation" else -1.0
            self.stops.append((factor * s["stiffness"], row, s["gap"]))
        self.cubic = factor * sum(s["stiffness"] for s in chain.get("springs_to_ground", ()))
        self.rest = np.zeros(n)
        for _ in range(50):  # Newton's method; the force is piecewise linear
            near = [(k, r, g) for k, r, g in self.stops if r @ self.rest > g]
            J = self.K + sum((k * np.outer(r, r) for k, r, _ in near), np.zeros((n, n)))
            self.rest += np.linalg.lstsq(J, self.force(self.rest), rcond=None)[0]

    def force(self, x):
        f = -self.K @ x
        f[-1] -= self.cubic * x[-1] ** 3
        return f - sum(k * max(r @ x - g, 0.0) * r for k, r, g in self.stops)

    def potential(self, x):
        stops = sum(0.5 * k * max(r @ x - g, 0.0) ** 2 for k, r, g in self.stops)
        return 0.5 * x @ self.K @ x + 0.25 * self.cubic * x[-1] ** 4 + stops

    def after(self, x, duration):
        """State after a time from rest; restarted wherever a stop is met or left."""
        y, t, n = np.append(x, np.zeros(self.n)), 0.0, self.n
        most = 0.6 / np.sqrt(max(np.linalg.eigvalsh(self.K / np.sqrt(np.outer(self.mass, self.mass)))))
        events = [lambda t, y, r=r, g=g: r @ y[:n] - g for _, r, g in self.stops]
        for event in events:
            event.terminal = True
        while t < duration:
            done = solve_ivp(
                lambda _, y: np.append(y[n:], self.force(y[:n]) / self.mass), (t, duration), y, "DOP853",
                rtol=1e-11, atol=1e-13, events=events, max_step=most,
            )  # fmt: skip
            y, t = done.y[:, -1], done.t[-1]
            if done.status == 1:  # a short way over the event, so that it isn't met again
                short = min(1e-9 * duration, duration - t)
                y = y + short * np.append(y[n:], self.force(y[:n]) / self.mass)
                t += short
        return y


SEEDS = (3, 6, 7, 8, 11)  # none of these chains is refused


def test_the_chains_have_something_of_everything():
    cases = [random_chain(np.random.default_rng(seed)) for seed in SEEDS]
    snubbers = [snubber for case in cases for snubber in case["chain"]["snubbers"]]
    assert {s.get("resists", s.get("side")) for s in snubbers} == {"approach", "separation", "below", "above"}
    assert {np.sign(s["gap"]) for s in snubbers} == {-1.0, 0.0, 1.0}
    assert any("springs_to_ground" in case["chain"] for case in cases)
    assert any(case["chain"]["springs"][0] == 0 for case in cases)
    assert 2 <= sum("continue_in" in case["nnm"] for case in cases) <= len(cases) - 2


@pytest.mark.parametrize("seed", SEEDS)
def test_motions_close_with_their_energy(seed):
    rng = np.random.default_rng(seed)
    case = random_chain(rng)
    result = nnm(load_scenario(case))
    if result.branches[0]["share"].values[-1] < 0.5:  # followed by continuity, and named
        (shared,) = result.outcome.outcomes_with_code("energy_shared")
        assert shared.numbers["share"] == pytest.approx(result.branches[0]["share"].values[-1], rel=1e-9)
    for branch in result.branches:
        k = int(rng.integers(branch["parameter"].values.size))
        chain = Chain(case["chain"], branch["parameter"].values[k] if result.parameter == "stiffness_factor" else 1.0)
        x, energy = branch["initial_displacement"].values[k], branch["energy"].values[k]
        np.testing.assert_allclose(chain.potential(x) - chain.potential(chain.rest), energy, rtol=1e-7)
        y = chain.after(x, 1 / branch["frequency_hz"].values[k])
        mu = multipliers(branch)[k]
        largest = np.abs(mu).max()
        miss = np.hypot(
            np.linalg.norm(y[: chain.n] - x) / np.linalg.norm(x - chain.rest),
            np.linalg.norm(y[chain.n :] * np.sqrt(chain.mass)) / np.sqrt(2 * energy),
        )
        assert miss < 2e-6 * largest
        if largest < 100:
            np.testing.assert_allclose(np.prod(mu), 1.0, atol=1e-5)
            assert np.count_nonzero(np.abs(mu - 1) < 3e-3) >= 2
            assert branch["stable"].values[k] or largest > 1 + 1e-6


def test_the_check_can_fail():
    """A motion of another chain does not close."""
    case = {"masses": [1.0, 1.0], "springs": [1.0, 1.0, 1.0],
            "snubbers": [{"mass": 2, "side": "above", "stiffness": 3.0, "gap": 0.2}]}  # fmt: skip
    branch = nnm(load_scenario({"chain": case, "nnm": {"mode": 1, "energy": 1.0}})).branches[0]
    x = branch["initial_displacement"].values[-1]
    misses = []
    for masses in (case["masses"], [1.0, 1.0001]):
        y = Chain(case | {"masses": masses}, 1.0).after(x, 1 / branch["frequency_hz"].values[-1])
        misses.append(np.linalg.norm(y[:2] - x) / np.linalg.norm(x))
    assert misses[0] < 1e-8
    assert misses[1] > 1e-5
