"""Coordinates of fields that are given body by body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.structures.basis import ReducedBasis
    from beamsim.structures.structure import Structure


def project(
    structure: Structure, basis: ReducedBasis, given: Mapping[str, Sequence[float]], quantity: str
) -> tuple[Floats, dict[str, float]]:
    """Kinetic (M-orthogonal) projection of given fields on a basis.

    Parameters
    ----------
    given : numbers by body, as its kind reads them; a body that is not named has no displacement or velocity.
    quantity : "displacement" or "velocity".

    Returns
    -------
    (n,) coordinates, and the relative error on every body that is named.
    """
    fields = [(member, member.field(basis.vectors)) for member in structure.members]
    named = [
        (member, vectors, member.body.given_field(given[member.body.name]))
        for member, vectors in fields
        if any(given.get(member.body.name, ()))
    ]
    q = np.zeros(basis.size)
    for member, vectors, field in named:
        q += member.mass_ratio * field.kinetic.products(vectors)
    errors = {member.body.name: field.error(vectors @ q, quantity) for member, vectors, field in named}
    return q * np.sqrt(structure.mass_scale), errors
