"""Scenarios in which every key that takes a place stands once, and what a scenario resolves to.

``<30>`` is the place at 30 % of a body's length (``<y30>`` of the second side, or body); `text_of` writes it in a unit.
"""

import re
from pathlib import Path

import numpy as np

from beamsim.scenario.base import Schema, path_text
from beamsim.scenario.parameters import value_at
from beamsim.scenario.quantities import Share

CONFIGS = Path(__file__).parents[2] / "configs"

BEAM = """\
beam: {length: L, width: 50 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700 kg/m^3, elements: 8,
  nodes: [<30>, <55>], point_masses: [{position: <75>, mass: 4 g}], supports: {left: clamped},
  damping: {kind: modal, ratio: 1 %}}
snubbers:
  - {name: tip, position: <100>, side: below, stiffness: 151.1 kN/m, damping: {kind: ratio, ratio: 2 %}}
  - {name: middle, at: {position: <50>}, side: both, stiffness: 50 kN/m, gap: 1 mm}
springs_to_ground: [{kind: linear, position: <60>, stiffness: 1 kN/m}]
friction: [{name: rub, position: <70>, normal_force: 1 N, coefficient: 0.2, stiffness: 10 kN/m}]
constant_forces:
  - {position: <80>, force: 1 N}
  - {line: [<10>, <90>], force_per_length: 2 N/m}
  - {line: [<10>, <90>], force_per_length: 2 N/m, shape: {kind: table, x: [<10>, <90>], values: [1, 2]}}
excitation: {kind: harmonic, applied_to: {position: <65>}, level: 2 N, frequency: 65 Hz}
probes: [{name: a, position: <100>}, {name: b, at: {position: <45>}}]
outputs:
  - {name: w, kind: displacement, position: <40>}
  - {name: m, kind: bending_moment, at: {position: <20>}}
run: {duration: 0.05 s, outputs: [{name: s, kind: strain, position: <35>}],
  start: {released_force: {position: <85>, force: 1 N}}}
"""
SEGMENTS = """\
beam: {length: L, elements: 8, damping: {kind: modal, ratio: 1 %}, segments: [
  {from: <0>, to: <40>, width: 50 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700 kg/m^3},
  {from: <40>, to: <100>, width: 50 mm, thickness: 4 mm, youngs_modulus: 69 GPa, density: 2700 kg/m^3}]}
excitation: {kind: forces, forces: [
  {kind: harmonic, applied_to: {position: <40>}, level: 1 N, frequency: 65 Hz},
  {kind: harmonic, applied_to: {line: [<50>, <100>]}, level: 3 N/m, frequency: 65 Hz}]}
run: {duration: 0.05 s}
"""
BODIES = """\
bodies:
  one: {kind: beam, length: L, width: 50 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700, elements: 8}
  two: {kind: beam, length: W, width: 40 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700, elements: 8}
joints:
  - {name: rod, kind: spring, between: [{body: one, position: <60>}, {body: two, position: <y70>}], stiffness: 9 kN/m}
springs_between:
  - {kind: linear, between: [{body: one, position: <40>}, {body: two, position: <y45>}], stiffness: 2 kN/m}
constant_forces:
  - {body: two, line: [<y10>, <y90>], force_per_length: 2 N/m, shape: {kind: table, x: [<y10>, <y90>], values: [1, 2]}}
snubbers: [{name: tip, between: [{body: one, position: <100>}, {body: two, position: <y95>}], stiffness: 50 kN/m}]
friction: [{name: rub, between: [{body: one, position: <75>}, {body: two, position: <y80>}], normal_force: 1 N,
  coefficient: 0.2, stiffness: 10 kN/m}]
excitation: {kind: harmonic, applied_to: base, level: 1 g, frequency: 40 Hz}
outputs: [{name: w, kind: displacement, at: {body: two, position: <y40>}}]
probes: [{name: a, at: {body: one, position: <50>}}]
run: {duration: 0.05 s}
"""
PLATE = """\
bodies:
  panel: {kind: plate, length: L, width: W, thickness: 2 mm, youngs_modulus: 70 GPa, density: 2700,
    poissons_ratio: 0.33, elements: [4, 4], supports: {left: clamped, points: [{position: [<100>, <y90>]}]},
    point_masses: [{position: [<30>, <y40>], mass: 10 g}],
    stiffeners: [{from: [<0>, <y50>], to: [<100>, <y50>], bending_stiffness: 3 N m^2, mass_per_length: 0.1 kg/m}],
    damping: {kind: modal, ratio: 1 %}}
snubbers: [{name: stop, position: [<80>, <y20>], side: below, stiffness: 20 kN/m, gap: 0.1 mm}]
constant_forces:
  - {area: [[<10>, <y10>], [<60>, <y90>]], pressure: 20 Pa}
  - {area: whole, pressure: 9 Pa, shape: {kind: table, x: [<0>, <50>], y: [<y10>, <y30>], values: [[1, 2], [2, 3]]}}
excitation: {kind: half_sine, applied_to: base, level: 5 g, duration: 11 ms}
outputs: [{name: w, kind: displacement, position: [<40>, <y60>]},
  {name: s, kind: stress, at: {position: [<20>, <y30>]}}]
probes: [{name: a, position: [<50>, <y50>]}]
run: {duration: 0.05 s}
"""
IMPORTED = f"""\
bodies:
  panel: {{kind: matrices, mass: {{file: {CONFIGS}/matrices/strip.op4, name: mxx}}, base: {{nodes: [15], direction: z}},
    stiffness: {{file: {CONFIGS}/matrices/strip.op4, name: kxx}}, dofs: {CONFIGS}/matrices/strip_dofs.csv,
    damping: {{kind: modal, ratio: 1 %}}}}
  yoke: {{kind: beam, length: W, width: 40 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700, elements: 4}}
joints: [{{kind: spring, between: [{{body: panel, node: 14}}, {{body: yoke, position: <y60>}}], stiffness: 20 kN/m}}]
snubbers:
  - {{name: corner, at: {{body: panel, node: 14, direction: z}}, side: below, stiffness: 100 kN/m, gap: 0.1 mm}}
  - {{name: yoke, between: [{{body: panel, node: 10}}, {{body: yoke, position: <y90>}}], stiffness: 10 kN/m, gap: 1 mm}}
excitation: {{kind: harmonic, applied_to: base, level: 2 g, frequency: 20 Hz}}
probes: [{{name: a, at: {{body: yoke, position: <y100>}}}}]
outputs: [{{name: w, kind: displacement, at: {{body: yoke, position: <y45>}}}}]
reduction: {{modes: 8}}
run: {{duration: 0.05 s}}
"""
FOLLOWED = """\
bodies:
  other: {kind: chain, masses: [1.0], springs: [1000.0]}
  one: {kind: beam, length: L, width: 50 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700, elements: 4}
snubbers:
  - {name: mass, at: {body: other, mass: 1}, side: below, stiffness: 1 kN/m, gap: 1 mm}
  - {name: tip, at: {body: one, position: <70>}, side: below, stiffness: 50 kN/m, gap: 0.1 mm}
excitation: {kind: harmonic, applied_to: base, level: 1 g, frequency: 40 Hz}
sweep: {kind: continuation, continue_in: {kind: position, snubber: tip, from: <45>, to: <95>, points_at: [<60>, <80>]}}
identify_stiffness: {snubber: tip, measured_without: [20 Hz, 120 Hz], measured_with: [60 Hz],
  shapes_without: {positions: [<30>, <60>, <100>], shapes: [[0.1, 0.4, 1.0]]},
  update: [{parameter: snubbers.tip.at.position, bounds: [<50>, <90>]}]}
vary: {kind: grid, parameters: [{path: snubbers.tip.at.position, values: [<55>, <85>]}]}
"""
FOLDS = """\
beam: {length: L, width: 50 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700 kg/m^3, elements: 4}
snubbers: [{name: tip, position: <90>, side: below, stiffness: 50 kN/m, gap: 0.1 mm}]
excitation: {kind: harmonic, applied_to: base, level: 1 g, frequency: 40 Hz}
sweep: {kind: continuation, from: 20 Hz, to: 90 Hz, follow_points_in: {kind: position, from: <70>, to: <100>}}
"""
FRAME = """\
bodies:
  bracket: {kind: frame, nodes: {foot: [0, 0, 0], head: [0, 0, W], far: [L, 0, W]},
    sections: {tube: {section: {kind: tube, outer_diameter: 20 mm, wall_thickness: 2 mm}, youngs_modulus: 69 GPa,
      density: 2700}},
    members: {post: {nodes: [foot, head]}, arm: {nodes: [head, far]}}, supports: {foot: clamped},
    point_masses: [{member: arm, position: <75>, mass: 40 g}],
    recovered: {root: {member: post, position: <y10>, quantity: moment_y}},
    damping: {kind: modal, ratio: 1 %}}
snubbers:
  - {name: tip, at: {member: arm, position: <90>, direction: z}, side: below, stiffness: 100 kN/m, gap: 0.1 mm}
friction: [{name: rub, at: {member: post, position: <y80>, direction: y}, normal_force: 1 N, coefficient: 0.2,
  stiffness: 10 kN/m}]
excitation: {kind: harmonic, applied_to: {member: arm, position: <40>, direction: y}, level: 2 N, frequency: 20 Hz}
probes: [{name: a, at: {member: arm, position: <60>, direction: y}}]
outputs: [{name: m, kind: recovered, row: root, unit: N m}]
run: {duration: 0.05 s}
"""
CASES = {
    "beam": BEAM, "segments": SEGMENTS, "bodies": BODIES, "plate": PLATE, "imported": IMPORTED, "followed": FOLLOWED,
    "folds": FOLDS, "frame": FRAME,
}  # fmt: skip
MARKER = re.compile(r"<(y?)(\d+)>")
UNITS = {
    "percent": lambda share, side: f"{share} %",
    "metres": lambda share, side: repr(share * side / 100),
    "millimetres": lambda share, side: f"{share * side * 10!r} mm",
}


