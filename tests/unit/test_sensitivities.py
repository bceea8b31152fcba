"""Derivatives of a run's values: closed forms, whole runs beside it, grazing contacts, and what is shown of them."""

import math

import numpy as np
import pytest

import beamsim
from beamsim import load_scenario
from beamsim.analyses.studies.responses import entries_of, run_responses
from beamsim.cli.motions import run_screen
from beamsim.plots.run import run_figures
from beamsim.scenario.parameters import with_values
from beamsim.scenario.studies import resolve_parameter
from beamsim.store.results import load, write_result

STOP = {"name": "stop", "mass": 1, "side": "below", "stiffness": 3e4, "gap": 1e-3}
OSCILLATOR = {
    "chain": {"masses": [2.0], "springs": [8e3], "snubbers": [STOP]},
    "excitation": {"kind": "none"},
    "probes": [{"name": "mass", "mass": 1}],
    "run": {"duration": 1.0, "start": {"displacement": [4e-3]}, "convergence": "off"},
}


def asked(case, *numbers, **run):
    return load_scenario({**case, "run": {**case["run"], **run, "sensitivities": list(numbers)}})


def slope(result, response, path):
    return result.summary["sensitivities"][response][path]["derivative"]


def test_the_largest_force_of_an_oscillator_follows_from_its_energy():
    """k x0^2 = k (g + d)^2 + s d^2 at the largest penetration d, and the force is s d."""
    k, s, g, x0 = 8e3, 3e4, 1e-3, 4e-3
    d = (-k * g + math.sqrt((k * g) ** 2 - (k + s) * k * (g**2 - x0**2))) / (k + s)
    d_x0 = k * x0 / (k * (g + d) + s * d)
    d_g = -k * (g + d) / (k * (g + d) + s * d)
    d_s = -0.5 * d**2 / (k * (g + d) + s * d)
    paths = ["run.start.displacement[0]", "chain.snubbers.stop.gap", "chain.snubbers.stop.stiffness", "chain.masses[0]"]
    result = beamsim.run(asked(OSCILLATOR, *paths))
    found = [slope(result, "snubbers/stop/peak_force", path) for path in paths]
    np.testing.assert_allclose(found[:3], [s * d_x0, s * d_g, d + s * d_s], rtol=1e-10)
    assert abs(found[3]) < 1e-10 * s * d  # the energy does not depend on the mass


@pytest.mark.parametrize("excitation", [
    {"kind": "step", "applied_to": "base", "level": 2e-3, "quantity": "displacement", "rise": 0.05},
    {"kind": "step", "applied_to": "base", "level": 20.0, "duration": 0.05},
])  # fmt: skip
def test_an_undamped_peak_that_is_as_high_on_both_sides_is_counted_once(excitation):
    """It is proportional to the level."""
    case = {**OSCILLATOR, "chain": {"masses": [2.0], "springs": [800.0]}, "excitation": excitation}
    result = beamsim.run(asked(case, "excitation.level", start="static_equilibrium", duration=2.0))
    peak = result.summary["peak_displacement_m"]["mass"]
    found = slope(result, "probes/mass/peak_displacement", "excitation.level")
    assert found == pytest.approx(peak / excitation["level"], rel=1e-9)


def test_the_time_in_contact_follows_from_the_two_half_oscillations():
    """Without a gap the oscillator is in contact for half a period of the stiffer one, again and again."""
    case = {**OSCILLATOR, "chain": {"masses": [2.0], "springs": [8e3], "snubbers": [{**STOP, "gap": 1e-12}]}}
    opened, closed = math.pi * math.sqrt(2.0 / 8e3), math.pi * math.sqrt(2.0 / 3.8e4)
    duration = 5.0 * (opened + closed)  # ends in the middle of an open half, where it began
    result = beamsim.run(asked(case, "chain.snubbers.stop.stiffness", "chain.masses[0]", duration=duration))
    assert result.summary["contact_share"]["stop"] == pytest.approx(5.0 * closed / duration, rel=1e-7)
    by_stiffness = -0.5 * 5.0 * closed / 3.8e4 / duration
    assert slope(result, "snubbers/stop/contact_share", "chain.snubbers.stop.stiffness") == pytest.approx(
        by_stiffness, rel=1e-7
    )
    by_mass = 0.5 * 5.0 * closed / 2.0 / duration
    assert slope(result, "snubbers/stop/contact_share", "chain.masses[0]") == pytest.approx(by_mass, rel=1e-7)


