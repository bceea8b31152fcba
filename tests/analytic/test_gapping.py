"""Gapping: levels against one mass in closed form and against motions just below and above, preloads against runs."""

import re

import numpy as np
import pytest

import beamsim
from beamsim.analyses.sweep.analysis import sweep as sweep_alone
from beamsim.analyses.sweep.analysis import sweep_system
from beamsim.cli.screens import Errors
from beamsim.cli.screens import contact_levels as contact_sentences
from beamsim.cli.tables import all_rows
from beamsim.responses.gapping import contact_levels, transfer
from beamsim.results.values import limits_not_met
from beamsim.scenario import load_scenario


def mass(level="1 N", frequency="1 Hz", **stop):
    stop = {"name": "stop", "mass": 1, "side": "below", "stiffness": 300.0, **stop}
    return load_scenario(
        {
            "chain": {"masses": [2.0], "springs": [500.0], "dashpots": [3.0], "snubbers": [stop]},
            "excitation": {"kind": "harmonic", "applied_to": {"mass": 1}, "level": level, "frequency": frequency},
            "probes": [{"name": "mass", "mass": 1}],
            "run": {"duration": 60.0, "sample_rate": "200 Hz"},
            "sweep": {"kind": "stepped", "from": 0.5, "to": 4.0, "points": 41},
        }
    )


@pytest.mark.parametrize("law", ["kelvin_voigt", "no_tension"])
@pytest.mark.parametrize("dashpot", [0.0, 4.0])
def test_one_prestressed_mass_in_closed_form(law, dashpot):
    """It lifts off at penetration zero, without tension at force zero."""
    system = sweep_system(mass(gap="-1 mm", damping={"kind": "viscous", "coefficient": dashpot}, law=law))
    hz = np.array([0.7, 2.0, 3.5])
    levels = contact_levels(system, hz)["stop"]
    w = 2 * np.pi * hz
    impedance = 300.0 + 1j * w * dashpot
    amplitude = 1.0 / np.abs(500.0 + 3j * w - 2.0 * w**2 + impedance)  # for a unit of force, closed
    losing = np.abs(impedance) if law == "no_tension" else 300.0
    at_rest = 0.3 * 500.0 / 800.0  # N: the stop is pressed by 1 mm against both springs
    np.testing.assert_allclose(levels.loss, at_rest / (losing * amplitude), rtol=1e-9)
    np.testing.assert_allclose(levels.preload_needed, losing * amplitude, rtol=1e-9)
    np.testing.assert_allclose(levels.preload_alone, losing * amplitude, rtol=1e-9)
    assert levels.closed_at_rest


def test_alone_and_together_against_models_with_the_stops_as_springs():
    """Of three stops only the middle one is closed at rest; the preload of each alone is that of a beam on springs."""

    def beam(springs, **snubbers):
        return load_scenario(
            {
                "beam": {"length": 1.0, "bending_stiffness": 50.0, "mass_per_length": 0.8,
                         "damping": {"kind": "viscous", "coefficient": 4.0}},
                "springs_to_ground": springs,
                "snubbers": [{"name": name, "position": x, "side": "below", "stiffness": 3000.0, "gap": gap}
                             for name, (x, gap) in snubbers.items()],
                "excitation": {"kind": "harmonic", "applied_to": {"position": 1.0}, "level": "1 N", "frequency": 1.0},
                "reduction": {"modes": "all"},
                "sweep": {"kind": "stepped", "from": 5, "to": 30},
            }
        )  # fmt: skip

    hz = np.array([6.0, 14.0, 28.0])
    levels = contact_levels(sweep_system(beam([], a=(0.4, 1e-3), b=(0.7, -1e-3), c=(1.0, 2e-3))), hz)
    assert [levels[name].closed_at_rest for name in "abc"] == [False, True, False]

    def spring(*places):
        return [{"kind": "linear", "position": x, "stiffness": 3000.0} for x in places]

    for name, x, others, rest in (
        ("a", 0.4, (0.7,), (0.7, 1.0)),
        ("b", 0.7, (), (0.4, 1.0)),
        ("c", 1.0, (0.7,), (0.4, 0.7)),
    ):
        alone = contact_levels(sweep_system(beam(spring(*others), s=(x, -1e-9))), hz)["s"]
        np.testing.assert_allclose(levels[name].preload_alone, alone.preload_needed, rtol=1e-6)
        together = contact_levels(sweep_system(beam(spring(*rest), s=(x, -1e-9))), hz)["s"]
        np.testing.assert_allclose(levels[name].preload_needed, together.preload_needed, rtol=1e-6)


