"""A second opinion: structures, stops and time stepping written apart from the package, which is not imported here.

Beams are assembled from the textbook's element matrices, reduced with a dense eigenvalue problem, and integrated by
SciPy's DOP853, restarted at every contact. Nothing is shared with what it checks, neither formulas nor the start.
"""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import eigh

# --- structures -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Structure:
    """M x'' + C x' + K x = f; the base's acceleration a adds -inertia a."""

    mass: np.ndarray  # (n, n)
    damping: np.ndarray  # (n, n)
    stiffness: np.ndarray  # (n, n)
    inertia: np.ndarray  # (n,)


def free_beam(bending, line, h, elements):
    """Mass and stiffness of equal cubic elements of length h: bending stiffness, mass per length, no supports."""
    k = bending / h**3 * np.array(
        [[12, 6 * h, -12, 6 * h], [6 * h, 4 * h * h, -6 * h, 2 * h * h],
         [-12, -6 * h, 12, -6 * h], [6 * h, 2 * h * h, -6 * h, 4 * h * h]]
    )  # fmt: skip
    m = line * h / 420 * np.array(
        [[156, 22 * h, 54, -13 * h], [22 * h, 4 * h * h, 13 * h, -3 * h * h],
         [54, 13 * h, 156, -22 * h], [-13 * h, -3 * h * h, -22 * h, 4 * h * h]]
    )  # fmt: skip
    M, K = np.zeros((2, 2 * elements + 2, 2 * elements + 2))
    for e in range(elements):
        M[2 * e : 2 * e + 4, 2 * e : 2 * e + 4] += m
        K[2 * e : 2 * e + 4, 2 * e : 2 * e + 4] += k
    return M, K


class Beam:
    """A uniform Euler-Bernoulli beam of equal cubic elements, dofs (w, w') at each node; ``held`` at its left end."""

    def __init__(self, length, width, thickness, modulus, density, elements, held, point_masses=(), right="free"):
        self.h, self.elements = length / elements, elements
        M, K = free_beam(modulus * width * thickness**3 / 12, density * width * thickness, self.h, elements)
        fixed = {"clamped": (0, 1), "pinned": (0,), "guided": (1,), "free": ()}
        away = [*fixed[held], *(2 * elements + dof for dof in fixed[right])]
        self.free = np.setdiff1d(np.arange(2 * elements + 2), away)
        for x, mass in point_masses:
            M += mass * np.outer(self.whole_row(x), self.whole_row(x))
        lift = np.tile([1.0, 0.0], elements + 1)
        part = np.ix_(self.free, self.free)
        self.M, self.K, self.inertia = M[part], K[part], (M @ lift)[self.free]
        self.turned = [(M @ moved)[self.free] for moved in (lift, self._by_turning())]

    def _by_turning(self):
        """Motion of all dofs by a unit rotation about the left end, which takes points of larger x down."""
        return np.stack([-self.h * np.arange(self.elements + 1), -np.ones(self.elements + 1)], axis=1).ravel()

    def turning_inertia(self, about):
        """Load of a unit angular acceleration of the base about a position, but for its sign."""
        return self.turned[1] + about * self.turned[0]

    def whole_row(self, x):
        e = min(int(x / self.h * (1 + 1e-12)), self.elements - 1)
        s = x / self.h - e
        row = np.zeros(2 * self.elements + 2)
        row[2 * e : 2 * e + 4] = [
            1 - 3 * s**2 + 2 * s**3, self.h * (s - 2 * s**2 + s**3), 3 * s**2 - 2 * s**3, self.h * (s**3 - s**2)
        ]  # fmt: skip
        return row

    def row(self, x):
        """Deflection at x for a unit of each free dof."""
        return self.whole_row(x)[self.free]

    def reduced(self, modes, places, ratio, rigid=0):
        """The lowest modes and what the others add to the static deflection under a force at each place.

        Returns the structure in the coordinates that diagonalise it, with a damping ratio for each, and their shapes.
        """
        omega2, phi = eigh(self.K, self.M)
        omega2[:rigid] = 0.0
        rest = phi[:, modes:]
        static = np.array([rest @ (rest.T @ self.row(x) / omega2[modes:]) for x in places]).T
        static /= np.sqrt(np.sum(static * (self.M @ static), axis=0))
        squares, turn = eigh(static.T @ self.K @ static, static.T @ self.M @ static)
        shapes = np.hstack([phi[:, :modes], static @ turn])
        omega2 = np.append(omega2[:modes], squares)
        damping = np.diag(2 * ratio * np.sqrt(omega2))
        return Structure(np.eye(omega2.size), damping, np.diag(omega2), shapes.T @ self.inertia), shapes


