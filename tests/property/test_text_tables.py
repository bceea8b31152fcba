"""Tables as programs and spreadsheets write them read back the same, or are refused; never as other numbers."""

import io

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from beamsim.errors import InputFileError
from beamsim.measurements.tables import read_csv

pytestmark = pytest.mark.portable

pd = pytest.importorskip("pandas")

BLANKS = {"blank": " ", "no-break": "\u00a0", "narrow": "\u202f", "thin": "\u2009"}
THOUSANDS = {"": "", "point": ".", "comma": ",", "apostrophe": "'", "curly": "’", **BLANKS}
UNITS = (("s", "g"), ("ms", "mm/s^2"), ("s", "N"), ("min", "mm"))


def grouped(value, digits, decimal, thousands):
    """As a spreadsheet formats a number."""
    whole, _, fraction = f"{value:,.{digits}f}".partition(".")
    return whole.replace(",", thousands) + (decimal + fraction if digits else "")


def spreadsheet(columns, separator, digits, decimal, thousands):
    """Lines of a table; a cell with the separator in it is quoted."""
    rows = (
        [grouped(x, n, decimal, thousands) for x, n in zip(row, digits, strict=True)]
        for row in zip(*columns, strict=True)
    )
    return "\n".join(separator.join(f'"{cell}"' if separator in cell else cell for cell in row) for row in rows)


def read(path, text, encoding, decimal=None):
    path.write_bytes(text.encode(encoding))
    return read_csv(path, decimal)


@st.composite
def numbers(draw):
    """Times and two channels with the digits behind the decimal mark that they are written with."""
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    digits = random.choice([0, 1, 2, 3, 3, 3, 4, 6], size=3).tolist()
    scale = 10.0 ** random.integers(-1, 7, size=3)
    count = int(random.integers(2, 7))
    columns = [np.round(s * random.uniform(-1, 1, count), n) + 0.0 for s, n in zip(scale, digits, strict=True)]
    columns[0] = np.round(scale[0] * (np.arange(count) + random.integers(0, 3)), digits[0])
    assume(len(set(columns[0])) == count)
    return [column.tolist() for column in columns], digits


@pytest.mark.parametrize("examples", [50, 400])
def test_a_spreadsheet_reads_back_or_is_refused(tmp_path_factory, examples):
    @settings(max_examples=examples, deadline=None)
    @given(
        table=numbers(),
        separator=st.sampled_from([";", "\t", ",", " ", "   "]),
        decimal=st.sampled_from([".", ","]),
        thousands=st.sampled_from(sorted(THOUSANDS)),
        encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "cp1252"]),
        units=st.sampled_from(UNITS),
        headings=st.sampled_from(["brackets", "row below", "none"]),
        ending=st.sampled_from(["", "separator"]),
    )
    def check(table, separator, decimal, thousands, encoding, units, headings, ending):
        columns, digits = table
        mark = THOUSANDS[thousands]
        assume(mark != decimal and not (encoding == "cp1252" and thousands in ("narrow", "thin")))
        assume(not (mark == " " and separator.isspace() and separator != "\t"))  # no file that anyone could read
        names = {
            "brackets": [[f"Zeit ({units[0]})", f"a ({units[1]})", f"b [{units[1]}]"]],
            "row below": [["Zeit", "a", "b"], [units[0], units[1], units[1]]],
            "none": [],
        }[headings]
        if separator.isspace() and separator != "\t":
            names = [[cell.replace(" ", "_") for cell in row] for row in names] if headings == "row below" else names
        lines = [separator.join(row) for row in names] + spreadsheet(columns, separator, digits, decimal, mark).split(
            "\n"
        )
        if ending and not separator.startswith(" "):
            lines = [line + separator for line in lines]
        path = tmp_path_factory.mktemp("table") / "a.csv"
        for stated in (None, decimal):
            try:
                signals = read(path, "\n".join(lines) + "\n", encoding, stated)
            except InputFileError:
                continue
            assert len(signals) == 3
            for signal, values in zip(signals, columns, strict=True):
                np.testing.assert_array_equal(signal.y, values)
            if names:
                assert [signal.unit for signal in signals] == [units[0], units[1], units[1]]
                assert [signal.axis_unit for signal in signals] == ["", units[0], units[0]]
                assert not any(signal.is_over_frequency for signal in signals)

    check()


@settings(max_examples=50, deadline=None)
@given(table=numbers(), separator=st.sampled_from([";", "\t", ","]), decimal=st.sampled_from([".", ","]))
def test_with_the_decimal_mark_stated_a_spreadsheet_is_never_refused(tmp_path_factory, table, separator, decimal):
    columns, digits = table
    text = "time (s),a (g),b (g)\n".replace(",", separator) + spreadsheet(columns, separator, digits, decimal, "")
    signals = read(tmp_path_factory.mktemp("table") / "a.csv", text, "utf-8", decimal)
    for signal, values in zip(signals, columns, strict=True):
        np.testing.assert_array_equal(signal.y, values)


