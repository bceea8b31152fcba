"""Chapter 4 of the thesis by ``nnm: {method: multiple_scales}``: chains, beams, and how small its factors are."""

import numpy as np
import pytest

from beamsim.analyses.multiple_scales import compare_expansion, expand_nnm, expansion_path
from beamsim.analyses.nnm import conservative_system
from beamsim.errors import NotTrustedError, ScenarioError
from beamsim.model.build import build_system
from beamsim.scenario import load_scenario

BEAM = {
    "length": 0.27, "width": 0.05, "thickness": 0.005, "youngs_modulus": 69e9, "density": 2700, "elements": 10,
    "supports": {"left": "clamped", "right": "free"},
}  # fmt: skip


def chain(mass, **snubber):
    snubber = {"mass": mass, "side": "below", "stiffness": 1.0, "gap": 0.0} | snubber
    return {"title": "Six masses", "chain": {"masses": [1] * 6, "springs": [1] * 7, "snubbers": [snubber]}}


def beam(position, stiffness=107e3, **snubber):
    snubber = {"name": "stop", "position": position, "side": "below", "stiffness": stiffness, "gap": 0.0} | snubber
    return {"title": "Beam", "beam": BEAM, "snubbers": [snubber]}


def structure(case):
    return conservative_system(load_scenario(case))


@pytest.mark.parametrize(("factor", "mode"), [(0.02, 4), (0.015, 1)])
@pytest.mark.parametrize("mass", [1, 5])
def test_six_masses(factor, mode, mass):
    """The thesis's factors: initial vectors within 0.4 % of the exact ones at first order, 0.06 % at second."""
    system = structure(chain(mass))
    there = compare_expansion(system, expansion_path(system, mode, factors=[factor]))
    assert there.frequency_difference[0, 1] < 3e-5
    assert there.initial_difference[0, 1] < 4e-3
    assert there.initial_difference[0, 2] < 6e-4
    c = compare_expansion(system, expansion_path(system, mode))
    for order in (0, 1):
        np.testing.assert_allclose(c.frequency_orders[-2:, order], order + 1, atol=0.02)
        np.testing.assert_allclose(c.initial_orders[-2:, order], order + 1, atol=0.02)
    np.testing.assert_allclose(c.frequency_orders[:3, 2], 3.0, atol=0.06)
    np.testing.assert_allclose(c.initial_orders[:3, 2], 3.0, atol=0.1)


@pytest.mark.parametrize(("position", "mode"), [(0.27, 1), (0.27, 2), (0.27, 3), (0.135, 2), (0.135, 3)])
def test_beam_with_107_kn_per_m(position, mode):
    """Frequencies to the orders expected, in the thesis's five cases, for factors that are small enough."""
    system = structure(beam(position))
    c = compare_expansion(system, expansion_path(system, mode))
    for order in (0, 1, 2):
        np.testing.assert_allclose(c.frequency_orders[:2, order], order + 1, atol=0.12)
    assert c.frequency_difference[0, 1] < 1e-3


def test_the_thesis_factors_are_not_small_for_the_beam():
    """At factor 1 the first-order frequency of mode 1 is 322 Hz (exact about 86): 57.62 Hz belongs to some 690 N/m."""
    system = structure(beam(0.27))
    path = expansion_path(system, 1, factors=[1.0])
    assert path.frequency_hz[0, 1] == pytest.approx(321.5, abs=0.5)
    assert path.reach < 0.05
    with pytest.raises(NotTrustedError, match="smaller factors"):
        compare_expansion(system, path)
    soft = expansion_path(system, 1, factors=[689.0 / 107e3])
    assert soft.frequency_hz[0, 2] == pytest.approx(57.62, abs=0.02)


def test_gaps_need_an_energy():
    for gap in (0.1, -0.1):
        system = structure(chain(5, gap=gap))
        with pytest.raises(ScenarioError, match=r"nnm\.energy.*missing"):
            expansion_path(system, 4)
        c = compare_expansion(system, expansion_path(system, 4, 0.5))
        np.testing.assert_allclose(c.frequency_orders[-2:, 1], 2.0, atol=0.05)
        np.testing.assert_allclose(c.initial_orders[-2:, 1], 2.0, atol=0.05)


def test_cubic_spring():
    case = chain(5)
    case["chain"]["snubbers"] = []
    case["chain"]["springs_to_ground"] = [{"mass": 6, "kind": "cubic", "stiffness": 0.5}]
    c = compare_expansion(structure(case), expansion_path(structure(case), 4, 0.5, 0.2 * 0.5 ** np.arange(4)))
    for order in (0, 1, 2):
        np.testing.assert_allclose(c.frequency_orders[-1, order], order + 1, atol=0.05)
        np.testing.assert_allclose(c.initial_orders[-1, order], order + 1, atol=0.05)


def test_scenario():
    case = chain(5) | {"nnm": {"mode": 4, "method": "multiple_scales"}}
    scenario = load_scenario(case)
    assert load_scenario(scenario.to_yaml()) == scenario
    c = expand_nnm(scenario)
    assert c.path.mode == 4
    assert np.all(c.exact.residual < 1e-10)
    assert c.path.initial_displacement.shape == (c.path.factor.size, 3, 6)
    with pytest.raises(ScenarioError, match="stiffness factor"):
        load_scenario(case | {"nnm": {"mode": 4, "method": "multiple_scales", "continue_in": {
            "kind": "energy", "from": 0.1, "to": 1.0}}})  # fmt: skip
    with pytest.raises(ScenarioError, match="is missing"):
        expand_nnm(load_scenario(chain(5)))
    with pytest.raises(ScenarioError, match="not among"):
        expansion_path(structure(chain(5)), 7)
    damped = build_system(load_scenario(chain(5) | {"chain": case["chain"] | {"dashpots": [0.1] * 7}}))
    with pytest.raises(ValueError, match="without damping"):
        expansion_path(damped, 1)
    with pytest.raises(ValueError, match="other factors"):
        compare_expansion(structure(chain(5)), expansion_path(structure(chain(5)), 4, factors=[0.1]), c.exact)