# --- stops ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Stop:
    """A one-sided spring and dashpot on the deflection ``row @ x``, below (+1) or above (-1) the structure."""

    row: np.ndarray
    stiffness: float
    dashpot: float = 0.0
    gap: float = 0.0
    side: float = 1.0
    on_ground: bool = False
    no_tension: bool = False  # lets go when the force reaches zero, and relaxes by itself until it is met again

    def with_damping_ratio(self, structure, ratio):
        """Dashpot 2 ratio k / Omega, Omega the first frequency that is not zero with this stop closed."""
        squares = eigh(structure.stiffness + self.stiffness * np.outer(self.row, self.row), structure.mass)[0]
        first = np.sqrt(squares[squares > 1e-9 * squares[-1]][0])
        return Stop(**{**vars(self), "dashpot": 2 * ratio * self.stiffness / first})


def static_equilibrium(structure, stops):
    """Rest position: the closed set for which every closed stop is compressed and no open one is."""
    closed = np.zeros(len(stops), dtype=bool)
    for _ in range(50):
        K, f = structure.stiffness.copy(), np.zeros(len(structure.stiffness))
        for stop in (s for s, c in zip(stops, closed, strict=True) if c):
            K += stop.stiffness * np.outer(stop.row, stop.row)
            f -= stop.stiffness * stop.gap * stop.side * stop.row
        x = np.linalg.solve(K, f)
        now = np.array([-s.gap - s.side * (s.row @ x) > 0 for s in stops])
        if np.array_equal(now, closed):
            return x
        closed = now
    raise AssertionError("no equilibrium")


# --- time stepping ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Motion:
    state: np.ndarray  # (nt, 2 n) x and x' at the times asked for
    event_time: np.ndarray
    event_stop: np.ndarray
    event_closing: np.ndarray


