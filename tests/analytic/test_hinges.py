"""Stops, play, friction and latches of hinges: closed forms of a rigid arm, own integration of a flexible one."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from independent import Beam
from scipy.integrate import solve_ivp

import beamsim
from beamsim import run
from beamsim.cli.motions import run_screen

ANGLE = {"name": "angle", "kind": "rotation", "at": {"body": "arm", "position": 0}}
HELD = {"at": {"body": "arm", "position": 0.5}, "force": -0.4}  # N; turns the arm to -0.1 rad
LENGTH, INERTIA, SPRING = 0.5, 1.2 * 0.5**3 / 3 + 0.5 * 0.5**2, 2.0
SPEED = np.sqrt(SPRING / INERTIA)  # rad/s, of the free arm
RIGID = 2e-4  # what its elastic vibration after the release is, over the motion


def arm(hinge, duration=2.0, **changes):
    """A rigid arm with a tip mass on a hinge to the base, let go at -0.1 rad."""
    body = {
        "kind": "beam", "length": LENGTH, "bending_stiffness": 5e6, "mass_per_length": 1.2, "elements": 2,
        "supports": {"left": "free", "right": "free"}, "point_masses": [{"position": LENGTH, "mass": 0.5}],
    }  # fmt: skip
    joint = {"name": "root", "kind": "hinge", "between": [{"body": "arm", "position": 0}, "base"]}
    data = {
        "bodies": {"arm": body}, "joints": [{**joint, "rotational_stiffness": SPRING, **hinge}], "outputs": [ANGLE],
        "probes": [{"name": "tip", "at": {"body": "arm", "position": LENGTH}}], "reduction": {"modes": 1},
        "run": {"duration": duration, "sample_rate": 1000, "start": {"released_force": HELD},
                **({"impacts": {}} if "stops" in hinge else {})},
    }  # fmt: skip
    return run(beamsim.load_scenario(data | changes))


def test_a_latch_holds_from_the_first_contact_on():
    """Speed at the stop by energy; afterwards a harmonic motion of both springs about their equilibrium."""
    stiffness, met = 400.0, -np.deg2rad(1.0)
    stop = {"angle": "-1 deg", "side": "above", "stiffness": stiffness}
    result = arm({"stops": [{"name": "end", "latch": True, **stop}]})
    summary, impacts = result.summary, result.summary["impacts"]["root.end"]
    speed = SPEED * np.sqrt(0.1**2 - met**2)
    assert impacts["number"] == 1
    assert impacts["highest_approach_speed_rad_s"] == pytest.approx(speed, rel=RIGID)
    assert result["events"]["time"].values == pytest.approx([np.arccos(met / -0.1) / SPEED], rel=RIGID)
    latched = np.sqrt((SPRING + stiffness) / INERTIA)
    rest = stiffness * met / (SPRING + stiffness)
    amplitude = np.hypot(met - rest, speed / latched)
    assert summary["peak_moment_n_m"]["root.end"] == pytest.approx(stiffness * (rest + amplitude - met), rel=RIGID)
    assert summary["largest_pulling_moment_n_m"]["root.end"] == pytest.approx(
        stiffness * (met - rest + amplitude), rel=RIGID
    )
    assert summary["closed_frequencies_hz"][0] == pytest.approx(latched / (2 * np.pi), rel=RIGID)
    since = result["histories"]["time"].values - result["events"]["time"].values[0]
    after = since >= 0.0
    angle = rest + (met - rest) * np.cos(latched * since) + speed / latched * np.sin(latched * since)
    assert result["histories"]["output_value"].sel(output="angle").values[after] == pytest.approx(
        angle[after], abs=RIGID * 0.1
    )
    assert summary["peak_force_n"] == {}
    # without the latch the arm comes back
    free = arm({"stops": [stop]})
    assert free.summary["impacts"]["root.stop_1"]["number"] > 1
    assert free["histories"]["output_value"].sel(output="angle").values.min() == pytest.approx(-0.1, rel=10 * RIGID)


def test_the_shipped_boom_has_its_energy_by_hand(solve):
    """Half the spring's energy less what friction takes on the way is the kinetic energy at the stop."""
    done = solve("run", "configs/structures/deployed_boom.yaml", "--set", "run.convergence=off")
    result = beamsim.load(done.file)
    summary = result.summary
    met, start, friction = -np.deg2rad(1.0), -0.1, 0.02
    energy = 0.5 * SPRING * (start**2 - met**2) - friction * (met - start)
    assert summary["impacts"]["root.end"]["highest_approach_speed_rad_s"] == pytest.approx(
        np.sqrt(2 * energy / INERTIA), rel=RIGID
    )
    assert summary["friction"]["root.friction"]["static_moment_n_m"] == friction
    assert summary["margins"]["peak_moment"]["verdict"] == "ok"
    row = run_screen(result).rows[0]
    assert row["peak moment"].endswith(" N m")
    assert not row["peak force"]


