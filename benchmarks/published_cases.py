"""Published cases that take long: ``python -m benchmarks.published_cases``.

Computes them, and what the thesis of H. Hazim (2010) leaves open, and keeps them in ``docs/published.yaml`` with the
date and the commit. The page of validation compares them with what their sources print.
"""

from __future__ import annotations

import argparse
import datetime
import math
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numba
import numpy as np
import yaml
from scipy.linalg import eigh

import beamsim
from beamsim.system.build import build_system

ROOT = Path(__file__).parents[1]
TABLE = ROOT / "docs" / "published.yaml"
GRAVITY = 9.80665  # m/s^2
# largest tip displacement, m, and acceleration, g, from 0.7 to 0.8 s: ends of the printed axes, or what the text says
PRINTED = {45: (1.5e-4, 10.0), 65: (4.0e-4, 20.0), 78: (1.4e-3, 60.0), 160: (3.0e-4, 10.0)}
TUBE, SPAN, GAP = 2.436, 0.609, 0.406e-3  # m


def config(name: str, changes: Mapping[str, Any] | None = None) -> Any:
    """A shipped scenario with changes."""
    (path,) = (ROOT / "configs").rglob(f"{name}.yaml")
    return beamsim.load_scenario(path, {**(changes or {})})


def duan_singh() -> dict[str, float]:
    """Frequencies, Hz, at which motions of a clutch with a mean torque double their period."""
    spring = {"name": "clutch", "mass": 1, "kind": "piecewise_linear", "breakpoints": [-4.0, 4.0],
              "stiffnesses": [1.0, 0.25, 1.0]}  # fmt: skip
    case = {
        "chain": {"masses": [1.0], "springs": [0.0], "dashpots": [0.04], "springs_to_ground": [spring]},
        "probes": [{"name": "mass", "mass": 1}], "constant_forces": [{"mass": 1, "force": 1.2}],
        "excitation": {"kind": "harmonic", "applied_to": {"mass": 1}, "level": 1.0, "frequency": 0.17},
        "sweep": {"kind": "continuation", "from": 0.05, "to": 0.36},
    }  # fmt: skip
    points = beamsim.continuation(beamsim.load_scenario(case))["special_points"]
    columns = (points[name].values.tolist() for name in ("branch", "kind", "parameter"))
    found = [value for branch, kind, value in zip(*columns, strict=True) if branch == 0 and kind == "period_doubling"]
    return {f"period doubling {k}, Hz": value for k, value in enumerate(sorted(found), 1)}


def tube() -> dict[str, float]:
    """Forces of the stops of a tube in four supports, N (rms from 0.17 to 0.25 s)."""
    section = {"kind": "tube", "outer_diameter": 15.9e-3, "wall_thickness": 1.15e-3}
    beam = {
        "length": TUBE, "section": section, "youngs_modulus": 2.07e11, "density": 7870, "elements": 48,
        "supports": {"left": "clamped"}, "damping": {"kind": "rayleigh", "mass": 0.1526, "stiffness": 1.79e-5},
    }  # fmt: skip
    dashpot = {"kind": "viscous", "coefficient": 0.28}
    stops = [
        {"name": f"stop_{k}", "at": {"position": SPAN * k}, "side": "both", "stiffness": 1e5, "gap": GAP,
         "damping": dashpot}
        for k in range(1, 5)
    ]  # fmt: skip
    forces = [
        {"kind": "harmonic", "applied_to": {"position": SPAN * (span + k / 12)}, "level": 4.138 * (-1) ** span,
         "frequency": 251.2 / (2.0 * math.pi)}
        for span in range(4) for k in range(1, 12)
    ]  # fmt: skip
    case = {
        "beam": beam, "reduction": {"modes": 30}, "snubbers": stops, "probes": [{"name": "tip", "position": TUBE}],
        "excitation": {"kind": "forces", "forces": forces},
        "run": {"duration": 0.25, "sample_rate": 2e4, "start": "rest", "convergence": "off", "spectrum": None},
    }  # fmt: skip
    histories = beamsim.run(beamsim.load_scenario(case))["histories"]
    last = histories["time"].values >= 0.17
    found = {}
    for k in range(1, 5):
        pair = [histories["snubber_force"].sel(snubber=f"stop_{k}.{side}").values[last] for side in ("above", "below")]
        found[f"rms force of stop {k}, N"] = float(np.sqrt(np.mean((pair[0] - pair[1]) ** 2)))
    return found


