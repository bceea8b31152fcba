"""Cost of rings by number of sides and of rings, and a published tube with rings in place of pairs of stops.

``python -m benchmarks.rings cost`` prints processor times of the march; ``python -m benchmarks.rings tube`` computes
SDNL301A of code_aster (a tube in four supports) with its loads at an angle, once with pairs of stops in one plane;
``python -m benchmarks.rings pipe`` shakes a frame of 3,018 degrees of freedom in up to 20 rings along three axes.
"""

from __future__ import annotations

import math
import sys
import time
from typing import Any

import numpy as np

import beamsim
from beamsim.analyses.run.motion import motion_in_chunks
from beamsim.flow.transient import MotionInChunks
from beamsim.scenario import Scenario, load_scenario
from beamsim.system.build import build_system
from benchmarks.published_cases import GAP, SPAN, TUBE, tube

SIZES = ((1, 24), (1, 48), (1, 96), (2, 48), (5, 24), (5, 48), (10, 24))
"""Numbers of rings and of the sides of each."""


def discs(rings: int, sides: int) -> dict[str, Any]:
    """Discs on elastic shafts, coupled in a row, each in its ring, under an oblique harmonic force."""
    n = 2 * rings
    unit, stiffness = np.eye(n), 2e4 * np.eye(n)
    for k in range(n - 2):
        stiffness[[k, k + 2], [k, k + 2]] += 5e3
        stiffness[[k, k + 2], [k + 2, k]] -= 5e3
    rows = {f"{'yz'[k % 2]}{k // 2}": unit[k].tolist() for k in range(n)} | {"load": [1.0, 0.4] * rings}
    ring = {"kind": "ring", "gap": 4e-4, "stiffness": 1e6, "sides": sides, "largest_penetration": 5e-5}
    body = {
        "kind": "matrices", "base": "free", "mass": (2.0 * unit).tolist(), "stiffness": stiffness.tolist(),
        "rows": rows, "damping": {"kind": "modal", "ratio": 0.02},
    }  # fmt: skip
    return {
        "bodies": {"discs": body},
        "snubbers": [ring | {"name": f"ring_{k}", "along": [{"row": f"y{k}"}, {"row": f"z{k}"}]} for k in range(rings)],
        "excitation": {"kind": "harmonic", "applied_to": {"row": "load"}, "level": 12.0, "frequency": 17.0},
        "probes": [{"name": "first", "at": {"row": "y0"}}],
        "run": {"duration": 0.1, "sample_rate": 2e3, "convergence": "off", "start": "rest"},
    }


def marched(scenario: Scenario) -> tuple[MotionInChunks, float, float]:
    """The whole motion of a case, and processor times of its model and of the march, s."""
    begin = time.process_time()
    system = build_system(scenario)
    built = time.process_time()
    assert scenario.run is not None
    march, _ = motion_in_chunks(system, scenario.run)
    for _ in march.chunks():
        pass
    return march, built - begin, time.process_time() - built


def cost() -> None:
    """Print processor times for `SIZES`."""
    for rings, sides in SIZES:
        march, building, seconds = marched(load_scenario(discs(rings, sides)))
        events = max(march.event_time.size, 1)
        print(
            f"{rings} rings of {sides} sides: built in {building:.2f} s, {events} events, {march.states} contact "
            f"states, {march.evaluations} evaluations, {1e3 * seconds / events:.2f} ms an event",
            flush=True,
        )


PIPES = ((1, 2.0), (5, 1.0), (20, 0.5))
"""Numbers of rings, and duration, s."""


