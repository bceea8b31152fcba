"""Ending early: what was found is kept, by the Python functions and by the commands that a signal reaches."""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from functools import cache
from itertools import count, product
from pathlib import Path

import numpy as np
import pytest
from sampling import first_apart
from shipped import config_path

import beamsim
from beamsim.analyses.nnm.analysis import nnm
from beamsim.cli.session import STOPPING, interruptible
from beamsim.measurements.channels import read_tests
from beamsim.outcomes import COMPLETE, Interrupted, exit_code, stop_requests
from beamsim.scenario import load_scenario
from beamsim.store import results as result_files
from beamsim.store.results import load
from tests.helpers.commands import invoke
from tests.helpers.forked_commands import Plan, ended
from tests.helpers.tables import variables

MODE, RESPONSE = config_path("nnm_chain_mass_5"), config_path("chain_two_dof")
POINTS = 5


class After:
    """Progress and a request to stop once it was reported so many times."""

    def __init__(self, reports):
        self.reports = reports

    def __call__(self, fraction):
        self.reports -= 1

    def stop(self):
        return self.reports <= 0


# --- from Python ------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def mode():
    """A case, and what is found of its mode if nothing stops it."""
    scenario = load_scenario(MODE, {"nnm.continue_in.to": 0.2})
    return scenario, nnm(scenario)


@first_apart("points", 1, [1, 5])
def test_a_mode_keeps_the_points_it_has(mode, points):
    (scenario, mode), request = mode, After(points)
    with stop_requests(request.stop):
        part = nnm(scenario, request)
    assert mode.complete  # the twin that is not stopped
    assert part.status == f"interrupted at stiffness factor {part.branches[0]['parameter'].values[-1]:.6g}"
    assert part.summary["status"] == part.status
    assert part.branches[0]["parameter"].values.size == points < mode.branches[0]["parameter"].values.size
    np.testing.assert_array_equal(
        part.branches[0]["initial_displacement"].values, mode.branches[0]["initial_displacement"].values[:points]
    )
    assert part["motion"]["branch_point"].item() == points
    part.plot()


@pytest.fixture(scope="module")
def impacting():
    """A case, and what a run of it gives that nothing stops."""
    scenario = load_scenario(
        config_path("one_sided_45hz"), ["run.duration=0.3 s", "run.spectrum.last=0.2 s", "run.sample_rate=2 kHz"]
    )
    return scenario, beamsim.run(scenario, stop=lambda: False)


@pytest.mark.parametrize(
    ("stage", "left_out"),
    [
        ("exact_motion_of", "interrupted before the spectra"),
        ("spectra_of", "interrupted before the spectra"),
        ("convergence_of", "interrupted during the comparison with a finer model"),
    ],
)
def test_a_run_stopped_at_any_stage_keeps_its_motion(stage, left_out, impacting, monkeypatch, tmp_path):
    from beamsim.analyses.run import analysis
    from beamsim.trust import runs

    home = runs if stage == "convergence_of" else analysis
    (scenario, whole), reached, real = impacting, [], getattr(home, stage)
    assert whole.outcome.complete

    def stopped(*given):
        value = real(*given) if stage == "exact_motion_of" else None
        reached.append(1)
        return value or real(*given)

    monkeypatch.setattr(home, stage, stopped)
    part = beamsim.run(scenario, stop=lambda: bool(reached))
    assert part.status == part.summary["status"] == left_out
    for kept in (part, beamsim.load(beamsim.write_result(part, tmp_path / "part.h5"))):
        np.testing.assert_array_equal(kept["histories"]["time"].values, whole["histories"]["time"].values)
        np.testing.assert_array_equal(
            kept["histories"]["displacement"].sel(probe="tip").values,
            whole["histories"]["displacement"].sel(probe="tip").values,
        )
        np.testing.assert_array_equal(
            kept["histories"]["energy_stored"].values, whole["histories"]["energy_stored"].values
        )
        for entry in ("peak_displacement_m", "peak_force_n", "energy_error", "contacts"):
            assert kept.summary[entry] == whole.summary[entry]
        assert ("spectra" in kept.datasets) == (stage == "convergence_of")
    assert kept.plot()


