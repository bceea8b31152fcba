"""Names of the array types that signatures use, whose shapes and units stand in comments; what is known of a type."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
_T = TypeVar("_T")


def not_none(value: _T | None) -> _T:
    """A value that is there, as what was checked before says."""
    assert value is not None
    return value


def of_kind(kind: type[_T], value: object) -> _T:
    """A value of that kind, as what was checked before says."""
    assert isinstance(value, kind)
    return value
