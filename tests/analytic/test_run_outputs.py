"""Reactions, joint forces, moments, strains and energies of a run: closed forms, balances, independent integration."""

import numpy as np
import pytest

import beamsim
from beamsim.flow.exact import exact_flow
from beamsim.flow.transient import simulate
from beamsim.scenario import load_scenario
from beamsim.store.results import load, write_result
from beamsim.structures.places import UPWARDS
from beamsim.system.build import build_system
from beamsim.system.reduced_model import build_reduced_model
from tests.helpers.observed import rows
from tests.helpers.spectra import spectrum_of

BEAM = {"length": 0.8, "width": 0.05, "thickness": 0.01, "youngs_modulus": 70e9, "density": 2700.0, "elements": 6}
EI, LINE = 70e9 * 0.05 * 0.01**3 / 12, 2700 * 0.05 * 0.01
QUIET = {"duration": 0.01, "sample_rate": 2000.0, "convergence": "off"}
SHAKEN = {"kind": "harmonic", "applied_to": "base", "level": 30.0, "frequency": 31.0}


def held(left, right, **more):
    return {**BEAM, "supports": {"left": left, "right": right}, **more}


def support(kind, name, **more):
    return {"name": f"{kind}_{name}", "kind": f"reaction_{kind}", "support": name, **more}


def run(case, outputs, **settings):
    return beamsim.run(load_scenario({**case, "run": {**QUIET, **settings, "outputs": outputs}}))


def values(result):
    return {name: output.values[:] for name, output in result["histories"].by_label("output_value").items()}


def test_static_reactions_of_a_cantilever():
    force, x, mass = 20.0, 0.3, LINE * BEAM["length"]
    case = {"beam": held("clamped", "free"), "gravity": 9.81, "constant_forces": [{"position": x, "force": force}]}
    result = run(case, [support("force", "left"), support("moment", "left"), support("force", "base")])
    expected = mass * 9.81 - force
    assert result.summary["max_output"]["force_left"] == pytest.approx(expected, rel=1e-10)
    assert result.summary["min_output"]["force_base"] == pytest.approx(expected, rel=1e-10)
    # the clamp turns the beam up against its weight
    moment = mass * 9.81 * BEAM["length"] / 2 - force * x
    np.testing.assert_allclose(
        result["histories"]["output_value"].sel(output="moment_left").values[:], moment, rtol=1e-10
    )
    assert result["histories"]["output_unit"].sel(output="moment_left").item() == "N m"


@pytest.mark.parametrize("modes", ["all", 4])
def test_static_reactions_of_a_beam_clamped_at_both_ends(modes):
    """R = P b^2 (3 a + b) / L^3 and M = P a b^2 / L^2, also where the force acts within the element at the support."""
    length, force = BEAM["length"], 50.0
    for a in (0.05, 0.5):
        b = length - a
        case = {
            "beam": held("clamped", "clamped"),
            "constant_forces": [{"position": a, "force": -force}],
            "reduction": {"modes": modes},
        }
        names = [support(kind, end) for kind in ("force", "moment") for end in ("left", "right")]
        found = values(run(case, names))
        assert found["force_left"][0] == pytest.approx(force * b**2 * (3 * a + b) / length**3, rel=1e-9)
        assert found["force_right"][0] == pytest.approx(force * a**2 * (a + 3 * b) / length**3, rel=1e-9)
        assert found["moment_left"][0] == pytest.approx(force * a * b**2 / length**2, rel=1e-9)
        assert found["moment_right"][0] == pytest.approx(-force * a**2 * b / length**2, rel=1e-9)


