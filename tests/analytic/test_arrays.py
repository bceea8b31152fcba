"""Systems from arrays: the same motions as by scenarios, by other coordinates and by independent integration."""

import numpy as np
import pytest
from independent import Stop, Structure, integrate
from scipy.sparse import csr_array

import beamsim
from beamsim.errors import ScenarioError

MASS, STIFFNESS = np.array([[2.0, 0.3], [0.3, 1.0]]), np.array([[30.0, -10.0], [-10.0, 12.0]])
DAMPING = 0.01 * MASS + 0.004 * STIFFNESS
ROW, LOAD = np.array([-0.4, 1.3]), np.array([1.0, -0.5])
SINE = {"kind": "harmonic", "level": 3.0, "frequency": 0.55}
START = (np.array([0.05, -0.1]), np.array([0.4, 0.2]))


def system(mass=MASS, stiffness=STIFFNESS, damping=DAMPING, row=ROW, load=LOAD, **changes):
    law = {"stiffness": 90.0, "damping": {"kind": "viscous", "coefficient": 0.7}}
    given = {"contacts": [beamsim.Contact(row, law, 0.06, "stop")], "loads": {"shaker": load}} | changes
    return beamsim.System(mass, stiffness, damping, **given)


def motion(of, start=START, **settings):
    return beamsim.simulate(of, 6.0, {"shaker": SINE}, start=start, sample_rate=50.0, convergence="off", **settings)


def displacements(result):
    return result["histories"]["displacement"].values


def test_the_motion_is_that_of_an_independent_integration():
    """With full matrices, a contact and a load that act on both degrees of freedom."""
    result = motion(system())
    time = result["histories"]["time"].values
    stop = Stop(ROW, 90.0, 0.7, 0.06, side=-1.0)
    structure = Structure(MASS, DAMPING, STIFFNESS, np.zeros(2))
    stepped = integrate(
        structure,
        [stop],
        lambda t: LOAD * 3.0 * np.sin(2 * np.pi * 0.55 * t),
        np.concatenate(START),
        time,
        most_step=0.05,
    )
    assert result["events"]["time"].values.size > 6
    np.testing.assert_allclose(displacements(result), stepped.state[:, :2].T, atol=1e-9)


def test_other_coordinates_give_the_same_motion():
    """With u = T y the matrices are T' M T, and rows and loads T' r."""
    turn = np.array([[0.7, 0.2], [-0.5, 1.1]])
    turned = system(*(turn.T @ matrix @ turn for matrix in (MASS, STIFFNESS, DAMPING)), turn.T @ ROW, turn.T @ LOAD)
    start = tuple(np.linalg.solve(turn, part) for part in START)
    first, second = motion(system()), motion(turned, start)
    np.testing.assert_allclose(turn @ displacements(second), displacements(first), atol=1e-11)
    forces = [result["histories"]["snubber_force"].sel(snubber="stop").values for result in (first, second)]
    np.testing.assert_allclose(*forces, atol=1e-9)


def test_outputs_are_rows_of_the_motion():
    rows = {"sum": [1.0, 1.0], "stop": ROW}
    named, plain = motion(system(outputs=rows)), motion(system())
    for name, row in rows.items():
        of_row = named["histories"]["displacement"].sel(probe=name).values
        np.testing.assert_allclose(of_row, np.asarray(row) @ displacements(plain), atol=1e-12)


