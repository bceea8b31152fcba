"""What takes too long by what is counted before the start is refused there, whoever asks for it."""

from pathlib import Path

import numpy as np
import pytest
from commands import invoke

import beamsim
from beamsim.analyses.studies.plan import plan_designs
from beamsim.errors import TooLongError, allowed_hours, allowing_hours
from beamsim.trust.least_time import least_time_of_run, least_time_of_study, least_time_of_sweep

pytestmark = pytest.mark.quick

CASE = Path("configs/one_sided_65hz.yaml")
STEPPED = {"kind": "stepped", "from": "20 Hz", "to": "40 Hz", "points": 100_000}
GAPS = {"path": "snubbers.tip.gap", "from": "0 mm", "to": "1 mm"}
SAMPLED = {"kind": "latin_hypercube", "samples": 1000, "parameters": [GAPS]}


def counted(of):
    return [count.number for count in of.counts]


def test_periods_of_a_run():
    assert counted(least_time_of_run(beamsim.load_scenario(CASE))) == [pytest.approx(0.8 * 65)]
    free = beamsim.load_scenario(CASE, {"excitation": {"kind": "none"}, "run.start": {"mode": 1, "amplitude": "1 mm"}})
    assert counted(least_time_of_run(free)) == [1]


@pytest.mark.parametrize(
    ("sweep", "counts"),
    [
        ({**STEPPED, "direction": "both", "levels": ["1 g", "2 g", "3 g"]}, [3, 200_000]),
        # f(t) = 20 Hz 2^t, t in s: 20 Hz / ln 2 cycles in an octave
        ({"kind": "swept_sine", "from": "20 Hz", "to": "40 Hz", "rate": "1 oct/s"}, [1, 20 / np.log(2)]),
        ({"kind": "continuation", "from": "20 Hz", "to": "40 Hz", "levels": ["1 g", "2 g"]}, [2]),
    ],
)
def test_what_a_sweep_counts(sweep, counts):
    assert counted(least_time_of_sweep(beamsim.load_scenario(CASE, {"sweep": sweep}))) == pytest.approx(counts)


@pytest.mark.parametrize(
    ("overrides", "counts"),
    [
        ({"vary": {"kind": "grid", "parameters": [{**GAPS, "points": 30}]}}, [30]),
        ({"vary": SAMPLED, "sweep": STEPPED}, [1000, 1, 100_000]),
        ({"vary": {"kind": "reliability", "parameters": [GAPS], "samples": 500}, "limits.peak_force": "5 N"}, [500]),
        # a first-order approximation, or a search, may end soon
        ({"vary": {"kind": "reliability", "parameters": [GAPS], "method": "form"}, "limits.peak_force": "5 N"}, [1]),
        ({"optimise": {"parameters": [GAPS], "minimise": "peak_force", "most_cases": 100_000}}, [1]),
        # the case with the fewest points counts
        (
            {
                "sweep": STEPPED,
                "vary": {"kind": "grid", "parameters": [{"path": "sweep.points", "values": [300, 100, 200]}]},
            },
            [3, 1, 100],
        ),
    ],
)
def test_cases_of_a_study(overrides, counts):
    plan = plan_designs(beamsim.load_scenario(CASE, overrides))
    assert counted(least_time_of_study(plan)) == pytest.approx(counts)


def test_cases_that_are_known_take_no_time():
    plan = plan_designs(beamsim.load_scenario(CASE, {"vary": SAMPLED}))
    assert counted(least_time_of_study(plan, solved_cases=900)) == [100]


def test_a_long_sweep_is_refused_from_python():
    """2e8 steady motions."""
    scenario = beamsim.load_scenario(CASE, {"sweep": {**STEPPED, "levels": [0.01 * k for k in range(1, 2001)]}})
    refused = r"2,000 levels x 100,000 frequencies, .* 56 h, .* 50 h .*; lower sweep\.levels or sweep\.points"
    with allowing_hours(50.0), pytest.raises(TooLongError, match=refused) as raised:
        beamsim.sweep(scenario)
    assert raised.value.exit_code == 2


LONG = {"vary": SAMPLED, "sweep": STEPPED}  # 1e8 steady motions


def test_a_long_study_is_refused_from_python():
    scenario = beamsim.load_scenario(CASE, LONG)
    refused = r"1,000 cases x 1 levels x 100,000 frequencies.* 28 h.* vary\.samples or sweep\.points"
    with allowing_hours(10.0):
        with pytest.raises(TooLongError, match=refused):
            beamsim.design_study(scenario)
        with pytest.raises(TooLongError, match="lower draws or"):
            beamsim.ensemble(beamsim.load_scenario(CASE, {"sweep": STEPPED}), {"snubbers.tip.gap": np.zeros(1000)})


def test_a_long_study_is_refused_by_the_command(tmp_path):
    """Nothing is written, and cases that were kept stay as they are."""
    case = tmp_path / "case.yaml"
    case.write_text(beamsim.load_scenario(CASE, LONG).to_yaml())
    kept = tmp_path / "case.h5.partial"
    kept.write_bytes(b"kept")
    done = invoke("sweep", case, "-o", tmp_path / "case.h5", "--workers", "1", "--allow-hours", "10")
    assert done.exit_code == 2
    assert "--allow-hours 60" in done.output
    assert kept.read_bytes() == b"kept"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["case.h5.partial", "case.yaml"]


def test_less_can_be_allowed_and_more():
    scenario = beamsim.load_scenario(CASE, {"sweep": {**STEPPED, "points": 3}})
    with allowing_hours(1e-9):
        with pytest.raises(TooLongError, match=r"1 levels x 3 frequencies.*; lower sweep\.points, "):
            beamsim.sweep(scenario)
        with allowing_hours(5000.0):
            assert allowed_hours.get() == 5000.0
    assert allowed_hours.get() == 1000.0