CONTACT = {
    "bodies": {
        "inner": {"kind": "beam", **held("clamped", "free", damping={"kind": "modal", "ratio": 0.02})},
        "outer": {"kind": "beam", **held("free", {"stiffness": 4e4, "dashpot": 3.0}, length=0.5)},
    },
    "joints": [
        {
            "name": "hinge", "kind": "hinge", "rotational_stiffness": 30.0, "rotational_dashpot": 0.02,
            "between": [{"body": "inner", "position": 0.8}, {"body": "outer", "position": 0.0}],
        },
        {"name": "strut", "kind": "spring", "stiffness": 2e3, "dashpot": 1.0,
         "between": ["base", {"body": "inner", "position": 0.5}]},
    ],
    "snubbers": [
        {"name": "stop", "at": {"body": "outer", "position": 0.2}, "side": "both", "stiffness": 1e5, "gap": 2e-4,
         "damping": {"kind": "viscous", "coefficient": 5.0}},
        {"name": "earth", "at": {"body": "inner", "position": 0.7}, "side": "below", "stiffness": 1e5, "gap": 3e-4,
         "mounted_on": "ground"},
    ],
    "springs_to_ground": [
        {"name": "soft", "at": {"body": "outer", "position": 0.4}, "kind": "linear", "stiffness": 500.0}
    ],
    "constant_forces": [{"at": {"body": "outer", "position": 0.3}, "force": 4.0}],
    "gravity": 9.81,
    "excitation": SHAKEN,
    "reduction": {"modes": 8},
}  # fmt: skip
HOLDING = [
    support("force", "left", body="inner"),
    support("force", "right", body="outer"),
    {"name": "strut", "kind": "joint_force", "joint": "strut"},
    {"name": "soft", "kind": "joint_force", "joint": "soft"},
]


def test_sum_of_reactions_is_inertia_and_loads_with_contact():
    settings = {"duration": 0.2, "sample_rate": 4000.0, "outputs": [*HOLDING, support("force", "base")]}
    scenario = load_scenario({**CONTACT, "run": {**QUIET, **settings}})
    result = beamsim.run(scenario)
    found = values(result)
    assert result.summary["events"] > 20
    pushed = {"stop.below": 1.0, "stop.above": -1.0, "earth": 1.0}
    push = {
        name: sign * result["histories"]["snubber_force"].sel(snubber=name).values[:] for name, sign in pushed.items()
    }
    parts, system = build_reduced_model(scenario), build_system(scenario)
    flow = exact_flow(system, 0.2)
    trajectory = simulate(flow, system.initial_state)
    inertia = trajectory.sample(
        result["histories"]["time"].values[:], rows(flow, 1, acceleration=parts.base_load(UPWARDS)[0])
    )[:, 0]
    mass = LINE * 1.3
    total = inertia + mass * (system.base[0].acceleration(result["histories"]["time"].values[:]) + 9.81) - 4.0
    holding = sum(found[name] for name in ("force_left", "force_right", "strut", "soft")) + sum(push.values())
    scale = np.abs(total).max()
    np.testing.assert_allclose(holding, total, atol=1e-10 * scale)
    base = found["force_left"] + found["force_right"] + found["strut"] + push["stop.below"] + push["stop.above"]
    np.testing.assert_allclose(found["force_base"], base, atol=1e-10 * scale)


def test_spring_support_and_spring_joint_pull_by_their_stretch():
    """With all modes the force that follows from equilibrium is that of stiffness and dashpot."""
    at = {"body": "outer", "position": 0.5}
    more = [
        {"name": "w", "kind": "displacement", "at": at}, {"name": "v", "kind": "velocity", "at": at},
        {"name": "s", "kind": "displacement", "at": {"body": "inner", "position": 0.5}},
        {"name": "r", "kind": "velocity", "at": {"body": "inner", "position": 0.5}},
        {"name": "slope_in", "kind": "rotation", "at": {"body": "inner", "position": 0.8}},
        {"name": "slope_out", "kind": "rotation", "at": {"body": "outer", "position": 0.0}},
        {"name": "moment", "kind": "joint_moment", "joint": "hinge"},
    ]  # fmt: skip
    case = {**CONTACT, "reduction": {"modes": "all"}}
    case["bodies"] = {
        name: {k: v for k, v in body.items() if k != "damping"} for name, body in CONTACT["bodies"].items()
    }
    found = values(run(case, [*HOLDING, *more], duration=0.05))
    pull = -4e4 * found["w"] - 3.0 * found["v"]
    np.testing.assert_allclose(found["force_right"], pull, atol=1e-8 * np.abs(pull).max())
    pull = -2e3 * found["s"] - found["r"]
    np.testing.assert_allclose(found["strut"], pull, atol=1e-7 * np.abs(pull).max())
    # without its dashpot, whose rate of rotation is no output
    turned = 30.0 * (found["slope_out"] - found["slope_in"])
    rate = np.gradient(turned / 30.0, 1 / 2000.0)
    assert np.abs(found["moment"] + turned + 0.02 * rate)[2:-2].max() < 0.2 * np.abs(0.02 * rate).max()


