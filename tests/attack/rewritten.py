"""Random scenarios written in other words, which are the same physics: the same result to 1e-9.

A scenario is a shipped config, a system of `random_systems`, or a plate, short and coarse. It is run as
it is, and again

- `shares`: every place as a share of its body's length,
- `absolute`: dashpots for damping ratios, factors for Rayleigh ratios; defaults of shapes, areas and sides written out,
- `units`: every quantity in another unit, chosen at random,
- `renamed`: bodies (one alone is listed among `bodies`) under other names, these and all lists in another order,
- `mirrored`: left and right exchanged, along x on plates; chains from their other end,
- `upside_down`: above and below exchanged,
- `turned`: plates with x and y exchanged,
- `varied`: as a case of an ensemble in which a number of it is another one; the run is that of the edited scenario,
- `stored`: written, read, and run again from the file.

Of one in four a short sweep or continuation near the lowest modes is compared as well, where these follow its
excitation.

What is sensitive to the last digits is not compared: the same run with numbers that differ by 1e-14 tells.
"""

import contextlib
import copy
import math
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from comparison import CHANGED
from random_systems import ASSEMBLIES, MORE, random_case
from scipy.optimize import brentq
from shipped import PATHS, shipped

import beamsim
from beamsim.analyses.sweep.layouts import FOLLOWED
from beamsim.errors import ScenarioError
from beamsim.results.values import peaks_in
from beamsim.scenario.base import as_plain_data, path_text
from beamsim.scenario.parameters import field_type_at
from beamsim.scenario.quantities import LEVEL_DIMENSIONS, LevelType, Quantity
from beamsim.scenario.scenario import named_files
from beamsim.system.build import build_system

AGREED = 1e-9  # of the largest value of a history
SENSITIVE = 1e-11  # change of a history with the last digits of the numbers, above which it is not compared
PERIODS = 4.0  # of the lowest mode
MOST_EVENTS = 400
SWEPT = 4  # seeds to one sweep
CYCLES = 15  # of a sweep, at one frequency where it is stepped
DIGITS = 1e-14
EPSILON = float(np.finfo(float).eps)


@dataclass
class Rewriting:
    """What came of one scenario written in other words."""

    seed: int
    source: str
    words: str
    outcome: str  # agrees, differs, or why it was not compared
    differences: list = field(default_factory=list)
    compared: int = 0  # histories and values


class InvalidValueError(Exception):
    """Why a scenario cannot be written in these words."""


# --- scenarios -------------------------------------------------------------------------------------------------------


def scenario_of(seed, folder):
    """Where a random scenario comes from, and its tree: plain numbers in SI units, short and coarse."""
    rng = np.random.default_rng([seed, 29])
    kind = rng.choice(["config", "system", "plate"], p=[0.4, 0.45, 0.15])
    if kind == "config":
        path = PATHS[int(rng.integers(len(PATHS)))]
        source, tree = path.stem, config(path)
    elif kind == "system":
        first = int(rng.choice([0, MORE, ASSEMBLIES]))
        source, tree = f"system {first + seed}", random_case(first + seed, folder)[0]
    else:
        source, tree = "plate", plate(rng)
    for path, side, _ in positions(tree):
        if isinstance(place := get(tree, path), str):
            put(tree, path, side * float(place.removesuffix("%")) / 100)
    tree["run"] = {"start": tree.get("run", {}).get("start", "static_equilibrium")}
    few = any("length" in body for _, body in bodies_of(tree).values()) and rng.random() < 0.3
    tree["reduction"] = {"modes": 4 if few else "all"}
    tree["run"] |= {"duration": 1e-3, "convergence": "off"}
    with_outputs(tree, rng)
    built = build_system(beamsim.load_scenario(tree))
    squared = np.asarray(built.dynamics.stiffness)
    moving = np.sqrt(squared[squared > 1e-9 * squared.max()])
    slowest = float(moving.min()) if moving.size else 2 * math.pi  # rad/s, also of bodies that only stops hold
    longest = PERIODS * 2 * math.pi / slowest
    for duration in (longest, 0.1 * longest, 0.01 * longest):  # of records that end before
        timing = {"duration": duration, "sample_rate": 150 / duration, "spectrum": {"to": 20 / duration}}
        tree["run"] |= timing | {"max_events": MOST_EVENTS}  # nothing of a spectrum is compared
        with contextlib.suppress(ScenarioError):
            tree = as_plain_data(beamsim.load_scenario(tree))
            return source, with_sweep(tree, PERIODS / longest, rng) if seed % SWEPT == SWEPT - 1 else tree
    raise InvalidValueError("a record of no length")


