"""A contact that begins at t = 0 is an event and counts; a snubber that is pressed there was in contact before."""

import numpy as np
import pytest

import beamsim
from beamsim.scenario import Scenario

SPRING, STOP = 4.0, 60.0  # N/m, on a mass of 1 kg
OPEN, CLOSED = np.sqrt(SPRING), np.sqrt(SPRING + STOP)
METHODS = [{}, {"method": "reference", "integrator": "DOP853", "rtol": 1e-11}]


def case(start, gap=0.0, **rest):
    stop = {"name": "stop", "mass": 1, "side": "below", "stiffness": STOP, **({} if gap is None else {"gap": gap})}
    run = {"duration": 5.0, "sample_rate": 50.0, "start": start, "convergence": "off", **rest.pop("run", {})}
    chain = {"masses": [1.0], "springs": [SPRING], "snubbers": [stop | rest.pop("stop", {})]}
    return Scenario.model_validate({"chain": chain, "probes": [{"name": "m", "mass": 1}], "run": run, **rest})


@pytest.mark.parametrize("method", METHODS, ids=["exact", "reference"])
def test_a_mass_thrown_at_a_closed_gap(method):
    """Half a period in contact, half a period away, from t = 0 on."""
    result = beamsim.run(case({"displacement": [0.0], "velocity": [-1.0]}, run=method))
    expected = np.cumsum([0.0, *[np.pi / CLOSED, np.pi / OPEN] * 3])
    expected = expected[expected < 5.0]
    np.testing.assert_allclose(result["events"]["time"].values, expected, atol=1e-8)
    assert result["events"]["closing"].values.tolist() == [k % 2 == 0 for k in range(expected.size)]
    figures = result.summary
    assert figures["contacts"]["stop"] == (expected.size + 1) // 2
    assert figures["events"] == expected.size
    assert figures["linear"] is False
    away = np.clip(np.diff(np.append(expected, 5.0)), 0, None)[::2].sum() / 5.0
    assert figures["contact_share"]["stop"] == pytest.approx(away, rel=1e-7)


def test_a_contact_of_50_nanoseconds_counts():
    """Thrown at a closed gap against 400 kN, the mass of 1 kg is back after 2 v / a = 50 ns, 0.1 nm deep."""
    away = {"kind": "step", "applied_to": {"mass": 1}, "level": 4e5}
    thrown = case({"velocity": [-0.01]}, excitation=away, run={"duration": 1e-3, "sample_rate": 1e4})
    result = beamsim.run(thrown)
    np.testing.assert_allclose(result["events"]["time"].values, [0.0, 5e-8], rtol=1e-5)
    assert result["events"]["closing"].values.tolist() == [True, False]
    assert result.summary["contacts"]["stop"] == 1


@pytest.mark.parametrize("method", METHODS, ids=["exact", "reference"])
def test_a_step_that_only_presses_is_one_contact_and_not_linear(method):
    """Pushed against the stop from rest, the mass never comes back beyond its start."""
    push = {"kind": "step", "applied_to": {"mass": 1}, "level": -3.0}
    result = beamsim.run(case("rest", excitation=push, run={**method, "duration": 0.7}))
    assert result["events"]["time"].values[0] == 0.0
    assert result["events"]["closing"].values[0]
    assert (result.summary["contacts"]["stop"], result.summary["linear"]) == (1, False)
    assert result.summary["contact_share"]["stop"] == 1.0
    away = beamsim.run(case("rest", excitation={**push, "level": 3.0}, run={**method, "duration": 0.7}))
    assert (away.summary["contacts"]["stop"], away.summary["events"], away.summary["linear"]) == (0, 0, True)


@pytest.mark.parametrize("method", METHODS, ids=["exact", "reference"])
def test_a_prestressed_snubber_has_not_begun(method):
    """Preloaded by 3 N: shaken little it stays closed, a linear run; shaken hard its first event is an opening."""
    shaken = {"kind": "harmonic", "applied_to": {"mass": 1}, "frequency": 0.4, "level": 0.5}
    start = "static_equilibrium"
    calm = beamsim.run(case(start, None, stop={"preload": 3.0}, excitation=shaken, run=method)).summary
    assert (calm["contacts"]["stop"], calm["events"], calm["linear"]) == (0, 0, True)
    assert calm["contact_share"]["stop"] == 1.0
    hard = beamsim.run(case(start, None, stop={"preload": 3.0}, excitation={**shaken, "level": 20.0}, run=method))
    assert not hard["events"]["closing"].values[0]
    assert hard["events"]["time"].values[0] > 0.0
    assert hard.summary["contacts"]["stop"] == hard["events"]["closing"].values.sum() > 0
    assert hard.summary["linear"] is False


