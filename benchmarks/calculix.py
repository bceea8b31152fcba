"""The decks of CalculiX and its numbers: ``python -m benchmarks.calculix [NAME...]``.

Writes the input decks of `docs/site_pages/finite_elements.py` from their scenarios to ``tests/reference/calculix`` and,
where ``ccx`` is installed (Debian: ``apt-get install calculix-ccx``), runs those named (by default all) with every mesh
and step, and keeps the numbers there. ``--check`` compares with the kept numbers instead.

Beams are B32R and plates S8R, which ccx expands to one layer of 20-node bricks with reduced integration. Poisson's
ratio of beams is 0, so that a row of bricks is a beam. The base is at rest, and its motion is a body force and forces
on the point masses. Stops are springs with a table of forces (SPRINGA), which are 100 mm long.
"""

from __future__ import annotations

import argparse
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

import beamsim
from docs.site_pages.finite_elements import (
    FOLDER,
    NUMBERS,
    ON_ONE_STOP,
    ON_TWO_STOPS,
    PORTAL,
    motion,
    named,
    numbers,
    scenario,
)

ARM = 0.1  # m, length of a stop
BEAM_MESHES, PLATE_MESHES, FRAME_MESHES = (10, 20), ((14, 8), (28, 16)), (8, 16)
BEAM_STEPS, PLATE_STEPS = (4e-5, 2e-5, 1e-5), (5e-4, 2.5e-4)
POINTS_OF_PERIOD = 300  # of the table of the motion of the base


def ended(lines: Sequence[str]) -> str:
    """The text of a deck."""
    return "\n".join([*lines, "*END STEP"]) + "\n"


def material(young: float, poisson: float, density: float) -> list[str]:
    """The only material."""
    return ["*MATERIAL, NAME=ALL", "*ELASTIC", f"{young:.9g}, {poisson:g}", "*DENSITY", f"{density:.9g}"]


def stops(
    nodes: Mapping[int, tuple[float, float]],
    used: tuple[int, int],
    stiffnesses: Sequence[float],
    gaps: Sequence[float] | None,
) -> list[str]:
    """Springs below nodes, linear without gaps; with them, without tension.

    Parameters
    ----------
    nodes : by number, their places, m.
    used : numbers of nodes and of elements so far; ccx is slow with large numbers.
    stiffnesses : N/m.
    gaps : m.
    """
    lines = ["*NODE, NSET=NGROUND"]
    lines += [f"{used[0] + 1 + k}, {x:.9g}, {y:.9g}, {-ARM:g}" for k, (x, y) in enumerate(nodes.values())]
    for k, (node, stiffness) in enumerate(zip(nodes, stiffnesses, strict=True)):
        lines += [f"*ELEMENT, TYPE=SPRINGA, ELSET=ESTOP{k}", f"{used[1] + 1 + k}, {used[0] + 1 + k}, {node}"]
        if gaps is None:
            lines += [f"*SPRING, ELSET=ESTOP{k}", "", f"{stiffness:.1f}"]  # ccx needs the empty line and the point
        else:
            pressed, rest = f"{-stiffness * ARM:.1f}, {-ARM - gaps[k]:.9g}", f"0., {-gaps[k]:.9g}"
            lines += [f"*SPRING, ELSET=ESTOP{k}, NONLINEAR", pressed, rest, f"0., {ARM:g}"]
    return [*lines, "*BOUNDARY", "NGROUND, 1, 3"]


def eigenfrequencies(count: int) -> list[str]:
    """The step that computes modes."""
    return ["*STEP", "*FREQUENCY", str(count)]


def shaken(case: Any, step: float, elements: str, tips: Sequence[int], masses: Mapping[int, float]) -> list[str]:
    """The step of a base that moves harmonically from rest: implicit dynamics without numerical damping."""
    level, frequency, duration = case.excitation.level, case.excitation.frequency, case.run.duration
    spacing = 1.0 / (POINTS_OF_PERIOD * frequency)
    times = [k * spacing for k in range(math.ceil(duration / spacing) + 2)]
    points = [f"{time:.9g}, {math.sin(2.0 * math.pi * frequency * time):.9g}" for time in times]
    return [
        "*NSET, NSET=NTIP", *map(str, tips),
        "*AMPLITUDE, NAME=BASE", *(", ".join(points[k : k + 4]) for k in range(0, len(points), 4)),
        "*STEP, INC=1000000", "*DYNAMIC, DIRECT, ALPHA=0", f"{step:g}, {duration:g}",
        "*DLOAD, AMPLITUDE=BASE", f"{elements}, GRAV, {level:.9g}, 0, 0, -1",
        *(["*CLOAD, AMPLITUDE=BASE", *(f"{node}, 3, {-mass * level:.9g}" for node, mass in masses.items())]
          if masses else []),
        "*NODE PRINT, NSET=NTIP", "U", "*NODE PRINT, NSET=NGROUND", "RF",
    ]  # fmt: skip


