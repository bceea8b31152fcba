"""Motion of the base along and about any axis, and gravity as a vector."""

import json
from pathlib import Path

import numpy as np
import pytest
from independent import Beam
from scipy.linalg import expm
from scipy.sparse import csc_array

import beamsim
from beamsim.errors import ScenarioError
from beamsim.matrix_files import write_matrices
from beamsim.scenario import load_scenario
from beamsim.structures.assembly import assemble
from beamsim.structures.named_matrices import DofTable, write_dof_table
from beamsim.system.build import build_system

L, W, H, E, RHO = 0.9, 0.03, 0.004, 70e9, 2700.0
EI, LINE = E * W * H**3 / 12, RHO * W * H
BEAM = {
    "length": L, "width": W, "thickness": H, "youngs_modulus": E, "density": RHO, "elements": 7,
    "damping": {"kind": "modal", "ratio": 0.02},
}  # fmt: skip
PLATE = {
    "kind": "plate", "length": 0.5, "width": 0.3, "thickness": 0.002, "youngs_modulus": E, "poissons_ratio": 0.3,
    "density": RHO, "elements": [4, 3], "damping": {"kind": "modal", "ratio": 0.02},
}  # fmt: skip
TURN = {"kind": "harmonic", "applied_to": "base", "direction": "ry", "level": "30 rad/s^2", "frequency": 23.0}
STEP = {"kind": "step", "applied_to": "base", "direction": "ry", "level": "30 rad/s^2"}


def case(excitation, *, beam=None, **more):
    return load_scenario(
        {
            "beam": {**BEAM, **(beam or {})}, "excitation": excitation, "run": {"duration": 0.2},
            "probes": [{"name": "p", "position": 0.7 * L}], **more,
        }
    )  # fmt: skip


def test_statics_of_a_cantilever_under_an_angular_acceleration_are_those_of_a_triangular_load():
    system = build_system(case(STEP, reduction={"modes": 3}, beam={"elements": 40}))
    q = 30 * system.forcing.load[0] / system.dynamics.stiffness
    body, s = system.bodies[0], system.bodies[0].position / L
    p = 30 * LINE * L  # upwards at the tip: points go down with a turn about y, inertia acts up
    moment = p * L**2 / 6 * (2 - 3 * s + s**3)
    stress = system.stress
    np.testing.assert_allclose(body.bending_moment @ q + 30 * body.base_moment, moment, atol=1e-9 * p * L**2)
    assert stress is not None
    tip = body.deflection[-1] @ q
    assert tip == pytest.approx(11 * p * L**4 / (120 * EI), rel=2e-4)  # three modes