def test_an_undamped_resonance_on_the_grid_leaves_the_other_frequencies_known():
    """Their levels are those of a grid without it."""
    resonance = 2.0
    scenario = load_scenario(
        {
            "chain": {"masses": [1.0], "springs": [(2 * np.pi * resonance) ** 2],
                      "snubbers": [{"name": "stop", "mass": 1, "side": "below", "stiffness": 300.0, "gap": "1 mm"}]},
            "excitation": {"kind": "harmonic", "applied_to": {"mass": 1}, "level": "1 N", "frequency": "1 Hz"},
            "sweep": {"kind": "stepped", "from": 0.5, "to": 4.0},
        }
    )  # fmt: skip
    system, hz = sweep_system(scenario), np.array([0.7, resonance, 3.5])
    w = 2 * np.pi * hz
    assert np.any(system.dynamics.stiffness == w[1] ** 2)  # in floating point, too
    moved = transfer(system, hz)
    np.testing.assert_array_equal(np.isnan(moved[:, 0]), [False, True, False])
    np.testing.assert_array_equal(moved[::2], transfer(system, hz[::2]))
    onset = contact_levels(system, hz)["stop"].onset
    np.testing.assert_allclose(onset[::2], 1e-3 * np.abs(w[1] ** 2 - w[::2] ** 2), rtol=1e-9)


@pytest.mark.parametrize("gap", ["-2 mm", "2 mm"])
def test_a_run_just_below_the_level_never_changes_contact_and_above_it_does(gap):
    """The excitation is so slow that the motion from rest is steady at once."""
    said = beamsim.run(mass(gap=gap, frequency="0.02 Hz")).summary["gapping"]["stop"]
    assert said["closed_at_rest"] is (gap == "-2 mm")
    for factor, changes in ((0.97, False), (1.03, True)):
        result = beamsim.run(mass(gap=gap, frequency="0.02 Hz", level=f"{factor * said['level']} N"))
        of = result.summary["gapping"]["stop"]
        assert of["share_of_level"] == pytest.approx(1 / factor)
        assert (of["first_change_s"] is not None) is changes


def test_a_preload_as_advised_keeps_contact_in_the_sweep():
    loose = sweep_alone(mass(gap="-1 mm")).summary["gapping"]["stop"]
    assert loose["share_of_level"] < 1.0
    assert loose["first_change_hz"]["up_0"] is not None
    assert loose["largest_gap_m"] > 0
    assert loose["preload_n"] == loose["preload_alone_n"]
    for factor, opened in ((1.01, False), (0.8, True)):
        advised = load_scenario(
            mass().to_yaml(), {"chain.snubbers": [{"name": "stop", "mass": 1, "side": "below", "stiffness": 300.0,
                                                   "preload": factor * loose["preload_n"]}]}
        )  # fmt: skip
        of = sweep_alone(advised).summary["gapping"]["stop"]
        assert (of["first_change_hz"]["up_0"] is not None) is opened
        assert (of["share_of_level"] < 1.0) is opened