def beam_deck(elements: int, stop: str, step: float = 0.0) -> str:
    """The cantilever with its point masses; ``stop``: none, linear, gap."""
    case = scenario("one_sided_65hz", ON_ONE_STOP)
    beam, (tip,) = case.beam, case.snubbers
    count = 2 * elements + 1
    masses = {round(of.position / beam.length * (count - 1)) + 1: of.mass for of in beam.point_masses}
    lines = ["*NODE, NSET=NALL", *(f"{k + 1}, {beam.length * k / (count - 1):.9g}, 0, 0" for k in range(count))]
    lines += ["*ELEMENT, TYPE=B32R, ELSET=EBEAM"]
    lines += [f"{k + 1}, {2 * k + 1}, {2 * k + 2}, {2 * k + 3}" for k in range(elements)]
    for k, (node, mass) in enumerate(masses.items(), 1):
        lines += [
            f"*ELEMENT, TYPE=MASS, ELSET=EMASS{k}",
            f"{elements + k}, {node}",
            f"*MASS, ELSET=EMASS{k}",
            f"{mass:g}",
        ]
    lines += material(beam.youngs_modulus, 0.0, beam.density)
    lines += ["*BEAM SECTION, ELSET=EBEAM, MATERIAL=ALL, SECTION=RECT", f"{beam.width:g}, {beam.thickness:g}"]
    lines += ["0, 1, 0", "*BOUNDARY", "1, 1, 6"]
    if stop != "none":
        gaps = [tip.gap] if stop == "gap" else None
        lines += stops({count: (beam.length, 0.0)}, (count, elements + len(masses)), [tip.stiffness], gaps)
    last = shaken(case, step, "EBEAM", [count], masses) if step else eigenfrequencies(16)
    return ended([*lines, *last])


def plate_deck(mesh: tuple[int, int], stop: str, step: float = 0.0) -> str:
    """The panel; ``stop``: none, linear, gap."""
    case = scenario("plate_panel", ON_TWO_STOPS)
    plate, (nx, ny) = case.bodies["panel"], mesh
    places = [(i, j) for j in range(2 * ny + 1) for i in range(2 * nx + 1) if not (i % 2 and j % 2)]
    ids = {place: k for k, place in enumerate(places, 1)}
    dx, dy = plate.length / (2 * nx), plate.width / (2 * ny)
    lines = ["*NODE, NSET=NALL", *(f"{k}, {i * dx:.9g}, {j * dy:.9g}, 0" for (i, j), k in ids.items())]
    lines += ["*ELEMENT, TYPE=S8R, ELSET=EPLATE"]
    around = ((0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1))
    corners = [(i, j) for j in range(0, 2 * ny, 2) for i in range(0, 2 * nx, 2)]
    for number, (i, j) in enumerate(corners, 1):
        lines += [", ".join(map(str, (number, *(ids[i + p, j + q] for p, q in around))))]
    lines += ["*NSET, NSET=NCLAMPED", *(str(ids[0, j]) for j in range(2 * ny + 1))]
    lines += material(plate.youngs_modulus, plate.poissons_ratio, plate.density)
    lines += ["*SHELL SECTION, ELSET=EPLATE, MATERIAL=ALL", f"{plate.thickness:g}", "*BOUNDARY", "NCLAMPED, 1, 6"]
    tips = {ids[2 * nx, j]: (plate.length, j * dy) for j in (0, 2 * ny)}
    if stop != "none":
        gaps = [of.gap for of in case.snubbers] if stop == "gap" else None
        lines += stops(tips, (len(ids), nx * ny), [of.stiffness for of in case.snubbers], gaps)
    last = shaken(case, step, "EPLATE", [*tips], {}) if step else eigenfrequencies(8)
    return ended([*lines, *last])


