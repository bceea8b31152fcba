"""Bodies with matrices of other programs against the bodies that the matrices came from."""

import tempfile
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.sparse import block_diag, csc_array, eye_array

from beamsim.errors import ScenarioError
from beamsim.matrix_files import write_matrices
from beamsim.scenario import load_scenario
from beamsim.structures.assembly import assemble
from beamsim.structures.matrices import structure_of
from beamsim.structures.named_matrices import DofTable, NamedMatrices, write_dof_table
from beamsim.system.build import build_system

pytestmark = pytest.mark.quick

BEAM = """
bodies:
  panel:
    kind: beam
    length: 0.5
    width: 50 mm
    thickness: 5 mm
    youngs_modulus: 70 GPa
    density: 2700
    elements: 8
    supports: {left: clamped, right: free}
    damping: {kind: modal, ratio: 1 %}
    point_masses: [{position: 0.25, mass: 20 g}]
"""
PLACE = {"built": "position: 0.5", "imported": "node: 9, direction: z"}
CASE = """
snubbers:
  - {{name: corner, at: {{body: panel, {place}}}, side: below, stiffness: 100 kN/m, gap: 0.1 mm}}
probes:
  - {{name: corner, at: {{body: panel, {place}}}}}
excitation: {{kind: harmonic, applied_to: base, level: 2 g, frequency: 20 Hz}}
reduction: {{modes: 5}}
run: {{duration: 0.2 s, sample_rate: 10 kHz, convergence: 'off', start: rest}}
"""
BODY = """
bodies:
  panel:
    kind: matrices
    mass: {{file: {folder}/panel.op4, name: mxx}}
    stiffness: {{file: {folder}/panel.op4, name: kxx}}
    dofs: {folder}/dofs.csv
    base: {base}
    damping: {{kind: modal, ratio: 1 %}}
"""


def parse_scenario(text):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "case.yaml"
        path.write_text(text)
        return load_scenario(path)


def built(text=BEAM):
    return parse_scenario(text + CASE.format(place=PLACE["built"]))


def exported(text=BEAM):
    return assemble(built(text)).named_matrices


def imported(folder: Path, mass, stiffness, table, base="{nodes: [10], direction: z}", body=BODY, case=CASE):
    write_matrices(folder / "panel.op4", {"mxx": csc_array(mass), "kxx": csc_array(stiffness)})
    write_dof_table(folder / "dofs.csv", table)
    return parse_scenario(body.format(folder=folder, base=base) + case.format(place=PLACE["imported"]))


def frequencies(scenario):
    return build_system(scenario).modes["open_frequencies_hz"].values


def problems(folder, mass, stiffness, table, **given):
    with pytest.raises(ScenarioError) as caught:
        build_system(imported(folder, mass, stiffness, table, **given))
    return str(caught.value)


def test_a_free_beam_keeps_its_rigid_motions(tmp_path):
    model = exported(BEAM.replace("left: clamped", "left: free"))
    case = imported(tmp_path, model.mass, model.stiffness, model.table, base="free")
    assert model.base == ()
    known = frequencies(built(BEAM.replace("left: clamped", "left: free")))
    read = frequencies(case)
    assert np.array_equal(read[:2], [0.0, 0.0])
    np.testing.assert_allclose(read[2:], known[2:], rtol=1e-8)


def test_motions_without_mass_follow_statically(tmp_path):
    """Rotations without inertia: the condensed eigenproblem in closed form."""
    model = exported()
    mass, stiffness = model.mass.toarray(), model.stiffness.toarray()
    rotations = np.array([direction == "ry" for _, direction in model.table.dofs])
    mass[rotations], mass[:, rotations] = 0.0, 0.0
    case = imported(tmp_path, mass, stiffness, model.table)
    free = np.arange(len(model.table.dofs) - 1)
    z, ry = free[~rotations[free]], free[rotations[free]]
    condensed = stiffness[np.ix_(z, z)] - stiffness[np.ix_(z, ry)] @ np.linalg.solve(
        stiffness[np.ix_(ry, ry)], stiffness[np.ix_(ry, z)]
    )
    squared = np.sort(np.linalg.eigvals(np.linalg.solve(mass[np.ix_(z, z)], condensed)).real)
    np.testing.assert_allclose(frequencies(case)[:5], np.sqrt(squared[:5]) / (2 * np.pi), rtol=1e-8)
    assert any("8 motions without mass" in warning for warning in build_system(case).warnings)
    acting = CASE.replace("{place}", "node: 9, direction: ry", 1)
    text = problems(tmp_path, mass, stiffness, model.table, case=acting)
    assert "snubbers[0].at.node = 9 has no mass in ry" in text


