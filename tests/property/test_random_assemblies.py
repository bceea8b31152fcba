"""Random assemblies of beams and chains with joints and snubbers against matrices of their own and time stepping.

The second opinion assembles each body from the textbook's elements, joins them by the null space of the constraints,
and integrates with restarts at every contact (`tests/helpers/independent.py`).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from independent import Beam, Stop, Structure, chain, integrate
from scipy.linalg import block_diag, eigh, null_space

import beamsim
from beamsim.scenario import load_scenario

WIDTH, THICKNESS, MODULUS, DENSITY = 0.04, 0.004, 70e9, 2700.0
DURATION, RATE = 0.08, 2000.0


@dataclass(frozen=True)
class Member:
    """A body: what the scenario says, its matrices and the row of a deflection or slope."""

    section: dict[str, Any]
    structure: Structure
    own: Any  # the textbook beam; None for a chain
    length: float

    def row(self, place: float, slope: bool = False) -> np.ndarray:
        """For a unit of each degree of freedom; a place of a chain is a number from 1."""
        if self.own is None:
            return np.eye(len(self.structure.inertia))[int(place) - 1]
        if not slope:
            return np.asarray(self.own.row(place))
        whole = np.zeros(2 * self.own.elements + 2)
        whole[2 * round(place / self.own.h) + 1] = 1.0
        return np.asarray(whole[self.own.free])


class Assembly:
    """A random case, as a scenario and as matrices."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.rng = rng
        self.members = {f"body{i}": self._beam(clamped=i == 0) for i in range(rng.integers(2, 4))}
        if rng.random() < 0.5:
            self.members["masses"] = self._chain()
        sizes = [len(member.structure.inertia) for member in self.members.values()]
        self.starts = dict(zip(self.members, np.cumsum([0, *sizes[:-1]]), strict=True))
        self.size = sum(sizes)
        structures = [member.structure for member in self.members.values()]
        self.mass, self.damping, self.stiffness = (
            block_diag(*(getattr(each, name) for each in structures)) for name in ("mass", "damping", "stiffness")
        )
        inertia = np.concatenate([each.inertia for each in structures])
        self.held: list[np.ndarray] = []
        self.joints = self._joints()
        basis = null_space(np.array(self.held)) if self.held else np.eye(self.size)
        self.basis = basis
        self.structure = Structure(
            *(basis.T @ matrix @ basis for matrix in (self.mass, self.damping, self.stiffness)), basis.T @ inertia
        )
        self.stops: list[Stop] = []
        self.snubbers = [self._snubber(k) for k in range(rng.integers(1, 4))]
        self.level, self.frequency = float(rng.uniform(5.0, 40.0)), float(rng.uniform(15.0, 60.0))
        self.probes = {name: self._somewhere(name) for name in self.members}

    def _beam(self, clamped: bool) -> Member:
        rng = self.rng
        length, elements = float(rng.uniform(0.3, 0.6)), int(rng.integers(2, 4))
        left = "clamped" if clamped else str(rng.choice(["free", "free", "pinned", "clamped"]))
        own = Beam(length, WIDTH, THICKNESS, MODULUS, DENSITY, elements, left)
        a, b = float(rng.uniform(1.0, 10.0)), float(rng.uniform(1e-6, 1e-5))
        section = {
            "kind": "beam", "length": length, "width": WIDTH, "thickness": THICKNESS, "youngs_modulus": MODULUS,
            "density": DENSITY, "elements": elements, "supports": {"left": left, "right": "free"},
            "damping": {"kind": "rayleigh", "mass": a, "stiffness": b},
        }  # fmt: skip
        return Member(section, Structure(own.M, a * own.M + b * own.K, own.K, own.inertia), own, length)

    def _chain(self) -> Member:
        masses, springs, dashpots = (self.rng.uniform(*r, size=n).tolist() for r, n in
                                     (((0.1, 0.5), 2), ((5e3, 2e4), 2), ((0.1, 2.0), 2)))  # fmt: skip
        springs, dashpots = [*springs, 0.0], [*dashpots, 0.0]
        section = {"kind": "chain", "masses": masses, "springs": springs, "dashpots": dashpots}
        return Member(section, chain(masses, springs, dashpots), None, 2.0)

    def _whole(self, name: str, place: float, slope: bool = False) -> np.ndarray:
        row = np.zeros(self.size)
        of_body = self.members[name].row(place, slope)
        row[self.starts[name] : self.starts[name] + of_body.size] = of_body
        return row

    def _node(self, name: str) -> float:
        """A node of a beam that moves, or a mass."""
        member = self.members[name]
        if member.own is None:
            return float(self.rng.integers(1, 3))
        first = 0 if member.section["supports"]["left"] == "free" else 1
        return float(self.rng.integers(first, member.own.elements + 1) * member.own.h)

    def _somewhere(self, name: str) -> float:
        """Anywhere on a body but close to its supports."""
        member = self.members[name]
        return self._node(name) if member.own is None else float(member.length * self.rng.uniform(0.3, 1.0))

    def _at(self, name: str, place: float) -> dict[str, Any]:
        return (
            {"body": name, "mass": int(place)} if self.members[name].own is None else {"body": name, "position": place}
        )

    def _joints(self) -> list[dict[str, Any]]:
        """Each body to the one before it, rigid, by a hinge or springs, or not at all where its supports hold it."""
        rng, joints = self.rng, []
        names = list(self.members)
        for before, name in pairwise(names):
            points = self._node(before), self._node(name)
            between = [self._at(before, points[0]), self._at(name, points[1])]
            deflection = self._whole(name, points[1]) - self._whole(before, points[0])
            if self.members[name].own is None:
                joints.append({"kind": "hinge", "between": between})
                self.held.append(deflection)
                continue
            clamped = self.members[name].section["supports"]["left"] == "clamped"
            kind = str(rng.choice(["rigid", "hinge", "spring", *(["none"] if clamped else [])]))
            if kind == "none":
                continue
            slope = self._whole(name, points[1], True) - self._whole(before, points[0], True)
            joint: dict[str, Any] = {"kind": kind, "between": between}
            if kind != "spring":
                self.held.append(deflection)
            if kind == "rigid":
                self.held.append(slope)
            else:
                joint |= {"rotational_stiffness": rng.uniform(20.0, 200.0), "rotational_dashpot": rng.uniform(0.0, 0.1)}
                self.stiffness += joint["rotational_stiffness"] * np.outer(slope, slope)
                self.damping += joint["rotational_dashpot"] * np.outer(slope, slope)
            if kind == "spring":
                joint |= {"stiffness": rng.uniform(5e3, 5e4), "dashpot": rng.uniform(0.0, 5.0)}
                self.stiffness += joint["stiffness"] * np.outer(deflection, deflection)
                self.damping += joint["dashpot"] * np.outer(deflection, deflection)
            joints.append(joint)
        return joints

    def _snubber(self, number: int) -> dict[str, Any]:
        rng = self.rng
        stiffness, dashpot, gap = (float(rng.uniform(*r)) for r in ((1e4, 1e5), (0.0, 20.0), (1e-4, 1e-3)))
        snubber: dict[str, Any] = {
            "name": f"stop{number}", "stiffness": stiffness, "gap": gap,
            "damping": {"kind": "viscous", "coefficient": dashpot},
        }  # fmt: skip
        first = str(rng.choice(list(self.members)))
        place = self._somewhere(first)
        row = self._whole(first, place)
        if rng.random() < 0.4:
            second = str(rng.choice([name for name in self.members if name != first]))
            other = self._somewhere(second)
            snubber["between"] = [self._at(first, place), self._at(second, other)]
            row, sides = row - self._whole(second, other), (-1.0,)
        else:
            side = str(rng.choice(["below", "above", "both"]))
            snubber |= {"at": self._at(first, place), "side": side}
            sides = {"below": (1.0,), "above": (-1.0,), "both": (-1.0, 1.0)}[side]
        for sign in sides:
            self.stops.append(Stop(self.basis.T @ row, stiffness, dashpot, gap, sign))
        return snubber

    def scenario(self, backwards: bool = False) -> dict[str, Any]:
        names = list(self.members)
        return {
            "bodies": {name: self.members[name].section for name in (reversed(names) if backwards else names)},
            "joints": self.joints,
            "snubbers": self.snubbers,
            "probes": [{"name": name, "at": self._at(name, place)} for name, place in self.probes.items()],
            "excitation": {"kind": "harmonic", "applied_to": "base", "level": self.level, "frequency": self.frequency},
            "reduction": {"modes": "all"},
            "run": {"duration": DURATION, "sample_rate": RATE, "start": "rest", "convergence": "off"},
        }

    def stepped(self, times: np.ndarray) -> Any:
        omega = 2 * np.pi * self.frequency
        return integrate(
            self.structure, self.stops, lambda t: -self.structure.inertia * self.level * np.sin(omega * t),
            np.zeros(2 * self.basis.shape[1]), times, most_step=2e-4, rtol=1e-11,
        )  # fmt: skip


