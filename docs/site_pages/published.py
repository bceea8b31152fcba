"""Published cases of the field: what their sources print, and what beamsim computes."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

import beamsim
from beamsim.results.branch import harmonics_of
from beamsim.system.build import build_system

from .configs import CONFIGS

RECORDED = Path(__file__).parents[1] / "published.yaml"
GRAVITY = 9.81


class Published(NamedTuple):
    """A case: its source, the numbers printed there and the right ones, what computes them, why they may differ."""

    title: str
    source: str
    printed: Mapping[str, float]  # by quantity with its unit
    computed: Callable[[], dict[str, float]]  # by quantity, those printed and the right ones among them
    right: Mapping[str, float] = {}  # by quantity: of a closed form or an independent computation
    right_by: str = "closed form"
    why: str = ""  # why printed numbers differ from computed ones
    why_right: str = ""  # why right numbers differ from computed ones
    scale: float = 0.0  # of the differences of a series of values; 0: each value itself
    note: str = ""


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


STOP_STIFFNESS = 1e8
IMPACT_ORBITS = {
    "omega 2, r 0.4": (2.0, 0.4, 1e-3, 7090.154316, 2.22221222, 0.7868981657),
    "omega 2.6, r 0.8": (2.6, 0.8, 0.0, 1487.101942, 0.5054399709, 1.1651472830),
    "omega 2.8, r 0.8": (2.8, 0.8, 0.0, 1487.101942, 0.3361772700, 1.0926345564),
}
"""Frequency of the force, restitution, place of the stop, m, dashpot of a stop with this restitution, N s/m, and the
closed form: impact speed, m/s, and time of the impact after an extreme of the force, s."""


def budd_dux() -> dict[str, float]:
    """Speed of the second impact of motions that begin where the closed form leaves a rigid stop, at a stiff one."""
    found = {}
    for name, (omega, restitution, gap, dashpot, speed, time) in IMPACT_ORBITS.items():
        damping = {"kind": "viscous", "coefficient": dashpot}
        hit = stop("above", gap, STOP_STIFFNESS, damping=damping, law="no_tension")
        force = {"kind": "harmonic", "applied_to": {"mass": 1}, "level": 1.0, "frequency": 0.5 * omega / np.pi,
                 "phase": 0.5 * np.pi + omega * time}  # fmt: skip
        start = {"displacement": [gap], "velocity": [-restitution * speed]}
        run = {"duration": 5.0 * np.pi / omega, "sample_rate": 20.0, "impacts": {}, "start": start}
        result = ran(one_mass(1.0, 1.0, snubbers=[hit], excitation=force, run=run))
        found[f"impact speed, {name}"] = float(result["impacts"]["approach_speed"].values[1])
    return found


def elasto_gap() -> dict[str, float]:
    """First flight of a mass between two damped stops, and its place after it has met the other one."""
    dashpot = {"damping": {"kind": "viscous", "coefficient": 1.5}, "law": "no_tension"}
    sides = [stop(side, 0.5, 10.0, **dashpot) for side in ("above", "below")]
    run = {"duration": 1.0, "sample_rate": 1e4, "start": {"displacement": [2.0]}}
    result = ran(one_mass(1.0, snubbers=sides, run=run))
    times, histories, events = result["histories"]["time"].values, result["histories"], result["events"]
    opened, met = (float(events["time"].values[events["closing"].values == closes][0]) for closes in (False, True))
    k = int(np.searchsorted(times, 0.5 * (opened + met)))
    speed = float(histories["velocity"].sel(probe="mass").values[k])
    place = float(histories["displacement"].sel(probe="mass").values[k])
    return {
        "speed of the first flight, m/s": speed,
        "s = 0.5 m at, s": float(times[k]) + (0.5 - place) / speed,
        "s = -0.5 m at, s": met,
        "s(0.95 s), m": displacements(result, [0.95])[0],
    }


def clough_penzien() -> dict[str, float]:
    """Displacements of a damped elastoplastic mass under a force that is given at tenths of a second."""
    slider = {"name": "frame", "at": {"mass": 1}, "mounted_on": "ground", "normal_force": 6.0, "coefficient": 1,
              "stiffness": 5.0}  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "force.csv"
        rows = [f"{0.1 * k},{force}" for k, force in enumerate((0, 5, 8, 7, 5, 3, 2, 1, 0, 0, 0, 0))]
        file.write_text("\n".join(["time,force", *rows]), encoding="utf-8")
        force = {"kind": "sampled", "applied_to": {"mass": 1}, "file": str(file), "column": "force", "unit": "N",
                 "time_unit": "s", "interpolation": "linear"}  # fmt: skip
        case = one_mass(0.1, friction=[slider], excitation=force,
                        run={"duration": 1.0, "sample_rate": 1e3, "start": "rest"})  # fmt: skip
        case["chain"]["dashpots"] = [0.2]
        result = ran(case)
    times = [0.1 * k for k in range(1, 11)]
    return {f"displacement at {t:.1f} s": x for t, x in zip(times, displacements(result, times), strict=True)}


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


def vibeams() -> dict[str, float]:
    """Natural frequencies of the two beams without contact, Hz."""
    overrides = ["bodies.left.elements=80", "bodies.right.elements=80"]
    system = build_system(beamsim.load_scenario(CONFIGS["vibeams"], overrides))
    shapes, frequencies = system.modes["shapes"].values, system.modes["open_frequencies_hz"].values
    of_left = next(part.stations for part in system.stations.bodies if part.body == "left")
    is_left = np.abs(shapes[:, of_left]).max(axis=1) > 1e-6 * np.abs(shapes).max(axis=1)
    return {
        f"{name}, mode {k}, Hz": float(value)
        for name, found in (("left", frequencies[is_left][:4]), ("right with leaf", frequencies[~is_left][:5]))
        for k, value in enumerate(found, 1)
    }


def _numbered(name: str, unit: str, values: Sequence[float]) -> dict[str, float]:
    return {f"{name}, mode {k}, {unit}": value for k, value in enumerate(values, 1)}


def recorded(name: str) -> dict[str, float]:
    """What ``python -m benchmarks.published_cases`` computed."""
    return dict(yaml.safe_load(RECORDED.read_text(encoding="utf-8"))["values"][name])


def clutch() -> dict[str, float]:
    """Recorded frequencies of period doublings, Hz."""
    return recorded("duan_singh")


def tube_forces() -> dict[str, float]:
    """Recorded forces of the stops of a tube, N; twice, since they are compared with two integrations."""
    found = recorded("sdnl301a")
    return found | {WHOLE.format(name): value for name, value in found.items()}


def tube_by_steps() -> dict[str, float]:
    """Recorded forces of the independent integrations with 30 modes and with all."""
    return recorded("sdnl301a, 30 modes by steps") | {
        WHOLE.format(name): value for name, value in recorded("sdnl301a, all modes by steps").items()
    }


TENTHS = [f"displacement at {0.1 * k:.1f} s" for k in range(1, 11)]
BAR_TIMES = [f"displacement at {t:.1f} ms, mm" for t in (0.2, 0.4, 0.6, 0.8, 1.0)]
TURNED = [f"displacement at {k} pi/100 s, mm" for k in range(1, 5)]

WHOLE = "{}, compared with all modes"
TUBE_FORCES = [f"rms force of stop {k}, N" for k in range(1, 5)]

CASES = (
    Published(
        "Backlash", "Modelica standard library, Rotational.Examples.Backlash (reference results of MAP-LIB)",
        {"torque is zero at, s": 0.0236592180, "the other side is met at, s": 0.0380238692,
         "speed between, rad/s": -66.1964949764}, backlash,
        {"torque is zero at, s": 0.023659215841, "the other side is met at, s": 0.038023842575,
         "speed between, rad/s": -66.19661797749},
        note="The printed results are those of an integrator, with errors up to 2e-6. From the second contact on, the "
        "source limits the force to twice the elastic one, which is another law: only the first flight is compared.",
    ),
    Published(
        "Elastoplastic frame under a step", "Ansys verification manual, VM80 (J. M. Biggs)",
        {"largest displacement, in": 0.806, "at, s": 0.0669, "smallest after it, in": 0.438, "then at, s": 0.122}, vm80,
        {"largest displacement, in": 0.80433353613, "at, s": 0.066861785916, "smallest after it, in": 0.43775799656,
         "then at, s": 0.122224417998},
        note="The printed results come from time steps. The computed times are those of samples, 0.01 ms apart.",
    ),
    Published(
        "Cubic spring", "Ansys verification manual, VM319 (A. Grolet and F. Thouverez, all sectors in phase)",
        {"resonance at 0.125 N, rad/s": 95.09, "sqrt(A1^2 + A3^2) at 0.125 N, mm": 2.80,
         "resonance at 0.25 N, rad/s": 98.95, "sqrt(A1^2 + A3^2) at 0.25 N, mm": 5.41}, vm319,
        {"sqrt(A1^2 + A3^2) at 0.125 N, mm": 2.80790, "sqrt(A1^2 + A3^2) at 0.25 N, mm": 5.39603},
        right_by="harmonic balance written for this equation",
        note="The printed amplitudes are read from a table of frequencies.",
    ),
    Published(
        "Rigid friction", "code_aster, SDND100A", {}, sdnd100a,
        dict(zip(TURNED, (-0.65, 0.45, -0.25, 0.05), strict=True)),
        note="Each half cycle takes 2 F/k. A sticking stiffness, by which rigid friction is often replaced, changes "
        "the numbers: with 4e5 N/m the last one is 0.0522 mm.",
    ),
    Published(
        "Two bars", "code_aster, SDNL111A", dict(zip(BAR_TIMES, (-0.1, -0.2, -0.1, 0.0, 0.2), strict=True)), sdnl111a,
        dict(zip(BAR_TIMES, (-0.1, -0.194968353, -0.094968353, 0.010063294, 0.210063294), strict=True)),
        "waves of the continuous bars, rigid contact",
        "Rounded reference: it takes 0.2 ms for the passage of a wave through a bar, which is 0.19749 ms. Differences "
        "are relative to 0.2 mm.",
        "Another model: 60 masses stand for each bar, and the contact has a stiffness. With more masses the difference "
        "becomes smaller.", 0.2,
        "The lengths of 1 m are inferred from the times. The source counts displacements against the motion.",
    ),
    Published(
        "Oscillator with a rigid stop", "M. D. Todd and L. N. Virgin (1996)", {}, todd_virgin,
        {"f/f0 at d/A = 0.5": 1.5, "f/f0 at d/A = -0.5": 3.0},
        note="The stop here has 1e8 times the stiffness of the spring; its contact time of pi/1e4 makes the "
        "difference.",
    ),
    Published(
        "Impact oscillator", "C. J. Budd and F. Dux, one impact in a period of the force", {}, budd_dux,
        {f"impact speed, {name}": orbit[4] for name, orbit in IMPACT_ORBITS.items()},
        note="A stop of 1e8 N/m with a dashpot of the same restitution r stands for the rigid one. The motions begin "
        "on the periodic ones; the speed is that of the second impact.",
    ),
    Published(
        "Ball on a damped ground", "Exudyn, contactCoordinateTest",
        {"height at 0.25 s + 50 mm, mm": 55.3132}, contact_coordinate,
        {"height at 0.25 s + 50 mm, mm": 55.67445308543, "event 1, s": 0.100963755469, "event 2, s": 0.102088934298,
         "event 3, s": 0.23066950195, "event 4, s": 0.23179649921},
        note="The printed number is a regression value whose time step is not converged; it is off by 0.65 %.",
    ),
    Published(
        "Ball on an elastic ground", "Exudyn, postNewtonStepContactTest",
        {"height at 0.5 s + 50 mm, mm": 57.2866}, post_newton,
        {"height at 0.5 s + 50 mm, mm": 60.939776065, "flight, s": 0.222978447494},
        why="Error of the reference: its time step of 5 ms is about half a contact, and is not converged. The closed "
        "form is right.",
    ),
    Published(
        "Virtual RubBeR rig", "NLtest, BT01", {"stuck, mode 1, Hz": 80.36780}, rubber,
        {**_numbered("stuck", "Hz", (80.3673923, 452.780188, 1204.09252)),
         **_numbered("sliding", "Hz", (67.9601817, 425.899189, 1192.53006))}, "continuous beam",
        note="Only the stuck frequency is printed. Both models here have 14 elements.",
    ),
    Published(
        "Elastic gap", "Modelica standard library, Translational ElastoGap (reference results of MAP-LIB)",
        {"speed of the first flight, m/s": -3.42715020688, "s = 0.5 m at, s": 0.583372760,
         "s = -0.5 m at, s": 0.875160380, "s(0.95 s), m": -0.75171559}, elasto_gap,
        why="Another law: the source limits the force to twice the elastic one, so that it does not jump at touch. "
        "beamsim does not have this law; the value is that of `no_tension`.",
        note="Up to the end of the first flight both laws are the same.",
    ),
    Published(
        "Elastoplastic mass", "R. W. Clough and J. Penzien, Dynamics of structures (the frame of its example)", {},
        clough_penzien,
        dict(zip(TENTHS, (0.0774005919, 0.5182094375, 1.2919072273, 2.0386636787, 2.5564023851, 2.7212337881,
                          2.5024450982, 1.9827565477, 1.3711336154, 0.9360662586), strict=True)),
        "independent integration from event to event",
        note="m 0.1, k 5, c 0.2, yield force 6; the force is linear between tenths of a second. The book's own table "
        "of steps was not at hand.",
    ),
    Published(
        "Clutch with a mean torque", "C. Duan and R. Singh (2008)", {}, clutch,
        dict(zip((f"period doubling {k}, Hz" for k in range(1, 5)), (0.0645718328, 0.0739642057, 0.1960483487,
                 0.3112454393), strict=True)),
        "independent integration, multiplier -1",
        note="The paper prints no numbers at hand, and claims that a subharmonic branch is isolated. Here the motions "
        "of twice the period begin at these frequencies.",
    ),
    Published(
        "Tube in four supports", "code_aster, SDNL301A", {TUBE_FORCES[3]: 23.9803}, tube_forces,
        tube_by_steps(),
        "independent integration",
        "Another model, and a time step that is not converged: the source keeps the 30 lowest modes and no static "
        "response of the stops, and has the shear of the tube.",
        "Another model: with 30 modes the independent integration has no static response of the stops, as the source; "
        "beamsim adds it, and agrees with the integration with all modes.",
        note="Root mean squares from 0.17 to 0.25 s, recorded. The 44 forces act at 11 points inside each span. "
        "The stops' forces depend on the modes that are kept: with 20, 30, 40 and 60 modes alone the independent "
        "integration gives 23.3, 24.2, 23.0 and 22.7 N at the tip. beamsim has 30 modes and static vectors.",
    ),
    Published(
        "VIbeams", "University of Stuttgart, doi 10.18419/darus-4501, measured",
        {**_numbered("left", "Hz", (30.95, 199.04, 556.82, 1085.93)),
         **_numbered("right with leaf", "Hz", (28.2, 205.54, 277.74, 594.98, 1168.62))}, vibeams,
        {**_numbered("left", "Hz", (30.9444, 202.07, 560.66, 1090.50)),
         **_numbered("right with leaf", "Hz", (28.401, 208.87, 273.86, 588.79, 1124.3))},
        "independent Euler-Bernoulli code",
        "Another model: the rig has a bolted block and a glued plate; one fitted factor stands for each in all modes. "
        "The independent code with the same factors gives the computed numbers.",
        note="[The page of VIbeams](../vibeams.md) has the model and predicted amplitudes. Measured amplitudes were "
        "not at hand.",
    ),
)  # fmt: skip

NOT_COMPUTED = {
    "code_aster, SDND125E (three masses, friction whose limit grows with the accumulated slip)":
        "A slip force that depends on the accumulated slip does not exist in beamsim.",
    "NUREG/CR-1677, volume 1, problem 1 (pipe with two elbows)":
        "Bodies in three dimensions with curved pipes do not exist in beamsim; it could only import their matrices.",
    "Modelica ElastoGap and Backlash after the first flight, with the law of the source":
        "The law of the force, limited to twice the elastic one, does not exist in beamsim.",
    "VIbeams, amplitudes and damping": "The measured values are in data files that were not at hand.",
    "Thesis of H. Hazim, six masses with a cubic spring (period of 3.93 s)": "Its energy is not printed, and the "
        "period depends on it.",
}  # fmt: skip
