"""Published cases of the field: what their sources print, and what beamsim computes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

import beamsim
from beamsim.results.branch import harmonics_of
from beamsim.system.build import build_system

GRAVITY = 9.81


class Published(NamedTuple):
    """A case: its source, the numbers printed there, what computes them, and what is inconsistent in the source."""

    title: str
    source: str
    printed: Mapping[str, float]  # by quantity with its unit
    computed: Callable[[], dict[str, float]]  # by quantity, those printed among them
    note: str


def ran(case: Mapping[str, Any]) -> Any:
    """The run of a case without a comparison with a finer model: masses have no finer one."""
    return beamsim.run(beamsim.load_scenario({**case, "run": {"convergence": "off", "spectrum": None, **case["run"]}}))


def one_mass(mass: float, stiffness: float = 0.0, **more: Any) -> dict[str, Any]:
    """A mass on a spring from the wall, with a probe."""
    chain = {"masses": [mass], "springs": [stiffness]}
    return {"chain": chain, "probes": [{"name": "mass", "mass": 1}], **more}


def stop(side: str, gap: float, stiffness: float, **more: Any) -> dict[str, Any]:
    """A stop on the mass."""
    return {"name": side, "mass": 1, "side": side, "gap": gap, "stiffness": stiffness, **more}


def displacements(result: Any, times: Sequence[float], probe: str = "mass") -> list[float]:
    """Displacements of a probe at times that are multiples of the sampling interval, m."""
    step = result["histories"]["time"].values[1] - result["histories"]["time"].values[0]
    return [float(result["histories"]["displacement"].sel(probe=probe).values[round(time / step)]) for time in times]


HALF_GAP = 0.39269908169872


def backlash() -> dict[str, float]:
    """Times at which the torque ends and the other side is met."""
    dashpot = {"damping": {"kind": "viscous", "coefficient": 50}, "law": "no_tension"}
    sides = [stop("above", HALF_GAP, 2e4, **dashpot), stop("below", HALF_GAP, 2e4, **dashpot)]
    run = {"duration": 0.05, "sample_rate": 1e5, "start": {"displacement": [1.570796326794897]}}
    result = ran(one_mass(5, snubbers=sides, run=run))
    opened, met = (
        float(result["events"]["time"].values[result["events"]["closing"].values == closes][0])
        for closes in (False, True)
    )
    flight = (result["histories"]["time"].values > opened) & (result["histories"]["time"].values < met)
    return {
        "torque is zero at, s": opened,
        "the other side is met at, s": met,
        "speed between, rad/s": float(np.median(result["histories"]["velocity"].sel(probe="mass").values[flight])),
    }


def vm80() -> dict[str, float]:
    """Largest and smallest displacement of an elastoplastic frame under a step."""
    slider = {"name": "frame", "at": {"mass": 1}, "mounted_on": "ground", "normal_force": 45.2862, "coefficient": 1,
              "stiffness": 83.4}  # fmt: skip
    step = {"kind": "step", "applied_to": {"mass": 1}, "level": 30}
    result = ran(
        one_mass(
            0.0259, friction=[slider], excitation=step, run={"duration": 0.15, "sample_rate": 1e5, "start": "rest"}
        )
    )
    x = result["histories"]["displacement"].sel(probe="mass").values
    top = int(x.argmax())
    low = top + int(x[top:].argmin())
    return {
        "largest displacement, in": float(x[top]), "at, s": float(result["histories"]["time"].values[top]),
        "smallest after it, in": float(x[low]), "then at, s": float(result["histories"]["time"].values[low]),
    }  # fmt: skip


def vm319() -> dict[str, float]:
    """Resonances of a mass on a linear and a cubic spring, by harmonic balance."""
    found = {}
    for force, (low, high) in {0.125: (14.9, 15.4), 0.25: (14.9, 16.0)}.items():
        chain = {
            "masses": [1.0], "springs": [8766.2], "dashpots": [0.46813],
            "springs_to_ground": [{"mass": 1, "kind": "cubic", "stiffness": 4.6752e7}],
        }  # fmt: skip
        sine = {"kind": "harmonic", "applied_to": {"mass": 1}, "level": force, "frequency": low}
        sweep = {
            "kind": "continuation",
            "from": low,
            "to": high,
            "method": {"kind": "harmonic_balance", "harmonics": 7},
        }
        case = {"chain": chain, "probes": [{"name": "mass", "mass": 1}], "excitation": sine, "sweep": sweep}
        branch = beamsim.continuation(beamsim.load_scenario(case)).branches[0]
        harmonics = np.abs(harmonics_of(branch)["mass"])
        value = np.hypot(harmonics[:, 1], harmonics[:, 3])
        k = int(value.argmax())
        found[f"resonance at {force:g} N, rad/s"] = 2.0 * np.pi * float(branch["frequency_hz"].values[k])
        found[f"sqrt(A1^2 + A3^2) at {force:g} N, mm"] = 1e3 * float(value[k])
    return found


TURNS = [np.pi / 100 * k for k in range(1, 5)]


def sdnd100a() -> dict[str, float]:
    """Displacements of a mass on a spring with rigid friction, where its motion turns."""
    slider = {"name": "ground", "at": {"mass": 1}, "mounted_on": "ground", "normal_force": 1.0, "coefficient": 1}
    run = {"duration": 0.13, "sample_rate": 400 / np.pi * 100, "start": {"displacement": [0.85e-3]}}
    result = ran(one_mass(1.0, 1e4, friction=[slider], run=run))
    found = displacements(result, TURNS)
    return {f"displacement at {k} pi/100 s, mm": 1e3 * x for k, x in enumerate(found, 1)}


def sdnl111a(masses: int = 60) -> dict[str, float]:
    """Displacement of the face of a bar that meets another one."""
    area, young, density, length = 0.02**2, 2e11, 7800.0, 1.0
    mass, spring = density * area * length / masses, young * area * masses / length
    springs = [0.0, *[spring] * (masses - 1), 0.0, *[spring] * (masses - 1), 2.0 * spring]
    bars = {
        "masses": [mass] * (2 * masses), "springs": springs,
        "snubbers": [{"name": "contact", "between": [masses, masses + 1], "stiffness": 5e9, "gap": 0.0}],
    }  # fmt: skip
    start = {"velocity": [1.0] * masses + [0.0] * masses}
    run = {"duration": 1e-3, "sample_rate": 1e6, "start": start}
    result = ran({"chain": bars, "probes": [{"name": "face", "mass": masses}], "run": run})
    times = (2e-4, 4e-4, 6e-4, 8e-4, 1e-3)
    # the source counts displacements against the motion
    return {
        f"displacement at {1e3 * t:.1f} ms, mm": -1e3 * x
        for t, x in zip(times, displacements(result, times, "face"), strict=True)
    }


def todd_virgin() -> dict[str, float]:
    """Frequency of free vibration against a rigid stop, over that without the stop."""
    found = {}
    for gap in (0.5, -0.5):
        run = {"duration": 10.0, "sample_rate": 100.0, "start": {"displacement": [-1.0]}}
        result = ran(one_mass(1.0, 1.0, snubbers=[stop("above", gap, 1e8)], run=run))
        met = result["events"]["time"].values[result["events"]["closing"].values]
        found[f"f/f0 at d/A = {gap:g}"] = 2.0 * np.pi / float(met[1] - met[0])
    return found


SIGMA, STOP_STIFFNESS, STOP_DASHPOT = 0.001, 1e6, 430.0


def budd_dux() -> dict[str, float]:
    """Impact speed of the periodic motion with one impact in a period of the force, from a stiff stop."""
    hit = stop(
        "above", SIGMA, STOP_STIFFNESS, damping={"kind": "viscous", "coefficient": STOP_DASHPOT}, law="no_tension"
    )
    force = {"kind": "harmonic", "applied_to": {"mass": 1}, "level": 1.0, "frequency": 1.0 / np.pi, "phase": "90 deg"}
    run = {"duration": 120.0, "sample_rate": 50.0, "impacts": {}}
    result = ran(one_mass(1.0, 1.0, snubbers=[hit], excitation=force, run=run))
    return {"impact speed": float(result["impacts"]["approach_speed"].values[-1])}


def falls(mass: float, gap: float, speed: float, law: Mapping[str, Any], until: float) -> Any:
    """The run of a mass that falls onto a stop on the ground."""
    weight = [{"mass": 1, "force": -mass * GRAVITY}]
    start = {"velocity": [speed]} if speed else "rest"
    run = {"duration": until, "sample_rate": 1e5, "start": start}
    return ran(one_mass(mass, snubbers=[{**stop("below", gap, 1.0), **law}], constant_forces=weight, run=run))


def contact_coordinate() -> dict[str, float]:
    """Height of a mass above a damped ground, and its contacts."""
    result = falls(
        0.25,
        0.05,
        0.0,
        {"stiffness": 2e6, "damping": {"kind": "viscous", "coefficient": 200}, "law": "kelvin_voigt"},
        0.25,
    )
    height = 0.05 + float(result["histories"]["displacement"].sel(probe="mass").values[-1])
    events = {f"event {k}, s": float(t) for k, t in enumerate(result["events"]["time"].values, 1)}
    return {"height at 0.25 s + 50 mm, mm": 50.0 + 1e3 * height, **events}


def post_newton() -> dict[str, float]:
    """Height of a mass above an elastic ground, and the time of its first flight."""
    result = falls(0.25, 0.01, -1.0, {"stiffness": 2e4}, 0.5)
    height = 0.01 + float(result["histories"]["displacement"].sel(probe="mass").values[-1])
    opened, closed = (
        result["events"]["time"].values[result["events"]["closing"].values == closes] for closes in (False, True)
    )
    return {"height at 0.5 s + 50 mm, mm": 50.0 + 1e3 * height, "flight, s": float(closed[1] - opened[0])}


RUBBER_PLACE, RUBBER_STIFFNESS = 0.253571, 1e7
RUBBER_BEAM = {
    "length": 0.71, "width": 0.06, "thickness": 0.05, "youngs_modulus": 0.6725 * 210e9, "density": 7850,
    "elements": 14, "supports": {"left": "clamped"}, "damping": {"kind": "modal", "ratio": 0.01},
}  # fmt: skip


def rubber() -> dict[str, float]:
    """Natural frequencies of a beam whose friction contact sticks, and slides."""
    case = {"beam": RUBBER_BEAM, "probes": [{"name": "tip", "position": 0.71}]}
    spring = [{"at": {"position": RUBBER_PLACE}, "kind": "linear", "stiffness": RUBBER_STIFFNESS}]
    found = {}
    for name, more in (("stuck", {"springs_to_ground": spring}), ("sliding", {})):
        modes = build_system(beamsim.load_scenario({**case, **more})).modes
        found |= {f"{name}, mode {k}, Hz": float(f) for k, f in enumerate(modes["open_frequencies_hz"].values[:3], 1)}
    return found


def rubber_resonance(level: float) -> float:
    """Frequency of the largest response of the tip to a force on it of this level, N, on a grid of 0.5 Hz, Hz."""
    slider = {"name": "jenkins", "at": {"position": RUBBER_PLACE}, "mounted_on": "ground", "normal_force": 15,
              "coefficient": 1, "stiffness": RUBBER_STIFFNESS}  # fmt: skip
    case = {
        "beam": RUBBER_BEAM, "reduction": {"modes": 4}, "friction": [slider],
        "probes": [{"name": "tip", "position": 0.71}],
        "excitation": {"kind": "harmonic", "applied_to": {"position": 0.71}, "level": level, "frequency": 70},
        "sweep": {"kind": "stepped", "from": 66, "to": 82.5, "points": 34, "spacing": "linear", "direction": "up",
                  "convergence": "off", "accelerations": False},
    }  # fmt: skip
    (curve,) = beamsim.sweep(beamsim.load_scenario(case)).curves.values()
    return float(curve.frequency_hz[curve.channel("displacement", "tip").peak.argmax()])


CASES = (
    Published(
        "Backlash", "Modelica standard library, Rotational.Examples.Backlash (reference results of MAP-LIB)",
        {"torque is zero at, s": 0.0236592180, "the other side is met at, s": 0.0380238692,
         "speed between, rad/s": -66.1964949764}, backlash,
        "The printed results differ from the closed form by up to 2e-6, the error of an integrator. From the second"
        " contact on the source limits the force to twice the elastic one, another law: only the first flight is "
        "compared.",
    ),
    Published(
        "Elastoplastic frame under a step", "Ansys verification manual, VM80 (J. M. Biggs)",
        {"largest displacement, in": 0.806, "at, s": 0.0669, "smallest after it, in": 0.438, "then at, s": 0.122}, vm80,
        "In closed form, elastic and plastic pieces one after the other, they are 0.80433 and 0.43776 in.",
    ),
    Published(
        "Cubic spring", "Ansys verification manual, VM319 (A. Grolet and F. Thouverez, all sectors in phase)",
        {"resonance at 0.125 N, rad/s": 95.09, "sqrt(A1^2 + A3^2) at 0.125 N, mm": 2.80,
         "resonance at 0.25 N, rad/s": 98.95, "sqrt(A1^2 + A3^2) at 0.25 N, mm": 5.41}, vm319,
        "A harmonic balance written for this equation alone gives the computed amplitudes to 1e-5, not the printed "
        "ones.",
    ),
    Published(
        "Rigid friction", "code_aster, SDND100A",
        dict(zip((f"displacement at {k} pi/100 s, mm" for k in range(1, 5)), (-0.65, 0.45, -0.25, 0.05), strict=True)),
        sdnd100a,
        "The closed form stands under printed: each half cycle takes 2 F/k. A sticking stiffness, by which rigid "
        "friction is often replaced, changes the numbers: with 4e5 N/m the last one is 0.0522 mm.",
    ),
    Published(
        "Two bars", "code_aster, SDNL111A",
        dict(zip((f"displacement at {t:.1f} ms, mm" for t in (0.2, 0.4, 0.6, 0.8, 1.0)), (-0.1, -0.2, -0.1, 0.0, 0.2),
                 strict=True)), sdnl111a,
        "The lengths of 1 m are inferred from the times. The printed values are those of a wave that runs through a"
        " bar in exactly 0.2 ms, which takes it 0.19749 ms. The source counts displacements against the motion.",
    ),
    Published(
        "Oscillator with a rigid stop", "M. D. Todd and L. N. Virgin (1996)",
        {"f/f0 at d/A = 0.5": 1.5, "f/f0 at d/A = -0.5": 3.0}, todd_virgin,
        "The closed form stands under printed. The stop here has 1e8 times the stiffness of the spring; its contact "
        "time of pi/1e4 makes the difference.",
    ),
    Published(
        "Impact oscillator", "C. J. Budd and F. Dux, closed form of one impact in a period (stiff limit)",
        {"impact speed": 2.968880}, budd_dux,
        "The closed form stands under printed: frequency 2, stop at 0.001, restitution 0.550899, which is that of the "
        "stop's spring and dashpot here.",
    ),
    Published(
        "Ball on a damped ground", "Exudyn, contactCoordinateTest",
        {"height at 0.25 s + 50 mm, mm": 55.3132}, contact_coordinate,
        "The printed number of the test is not converged in its time step.",
    ),
    Published(
        "Ball on an elastic ground", "Exudyn, postNewtonStepContactTest",
        {"height at 0.5 s + 50 mm, mm": 57.2866}, post_newton,
        "The printed number is that of a time step of 5 ms, about half a contact, and is not converged.",
    ),
    Published(
        "Virtual RubBeR rig", "NLtest, BT01", {"stuck, mode 1, Hz": 80.36780}, rubber,
        "Only the stuck frequency is printed. Those of the continuous beam are within 1e-4 of the computed ones (14"
        " elements).",
    ),
)  # fmt: skip
