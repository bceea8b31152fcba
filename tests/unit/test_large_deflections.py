"""Displacements beyond the theory of small ones are doubted, in every command that computes a motion."""

import pytest

import beamsim
from beamsim.scenario import load_scenario

BEAM = {"length": 0.27, "width": 0.05, "thickness": 0.005, "youngs_modulus": 69e9, "density": 2700,
        "damping": {"kind": "modal", "ratio": 0.01}}  # fmt: skip
STOP = {"name": "tip", "position": 0.27, "side": "below", "stiffness": 151e3, "gap": 1e-4}
COMMANDS = {
    "run": ({"run": {"duration": 0.05, "convergence": "off"}}, beamsim.run),
    "swept": ({"sweep": {"kind": "swept_sine", "from": 55, "to": 60, "rate": "20 Hz/s"}}, beamsim.sweep),
    "continuation": ({"sweep": {"kind": "continuation", "from": 40, "to": 40.1, "seek_at": 0}},
                     beamsim.continuation),
}  # fmt: skip


def warnings_of(command, level, **changes):
    more, compute = COMMANDS[command]
    base = {"kind": "harmonic", "applied_to": "base", "level": level, "frequency": 56}
    case = {"beam": BEAM, "snubbers": [STOP], "excitation": base, "reduction": {"modes": 3}, **more, **changes}
    return [w for w in compute(load_scenario(case)).warnings if "is not small for beam" in w]


@pytest.mark.parametrize("command", COMMANDS)
def test_displacements_of_the_size_of_the_beam_are_doubted(command):
    (warning,) = warnings_of(command, "2000 g")
    assert "the largest displacement at tip" in warning
    assert "more than 0.054 m" in warning
    assert not warnings_of(command, "2 g")


def test_a_free_beam_may_go_far():
    supports = {"left": "free", "right": "free"}
    run = {"duration": 0.05, "convergence": "off", "start": "rest"}
    assert not warnings_of("run", "2000 g", beam=BEAM | {"supports": supports}, run=run, snubbers=[STOP | {"gap": 1.0}])
