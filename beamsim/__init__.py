"""beamsim: exact simulation of structures that vibrate against one-sided elastic stops.

>>> import beamsim
>>> scenario = beamsim.load_scenario("configs/one_sided_65hz.yaml", {"run.duration": "0.2 s"})  # doctest: +SKIP
>>> result = beamsim.run(scenario)  # doctest: +SKIP
>>> result.summary["peak_force_n"]["tip"]  # doctest: +SKIP

Everything is imported when it is first asked for, so that importing the package costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from beamsim.analyses.designs import design_study
    from beamsim.analyses.identify import identify_stiffness
    from beamsim.analyses.results import RunResult
    from beamsim.analyses.run import run
    from beamsim.errors import BeamsimError, NotTrustedError, Problem, ResultFileError, ScenarioError
    from beamsim.scenario import Scenario, load_scenario
    from beamsim.store.designs import open_designs, write_designs
    from beamsim.store.measurement import read_tests
    from beamsim.store.read import open_result
    from beamsim.store.write import write_run

__version__ = "0.1.0"

__all__ = [
    "BeamsimError",
    "NotTrustedError",
    "Problem",
    "ResultFileError",
    "RunResult",
    "Scenario",
    "ScenarioError",
    "__version__",
    "design_study",
    "identify_stiffness",
    "load_scenario",
    "open_designs",
    "open_result",
    "read_tests",
    "run",
    "write_designs",
    "write_run",
]

_HOME = {
    "BeamsimError": "beamsim.errors",
    "NotTrustedError": "beamsim.errors",
    "Problem": "beamsim.errors",
    "ResultFileError": "beamsim.errors",
    "RunResult": "beamsim.analyses.results",
    "Scenario": "beamsim.scenario",
    "ScenarioError": "beamsim.errors",
    "design_study": "beamsim.analyses.designs",
    "identify_stiffness": "beamsim.analyses.identify",
    "load_scenario": "beamsim.scenario",
    "open_designs": "beamsim.store.designs",
    "open_result": "beamsim.store.read",
    "read_tests": "beamsim.store.measurement",
    "run": "beamsim.analyses.run",
    "write_designs": "beamsim.store.designs",
    "write_run": "beamsim.store.write",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
