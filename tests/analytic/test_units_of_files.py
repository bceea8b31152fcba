"""Matrices in the units of other programs against the same in SI units, entry by entry."""

import numpy as np
import pytest
from scipy.io import mmwrite, savemat
from scipy.sparse import csc_array

from beamsim.matrix_files import write_matrices
from beamsim.scenario import load_scenario
from beamsim.structures.assembly import bodies_of
from beamsim.structures.matrices import summaries_of_files
from beamsim.structures.places import UPWARDS, BaseDirection
from tests.helpers.commands import invoke

pytestmark = pytest.mark.quick

# SI sizes of the units of length, mass, force and time, as an engineer would write them.
INCH, POUND = 0.0254, 4.4482216152605
SYSTEMS = {
    "mm-t-s": (1e-3, 1e3, 1.0, 1.0),
    "mm-kg-ms": (1e-3, 1.0, 1e3, 1e-3),
    "mm-g-ms": (1e-3, 1e-3, 1.0, 1e-3),
    "mm-kg-s": (1e-3, 1.0, 1e-3, 1.0),
    "cm-g-s": (1e-2, 1e-3, 1e-5, 1.0),
    "in-lbf-s": (INCH, POUND / INCH, POUND, 1.0),
    "ft-lbf-s": (0.3048, POUND / 0.3048, POUND, 1.0),
    "{length: mm, mass: kg, force: N}": (1e-3, 1.0, 1.0, 1.0),  # WTMASS left out
    "{length: in, mass: lb, force: lbf, time: ms}": (INCH, 0.45359237, POUND, 1e-3),
}
DOFS = [(0, "modal"), (0, "modal"), (1, "z"), (1, "ry"), (2, "z"), (2, "ry"), (3, "z"), (3, "ry")]
PLACES = {1: (0.25, 0.01, 0.0), 2: (0.5, 0.0, 0.02), 3: (0.0, 0.0, 0.0)}
ROWS = ["stress", "moved"]


def in_si():
    """A bar on node 3: two links of beam elements with two modes beside them, and what is recovered from it."""
    rng = np.random.default_rng(5)
    matrices = {}
    stiffness, mass, damping = (np.zeros((8, 8)) for _ in range(3))
    for first, second in ((6, 2), (2, 4)):
        at = [first, first + 1, second, second + 1]
        a = 0.25
        element = np.array([[12, -6 * a, -12, -6 * a], [-6 * a, 4 * a * a, 6 * a, 2 * a * a],
                            [-12, 6 * a, 12, 6 * a], [-6 * a, 2 * a * a, 6 * a, 4 * a * a]])  # fmt: skip
        stiffness[np.ix_(at, at)] += 36.0 / a**3 * element
        inertia = np.array([[156, -22 * a, 54, 13 * a], [-22 * a, 4 * a * a, -13 * a, -3 * a * a],
                            [54, -13 * a, 156, 22 * a], [13 * a, -3 * a * a, 22 * a, 4 * a * a]])  # fmt: skip
        mass[np.ix_(at, at)] += 0.675 * a / 420 * inertia
    stiffness[:2, :2] = np.diag([4e4, 9e5])
    mass[:2, :2] = np.eye(2)
    mass[:2, 2:6] = 0.2 * rng.uniform(-1, 1, (2, 4)) * np.sqrt(mass.diagonal()[2:6])
    mass[2:6, :2] = mass[:2, 2:6].T
    damping[:6, :6] = 1e-5 * stiffness[:6, :6]
    damping[2:, 2:] = 1e-5 * stiffness[2:, 2:]
    matrices = {"mass": mass, "stiff": stiffness, "viscous": damping, "k4": 0.03 * stiffness}
    return {**matrices, "recovery": rng.normal(size=(2, 8)) * [0.1, 0.1, 1, 0.1, 1, 0.1, 0, 0]}


