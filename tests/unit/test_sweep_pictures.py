"""Pictures of sweeps: accelerations and transmissibility of all probes, spectrograms, levels where they differ."""

import numpy as np
import pytest

from beamsim.analyses.sweep.analysis import sweep
from beamsim.scenario import load_scenario

CASE = {
    "chain": {"masses": [1, 0.5], "springs": [39478.4, 60000, 0], "damping": {"kind": "modal", "ratio": "2 %"}},
    "excitation": {"kind": "harmonic", "applied_to": "base", "level": "1 g", "frequency": "20 Hz"},
    "probes": [{"name": "first", "mass": 1}, {"name": "second", "mass": 2}],
    "sweep": {"kind": "swept_sine", "from": "15 Hz", "to": "35 Hz", "rate": "4 oct/min", "orders": [1]},
}
STOP = {"name": "stop", "mass": 2, "side": "below", "stiffness": 60000, "gap": "5 mm"}


def result(chain=None, **settings):
    return sweep(
        load_scenario({**CASE, "chain": {**CASE["chain"], **(chain or {})}, "sweep": {**CASE["sweep"], **settings}})
    )


@pytest.fixture(scope="module")
def swept():
    return result(history_rate=400.0, levels=[2.0, 4.0])


def test_transmissibility_of_every_probe_with_its_quality():
    """The first mode has 2 % of damping: Q is 25 where the sweep is slow."""
    slow = result(rate="0.6 oct/min", **{"from": "24 Hz", "to": "29 Hz"})
    above, below = slow.plot()["acceleration"].axes
    labels = [text.get_text() for text in below.get_legend().get_texts()]
    assert [label.split(",")[0] for label in labels[:2]] == ["first", "second"]
    for label in labels[:2]:
        assert float(label.split("Q ")[1].split()[0]) == pytest.approx(25.0, rel=0.1)
    assert len(above.lines) == 2


def test_a_force_has_no_transmissibility():
    excitation = {**CASE["excitation"], "applied_to": {"mass": 2}, "level": "1 N"}
    driven = sweep(load_scenario({**CASE, "excitation": excitation}))
    assert len(driven.plot()["acceleration"].axes) == 1


def test_a_spectrogram_follows_the_sweep(swept):
    axes = swept.plot()["spectrogram_0"].axes[0]
    (image,) = axes.images
    level = image.get_array()
    left, right, low, high = image.get_extent()
    time, frequency = (
        start + (end - start) * (np.arange(size) + 0.5) / size
        for start, end, size in ((left, right, level.shape[1]), (high, low, level.shape[0]))
    )
    curve = swept.curves["up_0"]
    for column in range(10, level.shape[1] - 10, 40):
        strongest = frequency[int(np.argmax(level[:, column]))]
        assert strongest == pytest.approx(np.interp(time[column], curve.time, curve.frequency_hz), rel=0.05)
    assert level.max() == pytest.approx(0.0, abs=1e-9)


def test_levels_are_compared_in_the_units_that_are_shown(swept):
    """Displacement in mm per g; the harmonics have a panel for each level."""
    figures = swept.plot()
    axes = figures["levels"].axes[0]
    assert axes.get_ylabel().endswith("(mm per g)")
    curve = swept.curves["up_0"]
    expected = 1e3 * np.max(curve.channel("displacement", "first").peak / (curve.excitation_amplitude / 9.80665))
    assert np.max(axes.lines[0].get_ydata()) == pytest.approx(expected, rel=1e-6)
    panels = figures["harmonic_energy"].axes
    for panel, level in zip(panels, ("level 0.2039 g", "level 0.4079 g"), strict=True):
        assert level in panel.get_ylabel()
    for panel in panels:
        assert panel.get_ylabel().endswith("(mm per g)²")
        assert panel.get_ylim()[0] < np.max(panel.lines[0].get_ydata()) < panel.get_ylim()[1]


def test_a_stop_that_just_touches_has_no_line_on_a_logarithmic_axis():
    """A panel without any is left out; its share of contact is that of any level, which is drawn once."""
    figures = result({"snubbers": [{**STOP, "gap": 0.0}]}, rate="60 oct/min", levels=[0.5, 9.80665]).plot()
    (preload,) = figures["contact_levels"].axes
    assert "Preload" in preload.get_ylabel()
    force, share = figures["contact"].axes
    assert "level 1 g" in force.get_ylabel()
    assert share.lines[1].get_label() == "stop, level 1 g"