def test_a_stop_unloads_with_another_stiffness():
    """It is crushed by what the stiffer way back leaves of the largest angle, and by no later impact further."""
    met, stiffness, back = -np.deg2rad(1.0), 400.0, 1000.0
    result = arm(
        {"stops": [{"angle": "-1 deg", "side": "above", "stiffness": stiffness, "unloading": {"stiffness": back}}]}
    )
    stop = result.summary["impacts"]["root.stop_1"]
    speed, closed = SPEED * np.sqrt(0.1**2 - met**2), np.sqrt((SPRING + stiffness) / INERTIA)
    rest = stiffness * met / (SPRING + stiffness)
    peak = stiffness * (rest + np.hypot(met - rest, speed / closed) - met)
    assert result.summary["peak_moment_n_m"]["root.stop_1"] == pytest.approx(peak, rel=RIGID)
    crush = peak / stiffness - peak / back
    assert result.summary["residual_crush_rad"]["root.stop_1"] == pytest.approx(crush, rel=RIGID)
    assert stop["number"] > 1
    assert stop["energy_lost_j"] == pytest.approx(0.5 * peak * crush, rel=RIGID)


SHAKEN = {"kind": "harmonic", "applied_to": "base", "level": 1e-3, "frequency": 0.5}


@pytest.mark.parametrize(("analysis", "section", "excitation"), [
    (beamsim.nnm, {"nnm": {"mode": 1, "energy": 1e-3}}, None),
    (beamsim.continuation, {"sweep": {"kind": "continuation", "from": 0.3, "to": 1.0}}, SHAKEN),
])  # fmt: skip
def test_motions_that_repeat_refuse_a_latch(analysis, section, excitation):
    stop = {"name": "end", "angle": "-1 deg", "side": "above", "stiffness": 400.0, "latch": True}
    body = {"kind": "beam", "length": LENGTH, "bending_stiffness": 5e6, "mass_per_length": 1.2, "elements": 2,
            "supports": {"left": "free", "right": "free"}, "damping": {"kind": "modal", "ratio": 0.01}}  # fmt: skip
    hinge = {"name": "root", "kind": "hinge", "between": [{"body": "arm", "position": 0}, "base"]}
    data = {"bodies": {"arm": body}, "joints": [{**hinge, "rotational_stiffness": SPRING, "stops": [stop]}],
            "probes": [{"name": "tip", "at": {"body": "arm", "position": LENGTH}}], **section}  # fmt: skip
    scenario = beamsim.load_scenario(data if excitation is None else {**data, "excitation": excitation})
    with pytest.raises(beamsim.BeamsimError, match="a latch, which never opens again"):
        analysis(scenario)


def test_free_play_lengthens_the_period():
    """The arm flies across the play between the halves of a harmonic motion beyond it."""
    play, amplitude = 0.04, 0.1
    result = arm({"free_play": play}, duration=6.0, run={
        "duration": 6.0, "sample_rate": 1000, "start": {"displacement": [0, -amplitude]}, "impacts": {},
    })  # fmt: skip
    beyond = amplitude - play / 2
    period = 2 * np.pi / SPEED + 2 * play / (SPEED * beyond)
    closing = result["events"]["time"].values[
        result["events"]["closing"].values & (result["events"]["snubber"].values == 0)
    ]
    assert np.diff(closing) == pytest.approx(period, rel=1e-6)
    stops = result["histories"].labels("snubber")
    assert stops == ["root.play.above", "root.play.below"]
    assert result.summary["gap_rad"] == pytest.approx(dict.fromkeys(stops, play / 2))
    peaks = dict.fromkeys(stops, SPRING * beyond)
    assert result.summary["peak_moment_n_m"] == pytest.approx(peaks, rel=1e-6)


@pytest.mark.parametrize("stiffness", [None, 4e5])
def test_friction_takes_the_same_from_every_swing(stiffness):
    """Coulomb's decrement of an oscillator, two moments over the spring for each half cycle."""
    moment = 0.01
    given = {"moment": moment} | ({} if stiffness is None else {"stiffness": stiffness})
    result = arm({"friction": given}, duration=3.0)
    angle = result["histories"]["output_value"].sel(output="angle").values
    turns = angle[1:-1][(np.diff(angle)[:-1] * np.diff(angle)[1:]) < 0.0]
    swings = 0.1 - 2 * moment / SPRING * np.arange(1, turns.size + 1)
    assert turns.size >= 2
    assert np.abs(turns) == pytest.approx(swings, abs=2e-5)  # samples beside the turning points
    friction = result.summary["friction"]["root.friction"]
    assert friction["dissipated_energy_j"] == pytest.approx(moment * friction["sliding_distance_rad"], rel=1e-6)
    assert result.summary["peak_friction_moment_n_m"]["root.friction"] == pytest.approx(moment, rel=1e-9)


