"""Steady motions of one beam and of two bodies, in the coordinates of `own_model`: the package is not imported here."""

import numpy as np
from own_chain import OwnChain
from own_model import Structure, contacts_of


def random_structure(seed):
    """A scenario as a mapping: a beam, or one with a chain or a second beam, one or two stops, a base that moves."""
    rng = np.random.default_rng([seed, 79])
    chance = rng.random()
    if chance < 0.6:
        beam = _beam(rng, ("clamped", "pinned"))
        case = {"beam": beam, "probes": [{"name": "probe", **_place(beam, rng)}]}
        places = [_place(beam, rng) for _ in range(2)]
    else:
        one = _beam(rng, ("clamped",))
        k = _stiffness(one)
        two = _beam(rng, ("clamped",))
        if chance < 0.8:
            m = one["mass_per_length"] * one["length"]
            two = {
                "masses": [m * rng.uniform(0.3, 1), m * rng.uniform(0.1, 1)],
                "springs": [k, k * rng.uniform(0.2, 2)],
            }
            two["dashpots"] = [0.04 * np.sqrt(k * m), 0.04 * np.sqrt(k * m)]
        bodies = {"one": one, "two": two}
        places = [{"at": {"body": name, **_place(spec, rng)}} for name, spec in bodies.items()]
        case = {
            "bodies": {name: {"kind": "chain" if "masses" in s else "beam", **s} for name, s in bodies.items()},
            "probes": [{"name": name, **place} for name, place in zip(bodies, places, strict=True)],
        }
        if rng.random() < 0.5:
            joint = {"name": "joint", "kind": "spring", "between": [place["at"] for place in places]}
            case["joints"] = [joint | {"stiffness": k * rng.uniform(0.1, 3), "dashpot": 0.02 * np.sqrt(k)}]
    case |= {"title": f"structure {seed}", "reduction": {"modes": "all"}, "snubbers": []}
    structure = Structure(case)
    first, size = float(structure.omega[0]), 1e-3
    case["excitation"] = {
        "kind": "harmonic", "frequency": first / (2 * np.pi), "applied_to": "base", "quantity": "acceleration",
        "level": float(size * first**2 * rng.uniform(0.05, 0.4)),
    }  # fmt: skip
    for i in range(int(rng.integers(1, 3))):
        stop = {"name": f"stop_{i + 1}", "gap": float(size * rng.uniform(0.05, 1.0))}
        if "bodies" in case and rng.random() < 0.5:
            stop |= {"between": [p["at"] for p in places], "resists": str(rng.choice(["approach", "separation"]))}
        else:
            stop |= {**places[i], "side": str(rng.choice(["below", "above"]))}
        row = structure.row(stop) if "side" in stop else structure.row(places[1]) - structure.row(places[0])
        soft = float(1 / (row @ (row / structure.omega**2)))
        stop["stiffness"] = soft * 10 ** rng.uniform(-1, 2)
        if rng.random() < 0.5:
            stop["damping"] = {"kind": "viscous", "coefficient": 0.05 * stop["stiffness"] / first * rng.random()}
        case["snubbers"].append(stop)
    return case


def _beam(rng, left):
    length = float(rng.uniform(0.3, 1.5))
    beam = {
        "length": length, "elements": 2, "mass_per_length": float(10 ** rng.uniform(-0.5, 0.5)),
        "bending_stiffness": float(10 ** rng.uniform(0.5, 2.5)),
        "supports": {"left": str(rng.choice(left)), "right": "free"},
    }  # fmt: skip
    if beam["supports"]["left"] == "pinned":
        beam["supports"]["right"] = str(rng.choice(["pinned", "clamped", "guided"]))
    slow = float(np.sqrt(_stiffness(beam) / (beam["mass_per_length"] * length)))
    beam["damping"] = {"kind": "rayleigh", "mass": 0.05 * slow * rng.random(), "stiffness": 0.02 / slow}
    return beam


def _stiffness(beam):
    return 3 * beam["bending_stiffness"] / beam["length"] ** 3


def _place(spec, rng):
    if "masses" in spec:
        return {"mass": int(rng.integers(1, len(spec["masses"]) + 1))}
    whole = spec["supports"]["right"] in ("free", "guided") and rng.random() < 0.5
    return {"position": spec["length"] * (1.0 if whole else 0.5)}


class OwnStructure(OwnChain):
    """The motion of a scenario of `random_structure` at an angular frequency, in mass-normalised coordinates."""

    def __init__(self, case, omega):
        structure = Structure(case)
        self.n, self.omega = structure.omega.size, omega
        self.m, self.K, self.C = np.ones(self.n), np.diag(structure.omega**2), structure.damping
        self.stops = [(c.row, c.sign, c.gap, c.stiffness, c.dashpot) for c in contacts_of(case, structure)[0]]
        self.load, self.base = -structure.modal(structure.driven), 1.0
        self.drive = case["excitation"]["level"] * np.array([1.0, 0.0])
        self.probes = np.array([structure.row(probe) for probe in case["probes"]])
        self._known = {}
