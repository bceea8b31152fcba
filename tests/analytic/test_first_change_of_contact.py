"""Only the first change of contact is predicted by the linear motion: against own integration and closed forms."""

import json

import numpy as np
import pytest
from independent import Stop, chain, integrate
from typer.testing import CliRunner

import beamsim
from beamsim.analyses.sweep.analysis import sweep as sweep_alone
from beamsim.analyses.sweep.analysis import sweep_system
from beamsim.analyses.sweep.result import contact_levels_of
from beamsim.cli.app import app
from beamsim.cli.screens import Errors
from beamsim.cli.screens import contact_levels as contact_sentences
from beamsim.cli.tables import table_rows
from beamsim.flow.exact import exact_flow
from beamsim.flow.transient import simulate
from beamsim.responses.gapping import contact_levels
from beamsim.scenario import load_scenario
from beamsim.system.build import build_system

OTHER = "a table, branch, spring or friction changes first"


def lines_of(result):
    return contact_sentences(result, Errors(result))


# two masses on preloaded stops, shaken at their foot
SPRINGS, STOPS, PRELOADS, HZ = (200.0, 300.0), (2000.0, 800.0), (0.3, 1.0), 4.5


def masses(level=0.1, preloads=PRELOADS, **more):
    stops = [
        {"name": name, "mass": k + 1, "side": "below", "stiffness": STOPS[k], "preload": preloads[k],
         "damping": {"kind": "viscous", "coefficient": 5.0}}
        for k, name in enumerate(("floor", "tip"))
    ]  # fmt: skip
    scenario = {
        "chain": {"masses": [1.0, 1.0], "springs": [*SPRINGS, 0.0], "dashpots": [1.0, 1.0, 0.0], "snubbers": stops},
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": f"{level} m/s^2", "frequency": HZ},
        "probes": [{"name": "mass", "mass": 2}],
        "run": {"duration": 0.5, "convergence": "off"},
        "sweep": {"kind": "stepped", "from": 3.0, "to": 9.0, "points": 13, "convergence": "off"},
    }
    return load_scenario(scenario | more)


def own_model():
    """The structure, its stops, rest, and the linear amplitudes for a unit of acceleration."""
    structure = chain([1.0, 1.0], [*SPRINGS, 0.0], [1.0, 1.0, 0.0])
    rest = np.linalg.solve(structure.stiffness, PRELOADS)
    stops = [Stop(np.eye(2)[k], STOPS[k], 5.0, -PRELOADS[k] / STOPS[k] - rest[k]) for k in range(2)]
    w = 2 * np.pi * HZ
    stiffness, damping = structure.stiffness + np.diag(STOPS), structure.damping + 5.0 * np.eye(2)
    amplitude = np.linalg.solve(stiffness - w**2 * structure.mass + 1j * w * damping, -structure.inertia)
    return structure, stops, rest, amplitude


def stops_that_open(level):
    """Within twelve periods from the linear steady motion, by DOP853."""
    structure, stops, rest, amplitude = own_model()
    w, q = 2 * np.pi * HZ, level * amplitude
    start = np.concatenate([rest + q.imag, (1j * w * q).imag])
    motion = integrate(
        structure, stops, lambda t: -structure.inertia * level * np.sin(w * t), start, np.linspace(0.0, 12 / HZ, 9),
        most_step=0.02 / HZ, rtol=1e-10,
    )  # fmt: skip
    return set(motion.event_stop.tolist())


def test_the_level_of_a_later_stop_is_not_printed_as_a_fact():
    """It opens at 70 % of the level of the motion in which the first one stays closed."""
    *_, amplitude = own_model()
    floor, tip = np.array(PRELOADS) / np.array(STOPS) / np.abs(amplitude)
    assert floor < 0.5 * tip
    assert stops_that_open(0.999 * floor) == set()
    assert stops_that_open(1.01 * floor) == {0}
    assert stops_that_open(0.7 * tip) == {0, 1}
    result = beamsim.run(masses())
    of = result.summary["gapping"]
    assert of["floor"]["level"] == pytest.approx(floor, rel=1e-9)
    assert "not_predicted" not in of["floor"]
    assert of["tip"]["not_predicted"] == "floor opens first"
    assert all(np.isnan(of["tip"][name]) for name in ("level", "share_of_level", "frequency_hz"))
    rows = [text for _, text in table_rows(result)]
    assert any(text.startswith("not predicted") and text.endswith("floor opens first") for text in rows)
    floor_line, tip_line = lines_of(result)
    assert floor_line.startswith("floor opens from")
    assert tip_line == "tip not predicted: floor opens first"
    levels = contact_levels(sweep_system(masses()), np.array([HZ]))
    assert levels["tip"].loss[0] == pytest.approx(tip, rel=1e-9)  # of the motion in which floor stays closed
    assert levels["tip"].level_of_other[0] == pytest.approx(floor, rel=1e-9)
    assert np.isnan(levels["tip"].predicted_levels[0])


