"""What the first line says of a result: doubts about what is read first, with all modes of models that have few."""

import gzip
import tempfile
from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from imported_chain import imported_chain

import beamsim
from beamsim.cli.motions import run_screen
from beamsim.outcomes import OutcomeKind
from beamsim.results.values import is_main_value
from beamsim.scenario import load_scenario
from beamsim.store.results import load
from beamsim.system.build import build_system

ROOT = Path(__file__).parents[2]
BEAM = {"length": "270 mm", "width": "50 mm", "thickness": "5 mm", "youngs_modulus": "69 GPa",
        "density": "2700 kg/m^3", "damping": {"kind": "modal", "ratio": "1 %"}}  # fmt: skip

FLOATING = {
    "beam": {**BEAM, "length": "1 m", "supports": {"left": "free", "right": "free"}},
    "snubbers": [{"name": "tip", "position": "1 m", "side": "below", "stiffness": "5 kN/m", "gap": "1 mm"}],
    "reduction": {"modes": 3},
    "run": {"duration": 0.01, "start": "rest"},
}


def beam(modes, limit=None, **run):
    stops = [{"name": name, "position": at, "side": "below", "stiffness": k, "gap": "0 mm"}
             for name, at, k in (("left", "100 mm", "500 kN/m"), ("tip", "270 mm", "151 kN/m"))]  # fmt: skip
    excitation = {"kind": "harmonic", "applied_to": "base", "level": "2 g", "frequency": "65 Hz"}
    case = {"beam": BEAM, "snubbers": stops, "excitation": excitation, "reduction": {"modes": modes},
            "run": {"duration": 0.2, **run}}  # fmt: skip
    return load_scenario(case | ({"limits": limit} if limit else {}))


@pytest.mark.parametrize(
    ("key", "limits", "first"),
    [
        ("peak_force_n.tip", None, True),
        ("peak_acceleration_g.tip", None, True),
        ("up 2 g peak_displacement_m", None, False),
        ("open_frequencies_hz.1", None, True),
        ("closed_frequencies_hz.1", None, True),
        ("open_frequencies_hz.4", None, False),
        ("largest_bending_stress_pa", None, False),
        ("largest_bending_stress_pa", {"bending_stress": "80 MPa"}, True),
        ("rms_displacement_m.tip", None, False),
        ("rms_acceleration_g.tip", None, False),
        ("rms_acceleration_g.tip", {"rms_acceleration": "3 g"}, True),
        ("random.tip absolute_acceleration rms", {"rms_acceleration": "3 g"}, True),
        ("random.tip displacement rms", {"rms_acceleration": "3 g"}, False),
        ("rms_displacement_m.tip", {"rms_displacement": {"tip": "1 mm"}}, True),
        ("rms_displacement_m.middle", {"rms_displacement": {"tip": "1 mm"}}, False),
        ("rms_displacement_m.tip_2", {"rms_displacement": {"tip": "1 mm"}}, False),
        ("fatigue.beam", None, False),
        ("spectral_lines.tip displacement", None, False),
    ],
)
def test_what_is_read_first(key, limits, first):
    assert is_main_value(beam(3, limits), None, key) is first


@pytest.mark.parametrize(
    ("key", "first"),
    [("open_frequencies_hz.1", False), ("open_frequencies_hz.3", True), ("closed_frequencies_hz.2", True),
     ("closed_frequencies_hz.3", False)],
)  # fmt: skip
def test_the_first_frequency_of_a_floating_structure_is_that_of_its_first_elastic_mode(key, first):
    """A free beam has two motions as a rigid body, of which a stop in contact takes one."""
    case = load_scenario(FLOATING)
    modes = build_system(case).modes
    assert [int((modes[f"{state}_frequencies_hz"].values == 0.0).sum()) for state in ("open", "closed")] == [2, 1]
    assert is_main_value(case, modes, key) is first


def test_modes_that_are_hardly_kept_do_not_put_a_case_in_doubt():
    """Four elements give mode 6 with an error of more than 2 %, which no one reads as a result of this run."""
    result = beamsim.run(load_scenario(beam(6, low_pass="200 Hz"), {"beam.elements": 4}))
    assert {"open_frequencies_hz.6", "closed_frequencies_hz.6"} <= set(result.summary["doubtful"])
    assert result.outcome.gravest_kind is OutcomeKind.COMPLETE
    first, *_ = run_screen(result).text(result, ["case.h5"]).splitlines()
    assert "NOT CONVERGED" not in first
    assert "converged within" in first