BEAM = {
    "beam": {
        "length": 0.27, "width": 0.05, "thickness": 0.005, "youngs_modulus": 69e9, "density": 2700, "elements": 7,
        "supports": {"left": "clamped", "right": "free"}, "damping": {"kind": "modal", "ratio": 0.02},
    },
    "reduction": {"modes": 4},
    "snubbers": [
        {"name": "lower", "position": 0.26, "side": "below", "stiffness": 1.5e5, "gap": 2e-4,
         "damping": {"kind": "viscous", "coefficient": 30.0}},
        {"name": "upper", "position": 0.19, "side": "above", "stiffness": 8e4, "gap": -2e-5},
    ],
    "excitation": {"kind": "harmonic", "applied_to": "base", "level": "6 g", "frequency": 47.0},
    "probes": [{"name": "tip", "position": 0.27}],
    "run": {"duration": 0.08, "convergence": "off"},
}  # fmt: skip
CASES = {
    "beam": (BEAM, [
        {"path": "beam.length", "also": ["probes.tip.position"]}, "beam.thickness", "beam.damping.ratio",
        "snubbers.lower.position", "snubbers.lower.gap", "snubbers.lower.damping.coefficient", "snubbers.upper.gap",
        "excitation.level", "excitation.frequency",
    ]),
    "pulse": (BEAM | {
        "excitation": {"kind": "half_sine", "applied_to": "base", "level": "60 g", "duration": 0.006, "time": 0.002}
    }, ["excitation.duration", "excitation.time", "excitation.level", "beam.density"]),
    "face": (BEAM | {
        "snubbers": [{**BEAM["snubbers"][0], "law": "no_tension", "mounted_on": "ground"}, BEAM["snubbers"][1]]
    }, ["snubbers.lower.damping.coefficient", "snubbers.lower.stiffness", "beam.width", "excitation.frequency"]),
    "friction": ({
        "chain": {
            "masses": [1.0, 0.4], "springs": [4e4, 2e4], "dashpots": [4.0, 3.0],
            "snubbers": [{"name": "stop", "mass": 2, "side": "below", "stiffness": 1e5, "gap": 1e-3}],
        },
        "friction": [{"name": "pad", "mass": 1, "normal_force": 20.0, "coefficient": 0.3, "stiffness": 3e5}],
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": "3 g", "frequency": 17.0},
        "probes": [{"name": "second", "mass": 2}],
        "run": {"duration": 0.4, "convergence": "off"},
    }, ["friction.pad.normal_force", "friction.pad.stiffness", "chain.masses[1]", "chain.snubbers.stop.gap"]),
}  # fmt: skip
RUBBING = {"name": "rub", "position": 0.15, "normal_force": 20.0, "coefficient": 0.5}
CASES |= {
    # what holds moves otherwise in every model beside it
    "held beam": (BEAM | {
        "friction": [RUBBING], "snubbers": BEAM["snubbers"][:1], "excitation": BEAM["excitation"] | {"level": "20 g"},
    }, ["friction.rub.position", "friction.rub.normal_force", "beam.density", "snubbers.lower.gap"]),
    # by frequency and time of inputs that begin when there have been many cycles
    "late pulse": (BEAM | {
        "excitation": {"kind": "forces", "forces": [
            {"kind": "harmonic", "applied_to": {"position": 0.27}, "level": 30.0, "frequency": 47.0},
            {"kind": "half_sine", "applied_to": "base", "level": "15 g", "duration": 0.006, "time": 1.95},
        ]}, "run": {"duration": 2.0, "convergence": "off"}, "snubbers": BEAM["snubbers"][:1],
    }, ["excitation.forces[0].frequency", "excitation.forces[1].time"]),
}  # fmt: skip
TABLE = {key: STOP[key] for key in ("name", "mass", "side")} | {
    "force_deflection": {"points": [[0, 0], [5e-4, 8], [1e-3, 25], [6e-3, 250]], "scale": 1.1}, "preload": 9.0
}  # fmt: skip
RESTING = OSCILLATOR | {
    "gravity": 9.8, "constant_forces": [{"mass": 1, "force": -4.0}], "run": {"duration": 0.5, "convergence": "off"},
    "excitation": {"kind": "harmonic", "applied_to": {"mass": 1}, "level": 60.0, "frequency": 12.0},
}  # fmt: skip
OF_OSCILLATOR = ["constant_forces[0].force", "chain.masses[0]", "excitation.level"]  # no part of the stop's law
# all rest on the closed stop at the start
for name, stop, own in (
    ("spring", STOP, ["gap", "stiffness"]), ("table", TABLE, ["preload", "force_deflection.scale"]),
    ("branch", STOP | {"maxwell": [{"stiffness": 2e4, "relaxation_time": 0.01}]},
     ["gap", "maxwell[0].relaxation_time"]),
    ("yielding", STOP | {"hardening": {"yield_force": 40.0, "stiffness": 5e3}}, ["gap", "hardening.yield_force"]),
):  # fmt: skip
    resting = RESTING | {"chain": OSCILLATOR["chain"] | {"dashpots": [10.0], "snubbers": [stop]}}
    of_stop = ["gravity", *(f"chain.snubbers.stop.{each}" for each in own)]
    CASES[f"resting on {name}"] = resting, of_stop + OF_OSCILLATOR * (name == "spring")