@pytest.mark.parametrize(
    ("direction", "level", "unit", "static"),
    [("z", 3.0, ("m/s^2", "m/s", "m"), 0.3**4 / 8), ("ry", 30.0, ("rad/s^2", "rad/s", "rad"), 11 * 0.3**5 / 120)],
)
@pytest.mark.parametrize("integrals", [0, 1, 2])
def test_base_motion_in_displacement_or_rotation_counts_its_acceleration(direction, level, unit, static, integrals):
    """Slow against the 18 Hz of the beam: the static deflection under the inertia of a rigid rise or turn."""
    w = 2 * np.pi * 0.5
    scenario = {
        "beam": {"length": 0.3, "bending_stiffness": 2.0, "mass_per_length": 0.25},
        "snubbers": [{"name": "tip", "position": 0.3, "side": "below", "stiffness": 5000.0, "gap": 0.001}],
        "excitation": {"kind": "harmonic", "applied_to": "base", "direction": direction, "frequency": 0.5,
                       "level": f"{level / w**integrals} {unit[integrals]}"},
        "run": {"duration": 0.1, "convergence": "off"},
    }  # fmt: skip
    said = beamsim.run(load_scenario(scenario)).summary["gapping"]["tip"]
    assert said["share_of_level"] == pytest.approx(said["level"] / level)
    assert said["level"] == pytest.approx(0.001 / (0.25 * static / 2.0), rel=2e-3)


def test_the_level_of_a_moved_support_is_that_of_the_beam_in_closed_form():
    """w = sin(beta x) / sin(beta L) + sinh(beta x) / sinh(beta L), halved, from the pinned end at rest."""
    result = beamsim.run(
        load_scenario(
            {
                "beam": {"length": 0.9, "bending_stiffness": 10.0, "mass_per_length": 0.3,
                         "supports": {"left": "pinned", "right": "pinned"}},
                "snubbers": [{"name": "stop", "position": 0.5, "side": "below", "stiffness": 2e4, "gap": "0.5 mm"}],
                "excitation": {"kind": "harmonic", "applied_to": {"support": "left"}, "level": "1 mm",
                               "frequency": 9.0},
                "run": {"duration": 0.2, "start": "rest", "convergence": "off"},
            }
        )
    )  # fmt: skip
    omega = 2 * np.pi * 9.0
    beta, length, x = (0.3 * omega**2 / 10.0) ** 0.25, 0.9, 0.4
    shape = 0.5 * (np.sin(beta * x) / np.sin(beta * length) + np.sinh(beta * x) / np.sinh(beta * length))
    of = result.summary["gapping"]["stop"]
    assert of["level"] == pytest.approx(0.5e-3 / abs(shape) * omega**2, rel=1e-6)  # m/s^2 of the support
    assert of["share_of_level"] == pytest.approx(0.5 / abs(shape), rel=1e-6)


def test_level_zero_changes_nothing():
    of = beamsim.run(mass(gap="-1 mm", level="0 N")).summary["gapping"]["stop"]
    assert np.isnan(of["share_of_level"])
    assert of["level"] > 0
    assert of["preload_n"] == 0
    assert of["first_change_s"] is None


def test_laws_that_are_no_single_spring_say_nothing_of_it():
    """A table that stiffens while it is pressed leaves the linear motion before it opens."""
    table = [[0, 0], [1e-3, 0.2], [2e-3, 1.0]]
    result = beamsim.run(
        load_scenario(
            {
                "chain": {"masses": [2.0], "springs": [500.0],
                          "snubbers": [{"name": "stop", "mass": 1, "side": "below", "gap": 0.001,
                                        "force_deflection": table}]},
                "excitation": {"kind": "harmonic", "applied_to": {"mass": 1}, "level": "1 N", "frequency": "1 Hz"},
                "run": {"duration": 2.0, "sample_rate": 200.0},
            }
        )
    )  # fmt: skip
    assert "gapping" not in result.summary