@pytest.mark.parametrize("modes", ["all", 6])
def test_joint_of_a_cut_beam_carries_shear_and_moment_of_the_uncut_one(modes):
    length, cut = 0.8, 0.32
    common = {"excitation": SHAKEN, "gravity": 9.81, "reduction": {"modes": modes}}
    stop = {"name": "s", "side": "below", "stiffness": 2e5, "gap": 1e-4}
    points, weights = np.polynomial.legendre.leggauss(4)
    x = (cut + (length - cut) / 12 * (np.arange(12)[:, None] + (points + 1) / 2)).ravel()
    uncut = held("clamped", "free", elements=20, nodes=[cut])
    outputs = [{"name": f"a{k}", "kind": "acceleration", "position": float(at)} for k, at in enumerate(x)]
    outputs.append({"name": "moment", "kind": "bending_moment", "position": cut})
    whole = run({**common, "beam": uncut, "snubbers": [{**stop, "position": length}]}, outputs, duration=0.1)
    halves = {
        "inner": {"kind": "beam", **held("clamped", "free", length=cut, elements=8)},
        "outer": {"kind": "beam", **held("free", "free", length=length - cut, elements=12)},
    }
    joint = {
        "name": "cut",
        "kind": "rigid",
        "between": [{"body": "inner", "position": cut}, {"body": "outer", "position": 0}],
    }
    asked = [
        {"name": "force", "kind": "joint_force", "joint": "cut"},
        {"name": "moment", "kind": "joint_moment", "joint": "cut"},
    ]
    stops = [{**stop, "at": {"body": "outer", "position": length - cut}}]
    two = run({**common, "bodies": halves, "joints": [joint], "snubbers": stops}, asked, duration=0.1)
    found, one = values(two), values(whole)
    assert two.summary["events"] == whole.summary["events"] > 4
    weight = np.tile(weights, 12) * (length - cut) / 24
    outboard = LINE * sum(w * one[f"a{k}"] for k, w in enumerate(weight)) + LINE * (length - cut) * 9.81
    shear = outboard - whole["histories"]["snubber_force"].sel(snubber="s").values[:]
    np.testing.assert_allclose(found["force"], shear, atol=1e-8 * np.abs(shear).max())
    if modes == "all":  # else moments are recovered from displacements of few modes, forces from accelerations
        # the moment on the outer half's left end is -E I w''
        np.testing.assert_allclose(found["moment"], -one["moment"], atol=2e-6 * np.abs(one["moment"]).max())


def test_energies_of_bodies_add_up_to_what_is_stored():
    case = {key: value for key, value in CONTACT.items() if key not in ("springs_to_ground", "snubbers")}
    case["joints"] = [{**CONTACT["joints"][0], "rotational_stiffness": 0.0, "rotational_dashpot": 0.0}]
    names = [{"name": f"{kind}_{body}", "kind": f"{kind}_energy", "body": body}
             for kind in ("kinetic", "strain") for body in ("inner", "outer")]  # fmt: skip
    result = run(case, names, duration=0.1)
    found = values(result)
    stored = result["histories"]["energy_stored"].values[:]
    np.testing.assert_allclose(sum(found.values()), stored, rtol=1e-10)
    for name, history in found.items():
        assert result.summary["max_output"][name] >= history.max() * (1 - 1e-12)
        assert result.summary["max_output"][name] <= history.max() * 1.01
    assert "kinetic_inner" not in result.summary["rms_output"]


def test_strain_and_stress_at_the_surfaces():
    case = {"beam": held("clamped", "free"), "gravity": 9.81}
    outputs = [
        {"name": "moment", "kind": "bending_moment", "position": 0.1},
        {"name": "top", "kind": "stress", "position": 0.1},
        {"name": "gauge", "kind": "strain", "position": 0.1, "surface": "bottom"},
    ]
    found = values(run(case, outputs))
    moment = -LINE * 9.81 * 0.7**2 / 2
    np.testing.assert_allclose(found["moment"], moment, rtol=1e-9)
    np.testing.assert_allclose(found["top"], -moment * 0.005 / (EI / 70e9), rtol=1e-9)  # tension on top as it hangs
    np.testing.assert_allclose(found["gauge"], moment * 0.005 / EI, rtol=1e-9)


