"""A scenario as equations of motion, from its plain YAML mapping alone: the package is not imported here.

Bodies are assembled without reduction from the textbook's matrices, contact laws are written as forces between places,
inputs as functions of time. What is made of a mapping is a `Model`, which `move` integrates by `dense_stepper`.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from dense_stepper import EPS, Inputs, Linear, integrate, shortly
from independent import Beam
from own_laws import Bent, Branch, Curve, Pad, RigidFriction, SpringFriction, TableStop
from scipy.interpolate import CubicSpline, PPoly
from scipy.linalg import cho_factor, cho_solve, eigh
from scipy.optimize import brentq

SOFT = 1e-6  # of the largest square of a frequency: smaller ones, which it drowns, are those of the flexibility
ROUND_OFF = 64 * EPS  # of the size of a motion, in its penetrations: what the search for contacts allows


@dataclass(frozen=True)
class Contact:
    """A law between a place (or two) and its surroundings.

    One-sided: penetration delta = -gap - sign (row @ x + felt d); the push on the structure along the row is sign N.
    Others, as friction and piecewise-linear springs, have sign -1 and no gap: delta is the stretch row @ x + felt d.
    """

    name: str
    law: str  # kelvin_voigt, no_tension, piecewise_linear
    row: np.ndarray  # (n,)
    of: object  # its law, of `own_laws`
    sign: float = -1.0
    felt: float = 0.0  # 1: on the ground, so that the base's displacement counts
    stiffness: float = 0.0  # the largest
    dashpot: float = 0.0
    gap: float = 0.0


@dataclass(frozen=True)
class Model:
    """Mass-normalised modal coordinates of the open structure, all of them."""

    omega: np.ndarray  # (n,)
    damping: np.ndarray  # (n, n)
    constant: np.ndarray  # (n,)
    loads: np.ndarray  # (C, n) per unit of each input
    contacts: tuple  # rows in modal coordinates
    probes: dict  # name -> (n,)
    inputs: Inputs
    start: np.ndarray  # (2 n,)


# -- structures --------------------------------------------------------------------------------------------------------


class Body:
    """Matrices of one body, and the row of a place on it."""

    def __init__(self, spec):
        if "masses" in spec:
            self._chain(spec)
        elif "dofs" in spec:
            self._imported(spec)
        else:
            self._beam(spec)
        squares, shapes = eigh(self.K, self.M)
        squares[: self.rigid] = 0.0
        omega = np.sqrt(np.maximum(squares, 0.0))
        damping = spec.get("damping", {})
        modal = np.zeros(omega.size)
        if damping.get("kind") == "modal":
            ratios = np.atleast_1d(damping["ratio"])
            modal = 2 * np.append(ratios, np.full(omega.size, ratios[-1]))[: omega.size] * omega
        elif damping.get("kind") == "rayleigh":
            modal = damping.get("mass", 0.0) + damping.get("stiffness", 0.0) * omega**2
        back = self.M @ shapes
        self.C = self.C + (back * modal) @ back.T

    def _beam(self, spec):
        if "bending_stiffness" in spec:
            width = 12 * spec["bending_stiffness"]
            numbers = (width, 1.0, 1.0, spec["mass_per_length"] / width)
        else:
            numbers = (spec["width"], spec["thickness"], spec["youngs_modulus"], spec["density"])
        supports = {"left": "clamped", "right": "free", **spec.get("supports", {})}
        masses = [(m["position"], m["mass"]) for m in spec.get("point_masses", ())]
        ends = (supports["left"], supports["right"])
        beam = Beam(spec["length"], *numbers, spec["elements"], ends[0], masses, ends[1])
        self.beam, self.M, self.K, self.inertia = beam, beam.M, beam.K, beam.inertia
        self.rigid = {
            ("free", "free"): 2, ("pinned", "free"): 1, ("free", "pinned"): 1, ("guided", "free"): 1,
            ("free", "guided"): 1, ("guided", "guided"): 1,
        }.get(ends, 0)  # fmt: skip
        self.C = np.zeros_like(self.M)
        if spec.get("damping", {}).get("kind") == "viscous":
            bare = Beam(spec["length"], *numbers, spec["elements"], ends[0], (), ends[1])
            line = numbers[3] * numbers[0] * numbers[1]
            self.C = spec["damping"]["coefficient"] / line * bare.M
        self.ground = np.zeros(len(self.M))
        self.springs = ()

    def _imported(self, spec):
        """Nodes that move along z; the first is the base, to which all of their springs lead in the end."""
        M, K = (_matrix(spec[key]["file"]) for key in ("mass", "stiffness"))
        rigid = -np.linalg.solve(K[1:, 1:], K[1:, 0])
        self.M, self.K, self.inertia = M[1:, 1:], K[1:, 1:], M[1:, 1:] @ rigid + M[1:, 0]
        self.C, self.ground = np.zeros_like(self.M), np.zeros(len(rigid))
        self.beam, self.springs, self.rigid = None, (), 0

    def _chain(self, spec):
        masses, springs = np.array(spec["masses"], dtype=float), list(spec["springs"])
        n = masses.size
        springs += [0.0] * (n + 1 - len(springs))
        dashpots = list(spec.get("dashpots", ())) or [0.0] * (n + 1)
        dashpots += [0.0] * (n + 1 - len(dashpots))
        stretch = np.eye(n + 1, n) - np.eye(n + 1, n, -1)
        self.M = np.diag(masses)
        self.K = stretch.T @ np.diag(springs) @ stretch
        self.C = stretch.T @ np.diag(dashpots) @ stretch
        self.inertia, self.beam = masses, None
        self.ground = np.zeros(n)
        bent = []
        for spring in (*spec.get("springs_to_ground", ()), *spec.get("springs_between", ())):
            grounded = "mass" in spring
            row = np.zeros(n)
            if grounded:
                row[spring["mass"] - 1] = 1.0
            else:
                low, high = sorted(spring["masses"])
                row[low - 1], row[high - 1] = -1.0, 1.0
            if spring["kind"] == "linear":
                slope = spring["stiffness"]
            else:
                bends, slopes = spring["breakpoints"], spring["stiffnesses"]
                kept = [i for i in range(len(bends)) if slopes[i] != slopes[i + 1]]  # others are no bends
                law = Bent(tuple(bends[i] for i in kept), (*(slopes[i] for i in kept), slopes[-1]))
                slope = law.slope_at_rest
                if kept:
                    contact = Contact("", "piecewise_linear", row, law, felt=float(grounded), stiffness=max(law.slopes))
                    bent.append(contact)
            self.K = self.K + slope * np.outer(row, row)
            if grounded:
                self.ground -= slope * row
        self.springs = tuple(bent)
        values = np.linalg.eigvalsh(self.K)
        self.rigid = int(np.sum(values < 1e-12 * max(values[-1], 1e-300)))

    def row(self, place):
        if self.beam is not None:
            return self.beam.row(place["position"])
        return np.eye(len(self.M))[place["mass"] - 1 if "mass" in place else place["node"] - 2]

    def slope(self, place):
        """Slope at a node of a beam."""
        row = np.zeros(2 * self.beam.elements + 2)
        row[2 * round(place["position"] / self.beam.h) + 1] = 1.0
        return row[self.beam.free]

    def field(self, numbers):
        """Coordinates of an initial field: a polynomial that the supports and cubic elements allow, or a list."""
        if not numbers:
            return np.zeros(len(self.M))
        if self.beam is None:
            return np.array(numbers, dtype=float)
        polynomial = np.polynomial.Polynomial(numbers)
        x = self.beam.h * np.arange(self.beam.elements + 1)
        both = np.stack([polynomial(x), polynomial.deriv()(x)], axis=1).ravel()
        return both[self.beam.free]


def _matrix(file):
    """A dense matrix of the MatrixMarket format."""
    with open(file, encoding="utf-8") as lines:
        numbers = [line for line in lines if not line.startswith("%")]
    rows, columns = map(int, numbers[0].split())
    return np.array(numbers[1:], dtype=float).reshape(columns, rows).T


def _allowed(held):
    """Motions that leave rows at zero; coordinates are eliminated and not mixed, so that soft and stiff stay apart."""
    held, followers = held.copy(), []
    for k, row in enumerate(held):
        at = int(np.argmax(np.abs(row)))
        held[k] = row / row[at]
        others = np.arange(len(held)) != k
        held[others] -= np.outer(held[others, at], held[k])
        followers.append(at)
    rest = np.setdiff1d(np.arange(held.shape[1]), followers)
    free = np.zeros((held.shape[1], rest.size))
    free[rest, np.arange(rest.size)] = 1.0
    free[followers] = -held[:, rest]
    return free


class Structure:
    """All bodies of a scenario in open modal coordinates."""

    def __init__(self, case):
        specs = case.get("bodies") or {"": case.get("beam") or case["chain"]}
        self.bodies = {name: Body(spec) for name, spec in specs.items()}
        sizes = [len(body.M) for body in self.bodies.values()]
        ends = np.cumsum([0, *sizes])
        self.parts = {name: slice(a, b) for name, a, b in zip(self.bodies, ends[:-1], ends[1:], strict=True)}
        size = int(ends[-1])
        M, K, C = np.zeros((3, size, size))
        self.inertia, self.ground = np.zeros((2, size))
        for name, body in self.bodies.items():
            part = self.parts[name]
            M[part, part], K[part, part], C[part, part] = body.M, body.K, body.C
            self.inertia[part], self.ground[part] = body.inertia, body.ground
        self.rigid = sum(body.rigid for body in self.bodies.values())
        held, self.branches = [], []
        origins = {next(iter(self.bodies)): 0.0}  # of bodies along the common axis
        for joint in case.get("joints", ()):
            first, second = joint["between"]
            across = self.across(second) - self.across(first)
            if second != "base" and "position" in first and "position" in second and first["body"] in origins:
                origins.setdefault(second["body"], origins[first["body"]] + first["position"] - second["position"])
            if "rotational_stiffness" in joint:
                turn = self.across(second, slope=True) - self.across(first, slope=True)
                K += joint["rotational_stiffness"] * np.outer(turn, turn)
                C += joint["rotational_dashpot"] * np.outer(turn, turn)
            if joint["kind"] == "spring":
                K += joint["stiffness"] * np.outer(across, across)
                C += joint.get("dashpot", 0.0) * np.outer(across, across)
                self.branches += [(across, b["stiffness"], b["relaxation_time"]) for b in joint.get("maxwell", ())]
                continue
            held.append(across)
            if joint["kind"] == "rigid":
                held.append(self.across(second, slope=True) - self.across(first, slope=True))
        excitation = case.get("excitation", {})
        self.origins, self.about = origins, excitation.get("about") if excitation.get("direction") == "ry" else None
        driven = self.inertia.copy()
        if self.about is not None:
            for name, body in self.bodies.items():
                driven[self.parts[name]] = body.beam.turning_inertia(self.about - origins[name])
        self.free = _allowed(np.array(held).reshape(-1, size))
        M, K, C = (self.free.T @ matrix @ self.free for matrix in (M, K, C))
        self.inertia, self.driven, self.ground = (load @ self.free for load in (self.inertia, driven, self.ground))
        squares, self.shapes = eigh(K, M)
        if case.get("joints"):  # they may hold what floats by itself
            self.rigid = int(np.sum(squares < 1e-13 * squares[-1]))
        low = squares < SOFT * squares[-1]
        if low.any() and not self.rigid:
            moved = M @ self.shapes[:, low]
            flexibilities, turn = eigh(-moved.T @ cho_solve(cho_factor(K), moved))
            squares[low], self.shapes[:, low] = -1 / flexibilities, self.shapes[:, low] @ turn
        squares[: self.rigid] = 0.0
        self.omega = np.sqrt(np.maximum(squares, 0.0))
        self.damping = self.shapes.T @ C @ self.shapes
        self.M = M

    def row(self, place):
        """(n,) deflection at a place in modal coordinates."""
        return self.across(place.get("at", place)) @ self.free @ self.shapes

    def across(self, place, slope=False):
        """Deflection or slope at a place in the coordinates of all bodies; the base does not move."""
        if place == "base":
            return np.zeros(max(part.stop for part in self.parts.values()))
        name = place.get("body", next(iter(self.bodies)))
        row = np.zeros(max(part.stop for part in self.parts.values()))
        row[self.parts[name]] = (self.bodies[name].slope if slope else self.bodies[name].row)(place)
        return row

    def lift(self, place):
        """Motion of the base at a place, for a unit of what is given."""
        if self.about is None:
            return 1.0
        at = place.get("at", place)
        return self.about - self.origins[at["body"]] - at["position"]

    def modal(self, load):
        return self.shapes.T @ load

    def coordinates(self, field):
        """Modal coordinates of a field given in the bodies' own."""
        return self.shapes.T @ (self.M @ field)