@pytest.mark.parametrize(
    ("given", "said"),
    [
        # on the way to the steady motion the mass goes further than there
        ({"level": "2.424 N", "frequency": "2.2 Hz", "gap": "2 cm"},
         ["steady linear motion, above the level here", "first change 824.7 ms", "restitution 0.99"]),
        ({"level": "20 N", "frequency": "3.5 Hz", "gap": "-1 mm"},
         ["in steady linear motion", "closed at rest yes", "first change", "restitution 1.02"]),
        ({"level": "20 N", "frequency": "3.5 Hz", "gap": 0.0}, ["closed at rest no", "level 0 N"]),
    ],
)  # fmt: skip
def test_the_table_of_a_run_does_not_contradict_itself(given, said):
    run = {"run.duration": 2.0, "run.impacts": {}, "run.convergence": "off"}
    rows = all_rows("run", beamsim.run(load_scenario(mass(**given).to_yaml(), run)))
    text = " ".join(word for _, text in rows for word in text.split())
    for part in said:
        assert part in text


def swept_pad(level="0.5 g", **sweep):
    """One mass on a spring, with a pad that is pressed on at rest: the closed resonance lies inside the notch."""
    return load_scenario(
        {
            "chain": {"masses": [1.0], "springs": [1e4], "damping": {"kind": "modal", "ratio": 0.02},
                      "snubbers": [{"name": "pad", "mass": 1, "side": "above", "stiffness": 2e4, "preload": 10.0}]},
            "excitation": {"kind": "harmonic", "applied_to": "base", "level": level, "frequency": "20 Hz"},
            "probes": [{"name": "mass", "mass": 1}],
            "limits": {"gapping": 0.8},
            "sweep": {"kind": "swept_sine", "from": 20, "to": 40, "rate": "10 oct/min", **sweep},
        }
    )  # fmt: skip


def level_of_pad(frequency_hz):
    """m/s^2, at which the pad's 0.5 mm of penetration vanish; the dashpot is that of 2 % at the open resonance."""
    w = 2 * np.pi * frequency_hz
    return 0.5e-3 * np.abs(3e4 - w**2 + 1j * w * 2 * 0.02 * 100.0)


NOTCH = {"from": "24 Hz", "to": "32 Hz", "level": "0.02 g"}


@pytest.mark.parametrize(
    ("sweep", "closest", "loud"),
    [
        ({"notches": [NOTCH]}, 24.0, 0.5),
        ({"profile": [{"frequency": 20, "level": "0.5 g"}, {"frequency": 23, "level": "0.01 g"}]}, 23.0, 0.5),
    ],
)
def test_a_shaped_sweep_tells_the_lowest_level_and_where_the_test_comes_closest(sweep, closest, loud):
    levels = {} if "notches" in sweep else {"levels": [1.0]}
    result = sweep_alone(swept_pad(**sweep, **levels))
    of, test = (result.summary[entry]["pad"] for entry in ("gapping", "closest_to_test"))
    resonance = np.sqrt(3e4) / (2 * np.pi)
    assert of["frequency_hz"] == pytest.approx(resonance, rel=1e-3)
    assert of["level"] == pytest.approx(level_of_pad(resonance), rel=1e-3)
    assert test["frequency_hz"] == pytest.approx(closest, abs=0.2)  # the level falls within a cycle
    assert test["level"] == pytest.approx(level_of_pad(test["frequency_hz"]), rel=1e-6)
    assert test["share_of_level"] == pytest.approx(test["level"] / (loud * 9.80665), rel=1e-3)
    margin = result.summary["margins"]["gapping"]
    assert margin["value"] == pytest.approx(1 / test["share_of_level"])
    assert margin["at"] == f"pad, {test['frequency_hz']:.4g} Hz"
    said = " ".join(contact_sentences(result, Errors(result)))
    lowest = f"pad opens from {of['level'] / 9.80665:.4g} g at {of['frequency_hz']:.4g} Hz in steady linear motion"
    assert f"{lowest}, above the level there; " in said
    assert f"this test comes closest at {test['frequency_hz']:.4g} Hz, where it opens from " in said


