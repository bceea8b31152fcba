"""Which of several motions: shares, stability and smallest disturbances of an oscillator with a stop."""

from collections import Counter

import numpy as np
import pytest
from independent import Stop, chain, integrate
from scipy.stats import beta
from shipped import config_path

import beamsim
from beamsim.analyses.coexisting import analysis
from beamsim.errors import NotTrustedError, ScenarioError
from beamsim.orbits.tracing import Budget
from beamsim.scenario.reporting import Limits
from tests.helpers.branches import multipliers, peaks_of
from tests.helpers.tables import rows

HZ = 14.0
MASS, STIFFNESS, DASHPOT, FORCE, STOP, GAP = 1.0, 4e3, 4.0, 4.0, 4e4, 2e-3
OMEGA, PERIOD = 2 * np.pi * HZ, 1 / HZ
RECEPTANCE = 1.0 / (STIFFNESS - OMEGA**2 * MASS + 1j * OMEGA * DASHPOT)
STARTS = 16
BOX = {"probe": "mass", "displacement": ["-10 mm", "10 mm"], "velocity": ["-1 m/s", "1 m/s"]}


def case(excitation=None, **sweep):
    starts = {"kind": "states", "number": STARTS, "seed": 3, "box": [BOX]}
    return beamsim.load_scenario(
        {
            "chain": {
                "masses": [MASS], "springs": [STIFFNESS], "dashpots": [DASHPOT],
                "snubbers": [{"name": "stop", "mass": 1, "side": "below", "stiffness": STOP, "gap": GAP}],
            },
            "excitation": excitation
            or {
                "kind": "harmonic", "applied_to": {"mass": 1}, "level": f"{FORCE} N", "frequency": f"{HZ} Hz",
            },
            "probes": [{"name": "mass", "mass": 1}],
            "sweep": {"kind": "coexisting", "at": [f"{HZ} Hz"], "starts": starts} | sweep,
        }
    )  # fmt: skip


@pytest.fixture(scope="module")
def result():
    return beamsim.coexisting(case(), workers=1)


def here(result, **wanted):
    """The motions at 14 Hz with their branches."""
    pairs = zip(rows(result["motions"], "motion"), result.branches, strict=True)
    return [(m, b) for m, b in pairs if m.frequency_hz == HZ and all(getattr(m, k) == v for k, v in wanted.items())]


def free(result):
    """The stable motion that does not touch the stop."""
    return next((m, b) for m, b in here(result, stable=True) if peaks_of(b, "stop", "force")[0] == 0.0)


def own(state, time, cycles):
    """Own integration from a state at a time of the excitation: states after every cycle, from phase zero on."""
    first = PERIOD - time % PERIOD
    times = first + PERIOD * np.arange(cycles + 1)
    motion = integrate(
        chain([MASS], [STIFFNESS, 0.0], [DASHPOT, 0.0]), [Stop(np.ones(1), STOP, gap=GAP)],
        lambda t: np.array([FORCE * np.sin(OMEGA * (time + t))]), state, times, most_step=PERIOD / 4, rtol=1e-10,
        atol=1e-14,
    )  # fmt: skip
    return motion.state


def state_of(branch):
    return np.array([branch["coordinates"].values[0, 0], branch["coordinate_velocities"].values[0, 0]]) / np.sqrt(MASS)


def test_the_free_motion_is_that_of_the_linear_oscillator(result):
    motion, branch = free(result)
    assert peaks_of(branch, "mass")[0] == pytest.approx(FORCE * abs(RECEPTANCE), rel=1e-12)
    assert motion.largest_multiplier == pytest.approx(np.exp(-DASHPOT / (2 * MASS) * PERIOD), rel=1e-10)
    assert motion.lyapunov_exponent == pytest.approx(-DASHPOT / (2 * MASS), rel=1e-9)


def test_shares_are_those_of_the_starts_with_the_interval_of_clopper_and_pearson(result):
    for row, hz in enumerate(result["starts"]["frequency_hz"].values):
        motions = [m for m in rows(result["motions"], "motion") if m.frequency_hz == hz]
        counted = Counter(result["starts"]["destination"].values[row].tolist())
        assert sum(m.starts for m in motions) + counted[0] == STARTS
        for m in motions:
            assert m.starts == counted[m.number]
            if m.stable:
                k, n = m.starts, STARTS
                assert m.share == k / n
                assert m.share_low == pytest.approx(beta.ppf(0.025, k, n - k + 1) if k else 0.0, abs=1e-12)
                assert m.share_high == pytest.approx(beta.ppf(0.975, k + 1, n - k) if k < n else 1.0, abs=1e-12)
            else:
                assert np.isnan(m.share)
                assert m.starts == 0
    assert len(here(result, stable=True)) == 2