def text_of(case, unit, sides=(0.27, 0.18), moved=None):
    """A case with its places written in a unit.

    ``sides`` are the lengths of its bodies, m, and ``moved`` gives to a marker's number another share in percent.
    """
    text = re.sub(r"\b([LW])\b", lambda m: repr(sides["LW".index(m[1])]), CASES[case])
    share = (moved or {}).get

    def written(match):
        return UNITS[unit](share(int(match[2]), int(match[2])), sides[len(match[1])])

    return MARKER.sub(written, text)


def resolved(scenario, *without):
    """By path every value of a scenario, defaults among them and shares of lengths in metres."""
    found = {}

    def add(path, value):
        if isinstance(value, Schema):
            for key, name in type(value).attributes().items():
                add((*path, key), getattr(value, name))
        elif isinstance(value, (dict, tuple)):
            for key, part in value.items() if isinstance(value, dict) else enumerate(value):
                add((*path, key), part)
        elif path[0] not in without:
            found[path_text(path)] = value_at(scenario, path) if isinstance(value, Share) else value

    for key, name in type(scenario).attributes().items():
        if key != "units":
            add((key,), getattr(scenario, name))
    if scenario.run is not None:
        found["run.sample_rate"] = scenario.sample_rate
    return found


def differences(one, other, rtol=1e-14):
    """Paths at which resolved values, or paths of problems, differ by more than round-off."""
    if not isinstance(one, dict) or not isinstance(other, dict):
        return [] if one == other else [f"{one} and {other}"]
    different = [f"{path}: only once" for path in one.keys() ^ other.keys()]
    for path in one.keys() & other.keys():
        a, b = one[path], other[path]
        if path.endswith((".file", ".dofs")):
            a, b = (str(file).rpartition("/")[2] for file in (a, b))  # of a study with its folder
        numbers = all(isinstance(x, (int, float)) for x in (a, b))
        if not (np.isclose(a, b, rtol=rtol, atol=0.0) if numbers else a == b):
            different.append(f"{path}: {a} and {b}")
    return different
