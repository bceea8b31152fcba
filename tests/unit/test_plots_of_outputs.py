"""Pictures of outputs: each has its own axes, in its own unit, with its limit."""

import numpy as np

import beamsim
from beamsim.analyses.sweep.analysis import sweep as sweep_alone
from beamsim.scenario import load_scenario

CASE = {
    "chain": {"masses": [2.0], "springs": [800.0], "damping": {"kind": "modal", "ratio": 0.05}},
    "outputs": [{"name": "wall", "kind": "reaction_force", "support": "left"},
                {"name": "mass", "kind": "acceleration", "mass": 1}],
    "limits": {"outputs": {"wall": "2 kN"}},
    "excitation": {"kind": "harmonic", "applied_to": "base", "level": 400.0, "frequency": 2.0},
}  # fmt: skip
RUN = {"duration": 1.0, "convergence": "off"}


def labels(figure):
    return [ax.get_ylabel() for ax in figure.axes if ax.get_visible()]


def test_of_a_run():
    """With limits on both sides, as far as they leave room, and the faces of stops where a probe is."""
    stops = [
        {"name": name, "mass": 1, "side": side, "stiffness": 1e3, "gap": gap}
        for name, side, gap in (("near", "above", 1.25), ("under", "below", 1.3), ("far", "below", 50.0))
    ]
    limits = {**CASE["limits"], "peak_displacement": 1.5, "peak_force": 1e6}
    result = beamsim.run(load_scenario(CASE, {"run": RUN, "snubbers": stops, "limits": limits}))
    figures = result.plot()
    figure = figures["outputs"]
    assert labels(figure) == ["wall (kN)", "mass (g)"]
    drawn, *bounds = (line.get_ydata() for line in figure.axes[0].lines)
    assert np.abs(drawn).max() * 1e3 == np.abs(result["histories"]["output_value"].sel(output="wall").values).max()
    assert [list(y) for y in bounds] == [[2.0, 2.0], [-2.0, -2.0]]
    assert figure.axes[0].get_xlim() == (0.0, 1.0)
    lines = {line.get_label(): line.get_ydata()[0] for line in figures["displacement"].axes[0].lines}
    assert lines["limit"] == 1.5
    assert lines["face of near"] == 1.25
    assert lines["face of under"] == -1.3
    faces = [x for x in figures["displacement"].axes[0].lines if str(x.get_label()).startswith("face of")]
    assert len({str(line._dash_pattern) for line in faces}) == 2  # the legend says which is which
    assert "face of far" not in lines
    assert "limit" not in {line.get_label() for line in figures["contact_force"].axes[0].lines}


def test_of_a_sweep():
    sweep = {"kind": "stepped", "from": 2.0, "to": 2.5, "points": 3}
    result = sweep_alone(load_scenario(CASE, {"sweep": sweep}))
    figure = result.plot()["outputs"]
    assert labels(figure) == ["Peak of wall (kN)", "Peak of mass (g)"]
    peaks, limit = (line.get_ydata() for line in figure.axes[0].lines)
    np.testing.assert_allclose(
        np.asarray(peaks) * 1e3, result.curves["up_0"].channel("output", "wall").peak, rtol=1e-15
    )
    assert list(limit) == [2.0, 2.0]
    assert len(figure.axes[1].lines) == 1
