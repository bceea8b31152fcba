"""Impact statistics against closed forms, momentum and the energy balance; rainflow against ASTM E1049."""

from pathlib import Path

import numpy as np
import pytest
from scipy import stats
from scipy.optimize import minimize_scalar

import beamsim
from beamsim.scenario import Scenario, load_scenario
from beamsim.signals.rainflow import damage, equivalent_range, rainflow

EXAMPLES = Path(__file__).parents[1] / "data" / "examples"
MASS, SPRING, STOP = 1.3, 4.0, 900.0  # kg, N/m, N/m
SPEED = 1.0  # m/s


def thrown(dashpot=0.0, law="kelvin_voigt", spring=SPRING, **run):
    """A mass on a spring that meets a stop at its rest position."""
    stop = {
        "name": "stop", "mass": 1, "side": "below", "stiffness": STOP, "gap": 0.0, "law": law,
        "damping": {"kind": "viscous", "coefficient": dashpot},
    }  # fmt: skip
    settings = {
        "duration": 12.0, "sample_rate": 50.0, "start": {"displacement": [0.0], "velocity": [-SPEED]},
        "convergence": "off", "impacts": {}, **run,
    }  # fmt: skip
    chain = {"masses": [MASS], "springs": [spring], "snubbers": [stop]}
    return Scenario.model_validate({"chain": chain, "probes": [{"name": "m", "mass": 1}], "run": settings})


@pytest.mark.parametrize("dashpot", [0.0, 4.0])
def test_a_bouncing_mass_in_closed_form(dashpot):
    """Each contact is half a period of a damped oscillation: its time, speeds, peak, impulse and loss are known."""
    result = beamsim.run(thrown(dashpot))
    impacts, (stop,) = result["impacts"], result.summary["impacts"].values()
    omega = np.sqrt((SPRING + STOP) / MASS)
    zeta = dashpot / (2.0 * MASS * omega)
    damped = omega * np.sqrt(1.0 - zeta**2)
    restitution = np.exp(-np.pi * zeta / np.sqrt(1.0 - zeta**2))
    whole = ~impacts["incomplete"].values
    n = np.arange(impacts["begin"].values.size)
    speed = SPEED * restitution**n
    period = np.pi / damped + np.pi / np.sqrt(SPRING / MASS)
    np.testing.assert_allclose(impacts["begin"].values, n * period, atol=1e-11)
    np.testing.assert_allclose(impacts["contact_time"].values[whole], np.pi / damped, rtol=1e-11)
    np.testing.assert_allclose(impacts["approach_speed"].values, speed, rtol=1e-11)
    np.testing.assert_allclose(impacts["separation_speed"].values[whole], restitution * speed[whole], rtol=1e-11)
    np.testing.assert_allclose(impacts["restitution"].values[whole], restitution, rtol=1e-11)
    np.testing.assert_allclose(
        impacts["impulse"].values[whole], STOP * speed[whole] * (1 + restitution) / omega**2, rtol=1e-10
    )
    lost = 0.5 * MASS * speed**2 * (1.0 - restitution**2)
    np.testing.assert_allclose(impacts["energy_lost"].values[whole], lost[whole], rtol=1e-10, atol=1e-14)
    # k delta + c delta' is highest where its rate is zero

    def force(tau):
        delta = np.exp(-zeta * omega * tau) * np.sin(damped * tau) / damped
        rate = np.exp(-zeta * omega * tau) * (np.cos(damped * tau) - zeta * omega / damped * np.sin(damped * tau))
        return STOP * delta + dashpot * rate

    ends, finest = (0.0, np.pi / damped), {"xatol": 1e-10}
    highest = minimize_scalar(lambda tau: -force(tau), bounds=ends, method="bounded", options=finest)
    np.testing.assert_allclose(impacts["peak_force"].values[whole], -highest.fun * speed[whole], rtol=1e-11)
    time = impacts["peak_time"].values - impacts["begin"].values
    np.testing.assert_allclose(time[whole], highest.x, atol=1e-6)
    assert stop["number"] == result.summary["contacts"]["stop"] == n.size
    assert stop["restitution"] == pytest.approx(restitution, rel=1e-10)
    assert stop["contact_share"] == pytest.approx(result.summary["contact_share"]["stop"], rel=1e-12)


