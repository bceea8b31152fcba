"""Imported matrices whose nodes have displacement systems of their own: the physics of the same model without them.

The systems' axes at the nodes are those of pyYeti, from the rigid-body motions that it makes of Nastran's systems.
"""

from itertools import product

import numpy as np
import pytest
import yaml
from pyyeti.nastran import n2p
from sampling import first_apart

import beamsim
from beamsim.errors import ScenarioError
from beamsim.scenario import load_scenario
from beamsim.structures.assembly import with_places_of_files
from beamsim.structures.check import check
from beamsim.structures.matrices import read_body

PLACES = {1: (0, 0, 0), 2: (0.3, 0.1, 0.2), 3: (0.5, -0.2, 0.1), 4: (0.2, 0.4, -0.3), 5: (-0.2, 0.3, 0.5)}
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
POINTS = ((0.05, -0.02, 0.01), (0.15, 0.18, 0.31), (0.9, 0.1, -0.2))  # not along the axes of the model
KINDS = {"rectangular": 1, "cylindrical": 2}  # Nastran's CORD2R, CORD2C
SYSTEM = {1: 0, 2: 7, 3: 7, 4: 7, 5: 0}  # of the nodes


def frame():
    """Mass and stiffness of five nodes of six directions: bushings between them, which rigid motions do not load."""
    rng, size = np.random.default_rng(4), 6 * len(PLACES)
    mass = np.zeros((size, size))
    for k in range(len(PLACES)):
        mass[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] = np.diag([2.0, 2.0, 2.0, 0.02, 0.03, 0.04])
    stiffness = np.zeros((size, size))
    for i, j in ((1, 2), (2, 3), (3, 4), (4, 5), (2, 5), (1, 4)):
        x, y, z = np.subtract(PLACES[j], PLACES[i])
        carried = np.eye(6)
        carried[:3, 3:] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]  # what a motion of i is at j
        apart = np.zeros((6, size))
        apart[:, 6 * j - 6 : 6 * j], apart[:, 6 * i - 6 : 6 * i] = np.eye(6), -carried
        root = rng.standard_normal((6, 6)) * np.array([300, 300, 300, 60, 60, 60])[:, None]
        stiffness += apart.T @ (root @ root.T + 1e4 * np.eye(6)) @ apart
    return mass, stiffness


def turned(kind, base_too=False):
    """(30, 30) T of u_own = T u by pyYeti, and the number of the system of every node."""
    system = SYSTEM | ({1: 7} if base_too else {})
    reference = np.vstack([[7, KINDS[kind], 0], POINTS])
    uset = None
    for node, place in PLACES.items():
        uset = n2p.addgrid(uset, node, "b", 0, place, reference if system[node] else 0)
    motions = n2p.rbgeom_uset(uset)
    turn = np.zeros((6 * len(PLACES), 6 * len(PLACES)))
    for k in range(len(PLACES)):
        axes = motions[6 * k : 6 * k + 3, :3]
        turn[6 * k : 6 * k + 3, 6 * k : 6 * k + 3] = turn[6 * k + 3 : 6 * k + 6, 6 * k + 3 : 6 * k + 6] = axes
    return turn, system


