"""The bound of a reduced model's receptance, against the receptance of the full model."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import beamsim
from beamsim.scenario import load_scenario
from beamsim.structures.modes import natural_modes
from beamsim.structures.places import UPWARDS
from beamsim.structures.reduction import OmittedResponse, frequency_beyond, receptance_bound
from beamsim.system.build import build_system
from beamsim.system.reduced_model import build_reduced_model

BEAM = {"length": 1.0, "width": 0.05, "thickness": 0.01, "youngs_modulus": 7e10, "density": 2700}
UNDAMPED = {"kind": "modal", "ratio": 0.0}
ENDS = st.sampled_from(["clamped", "pinned", "free", "guided"])
RATIO = st.floats(0.001, 0.2)
DAMPING = st.one_of(
    st.just(UNDAMPED),
    st.builds(lambda ratio: {"kind": "modal", "ratio": ratio}, RATIO),
    st.builds(lambda ratios: {"kind": "modal", "ratio": ratios}, st.lists(RATIO, min_size=1, max_size=8)),
    st.builds(
        lambda a, b: {"kind": "rayleigh", "mass": a, "stiffness": b}, st.floats(0.1, 50.0), st.floats(1e-7, 1e-4)
    ),
    st.builds(lambda c: {"kind": "viscous", "coefficient": c}, st.floats(0.1, 300.0)),
)
PLACE = st.floats(0.05, 1.0)


def snubber(position):
    return {"name": f"at{position}", "position": position, "side": "below", "stiffness": 1e5, "gap": 1e-3}


@st.composite
def beams(draw, damping=DAMPING):
    masses = [{"position": x, "mass": draw(st.floats(0.01, 2.0))} for x in draw(st.lists(PLACE, max_size=2))]
    beam = {**BEAM, "elements": draw(st.integers(10, 30)), "damping": draw(damping), "point_masses": masses}
    left, right = draw(ENDS), draw(ENDS)
    beam["supports"] = {"left": left, "right": right}
    free = min(x for x in (0.95 if right in ("clamped", "pinned") else 1.0, 1.0))
    places = draw(st.lists(st.floats(0.05, free), min_size=1, max_size=2, unique=True))
    return {
        "beam": beam,
        "snubbers": [snubber(x) for x in places],
        "reduction": {"modes": draw(st.integers(2, 8))},
    }


@st.composite
def chains(draw):
    size = draw(st.integers(5, 12))
    number = st.floats(0.1, 10.0)
    springs = draw(st.lists(st.floats(1e3, 1e5), min_size=size, max_size=size))
    dashpot = st.one_of(st.just(0.0), st.floats(0.01, 50.0))
    dashpots = draw(st.lists(dashpot, min_size=size, max_size=size))
    chain = {
        "masses": draw(st.lists(number, min_size=size, max_size=size)),
        "springs": [*springs, 0.0] if draw(st.booleans()) else [0.0, *springs[1:], 0.0],
        "dashpots": [*dashpots, 0.0],
    }
    at = {"name": "s", "mass": draw(st.integers(1, size)), "side": "below", "stiffness": 1e4, "gap": 1e-3}
    return {"chain": chain, "snubbers": [at], "reduction": {"modes": draw(st.integers(2, 4))}}


def truncation(case):
    """What is left out of the responses at contacts and to the inertia load, and at probes."""
    parts = build_reduced_model(load_scenario(json.dumps(case)))
    structure = parts.structure
    loads = np.vstack([structure.rows(parts.snubber_sites), structure.base_load(UPWARDS)[0]])
    places = np.vstack([loads, structure.rows(parts.probe_sites)])
    return OmittedResponse.of(structure, parts.basis, parts.damping, places, len(loads))


def full_receptance(t, s):
    """Of the full model in all of its modes, each with its ratio."""
    model = t.model
    modes = natural_modes(model)
    stated = model.members[0].body.stated_damping
    ratios = np.zeros(model.size)
    matrix = np.zeros((model.size, model.size))
    if stated is not None and stated.kind == "modal":
        given = np.atleast_1d(stated.ratio)
        ratios[:] = given[-1]
        ratios[: given.size] = given[: model.size]
    elif stated is not None and stated.kind == "rayleigh":
        frequency = model.frequency_scale
        matrix += np.diag(stated.mass / frequency + stated.stiffness * frequency * modes.omega**2)
    if model.damping is not None:
        physical = modes.vectors.T @ (model.damping @ modes.vectors)
        matrix += physical / (model.mass_scale * model.frequency_scale)
    impedance = np.diag(modes.omega**2 - s**2 + 2j * s * ratios * modes.omega) + 1j * s * matrix
    loads = modes.vectors.T @ t.loads.T
    return loads.T @ np.linalg.solve(impedance, loads)


def frequencies(t):
    """Between the resonances, up to the highest frequency."""
    kept = np.sqrt(t.basis.omega[: t.basis.modes - 1] * t.basis.omega[1 : t.basis.modes])
    highest = t.basis.highest_frequency
    return [s for s in (*kept[kept < highest], 0.3 * highest, highest) if s > 0]


def assert_bounded(t, share=1.0):
    for s in frequencies(t):
        full = full_receptance(t, s)
        true, bound = np.abs(full - t.shapes @ t.response(s)), share * t.errors(s, t.response(s))
        assert np.all(true <= bound * (1 + 1e-6) + 1e-11 * np.abs(full).max())


def assert_within_three(case):
    """At one place, undamped, the bound is at most three times the true error."""
    t = truncation(case)
    contacts = slice(0, len(case["snubbers"]))
    for s in frequencies(t):
        full, reduced = full_receptance(t, s), t.shapes @ t.response(s)
        true = np.diag(np.abs(full - reduced))[contacts]
        measurable = true > 1e-8 * np.abs(full).max()
        assert np.all(np.diag(t.errors(s, t.response(s)))[contacts][measurable] <= 3 * true[measurable])


@settings(max_examples=16, deadline=None)
@given(beams())
def test_it_bounds_the_error_of_beams_whatever_damps_and_holds_them(case):
    assert_bounded(truncation(case))


@settings(max_examples=8, deadline=None)
@given(beams(), PLACE)
def test_it_bounds_the_error_at_probes_which_have_no_static_vectors(case, position):
    held = case["beam"]["supports"]["right"] in ("clamped", "pinned")
    t = truncation({**case, "probes": [{"name": "p", "position": min(position, 0.95 if held else 1.0)}]})
    assert t.loads.shape[0] == t.static_load_count + 1
    assert_bounded(t)
    loads, probe = t.loads[: t.static_load_count], t.loads[t.static_load_count :]
    both = receptance_bound(t.model, t.basis, t.damping, loads, probe)
    alone = receptance_bound(t.model, t.basis, t.damping, loads, probe[:0])
    assert alone.probes is None
    assert both.loads == pytest.approx(alone.loads, rel=1e-6, abs=1e-12, nan_ok=True)
    if np.isfinite(both.probes) and both.probes > 0:
        s = t.basis.highest_frequency
        full, reduced = full_receptance(t, s), t.shapes @ t.response(s)
        size = np.sqrt(np.maximum(t.compliances, np.abs(np.diag(reduced))))
        moved = t.compliances[: t.static_load_count] > 0
        true = (np.abs(full - reduced)[-1] / (size[-1] * size))[: t.static_load_count][moved].max()
        assert true <= both.probes * (1 + 1e-6) + 1e-11


@settings(max_examples=12, deadline=None)
@given(chains())
def test_it_bounds_the_error_of_chains_with_dashpots(case):
    assert_bounded(truncation(case))


@settings(max_examples=12, deadline=None)
@given(beams(st.just(UNDAMPED)))
def test_undamped_at_one_place_it_is_within_a_factor_of_three(case):
    assert_within_three(case)


def test_a_third_of_it_is_no_bound():
    case = {"beam": {**BEAM, "damping": UNDAMPED}, "snubbers": [snubber(1.0)], "reduction": {"modes": 3}}
    assert_bounded(truncation(case))
    with pytest.raises(AssertionError):
        assert_bounded(truncation(case), 1 / 3)


def joined(inner, outer):
    half = {**BEAM, "kind": "beam", "length": 0.5, "elements": 12}
    return {
        "bodies": {
            "inner": {**half, "supports": {"left": "clamped", "right": "free"}, "damping": inner},
            "outer": {**half, "supports": {"left": "free", "right": "free"}, "damping": outer},
        },
        "joints": [
            {
                "name": "hinge",
                "between": [{"body": "inner", "position": 0.5}, {"body": "outer", "position": 0.0}],
                "kind": "hinge",
                "rotational_stiffness": 200.0,
                "rotational_dashpot": 0.5,
            }
        ],
        "snubbers": [
            {"name": "end", "at": {"body": "outer", "position": 0.5}, "side": "below", "stiffness": 1e5, "gap": 1e-3}
        ],
        "reduction": {"modes": 4},
    }


@settings(max_examples=8, deadline=None)
@given(RATIO, RATIO)
def test_it_bounds_the_error_of_joined_bodies_with_modal_damping_defined_for_the_coordinates(inner, outer):
    t = truncation(joined({"kind": "modal", "ratio": inner}, {"kind": "modal", "ratio": outer}))
    assert t.stated_damping.is_composite
    stiffness, mass = (t.model.factor.T @ t.model.factor).toarray(), t.model.mass.toarray()
    vectors = mass @ t.basis.vectors
    damping = t.stated_damping.matrix.toarray() + vectors @ t.modal_damping @ vectors.T
    for s in frequencies(t):
        full = t.loads @ np.linalg.solve(stiffness - s**2 * mass + 1j * s * damping, t.loads.T)
        true = np.abs(full - t.shapes @ t.response(s))
        assert np.all(true <= t.errors(s, t.response(s)) * (1 + 1e-6) + 1e-11 * np.abs(full).max())


def test_between_two_bodies_errors_add_up():
    panels = {
        "bodies": {
            name: {**BEAM, "kind": "beam", "thickness": h, "supports": {"left": "clamped"}, "damping": UNDAMPED}
            for name, h in (("a", 0.01), ("b", 0.02))
        },
        "reduction": {"modes": 6},
    }
    ends = [{"body": "a", "position": 1.0}, {"body": "b", "position": 0.7}]
    between = {**panels, "snubbers": [{"name": "s", "between": ends, "stiffness": 1e5, "gap": 1e-3}]}
    parts = build_reduced_model(load_scenario(json.dumps(between)))
    loads = parts.structure.rows(parts.snubber_sites)
    bound = receptance_bound(parts.structure, parts.basis, parts.damping, loads, loads[:0]).loads
    full = build_reduced_model(load_scenario(json.dumps({**between, "reduction": {"modes": "all"}})))
    static = float(np.sum((loads @ full.basis.vectors) ** 2 / full.basis.omega**2))
    s = parts.basis.highest_frequency
    sizes = [float(np.sum((loads @ p.basis.vectors) ** 2 / (p.basis.omega**2 - s**2))) for p in (full, parts)]
    true = abs(sizes[0] - sizes[1])
    assert 0 < true <= bound * max(static, abs(sizes[1])) * (1 + 1e-6)


def test_a_mode_that_the_basis_lacks_is_noticed():
    case = {"beam": {**BEAM, "damping": UNDAMPED}, "snubbers": [snubber(1.0)], "reduction": {"modes": 4}}
    t = truncation(case)
    model, omega = t.model, natural_modes(t.model).omega
    assert omega[3] < frequency_beyond(model, omega[:4], 1.05 * omega[4]) <= omega[4]
    assert frequency_beyond(model, omega[[0, 1, 3]], omega[4]) == 0.0


WEAK = """
chain: {masses: [100, 0.01], springs: [1e6, 1, 0]}
excitation: {kind: harmonic, applied_to: base, level: 1 m/s^2, frequency: 1 Hz}
reduction: {modes: 1}
run: {duration: 0.1 s, sample_rate: 1 kHz, convergence: "off"}
"""


def test_results_of_a_reduction_without_a_useful_bound_are_not_trusted():
    """The mode kept is that of the light mass; what the base's motion does to the heavy one is left out."""
    result = beamsim.run(load_scenario(WEAK))
    assert result["modes"]["reduction_bound"].item() > 0.1
    assert result.outcome.code == "reduction_not_accurate"
    assert not result.outcome.trusted
    whole = beamsim.run(load_scenario(WEAK, ["reduction={modes: 2}"]))
    assert whole["modes"]["reduction_bound"].item() == 0.0
    assert whole.outcome.complete


def test_a_bound_above_one_percent_is_a_warning():
    system = build_system(load_scenario(WEAK, ["chain.masses=[5, 1]", "chain.springs=[1e6, 1e3, 0]"]))
    assert 0.01 < system.modes["reduction_bound"].item() < 0.1
    assert any("may not be accurate" in text for text in system.warnings)