# -- contacts ----------------------------------------------------------------------------------------------------------


def contacts_of(case, structure):
    """Snubbers in the scenario's order, then piecewise-linear springs; gaps that follow from preloads are 0 still."""
    found, preloads = [], []
    snubbers = [*case.get("snubbers", ()), *case.get("chain", {}).get("snubbers", ())]
    for i, snubber in enumerate(snubbers):
        if "between" in snubber:
            first, second = snubber["between"]
            if not isinstance(first, dict):
                first, second = ({"mass": number} for number in sorted((first, second)))
            row, felt = structure.row(second) - structure.row(first), 0.0
            sign = 1.0 if snubber.get("resists", "approach") == "approach" else -1.0
        else:
            row = structure.row(snubber)
            felt = structure.lift(snubber) if snubber.get("mounted_on") == "ground" else 0.0
            sign = 1.0 if snubber["side"] == "below" else -1.0
        k, damping = snubber.get("stiffness", 0.0), snubber.get("damping", {})
        c = damping.get("coefficient", 0.0)
        if damping.get("kind") == "ratio":
            c = 2 * damping["ratio"] * k / np.sqrt(lowest_square(structure.omega**2, row, k))
        law = snubber.get("law", "kelvin_voigt")
        name = snubber.get("name", f"snubber_{i + 1}")
        table, branches = snubber.get("force_deflection"), snubber.get("maxwell", ())
        gap = snubber.get("gap", 0.0)
        knots, slopes = (0.0,), (k,)
        if table:
            x, force = np.transpose(table)
            knots, slopes = tuple(x[:-1].tolist()), tuple((np.diff(force) / np.diff(x)).tolist())
        curve = Curve(knots, slopes)
        branches = tuple((b["stiffness"], b["relaxation_time"]) for b in branches)
        of = Pad(curve, c, branches) if law == "no_tension" and (c > 0 or branches) else TableStop(curve, c)
        k = max(slopes) + sum(b[0] for b in branches)
        found.append(Contact(name, law, row, of, sign, felt, k, c, gap))
        preloads.append(snubber.get("preload"))
    for name, body in structure.bodies.items():
        for spring in body.springs:
            whole = np.zeros(len(structure.free))
            whole[structure.parts[name]] = spring.row
            found.append(Contact(**{**vars(spring), "row": whole @ structure.free @ structure.shapes}))
            preloads.append(None)
    for across, stiffness, time in structure.branches:
        row = across @ structure.free @ structure.shapes
        found.append(Contact("", "branch", row, Branch(stiffness, time), stiffness=stiffness))
        preloads.append(None)
    for friction in case.get("friction", ()):
        found.append(friction_of(friction, structure))
        preloads.append(None)
    return found, preloads