def test_a_chain_is_the_same_by_its_matrices_in_all_functions():
    """Two masses with a stop, as a section of a scenario and as arrays: curves, backbones, shares, derivatives."""
    chain = {
        "masses": [1.0, 1.0], "springs": [0.0, 1.0, 1.0], "dashpots": [0.0, 0.03, 0.03],
        "snubbers": [{"name": "stop", "mass": 1, "side": "above", "stiffness": 100.0, "gap": 1.0}],
    }  # fmt: skip
    k = np.array([[1.0, -1.0], [-1.0, 2.0]])
    arrays = beamsim.System(
        np.eye(2), csr_array(k), 0.03 * k, [beamsim.Contact([1, 0], 100.0, 1.0, "stop")], {"f": [0, 1]}
    )
    force = {"kind": "harmonic", "applied_to": {"mass": 2}, "level": 0.1, "frequency": 0.12}
    case = {"chain": chain, "excitation": force, "probes": [{"name": f"q{i}", "mass": i} for i in (1, 2)]}

    sweep = {"kind": "continuation", "from": 0.12, "to": 0.122, "side_branches": "none"}
    by_chain = beamsim.continuation(beamsim.load_scenario({**case, "sweep": sweep}))["points"]
    by_arrays = beamsim.continue_motion(arrays, (0.12, 0.122), {"f": {"level": 0.1}}, side_branches="none")["points"]
    for name in ("frequency_hz", "peak_displacement", "floquet_multipliers_real"):
        np.testing.assert_allclose(by_arrays[name].values, by_chain[name].values, rtol=1e-6, atol=1e-8)

    nnm = {"mode": 1, "continue_in": {"kind": "energy", "from": 0.5, "to": 1.0}}
    by_chain = beamsim.nnm(beamsim.load_scenario({**case, "excitation": {"kind": "none"}, "nnm": nnm})).branches[0]
    by_arrays = beamsim.backbone(arrays, 1, (0.5, 1.0)).branches[0]
    np.testing.assert_allclose(by_arrays["frequency_hz"].values, by_chain["frequency_hz"].values, rtol=1e-8)

    box = [{"probe": "q1", "displacement": [-2.0, 2.0]}]
    starts = {
        "kind": "coexisting",
        "at": [0.12],
        "unstable": False,
        "starts": {"kind": "states", "number": 4, "box": box},
    }
    by_chain = beamsim.coexisting(beamsim.load_scenario({**case, "sweep": starts})).summary["motions"]
    by_arrays = beamsim.basins(arrays, 0.12, {"f": {"level": 0.1}}, box, 4, unstable=False).summary["motions"]
    assert [of["share"] for of in by_arrays] == [of["share"] for of in by_chain]

    run = {"duration": 30.0, "start": "rest", "sensitivities": ["chain.snubbers.stop.gap"], "convergence": "off"}
    by_chain = beamsim.run(beamsim.load_scenario({**case, "run": run}))["sensitivities"]["derivative"].values
    settings = {"start": ([0, 0], [0, 0]), "convergence": "off"}
    by_arrays = beamsim.sensitivities(
        arrays, ["snubbers.stop.gap"], 30.0, {"f": {"kind": "harmonic", "level": 0.1, "frequency": 0.12}}, **settings
    )["sensitivities"]["derivative"].values
    np.testing.assert_allclose(by_arrays, by_chain, rtol=1e-8, atol=1e-10)


UNITS = {
    "kind": "matrices", "mass": (MASS / 1e3).tolist(), "stiffness": (STIFFNESS / 1e3).tolist(), "base": "free",
    "viscous": (DAMPING / 1e3).tolist(), "units": "mm-t-s", "rows": {"stop": ROW.tolist(), "shaker": LOAD.tolist()},
}  # fmt: skip


def test_rows_are_in_the_units_of_the_matrices(tmp_path):
    """t and N/mm for kg and N/m; written in the case, and in files."""
    stop = {"name": "stop", "at": {"row": "stop"}, "side": "above", "gap": "60 mm", "stiffness": 90.0,
            "damping": {"kind": "viscous", "coefficient": 0.7}}  # fmt: skip
    run = {"duration": 6.0, "sample_rate": 50.0, "convergence": "off"}
    case = {
        "bodies": {"pair": UNITS}, "snubbers": [stop], "excitation": {**SINE, "applied_to": {"row": "shaker"}},
        "probes": [{"name": f"q{node}", "at": {"node": node}} for node in (1, 2)], "run": run,
    }  # fmt: skip
    expected = displacements(motion(system(), ([0, 0], [0, 0])))
    np.testing.assert_allclose(displacements(beamsim.run(beamsim.load_scenario(case))), expected, atol=1e-11)
    keys = ("mass", "stiffness", "viscous")
    np.savez(tmp_path / "matrices.npz", **{key: np.array(UNITS[key]) for key in keys})
    (tmp_path / "dofs.csv").write_text("node,direction\n1,z\n2,z\n")
    files = {key: {"file": str(tmp_path / "matrices.npz"), "name": key} for key in keys}
    body = {**UNITS, **files, "dofs": str(tmp_path / "dofs.csv")}
    by_files = beamsim.run(beamsim.load_scenario({**case, "bodies": {"pair": body}}))
    np.testing.assert_allclose(displacements(by_files), expected, atol=1e-11)


