"""Random assemblies: two to four bodies, a joint, stops of every law on and between them, and a harmonic excitation."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from beamsim.scenario import load_scenario
from beamsim.scenario.base import Path

LAWS = ("spring", "dashpot", "ratio", "no_tension", "table", "maxwell", "hardening", "unloading", "latch")
MOVES = ("base", "base", "turning", "turning", "force", "forces", "support", "support")
"""Kinds of excitation by how often they are drawn."""


class Assembly:
    """A random scenario, ``data``, as it would be written."""

    def __init__(self, seed: int, moves: str | None = None) -> None:
        self.rng = np.random.default_rng(seed)
        self.moves = str(self.rng.choice(MOVES)) if moves is None else moves
        self.lengths = dict(zip(("arm", "flap"), self.rng.uniform(0.25, 0.5, 2).round(3).tolist(), strict=True))
        self.data: dict[str, Any] = {"reduction": {"modes": "all"}}
        self._bodies()
        self.data["snubbers"] = [self._snubber(f"s{k}") for k in range(int(self.rng.integers(2, 4)))]
        self._others()
        self.data["excitation"] = self._excitation()
        self.data["outputs"] = [
            {"name": "push", "kind": "reaction_force", "support": "left", "body": "arm"},
            {"name": "lift", "kind": "displacement", "at": self.place("flap")},
        ]

    def often(self, share: float) -> bool:
        """True in this share of the assemblies."""
        return bool(self.rng.random() < share)

    def place(self, body: str) -> dict[str, Any]:
        """A place of a body where it can deflect."""
        if body == "cart":
            return {"body": body, "mass": 2}
        if body == "deck":
            return {"body": body, "position": [0.3, 0.1]}
        return {"body": body, "position": round(float(self.rng.uniform(0.3, 0.9)) * self.lengths[body], 4)}

    def _beam(self, name: str, supports: dict[str, str]) -> dict[str, Any]:
        damping = ({"kind": "modal", "ratio": 0.05}, {"kind": "rayleigh", "stiffness": 1e-5, "mass": 1.0},
                   {"kind": "viscous", "coefficient": 3.0})[self.rng.integers(3)]  # fmt: skip
        return {
            "kind": "beam", "length": self.lengths[name], "width": 0.04,
            "thickness": float(self.rng.uniform(4e-3, 7e-3)), "youngs_modulus": 70e9, "density": 2700.0,
            "elements": 2, "supports": supports, "damping": damping,
        }  # fmt: skip

    def _bodies(self) -> None:
        """An arm, a flap that is joined to it or stands beside it, and perhaps a chain and a plate."""
        rigid, turns = self.moves == "turning", 150.0
        kind = str(self.rng.choice(["rigid", "hinge", "spring", *([] if rigid else ["none"])]))
        self.joined = kind != "none"
        free, pinned = ({"left": end, "right": end} for end in ("free", "pinned"))
        bodies = {
            "arm": self._beam("arm", {"left": "clamped"}),
            "flap": self._beam("flap", free if self.joined else pinned),
        }
        ends = [{"body": "arm", "position": self.lengths["arm"]}, {"body": "flap", "position": 0.0}]
        ways: dict[str, Any] = {
            "rigid": {}, "hinge": {"rotational_stiffness": turns, "rotational_dashpot": 0.05},
            "spring": {"stiffness": 5e4, "dashpot": 2.0, "rotational_stiffness": turns},
        }  # fmt: skip
        if self.joined:
            joint = {"name": "root", "kind": kind, "between": ends, **ways[kind]}
            if kind == "hinge" and self.often(0.5):
                joint["stops"] = [{"name": "end", "angle": 0.01, "side": "above", "stiffness": 300.0}]
            self.data["joints"] = [joint]
        if not rigid and self.often(0.5):
            bodies["cart"] = {"kind": "chain", "masses": [1.0, 2.0], "springs": [4e4, 3e4, 5e4], "dashpots": [5.0] * 3}
        if not rigid and self.often(0.3):
            bodies["deck"] = {
                "kind": "plate", "length": 0.3, "width": 0.2, "thickness": 3e-3, "youngs_modulus": 70e9,
                "density": 2700.0, "poissons_ratio": 0.3, "elements": [2, 2], "supports": {"left": "clamped"},
            }  # fmt: skip
        self.data["bodies"] = bodies

    def _law(self) -> dict[str, Any]:
        k, kind = float(10 ** self.rng.uniform(3, 5)), str(self.rng.choice(LAWS))
        dashpot = {"damping": {"kind": "viscous", "coefficient": 4.0}}
        law: dict[str, Any] = {
            "spring": {}, "dashpot": dashpot, "ratio": {"damping": {"kind": "ratio", "ratio": 0.03}},
            "no_tension": {"law": "no_tension", **dashpot}, "latch": {"latch": True},
            "table": {"force_deflection": [[0, 0], [1e-4, 1e-4 * k], [1e-3, 3e-3 * k]]},
            "maxwell": {"maxwell": [{"stiffness": 0.5 * k, "relaxation_time": 0.01}]},
            "hardening": {"hardening": {"yield_force": 1e-4 * k, "stiffness": 0.2 * k}},
            "unloading": {"unloading": {"stiffness": 3 * k}},
        }[kind]  # fmt: skip
        stiffness = {} if kind == "table" else {"stiffness": k}
        return {"gap": float(self.rng.choice([0.0, 1e-4, -2e-5])), **stiffness, **law}

    def _snubber(self, name: str) -> dict[str, Any]:
        bodies = list(self.data["bodies"])
        if self.often(0.3):
            first, second = self.rng.choice(bodies, 2, replace=False)
            resists = str(self.rng.choice(["approach", "separation"]))
            return {"name": name, "between": [self.place(first), self.place(second)], "resists": resists, **self._law()}
        at = self.place(self.rng.choice(bodies[:2] if self.often(0.7) else bodies))
        side = str(self.rng.choice(["below", "above", "both"]))
        return {
            "name": name,
            "at": at,
            "side": side,
            "mounted_on": str(self.rng.choice(["base", "ground"])),
            **self._law(),
        }

    def _others(self) -> None:
        """Springs, friction, and constant loads."""
        data = self.data
        if self.often(0.4):
            data["springs_to_ground"] = [{"kind": "linear", "at": self.place("flap"), "stiffness": 2e3}]
        if self.often(0.3):
            between = [self.place("arm"), self.place("flap")]
            curve = {"breakpoints": [1e-4], "stiffnesses": [1e3, 3e3]}
            data["springs_between"] = [{"kind": "piecewise_linear", "between": between, **curve}]
        if self.often(0.3):
            data["gravity"] = 9.81
        if self.often(0.3):
            data["constant_forces"] = [{"at": self.place("flap"), "force": 2.0}]
        pressing = [s["name"] for s in data["snubbers"] if s.get("side") in ("below", "above")
                    and not s.keys() & {"damping", "maxwell", "hardening", "unloading", "latch"}]  # fmt: skip
        friction = {"coefficient": 0.3, "stiffness": 2e4}
        if pressing and self.often(0.6):
            force = {"snubber": pressing[0]}
            data["friction"] = [{"name": "rub", "at": self.place("flap"), "normal_force": force, **friction}]
        elif self.often(0.3):
            between = [self.place("arm"), self.place("flap")]
            data["friction"] = [{"name": "pad", "between": between, "normal_force": 3.0, **friction}]

    def _excitation(self) -> dict[str, Any]:
        sine = {"kind": "harmonic", "frequency": round(float(self.rng.uniform(15, 60)), 2)}
        level = lambda *levels: str(self.rng.choice(levels))  # noqa: E731
        root = {"support": "left", "body": "arm"}
        if self.moves == "forces":
            on = [{**sine, "applied_to": self.place(name), "level": 8.0} for name in self.lengths]
            return {"kind": "forces", "forces": [on[0], {**on[1], "phase": "30 deg"}]}
        if self.moves == "turning":
            about = {"about": "150 mm"} if self.often(0.5) else {}
            return {**sine, "applied_to": "base", "direction": "ry", **about, "level": level("60 rad/s^2", "1e-3 rad")}
        if self.moves == "base":
            return {**sine, "applied_to": "base", "level": level("1 g", "0.2 mm", "0.1 m/s")}
        if self.moves == "support":
            return {**sine, "applied_to": root, "level": level("1 g", "0.3 mm", "0.1 m/s")}
        return {**sine, "applied_to": self.place("flap"), "level": 10.0}


def parameters(data: dict[str, Any]) -> Iterator[tuple[dict[str, Any], Path]]:
    """What a continuation of an assembly can go along, as ``continue_in`` is written, and the path of that number."""
    scenario = load_scenario(data)
    excitation, several = scenario.excitation, data["excitation"]["kind"] == "forces"
    yield {"kind": "frequency", "from": 0.8 * excitation.frequency, "to": 1.2 * excitation.frequency}, ()
    level = excitation.level
    yield {"kind": "level", "from": 0.5 * level, "to": 2.0 * level}, () if several else ("excitation", "level")
    for path, _, snubber, bodies in scenario.listed("snubbers"):
        if path[0] == "joints":
            continue  # stops of hinges are varied in studies
        named = {"snubber": snubber.name}
        yield {"kind": "gap", "from": -1e-5, "to": 3e-4, **named}, (*path, "gap")
        if snubber.stiffness is not None:
            k = snubber.stiffness
            yield {"kind": "stiffness", "from": 0.5 * k, "to": 2.0 * k, **named}, (*path, "stiffness")
        first, *second = snubber.places
        if not second and isinstance(first.position, float):
            length = bodies[first.body].length
            along = {"kind": "position", "from": 0.35 * length, "to": 0.95 * length, **named}
            yield along, (*path, *snubber.place_paths[0], "position")