def test_a_value_without_a_limit_is_marked_where_it_is_printed():
    """The dashpot meets a point without mass: the jump grows with the modes, whatever three times as many change."""
    case = load_scenario(ROOT / "configs/one_sided_65hz.yaml", {"beam.point_masses": []})
    result = beamsim.run(case)
    assert result.summary["without_limit"] == ["peak_acceleration_g.tip", "rms_acceleration_g.tip"]
    text = run_screen(result).text(result, ["case.h5"])
    assert "NOT CONVERGED: 1 value" in text.splitlines()[0]
    assert f"{result.summary['peak_acceleration_g']['tip']:.2g} g ^" in text
    assert "^ has no limit: it grows with the number of modes" in text
    filtered = beamsim.run(load_scenario(case.to_yaml(), {"run.low_pass": "2 kHz"}))
    assert "without_limit" not in filtered.summary
    assert "^" not in run_screen(filtered).text(filtered, ["case.h5"])


def test_the_finer_model_keeps_all_modes_where_there_are_few():
    """A chain of 25 masses: 5 of its modes, and 8 of them, miss what all of them give."""
    chain = {"masses": [1.0] * 25, "springs": [4e5] * 25, "damping": {"kind": "modal", "ratio": 0.02}}
    stop = {"name": "stop", "mass": 25, "side": "above", "stiffness": 2e4, "gap": 1e-4}
    case = {
        "chain": chain | {"snubbers": [stop]}, "reduction": {"modes": 5}, "run": {"duration": 0.2},
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": "2 g", "frequency": "6 Hz"},
    }  # fmt: skip
    few, every = (beamsim.run(load_scenario(case | {"reduction": {"modes": modes}})).summary for modes in (5, "all"))
    assert few["convergence_model"]["modes"] == 25
    for entry in ("peak_force_n", "peak_displacement_m", "peak_acceleration_g"):
        for place, value in few[entry].items():
            other = every[entry][place]
            change = abs(value - other) / max(abs(value), abs(other))
            assert few["convergence"][entry][place] == pytest.approx(change, rel=1e-6)


def test_imported_matrices_of_few_coordinates_are_compared_with_all_of_their_modes(tmp_path):
    """The stated change of 5 of 25 modes is the true one."""
    case = imported_chain(tmp_path, 25)
    end = case["probes"][0]["at"]
    case["snubbers"] = [{"name": "stop", "at": end, "side": "above", "stiffness": 2e4, "gap": 1e-4}]
    results = []
    for modes in (5, "all"):
        (tmp_path / "case.yaml").write_text(yaml.safe_dump(case | {"reduction": {"modes": modes}}))
        results.append(beamsim.run(load_scenario(tmp_path / "case.yaml")).summary)
    few, every = results
    assert few["convergence_model"]["modes"] == 25
    for entry in ("peak_force_n", "peak_displacement_m", "peak_acceleration_g"):
        for place, value in few[entry].items():
            change = abs(value - every[entry][place]) / max(abs(value), abs(every[entry][place]))
            assert few["convergence"][entry][place] == pytest.approx(change, rel=1e-4, abs=1e-9)


def doubting(name, **doubts):
    """A stored result with other doubts, and its screen."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.h5"
        path.write_bytes(gzip.decompress((ROOT / f"tests/data/results/{name}.h5.gz").read_bytes()))
        result = load(path)
    result = replace(result, summary={**result.summary, **doubts})
    return run_screen(result).text(result, ["case.h5"])


def test_values_that_are_not_read_first_are_marked_where_they_are_printed():
    """A doubt about them is not one about the case, and is not visible with -v alone."""
    doubts = ["contact_share.stop", "contacts.stop", "gapping_ratio.stop"]
    first, *others = doubting("run_chain", doubtful=doubts).splitlines()
    assert "all modes kept" in first
    assert any("33.8 % *, 7 *" in line for line in others)
    assert any(line.startswith("stop touches from ") and line.endswith(" *") for line in others)
    assert "* off by more than 2 %" in others


@pytest.mark.parametrize(("after", "sure"), [("contact_share.stop", False), ("peak_force_n.stop", True)])
def test_one_of_many_motions_is_said_first_of_what_is_read_first(after, sure):
    model = {"modes": 3, "first_modes": 2, "reason": ""}
    first, *others = doubting("run_chain", after_divergence=[after], convergence_model=model).splitlines()
    assert ("one of many motions" in first) is sure
    assert ("converged within" in first) is not sure
    assert any(" ~" in line for line in others)
    assert any(line.startswith("~ one of many motions") for line in others)


def test_means_that_differ_within_their_standard_error_are_counted_of_one_of_many_motions():
    model = {"modes": 3, "first_modes": 2, "reason": ""}
    changes = {
        "peak_force_n": {"stop": 0.05},
        "peak_displacement_m": {"one": 0.01},
        "max_displacement_m": {"one": 0.01},
    }
    after = [f"{entry}.{place}" for entry, of in changes.items() for place in of]
    first, *_ = doubting("run_chain", after_divergence=after, convergence=changes, convergence_model=model).splitlines()
    assert "one of many motions, means within 1 %, 1 mean within the standard error" in first