def test_a_stepped_sine_keeps_the_frequencies_it_has():
    sweep = "sweep={kind: stepped, from: 60 Hz, to: 70 Hz, points: 6, most_cycles: 50}"
    request = After(2)
    part = beamsim.sweep(load_scenario(config_path("one_sided_65hz"), [sweep]), request, stop=request.stop)
    assert part.status == "interrupted before 64 Hz"
    assert part.curves["up_0"].frequency_hz.tolist() == [60.0, 62.0]


def test_a_fit_keeps_the_best_so_far():
    scenario = load_scenario(config_path("identify_nonlinear"))
    tests = read_tests(scenario, config_path("identify_nonlinear").parent)
    request = After(1)
    part = beamsim.identify_stiffness(scenario, tests, request, request.stop)
    assert part.status == "interrupted after 1 of 3 starts"
    fit = variables(part["nonlinear"])
    assert fit.starts == 1
    assert fit.misfit < 0.1 * fit.misfit_before
    assert "profiles" not in part.datasets


@pytest.mark.parametrize("asked", [1, 100, 1000])
def test_a_fit_to_sweeps_ends_wherever_it_is_asked(asked):
    """A branch that ends on request is none that fails: the fit was refused, or ended in an internal error."""
    narrow = [
        f"identify_stiffness.nonlinear.tests[{k}].{end} Hz" for k, end in product((0, 1), ("from=10", "to=12"))
    ]  # fmt: skip
    scenario, calls = load_scenario(config_path("identify_sweep"), narrow), count(1)

    tests = read_tests(scenario, config_path("identify_nonlinear").parent)
    try:
        part = beamsim.identify_stiffness(scenario, tests, stop=lambda: next(calls) > asked)
    except Interrupted:  # before anything was found
        return
    assert part.outcome.interrupted


# --- as a command -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("command", "path", "number", "code"),
    [("nnm", MODE, signal.SIGINT, 130), ("sweep", RESPONSE, signal.SIGTERM, 143)],
)
def test_a_signal_keeps_what_was_found(command, path, number, code, heeded, monkeypatch, tmp_path):
    """The signal comes with the fifth report of progress."""

    @contextmanager
    def signalling(_label, **_options):
        reports = count(1)
        yield lambda _: signal.raise_signal(number) if next(reports) == POINTS else None

    monkeypatch.setattr("beamsim.cli.command.progress_of", signalling)
    monkeypatch.chdir(tmp_path)
    done = invoke(command, path, "-o", "case.h5")
    assert done.exit_code == code, done.output
    assert done.stderr.splitlines() == [
        STOPPING,
        "beamsim: interrupted; the partial result is in case.h5; `beamsim plot case.h5` plots it",
    ]
    assert "interrupted" in done.stdout.lower()
    assert os.listdir(tmp_path) == ["case.h5"]
    kept = load("case.h5")
    assert kept.status.startswith("interrupted")
    assert POINTS <= kept.branches[0]["parameter"].values.size <= POINTS + 1  # the first need not be reported


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_first_signal_is_a_flag_and_the_second_one_ends(number, heeded, capsys):
    handlers = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    with interruptible() as interrupted:
        assert not interrupted()
        signal.raise_signal(number)
        assert interrupted()
    assert capsys.readouterr().err == STOPPING + "\n"
    assert exit_code(COMPLETE, signal=interrupted.signal) == 128 + number
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == handlers

    def twice():
        with interruptible():
            signal.raise_signal(number)
            signal.raise_signal(number)

    with pytest.raises(KeyboardInterrupt if number == signal.SIGINT else SystemExit):
        twice()
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == handlers


def test_a_signal_during_a_comparison_keeps_the_result(heeded, monkeypatch, tmp_path):
    from beamsim.trust import reference

    def interrupted(*given, real=reference.output_times):
        os.kill(os.getpid(), signal.SIGINT)
        return real(*given)

    monkeypatch.setattr(reference, "output_times", interrupted)
    options = ["--set", "run.duration=0.5 s", "--against", "reference", "--no-plots"]
    target = tmp_path / "case.h5"
    done = invoke("run", config_path("one_sided_65hz"), *options, "-o", target)
    assert done.exit_code == 130, done.output
    assert beamsim.load(target).status == "interrupted during the comparison with the reference integrator"


