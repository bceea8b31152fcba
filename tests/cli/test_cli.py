"""The command line: every command, every exit code, nothing half-written."""

import json
import math
import os
import subprocess
import sys

import pytest
from sampling import first_apart
from shipped import config_path

import beamsim
from beamsim.analyses.run.motion import with_limit
from beamsim.flow.trajectory import too_many_events
from beamsim.kinds import TemplateKind
from beamsim.scenario import template
from beamsim.store.results import write_result
from tests.helpers.commands import invoke

CASE = """\
title: Small case
beam: {length: 270 mm, width: 50 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700, elements: 4}
snubbers: [{name: tip, position: 270 mm, side: below, stiffness: 151.1 kN/m, gap: 0 mm}]
excitation: {kind: harmonic, applied_to: base, level: 2 g, frequency: 65 Hz}
run: {duration: 0.05 s, sample_rate: 5 kHz}
"""
PLOTS = {
    "displacement",
    "acceleration",
    "contact_force",
    "force_deflection",
    "spectrum",
    "phase_portrait",
    "deflected_shapes",
}


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.setattr("beamsim.cli.session.SHOWN_AFTER_S", 1e6)  # nothing but what the tests are about
    monkeypatch.chdir(tmp_path)
    (tmp_path / "case.yaml").write_text(CASE)
    return tmp_path


@pytest.fixture
def solved(monkeypatch, fabricated_run):
    """`beamsim run` with a solver that answers at once; change ``solved.result`` or ``solved.error``."""

    class Solver:
        result = fabricated_run()
        error = None
        scenario = None

        def __call__(self, scenario, progress=None, stop=None):
            self.scenario = scenario
            if progress is not None:
                progress(0.5)
            if self.error is not None:
                raise self.error
            return self.result

    solver = Solver()
    monkeypatch.setattr("beamsim.trust.runs.run", solver)
    return solver


@pytest.fixture
def stored(here, fabricated_run):
    return write_result(fabricated_run(), here / "stored.h5")


# --- success ----------------------------------------------------------------------------------------------------------


def test_run_leaves_result_and_plots_and_prints_the_summary(here, solved):
    done = invoke("run", "case.yaml", "--verbose")
    assert done.exit_code == 0, done.output
    assert set(os.listdir(here)) == {"case.yaml", "case.h5"} | {f"case_{name}.png" for name in PLOTS}
    for text in ("peak displacement", "0.4 mm", "8.5 g", "15.11 N", "50 %", "26", "20.0 MPa at x = 0",
                 "fundamental", "3e-13", "51.8", "static vectors", "case.h5"):  # fmt: skip
        assert text in done.stdout, text
    assert done.stderr == "beamsim: warning: a fabricated warning\n"
    assert beamsim.load("case.h5").complete


def test_overrides_reach_the_scenario(solved):
    sets = ["--set", "beam.thickness=4 mm", "--set", "run.duration=0.1 s"]
    assert invoke("run", "case.yaml", "--no-plots", *sets).exit_code == 0
    assert solved.scenario.beam.thickness == pytest.approx(0.004)
    assert solved.scenario.run.duration == 0.1


def test_json_is_alone_on_standard_output(here, solved, fabricated_run):
    solved.result = fabricated_run(frequency=math.nan)
    done = invoke("run", "case.yaml", "--json", "--no-plots")
    assert done.exit_code == 0
    summary = json.loads(done.stdout, parse_constant=lambda _: pytest.fail("NaN is no JSON"))
    assert summary["peak_force_n"] == {"tip": 15.11}
    assert summary["static_force_n"] == {"tip": None}
    assert summary["spectral_lines"][0]["order"] is None
    assert summary["files"] == ["case.h5"]
    assert set(os.listdir(here)) == {"case.yaml", "case.h5"}


def test_quiet_says_nothing(solved):
    assert invoke("run", "case.yaml", "--quiet", "--no-plots").stdout == ""


@pytest.mark.parametrize(
    ("output", "file"),
    [("out.h5", "out.h5"), ("deep/er", "deep/er/case.h5"), ("deep/out.hdf5", "deep/out.hdf5"), (".", "case.h5")],
)
def test_output_may_be_a_file_or_a_folder(output, file, here, solved):
    done = invoke("run", "case.yaml", "--no-plots", "-o", output)
    assert done.exit_code == 0, done.output
    assert (here / file).is_file()


def test_a_name_and_a_format_that_contradict_are_refused(here, stored):
    done = invoke("export", "stored.h5", "--format", "mat", "-o", "x.csv")
    assert (done.exit_code, set(os.listdir(here))) == (2, {"case.yaml", "stored.h5"})
    assert "--format mat contradicts -o x.csv; leave out --format" in done.stderr
    done = invoke("export", "stored.h5", "-o", "x.xlsx")
    assert done.exit_code == 2
    assert "--format is missing; give one of csv, uff, mat, or a file with such a suffix after -o" in done.stderr


def test_validate():
    done = invoke("validate", "case.yaml")
    assert (done.exit_code, done.stdout) == (
        0,
        "case.yaml: valid (Small case)\nharmonic, 2 g, 65 Hz, at the base; "
        "first mode 56 Hz open and at rest (0 %), 205 Hz closed (0 %)\n",
    )
    assert json.loads(invoke("validate", "case.yaml", "--json").stdout)["valid"] is True