@settings(max_examples=50, deadline=None)
@given(
    table=numbers(),
    separator=st.sampled_from([";", "\t", ","]),
    decimal=st.sampled_from([".", ","]),
    index=st.booleans(),
    form=st.sampled_from([None, "%.4f", "%.6e", "%.9g"]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]),
)
def test_a_data_frame_reads_back_or_is_refused(tmp_path_factory, table, separator, decimal, index, form, encoding):
    assume(separator != decimal or form is None)  # pandas quotes floats, but not those that it formats
    columns, _ = table
    frame = pd.DataFrame(dict(zip(["time (s)", "a (g)", "f (N)"], columns, strict=True)))
    path = tmp_path_factory.mktemp("table") / "a.csv"
    frame.to_csv(path, sep=separator, decimal=decimal, index=index, float_format=form, encoding=encoding)
    try:
        signals = read_csv(path)
    except InputFileError:
        return
    written = columns if form is None else [[float(form % x) for x in column] for column in columns]
    for signal, values in zip(signals[int(index) :], written, strict=True):
        np.testing.assert_array_equal(signal.y, values)
        assert signal.axis == ("" if signal.name == "time (s)" else "time (s)")


@settings(max_examples=50, deadline=None)
@given(
    table=numbers(),
    separator=st.sampled_from([" ", ",", ";", "\t", ", ", "  "]),
    form=st.sampled_from(["%.18e", "%.6g", "%12.3f", "%.3f", "%g"]),
    header=st.sampled_from(["", "time (s)|a (g)|b (g)", "made by NumPy"]),
)
def test_an_array_saved_as_text_reads_back_or_is_refused(tmp_path_factory, table, separator, form, header):
    columns, _ = table
    text = io.StringIO()
    np.savetxt(text, np.transpose(columns), fmt=form, delimiter=separator, header=header.replace("|", separator))
    try:
        signals = read(tmp_path_factory.mktemp("table") / "a.txt", text.getvalue(), "utf-8")
    except InputFileError:
        return
    assert [signal.unit for signal in signals] == (["s", "g", "g"] if "|" in header else ["", "", ""])
    for signal, values in zip(signals, columns, strict=True):
        np.testing.assert_array_equal(signal.y, [float(form % x) for x in values])


@settings(max_examples=50, deadline=None)
@given(table=numbers(), separator=st.sampled_from([",", ";", "\t", " "]), exponent=st.sampled_from("eEdD"))
def test_numbers_with_exponents_of_matlab_and_fortran_read_back(tmp_path_factory, table, separator, exponent):
    """writematrix writes 15 digits and no headings; Fortran marks double precision with D."""
    columns, _ = table
    rows = [separator.join(f"{x:.14e}".replace("e", exponent) for x in row) for row in zip(*columns, strict=True)]
    signals = read(tmp_path_factory.mktemp("table") / "a.txt", "\n".join(rows), "utf-8")
    for signal, values in zip(signals, columns, strict=True):
        np.testing.assert_array_equal(signal.y, [float(f"{x:.14e}") for x in values])


@settings(max_examples=50, deadline=None)
@given(
    first=numbers(),
    second=numbers(),
    names=st.sampled_from(
        [("X_1", "X_2"), ("time", "time"), ("Zeit (s)", "Zeit (s)"), ("Time 1 - fast", "Time 2 - Default sample rate"),
         ("t1 (ms)", "t2 (ms)"), ("Frequency - Plot 0", "Frequency - Plot 1")]
    ),
    separator=st.sampled_from([";", "\t", ","]),
)  # fmt: skip
def test_every_group_of_columns_is_along_its_own_axis(tmp_path_factory, first, second, names, separator):
    (groups, digits), (others, more) = first, second
    longest = max(len(groups[0]), len(others[0]))
    lines = [separator.join([names[0], "a", "b", names[1], "c", "d"])]
    for k in range(longest):
        cells = []
        for columns, places in ((groups, digits), (others, more)):
            present = k < len(columns[0])
            cells += [f"{x[k]:.{n}f}" if present else "" for x, n in zip(columns, places, strict=True)]
        lines.append(separator.join(cells))
    try:
        signals = read(tmp_path_factory.mktemp("table") / "a.csv", "\n".join(lines), "utf-8")
    except InputFileError:
        return
    by_name = {signal.name: signal for signal in signals}
    for columns, wanted in ((groups, "ab"), (others, "cd")):
        for name, values in zip(wanted, columns[1:], strict=True):
            np.testing.assert_array_equal(by_name[name].x, columns[0])
            np.testing.assert_array_equal(by_name[name].y, values)