def in_units(si, length, mass, force, time):
    """By the units of every kind of entry: displacement with displacement, with rotation, with mode, ..."""
    kind = np.array(["m" if d == "modal" else "t" if d == "z" else "r" for _, d in DOFS])
    mode = {"m": 1.0, "t": mass**-0.5, "r": mass**-0.5 / length}  # a unit modal mass stays one
    of_mass = {"tt": 1 / mass, "tr": 1 / (mass * length), "rr": 1 / (mass * length**2)}
    of_stiffness = {"tt": length / force, "tr": 1 / force, "rr": 1 / (force * length)}
    rate = force / (mass * length)  # of a consistent system 1 / time^2
    for other in "mtr":
        of_mass[f"m{other}"] = mode[other]
        of_stiffness[f"m{other}"] = mode[other] / rate

    def entries(factors):
        return np.array([[factors[a + b] if a + b in factors else factors[b + a] for b in kind] for a in kind])

    stiffness = entries(of_stiffness)
    column = np.array([{"t": length, "r": 1.0, "m": length * mass**0.5}[each] for each in kind])
    return {
        "mass": si["mass"] * entries(of_mass),
        "stiff": si["stiff"] * stiffness,
        "viscous": si["viscous"] * stiffness / time,
        "k4": si["k4"] * stiffness,
        "recovery": si["recovery"] * column,
    }


def punched(path, name, matrix):
    """One matrix as DMIG entries; scalar points, which have no component, for the modes."""
    numbers = [(901 + i, 0) if d == "modal" else (n, 3 if d == "z" else 5) for i, (n, d) in enumerate(DOFS)]
    lines = [f"DMIG,{name.upper()},0,6,2,0"]
    for j, (node, component) in enumerate(numbers):
        for i in range(j, len(numbers)):
            if matrix[i, j]:
                row = f"{numbers[i][0]},{numbers[i][1]},{float(matrix[i, j])!r}"
                lines.append(f"DMIG,{name.upper()},{node},{component},,{row}")
    path.write_text("\n".join(lines) + "\n")


def write(folder, ending, matrices):
    """Files of all matrices; how the section names each."""
    if ending in (".op4", ".bin.op4"):
        write_matrices(folder / "it.op4", matrices, binary=ending != ".op4")
        return {name: f"{{file: it.op4, name: {name}}}" for name in matrices}
    if ending in (".mat", ".npz"):
        (savemat if ending == ".mat" else np.savez)(folder / f"it{ending}", **(
            {"mdict": matrices} if ending == ".mat" else matrices))  # fmt: skip
        return {name: f"{{file: it{ending}, name: {name}}}" for name in matrices}
    for name, matrix in matrices.items():
        if ending == ".mtx" or name == "recovery":
            mmwrite(str(folder / f"{name}.mtx"), csc_array(matrix), precision=17)
        else:
            punched(folder / f"{name}.pch", name, matrix)
    return {n: f"{{file: {n}{ending if n != 'recovery' else '.mtx'}}}" for n in matrices}


def case(folder, matrices, sizes=None, units="SI", ending=".op4"):
    folder.mkdir(exist_ok=True)
    files = write(folder, ending, matrices)
    length = 1.0 if sizes is None else sizes[0]
    lines = ["node,direction,x,y,z"]
    for k, (node, direction) in enumerate(DOFS):
        place = "" if direction == "modal" else ",".join(repr(x / length) for x in PLACES[node])
        lines.append(f"{901 + k if ending == '.pch' and direction == 'modal' else node},{direction},{place or ',,'}")
    (folder / "dofs.csv").write_text("\n".join(lines) + "\n")
    (folder / "case.yaml").write_text(f"""
bodies:
  bar:
    kind: matrices
    mass: {files["mass"]}
    stiffness: {files["stiff"]}
    viscous: {files["viscous"]}
    structural_damping: {{{files["k4"][1:-1]}, frequency: 40 Hz}}
    recovery: {{{files["recovery"][1:-1]}, rows: [{", ".join(ROWS)}]}}
    dofs: dofs.csv
    units: {units}
    base: {{nodes: [3], direction: z}}
snubbers: [{{name: tip, at: {{node: 2}}, side: below, stiffness: 1e5, gap: 1e-4}}]
excitation: {{kind: harmonic, applied_to: base, level: 2 g, frequency: 20 Hz}}
run: {{duration: 1 ms, convergence: 'off'}}
""")
    return load_scenario(folder / "case.yaml")