def test_a_pad_that_never_pulls_restores_less():
    """Contact ends where the force vanishes: e = exp(-2 zeta / s acos(zeta)), s = sqrt(1 - zeta^2); the rest of the
    pad's energy is lost while it relaxes."""
    dashpot = 12.0
    result = beamsim.run(thrown(dashpot, "no_tension", spring=1e-7, duration=1.0))
    impacts = result["impacts"]
    zeta = dashpot / (2.0 * np.sqrt(STOP * MASS))
    angle = 2.0 * np.arccos(zeta) / np.sqrt(1.0 - zeta**2)
    restitution = np.exp(-zeta * angle)
    assert impacts["begin"].values.size == 1
    assert impacts["restitution"].values[0] == pytest.approx(restitution, rel=1e-8)
    assert impacts["contact_time"].values[0] == pytest.approx(angle / np.sqrt(STOP / MASS), rel=1e-8)
    assert impacts["energy_lost"].values[0] == pytest.approx(0.5 * MASS * SPEED**2 * (1 - restitution**2), rel=1e-8)
    assert impacts["impulse"].values[0] == pytest.approx(MASS * SPEED * (1 + restitution), rel=1e-8)


TABLE = {"force_deflection": [[0.0, 0.0], [2e-4, 10.0], [1e-3, 90.0]], "stiffness": None}
BRANCH = {"maxwell": [{"stiffness": 4e4, "relaxation_time": 5e-3}]}
LAWS = {
    "kelvin_voigt": {"law": "kelvin_voigt"},
    "no_tension": {"law": "no_tension"},
    "table": {**TABLE, "law": "no_tension"},
    "maxwell": {**BRANCH, "law": "no_tension"},
    "all": {**TABLE, **BRANCH, "law": "no_tension"},
}


@pytest.mark.parametrize("law", LAWS)
def test_what_impacts_lose_is_what_the_structure_loses(law):
    """Without structural damping the losses of all impacts are the dissipation of the energy balance."""
    bumper = {"name": "bumper", "between": [2, 3], "resists": "approach", "stiffness": 1e5, "gap": 5e-4}
    cable = {"name": "cable", "between": [1, 3], "resists": "separation", "stiffness": 2e4, "gap": 3e-3}
    for snubber, dashpot in ((bumper, 40.0), (cable, 25.0)):
        snubber |= {"damping": {"kind": "viscous", "coefficient": dashpot}, **LAWS[law]}
    case = {
        "chain": {"masses": [1.0, 0.5, 0.5], "springs": [4e4, 2e4, 2e4], "snubbers": [bumper, cable]},
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": 10.0, "frequency": 15.0},
        "run": {"duration": 2.0, "sample_rate": 1000.0, "convergence": "off", "impacts": {}},
    }
    result = beamsim.run(Scenario.model_validate(case))
    impacts = result["impacts"]
    assert impacts["begin"].values.size > 40
    assert impacts["energy_lost"].values.sum() == pytest.approx(
        result["histories"]["energy_dissipated"].values[-1], rel=1e-10
    )
    assert np.all(np.diff(impacts["begin"].values) >= 0.0)
    for j, (name, snubber) in enumerate(result.summary["impacts"].items()):
        each = impacts["snubber"].values == j
        assert snubber["impulse_n_s"] == pytest.approx(impacts["impulse"].values[each].sum(), rel=1e-12)
        assert snubber["peak_force_n"] == pytest.approx(result.summary["peak_force_n"][name], rel=1e-9)
        samples, time = (
            result["histories"]["snubber_force"].sel(snubber=name).values,
            result["histories"]["time"].values,
        )
        for begin, end, peak in zip(
            impacts["begin"].values[each], impacts["end"].values[each], impacts["peak_force"].values[each], strict=True
        ):
            assert samples[(time > begin) & (time < end)].max(initial=0.0) <= peak * (1 + 1e-12)