def with_sweep(tree, lowest, rng):
    """The same with a short sweep or continuation near the lowest modes, where these follow its excitation."""
    begin = lowest * float(rng.uniform(0.8, 3.0))
    sweep = {"from": begin, "to": 1.1 * begin, "convergence": "off", "impacts": True, "orders": [0.5, 1.0, 3.0]}
    kinds = {
        "swept_sine": sweep | {"rate": f"{0.1 * begin * begin / CYCLES!r} Hz/s"},
        "stepped": sweep | {"points": 2, "most_cycles": CYCLES, "measured_cycles": 2, "longest_period": 2},
        "continuation": {"from": begin, "to": 1.02 * begin, "points_at": [1.005 * begin, 1.015 * begin], "seek_at": 0,
                         "side_branches": "none"},
    }  # fmt: skip
    kind = str(rng.choice([*kinds]))
    with contextlib.suppress(ScenarioError):
        return as_plain_data(beamsim.load_scenario(tree | {"sweep": {"kind": kind} | kinds[kind]}))
    return tree


def config(path):
    """A shipped config without its analyses, its bodies coarse, its files by their full names."""
    scenario = shipped(path)
    tree = copy.deepcopy(as_plain_data(scenario))
    for at, name in named_files(scenario):
        put(tree, at, str((scenario.folder_of(*at) / name).absolute()))
    for key in ("sweep", "nnm", "identify_stiffness", "vary", "optimise", "limits", "units", "title"):
        tree.pop(key, None)
    if "orbit" in str(tree.get("run", {}).get("start")):
        tree["run"]["start"] = "static_equilibrium"
    for _, body in bodies_of(tree).values():
        if is_plate(body):
            body["elements"] = [3, 3]
        elif "length" in body:
            body["elements"] = 5
    return tree


def is_plate(body):
    return body.get("kind") == "plate"


def plate(rng):
    """A random plate with a stop, loads on parts of it, and a mass."""
    length, width = (float(x) for x in rng.uniform(0.2, 0.6, 2))
    at = [[float(x) for x in rng.uniform(0.1, 0.9, 2) * (length, width)] for _ in range(4)]
    edges = {edge: str(rng.choice(["free", "pinned", "clamped"])) for edge in ("left", "right", "bottom", "top")}
    low, high = (0.2 * length, 0.1 * width), (0.7 * length, 0.9 * width)
    return {
        "bodies": {"panel": {
            "kind": "plate", "length": length, "width": width, "thickness": 0.002, "youngs_modulus": 7e10,
            "poissons_ratio": 0.3, "density": 2700.0, "elements": [2, 3], "supports": edges | {"left": "clamped"},
            "point_masses": [{"position": at[0], "mass": 0.05}], "damping": {"kind": "modal", "ratio": 0.01},
            "stiffeners": [{"from": [0.0, at[1][1]], "to": [length, at[1][1]], "bending_stiffness": 3.0,
                            "mass_per_length": 0.1}],
        }},
        "snubbers": [{"name": "stop", "position": at[2], "side": str(rng.choice(["below", "above", "both"])),
                      "stiffness": 1e4, "gap": 1e-5, "damping": {"kind": "ratio", "ratio": 0.05}}],
        "constant_forces": [
            {"area": [list(low), list(high)], "pressure": 2.0,
             "shape": {"kind": "linear", "values": [[1.0, 2.0], [0.0, 1.0]]}},
            {"area": "whole", "pressure": 1.0,
             "shape": {"kind": "table", "x": [low[0], high[0]], "y": [low[1], high[1]],
                       "values": [[1.0, 2.0], [3.0, 0.5]]}},
        ],
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": 5.0, "frequency": float(rng.uniform(20, 80))},
        "probes": [{"name": "probe", "position": at[3]}],
    }  # fmt: skip


def with_outputs(tree, rng):
    """Add outputs and loads at random places, and pulses and damping with values that follow from others."""
    outputs, several = tree.setdefault("outputs", []), "bodies" in tree
    for name, (_, body) in bodies_of(tree).items():
        of = {"body": name} if several else {}
        if "masses" in body:
            outputs.append({"name": f"w {name}", "kind": "velocity", "at": of | {"mass": len(body["masses"])}})
            continue
        if "length" not in body:
            continue
        place = [float(x) for x in rng.uniform(0.1, 0.9, 2) * (body["length"], body.get("width", 1.0))]
        at = of | {"position": place if is_plate(body) else place[0]}
        outputs += [{"name": f"{kind} {name}", "kind": kind, "at": at} for kind in ("displacement", "bending_moment")]
        if not is_plate(body) and rng.random() < 0.5:
            shape = {"kind": "table", "x": [0.1 * body["length"], 0.8 * body["length"]], "values": [1.0, 3.0]}
            shape = shape if rng.random() < 0.5 else {"kind": "polynomial", "coefficients": [1.0, 0.5, -2.0]}
            line = [float(x) * body["length"] for x in sorted(rng.uniform(0, 1, 2))]
            load = of | {"line": line, "force_per_length": 1e-3 * float(rng.uniform(1, 3)), "shape": shape}
            tree.setdefault("constant_forces", []).append(load)
        if rng.random() < 0.3 and not several:
            ratios = [{"frequency": 10.0, "ratio": 0.02}, {"frequency": 60.0, "ratio": 0.04}]
            body["damping"] = {"kind": "rayleigh", "ratios": ratios}
    spec = tree.get("excitation", {})
    if spec.get("kind") == "half_sine" and spec.get("quantity", "acceleration") in ("acceleration", "force"):
        spec["kind"] = str(rng.choice(["half_sine", "trapezoid"]))