def test_starts_end_where_own_integration_takes_them(result):
    """A few of them; many are in tests/reference."""
    row = list(result["starts"]["frequency_hz"].values).index(HZ)
    states = {m.number: state_of(b) for m, b in here(result, stable=True)}
    ends = result["starts"]["destination"].values[row]
    chosen = [int(np.flatnonzero(ends == number)[0]) for number in states]
    for k in chosen:
        after = own(result["starts"]["start"].values[k], PERIOD, 50)[-1]  # phase zero is one of a whole period as well
        away = {number: np.linalg.norm((after - z) * [OMEGA, 1.0]) for number, z in states.items()}
        assert min(away, key=away.get) == ends[k]
        assert away[ends[k]] < 0.05 * max(away.values())


def test_the_unstable_motion_lies_between_the_stable_ones_and_closes(result):
    ((motion, branch),) = here(result, stable=False)
    peaks = sorted(peaks_of(b, "mass")[0] for _, b in here(result, stable=True))
    assert peaks[0] < peaks_of(branch, "mass")[0] < peaks[1]
    assert motion.largest_multiplier > 1.0
    start = state_of(branch)
    end = own(start, PERIOD, 0)[0]
    assert end == pytest.approx(start, abs=1e-8 * np.abs(start).max())
    # the determinant of the monodromy matrix of an oscillator with a stop without a dashpot
    assert np.prod(multipliers(branch)[0]).real == pytest.approx(np.exp(-DASHPOT / MASS * PERIOD), rel=1e-9)


def test_the_smallest_impulse_leaves_the_free_motion_and_less_of_it_does_not():
    starts = {"kind": "states", "number": 12, "seed": 3, "box": [BOX]}
    impulse = {"kind": "impulse", "probe": "mass", "to": "0.5 N s"}
    result = beamsim.coexisting(case(starts=starts, disturbances=[impulse], unstable=False), workers=1)
    motion, branch = free(result)
    (found,) = [d for d in rows(result["disturbances"], "disturbance") if d.number == motion.number]
    amplitude = peaks_of(branch, "mass")[0]

    def reaches(share):
        """Largest displacement of the section long after so much of the impulse."""
        phasor = FORCE * RECEPTANCE * np.exp(1j * OMEGA * found.time_s)
        state = np.array([phasor.imag, (1j * OMEGA * phasor).imag + share * found.amplitude / MASS])
        after = own(state, found.time_s, 60)[-3:]
        return np.linalg.norm(after * [1.0, 1.0 / OMEGA], axis=1).max()

    assert reaches(1.0) > 3.0 * amplitude
    assert reaches(0.9) == pytest.approx(amplitude, rel=0.02)
    # the motion must touch the stop before it can leave: a bound in closed form
    t, s = np.meshgrid(np.linspace(0, PERIOD, 200), np.linspace(1e-4, 5 * PERIOD, 2000))
    decay, damped = DASHPOT / (2 * MASS), np.sqrt(STIFFNESS / MASS - (DASHPOT / (2 * MASS)) ** 2)
    free_of_unit = np.exp(-decay * s) * np.sin(damped * s) / (MASS * damped)
    needed = (GAP + (FORCE * RECEPTANCE * np.exp(1j * OMEGA * (t + s))).imag) / np.abs(free_of_unit)
    assert needed.min() < abs(found.amplitude) < 10.0 * needed.min()


def test_up_and_down_lead_to_different_motions():
    history = {"kind": "history", "number": 6, "from": "12 Hz", "to": "16 Hz", "rate": "0.5 Hz/s"}
    result = beamsim.coexisting(case(starts=history, unstable=False), workers=1)
    came_up = result["starts"]["start"].values[:, 0] < HZ
    assert 0 < came_up.sum() < 6
    force = {m.number: peaks_of(b, "stop", "force")[0] for m, b in here(result)}
    for up, number in zip(came_up, result["starts"]["destination"].values[0], strict=True):
        assert (force[number] > 0.0) == up


