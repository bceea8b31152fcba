"""Text tables are bounded in lines, columns, cells and characters, and read only where memory is free for them."""

import numpy as np
import pytest

from beamsim.analyses.compare_modes.analysis import read_shapes
from beamsim.errors import BeamsimError, InputFileError
from beamsim.measurements import tables
from beamsim.measurements.read import read_file
from beamsim.scenario import load_scenario
from beamsim.structures.named_matrices import read_dof_table
from beamsim.system.force_tables import read_forces

pytestmark = pytest.mark.quick
BEAM = "beam: {length: 270 mm, width: 50 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700 kg/m^3}\n"
READERS = {
    "record": read_file, "table of degrees of freedom": read_dof_table, "force-deflection table": read_forces,
    "mode shapes": lambda path: read_shapes(path, load_scenario(BEAM)),
}  # fmt: skip


def wide(columns, separator):
    return "headings\n" + 2 * (separator.join(["1.5"] * columns) + "\n")


@pytest.mark.parametrize("read", READERS.values(), ids=READERS)
@pytest.mark.parametrize("separator", [",", ";", "\t", " "])
def test_columns_are_bounded(read, separator, tmp_path):
    (tmp_path / "a.csv").write_text(wide(tables.MOST_COLUMNS + 1, separator))
    with pytest.raises(BeamsimError) as refused:
        read(tmp_path / "a.csv")
    text = f"{refused.value} {getattr(refused.value, 'remedy', '')}"
    assert "has 10001 columns in line 2; up to 10000 are read" in text
    assert "export fewer channels or samples to a file, or export HDF5 or MATLAB" in text
    assert refused.value.exit_code == 2


def test_every_column_up_to_the_bound_is_read_on_its_axis(tmp_path, monkeypatch):
    count = 1000
    monkeypatch.setattr(tables, "MOST_COLUMNS", count)
    names = ["time (s)", *(f"a{k} (g)" for k in range(1, count))]
    rows = [[0.1 * row, *(np.arange(1, count) + row)] for row in range(3)]
    (tmp_path / "a.csv").write_text("\n".join(",".join(map(str, row)) for row in (names, *rows)))
    channels = read_file(tmp_path / "a.csv")
    assert [channel.name for channel in channels] == names
    assert {channel.axis for channel in channels[1:]} == {"time (s)"}
    np.testing.assert_array_equal(channels[-1].y, count - 1 + np.arange(3))


@pytest.mark.parametrize(
    ("bound", "most", "text", "message"),
    [
        ("MOST_CELLS", 30, "t,a\n" + 20 * "1,2\n", "has 42 cells in 21 lines; up to 30 cells are read"),
        ("MOST_CELLS", 30, "t a\n" + 20 * "1  2\n", "has 42 cells in 21 lines; up to 30 cells are read"),
        ("MOST_LINES", 100, "t,a\n" + 201 * "\n" + "1,2\n", "has 203 line ends; up to 100 lines are read"),
        ("MOST_LINES", 100, "t,a\n1,2\n" + 200 * "\f", "has 202 line ends; up to 100 lines are read"),
        ("MOST_CHARACTERS_OF_LINE", 90, "t,a\n1,2\n" + 100 * " " + "2,3\n", "103 characters in line 3; up to 90 are"),
        ("MOST_CHARACTERS_OF_LINE", 90, f"t,a\n1,2\n2,'{100 * 'x'}'\n", "104 characters in line 3; up to 90 are read"),
        ("MOST_CHARACTERS_OF_CELL", 2000, f"t,a\n1,{2001 * '1'}\n", "a cell of 2001 characters in line 2; up to 2000"),
        ("MOST_CHARACTERS_OF_CELL", 2000, f"t,{2001 * 'a'}\n1,2\n", "a cell of 2001 characters in line 1; up to 2000"),
    ],
)
def test_lines_cells_and_characters_are_bounded(bound, most, text, message, tmp_path, monkeypatch):
    (tmp_path / "a.csv").write_text(text)
    monkeypatch.setattr(tables, bound, most)
    with pytest.raises(InputFileError, match=message):
        read_file(tmp_path / "a.csv")


def test_a_table_without_room_in_memory_is_refused_before_it_is_taken_apart(tmp_path, monkeypatch):
    (tmp_path / "a.csv").write_text("t (s),a (g)\n" + 40_000 * "1,2\n")
    monkeypatch.setattr("beamsim.files.free_memory", lambda: 13_500_000.0)
    with pytest.raises(InputFileError, match=r"needs 20 MB of memory for its 80002 cells, and 13\.5 MB are free"):
        read_file(tmp_path / "a.csv")
    monkeypatch.setattr("beamsim.files.free_memory", lambda: 11_000_000.0)
    with pytest.raises(InputFileError, match=r"needs 13\.1 MB of memory for its 40002 lines, and 11 MB are free"):
        read_file(tmp_path / "a.csv")