def test_a_mass_released_from_the_stop_has_not_begun():
    """Pressed by the given start; it opens, and every later contact counts."""
    result = beamsim.run(case({"displacement": [-0.1]}))
    assert not result["events"]["closing"].values[0]
    assert result["events"]["time"].values[0] == pytest.approx(np.pi / 2 / CLOSED, rel=1e-12)
    assert result.summary["contacts"]["stop"] == result["events"]["closing"].values.sum()


@pytest.mark.parametrize("masses", [1, 2])
@pytest.mark.parametrize("kind", ["step", "half_sine"])
def test_a_mass_that_rests_at_a_closed_gap_until_it_is_pushed(kind, masses):
    """Contact begins with the push, whatever power of time the penetration starts with: 2 to 5."""
    push = {"kind": kind, "applied_to": {"mass": masses}, "level": -3.0, "time": 0.3}
    push |= {"duration": 2.0} if kind == "half_sine" else {}
    stop = {"name": "stop", "mass": 1, "side": "below", "stiffness": STOP, "gap": 0.0}
    chain = {"masses": [1.0, 0.5][:masses], "springs": [SPRING, 9.0][:masses], "snubbers": [stop]}
    result = beamsim.run(case("rest", chain=chain, excitation=push, run={"duration": 1.0}))
    assert result["events"]["closing"].values[0]
    assert result["events"]["time"].values[0] == 0.3
    assert result.summary["contact_share"]["stop"] == pytest.approx(0.7, abs=1e-12)


def test_a_mass_that_another_stop_pushes_away_has_no_contact_at_its_closed_gap():
    """The load alone would close the gap; with the pressed stop's force the mass leaves at once."""
    closed = {"name": "closed", "mass": 1, "side": "below", "stiffness": STOP, "gap": 0.0}
    pressed = {**closed, "name": "pressed", "gap": -0.1}
    chain = {"masses": [1.0], "springs": [SPRING], "snubbers": [closed, pressed]}
    push = {"kind": "step", "applied_to": {"mass": 1}, "level": -3.0}
    result = beamsim.run(case("rest", chain=chain, excitation=push, run={"duration": 0.1}))
    assert result["events"]["time"].values.size == 0
    assert result.summary["contacts"] == {"closed": 0, "pressed": 0}
    assert result.summary["contact_share"] == {"closed": 0.0, "pressed": 1.0}
    assert result["histories"]["snubber_force"].sel(snubber="closed").values.max() == 0.0


def test_a_derivative_of_round_off_closes_no_gap():
    """A force on the fourth of five masses, a stop on either side of the fifth: one of them is entered, not both."""
    stops = [
        {"name": side, "mass": 5, "side": side, "stiffness": k, "gap": 0.0, "law": "no_tension",
         "damping": {"kind": "ratio", "ratio": ratio}}
        for side, k, ratio in (("above", 10533.203633616988, 0.04373741283871345),
                               ("below", 8684.829056684921, 0.1117638574994136))
    ]  # fmt: skip
    chain = {
        "masses": [1.0027570682915976, 2.4045486280421886, 1.2995674886628397, 0.4611989924256367, 0.6325785072459154],
        "springs": [17.29693229489926, 7.319181994686006, 6.616266038796908, 11.237172059910959, 9.782131527219867,
                    45.887855283766264],
        "dashpots": [0.14120812273431618, 0.2632385481394736, 0.034959007581655224, 0.2836023694923981,
                     0.3090108099713598, 0.38150608120087237],
        "snubbers": stops,
    }  # fmt: skip
    tone = {"kind": "harmonic", "applied_to": {"mass": 4}, "level": 6.344851789506788e-06,
            "frequency": 0.16651448916969097, "phase": 0.33507399616793787}  # fmt: skip
    result = beamsim.run(case("rest", chain=chain, excitation=tone, run={"duration": 3.0}))
    assert [
        (float(t), int(k))
        for t, k in zip(result["events"]["time"].values[:1], result["events"]["snubber"].values, strict=False)
    ] == [(0, 0)]
    assert result["events"]["time"].values[1] > 2.9
    assert result.summary["contacts"] == {"above": 1, "below": 0}