def test_mass_of_rank_one_in_offset_masses(tmp_path):
    """A mass on an offset couples translation and rotation: its block has a motion without mass."""
    model = exported()
    mass, stiffness = model.mass.toarray(), model.stiffness.toarray()
    mass[:] = 0.0
    mass[14, 14], mass[15, 15] = 0.1, 1e-5  # where the snubber is
    for node in range(7):
        offset = np.array([1.0, 0.013])
        block = slice(2 * node, 2 * node + 2)
        mass[block, block] = 0.1 * np.outer(offset, offset)
    mass[-1, -1] = 1.0
    free = np.arange(16)
    case = imported(tmp_path, mass, stiffness, model.table)
    flexibility = np.linalg.inv(stiffness[np.ix_(free, free)])
    rows = np.zeros((9, 16))
    rows[7, 14], rows[8, 15] = np.sqrt(0.1), np.sqrt(1e-5)
    for node in range(7):
        rows[node, 2 * node : 2 * node + 2] = np.sqrt(0.1) * np.array([1.0, 0.013])
    squared = np.sort(1 / np.linalg.eigvalsh(rows @ flexibility @ rows.T))
    np.testing.assert_allclose(frequencies(case)[:5], np.sqrt(squared[:5]) / (2 * np.pi), rtol=1e-8)


def test_asymmetry_of_round_off_is_removed_and_said_and_more_is_refused(tmp_path):
    model = exported()
    stiffness = model.stiffness.toarray()
    stiffness[0, 2] *= 1 + 1e-9
    system = build_system(imported(tmp_path, model.mass, stiffness, model.table))
    assert any("stiffness was made symmetric" in warning for warning in system.warnings)
    stiffness[0, 2] *= 1.01
    text = problems(tmp_path, model.mass, stiffness, model.table)
    assert "bodies.panel.stiffness is not symmetric: the entries of node 3 z and node 2 z differ" in text


def test_craig_bampton_coordinates(tmp_path):
    """Fixed-interface modes with the tip and the base as boundary: the same modes and response to the base."""
    model = exported()
    mass, stiffness = model.mass.toarray(), model.stiffness.toarray()
    boundary, inner = np.array([14, 16]), np.setdiff1d(np.arange(17), [14, 16])
    _, modes = eigh(stiffness[np.ix_(inner, inner)], mass[np.ix_(inner, inner)])
    basis = np.zeros((17, 17))
    basis[np.ix_(inner, np.arange(15))] = modes
    basis[boundary, [15, 16]] = 1.0
    basis[np.ix_(inner, [15, 16])] = np.linalg.solve(
        stiffness[np.ix_(inner, inner)], -stiffness[np.ix_(inner, boundary)]
    )
    table = DofTable((*((0, "modal"),) * 15, (9, "z"), (10, "z")))
    case = imported(tmp_path, basis.T @ mass @ basis, basis.T @ stiffness @ basis, table)
    read, known = build_system(case), build_system(built())
    np.testing.assert_allclose(
        read.modes["open_frequencies_hz"].values, known.modes["open_frequencies_hz"].values, rtol=1e-8
    )
    np.testing.assert_allclose(np.abs(read.forcing.load[0]), np.abs(known.forcing.load[0]), rtol=1e-6, atol=1e-8)
    text = problems(tmp_path, model.mass[:-1][:, :-1], model.stiffness[:-1][:, :-1], table)
    assert "bodies.panel.dofs has 17 rows, but the matrix mass has 16" in text


