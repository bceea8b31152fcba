"""Plots: every result can be drawn, and the curves are those of the result."""

import math
import os

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from sampling import first_apart

import beamsim
from beamsim.analyses.run.layouts import SRS
from beamsim.plots import run as plots
from beamsim.plots.drawing import HERTZ, Chart, Curve, Picture, save_figures, thin_out
from beamsim.scenario import load_scenario

EVERYTHING = {
    "displacement",
    "acceleration",
    "contact_force",
    "force_deflection",
    "spectrum",
    "phase_portrait",
    "deflected_shapes",
}


@first_apart(
    ("how", "missing"),
    1,
    [
        ({"snubbers": ()}, {"contact_force", "force_deflection"}),
        ({"snubbers": tuple("abcdefgh"), "probes": tuple("pqrstuvw")}, set()),
        ({"chain": True, "frequency": math.nan}, {"deflected_shapes"}),
        ({"duration": 0.001, "rate": 1000.0}, {"contact_force", "force_deflection"}),
    ],
)  # fmt: skip
def test_every_kind_of_result_gets_its_pictures(how, missing, fabricated_run, tmp_path):
    files = save_figures(plots.run_figures(fabricated_run(**how)), tmp_path, "case")
    assert {path.name for path in files} == {f"case_{name}.png" for name in EVERYTHING - missing}
    assert set(os.listdir(tmp_path)) == {path.name for path in files}
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in files)


def test_curves_are_the_result_with_units(fabricated_run):
    result = fabricated_run()
    ax = result.plot()["displacement"].axes[0]
    np.testing.assert_allclose(
        ax.lines[0].get_ydata(), 1e3 * result["histories"]["displacement"].sel(probe="tip").values
    )
    assert ax.get_ylabel().endswith("(mm)")
    assert ax.get_xlabel() == "Time (s)"
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["tip", "middle"]
    assert len({line.get_linestyle() for line in ax.lines}) == 2  # told apart without colour


def test_force_is_over_penetration_in_contact_alone(fabricated_run):
    result = fabricated_run()
    closed, curve = result["histories"]["snubber_closed"].values[0], plots.force_deflection(result).curves[0]
    np.testing.assert_array_equal(np.isfinite(curve.y), closed)
    assert np.any(closed)


def test_spectrum_is_over_the_excitation_frequency(fabricated_run):
    result = fabricated_run()
    chart = plots.spectrum(result)
    spectra = result["spectra"]
    levels = spectra["amplitude_db"].sel(signal="tip absolute_acceleration").values
    np.testing.assert_allclose(chart.curves[0].x, spectra["frequency_hz"].values / 65.0)
    np.testing.assert_allclose(chart.curves[0].y, levels)
    assert "excitation frequency" in chart.x_axis[0]
    assert plots.spectrum(fabricated_run(frequency=math.nan)).x_axis == ("Frequency", HERTZ)


@first_apart("how", 1, [{"snubbers": tuple("abcdefgh")}, {}])
def test_labels_lie_in_the_figure_and_panels_do_not_overlap(how, fabricated_run):
    for figure in fabricated_run(**how).plot().values():
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        boxes = [ax.get_tightbbox(canvas.get_renderer()) for ax in figure.axes if ax.get_visible()]
        boxes += [text.get_window_extent(canvas.get_renderer()) for text in figure.texts]
        assert all(box.height > 0.0 for box in boxes)
        assert all(b.x0 >= -12 and b.y0 >= 0 and b.x1 <= figure.bbox.x1 + 12 and b.y1 <= figure.bbox.y1 for b in boxes)
        for k, one in enumerate(boxes):
            for other in boxes[:k]:
                across = min(one.x1, other.x1) - max(one.x0, other.x0)
                along = min(one.y1, other.y1) - max(one.y0, other.y0)
                assert min(across, along) < 12  # pixels: a tick label at the corner of a panel


