"""`beamsim compare` of test data before and after a test: screen, exit codes, files, and what is refused."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import beamsim
from tests.helpers.commands import invoke

ROOT = Path(__file__).parents[2]
BEFORE, AFTER = (ROOT / f"configs/measurements/search_{side}.csv" for side in ("before", "after"))
SWEEP = ("--sweep", "100 Hz, 600 Hz, 8 oct/min")
FREQUENCY = np.arange(20.0, 80.0, 0.1)


def peak(natural, damping=0.02):
    ratio = FREQUENCY / natural
    return 1 / np.abs(1 - ratio**2 + 2j * damping * ratio)


def write(path, header, *columns):
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.7g")
    return path


def test_the_screen_of_the_page_is_printed(tmp_path):
    """The exit code says that a limit is exceeded; the files are those that the page names."""
    page = (ROOT / "docs/before_after.md").read_text(encoding="utf-8")
    (quoted,) = re.findall(r"```\n(search_before.*?)\n```", page, re.S)
    result = invoke("compare", BEFORE, AFTER, *SWEEP, "--check", "-o", tmp_path / "out.h5")
    assert result.exit_code == 4
    printed = {" ".join(line.split()) for line in result.stdout.splitlines()}
    assert {" ".join(line.split()) for line in quoted.splitlines()} <= printed
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.h5", "out_middle_shifts.png", "out_tip_shifts.png"]
    stored = beamsim.load(tmp_path / "out.h5")
    assert list(stored.datasets) == ["record_pairs", "resonances", "responses_before", "responses_after"]
    assert [len(pair.resonances) for pair in stored.pairs] == [2, 2]
    # natural frequencies of the structure that was computed: 195.92 and 446.78 Hz, then 183.61 and 415.50 Hz
    for pair in stored.pairs:
        for resonance, exact in zip(pair.resonances, (183.6114 / 195.9235 - 1, 415.5024 / 446.7841 - 1), strict=True):
            shift = resonance.frequency
            assert (1 + shift.change) / (1 + shift.of_sweep) - 1 == pytest.approx(exact, abs=shift.resolution)
    done = invoke("export", tmp_path / "out.h5", "--format", "csv", "-o", tmp_path)
    assert done.exit_code == 0
    table = (tmp_path / "out_csv" / "resonances_by_resonance.csv").read_text().splitlines()
    assert len(table) == 5
    assert "after (Hz)" in table[0]


def test_limits_decide_the_exit_code(tmp_path):
    """5 % and 20 % by default; --set changes them; what the resolution does not decide ends with code 3."""
    head = "frequency (Hz),tip (g)"
    before = write(tmp_path / "b.csv", head, FREQUENCY, peak(50.0))
    after = write(tmp_path / "a.csv", head, FREQUENCY, peak(49.0))
    words = ("compare", before, after, "--check", "--no-plots", "-o", tmp_path / "r.h5")
    assert invoke(*words).exit_code == 0
    assert invoke(*words, "--set", "limits.frequency_shift=1.5 %").exit_code == 4
    assert invoke(*words, "--set", "limits.frequency_shift=2.05 %").exit_code == 3
    assert invoke(*words[:3], *words[4:], "--set", "limits.frequency_shift=1.5 %").exit_code == 0  # not checked
    printed = json.loads(invoke(*words, "--set", "limits.damping_shift={tip: 9 %}", "--json").stdout)
    assert printed["margins"]["damping_shift.tip"]["verdict"] == "ok"
    assert printed["resonances"][0]["frequency_change"] == pytest.approx(-0.02, abs=1e-4)


def test_a_case_and_options_give_the_same(tmp_path):
    """A YAML file with the paths relative to it, and its result file, which is a case, too."""
    head = "frequency (Hz),tip (g),root (g)"
    write(tmp_path / "b.csv", head, FREQUENCY, peak(50.0), peak(30.0))
    write(tmp_path / "a.csv", head.replace("tip", "AI 7"), FREQUENCY, peak(47.0), peak(30.0))
    case = tmp_path / "case.yaml"
    case.write_text(
        "title: Panel\nbefore_after:\n  before: b.csv\n"
        "  after: {file: a.csv, sweep: {from: 80 Hz, to: 20 Hz, rate: 2 oct/min}}\n"
        "  channels: [{before: tip, after: AI 7}]\n"
    )  # fmt: skip
    assert invoke("validate", case).exit_code == 0
    assert invoke("compare", case, "--no-plots", "-o", tmp_path / "one.h5").exit_code == 0
    words = ("--channel", "tip=AI 7", "--sweep-after", "80 Hz, 20 Hz, 2 oct/min", "--no-plots")
    done = invoke("compare", tmp_path / "b.csv", tmp_path / "a.csv", *words, "-o", tmp_path / "two.h5")
    assert done.exit_code == 0, done.output
    assert invoke("compare", tmp_path / "one.h5", "--no-plots", "-o", tmp_path / "again.h5").exit_code == 0
    shifts = [beamsim.load(tmp_path / f"{name}.h5").pairs[0].resonances for name in ("one", "two", "again")]
    assert shifts[0] == shifts[1] == shifts[2]
    assert shifts[0][0].frequency.of_sweep < 0.0
    for command in ("run", "sweep", "check", "export-structure"):
        refused = invoke(command, case)
        assert refused.exit_code == 2
        assert "internal error" not in refused.output


HISTORY = "time (s),tip (g)"
REFUSED = {
    "no common name": (("frequency (Hz),a (g),b (g)", "frequency (Hz),c (g),d (g)"), (), "no channel with one name"),
    "other quantities": (("frequency (Hz),tip (g)", "frequency (Hz),tip (mm)"), (), "in m/s^2 before, and in m after"),
    "one without unit": (("frequency (Hz),tip (g)", "frequency (Hz),tip"), (), "no unit after"),
    "a shock spectrum": (("frequency (Hz),SRS tip (g)",) * 2, ("--channel", "SRS tip"), "shock response spectrum"),
    "levels": (("frequency (Hz),tip (dB)",) * 2, ("--channel", "tip"), "levels in dB"),
    "an unknown channel": (("frequency (Hz),tip (g)",) * 2, ("--channel", "top"), "no channel top"),
    "a bad sweep": (("frequency (Hz),tip (g)",) * 2, ("--sweep", "20 Hz, 80 Hz"), "first and last frequency and rate"),
    "a bad rate": (("frequency (Hz),tip (g)",) * 2, ("--sweep", "20 Hz, 80 Hz, 2 Hz"), "rate"),
    "sweep and random": (
        (HISTORY,) * 2, ("--sweep", "20 Hz, 80 Hz, 2 oct/min", "--line-spacing", "1 Hz"), "exclude each other",
    ),
    "lines of a spectrum": (("frequency (Hz),tip (g)",) * 2, ("--line-spacing", "1 Hz"), "time histories"),
    "a history of what": ((HISTORY,) * 2, (), "--sweep, --line-spacing"),
    "a short history": ((HISTORY,) * 2, ("--line-spacing", "0.02 Hz"), "averages"),
    "another sweep": ((HISTORY,) * 2, ("--sweep", "0.3 Hz, 1.9 Hz, 6 oct/min"), "does not follow the sweep"),
    "a beginning alone": (("frequency (Hz),tip (g)",) * 2, ("--begin", "1 s"), "--begin belongs to a sine sweep"),
    "a late beginning": (
        (HISTORY,) * 2, ("--sweep", "0.3 Hz, 1.9 Hz, 6 oct/min", "--begin", "59 s"), "begins at 59 s of the record",
    ),
    "cycles alone": (("frequency (Hz),tip (g)",) * 2, ("--cycles", "3"), "belongs to a sine sweep"),
    "a probe": (("frequency (Hz),tip (g)",) * 2, ("--probe", "tip"), "belongs to the comparison with a result"),
    "a limit on a motion": (
        ("frequency (Hz),tip (g)",) * 2, ("--set", "limits.peak_force=3 N"), "give frequency_shift, amplitude_shift",
    ),
    "a limit elsewhere": (
        ("frequency (Hz),tip (g)",) * 2, ("--set", "limits.frequency_shift={root: 3 %}"), "root, which is not compared",
    ),
    "ranges apart": (
        ("frequency (Hz),tip (g)",) * 2, ("--set", "before_after.within={from: 1 Hz, to: 20.5 Hz}"),
        "frequencies before",
    ),
    "a falling range": (
        ("frequency (Hz),tip (g)",) * 2, ("--set", "before_after.within={from: 90 Hz, to: 20 Hz}"), "exchange the two",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("headings", "options", "message"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_compared_is_refused(headings, options, message, tmp_path):
    """With exit code 2 and no file."""
    files = []
    for side, heading in zip("ba", headings, strict=True):
        x = FREQUENCY - 20.0 if heading == HISTORY else FREQUENCY
        y = np.sin(7.0 * x) if heading == HISTORY else peak(50.0)
        files.append(write(tmp_path / f"{side}.csv", heading, x, *[y] * heading.count(",")))
    result = invoke("compare", *files, *options, "--no-plots", "-o", tmp_path / "r.h5")
    text = " ".join(result.output.split())
    assert result.exit_code == 2, text
    assert message in text
    assert not (tmp_path / "r.h5").exists()


def test_options_and_files_that_do_not_belong_together(tmp_path):
    file = write(tmp_path / "b.csv", "frequency (Hz),tip (g)", FREQUENCY, peak(50.0))
    (tmp_path / "case.yaml").write_text("before_after: {before: b.csv, after: b.csv}\n")
    for words, message in (
        ((file,), "nothing to compare it with"),
        ((tmp_path / "case.yaml", "--channel", "tip"), "belongs to two files"),
        ((tmp_path / "case.yaml", file), "unknown format"),
        ((file, tmp_path / "none.csv"), "none.csv"),
        ((ROOT / "configs/one_sided_65hz.yaml",), "before_after is missing"),
    ):
        result = invoke("compare", *words, "--no-plots", "-o", tmp_path / "r.h5")
        assert result.exit_code == 2, result.output
        assert message in " ".join(result.output.split())
