"""Bodies that joints make one structure: against one body, closed forms, and matrices assembled by hand."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

import beamsim
from beamsim.errors import ScenarioError
from beamsim.scenario import load_scenario
from beamsim.store.results import load, write_result
from beamsim.structures.assembly import assemble
from beamsim.system.build import build_system
from beamsim.system.reduced_model import build_reduced_model

BEAM = {"kind": "beam", "width": 0.05, "thickness": 0.01, "youngs_modulus": 70e9, "density": 2700.0}
EI, MASS = 70e9 * 0.05 * 0.01**3 / 12, 2700 * 0.05 * 0.01
SHAKEN = {
    "excitation": {"kind": "harmonic", "applied_to": "base", "level": 3.0, "frequency": 20.0},
    "run": {"duration": 0.2, "sample_rate": 4000.0, "convergence": "off"},
}


def at(body, position):
    return {"body": body, "position": position}


def beam(length, elements=10, left="free", right="free", **more):
    return {**BEAM, "length": length, "elements": elements, "supports": {"left": left, "right": right}, **more}


def joined(bodies, joints, **more):
    return {"bodies": bodies, "joints": joints, "reduction": {"modes": "all"}, **more}


def frequencies(case):
    return build_system(load_scenario(case)).modes["open_frequencies_hz"].values


def span_frequencies(roots, length):
    return np.asarray(roots) ** 2 * np.sqrt(EI / MASS) / (2 * np.pi * length**2)


def test_modes_that_beams_of_one_element_carry():
    """The bound on the modes of such a beam is above their number even at a frequency of zero."""
    bodies = {"one": beam(0.5, 1, "clamped"), "two": beam(0.5, 1)}
    joints = [{"kind": "rigid", "between": [at("one", "100 %"), at("two", "0 %")]}]
    structure = assemble(load_scenario(joined(bodies, joints)))
    assert structure.most_modes >= structure.size // 2


@pytest.mark.parametrize("modes", ["all", 6])
def test_beam_cut_in_two_and_joined_rigidly_is_the_same(modes):
    damping = {"damping": {"kind": "modal", "ratio": [0.02, 0.01]}}
    stop = {"name": "s", "side": "both", "stiffness": 1e4, "gap": 1e-3}
    common = {**SHAKEN, "gravity": 9.81, "reduction": {"modes": modes}}
    whole = {key: value for key, value in beam(1.0, 20, "clamped", **damping).items() if key != "kind"}
    one = {
        **common,
        "beam": whole,
        "snubbers": [{**stop, "position": "100 %"}],
        "probes": [{"name": "p", "position": 0.8}],
    }
    two = {
        **common,
        "bodies": {"a": beam(0.5, 10, "clamped", **damping), "b": beam(0.5, **damping)},
        "joints": [{"kind": "rigid", "between": [at("a", 0.5), at("b", 0.0)]}],
        "snubbers": [{**stop, "at": at("b", "100 %")}],
        "probes": [{"name": "p", "at": at("b", "60 %")}],
    }
    first, second = (beamsim.run(load_scenario(case)) for case in (one, two))
    assert second.summary["contacts"] == first.summary["contacts"]
    assert first.summary["contacts"]["s.below"] >= 2
    for name in ("open_frequencies_hz", "damping_ratios"):
        np.testing.assert_allclose(second["modes"][name], first["modes"][name], rtol=1e-10)
    scale = np.abs(first["histories"]["displacement"].sel(probe="p").values).max()
    np.testing.assert_allclose(
        second["histories"]["displacement"].sel(probe="p").values,
        first["histories"]["displacement"].sel(probe="p").values,
        atol=1e-10 * scale,
    )
    alone, parts = (result["bodies"].groups("station_body") for result in (first, second))
    stress = [body["peak_bending_stress"].values for body in (*alone.values(), *parts.values())]
    np.testing.assert_allclose(
        np.concatenate([stress[1], stress[2][1:]]), stress[0], rtol=0, atol=1e-8 * stress[0].max()
    )


def test_two_span_beam_over_a_support_in_the_middle():
    """Antisymmetric modes are those of a pinned span, symmetric ones those of a clamped-pinned span."""
    spans = {"a": beam(0.6, 20, "pinned"), "b": beam(0.6, 20, right="pinned")}
    joints = [
        {"kind": "rigid", "between": [at("a", 0.6), at("b", 0.0)]},
        {"kind": "hinge", "between": [at("b", 0.0), "base"]},
    ]
    clamped = [brentq(lambda b: np.tan(b) - np.tanh(b), (n + 0.1) * np.pi, (n + 0.4) * np.pi) for n in (1, 2)]
    expected = np.sort(np.concatenate([span_frequencies([np.pi, 2 * np.pi], 0.6), span_frequencies(clamped, 0.6)]))
    np.testing.assert_allclose(frequencies(joined(spans, joints))[:4], expected, rtol=2e-5)


def test_hinge_in_the_middle_of_a_clamped_beam():
    """No moment at the hinge: symmetric modes are cantilevers', antisymmetric ones those of clamped-pinned beams."""
    halves = {"a": beam(0.6, 20, "clamped"), "b": beam(0.6, 20, right="clamped")}
    joints = [{"name": "middle", "kind": "hinge", "between": [at("a", "100 %"), at("b", "0 %")]}]
    system = build_system(load_scenario(joined(halves, joints)))
    cantilever = [brentq(lambda b: np.cos(b) * np.cosh(b) + 1, *ends) for ends in ((1.5, 2.0), (4.5, 4.9))]
    pinned = [brentq(lambda b: np.tan(b) - np.tanh(b), (n + 0.1) * np.pi, (n + 0.4) * np.pi) for n in (1, 2)]
    expected = np.sort(np.concatenate([span_frequencies(cantilever, 0.6), span_frequencies(pinned, 0.6)]))
    np.testing.assert_allclose(system.modes["open_frequencies_hz"].values[:4], expected, rtol=2e-5)
    left, right = system.bodies
    largest = np.abs(left.bending_moment[:, :4]).max(axis=0)
    assert np.all(np.abs(left.bending_moment[-1, :4]) < 1e-7 * largest)
    assert np.all(np.abs(right.bending_moment[0, :4]) < 1e-7 * largest)


