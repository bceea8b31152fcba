"""A family of conservative systems that counts the motions computed with it: the cost of a method, not in seconds."""

from __future__ import annotations

from typing import Any

from beamsim.orbits.reversible import Conservative
from beamsim.typing import Floats


class CountedFamily:
    """Stands for ``family`` everywhere; ``passages`` is the number of motions carried so far, of whatever duration."""

    def __init__(self, family: Conservative) -> None:
        self._family = family
        self._flow: Any = None
        self._first = 0  # the present flow's count when it came
        self._before = 0  # passages of the flows before

    @property
    def passages(self) -> int:
        """Motions carried so far."""
        return self._before + (0 if self._flow is None else self._flow.passages - self._first)

    @property
    def omega(self) -> Floats:
        """As the family's."""
        return self._family.omega

    @property
    def extra(self) -> int:
        """As the family's."""
        return self._family.extra

    def flow_at(self, factor: float) -> tuple[Any, Any]:
        """As the family's."""
        flow, direction = self._family.flow_at(factor)
        if flow is not self._flow:
            self._before = self.passages
            self._flow, self._first = flow, flow.passages
        return flow, direction

    def potential(self, q: Floats, factor: float) -> tuple[float, Floats, float]:
        """As the family's."""
        return self._family.potential(q, factor)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._family, name)