# --- trees -----------------------------------------------------------------------------------------------------------


def bodies_of(tree):
    """By name the path and the tree of every body."""
    if "bodies" in tree:
        return {name: (("bodies", name), body) for name, body in tree["bodies"].items()}
    return {key: ((key,), tree[key]) for key in ("beam", "chain") if key in tree}


def get(tree, path):
    for key in path:
        tree = tree[key]
    return tree


def put(tree, path, value):
    get(tree, path[:-1])[path[-1]] = value


def leaves(value, path=()):
    """Path and value of all that is neither mapping nor list."""
    for key, part in list(value.items() if isinstance(value, dict) else enumerate(value)):
        if isinstance(part, (dict, list)):
            yield from leaves(part, (*path, key))
        else:
            yield (*path, key), part


def positions(tree):
    """Path, size of the side in m and its number for every number or share that is a place, found by these keys."""
    bodies = bodies_of(tree)
    only = next(iter(bodies)) if len(bodies) == 1 else None
    for path, value in leaves(tree):
        if isinstance(value, bool) or not (isinstance(value, (int, float)) or str(value).endswith("%")):
            continue
        words = [part for part in path if isinstance(part, str)]
        segment = "segments" in words or "stiffeners" in words
        table = "shape" in words and words[-1] in ("x", "y") and "coefficients" not in words
        mesh = words[-1] == "nodes" and "base" not in words
        if not (
            words[-1] in ("position", "line", "area") or (words[-1] in ("from", "to") and segment) or table or mesh
        ):
            continue
        name = next((name for name, (at, _) in bodies.items() if path[: len(at)] == at), None)
        body = bodies[name or body_beside(tree, path) or only][1]
        if body.get("kind") == "frame":  # a place on a member
            continue
        second = words[-1] == "y" or (path[-1] == 1 and words[-1] not in ("x", "line", "nodes"))
        yield path, float(body["width" if second else "length"]), int(second)


def body_beside(tree, path):
    """The body that is named beside a value, or beside what holds it; None where none is."""
    above = (get(tree, path[:k]) for k in range(len(path) - 1, 0, -1))
    return next((each["body"] for each in above if isinstance(each, dict) and isinstance(each.get("body"), str)), None)


# --- other words -----------------------------------------------------------------------------------------------------


def shares(tree, rng):
    found = list(positions(tree))
    if not found:
        raise InvalidValueError("no places")
    for path, side, _ in found:
        put(tree, path, f"{100 * get(tree, path) / side!r} %")
    return tree


def absolute(tree, rng):
    """What is relative or follows by default, as numbers of our own; nothing else is left that does."""
    changed = False
    snubbers = [(path, s) for path, s in items(tree, "snubbers") if s.get("damping", {}).get("kind") == "ratio"]
    for _, snubber in snubbers:
        if "stiffness" in snubber:
            c = 2 * snubber["damping"]["ratio"] * snubber["stiffness"] / closed(tree, snubber)
            snubber["damping"], changed = {"kind": "viscous", "coefficient": c}, True
    for _, body in bodies_of(tree).values():
        ratios = body.get("damping", {}).get("ratios")
        if ratios:
            omega = 2 * math.pi * np.array([each["frequency"] for each in ratios])
            factors = np.linalg.solve(np.transpose([0.5 / omega, 0.5 * omega]), [each["ratio"] for each in ratios])
            body["damping"] = {"kind": "rayleigh", "mass": float(factors[0]), "stiffness": float(factors[1])}
            changed = True
    spec = tree.get("excitation", {})
    if spec.get("kind") == "trapezoid":
        spec |= {"rise": 0.1 * spec["duration"], "fall": 0.1 * spec["duration"]}
        changed = True
    for load in tree.get("constant_forces", ()):
        if load.get("area") == "whole":
            plate_of = next(body for _, body in bodies_of(tree).values() if is_plate(body))
            load["area"], changed = [[0.0, 0.0], [plate_of["length"], plate_of["width"]]], True
    for path, snubber in list(items(tree, "snubbers")):
        if snubber.get("side") == "both":
            stops = [snubber | {"side": side, "name": f"{snubber['name']}.{side}"} for side in ("above", "below")]
            owner = get(tree, path[:-1])
            owner[owner.index(snubber) : owner.index(snubber) + 1], changed = stops, True
    if isinstance(tree.get("gravity"), float) and all("length" in body for _, body in bodies_of(tree).values()):
        tree["gravity"], changed = [0.0, 0.0, -tree["gravity"]], True
    if not changed:
        raise InvalidValueError("nothing relative")
    return tree