def compare(seed: int) -> int:
    """Frequencies, motions of all probes and contacts; returns how many contacts began or ended."""
    assembly = Assembly(seed)
    case = assembly.scenario()
    if not case["joints"]:
        del case["joints"]
    result = beamsim.run(load_scenario(case))
    expected = np.sqrt(eigh(assembly.structure.stiffness, assembly.structure.mass, eigvals_only=True)) / (2 * np.pi)
    np.testing.assert_allclose(np.sort(result.modes.open_frequencies_hz), expected, rtol=1e-8)
    motion = assembly.stepped(result.time)
    assert result.summary["events"] == motion.event_time.size
    n = assembly.basis.shape[1]
    for name, place in assembly.probes.items():
        history = motion.state[:, :n] @ (assembly.basis.T @ assembly._whole(name, place))
        np.testing.assert_allclose(
            result.probes[name].displacement, history, rtol=0, atol=2e-7 * np.abs(history).max(), err_msg=name
        )
    turned = beamsim.run(load_scenario({**case, "bodies": assembly.scenario(backwards=True)["bodies"]}))
    for name in assembly.probes:
        size = np.abs(result.probes[name].displacement).max()
        np.testing.assert_allclose(
            turned.probes[name].displacement, result.probes[name].displacement, rtol=0, atol=1e-9 * size
        )
    return int(motion.event_time.size)


def test_random_assemblies_against_integration() -> None:
    assert compare(1) > 10


@pytest.mark.slow
def test_more_random_assemblies_against_integration() -> None:
    """Thousands of others, with links of every kind: `tests/attack`."""
    assert sum(compare(seed) for seed in (0, *range(2, 18))) > 140