def test_against_an_independent_beam():
    """A clamped beam whose base turns about a point, on full matrices with their couplings to the clamp."""
    alpha, beta, about = 8.0, 2e-5, 0.25
    result = beamsim.run(case(
        {**TURN, "about": about}, reduction={"modes": "all"},
        beam={"damping": {"kind": "rayleigh", "mass": alpha, "stiffness": beta}},
    ))  # fmt: skip
    beam, free = Beam(L, W, H, E, RHO, 7, "clamped"), Beam(L, W, H, E, RHO, 7, "free")
    x = np.linspace(0, L, 8)
    rigid = np.column_stack([about - x, -np.ones(8)]).ravel()  # w = -(x - about), w' = -1
    load = -(free.M @ rigid)[beam.free]
    n = beam.free.size
    system = np.zeros((2 * n + 2, 2 * n + 2))
    inverse, omega = np.linalg.inv(beam.M), 2 * np.pi * 23.0
    system[:n, n : 2 * n] = np.eye(n)
    system[n : 2 * n, :n] = -inverse @ beam.K
    system[n : 2 * n, n : 2 * n] = -inverse @ (alpha * beam.M + beta * beam.K)
    system[n : 2 * n, 2 * n] = 30 * inverse @ load
    system[2 * n, 2 * n + 1], system[2 * n + 1, 2 * n] = omega, -omega
    start = np.zeros(2 * n + 2)
    start[-1] = 1.0
    every = slice(None, None, max(1, result["histories"]["time"].values.size // 40))
    q = np.array([(expm(system * t) @ start)[:n] for t in result["histories"]["time"].values[every]])
    relative = q @ beam.row(0.7 * L)
    carried = (about - 0.7 * L) * -30 / omega**2 * np.sin(omega * result["histories"]["time"].values[every])
    np.testing.assert_allclose(
        result["histories"]["displacement"].sel(probe="p").values[every],
        relative,
        rtol=0,
        atol=1e-8 * np.abs(relative).max(),
    )
    np.testing.assert_allclose(
        result["histories"]["absolute_displacement"].sel(probe="p").values[every],
        relative + carried,
        rtol=0,
        atol=1e-8 * np.abs(carried).max(),
    )


@pytest.mark.parametrize("direction", ["z", "rx", "ry"])
def test_a_free_plate_stays_where_it_is(direction):
    """What no support holds does not follow the base: absolute motions are zero, energies included."""
    level = "2 g" if direction == "z" else "30 rad/s^2"
    about = {} if direction == "z" else {"about": [0.1, 0.2]}
    result = beamsim.run(load_scenario({
        "bodies": {"panel": PLATE}, "probes": [{"name": "p", "position": [0.4, 0.05]}],
        "excitation": {"kind": "harmonic", "applied_to": "base", "direction": direction, "level": level,
                       "frequency": 9.0, **about},
        "run": {"duration": 0.1, "start": "rest"},
    }))  # fmt: skip
    size = np.abs(result["histories"]["displacement"].sel(probe="p").values).max()
    assert size > 1e-4
    # at rest relative to a base that moves: it drifts with the base's first velocity, and feels no acceleration
    assert (
        np.abs(result["histories"]["absolute_acceleration"].sel(probe="p").values).max()
        < 1e-9 * size * (2 * np.pi * 9.0) ** 2
    )
    assert result.summary["energy_error"] < 1e-10


def test_energies_balance_with_contact_while_the_base_turns():
    result = beamsim.run(
        case(TURN, snubbers=[{"name": "s", "position": L, "side": "below", "stiffness": 2e4, "gap": 1e-4}])
    )
    assert result.summary["contacts"]["s"] >= 2
    assert result.summary["energy_error"] < 1e-10
    assert result["histories"]["base_displacement"].sel(base_motion="ry").unit == "rad"


def test_a_rotation_and_its_angular_acceleration_are_the_same_motion():
    omega = 2 * np.pi * 23.0
    degrees = np.degrees(30 / omega**2)
    given = case({**TURN, "level": f"{degrees} deg", "phase": "180 deg"})
    assert given.excitation.quantity == "rotation"
    a, b = (
        beamsim.run(scenario)["histories"]["displacement"].sel(probe="p").values for scenario in (given, case(TURN))
    )
    np.testing.assert_allclose(a, b, rtol=0, atol=1e-12 * np.abs(b).max())


# --- imported matrices ------------------------------------------------------------------------------------------------


def written(folder: Path, mass, stiffness, table, excitation, *, base=(1,), probe=8, **more):
    write_matrices(folder / "m.op4", {"mxx": csc_array(mass), "kxx": csc_array(stiffness)})
    write_dof_table(folder / "dofs.csv", table)
    path = folder / "case.yaml"
    source = {"file": "m.op4"}
    path.write_text(json.dumps({
        "bodies": {"panel": {
            "kind": "matrices", "mass": {**source, "name": "mxx"}, "stiffness": {**source, "name": "kxx"},
            "dofs": "dofs.csv", "base": {"nodes": base}, "damping": {"kind": "modal", "ratio": 0.02},
        }},
        "excitation": excitation, "probes": [{"name": "p", "at": {"node": probe}}], "run": {"duration": 0.2}, **more,
    }))  # fmt: skip
    return load_scenario(path)


def free_beam():
    return assemble(case(TURN, beam={"supports": {"left": "free"}})).named_matrices


def test_reactions_of_imported_matrices_are_those_of_the_beam(tmp_path):
    """Force and moment of the clamped node, and the base's about another point, while the base turns."""
    model = free_beam()
    clamp_of = [{"name": "base", "kind": "reaction_force", "support": "base"},
                {"name": "base_moment", "kind": "reaction_moment", "support": "base"}]  # fmt: skip
    imported = [{"name": "clamp", "kind": "reaction_force", "support": "node 1"},
                {"name": "moment", "kind": "reaction_moment", "support": "node 1"},
                {**clamp_of[0]}, {**clamp_of[1], "about": [0.3, 0, 0]}]  # fmt: skip
    built = [{"name": "clamp", "kind": "reaction_force", "support": "left"},
             {"name": "moment", "kind": "reaction_moment", "support": "left"},
             {**clamp_of[0]}, {**clamp_of[1], "about": 0.3}]  # fmt: skip
    settings = {"reduction": {"modes": 5}, "gravity": 9.81}
    one = written(tmp_path, model.mass, model.stiffness, model.table, {**TURN, "about": [0.25, 0, 0]},
                  outputs=imported, **settings)  # fmt: skip
    other = case({**TURN, "about": 0.25}, outputs=built, **settings)
    a, b = (beamsim.run(scenario)["histories"]["output_value"] for scenario in (one, other))
    for name in ("clamp", "base", "base_moment"):
        expected = b.sel(output=name).values
        np.testing.assert_allclose(a.sel(output=name).values, expected, rtol=0, atol=1e-7 * np.abs(expected).max())
    turned, expected = (np.abs(each.sel(output="moment").values) for each in (a, b))  # right-handed about y there
    np.testing.assert_allclose(turned, expected, rtol=0, atol=1e-7 * turned.max())


def spatial():
    """Two nodes that springs in x and in z join to a base node, which has all three translations."""
    dofs = tuple((node, d) for node in (1, 2, 3) for d in ("x", "z"))
    places = np.array([[0, 0, 0], [0, 0, 0], [0.3, 0, 0], [0.3, 0, 0], [0.6, 0, 0.2], [0.6, 0, 0.2]], dtype=float)
    k = np.zeros((6, 6))
    for first, second, stiffness in ((0, 2, 900.0), (2, 4, 400.0), (1, 3, 300.0), (3, 5, 250.0)):
        k[np.ix_([first, second], [first, second])] += stiffness * np.array([[1, -1], [-1, 1]])
    return np.diag([1.0, 1.0, 2.0, 2.0, 0.5, 0.5]), k, DofTable(dofs, places)


@pytest.mark.parametrize(("direction", "along"), [("x", 0), ("z", 1)])
def test_the_base_moves_along_any_axis_of_an_imported_model(tmp_path, direction, along):
    mass, stiffness, table = spatial()
    system = build_system(written(
        tmp_path, mass, stiffness, table, {**TURN, "direction": direction, "level": "1 m/s^2"}, probe=3,
        reduction={"modes": "all"},
    ))  # fmt: skip
    m, k = (np.array(a)[np.ix_([2 + along, 4 + along], [2 + along, 4 + along])] for a in (mass, stiffness))
    tip = np.linalg.solve(k, -m @ np.ones(2))[1]  # static, under a unit acceleration
    shape = system.probes[0].shape if direction == "z" else None
    q = system.forcing.load[0] / system.dynamics.stiffness
    if shape is not None:
        assert shape @ q == pytest.approx(tip, rel=1e-10)
        assert system.probes[0].base_influence == 1.0
    else:  # the probe is in z, which neither moves nor is carried
        assert abs(system.probes[0].shape @ q) < 1e-12
        assert system.probes[0].base_influence == 0.0


def test_gravity_as_a_vector_is_the_scalar_where_they_coincide(tmp_path):
    mass, stiffness, table = spatial()
    still = {"kind": "none"}
    scalar, vector, along_x = (
        build_system(written(tmp_path, mass, stiffness, table, still, probe=3, gravity=g, reduction={"modes": 2}))
        for g in ("1 g", [0, 0, "-1 g"], [2.0, 0, 0])
    )
    np.testing.assert_allclose(vector.static_equilibrium, scalar.static_equilibrium, rtol=1e-12)
    sag = np.linalg.solve(stiffness[np.ix_([3, 5], [3, 5])], -9.80665 * mass[np.ix_([3, 5], [3, 5])] @ np.ones(2))[1]
    assert vector.probes[0].shape @ vector.static_equilibrium == pytest.approx(sag, rel=1e-10)
    # with its static vector, two of four modes are enough
    assert abs(along_x.probes[0].shape @ along_x.static_equilibrium) < 1e-12
    drawn = 0.5 * along_x.static_equilibrium**2 @ along_x.dynamics.stiffness
    f = 2.0 * mass[np.ix_([2, 4], [2, 4])] @ np.ones(2)
    assert drawn == pytest.approx(0.5 * f @ np.linalg.solve(stiffness[np.ix_([2, 4], [2, 4])], f), rel=1e-10)


def test_a_rotation_needs_coordinates(tmp_path):
    mass, stiffness, table = spatial()
    with pytest.raises(ScenarioError, match=r"excitation.direction = ry: dofs has no coordinates"):
        build_system(written(tmp_path, mass, stiffness, DofTable(table.dofs), TURN, probe=3,
                             base=[1, 2]))  # fmt: skip
