"""Rows and picture of a comparison between multiple scales and exact motions."""

import json

import pytest

from beamsim.cli.multiple_scales import compare, expansion_rows, expansion_summary
from beamsim.scenario import load_scenario


def test_comparison_of_a_chain(tmp_path):
    chain = {
        "masses": [1] * 6,
        "springs": [1] * 7,
        "snubbers": [{"mass": 5, "side": "below", "stiffness": 1, "gap": 0}],
    }
    scenario = load_scenario({"title": "Six", "chain": chain, "nnm": {"mode": 4, "method": "multiple_scales"}})
    comparison, files = compare(scenario, tmp_path / "six.h5", plots=True)
    assert [f.name for f in files] == ["six_multiple_scales.png"]
    assert files[0].stat().st_size > 10_000
    summary = json.loads(json.dumps(expansion_summary(comparison)))
    assert summary["observed_order_frequency"] == pytest.approx([2.0, 3.0], abs=0.1)
    rows = dict(expansion_rows(comparison))
    assert "frequency 2.0" in rows["observed orders"] or "frequency 1.9" in rows["observed orders"]
    assert compare(scenario, tmp_path / "six.h5", plots=False)[1] == []