def tube_by_steps(modes: int, step: float) -> dict[str, float]:
    """The same by small time steps of some modes of the tube, without static vectors."""
    count, outer, inner = 48, 7.95e-3, 6.8e-3
    rigidity = 2.07e11 * math.pi / 4 * (outer**4 - inner**4)
    line, a = 7870 * math.pi * (outer**2 - inner**2), TUBE / count
    stiffness = rigidity / a**3 * np.array(
        [[12, 6 * a, -12, 6 * a], [6 * a, 4 * a * a, -6 * a, 2 * a * a], [-12, -6 * a, 12, -6 * a],
         [6 * a, 2 * a * a, -6 * a, 4 * a * a]]
    )  # fmt: skip
    mass = line * a / 420 * np.array(
        [[156, 22 * a, 54, -13 * a], [22 * a, 4 * a * a, 13 * a, -3 * a * a], [54, 13 * a, 156, -22 * a],
         [-13 * a, -3 * a * a, -22 * a, 4 * a * a]]
    )  # fmt: skip
    K, M = np.zeros((2, 2 * count + 2, 2 * count + 2))
    for k in range(count):
        here = slice(2 * k, 2 * k + 4)
        K[here, here] += stiffness
        M[here, here] += mass
    squares, shapes = eigh(K[2:, 2:], M[2:, 2:], subset_by_index=(0, modes - 1))
    deflections = np.vstack([np.zeros(modes), shapes[::2]])  # (49, modes)
    load = sum(4.138 * (-1) ** span * deflections[12 * span + k] for span in range(4) for k in range(1, 12))
    rows = np.ascontiguousarray(deflections[12::12])
    rms = _stepped(squares, 0.1526 + 1.79e-5 * squares, rows, load, step, round(0.25 / step), round(0.17 / step))
    return {f"rms force of stop {k}, N": float(value) for k, value in enumerate(rms, 1)}


@numba.njit(cache=True)
def _stepped(squares, damping, rows, load, step, steps, first):  # type: ignore[no-untyped-def]
    """Root mean squares of the forces of the stops after some steps, N (semi-implicit Euler)."""
    q, v = np.zeros(squares.size), np.zeros(squares.size)
    total = np.zeros(rows.shape[0])
    for k in range(steps):
        force = load * math.sin(251.2 * k * step)
        for j in range(rows.shape[0]):
            place = rows[j] @ q
            if abs(place) > GAP:
                push = -1e5 * (place - math.copysign(GAP, place)) - 0.28 * (rows[j] @ v)
                force += push * rows[j]
                if k >= first:
                    total[j] += push**2
        v += step * (force - squares * q - damping * v)
        q += step * v
    return np.sqrt(total / (steps - first))


def resonances() -> dict[str, float]:
    """Frequencies, Hz, of the highest peaks of the thesis's beam at its first resonance, and above 340 Hz, swept."""
    found = {}
    for name, low, high, least in (("first", 70, 90, 70), ("second", 300, 400, 340)):
        changes = {"sweep.from": low, "sweep.to": high, "sweep.rate": "6 oct/min", "sweep.direction": "up"}
        peaks = beamsim.sweep(config("sweep_one_sided_2g", changes)).peaks
        highest = max(
            (peak for peak in peaks if peak.probe == "tip" and peak.frequency_hz > least), key=lambda peak: peak.value_m
        )
        found[f"{name} resonance, Hz"] = float(highest.frequency_hz)
    return found


def backbones() -> dict[str, float]:
    """Frequencies, Hz, of the beam's nonlinear modes 1 and 2 with a spring of five times 107 kN/m."""
    changes = {"nnm.phase_resonance": None}
    return {
        f"mode {mode}, factor 5, Hz": float(
            beamsim.nnm(config(f"nnm_forced_mode_{mode}", changes)).branches[0]["frequency_hz"].values[-1]
        )
        for mode in (1, 2)
    }