def test_rotational_spring_at_the_root_adds_its_compliance_and_its_dashpot_damps():
    """A tip force F bends the beam by F L^3 / 3 E I and turns the root by F L / k."""
    stiffness, dashpot, length = 200.0, 0.3, 0.8
    root = {"kind": "hinge", "rotational_stiffness": stiffness, "rotational_dashpot": dashpot}
    case = joined({"a": beam(length)}, [{**root, "between": [at("a", 0.0), "base"]}])
    case |= {"snubbers": [{"at": at("a", length), "side": "below", "stiffness": 1.0, "gap": 1.0}]}
    system = build_system(load_scenario(case))
    shape = system.snubbers[0].shape
    bent = shape / system.dynamics.stiffness  # by a force of 1 N
    assert shape @ bent == pytest.approx(length**3 / (3 * EI) + length**2 / stiffness, rel=1e-10)
    damping = system.dynamics.damping
    assert bent @ damping @ bent == pytest.approx(dashpot * (length / stiffness) ** 2, rel=1e-10)
    sizes = np.linalg.eigvalsh(damping)
    assert np.abs(sizes[:-1]).max() < 1e-12 * sizes[-1]  # of one dashpot


def test_spring_joint_and_springs_of_the_scenario_are_the_same():
    bodies = {"a": beam(0.5, left="clamped"), "b": beam(0.5, left="clamped")}
    ends = [at("a", 0.5), at("b", 0.35)]
    joint = frequencies(joined(bodies, [{"kind": "spring", "stiffness": 3e3, "between": ends}]))
    spring = {"kind": "linear", "stiffness": 3e3}
    np.testing.assert_allclose(
        frequencies({**joined(bodies, []), "springs_between": [{**spring, "between": ends}]}), joint, rtol=1e-12
    )
    to_base = frequencies(joined(bodies, [{"kind": "spring", "stiffness": 3e3, "between": [ends[0], "base"]}]))
    grounded = {**joined(bodies, []), "springs_to_ground": [{**spring, "at": ends[0]}], **SHAKEN}
    np.testing.assert_allclose(frequencies(grounded), to_base, rtol=1e-12)
    load = build_system(load_scenario(grounded)).forcing.load  # the ground stays where it is when the base moves
    assert load.shape[0] == 2