def test_thinning_keeps_the_extremes():
    time = np.arange(1_000_003.0)
    x = np.zeros(time.size)
    x[123_457], x[777_777], x[-1] = 5.0, -7.0, 1.0
    few_t, few_x = thin_out(time, x, 40_000)
    assert few_t.size < 50_000
    assert np.all(np.diff(few_t) >= 0)
    assert (few_x.max(), few_x.min(), few_x[-1]) == (5.0, -7.0, 1.0)
    assert few_t[few_x.argmax()] == 123_457
    assert thin_out(time[:100], x[:100], 40_000)[0].size == 100


def test_thinning_keeps_holes_and_the_extremes_beside_them():
    time = np.arange(300_000.0)
    x = np.where((time > 1e5) & (time < 2e5), np.nan, np.cos(time))
    x[100_000] = 9.0
    few_t, few_x = thin_out(time, x, 4000)
    assert few_x[few_t == 100_000] == [9.0]
    assert np.isnan(few_x[(few_t > 100_200) & (few_t < 199_800)]).all()
    assert few_x.size < 4200


@pytest.mark.parametrize("loop", [False, True])
def test_long_curves_are_drawn(loop, tmp_path):
    """Neither a history of many samples nor a loop exceeds what the renderer can take."""
    count = 40_000 if loop else 150_000
    phase = 0.7 * np.arange(float(count))
    curve = Curve("many", np.cos(phase) if loop else phase, np.sin(phase) * np.cos(1.3 * phase))
    picture = Picture("", [Chart(("x", ""), ("y", ""), [curve])])
    (drawn,) = picture.figure().axes[0].get_lines()
    assert drawn.get_xdata().size == (count if loop else 12_000)
    assert np.ptp(drawn.get_ydata()) == pytest.approx(np.ptp(curve.y), rel=1e-12)
    (file,) = save_figures({"many": picture}, tmp_path, "case")
    assert file.stat().st_size > 1000


def test_a_shock_is_shown_whole_with_its_input():
    result = beamsim.run(
        load_scenario(
            {
                "chain": {"masses": [1.0], "springs": [4e3], "dashpots": [5.0]},
                "excitation": {"kind": "half_sine", "applied_to": "base", "level": "10 g", "duration": "11 ms"},
                "run": {"duration": 0.3, "sample_rate": "2 kHz", "convergence": "off"},
            }
        )
    )
    figures = result.plot()
    (ax,) = figures["displacement"].axes
    assert ax.get_xlim() == pytest.approx((0.0, result["histories"]["time"].values[-1]))
    above, below = figures["acceleration"].axes
    assert "base" in below.get_ylabel()
    assert below.lines[0].get_ydata().max() == pytest.approx(10.0, rel=1e-3)
    assert above.get_xlim() == below.get_xlim()


def test_a_residual_of_nothing_does_not_squeeze_the_spectra():
    f = np.geomspace(10.0, 100.0, 5)
    of_input = dict.fromkeys(("maximax", "primary", "positive", "negative"), f[None])
    known = {"quality": 10.0, "frequency_hz": f, "signal": ["input acceleration"], "name": ["input"], **of_input}
    nothing, something = (SRS.dataset(known | {"residual": share * f[None]}) for share in (1e-6, 0.5))
    assert plots.shock_response(nothing, "").y_ends == (1.0, None)
    assert plots.shock_response(something, "").y_ends == (None, None)


def test_no_picture_is_of_a_contact_that_never_was(fabricated_run):
    result = fabricated_run()
    result["histories"]["snubber_force"].values[:] = 0.0
    assert set(plots.run_figures(result)) == EVERYTHING - {"contact_force", "force_deflection"}


def test_no_label_is_cut():
    """The long label of a low panel."""
    high, low = (Chart(("Time", "s"), ("Absolute acceleration (dB re peak)", ""), []) for _ in range(2))
    figure = Picture("case", [high, low]).figure()
    FigureCanvasAgg(figure).draw()
    for ax in figure.axes:
        label = ax.yaxis.label.get_window_extent()
        assert label.height <= ax.bbox.height + 1.0
        assert ax.get_ylabel().replace("\n", " ") == "Absolute acceleration (dB re peak)"