def test_a_spring_to_ground_in_the_matrices_is_refused_where_the_base_moves(tmp_path):
    model = exported()
    stiffness = model.stiffness.toarray()
    stiffness[14, 14] += 1e3
    assert "bodies.panel.base needs" in problems(tmp_path, model.mass, stiffness, model.table)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"base": "{nodes: [31], direction: z}"}, "base.nodes[0] = 31 is not a node of the matrices; the nodes are 2"),
        ({"base": "{nodes: [10], direction: x}"}, "none of its nodes has that direction; they have z"),
        (
            {"case": CASE + "joints: [{{kind: hinge, between: [{{node: 9}}, {{node: 8, direction: ry}}]}}]\n"},
            "joints[0].between acts between z and ry, a displacement and a rotation",
        ),
        ({"case": CASE.replace("{place}", "node: 24")}, "at.node = 24 is not a node of panel; the nodes are 2, 3"),
        ({"case": CASE.replace("{place}", "node: 9, direction: x")}, "= x is not a direction of node 9; node 9 has z"),
        ({"case": CASE.replace("{place}", "node: 10")}, "snubbers[0].at.node = 10 moves with the base"),
        ({"body": BODY.replace("name: kxx", "name: kgg")}, "stiffness.name = kgg is not a matrix of panel.op4"),
        ({"body": BODY.replace("dofs: {folder}/dofs.csv", "dofs: {folder}/none.csv")}, "bodies.panel.dofs = "),
        ({"body": BODY.replace("    dofs: {folder}/dofs.csv\n", "")}, "bodies.panel.dofs is missing"),
    ],
)  # fmt: skip
def test_mistakes_are_located(tmp_path, change, message):
    model = exported()
    assert message in problems(tmp_path, model.mass, model.stiffness, model.table, **change)


def test_negative_mass_and_stiffness_are_refused(tmp_path):
    model = exported()
    mass, stiffness = model.mass.toarray(), model.stiffness.toarray()
    mass[4, 4] *= -1
    assert "mass has a negative mass of" in problems(tmp_path, mass, stiffness, model.table)
    shifted = stiffness.copy()
    shifted[:-1, :-1] -= 3e3 * model.mass.toarray()[:-1, :-1] * 1e3
    text = problems(tmp_path, model.mass, shifted, model.table)
    assert "not positive semidefinite" in text or "negative stiffness" in text


def test_sizes_that_do_not_fit_are_named(tmp_path):
    """Matrices of different size with and without a table, and one that is not square."""
    model = exported()
    mass, stiffness = model.mass.toarray(), model.stiffness.toarray()
    smaller = stiffness[:-1, :-1]
    text = problems(tmp_path, mass, smaller, model.table)
    assert "dofs has 17 rows, but the matrix stiffness has 16; give a line for each row" in text
    body = BODY.replace("    dofs: {folder}/dofs.csv\n", "")
    text = problems(tmp_path, mass, smaller, model.table, body=body)
    assert "panel.stiffness and the others differ in size: mass has 17 rows, stiffness has 16 rows; export" in text
    text = problems(tmp_path, mass, stiffness[:-1], model.table)
    assert "panel.stiffness has 16 rows and 17 columns; give a square matrix" in text


def test_what_nothing_holds_is_named(tmp_path):
    """A row that has mass and no stiffness, and a hinge within the matrices."""
    model = exported()
    mass, stiffness = model.mass.toarray(), model.stiffness.toarray()
    loose = stiffness.copy()
    loose[3], loose[:, 3] = 0.0, 0.0
    text = problems(tmp_path, mass, loose, model.table)
    assert "bodies.panel.stiffness is zero at node 3 ry, which has mass: nothing restrains it" in text
    assert "bodies.panel.stiffness is zero; give" in problems(tmp_path, mass, 0 * stiffness, model.table)
    table = DofTable(tuple((node, direction) for node in (1, 2, 3, 4) for direction in ("z", "ry"))[:7])
    beam_stiffness = 1e4 * np.array([[12, -6, -12, -6], [-6, 4, 6, 2], [-12, 6, 12, 6], [-6, 2, 6, 4]])
    whole = np.zeros((7, 7))
    for dofs in ([0, 1, 2, 3], [2, 4, 5, 6]):  # the second beam turns about node 2
        whole[np.ix_(dofs, dofs)] += beam_stiffness
    order = [(1, "z"), (1, "ry"), (2, "z"), (2, "ry"), (3, "ry"), (4, "z"), (4, "ry")]
    table = DofTable(tuple(order))
    case = imported(tmp_path, np.eye(7), whole, table, base="{nodes: [1], direction: z}",
                    case=CASE.replace("{place}", "node: 4, direction: z"))  # fmt: skip
    warnings = build_system(case).warnings
    assert "panel: the base does not restrain it: a motion without stiffness, largest at node 4 z" in warnings


