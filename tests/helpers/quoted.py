"""Commands whose screens the documents quote, and what is wrong with the screen and the file of a command."""

from __future__ import annotations

import json
from pathlib import Path

from shipped import unfit

from beamsim.scenario import Scenario
from tests.helpers.screens import ResultFacts
from tests.helpers.sentences import contradictions

QUOTED = {  # by document and beginning of the first line the commands whose output is quoted
    ("README.md", "One-sided contact, 65 Hz"): ["run configs/one_sided_65hz.yaml"],
    ("docs/frames.md", "Pipe with two elbows"): ["run configs/structures/pipe_two_elbows.yaml"],
    ("docs/gapping.md", "tip opens from 1.151 g"): ["run configs/thesis/prestressed_90hz_3g.yaml"],
    ("docs/studies.md", "                       tip peak force"): ["sweep configs/studies/design_tornado.yaml"],
    ("docs/statics.md", "A beam at rest on a stop"): ["static configs/structures/resting_beam.yaml"],
    ("docs/statics.md", "Gap and dead load of a beam"): ["sweep configs/studies/static_gaps.yaml"],
    ("docs/comparison.md", "                         FRAC "): [
        "sweep configs/sweeps/sweep_test.yaml",
        "compare sweep_test.h5 configs/measurements/sweep_test.csv --reference base --cycles 3",
    ],
    ("docs/sensitivities.md", "peak force of tip: "): ["run configs/studies/sensitivities.yaml"],
    ("docs/shock.md", "base motion: spectrum"): ["run configs/loads/shock_matched.yaml"],
    ("docs/base_motion.md", "A bracket whose foot moves"): ["run configs/loads/base_in_all_axes.yaml"],
    ("docs/curves_of_special_points.md", "Two masses and a stop, special"): [
        "sweep configs/continuation/special_points.yaml"
    ],
    ("docs/curves_of_special_points.md", "Oscillator with a stop, an isola"): ["sweep configs/continuation/isola.yaml"],
    ("docs/coexisting.md", "                  share of starts"): ["sweep configs/continuation/coexisting_motions.yaml"],
    ("docs/optimisation.md", "Snubber to be chosen"): ["sweep configs/optimise_snubber.yaml"],
    ("docs/reliability.md", "Force of a stop beyond"): ["sweep configs/studies/exceedance.yaml"],
    ("docs/studies.md", "Snubber stiffness and gap"): ["sweep configs/studies/design_stiffness_gap.yaml"],
    ("docs/studies.md", "          tip stiffness   tip gap   peak force   margin    limit"): [
        "sweep configs/studies/design_robust.yaml --set vary.tolerances.quantile=null --set vary.tolerances.samples=5"
    ],
    ("docs/studies.md", "Two motions, 70 Hz"): ["sweep configs/studies/design_two_motions.yaml"],
}


def is_whole(path: Path, command: str) -> bool:
    """Whether a document quotes the screen of a command on a shipped config as it stands, which is compared with it."""
    first = (commands[0].split() for commands in QUOTED.values())
    whole = {(words[0], Path(words[1]).stem) for words in first if len(words) == 2}
    return (command, path.stem) in whole


def wrong_on_screen(stdout: str, file: Path, command: str, scenario: Scenario) -> list[str]:
    """What on the screen of a command contradicts its file, what does not fit the scenario, and energy that is lost."""
    facts = ResultFacts(file, command)
    texts = [facts.attributes["status"], *json.loads(facts.attributes["warnings"])]
    out_of_balance = facts.summary.get("energy_error", 0.0) >= 1e-8
    advice = () if scenario.study is not None else unfit(scenario, texts)
    return [*contradictions(stdout, facts), *advice, *["the energy is not balanced"] * out_of_balance]