def test_plate_carries_its_weight_to_edges_and_points():
    plate = {
        "kind": "plate", "length": 0.4, "width": 0.3, "thickness": 0.003, "youngs_modulus": 70e9, "poissons_ratio": 0.3,
        "density": 2700.0, "elements": [6, 6],
        "supports": {"left": "clamped", "bottom": "pinned", "points": [{"position": [0.4, 0.3]}]},
    }  # fmt: skip
    names = ["left", "bottom", "point 1"]
    found = values(
        run({"bodies": {"panel": plate}, "gravity": 9.81}, [support("force", name) for name in [*names, "base"]])
    )
    weight = 0.4 * 0.3 * 0.003 * 2700 * 9.81
    assert sum(found[f"force_{name}"][0] for name in names) == pytest.approx(weight, rel=1e-10)
    assert found["force_base"][0] == pytest.approx(weight, rel=1e-10)
    assert min(found[f"force_{name}"][0] for name in names) > 0.05 * weight


@pytest.mark.parametrize("cubic", [False, True])
def test_time_stepping_gives_the_same_outputs(cubic):
    case = {**CONTACT, "excitation": {**SHAKEN, "frequency": 60.0}}
    outputs = [*HOLDING, support("force", "base"), {"name": "T", "kind": "kinetic_energy", "body": "outer"}]
    if not cubic:
        settings = {"duration": 0.01, "sample_rate": 4000.0}
        exact, stepped = (run(case, outputs, **settings, **more) for more in (
            {}, {"method": "reference", "integrator": "DOP853", "rtol": 1e-9}))  # fmt: skip
        for name, value in values(exact).items():
            np.testing.assert_allclose(
                stepped["histories"]["output_value"].sel(output=name).values[:], value, atol=1e-6 * np.abs(value).max()
            )
            assert stepped.summary["peak_output"][name] == pytest.approx(exact.summary["peak_output"][name], rel=1e-4)
        return
    # of a spring as stiff as a linear one at rest, the pull goes to the supports beside
    chain = {
        "chain": {"masses": [1.0, 2.0], "springs": [100.0, 50.0, 80.0],
                  "springs_to_ground": [{"mass": 2, "kind": "cubic", "stiffness": 4e3}]},
        "excitation": {**SHAKEN, "applied_to": {"mass": 1}, "level": 20.0, "frequency": 1.0},
        "probes": [{"name": "one", "mass": 1}, {"name": "two", "mass": 2}],
    }  # fmt: skip
    result = run(chain, [support("force", "left"), support("force", "right")], duration=2.0, sample_rate=100.0)
    one, two = (
        result["histories"]["displacement"].sel(probe="one").values[:],
        result["histories"]["displacement"].sel(probe="two").values[:],
    )
    np.testing.assert_allclose(
        result["histories"]["output_value"].sel(output="force_left").values[:],
        -100.0 * one,
        atol=1e-8 * 100 * np.abs(one).max(),
    )
    np.testing.assert_allclose(
        result["histories"]["output_value"].sel(output="force_right").values[:],
        -80.0 * two,
        atol=1e-8 * 80 * np.abs(two).max(),
    )


def test_outputs_come_back_from_the_file_with_spectra_and_densities(tmp_path):
    case = dict(CONTACT)
    case["excitation"] = {
        "kind": "random",
        "applied_to": "base",
        "psd": [{"frequency": f, "density": 0.5} for f in (10.0, 100.0)],
        "seed": 1,
    }
    outputs = [support("force", "left", body="inner"), {"name": "T", "kind": "kinetic_energy", "body": "outer"}]
    result = run(case, outputs, duration=0.25, sample_rate=2000.0)
    write_result(result, tmp_path / "r.h5")
    read = load(tmp_path / "r.h5")
    for name in ("force_left", "T"):
        np.testing.assert_array_equal(
            read["histories"]["output_value"].sel(output=name).values[:],
            result["histories"]["output_value"].sel(output=name).values[:],
        )
        assert (
            read["histories"]["output_unit"].sel(output=name).item()
            == result["histories"]["output_unit"].sel(output=name).item()
        )
    spectrum = spectrum_of(read, "reaction_force", "force_left")
    assert spectrum.rms == result.summary["rms_output"]["force_left"]
    of_force, of_energy = (read["random"].sel(signal=of) for of in ("force_left reaction_force", "T kinetic_energy"))
    assert (of_force["unit"].item(), of_force["density"].unit, of_force["rms"].unit) == ("N", "(N)^2/Hz", "N")
    assert of_energy["density"].values.size == read["random"]["frequency_hz"].values.size


