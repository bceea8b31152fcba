"""The kinds of results, and where everything that belongs to each is.

One entry makes a kind known to the command line, to result files (writing, reading, ``info``, ``plot``, ``export``),
to their documentation, and to Python as a function and a class of the package. Functions and classes are given as
``module:name``, which `pkgutil.resolve_name` imports when they are needed.
"""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple


class Kind(NamedTuple):
    """One kind of result."""

    command: str  # that writes it
    description: str
    analysis: str  # function of a scenario that computes it
    result: str  # its class
    screen: str  # function of a result: what is printed first
    figures: str  # function of a result: its pictures by name
    question: str  # that it answers, for a report


KINDS = {
    "run": Kind(
        "run", "the result of `beamsim run`",
        analysis="beamsim.trust.runs:run",
        result="beamsim.analyses.run.result:RunResult",
        screen="beamsim.cli.motions:run_screen",
        figures="beamsim.plots.run:run_figures",
        question="How does the structure move under the excitation, and how hard does it meet its stops?",
    ),
    "static": Kind(
        "static", "the result of `beamsim static`",
        analysis="beamsim.trust.with_finer_model:static",
        result="beamsim.analyses.statics.result:StaticResult",
        screen="beamsim.cli.statics:static_screen",
        figures="beamsim.plots.statics:static_figures",
        question="Which stops does the structure rest on, and what do stops and supports carry?",
    ),
    "sweep": Kind(
        "sweep", "a sweep of one design by `beamsim sweep`",
        analysis="beamsim.trust.with_finer_model:sweep",
        result="beamsim.analyses.sweep.result:SweepResult",
        screen="beamsim.cli.motions:sweep_screen",
        figures="beamsim.plots.sweep:sweep_figures",
        question="How large is the response at each frequency while the excitation sweeps?",
    ),
    "continuation": Kind(
        "sweep", "a continuation by `beamsim sweep`",
        analysis="beamsim.trust.with_finer_model:continuation",
        result="beamsim.analyses.continuation.result:ContinuationResult",
        screen="beamsim.cli.branches:continuation_screen",
        figures="beamsim.plots.continuation:continuation_figures",
        question="Which steady motions does the excitation lead to, and which of them are stable?",
    ),
    "coexisting": Kind(
        "sweep", "coexisting motions by `beamsim sweep`",
        analysis="beamsim.trust.with_finer_model:coexisting",
        result="beamsim.analyses.coexisting.result:CoexistingResult",
        screen="beamsim.cli.branches:coexisting_screen",
        figures="beamsim.plots.coexisting:coexisting_figures",
        question="Which of several motions will occur?",
    ),
    "designs": Kind(
        "sweep", "a design study by `beamsim sweep`",
        analysis="beamsim.trust.studies:design_study",
        result="beamsim.analyses.studies.result:StudyResult",
        screen="beamsim.cli.studies:design_screen",
        figures="beamsim.plots.studies:design_figures",
        question="How does the response depend on what is varied?",
    ),
    "identify-stiffness": Kind(
        "identify-stiffness", "the result of `beamsim identify-stiffness`",
        analysis="beamsim.analyses.identify.analysis:identify_stiffness",
        result="beamsim.analyses.identify.result:IdentificationResult",
        screen="beamsim.cli.measured:identification_screen",
        figures="beamsim.plots.identification:identification_figures",
        question="Which stiffness do the measurements give, and how closely?",
    ),
    "nnm": Kind(
        "nnm", "the result of `beamsim nnm`",
        analysis="beamsim.trust.with_finer_model:nnm",
        result="beamsim.analyses.nnm.result:NormalModeResult",
        screen="beamsim.cli.branches:nnm_screen",
        figures="beamsim.plots.nnm:nnm_figures",
        question="How do frequency and shape of free vibrations change with their size?",
    ),
    "compare": Kind(
        "compare", "the result of `beamsim compare`",
        analysis="beamsim.analyses.compare.analysis:compare",
        result="beamsim.analyses.compare.result:Comparison",
        screen="beamsim.cli.measured:comparison_screen",
        figures="beamsim.plots.comparison:comparison_figures",
        question="How well does the computed motion agree with the measured one, or one test with another?",
    ),
    "compare-modes": Kind(
        "compare-modes", "the result of `beamsim compare-modes`",
        analysis="beamsim.analyses.compare_modes.analysis:compare_modes",
        result="beamsim.analyses.compare_modes.analysis:ModeComparison",
        screen="beamsim.cli.measured:modes_screen",
        figures="beamsim.plots.comparison:mode_comparison_figures",
        question="How well do the computed modes agree with the measured ones?",
    ),
}  # fmt: skip


class TemplateKind(StrEnum):
    """Scenarios that ``beamsim new`` writes."""

    beam = "beam"
    chain = "chain"
    sweep = "sweep"
    shock = "shock"
    random = "random"
    panel_pair = "panel-pair"
    nnm = "nnm"
    identify = "identify"

    @property
    def command(self) -> str:
        """The command that it is for."""
        return {"sweep": "sweep", "nnm": "nnm", "identify": "identify-stiffness"}.get(self, "run")