def test_modal_ratios_are_weighted_by_strain_energy():
    damping = [{"damping": {"kind": "modal", "ratio": ratio}} for ratio in (0.03, 0.01)]
    bodies = {"a": beam(0.5, 40, "clamped", **damping[0]), "b": beam(0.4, 40, **damping[1])}
    joint = {"kind": "hinge", "rotational_stiffness": 300.0, "between": [at("a", 0.5), at("b", 0.0)]}
    system = build_system(load_scenario(joined(bodies, [joint])))
    total = system.dynamics.stiffness
    shares = []
    for body in system.bodies:
        squared = CubicSpline(body.position, body.bending_moment**2)
        shares.append(squared.integrate(*body.position[[0, -1]]) / EI / total)
    expected = 0.03 * shares[0] + 0.01 * shares[1]  # the joint's spring has none
    np.testing.assert_allclose(system.modes["damping_ratios"].values[:4], expected[:4], rtol=1e-3)
    assert np.linalg.eigvalsh(system.dynamics.damping).min() > -1e-9 * np.abs(system.dynamics.damping).max()


def yoke():
    bodies = {
        "yoke": beam(0.3, left="clamped", damping={"kind": "modal", "ratio": 0.02}),
        "panel": beam(0.9, damping={"kind": "modal", "ratio": 0.01}),
        "alone": beam(0.7, left="clamped", damping={"kind": "modal", "ratio": 0.01}),
    }
    joint = {"kind": "hinge", "rotational_stiffness": 200.0, "between": [at("yoke", 0.3), at("panel", 0.0)]}
    return {
        "bodies": bodies,
        "joints": [joint],
        "snubbers": [
            {"name": "end", "at": at("panel", 0.9), "side": "both", "stiffness": 1e5, "preload": 2.0},
            {"name": "gap", "between": [at("alone", 0.7), at("panel", 0.4)], "stiffness": 1e4, "gap": 1e-3},
        ],
        "probes": [{"name": name, "at": at(name, 0.25)} for name in ("yoke", "panel", "alone")],
        **SHAKEN,
    }


def test_mechanism_is_refused_with_the_name_of_the_free_motion():
    case = yoke()
    del case["joints"][0]["rotational_stiffness"]
    stopped = build_system(load_scenario(case))
    assert any("joints[0] (joint_1) leaves panel free to turn there" in text for text in stopped.warnings)
    case["snubbers"] = []
    with pytest.raises(ScenarioError, match=r"joints\[0\] \(joint_1\) leaves panel free to turn there, and nothing"):
        build_system(load_scenario(case))


def test_floating_as_a_whole_is_no_mechanism():
    bodies = {"a": beam(0.5), "b": beam(0.5)}
    case = joined(bodies, [{"kind": "rigid", "between": [at("a", 0.5), at("b", 0.0)]}])
    whole = {key: value for key, value in beam(1.0, 20).items() if key != "kind"}
    together, expected = frequencies(case), frequencies({"beam": whole, "reduction": {"modes": "all"}})
    np.testing.assert_array_equal(together[:2], 0.0)
    np.testing.assert_allclose(together[2:], expected[2:], rtol=1e-10)


