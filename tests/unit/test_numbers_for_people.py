"""Numbers on screens and plots: the prefix of the rounded number, and the digits that its convergence supports."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beamsim.cli.screens import Errors, round_with_unit
from beamsim.outcomes import Outcome, OutcomeKind, Where
from beamsim.plots.drawing import Chart, Curve
from beamsim.plots.style import amount, extent, level_text, scale_for, use_units, value_text

pytestmark = pytest.mark.quick


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.99998, "J", "1 J"),
        (0.9999, "J", "999.9 mJ"),
        (999.96, "N", "1 kN"),
        (-999.96, "N", "-1 kN"),
        (999.94, "N", "999.9 N"),
        (9.9999e-5, "m", "0.1 mm"),
        (0.099999, "m", "0.1 m"),
        (999.99e6, "Pa", "1 GPa"),
        (999.99e9, "Pa", "1000 GPa"),  # there is no longer prefix
        (9.99999e-7, "m^2", "1 mm^2"),
        (0.999999, "kg", "1 kg"),
        (9.99999e-4, "kg", "1 g"),
        (0.999996, "s", "1 s"),
        (599.999, "s", "10 min"),
        (7199.99, "s", "2 h"),
        (999.99, "N s/m", "1 kN s/m"),
        (999.999, "Hz", "999.999 Hz"),  # frequencies have no prefix
        (0.99999, "MPa", "1 MPa"),  # nor have units with one
    ],
)
def test_the_prefix_is_that_of_the_rounded_number(value, unit, text):
    """0.99998 J was "1000 mJ", beside 1 J."""
    assert amount(value, unit) == text


def test_every_way_to_print_a_number_chooses_the_prefix_of_the_rounded_one():
    assert amount(0.9996, "J", 3) == "1 J"
    assert amount(0.99998, "J", 5) == "999.98 mJ"
    assert extent(0.99998, 1.2, "J") == "1 to 1.2 J"
    assert level_text(999.98, "N") == "level 1 kN"
    assert value_text("work_j", 0.99998) == "1 J"
    assert value_text("works_j", [0.5, 0.99998]) == "0.5, 1 J"
    assert round_with_unit(0.9996, "J") == "1.00 J"
    assert round_with_unit(0.99996, "J", 5) == "999.96 mJ"
    where = Outcome.of(OutcomeKind.STOPPED, "end", at=Where(0.9999999, "N")).in_display_units(scale_for)
    assert where.text == "stopped at 1 N"
    with use_units({"N": (1e-3, "kN")}):
        assert amount(999.98, "N") == "1 kN"
        assert amount(99.998, "N") == "0.1 kN"


def test_the_axis_of_a_plot_has_the_unit_of_its_rounded_numbers():
    x = np.linspace(0.0, 1.0, 5)
    chart = Chart(("Time", "s"), ("Force", "N"), [Curve("tip", 0.99998 * x, 999.98 * x)])
    assert [scale.unit for scale in chart.scales] == ["s", "kN"]


@given(st.floats(1e-11, 1e11), st.sampled_from(["N", "J", "Pa", "N/m", "N s/m", "rad"]), st.integers(3, 6))
def test_no_number_is_a_thousand_where_there_is_a_prefix(value, unit, digits):
    number, shown = amount(value, unit, digits).split(" ", 1)
    assert float(number) < 1000.0 or shown.startswith("G")
    assert float(number) >= 1.0 or shown.startswith("p")


@pytest.mark.parametrize(
    ("error", "text"),
    [(None, "19.4 N"), (0.0, "19.4 N"), (2e-5, "19.4 N"), (0.0078, "19.4 N"), (0.05, "19.4 N *"), (0.6, "19 N *")],
)
def test_a_number_has_the_digits_that_its_convergence_supports(error, text):
    known = {} if error is None else {"tip": error}
    doubtful = ["peak_force_n.tip"] if error is not None and error > 0.02 else []
    summary = {"convergence": {"peak_force_n": known}, "doubtful": doubtful}
    errors = Errors(SimpleNamespace(summary=summary))
    assert errors.number(19.4, "N", "peak_force_n", "tip") == text
    assert len(list(errors.legend())) == len(doubtful)
    assert list(errors.other_errors()) == []
    said = "" if error is None else errors.text("peak_force_n", "tip")
    assert said == {None: "", 0.0: "no error", 0.05: "NOT CONVERGED, error 5 %"}.get(error, said)


def test_one_reading_of_the_convergence_serves_numbers_and_table():
    """A value of one of many motions has a mark on the first screen, and words in the table."""
    summary = {
        "convergence": {"peak_force_n": {"tip": 0.001, "root": 0.01}, "largest_bending_stress_pa": 0.03},
        "doubtful": ["largest_bending_stress_pa"],
        "after_divergence": ["peak_force_n.tip"],
    }
    errors = Errors(SimpleNamespace(summary=summary))
    assert errors.number(2.0, "N", "peak_force_n", "tip") == "2.00 N ~"
    assert errors.number(3e6, "Pa", "largest_bending_stress_pa") == "3.00 MPa *"
    assert errors.number(np.nan, "N", "peak_force_n", "root") == "unknown"
    assert len(list(errors.legend())) == 2
    assert dict(errors.other_errors()) == {"peak force of root": "error 1 %"}
    assert errors.text("peak_force_n", "tip") == "one of many motions, error 0.1 %"
