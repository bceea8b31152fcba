"""Pictures of stops that move with a support, stay on the ground, or are moved: contact is where they are."""

import numpy as np
import pytest

import beamsim
from beamsim.plots.bodies import deflected_shapes
from beamsim.plots.run import phase_portrait

OMEGA = 2 * np.pi * 9.0
BEAM = {
    "length": "900 mm", "width": "30 mm", "thickness": "4 mm", "youngs_modulus": "70 GPa", "density": "2700 kg/m^3",
    "elements": 8, "supports": {"left": "pinned", "right": "pinned"}, "damping": {"kind": "modal", "ratio": "2 %"},
}  # fmt: skip
RUN = {"duration": "0.5 s", "start": "rest", "sample_rate": "4 kHz", "convergence": "off"}
SHAKEN = {"kind": "harmonic", "applied_to": "base", "level": "3 m/s^2", "frequency": "9 Hz"}
PUSHED = {"kind": "harmonic", "applied_to": {"support": "left"}, "level": "2 mm", "frequency": "9 Hz"}
CASES = {
    "support": ({"mounted_on": {"support": "left"}}, PUSHED),
    "ground": ({"mounted_on": "ground"}, SHAKEN),
    "itself": ({}, {"kind": "forces", "forces": [
        SHAKEN, {**PUSHED, "applied_to": {"snubber": "stop"}, "level": "1 mm", "phase": "90 deg"}
    ]}),
}  # fmt: skip


def moved(case, side="below"):
    where, excitation = CASES[case]
    stop = {"name": "stop", "position": "500 mm", "side": side, "stiffness": "20 kN/m", "gap": "0.2 mm", **where}
    return beamsim.run({"beam": BEAM, "snubbers": [stop], "excitation": excitation, "run": RUN})


@pytest.mark.parametrize("side", ["below", "above"])
@pytest.mark.parametrize("case", list(CASES))
def test_contact_is_beyond_the_face_in_a_phase_portrait(case, side):
    """The gap parts the free motion from that in contact, however the stop moves."""
    sign, chart = (-1.0 if side == "below" else 1.0), phase_portrait(moved(case, side), "snubber", "stop")
    known = {curve.label: curve for curve in chart.curves}
    free, contact = (known[name].x[np.isfinite(known[name].y)] for name in ("free", "in contact"))
    assert np.all(sign * free <= 0.2e-3 + 1e-9)
    assert np.mean(sign * contact >= 0.2e-3 - 1e-9) > 0.8  # but for the samples beside, which join the curves
    assert chart.x_axis[0] == "At stop, relative to the stop\nDisplacement"


def test_velocities_are_those_from_the_support():
    """The support's displacement is 2 mm sin(omega t)."""
    result = moved("support")
    histories, chart = result["histories"], phase_portrait(result, "snubber", "stop")
    time, w, v = (histories[name].values for name in ("time", "snubber_displacement", "snubber_velocity"))
    (free,) = (curve for curve in chart.curves if curve.label == "free")
    shown = np.isfinite(free.y)
    np.testing.assert_allclose(free.x, w[0] - 2e-3 * np.sin(OMEGA * time), atol=1e-9)
    right = v[0] - 2e-3 * OMEGA * np.cos(OMEGA * time)
    np.testing.assert_allclose(free.y[shown], right[shown], atol=1e-3 * np.abs(right).max())


def test_shapes_have_the_stop_where_it_is_then():
    """The face is 0.2 mm below the support's displacement at each of the two times, or where the beam presses it."""
    result = moved("support")
    chart = deflected_shapes(result, "beam")
    times = result["bodies"]["extreme_time"].values[::-1]  # highest first
    free = 2e-3 * np.sin(OMEGA * times) - 0.2e-3
    right = [min(face, np.interp(0.5, curve.x, curve.y)) for face, curve in zip(free, chart.curves, strict=False)]
    faces = np.concatenate([mark.y for mark in chart.marks])
    at = np.concatenate([mark.x for mark in chart.marks])
    np.testing.assert_allclose(at, 0.5)
    np.testing.assert_allclose(np.sort(faces), np.sort([*right, -0.2e-3]), atol=2e-6)
    assert {mark.label for mark in chart.marks} <= {
        "",
        "snubber, open then",
        "snubber, closed then",
        "snubber, open at rest",
    }
