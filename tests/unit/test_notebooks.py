"""Results in a notebook: a table, figures, data frames, a tree of datasets."""

import html
import re
from pkgutil import resolve_name
from typing import get_origin

import numpy as np
import pytest

import beamsim
from beamsim.cli.tables import all_rows, table_rows
from beamsim.kinds import KINDS
from beamsim.outcomes import COMPLETE

CHAIN = {
    "title": "One mass & its stop",
    "chain": {
        "masses": [1],
        "springs": [1],
        "dashpots": [0.1],
        "snubbers": [{"name": "stop", "mass": 1, "side": "above", "stiffness": 100, "gap": 1}],
    },
    "excitation": {"kind": "harmonic", "applied_to": {"mass": 1}, "level": 0.3, "frequency": 0.15},
    "probes": [{"name": "first", "mass": 1}],
    "run": {"duration": 60, "sample_rate": 10, "convergence": "off"},
}


@pytest.fixture(scope="module")
def result():
    return beamsim.run(beamsim.load_scenario(CHAIN))


def test_the_table_is_the_printed_one(result):
    text = result._repr_html_()
    assert text.startswith("<pre>One mass &amp; its stop\n")
    first, others = text.split("<details><summary>All values</summary>")
    assert "peak force" in first
    assert "peak force" in others
    assert "spectral lines" not in first
    assert html.unescape(re.sub("<[^>]*>", " ", first + others)).split() == str(result).split()
    lines = str(result).splitlines()  # what print shows at Python's prompt; the prompt itself showed every array
    assert [line.split() for line in lines[1:]] == [" ".join(row).split() for row in all_rows("run", result)]
    assert (lines[0], repr(result)) == ("One mass & its stop", "<RunResult 'One mass & its stop': complete>")


def test_data_frames_and_trees_hold_the_same_bits(result):
    pytest.importorskip("pandas")
    histories = result.to_pandas()["histories_by_time"]
    np.testing.assert_array_equal(
        histories["first displacement (m)"], result["histories"]["displacement"].sel(probe="first").values
    )
    assert "first velocity (m/s)" in histories.columns
    pytest.importorskip("xarray")
    tree = result.to_xarray()
    displacement = tree["histories"]["displacement"].sel(probe="first")
    np.testing.assert_array_equal(displacement, result["histories"]["displacement"].sel(probe="first").values)
    np.testing.assert_array_equal(displacement["time"], result["histories"]["time"].values)
    assert displacement.attrs["units"] == "m"
    assert displacement.attrs["long_name"]


def test_a_result_read_from_its_file_shows_the_same(result, tmp_path):
    read = beamsim.load(beamsim.write_result(result, tmp_path / "case.h5"))
    assert read._repr_html_() == result._repr_html_()
    assert read.plot().keys() == result.plot().keys()
    pytest.importorskip("pandas")
    histories = read.to_pandas()["histories_by_time"]
    np.testing.assert_array_equal(
        histories["first displacement (m)"], result["histories"]["displacement"].sel(probe="first").values
    )


@pytest.mark.parametrize(
    "changes",
    [
        {"limits": {"peak_force": 5.0}},  # the stop is not touched: no first contact, a margin without bound
        {
            "run": {"duration": 60, "sample_rate": 10, "convergence": "off", "impacts": {}},
            "friction": [{"name": "pad", "at": {"mass": 1}, "normal_force": 0.1, "coefficient": 0.3}],
        },
    ],
    ids=["nothing touched", "nothing worn"],
)
def test_the_table_of_a_result_file_is_that_of_the_run(changes, tmp_path):
    """What has no value is nan in a file; it was printed as "unknown", "nan Hz" and "nan mm^3"."""
    case = CHAIN | {
        "excitation": CHAIN["excitation"] | {"level": 0.05, "applied_to": "base", "quantity": "acceleration"}
    }
    run = beamsim.run(beamsim.load_scenario(case | changes))
    stored = beamsim.load(beamsim.write_result(run, tmp_path / "case.h5"))
    assert list(table_rows(stored)) == list(table_rows(run))


@pytest.mark.parametrize("kind", KINDS)
def test_empty_lists_of_a_summary_are_no_rows_of_its_table(kind):
    """Such as motions without disturbances, or a sweep without notches."""
    cls = resolve_name(KINDS[kind].result)
    empty = {entry.name: [] for entry in cls.SUMMARY if get_origin(entry.form) is list}
    result = cls(scenario=None, outcome=COMPLETE, summary=empty)
    assert [row for row in table_rows(result) if row[0] != "wall time"] == []
