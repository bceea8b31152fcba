"""Limits on outputs: margins in every analysis, and what is refused."""

import pytest

import beamsim
from beamsim.results.values import limits_not_met
from beamsim.scenario import load_scenario

MASS = """\
chain: {masses: [2 kg], springs: [800 N/m], damping: {kind: modal, ratio: 5 %}, snubbers: [{name: stop, mass: 1, side: below, stiffness: 800 N/m, gap: 1}]}
outputs:
  - {name: wall, kind: reaction_force, support: left}
  - {name: inside, kind: strain_energy}
limits: {outputs: {wall: 10 N, inside: 0.5 N m}}
excitation: {kind: harmonic, applied_to: base, level: 4 m/s^2, frequency: 2 Hz}
"""  # noqa: E501


def test_of_a_run():
    """Their values are the peaks of the outputs, and a limit below a peak is exceeded."""
    scenario = load_scenario(MASS, {"run": {"duration": 1.0, "convergence": "off"}})
    summary = beamsim.run(scenario).summary
    assert list(summary["margins"]) == ["outputs.wall", "outputs.inside"]
    for name in ("wall", "inside"):
        value = summary["peak_output"][name]
        entry = summary["margins"][f"outputs.{name}"]
        assert entry["value"] == value
        assert entry["exceeded"] == (value > entry["limit"])
    below = load_scenario(
        MASS, {"run": {"duration": 1.0, "convergence": "off"}, "limits": {"outputs": {"wall": "0.001 kN"}}}
    )
    margins = beamsim.run(below).summary["margins"]
    assert margins["outputs.wall"]["exceeded"]
    (message,) = limits_not_met(below, margins)
    assert message.startswith("output wall = ")
    assert message.endswith(" N exceeds limits.outputs.wall = 1 N")


@pytest.mark.parametrize(
    "sweep",
    [
        {"kind": "stepped", "from": 2.0, "to": 2.5, "points": 2},
        {"kind": "swept_sine", "from": 2.0, "to": 2.5, "rate": "0.1 Hz/s"},
        {"kind": "continuation", "from": 2.0, "to": 2.5},
    ],
)
def test_of_sweeps_and_continuations(sweep):
    """The largest over all frequencies; sweeps warn that they do not follow energies."""
    continued = sweep["kind"] == "continuation"
    analysis = beamsim.continuation if continued else beamsim.sweep
    summary = (result := analysis(load_scenario(MASS, {"sweep": sweep}))).summary
    assert set(summary["margins"]) == {"outputs.wall", "outputs.inside"}
    assert (summary["margins"]["outputs.inside"]["verdict"] == "not reliable") == (not continued)
    if continued:
        peaks = {name: of["value"] for name, of in summary["peak_output"].items()}
    else:
        assert any("limits.outputs.inside is not checked" in text for text in result.warnings)
        peaks = next(iter(summary["peak_output"].values()))
    assert summary["margins"]["outputs.wall"]["value"] == peaks["wall"]
    assert "Hz" in summary["margins"]["outputs.wall"]["at"]


def test_of_a_study():
    """Each case has a margin, also where other responses are asked for."""
    vary = {
        "kind": "grid", "parameters": [{"path": "excitation.level", "values": [1.0, 8.0]}],
        "responses": ["peak_displacement"],
    }  # fmt: skip
    scenario = load_scenario(MASS, {"run": {"duration": 1.0}, "vary": vary, "limits": {"outputs": {"wall": 10.0}}})
    result = beamsim.design_study(scenario)
    margin, peak = result["cases"]["margin"].sel(limit="outputs.wall").values, result.table["outputs/wall/peak_output"]
    assert margin == pytest.approx(10.0 / peak - 1.0, rel=1e-14)
    assert result.summary["margins"]["outputs.wall"]["case"] == 1