@pytest.mark.parametrize("name", CASES)
def test_derivatives_are_those_of_whole_runs_beside_it(name):
    case, paths = CASES[name]
    scenario = asked(case, *paths)
    plain = load_scenario(case)
    result = beamsim.run(scenario)
    assert result.summary["events"] >= 4
    values = {row["response"]: row["value"] for row in result["sensitivities"].rows("row")}
    entries = entries_of(list(values), plain)
    for number in (resolve_parameter(scenario, each) for each in scenario.run.sensitivities):
        step = 2e-6 * abs(number.nominal)
        sides = [
            run_responses(
                beamsim.run(
                    with_values(plain, dict.fromkeys(number.places, number.nominal + h)), entries=entries
                ).summary
            )
            for h in (step, -step, 2.0 * step, -2.0 * step)
        ]
        for response, of in result.summary["sensitivities"].items():
            up, down, up_2, down_2 = (side[response] for side in sides)
            expected = (8.0 * (up - down) - (up_2 - down_2)) / (12.0 * step)
            scale = abs(values[response] / number.nominal)
            derivative = of[number.path]["derivative"]
            assert derivative == pytest.approx(expected, rel=3e-6, abs=1e-7 * scale), (response, number.path)


def test_the_slow_motion_of_a_structure_whose_bending_is_3e9_times_as_stiff():
    case = {
        "bodies": {"boom": {
            "kind": "beam", "length": 0.5, "bending_stiffness": 2e4, "mass_per_length": 1.2,
            "supports": {"left": "free", "right": "free"}, "point_masses": [{"position": 0.5, "mass": 0.5}],
        }},
        "joints": [{"name": "root", "kind": "hinge", "between": [{"body": "boom", "position": 0.0}, "base"],
                    "rotational_stiffness": 2.0}],
        "probes": [{"name": "tip", "at": {"body": "boom", "position": 0.5}}], "reduction": {"modes": 4},
        "run": {"duration": 0.05, "convergence": "off",
                "start": {"released_force": {"at": {"body": "boom", "position": 0.5}, "force": -0.4}}},
    }  # fmt: skip
    path, response, step = "bodies.boom.mass_per_length", "probes/tip/peak_acceleration", 1e-3
    sides = [
        run_responses(beamsim.run(load_scenario(case, [f"{path}={1.2 + k * step}"])).summary)[response]
        for k in (1, -1, 2, -2)
    ]
    expected = (8.0 * (sides[0] - sides[1]) - (sides[2] - sides[3])) / (12.0 * step)
    assert slope(beamsim.run(asked(case, path)), response, path) == pytest.approx(expected, rel=1e-5)


