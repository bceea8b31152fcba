"""Dry friction that does not move while it sticks: closed forms and limits; random contacts are in the attack."""

import numpy as np
import pytest
from balance import energy_of_segments
from shipped import config_path

import beamsim
from beamsim.contacts.branches import MaxwellBranch
from beamsim.contacts.contacts import Contacts
from beamsim.contacts.laws import kelvin_voigt
from beamsim.contacts.pads import relaxing_law
from beamsim.contacts.sliders import pressed_friction_law, rigid_friction_law
from beamsim.flow.exact import ExactFlow
from beamsim.flow.transient import simulate
from beamsim.inputs.signal import Signal
from beamsim.scenario import load_scenario
from beamsim.system.equations import Forcing, PiecewiseLinearSystem
from tests.helpers.branches import peaks_of


def system_of(limits, shape, stiffness, damping):
    count, n = len(limits), len(stiffness)
    laws = tuple(rigid_friction_law(*numbers) for numbers in limits)
    contacts = Contacts(
        np.array(shape, dtype=float), -np.ones(count), np.zeros(count), np.zeros(count, dtype=bool), laws
    )  # fmt: skip
    return PiecewiseLinearSystem(np.array(stiffness), np.diag(damping).astype(float), contacts, np.zeros(n))


# -- closed forms ----------------------------------------------------------------------------------------------------


def test_decay_of_one_mass():
    """The amplitude falls by 4 F / k a cycle, until the spring cannot overcome the friction any more."""
    system = system_of([(0.06, 0.06)], [[1.0]], [1.0], [0.0])
    trajectory = simulate(ExactFlow(system, Forcing(np.zeros((0, 1)), ()), 40.0), np.array([1.0, 0.0]))
    stops = trajectory.event_time[trajectory.event_phase == 0]
    np.testing.assert_allclose(stops, np.pi * np.arange(1, stops.size + 1), atol=1e-12)
    turns = 1.0 - 0.12 * np.arange(1, stops.size + 1)
    np.testing.assert_allclose(np.abs(trajectory.states_at(stops)[:, 0]), turns, atol=1e-13)
    assert abs(turns[-1]) <= 0.06 < abs(turns[-2])
    assert trajectory.final_y[1] == 0.0


def test_stick_and_slip_on_a_belt():
    """A belt of speed v drags a mass on a spring, seen from the belt: the spring's end moves away.

    It sticks for 2 (Fs - Fd) / (k v) and slides for (2 / w) (pi - arctan((Fs - Fd) w / (k v))).
    """
    speed, static, sliding = 0.2, 1.0, 0.7
    system = system_of([(static, sliding)], [[1.0]], [1.0], [0.0])
    ramp = Signal.polynomial_pieces([0.0], [[0.0, -speed]])
    trajectory = simulate(ExactFlow(system, Forcing(np.ones((1, 1)), (ramp,)), 60.0), np.zeros(2))
    begins, ends = trajectory.event_time[::2], trajectory.event_time[1::2]
    count = min(begins.size, ends.size)
    assert count >= 6
    assert begins[0] == pytest.approx(static / speed, rel=1e-13)
    np.testing.assert_allclose((ends[:count] - begins[:count]), 2 * (np.pi - np.arctan(0.3 / speed)), rtol=1e-11)
    np.testing.assert_allclose(begins[1:] - ends[: begins.size - 1], 2 * 0.3 / speed, rtol=1e-11)


def test_the_shipped_case_begins_as_by_hand():
    """The second mass swings on the spring until the first breaks loose: 150 N (1 - cos w t) = 90 N."""
    result = beamsim.run(load_scenario(config_path("dry_friction")))
    pad = result["histories"].sel(friction="pad")
    time = result["histories"]["time"].values
    breaks = np.arccos(1.0 - 90.0 / 150.0) / 50.0
    stuck = time < breaks
    np.testing.assert_allclose(
        pad["friction_force"].values[stuck],
        150.0 * (1.0 - np.cos(50.0 * time[stuck])),
        atol=1e-10,
    )
    np.testing.assert_allclose(pad["friction_displacement"].values[stuck], 0.0, atol=1e-15)
    assert not pad["friction_stuck"].values[np.flatnonzero(~stuck)[0]]
    assert result.summary["energy_error"] < 1e-13
    assert pad["friction_dissipated_energy"].item() == pytest.approx(
        60.0 * pad["friction_sliding_distance"].item(), rel=1e-12
    )
    assert result.summary["peak_friction_force_n"]["pad"] == pytest.approx(90.0, rel=1e-12)


