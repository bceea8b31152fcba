"""Of many alike cases of a test some run among the fast tests, all of them in continuous integration."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def slow_after(count: int, cases: Iterable[Any]) -> list[Any]:
    """Values for `pytest.mark.parametrize`: the first ones as they are, the others marked as slow."""
    cases = list(cases)
    later = [case if isinstance(case, tuple) else (case,) for case in cases[count:]]
    return cases[:count] + [pytest.param(*case, marks=pytest.mark.slow) for case in later]