def pipe(rings: int, duration: float) -> dict[str, Any]:
    """A pipe on hangers, whose base moves at random along three axes, in rings of 24 sides at some of its 20 guides."""
    names = ["start", *[f"guide_{k}" for k in range(1, 21)], "end"]
    section = {
        "section": {"kind": "tube", "outer_diameter": 60.3e-3, "wall_thickness": 2.9e-3},
        "youngs_modulus": 2e11, "density": 7850, "added_mass_per_length": 2.3,
    }  # fmt: skip
    frame = {
        "kind": "frame", "nodes": {name: [1.5 * k, 0, 0] for k, name in enumerate(names)},
        "sections": {"dn50": section}, "elements": 24,
        "members": {f"span_{k}": {"nodes": list(names[k : k + 2])} for k in range(21)},
        "supports": {n: "clamped" if n in ("start", "end") else {"stiffness": {"y": 2e4, "z": 2e4}} for n in names},
        "damping": {"kind": "modal", "ratio": 0.03},
    }  # fmt: skip
    ring = {"kind": "ring", "axis": "x", "gap": 2e-3, "stiffness": 2e6, "sides": 24, "largest_penetration": 1e-3}
    guides = [int(20 * (k + 0.5) / rings + 0.5) for k in range(rings)]
    noise = [
        {"kind": "random", "applied_to": "base", "direction": direction,
         "psd": [{"frequency": f, "density": f"{rms**2 / 31.0} g^2/Hz"} for f in (2.0, 33.0)]}
        for direction, rms in (("x", 0.3), ("y", 0.3), ("z", 0.2))
    ]  # fmt: skip
    return {
        "bodies": {"pipe": frame}, "reduction": {"modes": 60},
        "snubbers": [ring | {"name": f"ring_{k}", "node": f"guide_{k}"} for k in guides],
        "excitation": {"kind": "forces", "forces": noise},
        "probes": [{"name": "middle", "at": {"node": "guide_10", "direction": "z"}}],
        "run": {"duration": duration, "sample_rate": 1e3, "convergence": "off", "start": "rest"},
    }  # fmt: skip


def shaken_pipe() -> None:
    """Print what takes the processor time of `PIPES`: the model, its motion, and all that a run adds."""
    for rings, duration in PIPES:
        scenario = load_scenario(pipe(rings, duration))
        march, building, seconds = marched(scenario)
        begin = time.process_time()
        result = beamsim.run(scenario)
        marches = (time.process_time() - begin) / seconds
        print(
            f"{rings} rings, {duration:g} s: built in {building:.2f} s, march {seconds:.2f} s with "
            f"{march.event_time.size} events, {march.states} contact states and {march.evaluations} evaluations; the "
            f"run takes {marches:.2f} marches; energy error "
            f"{result.summary['energy_error']:.1e}",
            *result.warnings, sep="\n  ", flush=True,
        )  # fmt: skip


def tube_in_rings(angle: float, sides: int) -> dict[str, float]:
    """Forces of the rings of SDNL301A, N (rms from 0.17 to 0.25 s), under loads at an angle, rad."""
    section = {"kind": "tube", "outer_diameter": 15.9e-3, "wall_thickness": 1.15e-3}
    beam = {
        "kind": "beam", "length": TUBE, "section": section, "youngs_modulus": 2.07e11, "density": 7870,
        "elements": 48, "supports": {"left": "clamped"},
        "damping": {"kind": "rayleigh", "mass": 0.1526, "stiffness": 1.79e-5},
    }  # fmt: skip
    planes = {"y": math.cos(angle), "z": math.sin(angle)}
    rings = [
        {"name": f"ring_{k}", "kind": "ring", "along": [{"body": body, "position": SPAN * k} for body in planes],
         "gap": GAP, "stiffness": 1e5, "damping": {"kind": "viscous", "coefficient": 0.28}, "sides": sides,
         "largest_penetration": 1.5 * GAP}
        for k in range(1, 5)
    ]  # fmt: skip
    forces = [
        {"kind": "harmonic", "applied_to": {"body": body, "position": SPAN * (span + k / 12)},
         "level": 4.138 * share * (-1) ** span, "frequency": 251.2 / (2.0 * math.pi)}
        for body, share in planes.items() if abs(share) > 1e-12 for span in range(4) for k in range(1, 12)
    ]  # fmt: skip
    case = {
        "bodies": dict.fromkeys(planes, beam), "reduction": {"modes": 60}, "snubbers": rings,
        "probes": [{"name": "tip", "at": {"body": "y", "position": TUBE}}],
        "excitation": {"kind": "forces", "forces": forces},
        "run": {"duration": 0.25, "sample_rate": 2e4, "start": "rest", "convergence": "off", "spectrum": None},
    }  # fmt: skip
    result = beamsim.run(load_scenario(case))
    last = result["rings"]["time"].values >= 0.17
    for warning in result.warnings:
        print(warning)
    forces_of = result["rings"].by_label("force")
    return {name: float(np.sqrt(np.mean(force.values[last] ** 2))) for name, force in forces_of.items()}


if __name__ == "__main__":
    if sys.argv[1:] == ["tube"]:
        print("pairs", tube())
        for turn, count in ((0.0, 48), (0.4, 48)):
            print(f"rings of {count} sides, loads at {turn} rad", tube_in_rings(turn, count), flush=True)
    elif sys.argv[1:] == ["pipe"]:
        shaken_pipe()
    else:
        cost()