# --- a flexible arm on a moving base ----------------------------------------------------------------------------------

STOPS = ((-0.012, -1.0, 60.0, 0.02, False), (0.02, 1.0, 90.0, 0.0, True))  # angle, sign, N m/rad, N m s/rad, latch
SHAKEN, HERTZ = 15.0, 4.0  # m/s^2, Hz


def independent_motion(times, stops=STOPS):
    """(nt, n) motion of the beam's dofs by DOP853, ended at every event, with phases of its own."""
    beam = Beam(0.6, 0.03, 0.004, 70e9, 2700.0, 3, "pinned")
    n = beam.M.shape[0]
    stiffness = beam.K.copy()
    stiffness[0, 0] += 3.0  # the first dof is the slope at the hinge
    inverse = np.linalg.inv(beam.M)

    def moment(phase, y):
        total = 0.0
        for closed, (angle, _, k, c, _) in zip(phase, stops, strict=True):
            total -= closed * (k * (y[0] - angle) + c * y[n])
        return total

    def rates(t, y, phase):
        force = -stiffness @ y[:n] - beam.inertia * SHAKEN * np.sin(2 * np.pi * HERTZ * t)
        force[0] += moment(phase, y)
        return np.concatenate([y[n:], inverse @ force])

    y, t, phase, out = np.zeros(2 * n), 0.0, [False] * len(stops), np.zeros((times.size, 2 * n))
    while True:
        events = []
        for closed, (angle, sign, _, _, _) in zip(phase, stops, strict=True):

            def event(_, y, phase, angle=angle, sign=sign):
                return sign * (y[0] - angle)

            event.terminal, event.direction = True, -1.0 if closed else 1.0
            events.append(event)
        watched = [e for e, closed, stop in zip(events, phase, stops, strict=True) if not (closed and stop[-1])]
        solution = solve_ivp(rates, (t, times[-1]), y, "DOP853", args=(list(phase),), events=watched, rtol=1e-11,
                             atol=1e-13, dense_output=True, max_step=2e-3)  # fmt: skip
        inside = (times >= t) & (times <= solution.t[-1])
        if inside.any():
            out[inside] = solution.sol(times[inside]).T
        if solution.status != 1:
            return out[:, :n], phase
        t, y = solution.t[-1], solution.y[:, -1]
        hit = watched[next(k for k, at in enumerate(solution.t_events) if at.size)]
        phase[events.index(hit)] = not phase[events.index(hit)]


def shaken_arm(**changes):
    """The same by the package."""
    (lower, _, *below), (upper, _, *above) = STOPS
    stops = [
        {"name": "low", "angle": lower, "stiffness": below[0], "damping": {"kind": "viscous", "coefficient": below[1]}},
        {"name": "high", "angle": upper, "stiffness": above[0], "latch": True} | changes,
    ]
    data = {
        "bodies": {"arm": {
            "kind": "beam", "length": 0.6, "width": 0.03, "thickness": 0.004, "youngs_modulus": 70e9, "density": 2700.0,
            "elements": 3, "supports": {"left": "free", "right": "free"},
        }},
        "joints": [{"kind": "hinge", "between": [{"body": "arm", "position": 0}, "base"], "rotational_stiffness": 3.0,
                    "stops": stops}],
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": SHAKEN, "frequency": HERTZ},
        "probes": [{"name": "tip", "at": {"body": "arm", "position": 0.6}}], "outputs": [ANGLE],
        "reduction": {"modes": "all"},
        "run": {"duration": 1.0, "sample_rate": 500, "start": "rest"},
    }  # fmt: skip
    return run(beamsim.load_scenario(data))


def test_a_flexible_arm_between_a_stop_and_a_latch():
    """Against DOP853 on the textbook's elements: many contacts with the lower stop, then the upper one latches."""
    result = shaken_arm()
    motion, phase = independent_motion(result["histories"]["time"].values)
    size = np.abs(motion[:, -2]).max()
    assert phase[1]
    assert result.summary["contacts"]["joint_1.low"] >= 2
    assert result.summary["contacts"]["joint_1.high"] == 1
    assert result["histories"]["output_value"].sel(output="angle").values == pytest.approx(
        motion[:, 0], abs=1e-6 * np.abs(motion[:, 0]).max()
    )
    assert result["histories"]["displacement"].sel(probe="tip").values == pytest.approx(motion[:, -2], abs=1e-6 * size)
    other = shaken_arm(stiffness=90.1)
    assert np.abs(other["histories"]["displacement"].sel(probe="tip").values - motion[:, -2]).max() > 1e-5 * size


