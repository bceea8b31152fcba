"""Every contact law in every analysis: it is taken, or refused with the reason and a remedy."""

import numpy as np
import pytest
from shipped import config_path

import beamsim
from beamsim.analyses.identify.vibrations import steady_vibration
from beamsim.analyses.sweep.analysis import sweep as sweep_alone
from beamsim.contacts.sliders import drops
from beamsim.errors import ScenarioError
from beamsim.flow.periodic_flow import PeriodicForcing
from beamsim.flow.variational import VariationalFlow
from beamsim.measurements.signal import MeasuredSignal
from beamsim.orbits.branch import BranchPoint
from beamsim.orbits.shooting import ForcedOrbits
from beamsim.orbits.tracing import explain
from beamsim.outcomes import Outcome, OutcomeKind
from beamsim.scenario import load_scenario
from beamsim.system.build import build_system
from tests.helpers.branches import multipliers
from tests.helpers.tables import estimates

BRANCHES = [{"stiffness": 200.0, "relaxation_time": 0.03}]
TABLE = [[0, 0], [2e-3, 0.8], [10e-3, 6]]
DASHPOT = {"kind": "viscous", "coefficient": 4.0}
RUB = {
    "name": "rub", "at": {"mass": 2}, "mounted_on": "ground", "normal_force": 1.0,
    "coefficient": {"static": 0.3, "sliding": 0.2},
}  # fmt: skip
STOPS = {
    "table": {"force_deflection": TABLE},
    "branch": {"stiffness": 300.0, "maxwell": BRANCHES},
    "table and branch": {"force_deflection": TABLE, "maxwell": BRANCHES},
    "dashpot": {"stiffness": 300.0, "law": "no_tension", "damping": DASHPOT},
    "hardening": {"stiffness": 300.0, "hardening": {"yield_force": 0.5, "stiffness": 60.0}},
    "friction": {"stiffness": 300.0},
    "rigid friction": {"stiffness": 300.0},
    "pressed friction": {"stiffness": 300.0},
}
CHANGED = {
    "table": ("chain.snubbers.pad.force_deflection[1][1]", 0.6, 0.9),
    "branch": ("chain.snubbers.pad.maxwell[0].stiffness", 100.0, 300.0),
    "table and branch": ("chain.snubbers.pad.maxwell[0].relaxation_time", 0.01, 0.05),
    "dashpot": ("chain.snubbers.pad.damping.coefficient", 1.0, 5.0),
    "hardening": ("chain.snubbers.pad.hardening.yield_force", 0.3, 0.6),
    "friction": ("friction.rub.coefficient.sliding", 0.05, 0.25),
    "rigid friction": ("friction.rub.normal_force", 0.5, 1.5),
    "pressed friction": ("friction.rub.coefficient.sliding", 0.1, 0.25),
}
RUN = {"duration": 0.5, "sample_rate": 1000.0, "start": "rest"}
CONTINUATION = {"kind": "continuation", "from": 3.9, "to": 3.94, "side_branches": "none", "convergence": "off"}


def case(law, *changed, **sections):
    rubs = {"friction": [{**RUB, "stiffness": 3000.0}], "rigid friction": [RUB]}
    rubs["pressed friction"] = [{**RUB, "normal_force": {"snubber": "pad"}}]
    return load_scenario({
        "chain": {
            "masses": [1.0, 1.0], "springs": [400.0, 400.0], "dashpots": [2.0, 2.0],
            "snubbers": [{"name": "pad", "mass": 1, "side": "below", "gap": 1e-3, **STOPS[law]}],
        },
        "probes": [{"name": "a", "mass": 1}],
        "excitation": {"kind": "harmonic", "applied_to": {"mass": 1}, "level": 3.0, "frequency": 4.5},
        **({"friction": rubs[law]} if law in rubs else {}),
        **sections,
    }, list(changed))  # fmt: skip


laws = pytest.mark.parametrize("law", STOPS)


@laws
def test_runs(law):
    result = beamsim.run(case(law, run=RUN))
    assert result.outcome.trusted
    assert result.summary["energy_error"] < 1e-10
    assert result.summary["contacts"]["pad"] >= 1