def test_a_sweep_predicts_its_first_change_and_at_each_frequency_the_first_there():
    result = sweep_alone(masses(preloads=(0.3, 0.6)))
    of = result.summary["gapping"]
    predicted = [name for name in of if "not_predicted" not in of[name]]
    assert len(predicted) == 1
    floor, tip = (contact_levels_of(result["linear"])[name] for name in ("floor", "tip"))
    lowest = np.minimum(floor.levels_of_change, tip.levels_of_change)
    assert of[predicted[0]]["level"] == pytest.approx(lowest.min(), rel=1e-12)
    np.testing.assert_array_equal(np.fmin(floor.predicted_levels, tip.predicted_levels), lowest)
    assert np.all(np.isnan(floor.predicted_levels) != np.isnan(tip.predicted_levels))
    assert np.isnan(floor.predicted_levels).any()
    assert np.isnan(tip.predicted_levels).any()


def test_json_has_null_for_what_is_not_predicted(tmp_path):
    case = tmp_path / "case.yaml"
    case.write_text(masses().to_yaml())
    done = CliRunner().invoke(app, ["run", str(case), "--no-plots", "--json", "-o", str(tmp_path / "case.h5")])
    assert done.exit_code == 0, done.output
    of = json.loads(done.stdout)["gapping"]
    assert of["tip"]["level"] is None
    assert of["tip"]["not_predicted"] == "floor opens first"
    assert of["floor"]["level"] > 0


def test_stops_that_change_together_are_all_predicted():
    pair = [{"name": side, "mass": 1, "side": side, "stiffness": 500.0, "gap": 1e-3} for side in ("below", "above")]
    scenario = masses(chain={"masses": [1.0], "springs": [200.0], "dashpots": [1.0], "snubbers": pair},
                      probes=[{"name": "mass", "mass": 1}])  # fmt: skip
    result = beamsim.run(scenario)
    of = result.summary["gapping"]
    assert of["below"]["level"] == pytest.approx(of["above"]["level"], rel=1e-12)
    (line,) = lines_of(result)
    assert line.startswith("below, above touch from ")
    assert not any("not_predicted" in each for each in of.values())


# one mass of 2 kg on a spring of 500 N/m and a dashpot of 3 N s/m, a force, a far stop, and another contact
W, M, K, C = 2 * np.pi * 1.3, 2.0, 500.0, 3.0
TABLE = {
    "name": "other",
    "mass": 1,
    "side": "below",
    "gap": -3e-3,
    "force_deflection": [[0, 0], [2e-3, 1.0], [9e-3, 8.0]],
}
CRUSHED = {"name": "other", "mass": 1, "side": "below", "gap": -1e-3, "stiffness": 400.0,
           "hardening": {"yield_force": 0.5, "stiffness": 90.0}}  # fmt: skip
PAD = {"name": "other", "mass": 1, "side": "below", "gap": -1e-3, "stiffness": 400.0,
       "maxwell": [{"stiffness": 250.0, "relaxation_time": 0.2}]}  # fmt: skip


def unit(impedance):
    return 1.0 / abs(K + impedance - M * W**2 + 1j * W * C)


def at_rest(force):
    """Penetration at rest of a stop with a gap and a force, by bisection."""
    low, high = 0.0, 1.0
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if force(middle) < 0 else (low, middle)
    return low


def of_table():
    rest = at_rest(lambda x: np.interp(x, *np.transpose(TABLE["force_deflection"])) - K * (3e-3 - x))
    return abs(rest - 2e-3) / unit(1000.0 if rest > 2e-3 else 500.0)


def of_crushed():
    rest = K * 1e-3 / (K + 400.0)
    return min(rest, 0.5 / 400.0 - rest) / unit(400.0)


def of_pad():
    impedance = 400.0 + 250.0 * 1j * W * 0.2 / (1.0 + 1j * W * 0.2)
    return 400.0 * K * 1e-3 / (K + 400.0) / abs(impedance) / unit(impedance)


def single(stops=(), level="0.1 N", far=1.0, **more):
    stop = {"name": "far", "mass": 1, "side": "above", "stiffness": 300.0, "gap": far}
    scenario = {
        "chain": {"masses": [M], "springs": [K], "dashpots": [C], "snubbers": [stop, *stops]},
        "excitation": {"kind": "harmonic", "applied_to": {"mass": 1}, "level": level, "frequency": W / (2 * np.pi)},
        "probes": [{"name": "mass", "mass": 1}],
        "sweep": {"kind": "stepped", "from": 0.5, "to": 4.0},
        "run": {"duration": 0.3, "convergence": "off"},
    }
    return load_scenario(scenario | more | ({"sweep": None} if "excitation" in more else {}))


FRICTION = {"name": "other", "mass": 1, "normal_force": 2.0, "coefficient": 0.3, "stiffness": 700.0}
SOFTENING = {"name": "other", "kind": "piecewise_linear", "mass": 1, "breakpoints": [-4e-3, 5e-3],
             "stiffnesses": [50.0, 100.0, 20.0]}  # fmt: skip