@pytest.mark.parametrize(
    ("line", "shape", "total", "lever"),
    [
        ("whole", {"kind": "uniform"}, 0.8, 0.4),
        ([0.2, "75 %"], {"kind": "uniform"}, 0.4, 0.4),
        ("whole", {"kind": "linear", "values": [0, 1]}, 0.4, 1.6 / 3),
    ],
)
def test_dead_load_along_a_beam(line, shape, total, lever):
    """Reactions of a cantilever in closed form, and those of a stop that the load presses on."""
    dead = [{"line": line, "force_per_length": "-50 N/m", "shape": shape}]
    case = {"beam": held("clamped", "free"), "constant_forces": dead}
    found = values(run(case, [support("force", "left"), support("moment", "left"),
                              {"name": "tip", "kind": "displacement", "position": 0.8}]))  # fmt: skip
    np.testing.assert_allclose(found["force_left"], 50 * total, rtol=1e-10)
    np.testing.assert_allclose(found["moment_left"], 50 * total * lever, rtol=1e-10)
    if line == "whole":
        tip = {0.8: 1 / 8, 0.4: 11 / 120}[total]
        np.testing.assert_allclose(found["tip"], -50 * 0.8**4 / EI * tip, rtol=1e-9)
    stop = {"name": "s", "position": 0.8, "side": "below", "stiffness": 1e12, "gap": 0.0}
    propped = run({**case, "snubbers": [stop]}, [support("force", "left")])
    prop = propped.summary["static_force_n"]["s"]
    if line == "whole":
        assert prop == pytest.approx(50 * 0.8 * {0.8: 3 / 8, 0.4: 11 / 40}[total], rel=1e-6)
    np.testing.assert_allclose(values(propped)["force_left"], 50 * total - prop, rtol=1e-6)


ORTHOTROPIC = {"dx": 400.0, "dy": 150.0, "nu": 0.25, "dxy": 90.0}


@pytest.mark.parametrize("orthotropic", [False, True])
def test_strains_of_a_plate_under_a_dead_pressure(orthotropic):
    """w = W sin sin of a plate pinned along its edges under p sin sin; strains -z w_xx, -z w_yy and -2 z w_xy."""
    a, b, h, pressure = 0.5, 0.3, 0.004, 300.0
    common = {"kind": "plate", "length": a, "width": b, "thickness": h, "elements": [10, 8],
              "supports": dict.fromkeys(("left", "right", "bottom", "top"), "pinned")}  # fmt: skip
    d = 70e9 * h**3 / 12 / (1 - 0.3**2)
    dx, dy, nu, dxy = (400.0, 150.0, 0.25, 90.0) if orthotropic else (d, d, 0.3, d * 0.35)
    panel = (
        {**common, "bending_stiffness": ORTHOTROPIC, "mass_per_area": 8.0}
        if orthotropic
        else {**common, "youngs_modulus": 70e9, "poissons_ratio": 0.3, "density": 2700.0}
    )
    shape = {"kind": "sine", "half_waves": [1, 1]}
    case = {"bodies": {"panel": panel},
            "constant_forces": [{"area": "whole", "pressure": f"{pressure} Pa", "shape": shape}]}  # fmt: skip
    at = {"position": [0.2, 0.075]}  # nodes of the mesh
    outputs = [
        *({"name": f"strain_{c}", "kind": "strain", "component": c, **at} for c in ("x", "y", "xy")),
        {"name": "below", "kind": "strain", "surface": "bottom", **at},
        {"name": "w", "kind": "displacement", **at},
        *(support("force", edge) for edge in ("left", "right", "bottom", "top")),
        {"name": "base", "kind": "reaction_force", "support": "base"},
    ]
    found = {name: value[0] for name, value in values(run(case, outputs)).items()}
    kx, ky = np.pi / a, np.pi / b
    size = pressure / (dx * kx**4 + 2 * (nu * dy + 2 * dxy) * kx**2 * ky**2 + dy * ky**4)
    w = size * np.sin(kx * 0.2) * np.sin(ky * 0.075)
    assert found["w"] == pytest.approx(w, rel=1e-4)
    assert found["strain_x"] == pytest.approx(h / 2 * kx**2 * w, rel=2e-3)
    assert found["strain_y"] == pytest.approx(h / 2 * ky**2 * w, rel=2e-3)
    assert found["strain_xy"] == pytest.approx(-h * kx * ky * size * np.cos(kx * 0.2) * np.cos(ky * 0.075), rel=2e-3)
    assert found["below"] == -found["strain_x"]
    assert found["base"] == pytest.approx(-pressure * a * b * 4 / np.pi**2, rel=1e-9)
