"""The output times of a run, which are computed where they are used."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from beamsim.typing import Floats


@dataclass(frozen=True)
class OutputTimes:
    """Every ``step``-th multiple of the time between two samples, from 0 on.

    >>> OutputTimes(10.0, 6).every(2).rows(1, 3)
    array([0.2, 0.4])
    """

    rate: float  # Hz, of the samples
    size: int
    step: int = 1

    def rows(self, first: int, last: int) -> Floats:
        """(last - first,) s."""
        return np.arange(first * self.step, last * self.step, self.step) / self.rate

    @property
    def all(self) -> Floats:
        """(size,) s."""
        return self.rows(0, self.size)

    @property
    def last(self) -> float:
        """The last one, s."""
        return float(self.rows(self.size - 1, self.size)[0])

    def until(self, end: float) -> OutputTimes:
        """Those up to a time."""
        size = min(int(end * self.rate / self.step) + 2, self.size)
        while size > 1 and float(self.rows(size - 1, size)[0]) > end:
            size -= 1
        return replace(self, size=size)

    def every(self, step: int) -> OutputTimes:
        """One of ``step`` of them."""
        return replace(self, size=-(-self.size // step), step=self.step * step)
