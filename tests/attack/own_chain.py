"""Steady motions of small chains with stops, by an integration of our own: the package is not imported here.

A stop pushes with k p + c p' while its penetration p is positive. Between contact changes the state with 1, sin and cos
of the load obeys a linear equation, which matrix exponentials follow; contacts are looked for at samples and between
them where the gap has an extremum.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

SAMPLES = 64  # of a block, a tenth of the fastest time constant apart
MOST_SEGMENTS = 20_000
TURN = 0.5  # of the fastest motion on a panel, rad
ROOT = {"rtol": 8.9e-16}


def random_chain(seed):
    """A scenario as a mapping: one to three masses, one or two stops, a sine near the first natural frequency."""
    rng = np.random.default_rng([seed, 77])
    n = int(rng.integers(1, 4))
    k = 10 ** rng.uniform(2, 4)
    springs = (k * 10 ** rng.uniform(-0.5, 0.5, n)).tolist()
    masses = (10 ** rng.uniform(-0.5, 0.3, n)).tolist()
    dashpots = (rng.uniform(0.01, 0.15, n) * np.sqrt(np.array(springs) * np.mean(masses))).tolist()
    chain = {"masses": masses, "springs": springs, "dashpots": dashpots, "snubbers": []}
    first = float(2 * np.pi * natural_frequencies({"chain": chain}, [])[0])
    size = 1e-3
    level = size * first**2 * rng.uniform(0.05, 0.5)
    sine = {"kind": "harmonic", "frequency": first / (2 * np.pi)}
    if rng.random() < 0.6:
        power = int(rng.integers(3))
        sine |= {"applied_to": "base", "quantity": ("acceleration", "velocity", "displacement")[power]}
        sine["level"] = float(level / first**power)
    else:
        sine |= {"applied_to": {"mass": int(rng.integers(1, n + 1))}, "level": float(level * np.mean(masses))}
    for i in range(int(rng.integers(1, 3))):
        stop = {"name": f"stop_{i + 1}"}
        if n > 1 and rng.random() < 0.25:
            a = int(rng.integers(1, n))
            stop |= {"between": [a, a + 1], "resists": str(rng.choice(["approach", "separation"]))}
        else:
            stop |= {"mass": int(rng.integers(1, n + 1)), "side": str(rng.choice(["below", "above"]))}
        gap = 0.0 if rng.random() < 0.1 else rng.uniform(0.1, 2.0)
        stop |= {"gap": float(size * gap), "stiffness": float(k * 10 ** rng.uniform(-1, 3))}
        if rng.random() < 0.5:
            coefficient = rng.uniform(0.01, 0.3) * np.sqrt(stop["stiffness"] * np.mean(masses))
            stop["damping"] = {"kind": "viscous", "coefficient": float(coefficient)}
        chain["snubbers"].append(stop)
    probes = [{"name": f"mass_{i + 1}", "mass": i + 1} for i in range(n)]
    return {"title": f"chain {seed}", "chain": chain, "excitation": sine, "probes": probes}


def row_of(stop, n):
    """(n,) how the stop feels the masses, and its sign: the penetration is -gap - sign (row @ x)."""
    row = np.zeros(n)
    if "between" in stop:
        row[stop["between"][1] - 1], row[stop["between"][0] - 1] = 1.0, -1.0
        return row, 1.0 if stop["resists"] == "approach" else -1.0
    row[stop["mass"] - 1] = 1.0
    return row, 1.0 if stop["side"] == "below" else -1.0


def matrix_of(chain, of):
    """(n, n) of springs or dashpots."""
    n = len(chain["masses"])
    values = np.zeros(n + 1)
    values[: len(chain.get(of, ()))] = chain.get(of, ())
    stretch = np.eye(n + 1, n) - np.eye(n + 1, n, -1)
    return stretch.T @ np.diag(values) @ stretch


def natural_frequencies(case, stiffness):
    """(n,) Hz, with springs of these stiffnesses at the stops."""
    chain = case["chain"]
    K, m = matrix_of(chain, "springs"), np.array(chain["masses"])
    for stop, k in zip(chain["snubbers"], stiffness, strict=False):
        row, _ = row_of(stop, m.size)
        K = K + k * np.outer(row, row)
    return np.sqrt(np.linalg.eigvalsh(K / np.sqrt(np.outer(m, m)))) / (2 * np.pi)


@dataclass
class Segment:
    """A part of a motion between two contact changes."""

    begin: float  # s
    length: float  # s
    closed: tuple  # bool for each stop
    state: np.ndarray  # at its begin


class OwnChain:
    """The motion of a scenario of `random_chain` at an angular frequency; free: without load and damping."""

    def __init__(self, case, omega, free=False):
        chain, sine = case["chain"], case.get("excitation")
        self.m, self.omega, self.n = np.array(chain["masses"]), omega, len(chain["masses"])
        self.K = matrix_of(chain, "springs")
        self.C = np.zeros_like(self.K) if free else matrix_of(chain, "dashpots")
        self.stops = []
        for stop in chain["snubbers"]:
            dashpot = 0.0 if free else stop.get("damping", {}).get("coefficient", 0.0)
            self.stops.append((*row_of(stop, self.n), stop["gap"], stop["stiffness"], dashpot))
        self.load, self.base, self.drive = np.zeros(self.n), 0.0, np.zeros(2)
        if not free:
            power = ("acceleration", "velocity", "displacement").index(sine.get("quantity", "acceleration"))
            # of d = X sin the acceleration is -w^2 X sin, of v = V sin it is w V cos
            self.drive = sine["level"] * omega**power * np.array([[1, 0], [0, 1], [-1, 0]][power])
            if sine["applied_to"] == "base":
                self.load, self.base = -self.m, 1.0
            else:
                self.load[sine["applied_to"]["mass"] - 1] = 1.0
        self.probes, self._known = np.eye(self.n), {}

    def state(self, x, v):
        """State at phase zero of the load."""
        return np.concatenate([x, v, [1.0, 0.0, 1.0]])

    def matrix(self, closed):
        """Rates of the state, the step between samples, and what takes the state to each of them."""
        if closed not in self._known:
            n = self.n
            K, C, f = self.K.copy(), self.C.copy(), np.zeros(n)
            for on, (row, sign, gap, k, c) in zip(closed, self.stops, strict=True):
                if on:
                    K, C, f = K + k * np.outer(row, row), C + c * np.outer(row, row), f - sign * k * gap * row
            A = np.zeros((2 * n + 3, 2 * n + 3))
            A[:n, n : 2 * n] = np.eye(n)
            A[n : 2 * n, :n], A[n : 2 * n, n : 2 * n] = -K / self.m[:, None], -C / self.m[:, None]
            A[n : 2 * n, 2 * n] = f / self.m
            A[n : 2 * n, 2 * n + 1 :] = np.outer(self.load / self.m, self.drive)
            A[2 * n + 1, 2 * n + 2], A[2 * n + 2, 2 * n + 1] = self.omega, -self.omega
            step = 0.1 / np.abs(np.linalg.eigvals(A)).max()
            self._known[closed] = A, step, np.array([expm(A * step * i) for i in range(1, SAMPLES + 1)])
        return self._known[closed]

    def penetration(self, i, z):
        row, sign, gap, _, _ = self.stops[i]
        return -gap - sign * (z[..., : self.n] @ row)

    def rate(self, i, z):
        row, sign, *_ = self.stops[i]
        return -sign * (z[..., self.n : 2 * self.n] @ row)

    def move(self, z, duration):
        """Segments of the motion, and the state at its end."""
        found, t = [], 0.0
        depth = [(self.penetration(i, z), self.rate(i, z)) for i in range(len(self.stops))]
        closed = tuple(bool(p > 0 or (p == 0 and rate > 0)) for p, rate in depth)
        while t < duration:
            if len(found) > MOST_SEGMENTS:
                raise RuntimeError("our own march stands still")
            begin, first = t, z
            t, z, which = self._until_change(t, z, closed, duration)
            found.append(Segment(begin, t - begin, closed, first))
            closed = tuple(on != (i == which) for i, on in enumerate(closed))
        return found, z

    def _until_change(self, t, z, closed, duration):
        A, step, ahead = self.matrix(closed)
        while True:
            samples = ahead @ z
            left, tops = self._left(z, samples, closed, A, step)
            first = int(np.argmax(left)) if left.any() else SAMPLES
            last = int(np.ceil((duration - t) / step - 1e-12))
            if last <= first and last <= SAMPLES:
                return duration, expm(A * (duration - t)) @ z, None
            if first == SAMPLES:
                t, z = t + SAMPLES * step, samples[-1]
                continue
            low = z if first == 0 else samples[first - 1]
            roots = [(self._root(i, on, low, A, tops.get((first, i), step)), i) for i, on in enumerate(closed)]
            after, which = min((root for root in roots if root[0] is not None), default=(step, None))
            if t + first * step + after >= duration:
                return duration, expm(A * (duration - t - first * step)) @ low, None
            return t + first * step + after, expm(A * after) @ low, which

    def _left(self, z, samples, closed, A, step):
        """At which samples, or before them, a stop is beyond its contact state, and where the extremes between are."""
        left, tops = np.zeros(SAMPLES, dtype=bool), {}
        for i, on in enumerate(closed):
            side = -1.0 if on else 1.0
            beyond = side * np.append(self.penetration(i, z), self.penetration(i, samples))
            rate = side * np.append(self.rate(i, z), self.rate(i, samples))
            left |= beyond[1:] > 0
            turning = (rate[:-1] > 0) & (rate[1:] <= 0) & (beyond[1:] <= 0) & (beyond[:-1] + rate[:-1] * step > 0)
            for q in np.flatnonzero(turning):
                at = z if q == 0 else samples[q - 1]
                top = self._turn(i, side, at, A, step)
                if side * self.penetration(i, expm(A * top) @ at) > 0:
                    left[q], tops[(q, i)] = True, top
        return left, tops

    def _turn(self, i, side, z, A, step):
        return brentq(lambda s: float(side * self.rate(i, expm(A * s) @ z)), 0.0, step, xtol=1e-15 * step, **ROOT)

    def _root(self, i, on, z, A, end):
        """When a stop leaves its contact state within a step; None where it does not."""
        side = -1.0 if on else 1.0

        def beyond(s):
            return float(side * self.penetration(i, expm(A * s) @ z))

        if not beyond(end) > 0:
            return None
        begin = 0.0
        if beyond(0.0) >= 0 and side * self.rate(i, z) < 0:  # it has just come from there
            if side * self.rate(i, expm(A * end) @ z) <= 0:
                return None
            begin = self._turn(i, -side, z, A, end)
        return begin if beyond(begin) >= 0 else brentq(beyond, begin, end, xtol=1e-15 * end, **ROOT)

    def figures(self, z, duration):
        """Extremes, means and shares of a motion; states and accelerations by mass, forces by stop."""
        segments, end = self.move(z, duration)
        node, weight = np.polynomial.legendre.leggauss(8)
        places = np.append((node + 1) / 2, np.linspace(0, 1, 65))
        high, low, sums, closed = {}, {}, {}, np.zeros(len(self.stops))
        for segment in segments:
            A = self.matrix(segment.closed)[0]
            closed += segment.length * np.array(segment.closed)
            panels = max(2, int(np.ceil(segment.length * np.abs(np.linalg.eigvals(A)).max() / TURN)))
            h, at = segment.length / panels, segment.state
            inner = np.array([expm(A * h * share) for share in places])
            for _ in range(panels):
                values = self._values(inner @ at, A, segment.closed)
                for name, value in values.items():
                    top, bottom = peaks(value[8:])
                    high[name] = np.maximum(high.get(name, -np.inf), top)
                    low[name] = np.minimum(low.get(name, np.inf), bottom)
                    integral = h / 2 * np.array([weight @ value[:8], weight @ value[:8] ** 2])
                    sums[name] = sums.get(name, 0.0) + integral / duration
                at = inner[-1] @ at
        means = {name: total[0] for name, total in sums.items()}
        rms = {name: np.sqrt(total[1]) for name, total in sums.items()}
        return Figures(high, low, means, rms, closed / duration, end)

    def _values(self, z, A, closed):
        n = self.n
        base = self.base * (z[:, 2 * n + 1 :] @ self.drive)[:, None]
        force = [
            on * (k * self.penetration(i, z) + c * self.rate(i, z))
            for i, (on, (*_, k, c)) in enumerate(zip(closed, self.stops, strict=True))
        ]
        acceleration = (z @ A.T)[:, n : 2 * n] @ self.probes.T + base
        return {"displacement": z[:, :n] @ self.probes.T, "acceleration": acceleration, "force": np.array(force).T}

    def monodromy(self, z, duration):
        """(2 n, 2 n) derivative of the state at the end by that at the begin, jumps at contacts included."""
        segments, _ = self.move(z, duration)
        M = np.eye(z.size)
        for segment, after in zip(segments, [*segments[1:], None], strict=True):
            A = self.matrix(segment.closed)[0]
            E = expm(A * segment.length)
            M, at = E @ M, E @ segment.state
            if after is not None and after.closed != segment.closed:
                (i,) = (i for i, on in enumerate(segment.closed) if on != after.closed[i])
                normal = np.zeros(z.size)
                normal[: self.n] = -self.stops[i][1] * self.stops[i][0]
                jump, speed = (self.matrix(after.closed)[0] - A) @ at, normal @ A @ at
                M = M if speed == 0.0 else M + np.outer(jump, normal @ M) / speed  # at a grazing nothing jumps
        return M[: 2 * self.n, : 2 * self.n]


@dataclass
class Figures:
    """Of a motion, by quantity: displacement and acceleration of the masses, force of the stops."""

    high: dict
    low: dict
    mean: dict
    rms: dict
    share: np.ndarray  # of the time in contact
    end: np.ndarray  # state

    def peak(self, name):
        return np.maximum(np.abs(self.high[name]), np.abs(self.low[name]))


def peaks(values):
    """Largest and smallest of the columns, by parabolas through three samples."""
    found = []
    for side in (1.0, -1.0):
        y = side * values
        at = np.clip(np.argmax(y, axis=0), 1, len(y) - 2)
        before, here, after = (y[at + k, np.arange(y.shape[1])] for k in (-1, 0, 1))
        bend, slope = (after - 2 * here + before) / 2, (after - before) / 2
        inside = (bend < 0) & (np.abs(slope) <= -2 * bend)
        vertex = here - slope**2 / np.where(inside, 4 * bend, 1.0)
        found.append(side * np.maximum(y.max(axis=0), np.where(inside, vertex, -np.inf)))
    return found