def items(tree, key):
    """Path and tree of every item of a list, of the scenario and of the bodies."""
    for base in ((), *(at for at, _ in bodies_of(tree).values())):
        for k, item in enumerate(get(tree, base).get(key, ())):
            yield (*base, key, k), item


def closed(tree, snubber):
    """First natural frequency that is not zero, rad/s, with a spring in the place of one snubber, the others open."""
    scenario = beamsim.load_scenario(copy.deepcopy(tree))
    names = [each.name for each in scenario.all_snubbers]
    dynamics = build_system(scenario).dynamics
    row = dynamics.contacts.shape[next(k for k, name in enumerate(names) if name.startswith(snubber["name"]))]
    open_squared, weight = np.asarray(dynamics.stiffness), snubber["stiffness"] * row**2
    felt = weight > 1e-14 * weight.max()
    poles, k = np.unique(open_squared[felt], return_inverse=True)
    weight = np.bincount(k, weight[felt])  # of equal frequencies together
    end = poles[1] if poles.size > 1 else poles[0] + 2 * weight[0]
    width = end - poles[0]

    def secular(share):  # zero at the first closed frequency, which an eigenvalue problem has only to 1e-16 of the last
        return 1.0 + float(np.sum(weight / (poles - poles[0] - share * width)))

    first = poles[0] + width * brentq(secular, 1e-15, 1 - 1e-15, xtol=1e-300, rtol=1e-15)
    return math.sqrt(min([first, *open_squared[~felt & (open_squared > 1e-9 * open_squared.max())]]))


OTHERS = {
    "m": {"mm": 1e-3, "cm": 1e-2, "in": 0.0254, "ft": 0.3048, "m": 1.0},
    "kg": {"lb": 0.45359237, "t": 1e3, "kg": 1.0},
    "N": {"kN": 1e3, "mN": 1e-3, "lbf": 4.4482216152605, "N": 1.0},
    "Pa": {"MPa": 1e6, "bar": 1e5, "psi": 4.4482216152605 / 0.0254**2},
    "s": {"ms": 1e-3, "min": 60.0, "s": 1.0},
    "Hz": {"kHz": 1e3, "rpm": 1 / 60},
    "rad": {"deg": math.pi / 180, "rad": 1.0},
    "J": {"mJ": 1e-3, "kJ": 1e3},
}
"""SI units and others, with their sizes."""


def units(tree, rng):
    scenario = beamsim.load_scenario(tree)
    for path, value in list(leaves(tree)):
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            continue
        kind = field_type_at(scenario, path)
        unit = ""
        if isinstance(kind, Quantity):
            unit = kind.dimension.unit
        elif isinstance(kind, LevelType) and path[0] == "excitation":
            holder = get(tree, next(path[:k] for k in range(len(path) - 1, 0, -1) if "quantity" in get(tree, path[:k])))
            unit = LEVEL_DIMENSIONS[holder["quantity"]].unit if "psd" not in path else ""
        if unit and unit != "byte":
            put(tree, path, in_unit(value, unit, rng))
    return tree


def in_unit(value, unit, rng):
    """A number in SI units with another unit of the same dimension, each factor exchanged by itself."""
    size, text = 1.0, ""
    for slash, base, power in re.findall(r"(/?)([A-Za-z]+)(?:\^(\d))?", unit):
        name = str(rng.choice([*OTHERS[base]]))
        size *= OTHERS[base][name] ** ((-1 if slash else 1) * int(power or 1))
        text += f"{slash or ' '}{name}" + (f"^{power}" if power else "")
    text = text.strip()
    return f"{value / size!r} {'1' * text.startswith('/')}{text}"


def renamed(tree, rng):
    bodies = bodies_of(tree)
    names = {old: f"{chr(97 + int(rng.integers(26)))}{k} body" for k, old in enumerate(bodies)}
    turns = str(tree.get("excitation", {}).get("direction", "")).startswith("r")
    alone = next(iter(bodies)) if "bodies" not in tree else ""  # called beam or chain, as its kind
    listed = {names[old]: ({"kind": alone} if alone else {}) | body for old, (_, body) in bodies.items()}
    order = [*listed] if turns else [str(name) for name in rng.permutation([*listed])]  # the first one has the axis
    tree = {key: value for key, value in tree.items() if key not in ("beam", "chain", "bodies")}
    for path, value in leaves(tree):
        if path[-1] == "body":
            put(tree, path, names[value])
    start = tree["run"].get("start")
    if isinstance(start, dict) and "bodies" in start:
        start["bodies"] = {names[name]: shape for name, shape in start["bodies"].items()}
    for key in (
        "joints",
        "springs_to_ground",
        "springs_between",
        "friction",
        "constant_forces",
        "probes",
        "outputs",
        "snubbers",
    ):
        if key in tree and not (key == "joints" and turns):
            tree[key] = [tree[key][int(k)] for k in rng.permutation(len(tree[key]))]
    return {**tree, "bodies": {name: listed[name] for name in order}}