def test_points_that_do_not_lie_together_give_a_warning_with_their_distance():
    bodies = {"a": beam(0.5, left="clamped"), "b": beam(0.5)}
    joints = [
        {"kind": "spring", "stiffness": 1e4, "between": [at("a", x), at("b", y)]} for x, y in ((0.1, 0.0), (0.5, 0.38))
    ]
    (warning,) = load_scenario(joined(bodies, joints)).warnings
    assert "joints[1] joins points 20 mm apart" in warning
    joints[1]["between"][1] = at("b", 0.4)
    assert not load_scenario(joined(bodies, joints)).warnings


PLATE = {
    "kind": "plate", "length": 0.4, "width": 0.3, "thickness": 0.003, "youngs_modulus": 70e9, "poissons_ratio": 0.3,
    "density": 2700, "elements": [2, 2],
}  # fmt: skip


def test_a_plate_that_turns_about_its_joints_is_a_mechanism():
    bodies = {"panel": PLATE, "arm": beam(0.4, left="clamped"), "strut": beam(0.4, left="clamped")}
    ends = [at("panel", [0.0, 0.0]), at("panel", [0.0, 0.3])]
    joints = [
        {"kind": "hinge", "between": [end, at(body, 0.4)]} for end, body in zip(ends, ("arm", "strut"), strict=True)
    ]
    case = joined(bodies, joints)
    with pytest.raises(ScenarioError) as caught:
        build_system(load_scenario(case))
    for text in ("joints[0] (joint_1)", "joints[1] (joint_2)"):
        assert f"{text} leaves panel free to turn or slide there, most at (0.4, " in str(caught.value)
    case["snubbers"] = [{"name": "end", "at": at("panel", [0.4, 0.15]), "side": "both", "stiffness": 1e4, "preload": 1}]
    assert any(
        "snubbers or nonlinear springs alone stop" in text for text in build_system(load_scenario(case)).warnings
    )
    case["joints"].append({"kind": "hinge", "between": [at("panel", [0.4, 0.15]), "base"]})
    case["snubbers"] = []
    assert not any("free to turn" in text for text in build_system(load_scenario(case)).warnings)


@pytest.mark.parametrize(
    ("bodies", "where"),
    [
        ({"panel": {**PLATE, "supports": {"left": "pinned"}}}, "panel moves freely, most at (0.4, "),
        ({"arm": beam(0.4, left="pinned")}, "arm moves freely, most at 0.4 m"),
        ({"arm": beam(0.4, left="clamped"), "masses": {"kind": "chain", "masses": [1.0, 2.0], "springs": [0.0, 1e4]}},
         "masses moves freely, most at mass "),
    ],
)  # fmt: skip
def test_a_structure_without_equilibrium_names_what_moves(bodies, where):
    case = joined(bodies, [])
    case["excitation"], case["run"] = {"kind": "none"}, {"duration": 0.1, "start": "static_equilibrium"}
    with pytest.raises(ScenarioError, match="the structure floats") as caught:
        build_system(load_scenario(case))
    assert where in str(caught.value)