@pytest.mark.parametrize(("level", "integrals"), [("0.5 g", 0), ("0.01 m/s", 1), ("0.1 mm", 2)])
def test_a_sweep_of_one_level_has_one_level_that_opens(level, integrals):
    """That of the quantity of the excitation, which is the same at all frequencies."""
    summary = sweep_alone(swept_pad(level)).summary
    hz = np.linspace(20.0, 40.0, 200_001)
    least = level_of_pad(hz) / (2 * np.pi * hz) ** integrals
    assert summary["gapping"]["pad"]["frequency_hz"] == pytest.approx(hz[np.argmin(least)], abs=0.02)
    assert "closest_to_test" not in summary


TWO_PADS = """
chain: {masses: [1 kg, 2 kg], springs: [10 kN/m, 30 kN/m], dashpots: [8 N s/m, 12 N s/m]}
snubbers:
  - {name: low, mass: 1, side: above, stiffness: 20 kN/m, preload: 10 N}
  - {name: high, mass: 2, side: above, stiffness: 50 kN/m, preload: 8 N}
probes: [{name: upper, mass: 2}]
excitation: {kind: harmonic, applied_to: base, level: 10 mm/s, frequency: 20 Hz}
sweep: {kind: swept_sine, from: 10 Hz, to: 60 Hz, rate: 240 oct/min, convergence: off, profile: %s}
"""


def test_a_profile_of_velocities_that_comes_closest_at_the_lowest_level_says_so_once():
    """Two masses with both pads as springs, by the matrices; the profile is in the quantity of the excitation."""
    scenario = load_scenario(TWO_PADS % "[{frequency: 10 Hz, level: 10 mm/s}, {frequency: 20 Hz, level: 2 mm/s}]")
    result = sweep_alone(scenario)
    hz = np.linspace(10.0, 60.0, 100_001)
    w = 2 * np.pi * hz[:, None, None]
    stiffness = np.array([[10e3 + 30e3 + 20e3, -30e3], [-30e3, 30e3 + 50e3]])
    damping = np.array([[20.0, -12.0], [-12.0, 12.0]])
    dynamic = stiffness + 1j * w * damping - w**2 * np.diag([1.0, 2.0])
    per_velocity = np.linalg.solve(dynamic, -(w * np.array([[1.0], [2.0]])))[:, :, 0]
    level = np.array([10.0 / 20e3, 8.0 / 50e3]) / np.abs(per_velocity)  # m/s
    k, j = np.unravel_index(np.argmin(level), level.shape)
    first, later = (("low", "high"), ("high", "low"))[j]
    of = result.summary["gapping"][first]
    assert of["frequency_hz"] == pytest.approx(hz[k], abs=0.05)
    assert of["level"] / (2 * np.pi * of["frequency_hz"]) == pytest.approx(level[k, j], rel=1e-3)
    said = list(contact_sentences(result, Errors(result)))
    assert said[0].startswith(f"{first} opens from ")
    times = re.search(r"; this test comes closest there, where that is (\S+) times its level$", said[0])[1]
    assert float(times) == pytest.approx(level[k, j] / 2e-3, rel=5e-3)
    assert said[1] == f"{later} not predicted: {first} opens first"


def test_a_limit_on_a_contact_that_changes_later_says_that_it_is_not_known():
    changes = {"sweep": None, "run": {"duration": 0.1, "convergence": "off"}, "excitation.frequency": 27}
    case = load_scenario(TWO_PADS % "[]", changes | {"limits": {"gapping": {"low": 0.9, "high": 0.9}}})
    margins = beamsim.run(case).summary["margins"]
    (name,) = (name for name, of in margins.items() if np.isnan(of["value"]))
    (text,) = limits_not_met(case, {name: margins[name]})
    label = f"gapping of {name.removeprefix('gapping.')}"
    assert text == f"{label} is not known, so that limits.{name} = 0.9 is neither met nor exceeded"
