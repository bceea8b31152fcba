r"""Matrices from and to the units of other programs.

With L, M, F and T the SI sizes of the units of length, mass, force and time, the energies of a file are in F L
(strain energy) and in :math:`M L^2 / T^2` (kinetic energy), and a degree of freedom u is in units of s: L of a
displacement, 1 (rad) of a rotation. With D the diagonal matrix of 1 / s

.. math:: K_{SI} = F L\, D K D, \quad M_{SI} = M L^2\, D M D, \quad C_{SI} = F L T\, D C D.

A modal coordinate has :math:`s = L \sqrt{M}`, so that modes that are normalised to a unit modal mass stay that, as if
the model had been in SI units; of any other scaling the motion of the nodes is the same.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.matrix_files.matrix import MODAL
from beamsim.structures.dof_table import TRANSLATIONS, DofTable
from beamsim.structures.named_matrices import NamedMatrices
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.scenario.file_units import UnitSizes


def in_si_units(given: NamedMatrices, sizes: UnitSizes) -> NamedMatrices:
    """Matrices, recovery matrix and coordinates of a file in SI units.

    The rows of a recovery matrix give what they gave, in the units of the file, now for motions in SI units.
    """
    length, mass, force, time = sizes
    if all(size == 1.0 for size in sizes):
        return given
    converted = _scaled(given, 1.0 / _sizes_of_dofs(given.table, sizes), mass * length**2, force * length, time, length)
    return replace(converted, time_unit=given.time_unit * time)


def in_units(given: NamedMatrices, sizes: UnitSizes) -> NamedMatrices:
    """The reverse: matrices and coordinates in SI units as a file in other units has them."""
    length, mass, force, time = sizes
    if all(size == 1.0 for size in sizes):
        return given
    scale = _sizes_of_dofs(given.table, sizes)
    return _scaled(given, scale, 1.0 / (mass * length**2), 1.0 / (force * length), 1.0 / time, 1.0 / length)


def _sizes_of_dofs(table: DofTable, sizes: UnitSizes) -> Floats:
    """(N,) of a unit of each degree of freedom, in m, rad, or m sqrt(kg)."""
    by_direction = {MODAL: sizes.length * np.sqrt(sizes.mass), **dict.fromkeys(TRANSLATIONS, sizes.length)}
    return np.array([by_direction.get(direction, 1.0) for _, direction in table.dofs])


def _scaled(
    given: NamedMatrices, dof: Floats, mass: float, stiffness: float, time: float, length: float
) -> NamedMatrices:
    """The matrices times numbers, their rows and columns times ``dof``; coordinates times ``length``."""
    from scipy.sparse import diags_array

    diagonal: Any = diags_array(dof)

    def of(matrix: Any, factor: float) -> Any:
        return None if matrix is None else (factor * (diagonal @ matrix @ diagonal)).tocsc()

    places = given.table.coordinates
    return replace(
        given,
        table=DofTable(given.table.dofs, None if places is None else places * length),
        mass=of(given.mass, mass),
        stiffness=of(given.stiffness, stiffness),
        damping=of(given.damping, stiffness * time),
        recovery=None if given.recovery is None else (given.recovery @ diagonal).tocsr(),
    )