def frame_deck(elements: int) -> str:
    """The portal frame, all members with as many elements."""
    frame = beamsim.load_scenario(PORTAL).bodies["portal"]
    places: dict[tuple[float, ...], int] = {}
    members: dict[str, list[list[int]]] = {}
    for name, member in frame.members.items():
        first, last = (np.asarray(frame.nodes[node], dtype=float) for node in member.nodes)
        along = [first + (last - first) * k / (2 * elements) for k in range(2 * elements + 1)]
        ids = [places.setdefault(tuple(np.round(place, 9).tolist()), len(places) + 1) for place in along]
        members[name] = [ids[2 * k : 2 * k + 3] for k in range(elements)]
    lines = ["*NODE, NSET=NALL", *(", ".join([str(k), *(f"{x:.9g}" for x in at)]) for at, k in places.items())]
    (section,) = frame.sections.values()
    number = 0
    for name, of in members.items():
        lines += [f"*ELEMENT, TYPE=B32R, ELSET=E{name.replace(' ', '')}"]
        for nodes in of:
            number += 1
            lines += [", ".join(map(str, (number, *nodes)))]
    lines += material(section.youngs_modulus, section.poissons_ratio, section.density)
    for name in members:  # the width is along y
        lines += [f"*BEAM SECTION, ELSET=E{name.replace(' ', '')}, MATERIAL=ALL, SECTION=RECT"]
        lines += [f"{section.section.width:g}, {section.section.thickness:g}", "0, 1, 0"]
    lines += ["*BOUNDARY"]
    lines += [f"{places[tuple(map(float, frame.nodes[node]))]}, 1, 6" for node in frame.supports]
    return ended([*lines, *eigenfrequencies(10)])


DECKS: dict[str, Callable[[], str]] = {
    **{f"beam_{n}": lambda n=n: beam_deck(n, "none") for n in BEAM_MESHES},
    **{f"beam_{n}_closed": lambda n=n: beam_deck(n, "linear") for n in BEAM_MESHES},
    "beam_10_gap": lambda: beam_deck(10, "gap", BEAM_STEPS[-1]),
    **{f"plate_{m[0]}_{m[1]}": lambda m=m: plate_deck(m, "none") for m in PLATE_MESHES},
    "plate_14_8_closed": lambda: plate_deck((14, 8), "linear"),
    "plate_14_8_gap": lambda: plate_deck((14, 8), "gap", PLATE_STEPS[-1]),
    **{f"frame_{n}": lambda n=n: frame_deck(n) for n in FRAME_MESHES},
}  # fmt: skip
"""The kept decks; those of the other meshes and steps differ in the mesh or in the line of the step."""


def results_of(deck: str) -> str:
    """What ccx prints about a deck.

    Raises
    ------
    RuntimeError
        If it stops with an error.
    """
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "deck.inp").write_text(deck, encoding="utf-8")
        done = subprocess.run(
            ["ccx", "-i", "deck"], cwd=folder, capture_output=True, text=True, env=os.environ | {"OMP_NUM_THREADS": "1"}
        )
        if "*ERROR" in done.stdout or done.returncode:
            raise RuntimeError(done.stdout[-2000:])
        return (Path(folder) / "deck.dat").read_text(encoding="utf-8")


def rows_between(text: str, heading: str, columns: int) -> list[list[float]]:
    """The rows of numbers of a table below a heading, whose letters are apart."""
    below = text[text.index(" ".join(heading)) :].splitlines()[1:]
    found: list[list[float]] = []
    for line in below:
        cells = line.split()
        if len(cells) == columns and cells[0].isdigit():
            found.append([float(cell) for cell in cells])
        elif found:
            break
    return found


def modes(deck: str, count: int, across: bool = False) -> list[float]:
    """The first frequencies, Hz; with ``across`` of motions along z alone."""
    text = results_of(deck)
    frequencies = [row[3] for row in rows_between(text, "EIGENVALUE", 5)]
    if across:
        shares = np.abs([row[1:4] for row in rows_between(text, "PARTICIPATION", 7)])
        frequencies = [f for f, share in zip(frequencies, shares, strict=True) if np.argmax(share) == 2]
    return [float(f"{value:.7g}") for value in frequencies[:count]]