def largest(frequency: int, changes: Mapping[str, Any], frame: str = "base") -> tuple[float, float]:
    """The largest displacement, m, and acceleration, g, of the tip from 0.7 to 0.8 s."""
    histories = beamsim.run(config(f"one_sided_{frequency}hz", {"run.convergence": "off", **changes}))["histories"]
    times = histories["time"].values
    last = times >= 0.7
    displacement = histories["displacement"].sel(probe="tip").values[last]
    if frame == "inertial":
        omega = 2 * np.pi * frequency
        displacement = displacement - 2 * GRAVITY / omega**2 * np.sin(omega * times[last])
    acceleration = np.abs(histories["absolute_acceleration"].sel(probe="tip").values[last]).max() / GRAVITY
    return float(displacement.max()), float(acceleration)


def choices() -> dict[str, list[list[float]]]:
    """Computed over printed amplitudes of the thesis, displacement and acceleration, with one choice changed."""
    closed = build_system(config("one_sided_65hz")).modes["closed_frequencies_hz"].values[0]
    proportional = {"kind": "rayleigh", "mass": 0.0, "stiffness": 2 * 0.01 / (2 * np.pi * closed)}
    others = [{"position": x, "mass": 4.0e-3} for x in (0.135, 0.189, 0.27)]
    printed_masses = [{"position": x, "mass": 0.045} for x in (0.135, 0.2025, 0.27)]
    options: dict[str, tuple[dict[str, Any], str, float]] = {
        "as in the configs": ({}, "base", 1.0),
        "damping proportional to stiffness, 1 % in contact": ({"beam.damping": proportional}, "base", 1.0),
        "modal damping of 2 %": ({"beam.damping.ratio": 0.02}, "base", 1.0),
        "modal damping of 5 %": ({"beam.damping.ratio": 0.05}, "base", 1.0),
        "no dashpot in the snubber": ({"snubbers[0].damping": None}, "base", 1.0),
        "a snubber that cannot pull": ({"snubbers[0].law": "no_tension"}, "base", 1.0),
        "dashpot of 10 %": ({"snubbers[0].damping.ratio": 0.1}, "base", 1.0),
        "displacement in space instead of relative to the base": ({}, "inertial", 1.0),
        "level of 1.1 g": ({}, "base", 1.1 / 2),
        "accelerometers of 4.0 g at 0.5, 0.7 and 1.0 of the length": ({"beam.point_masses": others}, "base", 1.0),
        "accelerometers of 45 g as printed": ({"beam.point_masses": printed_masses}, "base", 1.0),
        "spring of 559.625 kN/m as printed": ({"snubbers[0].stiffness": 559.625e3}, "base", 1.0),
    }  # fmt: skip
    return {
        name: [
            [float(f"{scale * value / of:.4g}") for value, of in zip(largest(hz, changes, frame), printed, strict=True)]
            for hz, printed in PRINTED.items()
        ]
        for name, (changes, frame, scale) in options.items()
    }


def main() -> None:
    """Compute the cases and keep them."""
    argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0]).parse_args()
    commit = ["git", "rev-parse", "--short=8", "HEAD"]
    values = {
        "duan_singh": duan_singh(),
        "sdnl301a": tube(),
        "sdnl301a, 30 modes by steps": tube_by_steps(30, 2e-7),
        "sdnl301a, all modes by steps": tube_by_steps(96, 1e-7),
        "resonances": resonances(),
        "backbones": backbones(),
    }
    table = {
        "date": datetime.date.today().isoformat(),
        "commit": subprocess.run(commit, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip(),
        "values": {
            name: {key: float(f"{value:.8g}") for key, value in found.items()} for name, found in values.items()
        },
        "thesis_choices": choices(),
    }
    TABLE.write_text(yaml.safe_dump(table, sort_keys=False, width=200), encoding="utf-8")


if __name__ == "__main__":
    main()
