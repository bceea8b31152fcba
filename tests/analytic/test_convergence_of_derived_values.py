"""Lines, root mean squares and statistics of random responses have their errors, from a finer model."""

import re

import numpy as np
import pytest

import beamsim
from beamsim.analyses.run.result import STATISTICS
from beamsim.cli.tables import table_rows
from beamsim.plots.run import DOUBTFUL_LINES
from beamsim.results.result import ALLOWED_ERROR
from beamsim.scenario import load_scenario
from tests.helpers.spectra import lines_of, spectrum_of

BEAM = {"length": 0.27, "bending_stiffness": 2.0, "mass_per_length": 0.25, "damping": {"kind": "modal", "ratio": 0.1}}
TIP = {"name": "tip", "position": 0.27, "side": "below", "stiffness": "100 kN/m", "gap": 0}
SHAKEN = {"kind": "harmonic", "applied_to": "base", "level": "2 g", "frequency": "65 Hz"}
PSD = [{"frequency": 20, "density": "0.01 g^2/Hz"}, {"frequency": 200, "density": "0.01 g^2/Hz"}]


def beam(**more):
    run = {"duration": 0.4, "spectrum": {"last": 0.2}} | more.pop("run", {})
    return load_scenario({"beam": BEAM, "snubbers": [TIP], "excitation": SHAKEN, "run": run} | more)


def by_frequency(result, quantity="absolute_acceleration"):
    return {round(line.frequency_hz, 6): line for line in lines_of(result, quantity, "tip")}


@pytest.fixture(scope="module")
def shaken():
    return beamsim.run(beam())


def test_errors_follow_from_the_finer_model_itself(shaken):
    """9/8 of the change to three times the modes and twice the elements."""
    modes = shaken.summary["convergence_model"]["modes"]
    finer = beamsim.run(beam(beam=BEAM | {"elements": 40}, reduction={"modes": modes}, run={"convergence": "off"}))
    for quantity in ("absolute_acceleration", "displacement"):
        other, compared = by_frequency(finer, quantity), 0
        for frequency, line in by_frequency(shaken, quantity).items():
            if line.kind in ("fundamental", "superharmonic") and frequency in other:
                a, b = line.amplitude, other[frequency].amplitude
                # the set of lines that are projected together is not quite the same
                assert line.error == pytest.approx(9 / 8 * abs(a - b) / max(a, b), rel=0.05, abs=1e-5)
                compared += 1
        assert compared > 4
    errors = shaken.summary["convergence"]
    for figure in ("rms_displacement_m", "rms_acceleration_g"):
        a, b = (result.summary[figure]["tip"] for result in (shaken, finer))
        assert errors[figure]["tip"] == pytest.approx(9 / 8 * abs(a - b) / max(a, b), rel=1e-5, abs=1e-12)


def test_a_model_of_too_few_modes_has_doubtful_lines(tmp_path):
    """Table, JSON, file and picture; the largest error over the strongest line is that of the spectrum."""
    result = beamsim.run(beam(reduction={"modes": 1}))
    name = "tip absolute_acceleration"
    assert f"spectral_lines.{name}" in result.summary["doubtful"]
    assert "rms_acceleration_g.tip" in result.summary["doubtful"]
    spectrum = spectrum_of(result, "absolute_acceleration", "tip")
    strongest = max(line.amplitude for line in spectrum.lines)
    # changes of amplitude alone: the orders of the excitation keep their frequency
    sizes = [line.error * line.amplitude for line in spectrum.lines if line.kind != "other"]
    assert np.isnan(sizes[0])  # a mean at -80 dB is leakage
    least = max(sizes[1:])
    assert result.summary["convergence"]["spectral_lines"][name] >= least / strongest * (1 - 1e-12) > ALLOWED_ERROR
    rows = [text for _, text in table_rows(result)]
    assert any("NOT CONVERGED" in text and "tip absolute acceleration" in text for text in rows)
    assert any("remainder   error" in text for text in rows)
    assert any(row["error"] > ALLOWED_ERROR for row in result.summary["spectral_lines"])
    stored = beamsim.load(beamsim.write_result(result, tmp_path / "run.h5"))
    kept = spectrum_of(stored, "absolute_acceleration", "tip")
    np.testing.assert_array_equal(*([line.error for line in s.lines] for s in (kept, spectrum)))
    assert stored.summary["convergence"] == result.summary["convergence"]
    assert "tip" in stored.summary["convergence"]["rms_acceleration_g"]
    above = stored.plot()["spectrum"].axes[0]
    marks = next(line for line in above.lines if line.get_label() == DOUBTFUL_LINES)
    changed = [line for line in spectrum.lines if line.error > ALLOWED_ERROR]
    within = [line for line in changed if line.frequency_hz <= above.get_xlim()[1] * spectrum.excitation_hz]
    assert len(marks.get_xdata()) == len(within) > 0
    assert any("lines not converged" in text.get_text() for text in above.texts)


def test_a_good_model_has_none(shaken):
    assert not any("spectral_lines" in name or "rms" in name for name in shaken.summary["doubtful"])
    below = shaken.plot()["spectrum"].axes[1]
    assert DOUBTFUL_LINES not in {line.get_label() for line in below.lines}
    assert not below.texts


def test_a_free_line_is_found_again_at_its_own_frequency():
    """A released beam whose natural frequencies move with the mesh: lines are compared mode by mode."""
    released = {"duration": 20.0, "start": {"released_force": {"position": 0.27, "force": 1.0}}, "spectrum": {}}
    coarse = beam(beam=BEAM | {"elements": 4, "damping": {"kind": "modal", "ratio": 1e-4}}, snubbers=[],
                  probes=[{"name": "tip", "position": 0.27}],
                  excitation={"kind": "none"}, reduction={"modes": 3}, run=released)  # fmt: skip
    result = beamsim.run(coarse)
    shift = result.summary["convergence"]["open_frequencies_hz"]
    lines = [line for line in lines_of(result, "displacement", "tip") if line.kind == "other"]
    assert len(lines) >= 2
    for k, line in enumerate(lines[:2], 1):
        assert line.frequency_hz == pytest.approx(result.summary["open_frequencies_hz"][k - 1], rel=1e-3)
        assert shift[str(k)] <= line.error + 1e-4
        assert line.error < ALLOWED_ERROR  # not lost, though bins away
    assert shift["2"] * lines[1].frequency_hz > 2.0 / 20.0  # more than two bins


@pytest.mark.parametrize("stop", [None, TIP], ids=["linear", "bouncing"])
def test_statistics_of_a_random_response(stop):
    excitation = {"kind": "random", "applied_to": "base", "psd": PSD, "seed": 2}
    case = {"snubbers": [stop] if stop else [], "excitation": excitation, "probes": [{"name": "tip", "position": 0.27}]}
    result = beamsim.run(beam(**case, run={"duration": 1.0, "sample_rate": 3000, "spectrum": {}}))
    changes = result.summary["convergence"]["random"]
    signals = [name for name in result.summary["random"] if not name.startswith("input")]
    assert set(changes) == {f"{name} {key}" for name in signals for key in STATISTICS}
    assert not any(name.startswith("random.tip displacement") for name in result.summary["doubtful"])
    rows = list(table_rows(result))
    labels = [label for label, _ in rows]
    first = labels.index("random")
    last = next(k for k, label in enumerate(labels) if k > first and label)
    table = " ".join(text for _, text in rows[first:last])
    assert "crest factor" in table
    assert len(re.findall(r"no error|error (?:below )?\d", table)) == len(changes)  # not of the input
    assert len(signals) == 2 + (stop is not None)