def friction_of(friction, structure):
    """Dry friction as a contact whose penetration is the stretch."""
    if "between" in friction:
        first, second = friction["between"]
        row, felt = structure.row(second) - structure.row(first), 0.0
    else:
        row = structure.row(friction)
        felt = structure.lift(friction) if friction["mounted_on"] == "ground" else 0.0
    limits = [friction["normal_force"] * friction["coefficient"][key] for key in ("static", "sliding")]
    stiffness = friction.get("stiffness", 0.0)
    law = SpringFriction(stiffness, *limits) if stiffness else RigidFriction(*limits)
    return Contact(friction["name"], "friction", row, law, felt=felt, stiffness=stiffness)


def lowest_square(squares, row, stiffness):
    """Smallest positive eigenvalue of diag(squares) + stiffness row rowᵀ.

    By the secular equation 1 / k + sum r_i^2 / (w_i^2 - x) = 0 between its first two poles: the eigenvalues of the
    matrix itself are known to the round-off of the largest.
    """
    felt = np.abs(row) > 1e-9 * np.abs(row).max()
    poles, at = np.unique(squares[felt], return_inverse=True)
    weights = np.bincount(at, row[felt] ** 2)
    others = squares[~felt & (squares > 0)]

    def secular(x):
        return 1 / stiffness + np.sum(weights / (poles - x))

    if poles.size == 1:
        root = poles[0] + stiffness * weights[0]
    else:
        low, high = poles[0] * (1 + 1e-15) + 1e-30 * poles[1], poles[1] * (1 - 1e-15)
        root = low if secular(low) >= 0 else high
        if secular(low) < 0 < secular(high):
            root = brentq(secular, low, high, xtol=1e-300, rtol=1e-15)
    return min([root, *others])