@pytest.mark.parametrize(("plates", "reach"), [(1, 280), (2, 330)])
def test_a_loop_of_plates_and_beams_that_does_not_close_is_said(plates, reach):
    """Of three and four bodies; a triangle of other angles closes."""
    panel = {**PLATE, "supports": {"left": "clamped"}}
    names = ["panel", "second", "arm", "strut"] if plates == 2 else ["panel", "arm", "strut"]
    bodies = {"panel": panel, "second": PLATE, "arm": beam(0.4), "strut": beam(0.4)}
    spans = {
        "panel": [[0.4, 0.0], [0.0, 0.0]],
        "second": [[0.0, 0.1], [0.04, 0.13]],
        "arm": [0.0, 0.2],
        "strut": [0.0, 0.08],
    }
    joints = [
        {"kind": "hinge", "between": [at(one, spans[one][1]), at(other, spans[other][0])]}
        for one, other in zip(names, names[1:] + names[:1], strict=True)
    ]
    case = joined({name: bodies[name] for name in names}, joints)
    held = {"arm": [0.1, 0.3], "strut": [0.1, 0.3], "second": [[0.0, 0.3], [0.4, 0.0], [0.4, 0.3]]}
    case["springs_to_ground"] = [
        {"kind": "linear", "stiffness": 1e3, "at": at(name, x)} for name in names[1:] for x in held[name]
    ]
    (warning,) = [text for text in build_system(load_scenario(case)).warnings if "loop" in text]
    assert f"joints[0] and joints[{len(names) - 1}] lie 400 mm from each other on panel" in warning
    assert f"between them reach {reach} mm: the loop stays open by {400 - reach} mm" in warning
    joints[-1]["between"][0] = at("strut", 0.21)
    assert not any("loop" in text for text in build_system(load_scenario(case)).warnings)


def test_mass_of_a_chain_hinged_to_a_beam_is_a_point_mass():
    bodies = {"a": beam(0.5, left="clamped"), "c": {"kind": "chain", "masses": [0.3], "springs": [0.0]}}
    case = joined(bodies, [{"kind": "hinge", "between": [at("a", 0.5), {"body": "c", "mass": 1}]}])
    alone = {key: value for key, value in bodies["a"].items() if key != "kind"}
    alone["point_masses"] = [{"position": 0.5, "mass": 0.3}]
    expected = frequencies({"beam": alone, "reduction": {"modes": "all"}})
    np.testing.assert_allclose(frequencies(case), expected, rtol=1e-9)


def test_start_of_a_beam_that_is_joined_to_the_base():
    plain = {key: value for key, value in beam(0.5, left="pinned").items() if key != "kind"}
    held = {"kind": "rigid", "between": [{"position": 0.0}, "base"]}
    run = {"duration": 0.01, "sample_rate": 4000.0, "start": {"displacement": [0.0, 0.0, 0.01]}}
    clamped = {**plain, "supports": {"left": "clamped", "right": "free"}}
    probes = [{"name": "tip", "position": 0.5}]
    joint, support = (
        beamsim.run(
            load_scenario({"beam": body, "joints": joints, "run": run, "probes": probes, "reduction": {"modes": "all"}})
        )
        for body, joints in ((plain, [held]), (clamped, []))
    )
    tip = support["histories"]["displacement"].sel(probe="tip").values
    assert tip[0] == pytest.approx(0.01 * 0.25, rel=1e-6)
    np.testing.assert_allclose(
        joint["histories"]["displacement"].sel(probe="tip").values, tip, atol=1e-9 * np.abs(tip).max()
    )


def test_start_of_bodies_that_are_joined():
    case = yoke() | {"snubbers": [], "reduction": {"modes": "all"}}
    rise = 0.01 / 0.09
    bodies = {"yoke": {"displacement": [0.0, 0.0, rise]}, "panel": {"displacement": [0.01, 0.02]}}
    case["run"] = {"duration": 0.01, "sample_rate": 2000.0, "start": {"bodies": bodies}}
    result = beamsim.run(load_scenario(case))
    assert result["histories"]["displacement"].sel(probe="yoke").values[0] == pytest.approx(rise * 0.25**2, rel=1e-9)
    assert result["histories"]["displacement"].sel(probe="panel").values[0] == pytest.approx(
        0.01 + 0.02 * 0.25, rel=1e-9
    )
    assert abs(result["histories"]["displacement"].sel(probe="alone").values[0]) < 1e-15
    assert not any("relative error" in warning for warning in result.warnings)