def test_impulses_are_the_change_of_momentum():
    """A mass between two stops, tied to nothing that counts: its momentum changes by the impulses alone."""
    stop = {"mass": 1, "stiffness": STOP, "gap": 0.02, "damping": {"kind": "viscous", "coefficient": 3.0}}
    stops = [{**stop, "name": "low", "side": "below"}, {**stop, "name": "high", "side": "above", "stiffness": 500.0}]
    case = thrown(spring=1e-9, duration=2.03).model_dump(mode="json", exclude_unset=True)
    case["chain"]["snubbers"] = stops
    result = beamsim.run(Scenario.model_validate(case))
    low, high = result.summary["impacts"].values()
    velocity = result["histories"]["velocity"].sel(probe="m").values
    assert min(low["number"], high["number"]) >= 4
    gained = low["impulse_n_s"] - high["impulse_n_s"]
    assert gained == pytest.approx(MASS * (velocity[-1] + SPEED), rel=1e-10)
    mean, share = low["mean_force_n"], low["contact_share"]
    assert low["mean_force_in_contact_n"] == pytest.approx(mean / share, rel=1e-12)
    assert low["rms_force_in_contact_n"] == pytest.approx(low["rms_force_n"] / np.sqrt(share), rel=1e-12)


def test_minimum_rest_joins_contacts_and_the_threshold_leaves_impacts_out():
    result = beamsim.run(thrown(4.0))
    whole = result["impacts"]
    apart = np.pi / np.sqrt(SPRING / MASS)
    joined = beamsim.run(thrown(4.0, impacts={"minimum_rest": 1.01 * apart}))["impacts"]
    assert joined["begin"].values.size == 1
    assert joined["contacts"].values[0] == whole["begin"].values.size
    assert joined["impulse"].values[0] == pytest.approx(whole["impulse"].values.sum(), rel=1e-13)
    assert joined["contact_time"].values[0] == pytest.approx(whole["contact_time"].values.sum(), rel=1e-13)
    assert joined["end"].values[0] == whole["end"].values[-1]
    kept = beamsim.run(thrown(4.0, impacts={"minimum_rest": 0.99 * apart}))["impacts"]
    assert kept["begin"].values.size == whole["begin"].values.size
    limit = float(np.sort(whole["peak_force"].values)[-3])
    strong = beamsim.run(thrown(4.0, impacts={"force_threshold": limit * (1 - 1e-9)}))
    (stop,) = strong.summary["impacts"].values()
    assert (stop["number"], stop["below_threshold"]) == (3, whole["begin"].values.size - 3)
    # of all contact
    assert stop["impulse_n_s"] == pytest.approx(result.summary["impacts"]["stop"]["impulse_n_s"], rel=1e-14)


def test_a_run_that_begins_and_ends_in_contact():
    start = {"displacement": [-0.01], "velocity": [0.0]}
    result = beamsim.run(thrown(duration=0.02, start=start))
    impacts = result["impacts"]
    assert impacts["incomplete"].values.tolist() == [True]
    assert np.isnan(impacts["approach_speed"].values[0])
    assert np.isnan(impacts["restitution"].values[0])
    assert result.summary["impacts"]["stop"]["incomplete"] == 1