def test_a_signal_ends_a_study_within_the_case_and_resume_goes_on(heeded, monkeypatch, tmp_path):

    from beamsim.trust.studies import CaseSolver

    solved = []

    def solve(self, case, real=CaseSolver.__call__):
        solved.append(case.number)
        if len(solved) == 2:
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.3)  # a case of some milliseconds may end before the main thread has heard of it
        return real(self, case)

    monkeypatch.setattr(CaseSolver, "__call__", solve)
    changes = ("vary.samples=5", "run.duration=0.5 s", "run.convergence=off")
    sets = [*(word for change in changes for word in ("--set", change)), "--workers", "1", "--no-plots"]
    target = tmp_path / "study.h5"
    done = invoke("sweep", config_path("design_tolerances"), *sets, "-o", target)
    assert done.exit_code == 130, done.output
    assert len(solved) == 2
    assert "1 of 5 cases are kept in" in done.output
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert beamsim.load(target).status == "1 of 5 cases computed"
    again = invoke("sweep", config_path("design_tolerances"), *sets, "--resume", "-o", target)
    assert again.exit_code == 0, again.output
    assert len(solved) == 6
    assert beamsim.load(target).complete


# --- while a result is written and drawn ------------------------------------------------------------------------------

MASS = """
chain: {masses: [1 kg], springs: [1 kN/m]}
snubbers: [{name: stop, mass: 1, side: below, gap: 1 mm, stiffness: 1e5}]
excitation: {kind: harmonic, applied_to: base, frequency: 5 Hz, level: 2}
"""
SHORT = "run: {duration: 0.2 s, convergence: off}\n"
WRITTEN = {  # what is written at once, and beside a journal
    "run": ("run", SHORT),
    "study": ("sweep", SHORT + "vary: {kind: grid, parameters: [{path: snubbers.stop.gap, values: [1 mm, 2 mm]}]}\n"),
}


@pytest.fixture
def invoked(heeded, monkeypatch, tmp_path):
    """Run the command of a small case in an empty folder."""

    monkeypatch.chdir(tmp_path)
    before = signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number))  # as `beamsim.cli.main` does

    def run(name, *options):
        command, sections = WRITTEN[name]
        Path("case.yaml").write_text(MASS + sections)
        workers = ("--workers", 1) if command == "sweep" else ()
        done = invoke(command, "case.yaml", "--quiet", *workers, *options)
        Path("case.yaml").unlink()
        return done

    yield run
    signal.signal(signal.SIGTERM, before)


def signals_in(monkeypatch, module, name, *numbers):
    """Let signals arrive in a function after it has done a part of its work."""
    arriving, real = list(numbers), getattr(module, name)

    def function(*given, **named):
        result = real(*given, **named)
        while arriving:
            os.kill(os.getpid(), arriving.pop(0))
        return result

    monkeypatch.setattr(module, name, function)


@pytest.mark.parametrize("plots", [True, False])
@pytest.mark.parametrize("name", WRITTEN)
def test_a_signal_while_the_file_is_written_waits_for_it(name, plots, invoked, monkeypatch):
    signals_in(monkeypatch, result_files, "_create", signal.SIGTERM)
    done = invoked(name, *([] if plots else ["--no-plots"]))
    assert "; press again to stop at once" in done.output
    assert os.listdir() == ["case.h5"]
    assert beamsim.load("case.h5").complete
    if plots:  # which are left out
        assert done.exit_code == 143, done.output
        assert "the whole result is in case.h5; `beamsim plot case.h5` plots it" in done.output
    else:  # nothing is
        assert done.exit_code == 0, done.output
        assert "interrupted" not in done.output


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_second_signal_while_the_file_is_written_ends_at_once(number, code, invoked, monkeypatch):
    signals_in(monkeypatch, result_files, "_create", number, number)
    Path("case.h5").write_bytes(b"old")
    done = invoked("run")
    assert done.exit_code == code, done.output
    assert done.output.splitlines()[-2:] == [STOPPING, "beamsim: interrupted; no incomplete file was left"]
    assert os.listdir() == ["case.h5"]
    assert Path("case.h5").read_bytes() == b"old"


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_while_a_picture_is_written_keeps_it_and_leaves_out_the_others(number, code, invoked, monkeypatch):
    from beamsim.plots import drawing

    whole = drawing.write

    def half(figure, path, *given):
        if pictures:
            path.write_bytes(b"half of one")
            os.kill(os.getpid(), number)
        pictures.append(path)
        whole(figure, path, *given)

    pictures = []
    monkeypatch.setattr(drawing, "write", half)
    done = invoked("run", "--json")
    assert done.exit_code == code, done.output
    assert "the whole result is in case.h5; `beamsim plot case.h5` plots it" in done.stderr
    listed = json.loads(done.stdout)["files"]
    assert len(listed) == 3
    assert sorted(listed) == sorted(os.listdir())
    assert beamsim.load("case.h5").complete


