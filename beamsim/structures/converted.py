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
from typing import Any

import numpy as np
from scipy.sparse import diags_array

from beamsim.matrix_files.matrix import MODAL
from beamsim.scenario.matrices import UnitSizes
from beamsim.structures.dof_table import TRANSLATIONS, DofTable
from beamsim.structures.named_matrices import NamedMatrices


def in_si_units(given: NamedMatrices, sizes: UnitSizes) -> NamedMatrices:
    """Matrices, recovery matrix and coordinates of a file in SI units.

    The rows of a recovery matrix give what they gave, in the units of the file, now for motions in SI units.
    """
    length, mass, force, time = sizes
    if all(size == 1.0 for size in sizes):
        return given
    by_direction = {MODAL: length * np.sqrt(mass), **dict.fromkeys(TRANSLATIONS, length)}
    units = np.array([by_direction.get(direction, 1.0) for _, direction in given.table.dofs])
    diagonal: Any = diags_array(1.0 / units)

    def scaled(matrix: Any, factor: float) -> Any:
        return None if matrix is None else (factor * (diagonal @ matrix @ diagonal)).tocsc()

    places = given.table.coordinates
    return replace(
        given,
        table=DofTable(given.table.dofs, None if places is None else places * length),
        mass=scaled(given.mass, mass * length**2),
        stiffness=scaled(given.stiffness, force * length),
        damping=scaled(given.damping, force * length * time),
        recovery=None if given.recovery is None else (given.recovery @ diagonal).tocsr(),
        time_unit=given.time_unit * time,
    )


def in_units(given: NamedMatrices, sizes: UnitSizes) -> NamedMatrices:
    """The reverse: matrices and coordinates in SI units as a file in other units has them."""
    return in_si_units(given, type(sizes)(*(1.0 / size for size in sizes)))