def test_two_contacts_at_one_place_share_the_force():
    """Reactions are not unique; those of the least sum of squares are equal, and the motion is that of one contact."""
    row, start = np.arange(1.0, 4.0), np.array([0.3, -0.2, 0.1, 0.2, 0.0, -0.3])
    forcing = Forcing(np.array([[1.2, -0.4, 0.7]]), (Signal.harmonic(1.0, 1.4),))
    one, two = (
        simulate(
            ExactFlow(
                system_of([(0.6 / k, 0.4 / k)] * k, [row] * k, [2.0, 7.0, 15.0], [0.1, 0.05, 0.2]), forcing, 12.0
            ),
            start,
        )
        for k in (1, 2)
    )
    assert one.event_time.size >= 3
    np.testing.assert_allclose(two.final_y, one.final_y, atol=1e-9)
    forces = two.sample(np.linspace(0.0, 12.0, 50), lambda phases: two.flow.at(phases).force)
    np.testing.assert_allclose(forces[:, 0], forces[:, 1], atol=1e-9)


# -- scenarios -------------------------------------------------------------------------------------------------------


def scenario(**others):
    return load_scenario(
        {
            "chain": {"masses": [2, 2], "springs": [1000, 5000]},
            "friction": [{"name": "pad", "at": {"mass": 1}, "normal_force": 300.0, "coefficient": 0.2}],
            "excitation": {"kind": "harmonic", "applied_to": "base", "level": 20.0, "frequency": 4.0},
            "run": {"duration": 1.0, "sample_rate": 500.0, "start": "rest"},
            **others,
        }
    )


@pytest.mark.parametrize(
    ("limits", "turn"),
    [((0.05, 0.3), 0.02), ((0.3, 0.05), 0.01), ((0.1, 0.1, 0.1), 0.04), ((0.02, 0.02, 0.3), 0.03)],
)
def test_contacts_at_rest_join_before_one_of_them_gives_way(limits, turn):
    """Where a mass turns, one contact sticks first, which could not hold what the others still push back with."""
    drag = sum(limits)
    system = system_of([(limit, limit) for limit in limits], [[1.0]] * len(limits), [1.0], [0.0])
    start = np.array([0.0, np.sqrt(turn**2 + 2.0 * drag * turn)])
    trajectory = simulate(ExactFlow(system, Forcing(np.zeros((0, 1)), ()), 40.0), start, max_events=50)
    np.testing.assert_allclose(trajectory.final_y, [turn, 0.0], atol=1e-13)
    np.testing.assert_allclose(trajectory.event_time, np.arctan2(start[1], drag), atol=1e-12)
    assert trajectory.event_contact.tolist() == list(range(len(limits)))
    assert not trajectory.event_phase.any()  # each sticks, and stays


def test_peak_force_is_the_sliding_or_the_static_one():
    """A face that turns under more than it can hold sticks for no time: the force it would take is not reached."""
    case = scenario(
        excitation={"kind": "harmonic", "applied_to": "base", "level": 20.0, "frequency": 6.0},
        friction=[{"name": "pad", "at": {"mass": 1}, "normal_force": 20.0, "coefficient": 0.2}],
    )
    summary = beamsim.run(case).summary
    assert summary["friction"]["pad"]["slides"] > 10
    assert summary["peak_friction_force_n"]["pad"] == pytest.approx(4.0, rel=1e-9)


@pytest.mark.parametrize("level", [6.0, 9.0])
def test_the_shipped_resonance_is_that_of_the_energies(level):
    """At resonance the excitation's work pi P X is what friction, 4 F X, and dashpot, pi c w X^2, take."""
    sweep = {"sweep.from": 5.0, "sweep.to": 5.05, "sweep.levels": [level]}
    (branch,) = beamsim.continuation(load_scenario(config_path("continuation_friction"), sweep)).branches
    omega, dashpot = np.sqrt(2000.0 / 2.0), 2 * 0.02 * np.sqrt(2.0 * 2000.0)
    expected = (level - 4.0 * 3.0 / np.pi) / (dashpot * omega)
    assert branch["status"].item().startswith("reached")
    assert peaks_of(branch, "mass_1").max() == pytest.approx(expected, rel=2e-3)