def written(folder, turn=None, system=None, kind="rectangular", keep=None, coordinates=True, points=POINTS, **changes):
    """A case with the frame as a file of rows turned by T has it; ``keep`` chooses rows."""
    mass, stiffness = frame()
    turn = np.eye(len(mass)) if turn is None else turn
    rng = np.random.default_rng(1)
    recovery = np.vstack([rng.standard_normal(len(mass)), np.eye(len(mass))[6 * 2 + 1]])  # the second: node 3 along y
    rows = np.arange(len(mass)) if keep is None else np.array(keep)
    some = np.ix_(rows, rows)
    files = {
        "m": (turn @ mass @ turn.T)[some],
        "k": (turn @ stiffness @ turn.T)[some],
        "r": (recovery @ turn.T)[:, rows],
    }
    folder.mkdir(exist_ok=True)
    np.savez(folder / "frame.npz", **files)
    lines = ["node,direction,x,y,z" + (",system" if system else "")]
    for i in rows:
        node = i // 6 + 1
        place = ",".join(map(str, PLACES[node])) if coordinates else ",,"
        lines.append(f"{node},{DIRECTIONS[i % 6]},{place}" + (f",{system[node] or ''}" if system else ""))
    (folder / "dofs.csv").write_text("\n".join(lines))
    body = {
        "kind": "matrices", "mass": {"file": "frame.npz", "name": "m"}, "stiffness": {"file": "frame.npz", "name": "k"},
        "recovery": {"file": "frame.npz", "name": "r", "rows": ["gauge", "moved"]}, "dofs": "dofs.csv",
        "base": {"nodes": [1], "direction": "z"}, "damping": {"kind": "modal", "ratio": 0.01},
        "systems": [{"number": 7, "kind": kind, "points": [list(p) for p in points]}] if system and points else [],
    }  # fmt: skip
    stop = {"name": "stop", "at": {"node": 3, "direction": "x"}, "side": "above", "stiffness": 2e6, "gap": 2e-5}
    case = {
        "bodies": {"frame": body}, "reduction": {"modes": "all"}, "snubbers": [stop],
        "probes": [{"name": f"{direction}_of_{node}", "at": {"node": node, "direction": direction}}
                   for node, direction in ((2, "x"), (3, "y"), (4, "z"), (4, "rx"), (5, "ry"))],
        "outputs": [{"name": "gauge", "kind": "recovered", "row": "gauge", "unit": "Pa"},
                    {"name": "moved", "kind": "recovered", "row": "moved", "unit": "m"},
                    {"name": "foot_x", "kind": "reaction_force", "support": "node 1", "direction": "x",
                     "body": "frame"}],
        "excitation": {"kind": "half_sine", "applied_to": "base", "level": 300.0, "duration": 0.004},
        "run": {"duration": 0.05, "sample_rate": 20000, "convergence": "off"}, **changes,
    }  # fmt: skip
    (folder / "case.yaml").write_text(yaml.safe_dump(case))
    return load_scenario(folder / "case.yaml")


@first_apart(("direction", "kind"), len(KINDS), product(["ry", "x", "z"], KINDS))
def test_the_same_physics(tmp_path, kind, direction):
    """Histories, contacts, reactions, recovered rows and frequencies, with the base's node in a system too."""
    excitation = {"kind": "half_sine", "applied_to": "base", "level": 300.0, "duration": 0.004, "direction": direction}
    plain = beamsim.run(written(tmp_path / "plain", excitation=excitation))
    own = beamsim.run(written(tmp_path / "own", *turned(kind, base_too=True), kind, excitation=excitation))
    assert plain.summary["contacts"]["stop"] > 0
    assert own.summary["open_frequencies_hz"] == pytest.approx(plain.summary["open_frequencies_hz"], rel=1e-9)
    for quantity in ("displacement", "absolute_acceleration", "snubber_force", "output_value"):
        for name, of in plain["histories"].by_label(quantity).items():
            known, found = of.values, own["histories"].by_label(quantity)[name].values
            assert np.abs(found - known).max() <= 1e-9 * np.abs(known).max(), (name, quantity)
    moved, probe = (
        plain["histories"]["output_value"].sel(output="moved").values,
        plain["histories"]["displacement"].sel(probe="y_of_3").values,
    )
    assert np.abs(moved - probe).max() <= 1e-9 * np.abs(probe).max()