def test_piecewise_linear_spring_at_a_point_is_a_pair_of_stops_on_the_ground():
    spring = {"name": "s", "kind": "piecewise_linear", "breakpoints": [-1e-3, 1e-3], "stiffnesses": [1e4, 0.0, 1e4]}
    stop = {"name": "s", "side": "both", "mounted_on": "ground", "stiffness": 1e4, "gap": 1e-3}
    case = {**yoke(), "snubbers": [], "reduction": {"modes": 8}}
    with_spring = beamsim.run(load_scenario(case | {"springs_to_ground": [{**spring, "at": at("panel", "80 %")}]}))
    with_stops = beamsim.run(load_scenario(case | {"snubbers": [{**stop, "at": at("panel", "80 %")}]}))
    assert sum(with_stops.summary["contacts"].values()) >= 2
    expected = with_stops["histories"]["displacement"].sel(probe="panel").values
    np.testing.assert_allclose(
        with_spring["histories"]["displacement"].sel(probe="panel").values, expected, atol=1e-9 * np.abs(expected).max()
    )


def test_position_as_a_share_of_the_length():
    case = load_scenario(yoke() | {"probes": [{"name": "p", "at": at("panel", "60 %")}]})
    assert case.all_bodies["panel"].point_of(case.effective_probes[0].place) == pytest.approx(0.54)
    assert load_scenario(case.to_yaml()) == case
    with pytest.raises(ScenarioError, match=r"probes\[0\].at.position = 0.99 m lies beyond"):
        load_scenario(yoke() | {"probes": [{"name": "p", "at": at("panel", "110 %")}]})


@pytest.mark.parametrize("spring", [0.0, 150.0])
def test_energies_of_modes_are_those_of_the_bodies_and_of_the_springs_between(spring, tmp_path):
    """Of every coordinate: kinetic energies add up, and what strain energy the bodies lack is in the hinge's spring."""
    ends = [at("a", 0.4), at("b", 0.0)]
    case = joined(
        {"a": beam(0.4, 8, "clamped"), "b": beam(0.6, 12)},
        [{"name": "h", "kind": "hinge", "between": ends, "rotational_stiffness": spring}],
        snubbers=[{"name": "s", "at": at("b", 0.6), "side": "below", "stiffness": 1e4, "gap": 1e-3}],
        reduction={"modes": 5},
        run={"duration": 0.01, "sample_rate": 1000.0, "start": "rest"},
    )
    result = beamsim.run(load_scenario(case))
    modes = result["modes"]
    kinetic, strain = modes["kinetic_energy_share"].values, modes["strain_energy_share"].values
    assert modes.labels("body") == ["a", "b"]
    np.testing.assert_allclose(kinetic.sum(axis=0), 1.0, rtol=1e-10)
    flexible = modes["open_frequencies_hz"].values > 0
    assert flexible.sum() == 6 - (spring == 0.0)
    if spring == 0.0:
        np.testing.assert_allclose(strain.sum(axis=0)[flexible], 1.0, rtol=1e-9)
        assert np.isnan(strain[0, 0])
        # the free bar turns about the hinge, and the beam that it hangs on is still
        np.testing.assert_allclose(kinetic[:, 0], [0.0, 1.0], atol=1e-12)
    else:
        structure = assemble(load_scenario(case))
        coupling = next(c for c in structure.couplings if c.stiffness)
        vectors = np.array([np.asarray(structure.row(coupling.site))])
        reduced = vectors @ reduced_basis(case)
        omega = 2 * np.pi * modes["open_frequencies_hz"].values
        in_spring = spring * reduced[0] ** 2 / structure.mass_scale / omega**2
        assert in_spring[0] > 0.05
        np.testing.assert_allclose(1 - strain.sum(axis=0), in_spring, atol=1e-9)
    again = load(write_result(result, tmp_path / "r.h5"))
    np.testing.assert_array_equal(again["modes"]["strain_energy_share"], strain)


def reduced_basis(case):
    return build_reduced_model(load_scenario(case)).basis.vectors
