"""Screens that the README and the documents quote are what the commands print now."""

import re
import shutil
from itertools import pairwise
from pathlib import Path

import pytest

from tests.helpers.commands import invoke

ROOT = Path(__file__).parents[2]
QUOTED = {  # by document and beginning of the first line the commands whose output is quoted
    ("README.md", "One-sided contact, 65 Hz"): "run configs/one_sided_65hz.yaml",
    ("docs/gapping.md", "tip opens from 1.151 g"): "run configs/thesis/prestressed_90hz_3g.yaml",
    ("docs/studies.md", "                       tip peak force"): "sweep configs/studies/design_tornado.yaml",
    ("docs/sweep_comparison.md", "                         FRAC "): (
        "sweep configs/sweeps/sweep_test.yaml",
        "compare sweep_test.h5 configs/measurements/sweep_test.csv --reference base --cycles 3",
    ),
    ("docs/sensitivities.md", "peak force of tip: "): "run configs/studies/sensitivities.yaml",
    ("docs/shock.md", "base motion: spectrum"): "run configs/loads/shock_matched.yaml",
    ("docs/coexisting.md", "                  share of starts"): "sweep configs/continuation/coexisting_motions.yaml",
    ("docs/optimisation.md", "Snubber to be chosen"): "sweep configs/optimise_snubber.yaml",
    ("docs/reliability.md", "Force of a stop beyond"): "sweep configs/studies/exceedance.yaml",
    ("docs/studies.md", "Snubber stiffness and gap"): "sweep configs/studies/design_stiffness_gap.yaml",
    ("docs/studies.md", "          tip stiffness   tip gap   peak force   margin   limit"): (
        "sweep configs/studies/design_robust.yaml --set vary.tolerances.quantile=null"
    ),
    ("docs/studies.md", "Two motions, 70 Hz"): "sweep configs/studies/design_two_motions.yaml",
}


def quoted(document, begins):
    """The lines of the block of a document that begins so."""
    blocks = re.findall(r"^```(\w*)\n(.*?)\n```$", (ROOT / document).read_text(encoding="utf-8"), re.S | re.M)
    (block,) = (text for language, text in blocks if not language and text.startswith(begins))
    return block.splitlines()


def without_spaces(text):
    return " ".join(text.split())


def missing(lines, printed):
    """Lines that are not in what was printed; lines may be broken in two, left out (...), or be of plots and files."""
    printed = without_spaces(printed)
    text = "\n".join(line for line in lines if ".h5" not in line and line.strip() != "...")
    parts = [without_spaces(part) for part in text.splitlines()]
    wrapped = [" ".join(pair) for pair in pairwise(parts)]
    return [
        part
        for k, part in enumerate(parts)
        if part not in printed and not any(both in printed for both in wrapped[max(k - 1, 0) : k + 1])
    ]


def test_a_stale_line_is_found():
    assert missing(["one  19.4 N", "...", "two broken", "in two"], "one 19.4 N\ntwo broken in two") == []
    assert missing(["one 19.4 N", "two 3 N"], "one 19.5 N\ntwo 3 N") == ["one 19.4 N"]


@pytest.mark.parametrize(
    ("of", "commands"),
    QUOTED.items(),
    ids=[f"{document} {begins.split()[0]}" for document, begins in QUOTED],
)
def test_a_quoted_screen_is_what_is_printed(of, commands, tmp_path, monkeypatch):
    shutil.copytree(ROOT / "configs", tmp_path / "configs")
    monkeypatch.chdir(tmp_path)
    printed = ""
    for command in [commands] if isinstance(commands, str) else commands:
        many = command.startswith("sweep") and ("studies/" in command or "optimise" in command)
        done = invoke(*command.split(), "--no-plots", *(("--workers", 1) if many else ()))
        assert done.exit_code == 0, done.output
        printed = done.output
    assert missing(quoted(*of), printed) == []