@first_apart("kind", 3, TemplateKind)
def test_new_writes_a_valid_case(kind, here):
    name = f"{kind.value}.yaml"
    done = invoke("new", name, "--kind", kind)
    assert done.exit_code == 0, done.output
    assert f"`beamsim {kind.command} {name}`" in done.stdout
    valid = invoke("validate", name)
    assert valid.exit_code == 0, valid.output
    first, _, text = (here / name).read_text().partition("\n")
    assert text == template(kind)
    assert first == "# yaml-language-server: $schema=beamsim.schema.json"  # next to the case: needs no network
    assert (here / "beamsim.schema.json").exists()


def test_new_replaces_a_case_on_request_and_names_the_schema(here):
    (here / "new.yaml").write_text("precious")
    refused = invoke("new", "new.yaml")
    assert refused.exit_code == 2
    assert "--force" in refused.stderr
    assert (here / "new.yaml").read_text() == "precious"
    assert invoke("new", "new.yaml", "--force", "--json").exit_code == 0
    first = (here / "new.yaml").read_text().partition("\n")[0]
    schema = here / first.removeprefix("# yaml-language-server: $schema=")
    assert json.loads(schema.read_text(encoding="utf-8")) == json.loads(invoke("schema").stdout)


# --- failures ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "arguments",
    [
        ("run",),
        ("run", "case.yaml", "--nonsense"),
        ("export", "stored.h5"),
        ("export", "stored.h5", "--format", "xlsx"),
        ("nonsense",),
    ],
)
def test_wrong_usage_ends_with_2(arguments, stored):
    done = invoke(*arguments)
    assert done.exit_code == 2
    assert "Traceback" not in done.output


@pytest.mark.parametrize(
    ("text", "arguments", "message"),
    [
        (CASE + "colour: red\n", (), "colour"),
        (CASE.replace("5 mm,", "-5 mm,"), (), "thickness"),
        (CASE.replace("position: 270 mm", "position: 310 mm"), (), "snubbers[0].position"),
        (CASE.replace("5 kHz", "100 Hz"), (), "sample_rate"),
        (CASE, ("--set", "beam.nonsense=1"), "nonsense"),
        (CASE, ("--set", "beam.length=3 kg"), "length"),
        ("title: [", (), "case.yaml"),
    ],
)
def test_bad_cases_end_with_2_and_touch_nothing(text, arguments, message, here, solved):
    (here / "case.yaml").write_text(text)
    (here / "case.h5").write_bytes(b"old")
    for command in ("run", "validate"):
        done = invoke(command, "case.yaml", *arguments)
        assert done.exit_code == 2, done.output
        assert message in done.stderr
        assert "Traceback" not in done.output
        assert done.stdout == ""
    assert (here / "case.h5").read_bytes() == b"old"
    assert solved.scenario is None
    assert json.loads(invoke("validate", "case.yaml", "--json", *arguments).stdout)["valid"] is False


@pytest.mark.parametrize("command", ["run", "validate", "info", "plot"])
def test_missing_file(command):
    done = invoke(command, "nowhere.yaml")
    assert done.exit_code == 2
    assert "nowhere.yaml" in done.stderr


def test_place_that_cannot_be_written_is_found_before_computing(here, solved):
    (here / "file").write_text("")
    done = invoke("run", "case.yaml", "-o", "file/case.h5")
    assert done.exit_code == 2
    assert "not a folder" in done.stderr
    assert solved.scenario is None
    (here / "case.h5").mkdir()
    assert invoke("run", "case.yaml").exit_code == 2


def test_partial_result_is_saved_and_ends_with_3(here, solved, fabricated_run):
    solved.result = fabricated_run(outcome=with_limit(too_many_events(0.2, 9)))
    done = invoke("run", "case.yaml", "--no-plots")
    assert done.exit_code == 3
    assert "max_events" in done.stderr
    assert "partial result is in case.h5" in done.stderr
    assert "9 contact events" in done.stdout
    assert not beamsim.load("case.h5").complete
    assert invoke("info", "case.h5").exit_code == 0


def test_a_bug_ends_with_1_in_one_line(here, solved):
    solved.error = ZeroDivisionError("division by zero\nand more")
    (here / "case.h5").write_bytes(b"old")
    done = invoke("run", "case.yaml")
    assert done.exit_code == 1
    assert (
        done.stderr == "beamsim: internal error (ZeroDivisionError: division by zero); use --debug for the traceback\n"
    )
    assert "Traceback" in invoke("run", "case.yaml", "--debug").stderr
    assert (here / "case.h5").read_bytes() == b"old"


# --- as a process -----------------------------------------------------------------------------------------------------


VALIDATE = """
import sys
import beamsim.cli
sys.argv = ["beamsim", "validate", {case!r}]
try:
    beamsim.cli.main()
except SystemExit as end:
    assert not end.code, end.code
heavy = ("numba", "matplotlib", "rich", "scipy.optimize", "scipy.signal", "scipy.stats")
heavy += ("beamsim.analyses", "beamsim.structures.plate")
print("loaded", [name for name in heavy if name in sys.modules])
"""


def test_validate_imports_only_what_it_needs():
    case = str(config_path("one_sided_65hz"))
    done = subprocess.run(
        [sys.executable, "-c", VALIDATE.format(case=case)], capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines()[-1] == "loaded []"