def test_a_force_that_is_constant_is_named():
    """Two equal bodies press each other with the same force at all times, until one of them is another."""
    bodies = {name: {"kind": "chain", "masses": [1.0], "springs": [4e3]} for name in "ab"}
    between = [{"body": "a", "mass": 1}, {"body": "b", "mass": 1}]
    case = {
        "bodies": bodies, "probes": [{"name": "a", "at": between[0]}],
        "snubbers": [{"name": "stop", "between": between, "stiffness": 1e5, "preload": 5.0}],
        "excitation": {"kind": "half_sine", "applied_to": "base", "level": "1 g", "duration": 0.01}, "run": {
            "duration": 0.1, "convergence": "off"},
    }  # fmt: skip
    result = beamsim.run(asked(case, "bodies.a.masses[0]"))
    assert any("stop/peak_force does not change along the motion" in text for text in result.warnings)


def test_two_contacts_that_begin_at_once_move_apart():
    """A symmetric structure touches two stops at the same instant; by the gap of one alone their times differ."""
    stops = [
        {"name": name, "mass": k, "side": "below", "stiffness": 2e4, "gap": 1e-3} for k, name in ((1, "a"), (2, "b"))
    ]
    case = OSCILLATOR | {
        "chain": {"masses": [1.0, 1.0], "springs": [4e3, 0.0, 4e3], "snubbers": stops},
        "probes": [{"name": "first", "mass": 1}],
        "run": {"duration": 0.5, "start": {"displacement": [4e-3, 4e-3]}, "convergence": "off"},
    }
    result = beamsim.run(asked(case, "chain.snubbers.a.gap"))
    assert result.summary["contacts"]["a"] == result.summary["contacts"]["b"] > 2
    alone = OSCILLATOR | {
        "chain": {"masses": [1.0], "springs": [4e3], "snubbers": [{**stops[0]}]}, "run": case["run"] | {
            "start": {"displacement": [4e-3]}}
    }  # fmt: skip
    expected = beamsim.run(asked(alone, "chain.snubbers.a.gap"))
    for response in ("snubbers/a/contact_share", "snubbers/a/peak_force"):
        found = slope(result, response, "chain.snubbers.a.gap")
        assert found == pytest.approx(slope(expected, response, "chain.snubbers.a.gap"), rel=1e-9)
    for response in ("snubbers/b/contact_share", "snubbers/b/peak_force"):
        assert slope(result, response, "chain.snubbers.a.gap") == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("distance", "said"),
    [
        (1e-14, "infinite"),
        (0.0, "infinite"),
        (-1e-14, "infinite"),
        (1e-7, "valid for smaller"),
        (-1e-7, "valid for smaller"),
        (1e-3, ""),
    ],
)
def test_a_grazing_contact_is_named(distance, said):
    """Released at x0, the undamped oscillator comes to -x0: the stop there is grazed, or just missed."""
    gap = 4e-3 - distance
    case = OSCILLATOR | {"chain": {**OSCILLATOR["chain"], "snubbers": [{**STOP, "gap": gap}]}}
    result = beamsim.run(asked(case, {"path": "chain.snubbers.stop.gap", "tolerance": "0.02 mm"}))
    notes = [text for text in result.warnings if "a contact is only grazed" in text]
    told = result.summary["sensitivities"]["snubbers/stop/peak_force"]["chain.snubbers.stop.gap"]
    if said:
        assert len(notes) == 1
        assert said in notes[0]
        assert told["holds_within"] == pytest.approx(max(abs(distance), 1e-12 * 8e-3), rel=0.02, abs=1e-15)
    else:
        assert notes == []
        assert told["holds_within"] > 2e-5


