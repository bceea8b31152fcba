"""Rows about a comparison between multiple scales and exact motions."""

import json
from dataclasses import replace

import pytest

from beamsim.analyses.nnm.analysis import nnm
from beamsim.cli.tables import table_rows
from beamsim.scenario import load_scenario


def test_comparison_of_a_chain():
    chain = {
        "masses": [1] * 6,
        "springs": [1] * 7,
        "snubbers": [{"mass": 5, "side": "below", "stiffness": 1, "gap": 0}],
    }
    scenario = load_scenario({"title": "Six", "chain": chain, "nnm": {"mode": 4, "method": "multiple_scales"}})
    result = nnm(scenario)
    summary = json.loads(json.dumps(result.summary["multiple_scales"]))
    assert summary["observed_order_frequency"] == pytest.approx([2.0, 3.0], abs=0.1)
    rows = [text for _, text in table_rows(result) if text.startswith("observed order frequency")]
    assert len(rows) == 1
    summary["observed_order_frequency"][0] = 1.23
    shown = replace(result, summary={**result.summary, "multiple_scales": summary}).plot()
    labels = [text.get_text() for text in shown["multiple_scales"].axes[1].get_legend().get_texts()]
    assert labels == ["order 1: observed 1.23", f"order 2: observed {summary['observed_order_frequency'][1]:.2f}"]