@laws
def test_swept_sines(law):
    sweep = {"kind": "swept_sine", "from": 4.0, "to": 5.0, "rate": "1 Hz/s"}
    assert sweep_alone(case(law, sweep=sweep)).outcome.trusted


@pytest.mark.parametrize("law", ["hardening", "friction"])
def test_contacts_on_the_ground_under_a_moving_base(law):
    """The base does work against forces whose work is lost: the balance of a swept sine counts it."""
    sweep = {"kind": "swept_sine", "from": 4.0, "to": 4.5, "rate": "1 Hz/s"}
    changed = ["excitation.applied_to=base", "chain.snubbers[0].mounted_on=ground"]
    result = sweep_alone(case(law, *changed, sweep=sweep))
    assert result.outcome.trusted
    assert result.summary["energy_error"] < 1e-10
    assert result.curves["up_0"]["contact_share"].sel(snubber="pad").values.max() > 0.01


@laws
def test_studies_of_its_numbers(law):
    path, first, last = CHANGED[law]
    parameters = [{"path": path, "from": first, "to": last, "points": 2}]
    result = beamsim.design_study(case(law, run=RUN, vary={"kind": "grid", "parameters": parameters}))
    peaks = result.responses["snubbers/pad/peak_force"].values
    assert result.outcome.trusted
    assert np.ptp(peaks) > 1e-4 * peaks.max()


@pytest.mark.parametrize("law", STOPS)
def test_continuation(law):
    ends = {"from": 4.495, "to": 4.5, "seek_at": 0} if law == "hardening" else {}
    result = beamsim.continuation(case(law, sweep={**CONTINUATION, **ends}))
    assert result.outcome.trusted
    assert all(np.max(branch["energy_error"].values) < 1e-8 for branch in result.branches)


@laws
def test_normal_modes(law):
    section = {"nnm": {"mode": 1, "energy": 1e-3, "convergence": "off"}, "excitation": {"kind": "none"}}
    refused = {
        "branch": "leave out maxwell of pad", "table and branch": "leave out maxwell of pad",
        "hardening": "leave out hardening of pad", "friction": "leave out the friction contact rub",
        "rigid friction": "leave out the friction contact rub",
        "pressed friction": "leave out the friction contact rub",
    }  # fmt: skip
    if law in refused:
        with pytest.raises(ScenarioError, match=f"nnm needs contacts without losses.*{refused[law]}"):
            beamsim.nnm(case(law, **section))
    else:
        assert beamsim.nnm(case(law, **section)).outcome.trusted


@pytest.mark.parametrize(
    "law", ["branch", "table and branch", "hardening", "friction", "rigid friction", "pressed friction"]
)
def test_internal_states_are_refused_by_harmonic_balance(law):
    with pytest.raises(ScenarioError, match="are beyond harmonic balance"):
        beamsim.continuation(case(law, sweep={**CONTINUATION, "method": "harmonic_balance"}))


@pytest.mark.parametrize(
    ("law", "changed", "ends"),
    [
        ("hardening", "chain.snubbers[0].hardening.yield_force=0.2 N", (5.171, 5.173)),
        ("friction", "friction[0].coefficient=0.25", (5.4, 5.5)),
    ],
)
def test_yielding_or_sliding_that_ends_at_phase_zero(law, changed, ends):
    """The slider is written where it would be if that ended: the branch goes on, with a state that does not jump."""
    sweep = {**CONTINUATION, "from": ends[0], "to": ends[1], "seek_at": 0}
    (branch,) = beamsim.continuation(case(law, changed, sweep=sweep)).branches
    assert branch["status"].item().startswith("reached")
    slider = branch["internal_states"].values[np.argsort(branch["frequency_hz"].values), 0]
    assert np.abs(np.diff(slider)).max() < 0.05 * np.abs(slider).max()


