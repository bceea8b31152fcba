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
    path = np.linspace(0.0, 3.0, 301)
    frequency = np.interp(path, [0.0, 1.0, 2.0, 3.0], [60.0, 90.0, 70.0, 110.0])
    which = np.minimum(path.astype(int), 2)
    own = result["branches"]["level"].values[0] if level is None else level
    return {"parameter": frequency, "stable": np.array(stable)[which], "peak": path * 1e-3, "level": own}


def of_branches(result, *branches):
    """The result with these branches and no others."""
    count, size = len(branches), sum(each["parameter"].size for each in branches)
    rows, points = result["branches"], result["points"]
    names = [name for name, array in rows.items() if "branch" in array.dims]
    rows = rows.assign(**{name: np.repeat(rows[name].values[:1], count) for name in names})
    rows = rows.assign(branch=np.arange(count), level=np.array([each["level"] for each in branches]))
    along = {name: array.dims.index("point") for name, array in points.items() if "point" in array.dims}
    points = points.assign(**{name: np.take(points[name].values, [0] * size, axis) for name, axis in along.items()})
    owner = np.repeat(np.arange(count), [each["parameter"].size for each in branches])
    joined = {name: np.concatenate([each[name] for each in branches]) for name in ("parameter", "stable", "peak")}
    peak = np.array([joined.pop("peak")] * len(points.labels("probe")))
    datasets = {"branches": rows, "points": points.assign(branch=owner, peak_displacement=peak, **joined)}
    return replace(result, datasets=result.datasets | datasets)


def test_two_motions_between_the_folds(result):
    (several,) = of_branches(result, folded(result)).coexisting()
    assert (several.low, several.high) == pytest.approx((70.0, 90.0), abs=0.3)  # a step of the branch
    # at 80 Hz: 20/30 on the way to the first fold, 10/40 after the second
    shares = 1e-3 * np.array([(several.parameter - 60.0) / 30.0, 2.0 + (several.parameter - 70.0) / 40.0])
    assert several.peaks == pytest.approx(shares, rel=1e-3)


def test_unstable_motions_and_other_levels_are_no_alternatives(result):
    assert not of_branches(result, folded(result, (True, False, False))).coexisting()
    other = folded(result, (False, False, True), level=2.0 * result["branches"]["level"].values[0])
    assert not of_branches(result, folded(result, (True, False, False)), other).coexisting()
    same = folded(result, (False, False, True))
    assert len(of_branches(result, folded(result, (True, False, False)), same).coexisting()) == 1


def test_the_first_screen_says_it_in_words(result):
    text = continuation_screen(of_branches(result, folded(result))).lines
    (said,) = [line for line in text if "stable motions from" in line]
    assert said.startswith("2 stable motions from 70")
    assert said.endswith("by the start (kind: coexisting says how likely)")
    assert " or " in said
