"""beamsim: exact simulation of structures that vibrate against one-sided elastic stops.

Every command is a function of a scenario that returns a frozen result. A `System` takes matrices, loads and contacts as
arrays instead.

>>> import beamsim
>>> scenario = beamsim.load_scenario("configs/one_sided_65hz.yaml", {"excitation.level": "3 g"})
>>> result = beamsim.run(scenario)
>>> print(f"{result.summary['peak_force_n']['tip']:.2f} N")
29.13 N

A name is imported when it is first used, so importing the package takes no time.
"""

from __future__ import annotations

from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

from beamsim.kinds import KINDS

if TYPE_CHECKING:
    from beamsim.analyses.coexisting.result import CoexistingResult
    from beamsim.analyses.compare.analysis import ChannelChoice, compare, pair_channels
    from beamsim.analyses.compare.before_after import compare_tests
    from beamsim.analyses.compare.result import Comparison
    from beamsim.analyses.compare_modes.analysis import ModeComparison, ShapesAtPlaces, compare_modes, read_shapes
    from beamsim.analyses.continuation.result import ContinuationResult
    from beamsim.analyses.identify.analysis import identify_stiffness
    from beamsim.analyses.identify.result import IdentificationResult
    from beamsim.analyses.nnm.result import NormalModeResult
    from beamsim.analyses.run.result import RunResult
    from beamsim.analyses.statics.result import StaticResult
    from beamsim.analyses.studies.plan import StudyPlan, plan_designs
    from beamsim.analyses.studies.result import StudyResult
    from beamsim.analyses.sweep.result import SweepResult
    from beamsim.arrays import (
        Contact,
        System,
        backbone,
        basins,
        continue_motion,
        periodic_motion,
        sensitivities,
        simulate,
    )
    from beamsim.errors import (
        BeamsimError,
        NotTrustedError,
        Problem,
        ResultFileError,
        ScenarioError,
        TooLongError,
        allowing_hours,
    )
    from beamsim.labelled import Dataset, LabelledArray
    from beamsim.measurements.channels import read_tests
    from beamsim.measurements.signal import MeasuredSignal
    from beamsim.outcomes import Outcome
    from beamsim.results.result import Result
    from beamsim.scenario import Scenario, load_scenario
    from beamsim.store.export import export_result
    from beamsim.store.results import load, write_result
    from beamsim.store.studies import ensemble
    from beamsim.trust.runs import run
    from beamsim.trust.studies import design_study
    from beamsim.trust.with_finer_model import coexisting, continuation, nnm, static, sweep
    from beamsim.version import __version__

_NAMES = {
    "beamsim.arrays": (
        "Contact",
        "System",
        "backbone",
        "basins",
        "continue_motion",
        "periodic_motion",
        "sensitivities",
        "simulate",
    ),
    "beamsim.analyses.studies.plan": ("StudyPlan", "plan_designs"),
    "beamsim.errors": (
        "BeamsimError",
        "NotTrustedError",
        "Problem",
        "ResultFileError",
        "ScenarioError",
        "TooLongError",
        "allowing_hours",
    ),
    "beamsim.labelled": ("Dataset", "LabelledArray"),
    "beamsim.measurements.signal": ("MeasuredSignal",),
    "beamsim.outcomes": ("Outcome",),
    "beamsim.results.result": ("Result",),
    "beamsim.scenario": ("Scenario", "load_scenario"),
    "beamsim.store.studies": ("ensemble",),
    "beamsim.store.export": ("export_result",),
    "beamsim.measurements.channels": ("read_tests",),
    "beamsim.analyses.compare.analysis": ("ChannelChoice", "pair_channels"),
    "beamsim.analyses.compare.before_after": ("compare_tests",),
    "beamsim.analyses.compare_modes.analysis": ("ShapesAtPlaces", "read_shapes"),
    "beamsim.store.results": ("load", "write_result"),
    "beamsim.version": ("__version__",),
}
_HOME = {name: module for module, names in _NAMES.items() for name in names}
for _kind in KINDS.values():  # the function and the class of each
    for _place in (_kind.analysis, _kind.result):
        _module, _, _name = _place.partition(":")
        _HOME[_name] = _module

__all__ = [
    "BeamsimError",
    "ChannelChoice",
    "CoexistingResult",
    "Comparison",
    "Contact",
    "ContinuationResult",
    "Dataset",
    "IdentificationResult",
    "LabelledArray",
    "MeasuredSignal",
    "ModeComparison",
    "NormalModeResult",
    "NotTrustedError",
    "Outcome",
    "Problem",
    "Result",
    "ResultFileError",
    "RunResult",
    "Scenario",
    "ScenarioError",
    "ShapesAtPlaces",
    "StaticResult",
    "StudyPlan",
    "StudyResult",
    "SweepResult",
    "System",
    "TooLongError",
    "__version__",
    "allowing_hours",
    "backbone",
    "basins",
    "coexisting",
    "compare",
    "compare_modes",
    "compare_tests",
    "continuation",
    "continue_motion",
    "design_study",
    "ensemble",
    "export_result",
    "identify_stiffness",
    "load",
    "load_scenario",
    "nnm",
    "pair_channels",
    "periodic_motion",
    "plan_designs",
    "read_shapes",
    "read_tests",
    "run",
    "sensitivities",
    "simulate",
    "static",
    "sweep",
    "write_result",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return resolve_name(f"{_HOME[name]}:{name}")


def __dir__() -> list[str]:
    return sorted({*__all__, *_HOME})