def equilibrium(structure, contacts, load, pushes=None):
    """Rest under a constant load by Newton's method on the piecewise-linear equations, the base at rest.

    ``pushes`` : (m,) constant contact forces instead of a law's, nan where the law acts.
    """
    pushes = np.full(len(contacts), np.nan) if pushes is None else pushes

    def balance(x):
        """Tangent stiffness and what is left of the load."""
        K, r = np.diag(structure.omega**2), load - structure.omega**2 * x
        for c, push in zip(contacts, pushes, strict=True):
            delta = -c.gap - c.sign * (c.row @ x)
            if np.isfinite(push):
                r = r + c.sign * push * c.row
            elif delta > 0 or not c.of.pushes:
                slope, force = c.of.static(delta)
                K = K + slope * np.outer(c.row, c.row)
                r = r + c.sign * force * c.row
        return K, r

    def along(share, x, step):
        return step @ balance(x + share * step)[1]

    x = np.zeros(structure.omega.size)
    for _ in range(200):
        K, r = balance(x)
        if not np.any(r):
            return x
        if np.abs(np.linalg.eigvalsh(K)).min() < 1e-13 * np.abs(K).max():
            return None
        step = np.linalg.solve(K, r)
        if np.linalg.norm(step) <= 1e-13 * np.linalg.norm(x):
            return x
        if along(1.0, x, step) < -1e-9 * along(0.0, x, step):  # beyond the least energy on this way, which is convex
            step = step * brentq(along, 0.0, 1.0, (x, step), xtol=1e-15)
        x = x + step
    return None


