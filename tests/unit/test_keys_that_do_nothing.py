"""A key that its analysis would ignore is refused with a remedy; what acts is accepted."""

import pytest

from beamsim.errors import ScenarioError
from beamsim.scenario import load_scenario

pytestmark = pytest.mark.quick

CASE = {
    "chain": {"masses": [1.0], "springs": [400.0, 0.0], "snubbers": [
        {"name": "stop", "mass": 1, "side": "below", "stiffness": 1e3, "gap": 0.1},
    ]},
    "excitation": {"kind": "harmonic", "applied_to": "base", "level": 1.0, "frequency": 2.0},
}  # fmt: skip
CUBIC = {"springs_to_ground": [{"kind": "cubic", "mass": 1, "stiffness": 1.0}]}
STEPPED = {"kind": "stepped", "from": 2.0, "to": 3.0}
SWEPT = {"kind": "swept_sine", "from": 2.0, "to": 3.0, "rate": "0.1 Hz/s"}
CONTINUATION = {"kind": "continuation", "from": 2.0, "to": 3.0}
FILTERED = {"duration": 1.0, "low_pass": "5 Hz"}
PROFILE = [{"frequency": 2.0, "level": 1.0}, {"frequency": 3.0, "level": 2.0}]


@pytest.mark.parametrize(
    ("sections", "path", "remedy"),
    [
        ({"sweep": STEPPED, "run": FILTERED}, "sweep", "run: null"),
        ({"sweep": SWEPT, "run": FILTERED}, "sweep", "run: null"),
        ({"sweep": CONTINUATION, "run": FILTERED}, "sweep", "run: null"),
        ({"sweep": SWEPT | {"between": "log_log"}}, "sweep.between", "leave it out"),
        ({"run": {"duration": 1.0, "rtol": 1e-6}}, "run.rtol", "method: reference"),
        ({"run": {"duration": 1.0, "atol": 1e-9}}, "run.atol", "method: reference"),
        ({"run": {"duration": 1.0, "integrator": "RK45"}}, "run.integrator", "method: reference"),
        (CUBIC | {"run": {"duration": 1.0, "integrator": "RK45"}}, "run.integrator", "method: reference"),
        ({"run": {"duration": 1.0, "method": "reference", "spectrum": {"to": 5.0}}}, "run.spectrum.to", "sample_rate"),
    ],
)
def test_a_key_that_does_nothing_is_refused(sections, path, remedy):
    with pytest.raises(ScenarioError) as refused:
        load_scenario(CASE | sections)
    (found,) = refused.value.problems
    assert found.path == path
    assert remedy in found.remedy


@pytest.mark.parametrize(
    "sections",
    [
        {"run": FILTERED},
        {"sweep": STEPPED | {"accelerations": False}, "run": FILTERED},
        {"sweep": SWEPT | {"between": "log_log", "profile": PROFILE}},
        {"run": {"duration": 1.0, "method": "reference", "rtol": 1e-6, "atol": 1e-9, "integrator": "RK45"}},
        CUBIC | {"run": {"duration": 1.0, "rtol": 1e-12, "atol": 1e-14}},
        {"run": {"duration": 1.0, "spectrum": {"to": 5.0}}},
    ],
)
def test_a_key_that_acts_is_accepted(sections):
    load_scenario(CASE | sections)


def test_each_command_refuses_or_leaves_out_the_section_that_it_does_not_use():
    """`sweep` ignored the band of the accelerometers: 404.9 g with 2 kHz and with 200 Hz."""
    both = CASE | {"sweep": STEPPED, "run": FILTERED}
    with pytest.raises(ScenarioError, match=r"run\.low_pass = 5 Hz"):
        load_scenario(both, command="sweep")
    (warning,) = load_scenario(both, command="run").warnings
    assert warning.startswith("left out, since run does not use it: sweep")