def same(one, other, size):
    """To 1e-12 of what the diagonals make of an entry."""
    one, other = (each.toarray() for each in (one, other))
    assert np.abs((one - other) / size).max() <= 1e-12


def agree(folder, units, ending=".op4"):
    si = in_si()
    known = bodies_of(case(folder / "si", si))[0]
    read = bodies_of(case(folder / "units", in_units(si, *SYSTEMS[units]), SYSTEMS[units], units, ending))[0]
    for name in ("mass", "stiffness", "damping"):
        one, other = (getattr(body.source_matrices, name) for body in (known, read))
        root = np.sqrt(one.diagonal())
        root[root == 0.0] = root[root > 0.0].min()
        same(one, other, np.outer(root, root))
    places = [body.source_matrices.table.coordinates for body in (known, read)]
    np.testing.assert_allclose(places[1], places[0], rtol=1e-13)
    time = SYSTEMS[units][3]
    for motion in (UPWARDS, BaseDirection("ry")):
        for derivative in range(3):
            rows = [(body, body.recovery_row(0, derivative)) for body in (known, read)]
            one, other = ((row @ body.all_dofs_map, row @ body.rigid_motion(motion)) for body, row in rows)
            np.testing.assert_allclose(other[0] / time**derivative, one[0], rtol=1e-12)
            np.testing.assert_allclose(other[1] / time**derivative, one[1], rtol=1e-12)
    return known, read


@pytest.mark.parametrize("units", SYSTEMS)
def test_every_system_of_units_is_the_same_structure_in_si(tmp_path, units):
    known, read = agree(tmp_path, units)
    for motion in (UPWARDS, BaseDirection("ry")):
        for one, other in zip(known.base_load(motion), read.base_load(motion), strict=True):
            np.testing.assert_allclose(other, one, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("ending", [".bin.op4", ".pch", ".mat", ".npz", ".mtx"])
def test_every_format_is_converted(tmp_path, ending):
    agree(tmp_path, "mm-kg-ms", ending)


@pytest.mark.parametrize(
    ("written", "stated", "warns"),
    [
        ("mm-t-s", None, "are they in mm or"),
        ("mm-t-s", "SI", None),
        ("mm-t-s", "mm-t-s", None),
        ("in-lbf-s", None, "or inches"),
        (None, None, None),
        (None, "mm-t-s", "coordinates of the table in metres"),
    ],
)
def test_sizes_and_masses_of_other_units_are_noticed_and_said(tmp_path, written, stated, warns):
    si, sizes = in_si(), SYSTEMS.get(written)
    matrices = si if sizes is None else in_units(si, *sizes)
    if written is None and stated:  # the matrices in mm, and the table in metres
        matrices = in_units(si, *SYSTEMS[stated])
    scenario = case(tmp_path, matrices, sizes, stated or "null")
    (found,) = summaries_of_files(scenario)
    assert (found.units, found.units_assumed) == (stated or "SI", stated is None)
    assert [warns in remark for remark in found.remarks if "structure has" in remark] == ([True] if warns else [])
    if stated == written:
        assert found.text.startswith("bar: 8 degrees of freedom, 0.3375 kg, 0.5 x 0.01 x 0.02 m; units: ")


@pytest.mark.parametrize("without_run", [["--set", "run=null"], []])
def test_validate_says_what_was_assumed(tmp_path, without_run):
    case(tmp_path, in_units(in_si(), *SYSTEMS["mm-t-s"]), SYSTEMS["mm-t-s"], "null")
    printed = invoke("validate", tmp_path / "case.yaml", *without_run)
    assert printed.exit_code == 0
    assert "bar: 8 degrees of freedom, 0.0003375 kg, 500 x 10 x 20 m; units: SI, the default" in printed.stdout
    assert "beamsim: warning: bar: the structure has 0.0003375 kg, 500 x 10 x 20 m, if its files are" in printed.stderr
