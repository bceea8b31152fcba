"""Accelerations of followed motions that grow with the number of modes, since the force of a dashpot jumps."""

from typing import Any

import pytest

import beamsim
from tests.helpers.branches import long_steps

FOLLOWED = {"kind": "continuation", "from": "75 Hz", "to": "75.1 Hz"}
FOUND = {
    "kind": "coexisting", "at": ["75 Hz"],
    "starts": {"kind": "states", "number": 2, "box": [{"probe": "tip", "mode": 1, "displacement": ["0 mm", "1 mm"]}]},
}  # fmt: skip


def struck_beam(mass: str = "", modes: int = 6, sweep: dict[str, Any] | None = None) -> dict[str, Any]:
    """README's beam on its snubber, with a point mass at the tip alone or with none."""
    return {
        "beam": {
            "length": "270 mm", "width": "50 mm", "thickness": "5 mm", "youngs_modulus": "69 GPa",
            "density": "2700 kg/m^3", "elements": 20, "supports": {"left": "clamped", "right": "free"},
            "damping": {"kind": "modal", "ratio": "1 %"},
            "point_masses": [{"position": "270 mm", "mass": mass}] if mass else [],
        },
        "snubbers": [
            {"name": "tip", "position": "270 mm", "side": "below", "mounted_on": "base", "stiffness": "151.1 kN/m",
             "damping": {"kind": "ratio", "ratio": "5 %"}, "gap": "0 mm"}
        ],
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": "2 g", "frequency": "75 Hz"},
        "probes": [{"name": "tip", "position": "270 mm"}, {"name": "middle", "position": "135 mm"}],
        "reduction": {"modes": modes}, "limits": {"peak_acceleration": "2000 g"},
        "sweep": sweep or FOLLOWED,
    }  # fmt: skip


@pytest.mark.parametrize("sweep", [FOLLOWED, FOUND], ids=["continuation", "coexisting"])
def test_a_limit_on_an_acceleration_that_grows_is_not_reliable(sweep: dict[str, Any]) -> None:
    compute = beamsim.continuation if sweep is FOLLOWED else beamsim.coexisting
    with long_steps():
        summary = compute(struck_beam(sweep=sweep)).summary
    assert summary["without_limit"] == ["peak_acceleration_g.tip"]
    assert summary["margins"]["peak_acceleration"]["verdict"] == "not reliable"


def test_it_grows_as_stated() -> None:
    """At the contact of a beam without mass in proportion to the modes; not in the middle."""
    with long_steps():
        few, many = (
            beamsim.continuation(struck_beam(modes=modes)).summary["peak_acceleration_g"] for modes in (10, 20)
        )
    assert many["tip"] > 1.5 * few["tip"]
    assert many["middle"] == pytest.approx(few["middle"], rel=0.05)


def test_a_mass_at_the_contact_gives_it_a_limit() -> None:
    with long_steps():
        summary = beamsim.continuation(struck_beam("20 g")).summary
    assert "without_limit" not in summary
    assert summary["margins"]["peak_acceleration"]["verdict"] == "ok"
