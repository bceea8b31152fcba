"""Response curves compared with other programs for harmonic balance, where they are installed.

Two masses and a stop (``configs/continuation/chain_two_dof.yaml``). Curves have different points, so that each is
measured by itself: from the state that a program gives, the exact motion over one period must come back to it. The
defect is the distance from there, over the largest size of the states of the curve.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

import beamsim
from beamsim.flow.exact import exact_flow
from beamsim.flow.transient import simulate
from beamsim.system.build import build_system
from benchmarks.measure import processor_time

CASE = "configs/continuation/chain_two_dof.yaml"
HARMONICS = ((5, 256), (11, 512), (21, 1024), (41, 2048))  # and samples of a period

Floats = Any


class Points(NamedTuple):
    """Periodic motions of a response curve at the phase 0 of the force, a sine."""

    omega: Floats  # (n,) rad/s
    place: Floats  # (n, 2) m
    speed: Floats  # (n, 2) m/s


def rows() -> Iterator[str]:
    """Lines of a table, and a line for each program that is missing."""
    yield "| response curve of two masses | processor time | ratio | points | median defect | largest defect |"
    yield "|---|---|---|---|---|---|"
    scenario = beamsim.load_scenario(CASE)
    results: list[Any] = []
    own = _second(lambda: results.append(beamsim.continuation(scenario)))
    branch = results[-1].branches[0]
    states = (
        part @ _shapes(build_system(scenario)).T
        for part in (branch["coordinates"].values, branch["coordinate_velocities"].values)
    )
    points = Points(2.0 * np.pi * branch["frequency_hz"].values, *states)
    yield _row("beamsim: branches, multipliers, special points", own, own, points)
    try:
        curve = _pyharm()
    except ImportError as missing:
        yield f"pyHarm is not installed ({missing}): skipped"
    else:
        for harmonics, samples in HARMONICS:
            found: list[Points] = []
            seconds = _second(lambda h=harmonics, n=samples, found=found: found.append(curve(h, n)))  # type: ignore[misc]
            yield _row(f"pyHarm, {harmonics} harmonics, {samples} samples", seconds, own, found[-1])
    yield "tmdsimpy is not in the package index: not run"


def _row(method: str, seconds: float, own: float, points: Points) -> str:
    defects = _defects(points)
    return (
        f"| {method} | {seconds:.3g} s | {seconds / own:.2g} | {defects.size} | {np.median(defects):.1e} | "
        f"{defects.max():.1e} |"
    )


def _shapes(system: Any) -> Floats:
    """(2, n) displacements of the masses for the coordinates."""
    return np.array([probe.shape for probe in system.probes])


def _second(work: Callable[[], Any]) -> float:
    """Processor time of a second call, s; the first one compiles."""
    work()
    return processor_time(work)


def _defects(points: Points) -> Floats:
    """(n,) how far exact motions are from their start after one period."""
    sizes, changes = [], []
    for omega, place, speed in zip(*points, strict=True):
        period = float(2.0 * np.pi / omega)
        frequency = {"excitation.frequency": f"{omega} rad/s", "run.duration": f"{2 * period} s"}
        system = build_system(beamsim.load_scenario(CASE, frequency))
        shape = _shapes(system)
        begin = np.concatenate([np.linalg.solve(shape, part) for part in (place, speed)])
        end = simulate(exact_flow(system, period), begin).final_y
        scale = np.repeat([1.0, 1.0 / omega], place.size)
        moved = np.concatenate([shape @ part for part in np.split(end - begin, 2)])
        changes.append(np.linalg.norm(scale * moved))
        sizes.append(np.linalg.norm(scale * np.concatenate([place, speed])))
    return np.array(changes) / max(sizes)


def _pyharm() -> Callable[[int, int], Points]:
    """The curve by so many harmonics and samples of a period; raises ImportError if pyHarm is missing."""
    from pyHarm.Maestro import Maestro

    logging.disable(logging.WARNING)  # of each point
    matrices = {
        "M": np.eye(2),
        "C": np.array([[0.03, -0.03], [-0.03, 0.06]]),
        "K": np.array([[1.0, -1.0], [-1.0, 2.0]]),
        "G": np.zeros((2, 2)),
    }

    def curve(harmonics: int, samples: int) -> Points:
        study = {
            "study": "frf", "puls_inf": 0.5, "puls_sup": 0.8, "sign_ds": -1, "ds0": 0.01, "ds_max": 0.1,
            "verbose": False,
        }  # fmt: skip
        stop = {"type": "PenaltyUnilateralGap", "connect": {"chain": [0]}, "dirs": [0], "g": 1.0, "k": 100.0}
        force = {"type": "SinusForcing", "connect": {"chain": [1]}, "dirs": [0], "amp": 0.1}
        maestro = Maestro({
            "analysis": {"curve": study},
            "system": {"type": "Base", "nh": harmonics, "nti": samples},
            "substructures": {"chain": {"matrix": matrices, "ndofs": 1}},
            "connectors": {"stop": stop, "force": force},
            "kinematics": {},
        })  # fmt: skip
        maestro.operate()
        solved = [s.x for s in maestro.nls["curve"].SolList if s.flag_accepted and 0.5 <= s.x[-1] <= 0.8]
        x, dofs = np.array(solved), maestro.system.expl_dofs
        order, node = dofs["harm"].to_numpy(), dofs["node_num"].to_numpy()
        cosine = dofs["cs"].to_numpy() == "c"
        omega = x[:, -1]
        place = np.stack([x[:, :-1][:, cosine & (node == k)].sum(axis=1) for k in (0, 1)], axis=1)
        rates = x[:, :-1] * np.where(cosine, 0.0, order)
        speed = omega[:, None] * np.stack([rates[:, node == k].sum(axis=1) for k in (0, 1)], axis=1)
        return Points(omega, place, speed)

    return curve