def test_time_stepping_meets_the_same_latch():
    """The shipped boom, softer so that steps are longer, with friction, stop and latch by the reference integrator."""
    case = yaml.safe_load(Path("configs/structures/deployed_boom.yaml").read_text())
    case["bodies"]["boom"] |= {"bending_stiffness": "0.2 kN m^2", "elements": 1}
    case["reduction"] = {"modes": 2}
    case["run"] |= {"duration": "0.7 s", "impacts": None, "convergence": "off"}
    exact = run(beamsim.load_scenario(case))
    case["run"] |= {"method": "reference", "integrator": "DOP853"}
    stepped = run(beamsim.load_scenario(case))
    assert stepped.summary["method"].startswith("reference")
    assert exact["events"]["time"].values.size == 1
    assert stepped["events"]["time"].values == pytest.approx(exact["events"]["time"].values, rel=1e-7)
    for values, other in (
        (
            exact["histories"]["snubber_force"].sel(snubber="root.end").values,
            stepped["histories"]["snubber_force"].sel(snubber="root.end").values,
        ),
        (
            exact["histories"]["output_value"].sel(output="angle").values,
            stepped["histories"]["output_value"].sel(output="angle").values,
        ),
    ):
        assert np.abs(other - values).max() <= 1e-6 * np.abs(values).max()
    assert stepped.summary["peak_moment_n_m"] == pytest.approx(exact.summary["peak_moment_n_m"], rel=1e-6)


@pytest.mark.parametrize("latch", [False, True])
def test_a_stop_and_a_latch_under_a_swept_sine(latch):
    """Peak moments of every cycle of a rigid arm against its own equation, integrated apart."""
    ratio, met, stiffness, level, low, rate = 0.1, 0.03, 400.0, 0.25, 0.3, 0.275 / 7  # Hz/s: seven cycles
    stop = {"name": "end", "angle": met, "side": "above", "stiffness": stiffness, "latch": latch}
    body = {
        "kind": "beam", "length": LENGTH, "bending_stiffness": 5e6, "mass_per_length": 1.2, "elements": 2,
        "supports": {"left": "free", "right": "free"}, "point_masses": [{"position": LENGTH, "mass": 0.5}],
    }  # fmt: skip
    hinge = {
        "name": "root", "kind": "hinge", "between": [{"body": "arm", "position": 0}, "base"], "stops": [stop],
        "rotational_stiffness": SPRING, "rotational_dashpot": 2 * ratio * SPEED * INERTIA,
    }  # fmt: skip
    result = beamsim.sweep(beamsim.load_scenario({
        "bodies": {"arm": body}, "joints": [hinge], "outputs": [ANGLE], "reduction": {"modes": 1},
        "probes": [{"name": "tip", "at": {"body": "arm", "position": LENGTH}}],
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": level, "frequency": low},
        "sweep": {"kind": "swept_sine", "from": low, "to": 0.8, "rate": f"{rate} Hz/s", "convergence": "off"},
    }))  # fmt: skip
    (curve,) = result.curves.values()
    first_moment, dashpot, held = 1.2 * LENGTH**2 / 2 + 0.5 * LENGTH, 2 * ratio * SPEED * INERTIA, [False]

    def moment(angle):
        return stiffness * (angle - met) if held[0] else stiffness * max(angle - met, 0.0)

    def motion(t, y):
        pushed = first_moment * level * np.sin(2 * np.pi * (low * t + rate * t**2 / 2))
        return [y[1], -(pushed + dashpot * y[1] + SPRING * y[0] + moment(y[0])) / INERTIA]

    def met_first(_, y):
        return y[0] - met

    met_first.terminal, met_first.direction = latch, 1.0
    ends = (-low + np.sqrt(low**2 + 2 * rate * np.arange(1, curve.frequency_hz.size + 1))) / rate
    times = np.linspace(0.0, ends[-1], 20_001)
    options = {"rtol": 1e-9, "atol": 1e-12, "max_step": 0.03, "dense_output": True}
    found = solve_ivp(motion, (0.0, ends[-1]), [0.0, 0.0], events=met_first, **options)
    angles = found.sol(np.minimum(times, found.t[-1]))[0]
    since = np.inf
    if latch:
        held[0], since = True, float(found.t[-1])
        after = solve_ivp(motion, (since, ends[-1]), found.y[:, -1], **options)
        angles[times > since] = after.sol(times[times > since])[0]
    moments = stiffness * np.where(times > since, np.abs(angles - met), np.maximum(angles - met, 0.0))
    cycle = np.searchsorted(ends[:-1], times, side="right")
    peaks = np.array([moments[cycle == k].max() for k in range(ends.size)])
    envelope = curve.channel("force", "root.end")
    assert envelope.unit == "N m"
    assert peaks.max() > 0.5
    assert envelope.peak == pytest.approx(peaks, abs=2e-3 * peaks.max())