def test_a_number_with_other_derivatives_on_both_sides_is_named():
    """The stop just touches at rest: a smaller gap presses it, a larger one leaves the start as it is."""
    case = OSCILLATOR | {
        "chain": {**OSCILLATOR["chain"], "snubbers": [{**STOP, "gap": 0.0}]},
        "excitation": {"kind": "harmonic", "applied_to": {"mass": 1}, "level": "20 N", "frequency": 9.0},
        "run": {"duration": 0.3, "convergence": "off"},
    }
    result = beamsim.run(asked(case, {"path": "chain.snubbers.stop.gap", "tolerance": "0.01 mm"}))
    assert any("on both sides of it derivatives differ" in text for text in result.warnings)


def test_the_result_file_has_them(tmp_path):
    result = beamsim.run(
        asked(OSCILLATOR, {"path": "chain.snubbers.stop.gap", "tolerance": "0.1 mm"}, "chain.masses[0]")
    )
    write_result(result, tmp_path / "case.h5")
    again = load(tmp_path / "case.h5")
    assert again["sensitivities"].rows("row") == result["sensitivities"].rows("row")
    row = again.summary["sensitivities"]["probes/mass/min_displacement"]["chain.snubbers.stop.gap"]
    assert row["change"] == row["derivative"] * row["tolerance"] == pytest.approx(row["derivative"] * 1e-4)
    assert again.summary["sensitivities"] == result.summary["sensitivities"]


@pytest.mark.parametrize(
    "change",
    [
        {
            "chain": OSCILLATOR["chain"] | {"springs_to_ground": [{"mass": 1, "kind": "cubic", "stiffness": 1e9}]},
            "run": OSCILLATOR["run"] | {"duration": 0.05},
        },
        {"run": OSCILLATOR["run"] | {"method": "reference", "duration": 0.05}},
    ],
)
def test_motions_from_time_stepping_are_refused(change):
    with pytest.raises(beamsim.ScenarioError, match=r"run.sensitivities need the whole motion in closed form"):
        beamsim.run(asked(OSCILLATOR | change, "chain.masses[0]"))


def test_a_number_that_nothing_follows_is_refused_with_what_would_follow_it():
    with pytest.raises(beamsim.ScenarioError, match=r"beam.length has a neighbouring value that is refused.*also"):
        beamsim.run(asked(BEAM, "beam.length"))


def test_they_are_printed_and_drawn_the_most_important_first():
    numbers = [{"path": "chain.snubbers.stop.gap", "tolerance": "0.1 mm"}, "chain.snubbers.stop.stiffness"]
    result = beamsim.run(asked(OSCILLATOR, *numbers))
    of = result.summary["sensitivities"]["snubbers/stop/peak_force"]
    by_gap, by_stiffness = (of[f"chain.snubbers.stop.{name}"]["change"] for name in ("gap", "stiffness"))
    assert abs(by_gap) > abs(by_stiffness)
    screen = run_screen(result).text(result, ["case.h5"])
    said = (
        f"stop.gap +0.1 mm: {1e3 * by_gap:.3g} mN, chain.snubbers.stop.stiffness +300 N/m: +{1e3 * by_stiffness:.3g} mN"
    )
    assert f"peak force of stop: chain.snubbers.{said}" in screen
    ax = run_figures(result)["sensitivities"].figure().axes[0]
    assert [label.get_text() for label in ax.get_yticklabels()] == [
        "chain.snubbers.stop.gap ± 0.1 mm", "chain.snubbers.stop.stiffness ± 300 N/m"
    ]  # fmt: skip
    widths = [bar.get_width() for bar in ax.patches]
    np.testing.assert_allclose(widths, [by_gap, by_stiffness, -by_gap, -by_stiffness], rtol=1e-12)