def test_rows_without_mass_and_stiffness_are_left_out(tmp_path):
    model = exported()
    wide = [np.zeros((19, 19)), np.zeros((19, 19))]
    for matrix, of_model in zip(wide, (model.mass, model.stiffness), strict=True):
        matrix[:17, :17] = of_model.toarray()
    table = DofTable((*model.table.dofs, (9, "x"), (9, "rz")))
    system = build_system(imported(tmp_path, *wide, table))
    assert "panel: rows without mass and stiffness were left out: 2" in system.warnings
    narrow = build_system(imported(tmp_path, model.mass, model.stiffness, DofTable(model.table.dofs)))
    np.testing.assert_array_equal(
        system.modes["open_frequencies_hz"].values, narrow.modes["open_frequencies_hz"].values
    )
    case = CASE.replace("{place}", "node: 9, direction: x")
    assert "at.direction = x is not a direction of node 9; node 9 has z, ry" in problems(
        tmp_path, *wide, table, case=case
    )


def test_structural_damping_is_refused_or_converted_at_a_frequency(tmp_path):
    import scipy.io

    model = exported()
    stiffness = model.stiffness.toarray()
    case = imported(tmp_path, model.mass, stiffness, model.table)
    scipy.io.savemat(tmp_path / "panel.mat", {"mxx": model.mass, "kxx": stiffness * (1 + 0.04j)})
    text = (
        case.to_yaml().replace("panel.op4", "panel.mat").replace("kind: modal, ratio: 0.01", "kind: modal, ratio: 0.0")
    )
    with pytest.raises(ScenarioError, match=r"bodies.panel.stiffness is complex"):
        build_system(parse_scenario(text))
    first = frequencies(built())[0]
    text = text.replace("    dofs:", f"    structural_damping: {{frequency: {first} Hz}}\n    dofs:")
    system = build_system(parse_scenario(text))
    assert system.modes["damping_ratios"].values[0] == pytest.approx(0.02, rel=1e-6)
    assert any("viscous damping that has the same effect" in warning for warning in system.warnings)


def test_a_beam_with_a_dashpot_is_exported_with_it(tmp_path):
    """The matrix of viscous damping acts on motion relative to the base and is read back so."""
    text = BEAM.replace("kind: modal, ratio: 1 %", "kind: viscous, coefficient: 3 N s/m^2")
    model = exported(text)
    write_matrices(tmp_path / "b.op4", {"bxx": model.damping})
    body = BODY.replace("    damping:", "    viscous: {{file: {folder}/b.op4}}\n    damping:").replace(
        "ratio: 1 %", "ratio: 0"
    )
    system = build_system(imported(tmp_path, model.mass, model.stiffness, model.table, body=body))
    np.testing.assert_allclose(
        system.modes["damping_ratios"].values[:4],
        build_system(built(text)).modes["damping_ratios"].values[:4],
        rtol=1e-8,
    )


TRIPLE = np.array([[1.0, 0.01, 0.02], [0.01, 1.0, 0.03], [0.02, 0.03, 1.0]])


def triples(count):
    """Triples of equal masses on equal springs that soft springs couple: K - k M has a diagonal of zeros."""
    table, size = DofTable(tuple((node, "z") for node in range(3 * count))), 3 * count
    stiffness = csc_array(block_diag([csc_array(TRIPLE)] * count))
    return structure_of(NamedMatrices(table, eye_array(size, format="csc"), stiffness, None, ()), name="triples")


def test_modes_are_counted_where_no_pivot_on_the_diagonal_serves():
    """Two of three frequencies lie below that of a mass on its spring; the signs of exchanged pivots would count one.

    A pivot on the diagonal is zero or round-off: the processor's arithmetic decides whether it is exchanged.
    """
    structure = triples(300)
    limit = 1.0 / structure.frequency_scale
    assert structure.frequency_count(limit) == 300 * np.sum(np.linalg.eigvalsh(TRIPLE) < 1.0) == 600


def test_of_many_nodes_the_range_and_those_next_to_an_unknown_one_are_told():
    """Numbers that are spelled alike are not near: 105 is not 1005."""
    table = DofTable(tuple((node, "z") for node in (*range(1, 101), 200, 1005)), None)
    assert table.remedy(105) == "the 102 nodes are numbered from 1 to 1005; next to it are 100 and 200"
    assert table.remedy(2000) == "the 102 nodes are numbered from 1 to 1005"
    assert table.remedy(200) == "node 200 has z"
    assert DofTable(((7, "z"), (5, "z")), None).remedy(6) == "the nodes are 5, 7"
