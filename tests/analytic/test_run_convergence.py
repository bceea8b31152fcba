"""Every value of a run has its error, from a finer model; accelerations may be read through a filter."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.signal import butter, lsim, zpk2tf
from shipped import config_path

import beamsim
from beamsim.cli.tables import all_rows, table_rows
from beamsim.flow.exact import exact_flow
from beamsim.flow.transient import simulate
from beamsim.outcomes import OutcomeKind, exit_code
from beamsim.results.result import ALLOWED_ERROR
from beamsim.scenario import load_scenario
from beamsim.signals import filters
from beamsim.signals.filters import FilteredPanels, FilteredSegments, filter_outputs
from beamsim.system.build import build_system
from tests.helpers.observed import accelerations

PANEL = {"length": "1.2 m", "bending_stiffness": "2967 N m^2", "mass_per_length": "2.4 kg/m",
         "damping": {"kind": "modal", "ratio": 0.02}, "supports": {"left": "pinned", "right": "free"}}  # fmt: skip


def panel(*, ratio=0.05, **more):
    """A hinged panel between two pairs of stops, shaken by a half-sine pulse."""
    damping = {"damping": {"kind": "ratio", "ratio": ratio}} if ratio else {}
    stops = [
        {"name": f"{side}_{x}", "position": x, "side": side, "stiffness": "100 kN/m", "gap": "-0.3 mm", **damping}
        for x in (0.6, 1.2)
        for side in ("below", "above")
    ]
    run = {"duration": "0.03 s"} | more.pop("run", {})
    pulse = {"kind": "half_sine", "applied_to": "base", "level": "20 g", "duration": "11 ms"}
    model = {"reduction": {"modes": 15}}
    return load_scenario({"beam": PANEL, "snubbers": stops, "excitation": pulse, "run": run, **model, **more})


def harmonic_beam(**more):
    return load_scenario(
        {
            "beam": {"length": 0.27, "bending_stiffness": 2.0, "mass_per_length": 0.25,
                     "damping": {"kind": "modal", "ratio": 0.01}},
            "snubbers": [{"name": "tip", "position": 0.27, "side": "below", "stiffness": "100 kN/m", "gap": 0}],
            "excitation": {"kind": "harmonic", "applied_to": "base", "level": "2 g", "frequency": "65 Hz"},
            "run": {"duration": 0.4} | more.pop("run", {}),
            **more,
        }
    )  # fmt: skip


@pytest.fixture(scope="module")
def damped():
    """With limits of about half and twice the peak acceleration."""
    accelerations = {"below_1.2": "60 g", "above_1.2": "240 g"}
    return beamsim.run(panel(limits={"peak_acceleration": accelerations, "peak_force": "1 MN"}))


def test_acceleration_at_a_dashpot_without_mass_grows_with_the_modes_and_says_so(damped):
    runs = [beamsim.run(panel(reduction={"modes": n}, run={"convergence": "off"})) for n in (6, 15)]
    at_tip = [run.summary["peak_acceleration_g"]["below_1.2"] for run in runs]
    assert all(later > 1.3 * earlier for earlier, later in pairwise(at_tip))

    s = damped.summary
    peaks = {f"peak_acceleration_g.{name}" for name in damped["histories"].labels("probe")}
    assert peaks <= set(s["doubtful"]) <= peaks | {key.replace("peak", "rms") for key in peaks}
    assert "peak acceleration of below_1.2 by " in damped.status  # as the table says it
    assert min(s["convergence"]["peak_acceleration_g"].values()) > 0.2
    assert s["reduction_bound"] < 1e-2  # of displacements, which says nothing of accelerations
    for figure in ("peak_displacement_m", "peak_force_n", "contact_share", "largest_gap_m"):
        assert max(s["convergence"][figure].values()) < 1e-3, figure


def test_the_error_follows_from_the_finer_model_itself(damped):
    """9/8 of the change between the same two models, each solved as a run of its own."""
    modes = damped.summary["kept_modes"]
    finer = panel(beam=PANEL | {"elements": 40}, reduction={"modes": 3 * modes}, run={"convergence": "off"})
    other = beamsim.run(finer).summary
    for figure in ("peak_displacement_m", "peak_acceleration_g", "peak_force_n", "largest_gap_m"):
        for name, a in damped.summary[figure].items():
            b = other[figure][name]
            change = abs(a - b) / max(abs(a), abs(b))
            least = 1e-3 if figure == "peak_acceleration_g" else 0.0
            error = max(9 / 8 * change, least)
            assert damped.summary["convergence"][figure][name] == pytest.approx(error, rel=1e-5, abs=1e-9)


def test_status_table_file_and_pictures_say_so(damped, tmp_path):
    assert damped.outcome.usable  # the displacements and forces are right
    assert not damped.complete
    assert damped.outcome.kind is OutcomeKind.DOUBTFUL
    assert damped.outcome.code == "figures_doubtful"
    assert "run.low_pass" in damped.outcome.remedy
    assert "dashpot" in damped.outcome.remedy
    rows = list(table_rows(damped))
    told = "; ".join(text for label, text in list(all_rows("run", damped))[1:3] if not label)
    assert told.lower() == damped.status.lower()
    assert damped.status.startswith("not converged: values are off by more than 2 %")
    assert sum(text.count("NOT CONVERGED") for _, text in rows) == len(damped.summary["doubtful"]) > 0
    path = beamsim.write_result(damped, tmp_path / "run.h5")
    stored = beamsim.load(path)
    assert stored.outcome == damped.outcome
    assert stored.summary["convergence"] == damped.summary["convergence"]
    assert stored.summary["convergence"]["peak_displacement_m"]["below_1.2"] < 1e-4
    texts = [text.get_text() for text in stored.plot()["acceleration"].axes[0].texts]
    assert any("not converged" in text for text in texts)
    assert not any("not converged" in t.get_text() for t in stored.plot()["displacement"].axes[0].texts)


def test_an_undamped_step_force():
    case = {
        "beam": {"length": 0.27, "bending_stiffness": 2.0, "mass_per_length": 0.25},
        "excitation": {"kind": "step", "applied_to": {"position": 0.27}, "level": "1 N"},
        "probes": [{"name": "tip", "position": 0.27}],
        "run": {"duration": 0.05},
    }
    s = beamsim.run(load_scenario(case)).summary
    assert s["doubtful"] == ["peak_acceleration_g.tip", "rms_acceleration_g.tip"]  # each line by itself converges
    assert s["convergence"]["peak_acceleration_g"]["tip"] > 0.2
    assert s["convergence"]["peak_displacement_m"]["tip"] < 1e-3
    case["run"]["low_pass"] = "1 kHz"
    assert "peak_acceleration_g.tip" not in beamsim.run(load_scenario(case)).summary["doubtful"]


def test_all_modes_kept_leaves_nothing_to_compare():
    run = {"duration": 10, "start": {"mode": 1, "amplitude": 1}}
    case = {"chain": {"masses": [1, 1], "springs": [1, 1, 0]}, "run": run}
    s = beamsim.run(load_scenario(case)).summary
    assert s["convergence_model"]["modes"] == 0
    assert set(s["convergence"]["peak_displacement_m"].values()) == {0.0}
    reduced = beamsim.run(load_scenario(case | {"reduction": {"modes": 1}}))
    assert reduced.summary["convergence_model"]["modes"] == 2


def test_off_and_studies():
    unchecked = beamsim.run(harmonic_beam(run={"convergence": "off"}))
    assert unchecked.summary["convergence"] == {}
    assert any(text.split() == ["reason", "not", "requested"] for _, text in table_rows(unchecked))
    from beamsim.analyses.studies.plan import plan_designs
    from beamsim.cases import Case

    vary = {"kind": "grid", "parameters": [{"path": "snubbers.tip.stiffness", "values": [1e5, 2e5]}]}
    study, case = plan_designs(harmonic_beam(vary=vary)).study, Case(0, (1e5,))
    assert study.scenario(case).run.convergence == "off"
    study = plan_designs(harmonic_beam(vary=vary, run={"convergence": "on"})).study
    assert study.scenario(case).run.convergence == "on"


def test_a_chaotic_motion_is_compared_before_the_sequences_part_and_statistically_after():
    """A hard stop beside a strongly shaken beam: no two models bounce alike for long, yet both are good."""
    stop = {"name": "tip", "position": 0.27, "side": "below", "stiffness": "1000 kN/m", "gap": "1 mm"}
    shaken = {"kind": "harmonic", "applied_to": "base", "level": "10 g", "frequency": "70 Hz"}
    case = harmonic_beam(run={"duration": 4.0}, excitation=shaken, snubbers=[stop], reduction={"modes": 20})
    result = beamsim.run(case)
    s = result.summary
    parted = s["convergence_model"]["contact_divergence_s"]
    assert 0.0 < parted < s["convergence_model"]["disturbance_divergence_s"] < 4.0  # sensitive, not only two models
    assert "contact_share.tip" in s["after_divergence"]
    assert ALLOWED_ERROR < s["convergence"]["contact_share"]["tip"] < 0.2  # of its mean, by chance
    assert s["convergence"]["peak_force_n"]["tip"] < ALLOWED_ERROR
    assert not {"contact_share.tip", "peak_force_n.tip"} & set(s["doubtful"])
    rows = [text for _, text in table_rows(result) if text.startswith("contact share")]
    assert any(text.endswith("within the standard error of its mean") for text in rows)


def test_forces_that_last_for_an_instant_are_compared_with_forces():
    """A dashpot at a stiff stop: samples missed its force, which "changed by 93 %, within its scatter"."""
    short = {"run.duration": 0.2, "run.spectrum": {"last": 0.1}, "reduction.modes": 8, "run.low_pass": 2e3}
    s = beamsim.run(load_scenario(config_path("one_sided_65hz"), {"snubbers[0].stiffness": 151e8} | short)).summary
    assert s["convergence_model"]["contact_divergence_s"] < 0.1
    assert s["convergence"]["peak_force_n"]["tip"] < ALLOWED_ERROR


def test_a_model_of_one_mode_is_told_from_a_good_one():
    """The comparison can fail: half a model changes its displacements."""
    s = beamsim.run(harmonic_beam(reduction={"modes": 1}, excitation={
        "kind": "harmonic", "applied_to": "base", "level": "2 g", "frequency": "300 Hz",
    })).summary  # fmt: skip
    assert "peak_displacement_m.tip" in s["doubtful"]
    assert s["convergence"]["peak_displacement_m"]["tip"] > ALLOWED_ERROR


def test_a_force_that_changes_by_more_than_half_is_not_reliable():
    """It was complete, with exit code 0, where the modes were given: a stop that only one of the models touches."""
    shaken = {"kind": "harmonic", "applied_to": "base", "level": "2 g", "frequency": "100 Hz"}

    def run(gap, modes, **more):
        stop = {"name": "tip", "position": 0.27, "side": "below", "stiffness": "10 kN/m", "gap": gap}
        return beamsim.run(harmonic_beam(snubbers=[stop], reduction={"modes": modes}, excitation=shaken, **more))

    free = {modes: -run(0.1, modes, run={"duration": 0.1}).summary["min_displacement_m"]["tip"] for modes in (2, 3)}
    assert abs(free[2] / free[3] - 1.0) < ALLOWED_ERROR
    limits = {"peak_force": "1 kN", "peak_displacement": "1 m"}
    result = run(0.5 * (free[2] + free[3]), 2, run={"duration": 0.1}, limits=limits)
    assert result.summary["convergence"]["peak_force_n"]["tip"] == 9 / 8  # 0 N in one of both
    assert (result.outcome.code, exit_code(result.outcome)) == ("figures_worthless", 3)
    assert result.status.startswith("not reliable: displacements or forces are off by more than 50 % (seen with 3")
    assert {item["verdict"] for item in result.summary["margins"].values()} == {"not reliable"}
    unchecked = run(0.5 * (free[2] + free[3]), 2, run={"duration": 0.1, "convergence": "off"}, limits=limits)
    assert exit_code(unchecked.outcome) == 0
    assert {item["verdict"] for item in unchecked.summary["margins"].values()} == {"ok"}


def test_a_limit_on_a_value_that_grows_with_the_modes_is_neither_met_nor_exceeded(damped):
    """The acceleration at the dashpot has no limit as the modes grow: no level is known to hold it."""
    margins = damped.summary["margins"]
    for name, share in (("below_1.2", 0.5), ("above_1.2", 2.0)):
        margin = margins[f"peak_acceleration.{name}"]
        assert margin["limit"] == pytest.approx(share * margin["value"], rel=0.3)
        assert margin["verdict"] == "not reliable"
        assert not margin["exceeded"]
        assert margin["highest"] == np.inf
    assert margins["peak_force"]["verdict"] == "ok"


# --- The filter -------------------------------------------------------------------------------------------------------


def test_low_pass_of_a_motion_is_that_of_scipy_on_fine_samples(monkeypatch):
    """Against a state-space simulation of SciPy's Butterworth filter, driven by fine exact samples.

    In closed form, and on panels, as motions with powers of time are.
    """
    scenario = harmonic_beam(reduction={"modes": 4}, run={"duration": 0.05})
    system = build_system(scenario)
    flow = exact_flow(system, 0.05)
    motion = simulate(flow, system.initial_state)
    output = accelerations(system, flow)
    times = np.linspace(0.0, 0.05, 100_001)
    closed = filter_outputs(motion, output, 1500.0, times[::250])
    monkeypatch.setattr(filters, "_near_poles", lambda *_: True)
    on_panels = filter_outputs(motion, output, 1500.0, times[::250])
    assert isinstance(closed, FilteredSegments)
    assert isinstance(on_panels, FilteredPanels)
    fine = motion.sample(times, output)[:, 0]
    z, p, k = butter(4, 2 * np.pi * 1500.0, analog=True, output="zpk")
    _, expected, _ = lsim(zpk2tf(z, p, k), fine, times)
    later = slice(60_000, 80_000)
    for motion in (closed, on_panels):
        np.testing.assert_allclose(motion.at(times[::250])[:, 0], expected[::250], atol=2e-6 * np.abs(expected).max())
        for part in (slice(None), later):
            low, _, high, when = motion.extremes(times[part][0], times[part][-1])
            assert high[0] == pytest.approx(expected[part].max(), rel=1e-5)
            assert low[0] == pytest.approx(expected[part].min(), rel=1e-5)
            assert when[0] == pytest.approx(times[part][expected[part].argmax()], abs=1e-6)
    np.testing.assert_allclose(closed.at(times[::250]), on_panels.at(times[::250]), rtol=0, atol=1e-10 * high[0])


@pytest.mark.parametrize("frequency", [1.0, 300.0])
def test_low_passed_peaks_of_a_fast_motion_are_certified(frequency):
    """The filter takes away most of what the modes do; no value between is beyond the extremes."""
    system = build_system(harmonic_beam(reduction={"modes": 6}))
    flow = exact_flow(system, 0.2)
    motion = simulate(flow, system.initial_state)
    behind = filter_outputs(motion, accelerations(system, flow), frequency, np.zeros(0))
    low, _, high, _ = behind.extremes(0.0, 0.2)
    fine = behind.at(np.linspace(0.0, 0.2, 40_001))
    size = max(high[0], -low[0])
    assert high[0] == pytest.approx(fine.max(), abs=1e-5 * size)
    assert low[0] == pytest.approx(fine.min(), abs=1e-5 * size)
    assert fine.max() <= high[0] + 1e-9 * size
    assert fine.min() >= low[0] - 1e-9 * size


def test_low_passed_peaks_reach_summary_histories_and_limits():
    raw, read = (beamsim.run(harmonic_beam(run=r, limits={"peak_acceleration": "30 g"}))
                 for r in ({"convergence": "off"}, {"convergence": "off", "low_pass": "200 Hz"}))  # fmt: skip
    a, b = raw.summary["peak_acceleration_g"]["tip"], read.summary["peak_acceleration_g"]["tip"]
    assert b < 0.7 * a
    history = read["histories"]["low_passed_acceleration"].sel(probe="tip").values
    assert np.abs(history).max() / 9.80665 == pytest.approx(b, rel=0.02)
    np.testing.assert_array_equal(
        read["histories"]["absolute_acceleration"].sel(probe="tip").values,
        raw["histories"]["absolute_acceleration"].sel(probe="tip").values,
    )
    assert read.summary["margins"]["peak_acceleration"]["value"] == pytest.approx(b * 9.80665)
    assert "low_passed_acceleration" not in raw["histories"]


def test_a_shoulder_beside_a_strong_line_is_not_sought_at_that_line():
    """Order 8 has weak lines near 7.95 and 8.06 on its sides; each is compared with its own in the finer model."""
    pad = {"name": "pad", "position": 0.6, "side": "below", "stiffness": 1e5, "law": "no_tension", "gap": 1e-3,
           "damping": {"kind": "ratio", "ratio": 0.05}}  # fmt: skip
    beam = {"length": 1.2, "bending_stiffness": 2967, "mass_per_length": 2.4,
            "damping": {"kind": "modal", "ratio": 0.02}, "supports": {"left": "pinned", "right": "pinned"}}  # fmt: skip
    excitation = {"kind": "harmonic", "applied_to": "base", "level": "0.5 g", "frequency": "40 Hz"}
    case = {
        "beam": beam, "snubbers": [pad], "excitation": excitation, "reduction": {"highest_frequency": "2 kHz"},
        "run": {"duration": 2.0, "low_pass": "2 kHz"},
    }  # fmt: skip
    result = beamsim.run(beamsim.load_scenario(case))
    lines = [line for line in result.summary["spectral_lines"] if line["quantity"] == "absolute_acceleration"]
    bin_width = 0.5 / 40.0  # in orders, of 2 s
    for order in (3.0, 7.95, 8.0, 8.06):
        nearest = min(lines, key=lambda line: abs(line["order"] - order))
        assert nearest["order"] == pytest.approx(order, abs=bin_width)
        assert nearest["error"] < 0.01
    assert result.summary["convergence"]["spectral_lines"]["pad absolute_acceleration"] < 0.02