def mirrored(tree, rng):
    if tree.get("excitation", {}).get("direction") or "mode" in str(tree["run"].get("start")):
        raise InvalidValueError("an axis, or a mode whose sign is none")
    if any(key in ("support", "joint") for path, _ in leaves(tree.get("excitation", {})) for key in path):
        raise InvalidValueError("a support that moves")
    for path, side, axis in list(positions(tree)):
        if axis == 0:
            put(tree, path, max(side - get(tree, path), 0.0))  # round-off may put an end beyond the end
    for name, (at, body) in bodies_of(tree).items():
        if "masses" in body:
            mirror_chain(tree, name, at, body)
        else:
            mirror_beam(body)
    loads = [
        *tree.get("constant_forces", ()),
        *(f["applied_to"] for f in forces(tree) if isinstance(f["applied_to"], dict)),
    ]
    for load in loads:
        mirror_load(load)
    for output in tree.get("outputs", ()):
        if output.get("support") in ("left", "right"):
            output["support"] = {"left": "right", "right": "left"}[output["support"]]
    reverse_hinges(tree)
    mirror_start(tree)
    return tree


def forces(tree):
    """Every part of the excitation that says where it acts."""
    spec = tree.get("excitation", {})
    return [each for each in (spec, *spec.get("forces", ())) if "applied_to" in each]


def mirror_beam(body):
    if "supports" in body:
        supports = body["supports"]
        left, right = supports.get("left"), supports.get("right")
        default = ("free", "free") if is_plate(body) else ("clamped", "free")
        supports |= {"left": right or default[1], "right": left or default[0]}
    elif "length" in body and not is_plate(body):
        body["supports"] = {"left": "free", "right": "clamped"}
    if "segments" in body:
        for segment in body["segments"]:
            segment["from"], segment["to"] = segment["to"], segment["from"]
        body["segments"].reverse()


def mirror_chain(tree, name, at, body):
    count = len(body["masses"])
    for key in ("springs", "dashpots"):
        if body.get(key):
            body[key] = [*body[key], *[0.0] * (count + 1 - len(body[key]))][::-1]
    body["masses"].reverse()
    for path, value in list(leaves(tree)):
        own = path[: len(at)] == at
        if path[-1] == "mass" and isinstance(value, int) and "between" not in path[-3:-1]:
            named = body_beside(tree, path)
            if own or named == name or (named is None and len(bodies_of(tree)) == 1):
                put(tree, path, count + 1 - value)
    for key in ("snubbers", "springs_between", "friction"):
        for path, item in items(tree, key):
            mine = path[: len(at)] == at or len(bodies_of(tree)) == 1
            ends = item.pop("masses", None) or item.get("between")
            if ends and mine and all(isinstance(end, int) for end in ends):
                item["between"] = [{"mass": count + 1 - end} for end in sorted(ends)]
            elif ends:
                item["between"] = [mirror_end(end, name, count, mine) for end in ends]
    for joint in tree.get("joints", ()):
        joint["between"] = [mirror_end(end, name, count, False) for end in joint["between"]]


def mirror_end(end, name, count, mine):
    of_it = isinstance(end, dict) and "mass" in end and (end.get("body") == name or (mine and "body" not in end))
    return end | {"mass": count + 1 - end["mass"]} if of_it else end


def reverse_hinges(tree):
    """Slopes change their signs, and with them the angles of stops of hinges."""
    for joint in tree.get("joints", ()):
        for stop in joint.get("stops", ()):
            side = stop.get("side", "below" if stop.get("angle", 0.0) < 0 else "above")
            stop["side"] = {"above": "below", "below": "above"}[side]
            if "angle" in stop:
                stop["angle"] *= -1


def mirror_load(load):
    for key in ("line", "area"):
        if isinstance(load.get(key), list):
            first, last = load[key]
            if key == "line":
                load[key] = [last, first]
            else:
                load[key] = [[last[0], first[1]], [first[0], last[1]]]
    shape = load.get("shape", {})
    if shape.get("kind") == "mode" or (shape.get("kind") == "sine" and shape.get("half_waves", [1])[0] % 2 == 0):
        raise InvalidValueError("a shape that changes its sign")
    if shape.get("kind") == "linear":
        shape["values"].reverse()
    elif shape.get("kind") == "table":
        shape["values"].reverse()
        shape["x"].reverse()
    elif shape.get("kind") == "polynomial":
        rows = np.array(shape["coefficients"], dtype=float)
        shape["coefficients"] = reflected(rows, 1.0).tolist()


def reflected(coefficients, length):
    """Coefficients of p(length - x) from those of p(x), along the first axis."""
    power = np.arange(len(coefficients))
    turn = [[math.comb(k, j) * (-1.0) ** j * length ** max(k - j, 0) for k in power] for j in power]
    return np.array(turn) @ coefficients  # there are no ways to take j out of less