def test_what_never_slides_is_a_support():
    """The tip of a beam on a face of unlimited friction moves as if it were pinned; a face without, as if free."""
    beam = {"length": 0.3, "width": 0.02, "thickness": 0.005, "youngs_modulus": 7e10, "density": 2700.0,
            "elements": 8, "supports": {"left": "clamped", "right": "free"},
            "damping": {"kind": "rayleigh", "mass": 0.0, "stiffness": 1e-6}}  # fmt: skip
    others = {
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": 20.0, "frequency": 90.0},
        "probes": [{"name": "middle", "position": 0.15}], "reduction": {"modes": "all"},
        "run": {"duration": 0.1, "sample_rate": 5000.0, "start": "rest", "convergence": "off"},
    }  # fmt: skip
    pad = {"at": {"position": 0.3}, "normal_force": 1.0}
    held = beamsim.run(load_scenario({"beam": beam, "friction": [{**pad, "coefficient": 1e6}], **others}))
    supports = {"left": "clamped", "right": "pinned"}
    pinned = beamsim.run(load_scenario({"beam": {**beam, "supports": supports}, **others}))
    loose = beamsim.run(load_scenario({"beam": beam, **others}))
    almost = beamsim.run(load_scenario({"beam": beam, "friction": [{**pad, "coefficient": 1e-9}], **others}))
    assert held["histories"]["friction_slides"].sel(friction="friction_1").item() == 0
    for one, other, allowed in ((held, pinned, 1e-9), (almost, loose, 1e-5)):
        a, b = (
            one["histories"]["displacement"].sel(probe="middle").values[:],
            other["histories"]["displacement"].sel(probe="middle").values[:],
        )
        np.testing.assert_allclose(a, b, atol=allowed * np.abs(b).max())


def test_what_friction_holds_against_its_load_rests():
    """The round-off of a load that reactions balance is none; found by the attack (10,001,008)."""
    shape = np.array([[0.31, -0.72, 0.44]])
    system = system_of([(10.0, 10.0)], shape, [200.0, 1500.0, 4000.0], [0.3, 0.2, 0.1])
    load = Forcing(1.7 * shape, (Signal.harmonic(1.0, 8.0),))
    trajectory = simulate(ExactFlow(system, load, 5.0), np.zeros(6))
    assert trajectory.event_time.size == 0
    np.testing.assert_array_equal(trajectory.states_at(np.linspace(0.0, 5.0, 50)), 0.0)
    assert energy_of_segments(trajectory).error == 0.0


def test_a_motion_begins_sliding():
    """Where the contact moves at the start, it slides from there on."""
    start = {"displacement": [0.0, 0.0], "velocity": [-0.5, 0.0]}
    run = {"duration": 0.2, "sample_rate": 500.0, "start": start}
    result = beamsim.run(scenario(excitation={"kind": "none"}, run=run))
    assert not result["histories"]["friction_stuck"].sel(friction="pad").values[0]
    assert result["histories"]["friction_force"].sel(friction="pad").values[0] == pytest.approx(-60.0)
    assert result["histories"]["friction_slides"].sel(friction="pad").item() >= 1


@pytest.mark.parametrize("beside", ["Maxwell branch", "pressed friction"])
def test_what_is_held_at_a_displacement_loads_what_moves_beside_it(beside):
    """The motion satisfies the equations: a face that had stuck away from zero did not push what is not symmetric."""
    rng, n = np.random.default_rng(3), 3
    if beside == "Maxwell branch":
        laws, pressed = (
            (rigid_friction_law(2.0, 1.5), relaxing_law(kelvin_voigt(20.0), [MaxwellBranch(30.0, 0.3)])),
            None,
        )
    else:
        laws = rigid_friction_law(2.0, 1.5), kelvin_voigt(30.0), pressed_friction_law(None, 0.4, 0.3)
        pressed = np.array([-1, -1, 1])
    m = len(laws)
    contacts = Contacts(
        rng.normal(size=(m, n)), np.append(-1.0, np.ones(m - 1)), np.append(0.0, np.full(m - 1, -0.02)),
        np.zeros(m, dtype=bool), laws, pressed_by=pressed,
    )  # fmt: skip
    system = PiecewiseLinearSystem(np.array([1.0, 5.0, 14.0]), np.diag([0.02, 0.05, 0.1]), contacts, np.zeros(n))
    flow = ExactFlow(system, Forcing(rng.normal(size=(1, n)), (Signal.harmonic(4.0, 1.3),)), 12.0)
    q = np.array([0.5, -0.2, 0.1])
    penetration = -contacts.gap - contacts.sign * (contacts.shape @ q)
    start = np.concatenate([q, np.zeros(n), contacts.relaxed_states(penetration)])
    motion, checked = simulate(flow, start), 0
    for k in np.flatnonzero(motion.length > 0.01):
        t, phases = motion.time[k] + 0.5 * motion.length[k], motion.phases[k]
        before, y, after = motion.states_at(t + np.array([-1e-5, 0.0, 1e-5]))
        rates = flow.at(phases).rates @ np.append(y, flow.inputs_at(np.array([t]))[0, 0])
        np.testing.assert_allclose((after - before) / 2e-5, rates, atol=1e-6 * np.abs(rates).max())
        checked += bool(phases[0] == 0 and np.abs(contacts.shape[0] @ y[:n]) > 0.1)
    assert checked >= 2