def integrate(
    structure, stops, load, start, times, *, base=None, breaks=(), most_step, rtol=1e-12, atol=1e-14, cubic=None
):
    """Step from time 0 through ``times``, which end the motion, restarted at every contact and at the breaks.

    Parameters
    ----------
    load : f(t), (n,); ``base(t)`` gives displacement and velocity of the base, which stops on the ground feel.
    start : (2 n,) x and x'.
    cubic : (rows, stiffness) of springs whose force is stiffness (row @ x)^3.
    """
    n, m = len(structure.stiffness), len(stops)
    inverse = np.linalg.inv(structure.mass)
    modal_masses = np.array_equal(structure.mass, np.eye(n))  # the load is then the acceleration
    k, c, gap, side = (np.array([getattr(s, x) for s in stops]) for x in ("stiffness", "dashpot", "gap", "side"))
    rows = np.array([s.row for s in stops]).reshape(m, n)
    grounded = np.array([s.on_ground for s in stops], dtype=float)
    # a face of its own, which keeps its place when it is left and relaxes at the rate k / c
    own_face = np.array([s.no_tension and s.dashpot > 0 for s in stops], dtype=bool)
    relaxing = np.where(own_face, k / np.where(own_face, c, 1.0), 0.0)
    base = base or (lambda t: (0.0, 0.0))

    def penetration(t, y):
        d, v = base(t)
        return -gap - side * (rows @ y[:n] + grounded * d), -side * (rows @ y[n : 2 * n] + grounded * v)

    def slope_while(closed):
        """The right-hand side while these stops are closed: constant matrices, the loads and the base's motion."""
        spring, dashpot = np.where(closed, k, 0.0), np.where(closed, c, 0.0)
        matrix = np.zeros((2 * n + m, 2 * n + m))
        matrix[:n, n : 2 * n] = np.eye(n)
        matrix[n : 2 * n, :n] = -inverse @ (structure.stiffness + (rows.T * spring) @ rows)
        matrix[n : 2 * n, n : 2 * n] = -inverse @ (structure.damping + (rows.T * dashpot) @ rows)
        matrix[2 * n :, 2 * n :] = -np.diag(np.where(closed, 0.0, relaxing))
        pushed = inverse @ rows.T
        constant, by_base = -pushed @ (side * spring * gap), -pushed @ np.transpose([spring, dashpot] * grounded)
        follows_base = bool(np.any(grounded[closed]))

        def slope(t, y):
            rate = matrix @ y
            rate[n : 2 * n] += constant + (load(t) if modal_masses else inverse @ np.broadcast_to(load(t), n))
            if follows_base:
                rate[n : 2 * n] += by_base @ base(t)
            if cubic is not None:
                rate[n : 2 * n] -= inverse @ ((cubic[1] * (cubic[0] @ y[:n]) ** 3) @ cubic[0])
            return rate

        return slope

    def watch(j, closed):
        def left(t, y):
            delta, rate = penetration(t, y)
            if not closed[j]:
                return y[2 * n + j] - delta[j]
            return k[j] * delta[j] + c[j] * rate[j] if own_face[j] else delta[j]

        left.terminal, left.direction = True, -1.0
        return left

    y = np.concatenate([start, np.zeros(m)])
    # just touching counts as closed if the motion goes on into the stop, seen a short way ahead
    ahead = 1e-4 * most_step
    onward = solve_ivp(slope_while(np.zeros(m, dtype=bool)), (0, ahead), y, "DOP853", rtol=rtol, atol=1e-30).y[:, -1]
    delta = penetration(0.0, y)[0]
    closed = np.where(np.abs(delta) > 1e-15 * (1 + np.abs(gap)), delta, penetration(ahead, onward)[0]) > 0
    state, found = np.empty((len(times), 2 * n)), []
    stops_at = [*sorted(b for b in breaks if 0 < b < times[-1]), times[-1]]
    t, first = 0.0, 0  # where the motion has come to, and the first time that lies beyond
    while t < times[-1]:
        stop = next(b for b in stops_at if b > t)
        done = solve_ivp(
            slope_while(closed), (t, stop), y, "DOP853", rtol=rtol, atol=atol, max_step=most_step,
            events=[watch(j, closed) for j in range(m)], t_eval=np.append(times[first:][times[first:] < stop], stop),
        )  # fmt: skip
        reached = np.count_nonzero(np.array(done.t) < stop)
        if reached:
            state[first : first + reached] = done.y[: 2 * n, :reached].T
        first += reached
        if done.status == 1:
            j = next(j for j in range(m) if done.t_events[j].size)
            t, y = done.t_events[j][-1], done.y_events[j][-1].copy()
            if own_face[j]:
                y[2 * n + j] = penetration(t, y)[0][j]
            closed = closed.copy()
            closed[j] = ~closed[j]
            found.append((t, j, closed[j]))
        else:
            t, y = stop, done.y[:, -1]
    state[first:] = y[: 2 * n]
    when, which, closing = zip(*found, strict=True) if found else ((), (), ())
    return Motion(state, np.array(when), np.array(which, dtype=int), np.array(closing, dtype=bool))


def chain(masses, springs, dashpots):
    """Masses in a row between two walls; a spring and a dashpot before each mass and one after the last."""
    stretch = np.eye(len(masses) + 1, len(masses)) - np.eye(len(masses) + 1, len(masses), -1)
    return Structure(
        np.diag(np.asarray(masses, dtype=float)),
        stretch.T @ np.diag(dashpots) @ stretch,
        stretch.T @ np.diag(springs) @ stretch,
        np.asarray(masses, dtype=float),
    )


def modal(omega, damping):
    """A structure given by its angular frequencies and damping matrix (or diagonal)."""
    damping = np.asarray(damping, dtype=float)
    damping = np.diag(damping) if damping.ndim == 1 else damping
    return Structure(np.eye(len(omega)), damping, np.diag(np.square(omega)), np.zeros(len(omega)))