# -- inputs ------------------------------------------------------------------------------------------------------------

NOTHING = (np.zeros(1), np.zeros(0), np.zeros((0, 0)), np.zeros((0, 0)), np.zeros(2), np.zeros((0, 1, 1)))


def sines(amplitude, omega, phase, quantity):
    """A force, or the base's acceleration, velocity and displacement without drift, from sines of one of them."""
    amplitude, omega, phase = (np.atleast_1d(np.asarray(x, dtype=float)) for x in (amplitude, omega, phase))
    if quantity == "force":
        amplitudes, phases = np.array([amplitude, amplitude * omega]), np.array([phase, phase + np.pi / 2])
        return Inputs(0, np.zeros(1), omega, amplitudes, phases, np.zeros(2), np.zeros((2, 1, 1)))
    power = {"acceleration": 0, "velocity": 1, "displacement": 2, "rotation": 2}[quantity.removeprefix("angular_")]
    amplitudes = np.array([amplitude * omega ** (power - i) for i in range(3)])
    phases = np.array([phase + (power - i) * np.pi / 2 for i in range(3)])
    return Inputs(0, np.zeros(1), omega, amplitudes, phases, np.zeros(2), np.zeros((3, 1, 1)))


def pieces(spline, quantity, start=(0.0, 0.0), kink=True):
    """The same from a spline of the force or acceleration, with the velocity and displacement at its start."""
    if quantity == "force":
        curves = [spline]
    else:
        velocity = _from(spline.antiderivative(), start[0])
        curves = [spline, velocity, _from(velocity.antiderivative(), start[1])]
    most = max(curve.c.shape[0] for curve in curves)
    table = np.array([np.vstack([np.zeros((most - curve.c.shape[0], curve.c.shape[1])), curve.c]) for curve in curves])
    empty = np.zeros((len(curves), 0))
    return Inputs(3, np.zeros(1), np.zeros(0), empty, empty, spline.x, table, spline.x[1:-1])


def _from(curve, value):
    c = curve.c.copy()
    c[-1] += value
    return PPoly(c, curve.x)