def transient(deck: str, names: Sequence[str]) -> dict[str, float]:
    """Values of the motion of the first tip, and of the forces of the stops."""
    values: dict[str, list[float]] = {"displacements": [], "forces": []}
    times, kind = [], ""
    for line in results_of(deck).splitlines():
        if found := re.match(r" (displacements|forces) .* time\s+(\S+)", line):
            kind = found[1]
            times += [float(found[2])] if kind == "displacements" else []
        elif cells := line.split():
            values[kind].append(float(cells[3]))
    tips = np.reshape(values["displacements"], (len(times), -1))[:, 0]
    of_stops = np.abs(np.reshape(values["forces"], (len(times), -1)).T)
    found = motion(tips, dict(zip(names, of_stops, strict=True)), np.array(times))
    return {name: float(f"{value:.5g}") for name, value in found.items()}


def beam() -> dict[str, Any]:
    """Frequencies of the beam by mesh."""
    return {
        f"{n} elements": named("open", modes(beam_deck(n, "none"), 5, across=True))
        | named("on the stop", modes(beam_deck(n, "linear"), 5, across=True))
        for n in BEAM_MESHES
    }


def plate() -> dict[str, Any]:
    """Frequencies of the plate by mesh."""
    return {
        f"{nx} x {ny} elements": named("open", modes(plate_deck((nx, ny), "none"), 8))
        | named("on both stops", modes(plate_deck((nx, ny), "linear"), 8))
        for nx, ny in PLATE_MESHES
    }


def frame() -> dict[str, Any]:
    """Frequencies of the portal frame by mesh."""
    return {f"{n} elements": named("frequency", modes(frame_deck(n), 10)) for n in FRAME_MESHES}


def beam_on_a_stop() -> dict[str, Any]:
    """The motion of the beam by mesh and step."""
    cases = [*((10, step) for step in BEAM_STEPS), (20, BEAM_STEPS[1])]
    return {f"{n} elements, {1e6 * step:g} µs": transient(beam_deck(n, "gap", step), [""]) for n, step in cases}


def plate_on_two_stops() -> dict[str, Any]:
    """The motion of the plate by mesh and step."""
    cases = [((8, 5), PLATE_STEPS[0]), *(((14, 8), step) for step in PLATE_STEPS)]
    return {
        f"{m[0]} x {m[1]} elements, {1e6 * step:g} µs": transient(plate_deck(m, "gap", step), [" of near", " of far"])
        for m, step in cases
    }


COMPUTED = {of.__name__: of for of in (beam, plate, frame, beam_on_a_stop, plate_on_two_stops)}


def differences(kept: Mapping[str, Any], new: Mapping[str, Any]) -> list[str]:
    """Where new numbers differ from kept ones by more than the last digits."""
    return [
        f"{mesh}: {quantity} was {value:g} and is {new[mesh][quantity]:g}"
        for mesh, values in kept.items()
        for quantity, value in values.items()
        if not math.isclose(value, new[mesh][quantity], rel_tol=1e-3)
    ]


def main() -> int:
    """Write the decks, and compute or compare the numbers."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("names", nargs="*", choices=[[], *COMPUTED], help="what is computed")
    parser.add_argument("--check", action="store_true", help="compare with the kept numbers")
    options = parser.parse_args()
    FOLDER.mkdir(exist_ok=True)
    for name, deck in DECKS.items():
        (FOLDER / f"{name}.inp").write_text(deck(), encoding="utf-8")
    if shutil.which("ccx") is None:
        print("ccx is not installed (Debian: apt-get install calculix-ccx); the decks are written, the numbers kept")
        return 0
    kept, failed = dict(numbers()) if NUMBERS.exists() else {}, False
    for name in options.names or COMPUTED:
        new = COMPUTED[name]()
        if options.check:
            wrong = differences(kept[name], new)
            print("\n".join([f"{name}: {len(wrong)} differences", *wrong]))
            failed = failed or bool(wrong)
            continue
        kept[name] = new
        text = yaml.safe_dump(kept, sort_keys=False, allow_unicode=True)
        NUMBERS.write_text(f"# Numbers of CalculiX 2.20: python -m benchmarks.calculix\n{text}", encoding="utf-8")
        print(f"{name} is computed")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
