"""Names of the array types that signatures use, whose shapes and units stand in comments; the smallest divisor."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
_T = TypeVar("_T")

TINY = 1e-300
"""Added or compared below a divisor or the argument of a logarithm, so that zero gives a finite value."""


def not_none(value: _T | None) -> _T:
    """A value that is there, as what was checked before says."""
    assert value is not None
    return value


def of_kind(kind: type[_T], value: object) -> _T:
    """A value of that kind, as what was checked before says."""
    assert isinstance(value, kind)
    return value