def random_lines(spec, duration):
    """Frequencies (rad/s), amplitudes and phases of the sines with the density of the table, cos(w t + phase)."""
    points = np.array([(p["frequency"], p["density"]) for p in spec["psd"]])
    period = spec.get("period", duration)
    count = int(np.ceil(period * spec.get("sample_rate", 20 * points[-1, 0])))
    f = np.arange(count // 2 + 1) / period
    phase = np.random.default_rng(spec.get("seed", 0)).uniform(0, 2 * np.pi, f.size)
    node, weight = np.polynomial.legendre.leggauss(12)
    square = np.zeros(f.size)  # mean square of each sine: the integral of the density over its share of the axis
    for k in range(1, f.size):
        low, high = np.clip([(k - 0.5) / period if k > 1 else 0.0, (k + 0.5) / period], points[0, 0], points[-1, 0])
        ends = np.unique([low, *(x for x in points[:, 0] if low < x < high), high])
        for a, b in pairwise(ends):
            x = 0.5 * (a + b) + 0.5 * (b - a) * node
            density = np.exp(np.interp(np.log(x), np.log(points[:, 0]), np.log(points[:, 1])))
            square[k] += 0.5 * (b - a) * weight @ density
    used = square > 0.0
    return 2 * np.pi * f[used], np.sqrt(2 * square[used]), phase[used], count / period


def several(forces):
    """Forces that are sines, then their rates, as one input."""
    omega = np.concatenate([force.omega for force in forces])
    amplitude, phase = np.zeros((2, 2 * len(forces), omega.size))
    ends = np.cumsum([0, *(force.omega.size for force in forces)])
    for i, force in enumerate(forces):
        for j in range(2):
            amplitude[i + j * len(forces), ends[i] : ends[i + 1]] = force.amplitude[j]
            phase[i + j * len(forces), ends[i] : ends[i + 1]] = force.phase[j]
    count = 2 * len(forces)
    return Inputs(0, np.zeros(1), omega, amplitude, phase, np.zeros(2), np.zeros((count, 1, 1)))


def inputs_of(case, duration):
    spec = case.get("excitation", {"kind": "none"})
    kind = spec["kind"]
    if kind == "none":
        return Inputs(0, *NOTHING[:1], np.zeros(0), *NOTHING[2:])
    if kind == "forces":
        return several([inputs_of({"excitation": force}, duration) for force in spec["forces"]])
    force = spec["applied_to"] != "base"
    quantity = "force" if force else spec.get("quantity", "acceleration")
    C = 1 if force else 3
    empty = np.zeros((C, 0))
    if kind == "harmonic":
        return sines(spec["level"], 2 * np.pi * spec["frequency"], spec.get("phase", 0.0), quantity)
    if kind == "multi_tone":
        columns = [[tone.get(key, 0.0) for tone in spec["tones"]] for key in ("level", "frequency", "phase")]
        return sines(columns[0], 2 * np.pi * np.array(columns[1]), columns[2], quantity)
    if kind == "step":
        numbers = np.array([spec["level"], spec.get("time", 0.0)])
        return Inputs(1, numbers, np.zeros(0), empty, empty, np.zeros(2), np.zeros((C, 1, 1)), numbers[1:])
    if kind == "half_sine":
        numbers = np.array([spec["level"], spec.get("time", 0.0), spec["duration"]])
        breaks = np.cumsum(numbers[1:])
        return Inputs(2, numbers, np.zeros(0), empty, empty, np.zeros(2), np.zeros((C, 1, 1)), breaks)
    if kind == "swept_sine":
        rate = float(spec["rate"].split()[0]) * np.sign(spec["to"] - spec["from"])
        numbers = np.array([spec["level"], spec["from"], rate, spec.get("phase", 0.0)])
        return Inputs(4, numbers, np.zeros(0), empty, empty, np.zeros(2), np.zeros((C, 1, 1)))
    if kind == "sampled":
        time, values = np.loadtxt(spec["file"], delimiter=",", skiprows=1).T
        return pieces(CubicSpline(time - time[0], values), quantity)
    omega, amplitude, phase, rate = random_lines(spec, duration)
    count = round(spec.get("period", duration) * rate)
    index = np.arange(-40, max(count, int(np.ceil(duration * rate))) + 41)  # a spline's ends are felt by few samples
    whole = CubicSpline(index, np.cos(np.outer(index / rate, omega) + phase) @ amplitude)  # over the sample number
    rise = whole.antiderivative(2)  # of the displacement, in squares of a step; it is the same a period later
    velocity = -(float(rise(count) - rise(0)) - count * float(rise(0, 1))) / count / rate
    curve = PPoly(whole.c[:, 40:-40] * rate ** np.arange(3.0, -1.0, -1)[:, None], whole.x[40:-40] / rate)
    return pieces(curve, quantity, (velocity, -np.sum(amplitude / omega**2 * np.cos(phase))))


# -- the whole ---------------------------------------------------------------------------------------------------------


def model_of(case, duration):
    """The equations of a scenario; None where its start asks for an equilibrium that is not found."""
    structure = Structure(case)
    inputs = inputs_of(case, duration)
    constant = -case.get("gravity", 0.0) * structure.modal(structure.inertia)
    for force in case.get("constant_forces", ()):
        constant = constant + force["force"] * structure.row(force)
    spec = case.get("excitation", {"kind": "none"})
    loads = np.zeros((inputs.count, structure.omega.size))
    for i, force in enumerate(spec.get("forces", [spec] if inputs.count in (1, 2) else [])):
        loads[i] = structure.row(force["applied_to"])
    if inputs.count == 3:
        loads[0], loads[2] = -structure.modal(structure.driven), structure.modal(structure.ground)
    contacts, preloads = contacts_of(case, structure)
    if any(p is not None for p in preloads):
        x = equilibrium(structure, contacts, constant, np.array([np.nan if p is None else p for p in preloads]))
        if x is None:
            return None
        for i, (contact, preload) in enumerate(zip(contacts, preloads, strict=True)):
            if preload is not None:
                gap = -preload / contact.stiffness - contact.sign * (contact.row @ x)
                contacts[i] = Contact(**{**vars(contact), "gap": gap})
    x, v = np.zeros((2, structure.omega.size))
    start = case.get("run", {}).get("start", "static_equilibrium")
    if start == "static_equilibrium":
        x = equilibrium(structure, contacts, constant)
    elif "released_force" in start:
        force = start["released_force"]
        x = equilibrium(structure, contacts, constant + force["force"] * structure.row(force))
    elif start != "rest":
        body = next(iter(structure.bodies.values()))
        x = structure.coordinates(body.field(start.get("displacement", ())))
        v = structure.coordinates(body.field(start.get("velocity", ())))
    if x is None:
        return None
    probes = {p["name"]: structure.row(p) for p in case["probes"]}
    return Model(
        structure.omega, structure.damping, constant, loads, tuple(contacts), probes, inputs, np.concatenate([x, v])
    )


@dataclass
class Equations:
    """A model in the scaled state y = (w x, x', faces w p), w the largest frequency of the open structure."""

    model: Model
    late: float = 0.0  # m for a unit row: by how much a penetration has passed zero where a contact begins or ends

    def __post_init__(self):
        m = self.model
        self.n = m.omega.size
        ends = np.cumsum([2 * self.n, *(c.of.states for c in m.contacts)])
        self.inside = [slice(a, b) for a, b in pairwise(ends)]  # states of each contact
        self.N = int(ends[-1])
        self.scale = max(float(m.omega.max()), 1e-3 * float(self.stiffest()))
        self.U = m.inputs.count + 1

    def stiffest(self):
        m = self.model
        return np.sqrt(np.max(m.omega) ** 2 + sum(c.stiffness * (c.row @ c.row) for c in m.contacts))

    def penetration(self, contact):
        """Rows of delta (or stretch) and of its rate over y and u."""
        n, N = self.n, self.N
        sign = -contact.sign
        row, rate = np.zeros((2, N + self.U))
        row[:n], rate[n : 2 * n] = sign * contact.row / self.scale, sign * contact.row
        row[N] = -contact.gap
        if self.U == 4:
            row[N + 3] = rate[N + 2] = sign * contact.felt
        return row, rate

    def combined(self, i, of_law):
        """Row over y and u of a row of a contact's penetration, its rate, 1 and its own states."""
        row, rate = self.penetration(self.model.contacts[i])
        row = of_law[0] * row + of_law[1] * rate
        row[self.N] += of_law[2]
        row[self.inside[i]] += of_law[3:] / self.scale
        return row

    def linear(self, phases):
        """The equations of one contact state."""
        m, n, N, s = self.model, self.n, self.N, self.scale
        # in extended precision: a stiff stop acts along its own row alone, to more than the round-off of its stiffness
        rates = np.zeros((N, N + self.U), dtype=np.longdouble)
        rates[:n, n : 2 * n] = s * np.eye(n)
        rates[n : 2 * n, :n] = -np.diag(m.omega**2) / s
        rates[n : 2 * n, n : 2 * n] = -m.damping
        rates[n : 2 * n, N] = m.constant
        rates[n : 2 * n, N + 1 :] = m.loads.T
        for i, phase in enumerate(phases):
            c = m.contacts[i]
            direction = np.asarray(c.sign * c.row, dtype=np.longdouble)
            rates[n : 2 * n] += np.outer(direction, self.combined(i, c.of.force(phase)))
            for k, row in enumerate(c.of.rates(phase), self.inside[i].start):
                rates[k] = s * self.combined(i, row)
        holding = {}
        stuck = [i for i, phase in enumerate(phases) if isinstance(m.contacts[i].of, RigidFriction) and phase == 0]
        if stuck:  # no acceleration along their rows
            rows = np.array([m.contacts[i].row for i in stuck])
            forces = np.linalg.solve(rows @ rows.T, rows) @ rates[n : 2 * n].astype(float)
            rates[n : 2 * n] -= rows.T @ forces
            holding = dict(zip(stuck, forces, strict=True))
        guards = [guard for i, phase in enumerate(phases) for guard in self.guards(i, phase, holding.get(i))]
        rows, *numbers, resets = zip(*guards, strict=True) if guards else ((),) * 5
        numbers = (np.array(number, dtype=np.int64) for number in numbers)
        rows, resets = (np.reshape(row, (-1, N + self.U)) for row in (rows, resets))
        return Linear(rates[:, :N], rates[:, N:], rows, *numbers, resets, self.watches(phases))

    def guards(self, i, phase, holding=None):
        """(row over y and u, contact, next phase, entry that starts anew, row of its value) of each of its guards."""
        c = self.model.contacts[i]
        nothing, one = np.zeros(self.N + self.U), np.eye(self.N + self.U)[self.N]
        if holding is not None:  # the force that rigid friction resists with
            limit = c.of.static_limit * one
            return [(limit - sign * holding, i, k, -1, nothing) for k, sign in ((1, 1.0), (2, -1.0))]
        found = []
        late = self.late * np.linalg.norm(c.row) * one
        for leave in c.of.exits(phase):
            entry, value = -1, nothing
            if leave.state >= 0:
                entry, value = self.inside[i].start + leave.state, self.scale * self.combined(i, leave.value)
            found.append((self.combined(i, leave.row) + leave.late * late, i, leave.following, entry, value))
        return found

    def watches(self, phases):
        """Rows of what is sought the maximum of: each probe's displacement up and down, each one-sided force."""
        rows = []
        for row in self.model.probes.values():
            whole = np.zeros(self.N + self.U)
            whole[: self.n] = row / self.scale
            rows += [whole, -whole]
        contacts = enumerate(self.model.contacts)
        return np.array(rows + [self.combined(i, c.of.force(phases[i])) for i, c in contacts if c.of.pushes])

    def start(self):
        m = self.model
        y = np.zeros(self.N)
        y[: self.n], y[self.n : 2 * self.n] = self.scale * m.start[: self.n], m.start[self.n :]
        return y

    def starting_phases(self, longest):
        """From the penetration; where that is zero, from the motion a little later, the contact being open."""
        m, y, close = self.model, self.start(), []

        def phases_of(whole):
            found = []
            for i, c in enumerate(m.contacts):
                row, rate = self.penetration(c)
                value, size = float(row @ whole), float(np.abs(row) @ np.abs(whole))
                if any(abs(value - knot) - 1e-13 * abs(knot) <= 1e-13 * size for knot in c.of.knots):
                    close.append(i)
                found.append(c.of.phase_at(value, float(rate @ whole)))
            return found

        phases = phases_of(np.append(y, m.inputs.at(0.0)))
        if close:
            undecided = tuple(close)
            later = [0 if i in close and m.contacts[i].of.pushes else phase for i, phase in enumerate(phases)]
            after = phases_of(shortly(self.linear(later), m.inputs, longest, y))
            for i in undecided:
                phases[i] = after[i]
        return phases

    def move(self, stops, longest, most_steps):
        """The motion through the stops."""
        return integrate(
            self.linear, self.model.inputs, longest, self.start(), self.starting_phases(longest), stops, most_steps,
            self.stiffest(),
        )  # fmt: skip

    def perturbed(self, size, motion, draw=1):
        """The same with all numbers changed by so much of their values, and contacts that change late.

        They change where the penetration has passed zero by the round-off of the motion. What is zero stays zero.
        """
        rng = np.random.default_rng(draw)

        def changed(values):
            return values * (1 + size * rng.choice([-1.0, 1.0], np.shape(values)))

        m = self.model
        contacts = tuple(
            replace(c, gap=float(changed(c.gap)), of=c.of.changed(changed), row=changed(c.row)) for c in m.contacts
        )
        numbers = {name: changed(getattr(m, name)) for name in ("omega", "constant", "loads", "start")}
        largest = np.linalg.norm(motion.y[:, : self.n], axis=1).max(initial=0.0) / self.scale
        return Equations(replace(m, contacts=contacts, **numbers), late=ROUND_OFF * largest)

    def displacement(self, y, probe):
        return y[..., : self.n] @ self.model.probes[probe] / self.scale

    def whole(self, motion):
        """(nt, N + U) states and inputs."""
        return np.hstack([motion.y, np.array([self.model.inputs.at(t) for t in motion.time]).reshape(-1, self.U)])

    def stored(self, motion):
        """(nt,) kinetic and elastic energy, contacts included."""
        m, n = self.model, self.n
        x, v = motion.y[:, :n] / self.scale, motion.y[:, n : 2 * n]
        total = 0.5 * np.sum(v**2, axis=1) + 0.5 * np.sum((m.omega * x) ** 2, axis=1)
        whole = self.whole(motion)
        for i, c in enumerate(m.contacts):
            delta = whole @ self.penetration(c)[0]
            states = motion.y[:, self.inside[i]] / self.scale
            total += [c.of.stored(*each) for each in zip(motion.phases[:, i], delta, states, strict=True)]
        return total

    def periods(self):
        """Shortest and longest period of the open structure that counts, s; the shortest of the inputs with it."""
        m = self.model
        moving = m.omega[m.omega > 0]
        i = m.inputs
        drive = 0.0
        if i.kind == 0 and i.omega.size:
            drive = float(i.omega.max())
        elif i.kind == 2:
            drive = np.pi / i.numbers[2]
        elif i.kind == 4:
            drive = 2 * np.pi * max(i.numbers[1], i.numbers[1] + i.numbers[2])
        slow = moving.min() if moving.size else self.stiffest()
        fast = max(m.omega.max(), drive) or slow
        return 2 * np.pi / fast, 2 * np.pi / slow