@pytest.mark.parametrize("form", ["csv", "mat", "uff"])
def test_a_signal_while_a_result_is_exported_leaves_nothing_incomplete(form, invoked, monkeypatch):

    assert invoked("run", "--no-plots").exit_code == 0

    def replace(temporary, target):
        assert temporary.stat().st_size
        os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(os, "replace", replace)
    done = invoke("export", "case.h5", "--format", form, "-o", "exported")
    assert done.exit_code == 130, done.output
    assert [path.name for path in Path().rglob("*") if path.is_file()] == ["case.h5"]


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_a_termination_of_which_a_library_makes_an_error_of_its_own():
    def compile_badly():
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            os.kill(os.getpid(), signal.SIGTERM)
        except KeyboardInterrupt:
            raise ValueError("not compiled") from None

    with pytest.raises(SystemExit) as ended, interruptible():
        compile_badly()
    assert ended.value.code == 143


TWICE = """
import os, signal, sys, types
from beamsim import cli

signal.signal(signal.SIGINT, signal.default_int_handler)  # a process in the background is started without

class Late:  # deleted after Python has given up its handlers
    def __del__(self, kill=os.kill, process=os.getpid()):
        kill(process, {number})

def app(prog_name):
    try:
        signal.raise_signal({number})
    finally:
        signal.raise_signal({number})

sys.late = Late()
sys.modules["beamsim.cli.app"] = types.SimpleNamespace(app=app)
cli.main()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_signals_that_follow_while_a_command_loads_or_ends_keep_its_exit_code(number, code):
    done = subprocess.run([sys.executable, "-c", TWICE.format(number=int(number))], check=False, capture_output=True)
    assert (done.returncode, done.stderr) == (code, b"")


EARLY = """
import signal, sys
from importlib.abc import MetaPathFinder

signal.signal(signal.SIGINT, signal.default_int_handler)  # a process in the background is started without

