"""Names of the degrees of freedom of imported matrices: node, direction and coordinates."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cached_property
from pathlib import Path

import numpy as np

from beamsim.errors import MethodError
from beamsim.matrix_files.matrix import DIRECTIONS, MODAL, Dof
from beamsim.measurements.read import read_rows
from beamsim.measurements.signal import MeasurementError
from beamsim.typing import Floats, Ints

TRANSLATIONS = DIRECTIONS[:3]


@dataclass(frozen=True)
class DofTable:
    """Row i of the matrices belongs to ``dofs[i]``."""

    dofs: tuple[Dof, ...]
    coordinates: Floats | None = None  # (N, 3) of each row's node, m beyond the file; NaN where none are given

    @cached_property
    def number(self) -> dict[Dof, int]:
        """Row of each node and direction; modal coordinates of one node are told apart by their order alone."""
        return {dof: i for i, dof in enumerate(self.dofs) if dof[1] != MODAL}

    @cached_property
    def nodes(self) -> Ints:
        """(N,) node of each row."""
        return np.array([node for node, _ in self.dofs], dtype=np.int64)

    def of_direction(self, direction: str) -> Floats:
        """(N,) 1 where a row has this direction, else 0."""
        return np.array([1.0 if each == direction else 0.0 for _, each in self.dofs])

    def rows_of(self, nodes: Sequence[int]) -> Ints:
        """Rows of these nodes."""
        return np.flatnonzero(np.isin(self.nodes, nodes))

    def part(self, rows: Ints) -> DofTable:
        """The table of some rows."""
        coordinates = None if self.coordinates is None else self.coordinates[rows]
        return DofTable(tuple(self.dofs[i] for i in rows), coordinates)

    def remedy(self, node: int) -> str:
        """What there is instead of an unknown node, or direction of a node."""
        directions = [each for number, each in self.dofs if number == node]
        if directions:
            return f"node {node} has {', '.join(directions)}"
        known = sorted({number for number, each in self.dofs if each != MODAL})
        if not known:
            return "there are modal coordinates alone"
        near = sorted(known, key=lambda number: abs(number - node))[:2]
        alike = get_close_matches(str(node), [str(number) for number in known], n=2)
        names = list(dict.fromkeys([*alike, *(str(number) for number in near)]))[:3]
        return f"the nearest nodes are {', '.join(names)}"


@dataclass(frozen=True)
class NamedDofs:
    """Degrees of freedom of a body as other programs have them."""

    table: DofTable
    scale: Floats  # (N,) what the table names, in m and rad, for a unit of each degree of freedom
    influence: Floats  # (N,) each, in the table's units, when the base moves by 1 m


def read_dof_table(path: Path) -> DofTable:
    """The table of a CSV file with the columns node, direction and, if wanted, x, y, z.

    Raises
    ------
    MethodError
        About ``dofs``: the file cannot be read, a line is wrong, or two lines name the same.
    """
    try:
        rows, _ = read_rows(path)
    except OSError as error:
        raise MethodError("dofs", f"= {path} cannot be read ({error})", "check the path") from None
    except MeasurementError as fault:
        raise MethodError("dofs", f"= {path.name} {fault.message}", fault.remedy) from None
    if [cell.lower() for cell in rows[0].cells[:2]] != ["node", "direction"]:
        raise MethodError(
            "dofs", f"= {path.name} has no heading", "begin the table with node,direction or node,direction,x,y,z"
        )
    dofs: list[Dof] = []
    places: list[list[float]] = []
    first: dict[Dof, int] = {}
    for number, cells in rows[1:]:
        direction = cells[1].lower() if len(cells) > 1 else ""
        if direction not in (*DIRECTIONS, MODAL):
            raise MethodError(
                "dofs", f"= {path.name} has the direction {direction or 'missing'} in line {number}",
                f"directions are {', '.join(DIRECTIONS)} and {MODAL}",
            )  # fmt: skip
        try:
            dof = (int(cells[0] or 0) if direction == MODAL else int(cells[0]), direction)
            place = [float(cell) if cell else np.nan for cell in cells[2:5]]
        except ValueError:
            raise MethodError(
                "dofs",
                f"= {path.name} has a line {number} that cannot be read: {','.join(cells)}",
                "write a node's number, a direction and, if wanted, three coordinates",
            ) from None
        if direction != MODAL and dof in first:
            raise MethodError(
                "dofs", f"= {path.name} names node {dof[0]} {direction} in lines {first[dof]} and {number}",
                "give each row of the matrices one line",
            )  # fmt: skip
        first[dof] = number
        dofs.append(dof)
        places.append(place + [np.nan] * (3 - len(place)))
    coordinates = np.array(places).reshape(-1, 3)
    return DofTable(tuple(dofs), None if np.all(np.isnan(coordinates)) else coordinates)


def write_dof_table(path: Path, table: DofTable) -> None:
    """Write a table that `read_dof_table` reads."""
    with open(path, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["node", "direction"] if table.coordinates is None else ["node", "direction", "x", "y", "z"])
        for i, dof in enumerate(table.dofs):
            place = [] if table.coordinates is None else table.coordinates[i].tolist()
            writer.writerow([*dof, *("" if np.isnan(x) else repr(x) for x in place)])