@pytest.mark.parametrize("kind", KINDS)
def test_directions_of_the_node_itself(tmp_path, kind):
    """A radial stop and probe: the motion along pyYeti's axis of the node, from probes along the axes of the model."""
    turn, system = turned(kind)
    places = [*((name, name) for name in DIRECTIONS), ("own", "local_x"), ("turned", "local_rz")]
    given = {
        "snubbers": [{"name": "stop", "at": {"node": 3, "direction": "local_x"}, "side": "above", "stiffness": 2e6,
                      "gap": 2e-5}],
        "probes": [{"name": name, "at": {"node": 3, "direction": direction}} for name, direction in places],
    }  # fmt: skip
    result = beamsim.run(written(tmp_path, turn, system, kind, **given))
    axes = turn[12:15, 12:15]
    motion = {name: np.asarray(probe.values) for name, probe in result["histories"].by_label("displacement").items()}
    for name, axis, parts in (("own", axes[0], ("x", "y", "z")), ("turned", axes[2], ("rx", "ry", "rz"))):
        known = sum(share * motion[part] for share, part in zip(axis, parts, strict=True))
        assert np.abs(motion[name] - known).max() <= 1e-12 * np.abs(known).max()
    pressed = np.maximum(motion["own"] - 2e-5, 0.0)
    assert pressed.max() > 0
    assert (
        np.abs(result["histories"]["snubber_force"].sel(snubber="stop").values - 2e6 * pressed).max()
        <= 1e-9 * result["histories"]["snubber_force"].sel(snubber="stop").values.max()
    )


def test_check_finds_the_rigid_motions(tmp_path):
    """Mass, centre and inertia, frequencies free and held, and that no rigid motion needs a force."""
    plain, own = (
        {row.name: row for row in check(written(tmp_path / name, *given))["frame"]}
        for name, given in (("plain", ()), ("own", (*turned("cylindrical", base_too=True), "cylindrical")))
    )
    assert [row.verdict for row in own.values()] == [row.verdict for row in plain.values()]
    for name in (
        "mass",
        "centre_of_mass",
        "inertia",
        "free_frequencies_hz",
        "fixed_frequencies_hz",
        "effective_masses",
    ):
        assert own[name].text == plain[name].text
    assert "6 rigid-body modes" in plain["free_frequencies_hz"].text


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"points": ()}, "dofs puts node 2 in system 7, but systems lists none; give it one"),
        (
            {"kind": "cylindrical", "coordinates": False},
            "no coordinates of node 2, which is in the cylindrical system 7",
        ),
        (
            {"keep": [0, 1, 2, 6, 12, 13, 14]},
            "gives node 2 only x of its system; export all three translations",
        ),
        ({"points": [[0, 0, 0], [0, 0, 1], [0, 0, 2]]}, "three points on a line"),
    ],
)
def test_mistakes_are_located(tmp_path, given, message):
    turn, system = turned(given.get("kind", "rectangular"))
    given = {"snubbers": [], "probes": [{"name": "a", "at": {"node": 3}}], "outputs": [], **given}
    with pytest.raises(ScenarioError, match=message):
        beamsim.run(written(tmp_path, turn, system, **given))


def test_some_directions_of_a_node_suffice_where_they_are_axes_of_the_model(tmp_path):
    """A cylinder about the model's z: z of a node alone, and its x and y together."""
    np.savez(tmp_path / "two.npz", m=np.eye(4), k=np.diag([1e4, 2e4, 5e4, 3e4]))
    (tmp_path / "dofs.csv").write_text(
        "node,direction,x,y,z,system\n1,z,1,1,0,4\n2,x,0,2,0,4\n2,y,0,2,0,4\n3,z,0,0,0,\n"
    )
    body = {"kind": "matrices", "mass": {"file": "two.npz", "name": "m"}, "stiffness": {"file": "two.npz", "name": "k"},
            "dofs": "dofs.csv", "base": "free",
            "systems": [{"number": 4, "kind": "cylindrical", "points": [[0, 0, 0], [0, 0, 1], [1, 0, 0]]}]}  # fmt: skip
    (tmp_path / "case.yaml").write_text(yaml.safe_dump({"bodies": {"two": body}}))
    scenario = load_scenario(tmp_path / "case.yaml")
    given, _ = read_body(with_places_of_files(scenario, "two"), "two")
    assert given.table.dofs == ((1, "z"), (2, "x"), (2, "y"), (3, "z"))
    # at (0, 2) the radial direction is y, and the tangential one -x
    assert given.stiffness.diagonal() == pytest.approx([1e4, 5e4, 2e4, 3e4])