def mirror_start(tree):
    start = tree["run"].get("start")
    if not isinstance(start, dict):
        return
    bodies = bodies_of(tree)
    shapes = start["bodies"] if "bodies" in start else {next(iter(bodies)): start}
    for name, shape in shapes.items():
        body = bodies[name][1]
        for key in ("displacement", "velocity"):
            if shape.get(key):
                given = np.array(shape[key], dtype=float)
                shape[key] = (given[::-1] if "masses" in body else reflected(given, body["length"])).tolist()


def upside_down(tree, rng):
    spec = tree.get("excitation", {})
    recorded = any(part.get("kind") in ("random", "sampled") for part in (spec, *spec.get("forces", ())))
    if recorded or "profile" in spec or spec.get("notches"):
        raise InvalidValueError("an input whose sign cannot be changed")
    for _, snubber in items(tree, "snubbers"):
        if "between" in snubber:
            snubber["between"] = turned_ends(snubber["between"])
        elif snubber["side"] != "both":
            snubber["side"] = {"above": "below", "below": "above"}[snubber["side"]]
    reverse_hinges(tree)
    for key in ("springs_to_ground", "springs_between"):
        for _, spring in items(tree, key):
            if spring.get("kind") == "piecewise_linear":
                spring["breakpoints"] = [-x for x in reversed(spring["breakpoints"])]
                spring["stiffnesses"].reverse()
    for _, contact in items(tree, "friction"):
        if isinstance(contact.get("start"), float):
            contact["start"] *= -1
    for load in tree.get("constant_forces", ()):
        for key in ("force", "force_per_length", "pressure"):
            if key in load:
                load[key] *= -1
    gravity = tree.get("gravity", 0.0)
    tree["gravity"] = [gravity[0], gravity[1], -gravity[2]] if isinstance(gravity, list) else -gravity
    for part in (spec, *spec.get("forces", ())):
        for tone in part.get("tones", (part,)):
            if "level" in tone:
                tone["level"] *= -1
    start = tree["run"].get("start")
    if isinstance(start, dict):
        for path, value in list(leaves(start)):
            if path[-1] in ("force", "amplitude") or path[-2:-1] in (("displacement",), ("velocity",)):
                put(start, path, -value)
    return tree


def turned_ends(ends):
    """The two places in the other order; of numbers of masses the lower one came first."""
    ordered = [{"mass": end} for end in sorted(ends)] if all(isinstance(end, int) for end in ends) else ends
    return ordered[::-1]


def turned(tree, rng):
    """A mirror in the diagonal: displacements stay, rotations are about the other axis."""
    if not all(is_plate(body) for _, body in bodies_of(tree).values()):
        raise InvalidValueError("no plate")
    edges = {"left": "bottom", "right": "top", "bottom": "left", "top": "right"}
    for _, body in bodies_of(tree).values():
        body |= {"length": body["width"], "width": body["length"], "elements": body["elements"][::-1]}
        supports = body.get("supports", {})
        body["supports"] = {edges.get(edge, edge): held for edge, held in supports.items()}
        if isinstance(stiffness := body.get("bending_stiffness"), dict):
            exchanged = {"dx": stiffness["dy"], "dy": stiffness["dx"]}
            stiffness |= exchanged | {"nu": stiffness.get("nu", 0.0) * stiffness["dy"] / stiffness["dx"]}
        for stiffener in body.get("stiffeners", ()):
            stiffener |= {key: stiffener[key][::-1] for key in ("from", "to")}
    for path, value in list(points(tree)):
        put(tree, path, value[::-1])
    for part in (*tree.get("constant_forces", ()), *(force["applied_to"] for force in forces(tree))):
        if isinstance(part, dict):
            if isinstance(part.get("area"), list):
                part["area"] = [corner[::-1] for corner in part["area"]]
            turn_shape(part.get("shape", {}))
    for output in tree.get("outputs", ()):
        if "component" in output or output["kind"] in ("bending_moment", "stress", "strain"):
            output["component"] = {"x": "y", "y": "x", "xy": "xy"}[output.get("component", "x")]
        if output.get("support") in edges:
            output["support"] = edges[output["support"]]
    if tree.get("excitation", {}).get("direction") or "support" in str(tree.get("excitation")):
        raise InvalidValueError("a base that turns, or a support that moves")
    return tree


def points(tree, path=()):
    """Path and value of every point of a plate."""
    for key, part in list(tree.items() if isinstance(tree, dict) else enumerate(tree)):
        if key == "position" and isinstance(part, list):
            yield (*path, key), part
        elif isinstance(part, (dict, list)):
            yield from points(part, (*path, key))


def turn_shape(shape):
    if shape.get("kind") == "mode":
        raise InvalidValueError("a shape that changes its sign")
    for key in ("values", "coefficients"):
        if key in shape:
            shape[key] = np.transpose(shape[key]).tolist()
    if shape.get("kind") == "table":
        shape["x"], shape["y"] = shape["y"], shape["x"]
    if "half_waves" in shape:
        shape["half_waves"] = shape["half_waves"][::-1]