@pytest.mark.parametrize(
    ("contact", "level"),
    [
        ({"stops": [TABLE]}, of_table()),
        ({"stops": [CRUSHED]}, of_crushed()),
        ({"stops": [PAD]}, of_pad()),
        ({"friction": [FRICTION]}, 0.6 / 700.0 / unit(700.0)),
        ({"springs_to_ground": [SOFTENING]}, 4e-3 / unit(100.0)),
    ],
    ids=["table", "hardening", "branch", "friction", "spring"],
)
def test_contacts_of_other_laws_end_the_prediction_where_they_leave_their_phase(contact, level):
    far = contact_levels(sweep_system(single(**contact)), np.array([W / (2 * np.pi)]))["far"]
    assert far.level_of_other[0] == pytest.approx(level, rel=1e-9)
    of = beamsim.run(single(**contact)).summary["gapping"]["far"]
    assert of["not_predicted"] == OTHER
    assert np.isnan(of["level"])


@pytest.mark.parametrize(
    "contact",
    [{"stops": [TABLE]}, {"friction": [FRICTION]}],
    ids=["table", "friction"],
)
def test_a_shock_changes_the_contact_first_that_just_changes_with_the_least_level(contact):
    """The first level by runs, to 1e-4: the far stop is predicted where it lies below, and else it is not."""
    shock = {"kind": "half_sine", "applied_to": {"mass": 1}, "duration": "0.1 s", "time": "20 ms"}

    def run(level, far):
        return beamsim.run(single(**contact, far=far, excitation=shock | {"level": f"{level} N"}))

    def changes(level):
        system = build_system(single(**contact, excitation=shock | {"level": f"{level} N"}))
        return simulate(exact_flow(system, 0.3), system.initial_state).event_time.size > 0

    low, high = 0.0, 100.0
    for _ in range(24):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if changes(middle) else (middle, high)
    linear = run(0.999 * low, 1.0)
    assert linear.summary["solver_events"] == 0
    reach = linear.summary["max_displacement_m"]["mass"]
    start = run(0.0, 1.0).summary["max_displacement_m"]["mass"]
    reach = start + (reach - start) / 0.999  # the linear motion just where the other contact changes
    assert "not_predicted" not in run(0.1, start + 0.999 * (reach - start)).summary["gapping"]["far"]
    late = run(0.1, start + 1.001 * (reach - start)).summary["gapping"]["far"]
    assert late["not_predicted"] == OTHER


def test_of_a_random_input_the_stop_with_the_fewest_sigmas_is_the_answer():
    psd = [{"frequency": 0.5, "density": 0.4}, {"frequency": 12.0, "density": 0.4}]
    random = {"kind": "random", "applied_to": {"mass": 1}, "seed": 1, "psd": psd, "period": 2.0}
    near = {"name": "near", "mass": 1, "side": "below", "stiffness": 300.0, "gap": 1e-3}
    of = beamsim.run(single([near], excitation=random)).summary["gapping"]
    assert of["near"]["sigmas"] > 0
    assert of["far"]["not_predicted"] == "near touches first"
    assert np.isnan(of["far"]["sigmas"])
    alone = beamsim.run(single(excitation=random)).summary["gapping"]["far"]
    assert alone["sigmas"] == pytest.approx(1e3 * of["near"]["sigmas"], rel=1e-9)


def test_a_stop_that_just_touches_is_met_before_all_others():
    near = {"name": "near", "mass": 1, "side": "below", "stiffness": 300.0, "gap": 0.0}
    result = beamsim.run(single([near]))
    assert result.summary["gapping"]["near"]["level"] == 0.0
    assert list(lines_of(result)) == ["far not predicted: near touches first"]


@pytest.mark.parametrize(
    ("excitation", "unit"),
    [
        ({"kind": "half_sine", "duration": "50 ms", "level": "0.5 m/s"}, "mm/s"),
        ({"kind": "step", "rise": "50 ms", "level": "20 mm"}, "mm"),
        ({"kind": "half_sine", "duration": "50 ms", "level": "1 g"}, "g"),
    ],
)
def test_the_level_of_a_pulse_is_printed_in_the_unit_in_which_it_is_written(excitation, unit):
    """Written back into the case, it is just reached."""

    def of(level):
        given = {"applied_to": "base"} | excitation | {"level": level}
        return beamsim.run(masses(excitation=given, sweep=None))

    result = of(excitation["level"])
    first = next(line for line in lines_of(result) if "not predicted" not in line)
    number, written = first.split(" from ")[1].split(" at ")[0].split(" ")
    assert written == unit
    assert of(f"{float(number) * 0.999} {unit}").summary["solver_events"] == 0
    assert of(f"{float(number) * 1.001} {unit}").summary["solver_events"] > 0


def test_the_level_of_a_sine_of_displacement_is_told_in_it_and_in_g():
    *_, amplitude = own_model()
    floor = (np.array(PRELOADS) / np.array(STOPS) / np.abs(amplitude))[0]
    sine = {"kind": "harmonic", "applied_to": "base", "level": "0.1 mm", "frequency": HZ}
    line, _ = lines_of(beamsim.run(masses(excitation=sine, sweep=None)))
    said = f"{1e3 * floor / (2 * np.pi * HZ) ** 2:.4g} mm ({floor / 9.80665:.4g} g) at {HZ} Hz"
    assert line.startswith(f"floor opens from {said}")