def test_rainflow_of_the_worked_example():
    """ASTM E1049-85, figure 6: A-B 3, B-C 4, E-F 4 (whole), C-D 8, D-G 9, G-H 8, H-I 6, the others half."""
    cycles = rainflow(np.array([-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0]))
    expected = [[3, -0.5, 0.5], [4, -1, 0.5], [4, 1, 1], [8, 1, 0.5], [9, 0.5, 0.5], [8, 0, 0.5], [6, 1, 0.5]]
    assert cycles.tolist() == expected
    assert damage(cycles, 8.0, 100.0, 3.0) == pytest.approx(
        sum(n * (s / 8.0) ** 3 for s, _, n in expected) / 100.0, rel=1e-14
    )
    assert damage(cycles, 8.0, 100.0, 3.0, limit=8.0) == pytest.approx(0.5 * (9 / 8) ** 3 / 100.0, rel=1e-14)
    assert rainflow(np.array([1.0])).size == rainflow(np.zeros(5)).size == 0
    assert damage(cycles, 1e-30, 100.0, 100.0) == float("inf")  # a stress range in the wrong unit
    largest = cycles[:, 0].max()
    assert equivalent_range(cycles, 100.0) == pytest.approx(largest * (0.5 / cycles[:, 2].sum()) ** 0.01, rel=1e-4)
    assert equivalent_range(cycles, 100.0, limit=largest) == 0.0


def cycles_of(counted):
    """Range, mean and count (n, 3) of all cycles of a dataset."""
    return np.stack([counted[name].values for name in ("range", "mean", "count")], axis=1)


def test_stress_and_force_are_counted_as_dense_samples_are():
    """Turning points in closed form give the cycles of a record sampled at 2 MHz."""
    case = load_scenario(
        EXAMPLES / "one_sided_65hz.yaml",
        ["run.duration=0.1", "run.sample_rate=2 MHz", "run.convergence=off", "run.impacts={}", "run.spectrum.last=0.1",
         "run.fatigue={stress_range: 80 MPa, exponent: 5, cycles: 2e6}"],
    )  # fmt: skip
    result = beamsim.run(case)
    (snubber,) = result.summary["impacts"].values()
    sampled = rainflow(result["histories"]["snubber_force"].values[0])
    counted = cycles_of(result["impact_statistics"])
    large = 1e-3 * snubber["peak_force_n"]
    exact, of_samples = (np.sort(x[x[:, 0] > large, 0]) for x in (counted, sampled))
    np.testing.assert_allclose(exact, of_samples, rtol=1e-3, atol=1e-3 * snubber["peak_force_n"])
    (body,), cycles = result.summary["fatigue"].values(), cycles_of(result["fatigue"])
    assert body["largest_range_pa"] <= 2.0 * result.summary["largest_bending_stress_pa"]
    assert np.max(np.abs(cycles[:, 1]) + 0.5 * cycles[:, 0]) == pytest.approx(
        result.summary["largest_bending_stress_pa"], rel=1e-9
    )
    assert body["damage"] == pytest.approx(damage(cycles, 80e6, 2e6, 5.0))
    assert body["life_s"] == pytest.approx(0.1 / body["damage"], rel=1e-12)
    assert body["cycles"] * (body["equivalent_range_pa"] / 80e6) ** 5 / 2e6 == pytest.approx(body["damage"], rel=1e-12)


def test_failure_within_a_run_is_doubted():
    """Stress ranges of 80 Pa instead of 80 MPa gave a life of 0 s without a word."""
    case = EXAMPLES / "one_sided_65hz.yaml"
    short = ["run.duration=30 ms", "run.spectrum=null", "run.convergence=off", "run.sample_rate=2 kHz"]
    for stress, doubted in (("80 MPa", False), ("80", True)):
        fatigue = f"run.fatigue={{stress_range: {stress}, exponent: 5}}"
        result = beamsim.run(load_scenario(case, [*short, fatigue]))
        doubts = [text for text in result.warnings if "is failure within the run" in text]
        assert [text.startswith("the damage of beam = ") for text in doubts] == [True] * doubted


