"""Observed orders of convergence of the finite elements."""

import numpy as np
import pytest

from beamsim.scenario.beam import Beam
from beamsim.structures.beam import assemble_beam, moment_rows
from beamsim.structures.modes import natural_modes
from beamsim.structures.places import Place
from beamsim.structures.reduction import reduce_model

pytestmark = pytest.mark.quick

BETA = np.array([1.8751040687119611, 4.6940911329741746, 7.8547574382376126])


def cantilever(elements):
    return assemble_beam(
        Beam(length=1.0, width=0.05, thickness=0.01, youngs_modulus=70e9, density=2700.0, elements=elements)
    )


def order(meshes, errors):
    return np.polyfit(np.log(meshes), -np.log(errors), 1)[0]


@pytest.mark.parametrize("mode", [0, 1, 2])
def test_frequencies_converge_with_order_four(mode):
    meshes = [5, 10, 20, 40]
    errors = [natural_modes(cantilever(n)).omega[mode] / BETA[mode] ** 2 - 1 for n in meshes]
    assert np.all(np.array(errors) > 0)  # consistent elements bound frequencies from above
    assert order(meshes, errors) == pytest.approx(4.0, abs=0.1)


def exact_moment(x, mode):
    b = BETA[mode]
    sigma = (np.sinh(b) - np.sin(b)) / (np.cosh(b) + np.cos(b))
    return b**2 * (np.cosh(b * x) + np.cos(b * x) - sigma * (np.sinh(b * x) + np.sin(b * x)))


@pytest.mark.parametrize("mode", [0, 1, 2])
@pytest.mark.parametrize("recovery", ["equilibrium", "curvature"])
def test_bending_moments_from_equilibrium_gain_two_orders(mode, recovery):
    from beamsim.structures.mesh import shape_functions

    meshes = [5, 10, 20, 40]
    errors = []
    for n in meshes:
        model = cantilever(n)
        basis = reduce_model(model)
        x = model.mesh.nodes
        if recovery == "equilibrium":
            x = np.sort(np.append(x, x[:-1] + model.mesh.lengths / 2))
            moment = moment_rows(model.members[0], basis, x)[:, mode]
        else:
            u = np.zeros(2 * x.size)
            u[model.free] = basis.vectors[:, mode]
            element, xi = model.mesh.locate(x)
            moment = np.sum(shape_functions(xi, model.mesh.lengths[element], 2) * u[model.mesh.dofs[element]], axis=1)
        exact = exact_moment(x, mode)
        exact *= np.sign(exact[0] * moment[0])
        errors.append(np.abs(moment - exact).max() / np.abs(exact).max())
    assert order(meshes, errors) == pytest.approx(4.0 if recovery == "equilibrium" else 2.0, abs=0.2)


def test_static_vectors_speed_up_the_convergence_in_modes():
    """Closed frequencies: residual flexibility turns slow convergence in the number of modes into a fast one."""
    from beamsim.structures.modes import closed_modes
    from beamsim.structures.structure import LoadPattern

    model = cantilever(40)
    row = model.row(Place("beam", 1.0))
    stiffness = np.array([80.0])

    def first(count, patterns):
        basis = reduce_model(model, patterns, count=count)
        return closed_modes(basis.omega, (row @ basis.vectors)[None, :], stiffness, 0)[0][0]

    exact = first(None, ())
    counts = np.array([2, 4, 8])
    plain = [first(c, ()) / exact - 1 for c in counts]
    enriched = [first(c, [LoadPattern(row, Place("beam", 1.0))]) / exact - 1 for c in counts]
    assert order(counts, plain) < 4
    assert enriched[0] < plain[2]
    assert order(counts[:2], enriched[:2]) > 7