def test_where_sliding_begins_at_once_a_branch_ends_and_says_why():
    """The force of the damper reaches its static limit of 35 N while it sticks; it then falls to 25 N."""
    sweep = {"kind": "continuation", "from": 3.505, "to": 3.53, "side_branches": "none", "seek_at": 0}
    damper = config_path("friction_damper")
    branch, *_ = beamsim.continuation(load_scenario(damper, {"run": None, "sweep": sweep})).branches
    assert branch["outcome"].item() == "sticking_jumps"
    assert branch["frequency_hz"].values.max() == pytest.approx(3.523498, abs=1e-5)
    one = load_scenario(damper, {"run": None, "sweep": sweep, "friction[0].coefficient": 0.35})
    assert not any(drops(law) for law in build_system(one).dynamics.contacts.laws)


@pytest.mark.parametrize(("share", "said"), [(1.00001, "just_yields"), (1.1, "not_smooth"),
                                              (0.9, "not_smooth")])  # fmt: skip
def test_a_stalled_branch_says_what_a_stop_that_yields_has_to_do_with_it(share, said):
    """With a yield force of about the peak of an elastic motion; not well above or below."""

    def stalled(yield_force):
        system = build_system(case("hardening", f"chain.snubbers[0].hardening.yield_force={yield_force} N"))
        loads = PeriodicForcing.harmonic(3.0 * system.forcing.load[0])
        flow = VariationalFlow(system.dynamics, loads, 2 * np.pi * 4.5, 1.0)
        start = np.zeros(flow.size)
        start[system.dynamics.size] = -0.2
        flow_map, one = flow.flow_map(start, 1.0 / 4.5), np.ones(flow.size + 1)
        point = BranchPoint(np.append(start, flow.omega), one, one, 0.0, 1.0, 0, flow_map)
        return ForcedOrbits(flow, "frequency"), point

    problem, point = stalled(50.0)
    times = np.linspace(0.0, point.data.duration, 4000)
    penetration, _ = problem.flow.penetration_of(problem.flow.states_at(point.data, times), times)
    reason = Outcome.of(OutcomeKind.STOPPED, "not_smooth", "it stalls", at=3.0)
    outcome = explain(reason, *stalled(share * 300.0 * penetration.max()))
    assert outcome.code == said
    assert outcome.place.value == 3.0


def test_a_contact_that_sticks_throughout():
    """Any place of its slider is periodic; the continuation leaves it where it began, and did not end before."""
    rub = {**RUB, "normal_force": 100.0, "stiffness": 3000.0}
    result = beamsim.continuation(case("friction", friction=[rub], sweep={**CONTINUATION, "from": 4.4, "to": 4.52}))
    assert result.outcome.trusted
    (branch,) = result.branches
    assert branch["frequency_hz"].values.size < 100
    np.testing.assert_allclose(branch["frequency_hz"].values[[0, -1]], [4.4, 4.52], rtol=1e-9)
    np.testing.assert_allclose(multipliers(branch)[:, 0], 1.0, atol=1e-9)


@pytest.mark.parametrize("law", ["friction", "rigid friction", "pressed friction"])
def test_a_measured_vibration_gives_its_coefficient(law):
    """From harmonics computed with another coefficient; the interval holds it."""
    changed = "friction[0].coefficient={}"
    true = steady_vibration(case(law, changed.format(0.25))).harmonics(0, "displacement", 6)
    time = np.arange(400) / (4.5 * 40.0)
    history = np.imag(np.exp(2j * np.pi * 4.5 * np.outer(time, np.arange(1, 7))) @ true)
    test = {"file": "a.csv", "quantity": "displacement", "harmonics": 6, "noise": 0.001}
    fit = {"estimate": ["friction.rub.coefficient"], "tests": [test], "starts": 1, "profiles": False}
    section = {"snubber": "pad", "nonlinear": fit}
    scenario = case(law, changed.format(0.2), identify_stiffness=section)
    signal = MeasuredSignal("a", time, history, unit="m")
    (found,) = estimates(beamsim.identify_stiffness(scenario, [signal]), "nonlinear")
    assert found.value == pytest.approx(0.25, rel=1e-4)
    assert found.interval[0] < 0.25 < found.interval[1]