class Arriving(MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == "{module}":
            signal.raise_signal({number})

from beamsim.__main__ import main

sys.meta_path.insert(0, Arriving())
main()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
@pytest.mark.parametrize("module", ["beamsim.cli", "beamsim.errors", "beamsim.cli.app", "typer"])
def test_a_signal_while_the_command_line_is_loaded_ends_it_silently(module, number, code):
    early = EARLY.format(number=int(number), module=module)
    done = subprocess.run([sys.executable, "-c", early, "--version"], check=False, capture_output=True)
    assert (done.returncode, done.stdout, done.stderr) == (code, b"", b"")


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_a_signal_that_the_process_was_started_to_ignore_stays_ignored_while_it_is_loaded():
    early = EARLY.format(number=int(signal.SIGINT), module="beamsim.errors").replace("default_int_handler", "SIG_IGN")
    done = subprocess.run([sys.executable, "-c", early, "--version"], check=False, capture_output=True)
    assert (done.returncode, done.stderr) == (0, b"")


DROPPED = """
import signal, sys, types

import beamsim.cli as cli

signal.signal(signal.SIGINT, signal.default_int_handler)  # a process in the background is started without

def app(prog_name):
    try:
        signal.raise_signal({number})
    except BaseException:
        pass  # as a library does while it is loaded
    signal.raise_signal({number})
    print("goes on")

sys.modules["beamsim.cli.app"] = types.SimpleNamespace(app=app)
cli.main()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_after_one_that_a_library_dropped_ends_the_command(number, code):
    done = subprocess.run([sys.executable, "-c", DROPPED.format(number=int(number))], check=False, capture_output=True)
    assert (done.returncode, done.stdout, done.stderr) == (code, b"", b"")


IN_EXEC = """
import signal, sys, types
from beamsim import cli

signal.signal(signal.SIGINT, signal.default_int_handler)  # a process in the background is started without

def app(prog_name):
    try:
        exec("signal.raise_signal(signal.SIGINT)")
    except KeyboardInterrupt:
        sys.exit(130)

sys.modules["beamsim.cli.app"] = types.SimpleNamespace(app=app)
cli.main()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_a_signal_in_code_that_a_library_executes_keeps_the_exit_code_of_a_module(tmp_path):
    """``python -m`` ended by the signal itself, after the command had cleaned up."""
    (tmp_path / "interrupted.py").write_text(IN_EXEC)
    places = os.pathsep.join([str(tmp_path), *sys.path])
    command = [sys.executable, "-m", "interrupted"]
    done = subprocess.run(command, check=False, capture_output=True, env=os.environ | {"PYTHONPATH": places})
    assert (done.returncode, done.stderr) == (130, b"")


# --- while a motion is evaluated --------------------------------------------------------------------------------------

EVALUATED = """
chain: {masses: [1 kg, 1 kg], springs: [1 kN/m, 1 kN/m], damping: {kind: modal, ratio: 0.01}}
snubbers: [{name: stop, mass: 2, side: below, gap: 0.1 mm, stiffness: 1e5}]
run: {duration: 1 s, sample_rate: 2 kHz, low_pass: 500 Hz, impacts: {}, srs: {from: 20 Hz, to: 200 Hz},
  sensitivities: [snubbers.stop.gap]}
"""
INPUTS = {
    "harmonic": "excitation: {kind: harmonic, applied_to: base, frequency: 5 Hz, level: 2}\n",
    "random": "excitation: {kind: random, applied_to: base, seed: 3, "
    "psd: [{frequency: 5 Hz, density: 1}, {frequency: 50 Hz, density: 1}]}\n",
}
STAGES = [  # input, module and function in which the signal comes, what is said to be missing
    ("harmonic", "analyses.run.motion", "energies_of_segments", "before the spectra"),
    ("harmonic", "responses.histories", "stored_energy", "before the spectra"),
    ("harmonic", "analyses.run.analysis", "spectra_of", "before the spectra"),
    ("random", "analyses.run.summary", "gapping_of_run", "before the level that changes contact"),
    ("random", "analyses.run.random_response", "random_response", "before densities and statistics"),
    ("harmonic", "analyses.run.impacts", "_contacts", "before statistics of impacts"),
    ("harmonic", "analyses.run.analysis", "shock_response", "before shock response spectra"),
    ("harmonic", "analyses.run.sensitivities", "sensitivities_of", "before sensitivities"),
    ("harmonic", "trust.runs", "convergence_of", "during the comparison with a finer model"),
]


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    """The content of the result file of each case that is evaluated, computed when it is first asked for."""

    @cache
    def content(excited):
        case = tmp_path_factory.mktemp(excited) / "case.yaml"
        case.write_text(EVALUATED + INPUTS[excited])
        done = invoke("run", case, "--no-plots", "--quiet", "--set", "run.convergence=off", "-o", case.parent)
        assert done.exit_code == 0, done.output
        return (case.parent / "case.h5").read_bytes()

    return content


@first_apart(("excited", "module", "function", "missing"), 3, STAGES[::4] + [x for k, x in enumerate(STAGES) if k % 4])
def test_a_signal_in_the_evaluation_keeps_the_motion(
    excited, module, function, missing, uninterrupted, invoked, tmp_path, monkeypatch
):
    """The signal comes where the function is called: it does not return, and a complete older result stays."""
    monkeypatch.chdir(tmp_path)
    home = __import__(f"beamsim.{module}", fromlist=["?"])
    real, returned = getattr(home, function), []

    def signalled(*given, **named):
        os.kill(os.getpid(), signal.SIGTERM)
        result = real(*given, **named)
        returned.append(function)
        return result

    Path("case.yaml").write_text(EVALUATED + INPUTS[excited])
    complete = uninterrupted(excited)
    Path("case.h5").write_bytes(complete)
    monkeypatch.setattr(home, function, signalled)
    done = invoke("run", "case.yaml")
    assert done.exit_code == 143, done.output
    assert sorted(os.listdir()) == ["case.h5", "case.yaml", "case_partial.h5"]
    assert Path("case.h5").read_bytes() == complete
    kept = beamsim.load("case_partial.h5")
    assert kept.status.startswith(f"interrupted {missing}")
    assert kept["histories"]["time"].values[-1] == pytest.approx(1.0)
    whole = beamsim.load("case.h5")
    assert kept.summary["peak_force_n"] == whole.summary["peak_force_n"]
    # which are finished if that takes less than a second
    if function not in ("energies_of_segments", "stored_energy"):
        assert returned == []


REPLACED = """
import signal, sys, types
from beamsim import cli

signal.signal(signal.SIGINT, signal.default_int_handler)

def app(prog_name):
    from beamsim.cli.session import with_exit_code

    with with_exit_code(debug=False):
        try:
            signal.raise_signal({number})
        except BaseException:
            pass
        raise ValueError("schema")  # with nothing behind it, as compiled libraries do

sys.modules["beamsim.cli.app"] = types.SimpleNamespace(app=app)
try:
    cli.main()
except Exception as ended:
    sys.exit(ended.exit_code)  # as typer does
"""


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_error_that_a_library_raises_in_place_of_a_signal_is_none(number, code):
    done = subprocess.run(
        [sys.executable, "-c", REPLACED.format(number=int(number))], check=False, capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (code, "beamsim: interrupted; no incomplete file was left\n")


# --- at any time ------------------------------------------------------------------------------------------------------

LONG = {
    "run": ("run", "one_sided_65hz", "--set", "run.duration=20 s"),
    "sweep": ("sweep", "sweep_up_down"),
    "continuation": ("sweep", "continuation_60_120hz"),
    "coexisting": ("sweep", "coexisting_motions", "--workers", "1"),
    "study": ("sweep", "design_stiffness_gap", "--workers", "1"),
    "workers": ("sweep", "design_stiffness_gap", "--workers", "2"),
    "nnm": ("nnm", "nnm_first"),
    "identify": ("identify-stiffness", "identify_nonlinear"),
    "validate": ("validate", "random_vibration", "--sketch"),
}
AT = {"run": (0.2, 0.8), "sweep": (0.6,), "continuation": (0.2, 0.5), "coexisting": (0.8,), "study": (0.5,),
      "workers": (0.3,), "nnm": (0.4,), "identify": (0.6,), "validate": (0.2,)}  # fmt: skip
SHORT_RUN = ["run", str(config_path("one_sided_65hz")), *(
    word for change in ("run.duration=0.5 s", "run.spectrum.last=0.2 s") for word in ("--set", change)
)]  # fmt: skip


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere processes with such libraries cannot be forked")
@pytest.mark.parametrize(
    ("first", "instants"),
    [
        ([], product(("run", "workers", "validate"), (0.1, 0.4, 0.8))),  # while it is loaded, one is like another
        (SHORT_RUN, [(name, at) for name, times in AT.items() for at in times]),
    ],
    ids=["loading", "working"],
)
def test_a_signal_at_any_time_ends_a_command_with_its_exit_code(first, instants, tmp_path):
    """After so many seconds of processor time it is importing, loading, solving, writing or drawing."""
    plans = []
    for name, at in instants:
        number = signal.SIGINT if (list(LONG).index(name) + int(10 * at)) % 2 else signal.SIGTERM
        command, case, *options = LONG[name]
        arguments = [command, str(config_path(case)), *options]
        plans.append(Plan(arguments, str(tmp_path / f"{name}_{at}"), int(number), at))
    interrupted = 0
    for plan, ending in zip(plans, ended(plans, [*first, "-o", str(tmp_path)] if first else []), strict=True):
        where = f"{plan}: {ending}"
        assert "Traceback" not in ending.errors, where
        assert "internal error" not in ending.errors, where
        if ending.code == 0:  # it had ended before
            continue
        interrupted += 1
        assert ending.code == 128 + plan.number, where
        for file in Path(plan.folder).glob("*.h5"):
            assert load(file).outcome.cut_short or "the whole result is in" in ending.errors, where
        assert not list(Path(plan.folder).glob("*.tmp*")), where
    assert interrupted >= 0.8 * len(plans)
