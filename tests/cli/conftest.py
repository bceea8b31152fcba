"""Results that no solver made, as a fixture."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

from beamsim.analyses.results import RunResult

# Tests are not a package (importmode=importlib), so the shared module is loaded by its place.
_spec = spec_from_file_location("fabricated", Path(__file__).parents[1] / "fabricated.py")
assert _spec is not None
assert _spec.loader is not None
_fabricated = sys.modules.setdefault(_spec.name, module_from_spec(_spec))  # its dataclasses look there
_spec.loader.exec_module(_fabricated)


@pytest.fixture
def fabricated_run() -> Callable[..., RunResult]:
    """Factory of consistent results."""
    factory: Callable[..., RunResult] = _fabricated.fabricate
    return factory