def test_phases_at_switch_on_come_to_the_free_motion_far_above_resonance():
    result = beamsim.coexisting(case(at=["20 Hz"], starts={"kind": "phases", "number": 8}, unstable=False), workers=1)
    ((motion, branch),) = zip(rows(result["motions"], "motion"), result.branches, strict=True)
    assert (motion.share, peaks_of(branch, "stop", "force")[0]) == (1.0, 0.0)
    assert 0.0 <= result["starts"]["start"].values.min() < result["starts"]["start"].values.max() <= 2 * np.pi
    assert result["starts"]["coordinate_name"].values.tolist() == ["phase"]


def test_what_has_not_settled_is_counted_and_said(result):
    short = beamsim.coexisting(case(most_cycles=96, unstable=False), workers=1)
    left = int(short.not_settled[0])
    assert 0 < left < STARTS
    assert f"{left} starts did not settle at 14 Hz" in short.status
    assert short.summary["not_settled"] == {"14": left}
    settled = short["starts"]["destination"].values[0] > 0
    assert short["starts"]["cycles"].values[0][settled].max() <= 96
    with pytest.raises(NotTrustedError, match="most_cycles"):
        beamsim.coexisting(case(most_cycles=3, unstable=False), workers=1)


def test_without_damping_nothing_settles_and_that_is_said_with_the_remedy():
    """The free mode of 10.07 Hz never decays: what does not repeat is no motion that starts come to."""
    few = {"kind": "states", "number": 4, "seed": 3, "box": [BOX]}
    damped = case(starts=few, unstable=False).model_dump(by_alias=True, exclude_unset=True)
    endless = {"chain.dashpots": [0.0], "sweep.most_cycles": 96}
    result = beamsim.coexisting(beamsim.load_scenario(damped, endless), workers=1)
    assert not result.outcome.trusted
    assert "the mode at 10.07 Hz has no damping" in result.status
    assert "give each body damping" in result.status
    assert "most_cycles" not in result.status


def test_a_chaotic_motion_is_named_with_its_exponent_and_peaks(tmp_path):
    """At a stiff stop: several starts come to it, and neighbours part at a rate that is clearly positive."""
    chain_ = {
        "chain.dashpots": [2.0], "chain.snubbers": [
            {"name": "stop", "mass": 1, "side": "below", "stiffness": 4e5, "gap": "1 mm"}
        ], "excitation.level": "40 N",
    }  # fmt: skip
    starts = {"kind": "states", "number": 6, "seed": 3, "box": [BOX]}
    settled = case(at=["26 Hz"], starts=starts, most_cycles=400, unstable=False)
    scenario = beamsim.load_scenario(settled.model_dump(by_alias=True, exclude_unset=True), chain_)
    result = beamsim.coexisting(scenario, workers=1)
    chaotic = [
        (m, b) for m, b in zip(rows(result["motions"], "motion"), result.branches, strict=True) if m.kind == "chaotic"
    ]
    assert len(chaotic) == 1
    ((motion, branch),) = chaotic
    assert motion.starts >= 2
    assert motion.period_cycles == 0
    assert np.isnan(motion.largest_multiplier)
    assert motion.lyapunov_exponent > 3.0
    assert peaks_of(branch, "stop", "force")[0] > 0.0
    stored = beamsim.load(beamsim.write_result(result, tmp_path / "chaotic.h5"))
    assert stored["motions"]["kind"].values[0] == result["motions"]["kind"].values[0]
    # harmonics of the cycles that are measured
    assert stored.branches[motion.number - 1]["period_multiple"].item() == 256


def test_a_long_period_is_not_taken_for_a_quasi_periodic_motion():
    """The beam's motion at 70 Hz repeats after 50 cycles, found by own inspection of its sections to 4e-11; that at
    62 Hz nearly repeats after 127, and its distances grow in proportion to the time: its exponent is zero."""
    config = config_path("coexisting_motions")
    at_rest = {"probe": "tip", "mode": 1, "displacement": [0, "1 nm"]}
    starts = {"kind": "states", "number": 2, "box": [at_rest]}
    changes = {"sweep.starts": starts, "sweep.unstable": False, "sweep.disturbances": []}
    kinds = {}
    for hz, longest in ((70.0, 50), (62.0, 16)):
        asked = changes | {"sweep.at": [hz], "sweep.longest_period": longest, "sweep.most_cycles": 1600}
        result = beamsim.coexisting(beamsim.load_scenario(config, asked), workers=1)
        kinds[hz] = {(m.kind, m.period_cycles) for m in rows(result["motions"], "motion") if m.starts}
    assert kinds == {70.0: {("periodic", 50)}, 62.0: {("quasi-periodic", 0)}}
    short = changes | {"sweep.at": [70.0, 76.0], "sweep.longest_period": 16}
    result = beamsim.coexisting(beamsim.load_scenario(config, short), workers=1)
    assert result.not_settled.tolist() == [2, 0]


