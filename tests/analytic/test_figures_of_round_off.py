"""Figures that are zero but for round-off are not data: no number, no doubt, no lines."""

import numpy as np
import pytest

import beamsim
from beamsim.cli.tables import table_rows
from beamsim.trust.studies import design_study

PINNED = {
    "beam": {
        "length": 0.27, "bending_stiffness": 2.77, "mass_per_length": 0.41,
        "supports": {"left": "pinned", "right": "pinned"}, "damping": {"kind": "modal", "ratio": 0.02},
    },
    "snubbers": [{"name": "far", "position": 0.1, "side": "below", "stiffness": 6e4, "gap": 0.01}],
    "excitation": {"kind": "none"},
    "probes": [{"name": "middle", "position": 0.135}, {"name": "quarter", "position": 0.0675}],
    "run": {"duration": 0.05, "start": {"mode": 2, "amplitude": 1e-3}},
}  # fmt: skip


@pytest.mark.parametrize("first", ["middle", "quarter"])
def test_a_probe_at_a_node_does_not_move(first):
    """Its 1e-17 m changed by half with the finer model, and the whole run was not to be trusted."""
    probes = sorted(PINNED["probes"], key=lambda probe: probe["name"] != first)
    result = beamsim.run(beamsim.load_scenario({**PINNED, "probes": probes}))
    assert result.outcome.code == "complete"
    assert result.summary["doubtful"] == []
    for figure in ("peak_displacement_m", "min_displacement_m", "max_displacement_m", "peak_acceleration_g"):
        assert result.summary[figure]["middle"] == 0.0
        assert result.summary[figure]["quarter"] != 0.0
    assert {line["probe"] for line in result.summary["spectral_lines"]} == {"quarter"}
    assert set(result.summary["convergence"]["rms_displacement_m"]) == {"quarter"}


def test_a_contact_throughout_has_no_opening():
    """A free beam that falls on a stop: the opening was 4e-17 m, marked as changing by 50 %; the same in a study."""
    case = {
        "beam": {
            "length": 3.4223425000871788, "width": 0.07060241215895702, "thickness": 0.16396808472049362,
            "youngs_modulus": 52107674871.622955, "density": 1555.8323321474638, "elements": 5,
            "supports": {"left": "free", "right": "free"},
        },
        "gravity": -1.774053192204638,
        "snubbers": [{
            "name": "stop", "position": 1.7111712500435894, "side": "above", "stiffness": 617.3713684565334, "gap": 0,
            "damping": {"kind": "viscous", "coefficient": 3019.544148071633},
        }],
        "excitation": {"kind": "none"},
        "probes": [{"name": "middle", "position": 1.7}],
        "run": {"duration": 1.0, "start": "rest"},
    }  # fmt: skip
    result = beamsim.run(beamsim.load_scenario(case))
    assert result.outcome.code == "complete"
    assert result.summary["contact_share"]["stop"] == pytest.approx(1.0, rel=1e-14)
    assert result.summary["largest_gap_m"]["stop"] == 0.0
    assert result.summary["doubtful"] == []
    vary = {"kind": "grid", "parameters": [{"path": "snubbers.stop.stiffness", "values": [600.0, 700.0]}]}
    study = design_study(beamsim.load_scenario({**case, "vary": vary}), workers=1)
    np.testing.assert_array_equal(study.table["snubbers/stop/largest_gap"], 0.0)


@pytest.mark.parametrize(
    "excitation", [{"kind": "none"}, {"kind": "harmonic", "applied_to": "base", "level": 0.0, "frequency": 40.0}]
)
@pytest.mark.parametrize("preload", [0.0, 5.0])
def test_a_structure_at_rest_has_converged(excitation, preload):
    """Under its weight: accelerations of 1e-13 g changed by half, with spectral lines and advice."""
    stop = {**PINNED["snubbers"][0]} | ({"gap": None, "preload": preload} if preload else {})
    case = {
        **PINNED, "gravity": 9.81, "excitation": excitation, "run": {"duration": 0.05},
        "snubbers": [{name: value for name, value in stop.items() if value is not None}],
        "outputs": [{"name": kind, "kind": kind, "at": {"position": 0.1}} for kind in ("acceleration", "velocity")],
    }  # fmt: skip
    result = beamsim.run(beamsim.load_scenario(case))
    assert result.outcome.code == "complete"
    assert result.summary["peak_acceleration_g"] == {"middle": 0.0, "quarter": 0.0}
    assert result.summary["peak_output"] == {"acceleration": 0.0, "velocity": 0.0}
    assert result.summary["peak_displacement_m"]["middle"] > 1e-4
    lines = [line for line in result.summary["spectral_lines"] if line["quantity"] != "displacement"]
    assert not lines
    assert not any("low_pass" in warning for warning in result.warnings)
    # the twin: what moves by a millionth of its deflection does not rest
    shaken = {"kind": "harmonic", "applied_to": {"position": 0.1}, "level": 1e-6, "frequency": 40.0}
    moved = beamsim.run(beamsim.load_scenario({**case, "excitation": shaken})).summary
    assert moved["peak_acceleration_g"]["middle"] > 1e-8
    assert min(moved["peak_output"].values()) > 0.0


def test_frequencies_of_static_vectors_are_not_natural_frequencies():
    """With three modes and a static vector a fourth one was printed, 80 % above that of the beam."""
    case = {**PINNED, "reduction": {"modes": 3}, "run": {**PINNED["run"], "duration": 0.01}}
    result = beamsim.run(beamsim.load_scenario(case))
    rows = [text for name, text in table_rows(result)]
    opened, closed = (next(row for row in rows if row.startswith(f"{state} freq")) for state in ("open", "closed"))
    *printed, unit = opened.partition(", error")[0].split()[2:]
    assert unit == "Hz"
    natural = [np.pi / 2 * (k / 0.27) ** 2 * np.sqrt(2.77 / 0.41) for k in (1, 2, 3)]
    assert [float(number.strip(",")) for number in printed] == pytest.approx(natural, rel=1e-4)
    assert len(closed.partition(", error")[0].split()) == 2 + 4
    assert not any("frequencies" in name for name in result.summary["doubtful"])
    assert set(result.summary["convergence"]["open_frequencies_hz"]) == {"1", "2", "3"}
