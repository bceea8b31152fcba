"""Processor time and peak memory of large imported models: a plate of shells' kind, and a solid of hexahedra.

    python -m benchmarks.large_models plate 100000
    python -m benchmarks.large_models solid 30000 --shape cube

The model is written as a binary OP4 file in a folder of its own; measured is what `beamsim run` does from there.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from beamsim.matrix_files import write_matrices
from beamsim.structures.named_matrices import DofTable, write_dof_table
from beamsim.typing import Floats, Ints

YOUNG, POISSON, DENSITY = 70e9, 0.33, 2700.0
CASE = """
bodies:
  model:
    kind: matrices
    mass: {{file: model.op4, name: mass}}
    stiffness: {{file: model.op4, name: stiff}}
    dofs: dofs.csv
    base: {{nodes: [{base}], direction: z}}
    damping: {{kind: modal, ratio: 1 %}}
snubbers:
  - {{name: corner, at: {{node: {corner}, direction: z}}, side: below, stiffness: 50 kN/m, gap: 0.01 mm}}
excitation: {{kind: harmonic, applied_to: base, level: 2 g, frequency: 20 Hz}}
run: {{duration: 0.1 s, sample_rate: 10 kHz, convergence: 'off'}}
"""


def element_matrices(h: Floats) -> tuple[Floats, Floats]:
    """(24, 24) stiffness and mass of a trilinear hexahedron with sides h, m; two Gauss points along each axis.

    T. J. R. Hughes, The Finite Element Method (2000), section 3.5; corners in the order of x, then y, then z.
    """
    corners = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], dtype=float)
    lame, shear = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON)), YOUNG / (2 * (1 + POISSON))
    law = np.diag([2 * shear] * 3 + [shear] * 3)
    law[:3, :3] += lame
    stiffness, mass, volume = np.zeros((24, 24)), np.zeros((24, 24)), float(np.prod(h)) / 8
    for point in corners / np.sqrt(3):
        shape = np.prod(1 + corners * point, axis=1) / 8
        slope = np.empty((8, 3))
        for axis in range(3):
            others = [other for other in range(3) if other != axis]
            slope[:, axis] = corners[:, axis] * np.prod(1 + (corners * point)[:, others], axis=1) / 8 * 2 / h[axis]
        strain = np.zeros((6, 24))
        for axis in range(3):
            strain[axis, axis::3] = slope[:, axis]
        for row, (i, j) in enumerate(((0, 1), (1, 2), (0, 2)), 3):
            strain[row, i::3], strain[row, j::3] = slope[:, j], slope[:, i]
        stiffness += volume * strain.T @ law @ strain
        mass += volume * DENSITY * np.kron(np.outer(shape, shape), np.eye(3))
    return stiffness, mass


def solid(counts: Ints, sides: Floats) -> tuple[DofTable, Any, Any, Ints]:
    """Names, stiffness and mass of a block of hexahedra, and its nodes at x = 0, which the base holds."""
    from scipy.sparse import coo_array

    nodes = counts + 1
    number = np.arange(int(np.prod(nodes))).reshape(nodes[::-1])  # z, y, x
    cells = np.stack(
        [number[k : k + counts[2], j : j + counts[1], i : i + counts[0]].ravel()
         for k in (0, 1) for j in (0, 1) for i in (0, 1)], axis=1,
    )  # fmt: skip
    dofs = (3 * cells[:, :, None] + np.arange(3)).reshape(len(cells), 24)
    rows, columns = np.repeat(dofs, 24, axis=1).ravel(), np.tile(dofs, (1, 24)).ravel()
    size = 3 * number.size
    stiffness, mass = (
        coo_array((np.tile(matrix.ravel(), len(cells)), (rows, columns)), shape=(size, size)).tocsc()
        for matrix in element_matrices(sides / counts)
    )
    z, y, x = np.unravel_index(np.arange(number.size), nodes[::-1])
    places = np.column_stack([x, y, z]) * (sides / counts)
    names = tuple((n + 1, direction) for n in range(number.size) for direction in "xyz")
    return DofTable(names, np.repeat(places, 3, axis=0)), stiffness, mass, 1 + np.flatnonzero(x == 0)


def write_solid(folder: Path, size: int, shape: str) -> str:
    """A block of about ``size`` degrees of freedom; returns the case."""
    sides = {"cube": np.array([0.3, 0.3, 0.3]), "slab": np.array([0.6, 0.4, 0.05])}[shape]
    counts = np.maximum(np.round(sides * (size / 3 / np.prod(sides)) ** (1 / 3)).astype(int) - 1, 1)
    table, stiffness, mass, held = solid(counts, sides)
    write_matrices(folder / "model.op4", {"mass": mass, "stiff": stiffness}, binary=True)
    write_dof_table(folder / "dofs.csv", table)
    print(f"{len(table.dofs):,} degrees of freedom, {stiffness.nnz:,} entries, elements {counts.tolist()}")
    return CASE.format(base=", ".join(map(str, held)), corner=table.dofs[-1][0])


def write_plate(folder: Path, size: int) -> str:
    """A plate of about ``size`` degrees of freedom, clamped along an edge; returns the case."""
    from beamsim.scenario import load_scenario
    from beamsim.structures.assembly import assemble

    count = round(np.sqrt(size / 4)) - 1
    built = {
        "bodies": {"panel": {
            "kind": "plate", "length": 0.8, "width": 0.7, "thickness": 0.004, "youngs_modulus": YOUNG,
            "poissons_ratio": POISSON, "density": DENSITY, "elements": [count, count], "supports": {"left": "clamped"},
        }},
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": "2 g", "frequency": 20.0},
    }  # fmt: skip
    named = assemble(load_scenario(built)).named_matrices
    write_matrices(folder / "model.op4", {"mass": named.mass, "stiff": named.stiffness}, binary=True)
    write_dof_table(folder / "dofs.csv", named.table)
    print(f"{len(named.table.dofs):,} degrees of freedom, {named.stiffness.nnz:,} entries")
    corner = max(node for node, direction in named.table.dofs[:-1] if direction == "z")
    return CASE.format(base=named.base[0], corner=corner)


@contextmanager
def measured(what: str) -> Iterator[None]:
    """Print processor time and the peak memory so far."""
    start = time.process_time()
    yield
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(f"{what:28} {time.process_time() - start:7.1f} s   peak {peak:.2f} GB", flush=True)


def main() -> None:
    """Write a model, then measure reduction, run and check in this process."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("kind", choices=["plate", "solid"])
    parser.add_argument("size", type=int, help="degrees of freedom, about")
    parser.add_argument("--shape", choices=["cube", "slab"], default="slab", help="of a solid")
    parser.add_argument("--check", action="store_true", help="`beamsim check` instead of a run")
    arguments = parser.parse_args()
    from beamsim import run
    from beamsim.scenario import load_scenario
    from beamsim.structures.check import check

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with measured("writing the model"):
            plate = arguments.kind == "plate"
            text = (
                write_plate(folder, arguments.size) if plate else write_solid(folder, arguments.size, arguments.shape)
            )
            (folder / "case.yaml").write_text(text)
        scenario = load_scenario(folder / "case.yaml")
        if arguments.check:
            with measured("check"):
                for row in next(iter(check(scenario).values())):
                    print("   ", row.name, row.text)
            return
        with measured("run"):
            result = run(scenario)
        frequencies = ", ".join(f"{f:.5g}" for f in result["modes"]["open_frequencies_hz"].values[:5])
        print(f"natural frequencies {frequencies} Hz; {result.summary['events']} events")


if __name__ == "__main__":
    main()