def test_it_stops_when_it_is_told_to():
    shares = []
    result = beamsim.coexisting(case(), shares.append, lambda: bool(shares), workers=1)
    left = int(np.sum(result["starts"]["cycles"].values == 0))
    assert 0 < left < STARTS
    assert result.outcome.interrupted
    assert f"{left} starts left" in result.status
    assert sum(m.starts for m in rows(result["motions"], "motion")) == STARTS - left
    with pytest.raises(KeyboardInterrupt):
        beamsim.coexisting(case(), None, lambda: True, workers=1)


@pytest.mark.parametrize(
    ("sweep", "said"),
    [
        ({"at": []}, "has no frequencies"),
        ({"points": 3}, "exclude each other"),
        ({"disturbances": [{"kind": "base_pulse", "to": "1 m/s"}]}, "which rests"),
        ({"starts": {"kind": "states", "box": [{"probe": "mass"}]}}, r"box\[0\] has no range"),
        ({"disturbances": [{"kind": "impulse", "probe": "tip", "to": "1 N s"}]}, "tip"),
        ({"starts": {"kind": "states", "box": [BOX | {"probe": "tip"}]}}, "tip"),
    ],
)
def test_what_does_not_fit_is_refused(sweep, said):
    with pytest.raises(ScenarioError, match=said):
        case(**sweep)


def test_a_mode_that_is_not_there_is_refused():
    starts = {"kind": "states", "number": 2, "box": [BOX | {"mode": 2}]}
    with pytest.raises(ScenarioError, match="mode 2"):
        beamsim.coexisting(case(starts=starts), workers=1)


def test_limits_and_the_largest_values_are_of_all_stable_motions(result):
    largest = max(peaks_of(b, "stop", "force")[0] for _, b in here(result, stable=True))
    for limit, verdict in ((1.01 * largest, "ok"), (0.99 * largest, "exceeded")):
        scenario = case(unstable=False).model_copy(update={"limits": Limits(peak_force=limit)})
        summary = beamsim.coexisting(scenario, workers=1).summary
        assert summary["peak_force_n"]["stop"] == pytest.approx(largest, rel=1e-9)
        assert summary["margins"]["peak_force"]["verdict"] == verdict


def test_a_pulse_of_the_base_is_an_impulse_on_the_mass():
    """Of one mass on the base: a change of the base's velocity is an impulse of mass times it, the other way."""
    base = {"kind": "harmonic", "applied_to": "base", "level": f"{FORCE / MASS} m/s^2", "frequency": f"{HZ} Hz"}
    kinds = [{"kind": "impulse", "probe": "mass", "to": "0.4 N s"}, {"kind": "base_pulse", "to": "0.4 m/s"}]
    starts = {
        "kind": "states",
        "number": 2,
        "seed": 3,
        "box": [BOX | {"displacement": [0, "1e-6 m"], "velocity": [0, 0]}],
    }
    result = beamsim.coexisting(case(base, starts=starts, disturbances=kinds, unstable=False), workers=1)
    impulse, pulse = rows(result["disturbances"], "disturbance")
    assert (impulse.unit, pulse.unit) == ("N s", "m/s")
    assert MASS * abs(pulse.amplitude) == pytest.approx(abs(impulse.amplitude), rel=0.01)


def test_convergence_is_that_of_the_largest_values():
    asked = case(starts={"kind": "phases", "number": 2}, convergence="on", unstable=False)
    summary = beamsim.coexisting(asked, workers=1).summary
    assert summary["convergence"]["peak_displacement_m"] == {"mass": 0.0}  # an oscillator has no finer model
    assert summary["doubtful"] == []


def test_branches_that_are_cut_off_are_named_with_what_the_sweep_can_change(monkeypatch):
    monkeypatch.setattr(analysis, "Budget", lambda *given: Budget(10, *given[1:]))
    status = beamsim.coexisting(case(), workers=1).status
    assert "sweep.unstable: false" in status
    assert "most_points" not in status
