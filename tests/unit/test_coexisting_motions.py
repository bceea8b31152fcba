"""Where a curve of periodic motions has several stable ones, from a curve whose folds are known."""

import gzip
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from beamsim.cli.branches import continuation_screen
from beamsim.store.results import load

STORED = Path(__file__).parents[1] / "data" / "results" / "continuation.h5.gz"


@pytest.fixture
def result(tmp_path):
    (tmp_path / "stored.h5").write_bytes(gzip.decompress(STORED.read_bytes()))
    return load(tmp_path / "stored.h5")


def folded(result, stable=(True, False, True), level=None):
    """A branch up to a fold at 90 Hz, back to one at 70 Hz and up to 110 Hz; the displacement is that of its path."""
    branch = result.branches[0]
    path = np.linspace(0.0, 3.0, 301)
    frequency = np.interp(path, [0.0, 1.0, 2.0, 3.0], [60.0, 90.0, 70.0, 110.0])
    which = np.minimum(path.astype(int), 2)
    probes = tuple(
        replace(probe, maximum=path * 1e-3, minimum=-path * 1e-3) if probe.quantity == "displacement" else probe
        for probe in branch.probes
    )
    return replace(branch, parameter=frequency, stable=np.array(stable)[which], probes=probes, special=[],
                   level=branch.level if level is None else level)  # fmt: skip


def test_two_motions_between_the_folds(result):
    (several,) = replace(result, branches=(folded(result),)).coexisting()
    assert (several.low, several.high) == pytest.approx((70.0, 90.0), abs=0.3)  # a step of the branch
    # at 80 Hz: 20/30 on the way to the first fold, 10/40 after the second
    shares = 1e-3 * np.array([(several.at - 60.0) / 30.0, 2.0 + (several.at - 70.0) / 40.0])
    assert several.peaks == pytest.approx(shares, rel=1e-3)


def test_unstable_motions_and_other_levels_are_no_alternatives(result):
    assert not replace(result, branches=(folded(result, (True, False, False)),)).coexisting()
    other = folded(result, (False, False, True), level=2.0 * result.branches[0].level)
    assert not replace(result, branches=(folded(result, (True, False, False)), other)).coexisting()
    same = folded(result, (False, False, True))
    assert len(replace(result, branches=(folded(result, (True, False, False)), same)).coexisting()) == 1


def test_the_first_screen_says_it_in_words(result):
    text = continuation_screen(replace(result, branches=(folded(result),))).lines
    (said,) = [line for line in text if "stable motions from" in line]
    assert said.startswith("2 stable motions from 70")
    assert said.endswith("by the start (kind: coexisting says how likely)")
    assert " or " in said