WORDS = {
    "shares": shares, "absolute": absolute, "units": units, "renamed": renamed, "mirrored": mirrored,
    "upside_down": upside_down, "turned": turned,
}  # fmt: skip
SAME = (*WORDS, "varied", "stored")


# --- what comes out --------------------------------------------------------------------------------------------------


def told(tree):
    """Histories and contacts of a run by name, and of a sweep; they are compared without their signs."""
    scenario = beamsim.load_scenario(copy.deepcopy(tree))
    result = beamsim.run(scenario)
    return histories(result) | curves(scenario) if result.complete else None


def curves(scenario):
    """What a sweep or continuation gives, by name; nothing where there is none."""
    return {} if scenario.sweep is None else of_curves(followed(scenario))


def followed(scenario):
    return (beamsim.continuation if scenario.sweep.kind == "continuation" else beamsim.sweep)(scenario)


def of_curves(result):
    """Values of a sweep cycle by cycle, or those of periodic motions at the frequencies that were asked for."""
    found = {}
    if result.scenario.sweep.kind == "continuation":
        asked = result.scenario.sweep.points_at
        for label, branch in enumerate(result.branches):
            frequencies = branch["frequency_hz"].values
            there = np.flatnonzero([any(math.isclose(f, at, rel_tol=1e-12) for at in asked) for f in frequencies])
            for value, of in peaks_in(branch):
                found |= {f"{label} peak of {value.name} of {name}": peak[there] for name, peak in of.items()}
        return found
    for label, curve in result.curves.items():
        places = [(kind, place) for kind in (*FOLLOWED, "output") for place in curve.places(kind)]
        for kind, place in places:
            values = curve.channel(kind, place)
            for name in ("peak", "rms", "mean", "harmonics"):
                found[f"{label} {name} of {kind} of {place}"] = np.abs(getattr(values, name))
        for key in ("number", "impulse", "energy_lost"):
            for place, values in curve.cycles.by_label(f"impact_{key}").items():
                found[f"{label} {key} of force of {place}"] = values.values
    return found


def histories(result):
    found = {}
    for name in result["histories"].labels("probe"):
        found[f"displacement of {name}"] = np.abs(result["histories"]["displacement"].sel(probe=name).values)
        found[f"velocity of {name}"] = np.abs(result["histories"]["velocity"].sel(probe=name).values)
        found[f"peak of {name}"] = np.array([result.summary["peak_displacement_m"][name]])
    peaks = result.summary.get("peak_force_n", {}) | result.summary.get("peak_moment_n_m", {})  # of stops on rotations
    for name in result["histories"].labels("snubber"):
        found[f"force of {name}"] = result["histories"]["snubber_force"].sel(snubber=name).values
        found[f"peak force of {name}"] = np.array([peaks[name]])
    for name in result["histories"].labels("output"):
        found[f"output {name}"] = np.abs(result["histories"]["output_value"].sel(output=name).values)
    for name in result["histories"].labels("friction"):
        found[f"friction {name}"] = np.abs(result["histories"]["friction_force"].sel(friction=name).values)
    found["energy"] = np.asarray(result["histories"]["energy_stored"].values)
    found["contacts"] = result["events"]["time"].values
    return found


def noisy(tree, first, rng):
    """Histories with other last digits in the numbers; without those that say nothing of other words.

    A peak depends on all contacts before, and those differ. The force of a stop is that of its deflection, of which one
    digit is much where the stop is stiff and lies far in.
    """
    scenario = beamsim.load_scenario(perturbed(tree, rng))
    result = beamsim.run(scenario)
    found = histories(result) | curves(scenario) if result.complete else {}
    moved = bool(found) and found["contacts"].size != first["contacts"].size
    left_out = {name for name in found if moved and name.startswith("peak")}
    for name in result["histories"].labels("snubber"):
        digit = (
            EPSILON
            * result["histories"]["snubber_stiffness"].sel(snubber=name).item()
            * (
                abs(result["histories"]["snubber_gap"].sel(snubber=name).item())
                + np.max(np.abs(result["histories"]["snubber_displacement"].sel(snubber=name).values), initial=0.0)
            )
        )
        if digit > SENSITIVE * np.max(result["histories"]["snubber_force"].sel(snubber=name).values, initial=0.0):
            left_out |= {each for each in found if each.endswith(f"force of {name}")}
    return {name: values for name, values in found.items() if name not in left_out}


def side_names(found):
    """Both stops of a pair exchange their names where above and below do."""
    turn = {".above": ".below", ".below": ".above"}
    return {re.sub(r"\.(above|below)$", lambda m: turn[m[0]], name): values for name, values in found.items()}


def perturbed(tree, rng):
    """The same with other last digits in what `comparison` changes."""
    tree = copy.deepcopy(tree)
    for path, value in list(leaves(tree)):
        of_pair = path[-2:-1] == ("coefficient",)  # static and sliding ones may be equal
        if isinstance(value, float) and not of_pair and CHANGED & {part for part in path if isinstance(part, str)}:
            put(tree, path, value * (1 + DIGITS * float(rng.uniform(-1, 1))))
    return tree


