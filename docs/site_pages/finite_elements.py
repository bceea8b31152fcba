"""A beam, a plate, a frame and stops computed by CalculiX too: the cases, its kept numbers, and those of beamsim.

`benchmarks/calculix.py` writes its input decks from these scenarios and keeps its numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import yaml

import beamsim
from beamsim.system.build import build_system

from .configs import CONFIGS
from .published import Published

FOLDER = Path(__file__).parents[2] / "tests" / "reference" / "calculix"
NUMBERS = FOLDER / "numbers.yaml"
SOURCE = "CalculiX 2.20 (ccx, Debian), `python -m benchmarks.calculix`"
UNDAMPED = {"run.start": "rest", "run.convergence": "off", "run.spectrum": None}
ON_ONE_STOP = {
    **UNDAMPED, "beam.damping": None, "snubbers.tip.damping": None, "snubbers.tip.gap": "0.05 mm",
    "run.duration": "50 ms", "run.sample_rate": "100 kHz",
}  # fmt: skip
ON_TWO_STOPS = {
    **UNDAMPED, "bodies.panel.damping": None, "snubbers.near.gap": "0.1 mm", "snubbers.far.gap": "0.2 mm",
    "run.duration": "120 ms", "run.sample_rate": "50 kHz",
}  # fmt: skip
PORTAL = {
    "bodies": {
        "portal": {
            "kind": "frame",
            "nodes": {"foot": [0, 0, 0], "left": [0, 0, 0.8], "right": [1, 0, 0.8], "other foot": [1, 0, 0]},
            "sections": {
                "flat": {
                    "section": {"kind": "rectangle", "width": "60 mm", "thickness": "10 mm"}, "theory": "timoshenko",
                    "youngs_modulus": "200 GPa", "poissons_ratio": 0, "density": 7850,
                }
            },
            "members": {
                "column": {"nodes": ["foot", "left"], "orientation": [1, 0, 0]},
                "beam": {"nodes": ["left", "right"], "orientation": [0, 0, 1]},
                "other column": {"nodes": ["other foot", "right"], "orientation": [1, 0, 0]},
            },
            "supports": {"foot": "clamped", "other foot": "clamped"},
            "elements": 8,
        }
    },
    "excitation": {"kind": "harmonic", "applied_to": "base", "direction": "x", "level": "1 g", "frequency": "8 Hz"},
    "probes": [{"name": "corner", "at": {"node": "left", "direction": "x"}}],
    "reduction": {"modes": 12},
}  # fmt: skip


def numbers() -> Mapping[str, Any]:
    """The kept numbers of CalculiX."""
    found: Mapping[str, Any] = yaml.safe_load(NUMBERS.read_text(encoding="utf-8"))
    return found


def scenario(name: str, changes: Mapping[str, Any] | None = None) -> Any:
    """A shipped scenario with changes."""
    return beamsim.load_scenario(CONFIGS[name], {**(changes or {})})


def named(what: str, values: Sequence[float]) -> dict[str, float]:
    """Frequencies of modes by name."""
    return {f"{what}, mode {mode}, Hz": float(value) for mode, value in enumerate(values, 1)}


def motion(displacement: Any, forces: Mapping[str, Any], time: Any, unit: float = 1e-3) -> dict[str, float]:
    """Values of a motion by name: the largest displacements of a point both ways, mm, and the peak forces of stops, N.

    Parameters
    ----------
    displacement : (times,) m.
    forces : by name of the stop, (times,) N.
    time : (times,) s.
    unit : of time in the names, s.
    """
    top = int(np.argmax(displacement))
    found = {
        "largest displacement, mm": 1e3 * float(displacement[top]), "at, ms": float(time[top]) / unit,
        "smallest displacement, mm": 1e3 * float(np.min(displacement)),
    }  # fmt: skip
    return found | {f"peak force{of}, N": float(np.max(force)) for of, force in forces.items()}


def modes_of(case: Any, count: int, closed: str = "") -> dict[str, float]:
    """The first frequencies of a structure, and those with closed stops under a name."""
    modes = build_system(case).modes
    found = named("open" if closed else "frequency", modes["open_frequencies_hz"].values[:count])
    return found | (named(closed, modes["closed_frequencies_hz"].values[:count]) if closed else {})


def beam() -> dict[str, float]:
    """Frequencies of the cantilever, Hz."""
    return modes_of(scenario("one_sided_65hz"), 5, "on the stop")


def timoshenko_beam() -> list[float]:
    """All frequencies of the cantilever as Timoshenko members of a frame, Hz, of motions along all axes."""
    beam = scenario("one_sided_65hz").beam
    places = {"root": 0.0} | {f"mass {k}": mass.position for k, mass in enumerate(beam.point_masses, 1)}
    members = list(places)
    flat = {"kind": "rectangle", "width": beam.width, "thickness": beam.thickness}
    frame = {
        "kind": "frame", "nodes": {name: [x, 0, 0] for name, x in places.items()},
        "sections": {"flat": {"section": flat, "theory": "timoshenko", "poissons_ratio": 0,
                              "youngs_modulus": beam.youngs_modulus, "density": beam.density}},
        "members": {f"to {end}": {"nodes": [start, end]} for start, end in pairwise(members)},
        "supports": {"root": "clamped"}, "elements": 8,
        "point_masses": [{"node": f"mass {k}", "mass": of.mass} for k, of in enumerate(beam.point_masses, 1)],
    }  # fmt: skip
    case = {**PORTAL, "bodies": {"bar": frame}, "probes": [{"name": "tip", "at": {"node": members[-1]}}]}
    frequencies = build_system(beamsim.load_scenario(case)).modes["open_frequencies_hz"].values
    return [float(value) for value in frequencies]


def plate() -> dict[str, float]:
    """Frequencies of the panel, Hz."""
    changes = {"bodies.panel.elements": [28, 16], "reduction": None}
    return modes_of(scenario("plate_panel", changes), 8, "on both stops")


def frame() -> dict[str, float]:
    """Frequencies of the portal frame, Hz."""
    return modes_of(beamsim.load_scenario(PORTAL), 10)


def _ran(case: Any, probe: str, names: Mapping[str, str]) -> dict[str, float]:
    found = beamsim.run(case)["histories"]
    forces = {of: found["snubber_force"].sel(snubber=name).values for name, of in names.items()}
    return motion(found["displacement"].sel(probe=probe).values, {**forces}, found["time"].values)


def beam_on_a_stop() -> dict[str, float]:
    """The cantilever, which meets its stop across a gap."""
    return _ran(scenario("one_sided_65hz", ON_ONE_STOP), "tip", {"tip": ""})


def plate_on_two_stops() -> dict[str, float]:
    """The panel, which meets two stops across different gaps."""
    return _ran(scenario("plate_panel", ON_TWO_STOPS), "corner", {"near": " of near", "far": " of far"})


def _convergence(kept: Mapping[str, Mapping[str, float]]) -> str:
    """The values of the other meshes and steps over those of the last one, in words."""
    *others, last = kept.items()
    ranges = []
    for mesh, values in others:
        differences = [100.0 * (value / last[1][quantity] - 1.0) for quantity, value in values.items()]
        ranges.append(f"{mesh}: {min(differences):+.2g} to {max(differences):+.2g} %")
    return f"CalculiX with {last[0]}. Its values otherwise, over these: {'; '.join(ranges)}."


SHEAR = (
    "A body of kind beam has no shear deformation and no rotary inertia; bricks have both. With Timoshenko members of "
    "a frame in its place the difference is 0.1 %."
)
MESH = (
    "The mesh of CalculiX: from 8 x 5 to 14 x 8 elements all of its values approach those of beamsim, by 0.4 to 0.8 %; "
    "its frequencies with 14 x 8 elements are up to 0.5 % above those with 28 x 16."
)
CASES = (
    ("Frequencies of a cantilever", beam, SHEAR),
    ("Frequencies of a plate", plate, ""),
    ("Frequencies of a portal frame", frame, ""),
    ("A cantilever that meets a stop", beam_on_a_stop, ""),
    ("A plate that meets two stops", plate_on_two_stops, MESH),
)


def published() -> list[Published]:
    """The cases as the page of validation has them."""
    kept = numbers()
    return [
        Published(
            title, SOURCE, {}, computed, [*kept[computed.__name__].values()][-1], "CalculiX",
            why_right=why, note=_convergence(kept[computed.__name__]),
        )
        for title, computed, why in CASES
    ]  # fmt: skip