def test_intervals_of_a_random_input():
    """That of the rate is Student's t interval of the counts in equal blocks; the others hold their value."""
    psd = "[{frequency: 20, density: 0.5 g^2/Hz}, {frequency: 300, density: 0.5 g^2/Hz}]"
    random = f"excitation={{kind: random, applied_to: base, psd: {psd}, seed: 3}}"
    overrides = ["run.spectrum.last=0.1", "run.convergence=off", "run.impacts={}", "run.duration=3", random]
    case = load_scenario(EXAMPLES / "one_sided_65hz.yaml", overrides)
    result = beamsim.run(case)
    impacts, (snubber,) = result["impacts"], result.summary["impacts"].values()
    rows = {row["value_name"]: row for row in result["impact_statistics"].rows("interval")}
    edges = np.linspace(0.3, 3.0, 21)
    counts = np.histogram(impacts["begin"].values, edges)[0]
    half = stats.t.ppf(0.975, 19) * counts.std(ddof=1) / np.sqrt(20)
    rate = rows["rate_hz"]
    assert counts.sum() > 100
    assert rate["value"] == pytest.approx(counts.sum() / 2.7, rel=1e-12)
    assert [rate["low"], rate["high"]] == pytest.approx(
        [(20 * (counts.mean() + x)) / 2.7 for x in (-half, half)], rel=1e-9
    )
    assert all(row["low"] < row["value"] < row["high"] for row in rows.values())
    assert rows["rms_force_n"]["value"] == pytest.approx(snubber["rms_force_n"], rel=0.2)
    assert snubber["intervals"]["rate_hz"] == [rate["low"], rate["high"]]


@pytest.mark.parametrize("inside", [0.0, 0.4])
def test_impacts_from_a_time_on(inside):
    """From between two impacts, or from within one, which is cut there: what begins later is as in closed form."""
    dashpot, number = 4.0, 2
    omega = np.sqrt((SPRING + STOP) / MASS)
    zeta = dashpot / (2.0 * MASS * omega)
    contact, rest = np.pi / (omega * np.sqrt(1.0 - zeta**2)), np.pi / np.sqrt(SPRING / MASS)
    begin = number * (contact + rest) + (inside * contact if inside else -0.3 * rest)
    result = beamsim.run(thrown(dashpot, **{"from": begin}))
    impacts, of = result["impacts"], result.summary["impacts"]["stop"]
    n = np.arange(number, number + impacts["begin"].values.size)
    begins = n * (contact + rest)
    begins[0] = max(begins[0], begin)
    np.testing.assert_allclose(impacts["begin"].values, begins, atol=1e-11)
    assert of["rate_hz"] == pytest.approx(n.size / (12.0 - begin), rel=1e-12)
    assert impacts["incomplete"].values[0] == np.isnan(impacts["approach_speed"].values[0]) == (inside > 0.0)
    np.testing.assert_allclose(impacts["contact_time"].values[0], (1.0 - inside) * contact, rtol=1e-9)
    restitution = np.exp(-np.pi * zeta / np.sqrt(1.0 - zeta**2))
    whole = ~impacts["incomplete"].values
    np.testing.assert_allclose(impacts["approach_speed"].values[whole], SPEED * restitution ** n[whole], rtol=1e-11)
    assert of["contact_share"] * (12.0 - begin) == pytest.approx(impacts["contact_time"].values.sum(), rel=1e-12)


@pytest.mark.parametrize("begin", [3.0, 5.3])
def test_sums_before_and_after_a_time_are_those_of_the_run(begin):
    whole = beamsim.run(thrown(4.0)).summary["impacts"]["stop"]
    before = beamsim.run(thrown(4.0, duration=begin)).summary["impacts"]["stop"]
    after = beamsim.run(thrown(4.0, **{"from": begin})).summary["impacts"]["stop"]
    for name in ("impulse_n_s", "energy_lost_j"):
        assert before[name] + after[name] == pytest.approx(whole[name], rel=1e-10)
    square = [of["rms_force_n"] ** 2 * time for of, time in ((before, begin), (after, 12.0 - begin), (whole, 12.0))]
    assert square[0] + square[1] == pytest.approx(square[2], rel=1e-10)