def test_a_row_on_a_moving_base_follows_it():
    """A third degree of freedom moves with the base; a stop at (u1 + u3) / 2 is half as stiff and a quarter as near."""
    matrices = {
        "mass": np.diag([1.0, 2.0, 1.0]).tolist(),
        "stiffness": [[30.0, -10.0, -20.0], [-10.0, 25.0, -15.0], [-20.0, -15.0, 35.0]],
    }
    body = {"kind": "matrices", **matrices, "base": {"nodes": [3]}, "rows": {"half": [0.5, 0.0, 0.5]}}
    base = {"kind": "harmonic", "applied_to": "base", "level": 4.0, "frequency": 0.8}

    def forces(place, gap, stiffness):
        stop = {"name": "stop", "at": place, "side": "above", "gap": gap, "stiffness": stiffness}
        case = {
            "bodies": {"pair": body}, "snubbers": [stop], "excitation": base,
            "run": {"duration": 5.0, "sample_rate": 100.0, "convergence": "off"},
        }  # fmt: skip
        return beamsim.run(beamsim.load_scenario(case))["histories"]["snubber_force"].values

    by_row, by_node = forces({"row": "half"}, 0.02, 400.0), forces({"node": 1}, 0.04, 100.0)
    assert by_row.max() > 1.0
    np.testing.assert_allclose(0.5 * by_row, by_node, atol=1e-9)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mass": [[1.0, 0.0]]}, r"bodies\.system\.mass\[0\] has 2 numbers, and the matrix has 1 row"),
        ({"stiffness": np.eye(3)}, r"mass has 2 rows"),
        ({"stiffness": [[30.0, -10.0], [-9.0, 12.0]]}, r"bodies\.system\.stiffness is not symmetric"),
        ({"row": [1.0]}, r"bodies\.system\.rows\.stop has 1 factors"),
        ({"row": [0.0, 0.0]}, "snubbers.*row"),
        ({"mass": np.eye(301), "stiffness": np.eye(301)}, r"bodies\.system\.mass has 301 rows, and takes up to 300"),
    ],
)
def test_arrays_that_do_not_fit_are_located(changes, message):
    with pytest.raises(ScenarioError, match=message):
        motion(system(**changes))


def test_a_start_has_a_number_for_each_row():
    with pytest.raises(ScenarioError, match=r"run\.start\.displacement has 1 number for 2 rows of the matrices"):
        motion(system(), ([0.1], [0.0, 0.0]))


def test_free_masses_collide_as_in_closed_form():
    """A spring k between masses 1 and 2 acts for half a period of the reduced mass; elastic exchange of momentum."""
    pair = beamsim.System(
        np.diag([1.0, 2.0]), np.zeros((2, 2)), contacts=[beamsim.Contact([1, -1], 1e4, name="buffer")]
    )
    result = beamsim.simulate(pair, 0.1, start=([0, 0], [1.0, 0.0]), sample_rate=1e3)
    opened = result["events"]["time"].values[-1]
    assert opened == pytest.approx(np.pi * np.sqrt(2 / 3 / 1e4), rel=1e-10)
    np.testing.assert_allclose(result["histories"]["velocity"].values[:, -1], [-1 / 3, 2 / 3], atol=1e-10)
    assert result.summary["peak_force_n"]["buffer"] == pytest.approx(np.sqrt(2 / 3 * 1e4), rel=1e-10)


def test_a_periodic_motion_below_the_gap_is_the_linear_one():
    pair = system(contacts=[beamsim.Contact(ROW, 90.0, 10.0, "stop")])
    points = beamsim.periodic_motion(pair, 0.55, {"shaker": {"level": 3.0}})
    omega = 2 * np.pi * 0.55
    linear = np.linalg.solve(STIFFNESS + 1j * omega * DAMPING - omega**2 * MASS, 3.0 * LOAD)
    np.testing.assert_allclose(points["peak_displacement"].values[:, 0], abs(linear), rtol=1e-8)


def test_no_contact_is_lost_where_two_have_one_name():
    with pytest.raises(ScenarioError, match=r"snubbers\[1\]\.name = stop"):
        motion(system(contacts=[beamsim.Contact(ROW, 90.0, 0.06, "stop"), beamsim.Contact(LOAD, 50.0, 0.02, "stop")]))


def test_sparse_damping_is_that_of_its_array():
    np.testing.assert_array_equal(
        displacements(motion(system(damping=csr_array(DAMPING)))), displacements(motion(system()))
    )