def rewrite(seed, folder, words=SAME):
    """Draw a scenario, write it in other words, and compare: what came of each."""
    rng = np.random.default_rng([seed, 10])
    try:
        source, tree = scenario_of(seed, Path(folder))
        first = told(tree)
    except (InvalidValueError, ScenarioError):
        return [Rewriting(seed, "drawn", "not written", "is refused or does not move")]
    if first is None:  # a tenth of it has fewer contacts
        run = tree["run"]
        rates = {"sample_rate": 10 * run["sample_rate"], "spectrum": {"to": 10 * run["spectrum"]["to"]}}
        run |= {"duration": 0.1 * run["duration"], **rates}
        first = told(tree)
    noise = () if first is None else tuple(noisy(tree, first, rng) for _ in range(2))
    findings = []
    for name in words:
        finding = Rewriting(seed, source, name, "agrees" if first is not None else "more contacts than are compared")
        findings.append(finding)
        if first is None:
            continue
        try:
            if name == "varied":
                _compare(finding, *varied(tree, rng))
            else:
                other = stored(tree, Path(folder)) if name == "stored" else told(WORDS[name](copy.deepcopy(tree), rng))
                turned = name == "upside_down" and other is not None
                _compare(finding, first, side_names(other) if turned else other, noise)
        except InvalidValueError as unfit:
            finding.outcome = str(unfit)
        except ScenarioError as error:
            finding.outcome, finding.differences = "differs", [f"refused: {error}"]
    return findings


def _compare(finding, first, other, noise):
    if other is None:
        finding.differences = ["incomplete"]
    elif first.keys() != other.keys():
        finding.differences = [f"only once: {sorted(first.keys() ^ other.keys())}"]
    else:
        said = [difference(name, first[name], other[name], noise) for name in first]
        finding.compared = sum(each is not None for each in said)
        finding.differences = [each for each in said if each]
    if finding.differences:
        finding.outcome = "differs"
    elif not finding.compared:
        finding.outcome = "sensitive to the last digits"


def difference(name, one, other, noise):
    """What differs, '' where nothing does; None where the last digits of the numbers show."""
    size = float(np.max(one, initial=0.0))
    for each in noise:
        if name not in each or each[name].shape != one.shape:
            return None
        if not np.max(np.abs(each[name] - one), initial=0.0) <= SENSITIVE * size:
            return None
    if one.shape != other.shape:
        return f"{name}: {one.shape} and {other.shape}"
    apart = float(np.max(np.abs(one - other), initial=0.0))
    return "" if apart <= AGREED * size else f"{name}: {apart / size:.1e} of it"


def stored(tree, folder):
    """Histories of runs from stored results, which hold what was computed."""
    scenario = beamsim.load_scenario(copy.deepcopy(tree))
    again = {}
    for compute, read in ((beamsim.run, histories), (followed, of_curves)):
        if compute is beamsim.run or scenario.sweep is not None:
            result = compute(scenario)
            opened = beamsim.load(beamsim.write_result(result, folder / "stored.h5"))
            for name, values in read(result).items():
                np.testing.assert_array_equal(read(opened)[name], values)
            again |= read(compute(opened.scenario))
    return again


def varied(tree, rng):
    """Responses of a run of the edited scenario, and of the same numbers as the second case of an ensemble."""
    tree = {key: part for key, part in tree.items() if key != "sweep"}  # of which a study would be
    known = CHANGED | {"length", "mass", "density"}
    numbers = [path for path, value in leaves(tree) if isinstance(value, float) and value > 0]
    candidates = [path for path in numbers if path[0] != "run" and path[-1] in known and "segments" not in path]
    if not candidates:
        raise InvalidValueError("nothing to vary")
    path = candidates[int(rng.integers(len(candidates)))]
    scenario, value = beamsim.load_scenario(copy.deepcopy(tree)), get(tree, path)
    edited = copy.deepcopy(tree)
    put(edited, path, 1.05 * value)
    try:
        changed = beamsim.load_scenario(edited)
    except ScenarioError as error:
        raise InvalidValueError("the edited scenario is none") from error
    table = beamsim.ensemble(scenario, {path_text(path): [value, 1.05 * value]}, workers=1)
    if not (edited_run := beamsim.run(changed)).complete:
        raise InvalidValueError("more contacts than are compared")
    first = responses(edited_run.summary)
    noise = [responses(beamsim.run(beamsim.load_scenario(perturbed(edited, rng))).summary) for _ in range(2)]
    return first, {name: np.asarray(table.responses[name].values)[1:2] for name in first}, noise


def responses(summary):
    """By name of the response what a run's summary says."""
    return {
        f"{section}/{name}/{key.rpartition('_')[0]}": np.array([value])
        for key, section in (("peak_displacement_m", "probes"), ("peak_force_n", "snubbers"))
        for name, value in summary.get(key, {}).items()
    }