def test_a_low_derivative_beside_the_motion_of_a_stiff_stop():
    """A force presses the third mass on a stiff stop of no gap; the second follows with the fourth power of time, away
    from its stop against the first. The fifth and sixth derivatives, of the stiff stop's motion, do not close that."""
    stops = [
        {"name": "stiff", "mass": 3, "side": "above", "stiffness": 1017981760.4290954, "gap": 0.0, "law": "no_tension",
         "damping": {"kind": "ratio", "ratio": 0.013463566347538893}},
        {"name": "link", "between": [1, 2], "resists": "approach", "stiffness": 40091304.99072216, "gap": 0.0,
         "law": "no_tension", "damping": {"kind": "viscous", "coefficient": 565.6045869647984}},
    ]  # fmt: skip
    chain = {
        "masses": [0.6547235862052709, 1.1685060115409205, 0.2253091757318123],
        "springs": [2724.2261594142165, 10139.044940880842, 9244.698788197386, 3577.571708195824],
        "dashpots": [0.4818315935467764, 9.354736748265548, 4.351030650090999, 3.214652597187318],
        "snubbers": stops,
    }
    push = {"kind": "harmonic", "applied_to": {"mass": 3}, "level": 0.026626204090475593,
            "frequency": 10.970105961486704, "phase": 1.0182723814572388}  # fmt: skip
    result = beamsim.run(case("rest", chain=chain, excitation=push, run={"duration": 0.02}))
    assert result["events"]["snubber"].values.tolist() == [0]
    assert result["events"]["time"].values.tolist() == [0.0]
    assert result.summary["contacts"] == {"stiff": 1, "link": 0}


@pytest.mark.parametrize("thrown", [0.008450318427599749, 0.3, 7.0])
def test_a_mass_thrown_off_its_stop_comes_back_once(thrown):
    """Under a constant pull x = v t - a t² / 2: the first step of the search ends at the return, not at the start."""
    mass, pull, stiffness = 0.10748258473142189, 9.361911009323189, 5.25e7
    chain = {"masses": [mass], "springs": [0.0], "dashpots": [0.0], "snubbers": [
        {"name": "stop", "mass": 1, "side": "below", "stiffness": stiffness, "gap": 0.0}]}  # fmt: skip
    step = {"kind": "step", "applied_to": "base", "level": pull, "time": 0.0}
    returns, contact = 2 * thrown / pull, np.pi * np.sqrt(mass / stiffness)
    run = {"duration": returns + 3 * contact, "sample_rate": 1e5}
    result = beamsim.run(case({"velocity": [thrown]}, chain=chain, excitation=step, run=run))
    assert result["events"]["time"].values[0] == pytest.approx(returns, rel=1e-12)
    assert result["events"]["closing"].values.tolist() == [True, False]
    assert result.summary["contacts"] == {"stop": 1}


def test_a_beam_that_leaves_its_stop_at_once_has_no_contact_by_round_off():
    """Written in the coordinates of the open contact, the gap of a start on the stop is -5e-18 m."""
    stop = {"name": "stop", "position": 0.733966278602483, "side": "below", "mounted_on": "ground", "gap": 0.0,
            "stiffness": 4033647.9429575442, "law": "no_tension"}  # fmt: skip
    rubs = {"name": "rub", "at": {"position": 0.4241864241340903}, "mounted_on": "base",
            "coefficient": {"static": 0.18445398964514548, "sliding": 0.13258818627038876},
            "normal_force": 0.0021443044241516943, "stiffness": 482.63091253335847}  # fmt: skip
    beam = {"length": 0.733966278602483, "elements": 3, "supports": {"left": "free", "right": "free"},
            "bending_stiffness": 384.00783844286514, "mass_per_length": 9.139766566837386,
            "damping": {"kind": "rayleigh", "mass": 9.503687623097424, "stiffness": 2.68607553369523e-05}}  # fmt: skip
    velocity = [0.0015199066837247711, -0.0008188518900541655, 0.0007941314122146021, -0.0018151208191102021]
    run = {"duration": 0.001, "start": {"velocity": velocity}, "convergence": "off"}
    case = {"beam": beam, "reduction": {"modes": "all"}, "snubbers": [stop], "friction": [rubs], "run": run}
    result = beamsim.run(Scenario.model_validate(case))
    assert result.summary["contacts"] == {"stop": 0}
    assert not result["events"]["time"].values.size
