"""Ending early: what was found is kept, by the Python functions and by the commands that a signal reaches."""

import json
import os
import signal
import subprocess
import sys
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from sampling import slow_after

import beamsim
from beamsim.analyses.nnm.analysis import nnm
from beamsim.analyses.response.analysis import frequency_response
from beamsim.cli.conclusion import exit_code
from beamsim.cli.interruption import interruptible, raised_again
from beamsim.outcomes import COMPLETE
from beamsim.plots.continuation import frequency_response_figures
from beamsim.plots.nnm import nnm_figures
from beamsim.scenario import load_scenario
from beamsim.store.results import open_nnm, open_response

CONFIGS = Path(__file__).parents[2] / "configs"
MODE, RESPONSE = CONFIGS / "nnm_chain_mass_5.yaml", CONFIGS / "chain_two_dof.yaml"
POINTS = 5


class After:
    """Progress and a request to stop once it was reported so many times, and some passages later."""

    def __init__(self, reports, passages=0):
        self.reports, self.passages = reports, passages

    def __call__(self, fraction):
        self.reports -= 1

    def stop(self):
        if self.reports <= 0:
            self.passages -= 1
        return self.reports <= 0 and self.passages < 0


# --- from Python ------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def mode():
    return nnm(load_scenario(MODE))


@pytest.fixture(scope="module")
def response():
    return frequency_response(load_scenario(RESPONSE))


@pytest.mark.parametrize("points", slow_after(1, [1, 20]))
def test_a_mode_keeps_the_points_it_has(mode, points):
    request = After(points)
    part = nnm(load_scenario(MODE), request, stop=request.stop)
    assert mode.complete  # the twin that is not stopped
    assert part.status == f"interrupted at stiffness factor {part.backbone.parameter[-1]:.6g}"
    assert part.summary["status"] == part.status
    assert part.backbone.parameter.size == points < mode.backbone.parameter.size
    np.testing.assert_array_equal(part.backbone.initial_displacement, mode.backbone.initial_displacement[:points])
    (motion,) = (branch.motion for branch in part.branches if branch.motion is not None)
    assert motion.periods == 5  # not 50: a command ends within a second
    nnm_figures(part)


@pytest.mark.parametrize("points", slow_after(1, [1, 20]))
def test_a_response_keeps_the_points_it_has(response, points):
    request = After(points)
    part = frequency_response(load_scenario(RESPONSE), request, request.stop)
    assert response.complete
    assert part.status.startswith("interrupted; range not covered: 0.0795")
    (branch,) = part.branches
    own, whole = branch.floquet_multipliers, response.branches[0].floquet_multipliers
    assert points <= len(own) < len(whole)  # special points are points too
    np.testing.assert_array_equal(own, whole[: len(own)])
    frequency_response_figures(part)


def test_a_response_that_is_stopped_keeps_as_many_points_as_are_quickly_evaluated(response, monkeypatch):
    """These alone: between them no maximum is sought."""
    from beamsim.analyses.response import analysis

    evaluations = []

    def counted(*given, real=analysis.measured_orbit):
        evaluations.append(0)
        return real(*given)

    monkeypatch.setattr(analysis, "POINTS_OF_A_STOPPED_RESPONSE", 10)
    monkeypatch.setattr(analysis, "measured_orbit", counted)
    request = After(20)
    part = frequency_response(load_scenario(RESPONSE), request, request.stop)
    (branch,), whole = part.branches, response.branches[0]
    kept = np.flatnonzero(np.isin(whole.parameter, branch.parameter))
    assert 8 <= kept.size == branch.parameter.size == len(evaluations) <= 11
    assert set(np.diff(kept)[:-1]) == {3}
    np.testing.assert_array_equal(branch.coordinates, whole.coordinates[kept])
    assert part.warnings[-1] == "interrupted: of 3 points of a branch one is kept"


def test_a_response_that_is_stopped_while_it_is_evaluated_evaluates_few_points_of_the_rest(monkeypatch):
    """35 branches were evaluated to the end: 4 s of processor time after the signal."""
    from beamsim.analyses.response import analysis

    @dataclass(frozen=True)
    class Branch:
        points: tuple[int, ...]

    monkeypatch.setattr(analysis, "POINTS_OF_A_STOPPED_RESPONSE", 10)
    evaluated = []

    def response(model, branch, *_):
        evaluated.append(len(branch.points))
        return SimpleNamespace(parameter=np.array(branch.points))

    monkeypatch.setattr(analysis, "_response", response)
    traced = [Branch(tuple(range(100)))] * 4
    assert analysis._responses(None, traced, 1.0, lambda: len(evaluated) >= 2)[1:] == (
        ("interrupted: of 20 points of a branch one is kept",), True,
    )  # fmt: skip
    assert evaluated == [100, 100, 6, 6]
    assert analysis._responses(None, traced, 1.0, lambda: False)[1:] == ((), False)
    assert evaluated[4:] == [100] * 4


def test_a_branch_that_is_being_evaluated_is_evaluated_at_few_more_points(monkeypatch):
    from beamsim.analyses.response import analysis, refinement

    evaluations = []

    def counted(*given, real=analysis.measured_orbit):
        evaluations.append(0)
        return real(*given)

    monkeypatch.setattr(analysis, "measured_orbit", counted)
    monkeypatch.setattr(refinement, "POINTS_AFTER_A_STOP", 4)
    part = frequency_response(load_scenario(RESPONSE), stop=lambda: len(evaluations) >= 5)
    assert 5 + 2 <= part.branches[0].parameter.size <= 5 + 4 + 1
    assert sum(branch.parameter.size for branch in part.branches) == len(evaluations)
    assert part.outcome.interrupted
    assert "interrupted: of the rest of a branch few points are kept" in part.warnings


@pytest.mark.parametrize("stage", ["spectra_of", "_with_impacts", "summary_of_run", "convergence_of"])
def test_a_run_stopped_at_any_stage_keeps_as_many_samples_as_are_quickly_written(stage, monkeypatch, tmp_path):
    from beamsim.analyses.run import analysis, motion

    monkeypatch.setattr(motion, "SAMPLES_OF_A_STOPPED_RUN", 100)
    reached, real = [], getattr(analysis, stage)
    monkeypatch.setattr(analysis, stage, lambda *given: reached.append(1) or real(*given))
    scenario = load_scenario(CONFIGS / "one_sided_45hz.yaml", ["run.duration=0.5 s", "run.sample_rate=2 kHz"])
    part = analysis.run(scenario, stop=lambda: bool(reached))
    assert part.outcome.interrupted
    assert part.warnings.count("interrupted: of 11 output times one is kept") == 1
    np.testing.assert_allclose(part.time, np.arange(91) * 55e-4, rtol=1e-12)
    whole = analysis.run(scenario)
    assert whole.outcome.complete
    for kept in (part, beamsim.open_result(beamsim.write_result(part, tmp_path / "part.h5"))):
        np.testing.assert_allclose(kept.probes["tip"].displacement, whole.probes["tip"].displacement[::11], atol=1e-15)
        np.testing.assert_allclose(kept.energy.stored, whole.energy.stored[::11], rtol=1e-9)


def test_what_was_not_begun_is_named():
    request = After(2)
    part = frequency_response(load_scenario(RESPONSE, ["sweep.levels=[0.1 N, 0.2 N, 0.3 N]"]), request, request.stop)
    assert part.status.startswith("interrupted; not started: level 0.2 N, level 0.3 N")
    scenario = load_scenario(CONFIGS / "nnm_chain_thesis_method.yaml")
    points = nnm(scenario).backbone.parameter.size
    request = After(points)
    assert nnm(scenario, request, stop=request.stop).status == "interrupted at stiffness factor 1"
    request = After(points + 4)
    part = nnm(scenario, request, stop=request.stop)
    assert part.status.endswith("during relaxed minimisation")
    assert 1 <= part.relaxed.factor.size < scenario.nnm.solver.steps


def test_the_search_for_a_point_is_given_up_within_it(monkeypatch):
    """The end is asked for before every passage of a motion; the point before it is the last."""
    from beamsim.flow.variational import VariationalFlow

    carry, begun = VariationalFlow.carry, []
    monkeypatch.setattr(VariationalFlow, "carry", lambda self, *a, **k: begun.append(1) or carry(self, *a, **k))
    whole = nnm(load_scenario(MODE)).backbone.parameter
    for passages in (1, 2):
        request, at_report, at_end = After(20, passages), [], []

        def report(fraction, request=request, at_report=at_report):
            request(fraction)
            at_report.append(len(begun))

        def stop(request=request, at_end=at_end):
            ends = request.stop()
            at_end.extend([len(begun)] if ends else [])
            return ends

        part = nnm(load_scenario(MODE), report, stop=stop)
        np.testing.assert_array_equal(part.backbone.parameter, whole[:20])
        assert part.outcome.interrupted
        assert 1 <= at_end[0] - at_report[19] <= passages  # asked before each of them, and within
    begun.clear()
    with pytest.raises(KeyboardInterrupt):
        nnm(load_scenario(MODE), stop=lambda: True)
    assert len(begun) == 1
    begun.clear()
    with pytest.raises(KeyboardInterrupt):
        frequency_response(load_scenario(RESPONSE), stop=lambda: True)
    assert len(begun) == 1  # asked within the first passage


def test_nothing_found_is_nothing_kept(monkeypatch):
    monkeypatch.setattr("beamsim.analyses.response.branches.ShootingTracer.begin", lambda *_: None)
    with pytest.raises(KeyboardInterrupt):
        frequency_response(load_scenario(RESPONSE), stop=lambda: True)
    with pytest.raises(beamsim.ScenarioError, match="no periodic motion"):
        frequency_response(load_scenario(RESPONSE))


# --- as a process -----------------------------------------------------------------------------------------------------

CHILD = f"""
import signal
import sys
from contextlib import contextmanager
import beamsim.cli
import beamsim.cli.progress

@contextmanager
def telling(label, *, shown, afterwards=""):
    reports = 0
    def tell(fraction):
        nonlocal reports
        reports += 1
        if reports == {POINTS}:
            print("under way", flush=True)
            sys.stdin.readline()
    yield tell

signal.signal(signal.SIGINT, signal.default_int_handler)  # the tests may run where it is ignored
beamsim.cli.progress.progress_of = telling
beamsim.cli.main()
"""


@pytest.fixture
def under_way(tmp_path):
    """Start a command in an empty folder; it waits after a few reports of progress for a line on its input."""
    started = []

    def start(*arguments):
        process = subprocess.Popen(
            [sys.executable, "-c", CHILD, *map(str, arguments)], cwd=tmp_path, text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        started.append(process)
        assert process.stdout.readline() == "under way\n", process.communicate()
        return process

    yield start
    for process in started:
        process.kill()
        process.communicate()


@pytest.mark.parametrize(
    ("command", "path", "read", "number", "code"),
    [
        ("nnm", MODE, open_nnm, signal.SIGINT, 130),
        pytest.param("sweep", RESPONSE, open_response, signal.SIGTERM, 143, marks=pytest.mark.slow),
    ],
)
def test_a_signal_keeps_what_was_found(command, path, read, number, code, under_way, tmp_path):
    process = under_way(command, path, "-o", "case.h5")
    process.send_signal(number)
    output, errors = process.communicate("go on\n", timeout=120)
    assert process.returncode == code, errors
    assert errors.splitlines() == [
        "beamsim: stopping after the current point and saving the partial result; press again to stop immediately",
        "beamsim: interrupted; the partial result is in case.h5; `beamsim plot case.h5` plots it",
    ]
    assert "interrupted" in output
    assert os.listdir(tmp_path) == ["case.h5"]
    kept = read(tmp_path / "case.h5")
    assert kept.status.startswith("interrupted")
    assert POINTS <= kept.branches[0].parameter.size <= POINTS + 1  # the first need not be reported


@pytest.fixture
def heeded():
    """SIGINT as it is in a foreground process, wherever the tests run."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_are_the_commands_only_while_it_can_keep_something(number, heeded, capsys):
    handlers = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    with interruptible() as interrupted:
        assert not interrupted()
        signal.raise_signal(number)
        assert interrupted()
        assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == handlers
    assert "again to stop immediately" in capsys.readouterr().err
    assert exit_code(COMPLETE, interrupted.signal) == 128 + number
    with interruptible():
        assert signal.getsignal(number) not in handlers
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == handlers


@pytest.mark.parametrize("lost", [False, True])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_before_there_is_anything_to_keep_ends_at_once(number, lost, heeded, capsys):
    """While a model is built or a random input is made: seconds, after which a motion of some steps was evaluated."""
    reached = []

    def build_and_march():
        with interruptible() as interrupted:
            with suppress(KeyboardInterrupt) if lost else nullcontext():  # as a callback of the compiler does
                signal.raise_signal(number)
                reached.append("model")
            interrupted()
            reached.append("march")

    with pytest.raises(KeyboardInterrupt if number == signal.SIGINT else SystemExit):
        build_and_march()
    assert not reached
    assert not capsys.readouterr().err  # nothing is saved, and that is not said
    with interruptible() as interrupted:
        assert not interrupted()  # from here on something is kept
        signal.raise_signal(number)
        assert interrupted()


def test_a_signal_while_a_random_input_is_made_leaves_no_file(heeded, monkeypatch, tmp_path):
    from typer.testing import CliRunner

    from beamsim.cli.app import app
    from beamsim.inputs import random_input

    def density(*given, real=random_input.density):
        signal.raise_signal(signal.SIGINT)
        return real(*given)

    monkeypatch.setattr(random_input, "density", density)
    target = tmp_path / "case.h5"
    done = CliRunner().invoke(app, ["run", str(CONFIGS / "random_vibration.yaml"), "--no-plots", "-o", str(target)])
    assert done.exit_code == 130, done.output
    assert done.output == "beamsim: interrupted; no incomplete file was left\n"
    assert not target.exists()


def test_a_signal_that_is_ignored_stays_ignored(heeded):
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with interruptible() as interrupted:
        signal.raise_signal(signal.SIGINT)
        assert not interrupted()


def test_a_second_signal_ends_at_once(under_way, tmp_path):
    process = under_way("nnm", MODE)
    process.send_signal(signal.SIGINT)
    assert "again" in process.stderr.readline()
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 130
    assert errors == "beamsim: interrupted; no incomplete file was left\n"
    assert os.listdir(tmp_path) == []


LONG = {
    "run": ("one_sided_65hz.yaml", "run.duration=2000 s", "run.sample_rate=200 Hz"),
    "sweep": ("sweep_up_down.yaml", "sweep.rate=0.3 oct/min", "sweep.direction=up"),
}


@pytest.mark.parametrize(
    ("command", "number", "code"),
    [
        ("run", signal.SIGINT, 130),
        pytest.param("run", signal.SIGTERM, 143, marks=pytest.mark.slow),
        pytest.param("sweep", signal.SIGTERM, 143, marks=pytest.mark.slow),
    ],
)
def test_a_signal_during_a_long_motion_keeps_what_was_computed(command, number, code, under_way, tmp_path):
    name, *overrides = LONG[command]
    sets = [x for override in overrides for x in ("--set", override)]
    process = under_way(command, CONFIGS / name, *sets, "-o", "case.h5")
    process.send_signal(number)
    _, errors = process.communicate("go on\n", timeout=120)
    assert process.returncode == code, errors
    assert "Traceback" not in errors
    assert os.listdir(tmp_path) == ["case.h5"]
    kept = beamsim.open_result(tmp_path / "case.h5")
    assert kept.outcome.interrupted
    assert not kept.complete
    if command == "run":
        assert 0.0 < kept.time[-1] < 2000.0
        assert kept.time[-1] <= kept.outcome.numbers["parameter"]


@pytest.mark.parametrize(
    ("arguments", "entered", "during"),
    [
        (
            ["run", "one_sided_65hz.yaml", "--set", "run.duration=0.5 s", "--against", "reference"],
            "beamsim.analyses.run.against.output_times",
            "the comparison with the reference integrator",
        ),
        (
            ["sweep", "ms_forced_oscillator.yaml", "--compare", "multiple_scales"],
            "beamsim.analyses.response.forced_expansion._refuse",
            "the expansion",
        ),
    ],
)
def test_a_signal_during_a_comparison_keeps_the_result(arguments, entered, during, heeded, monkeypatch, tmp_path):
    from importlib import import_module

    from typer.testing import CliRunner

    from beamsim.cli.app import app

    module, _, name = entered.rpartition(".")
    real = getattr(import_module(module), name)

    def interrupted(*given):
        os.kill(os.getpid(), signal.SIGINT)
        return real(*given)

    monkeypatch.setattr(entered, interrupted)
    command, config, *more = arguments
    target = tmp_path / "case.h5"
    done = CliRunner().invoke(app, [command, str(CONFIGS / config), *more, "--no-plots", "-o", str(target)])
    assert done.exit_code == 130, done.output
    assert beamsim.open_result(target).status == f"interrupted during {during}"


def test_a_signal_whose_exception_is_lost_ends_a_study_after_the_case(heeded, monkeypatch, tmp_path):
    """As in a callback of the compiler, within which nothing can be raised."""
    from typer.testing import CliRunner

    from beamsim.analyses.designs.cases import CaseSolver
    from beamsim.cli.app import app

    solved = []

    def solve(self, task, real=CaseSolver.solve):
        solved.append(task.index)
        if len(solved) == 2:
            with suppress(KeyboardInterrupt):
                os.kill(os.getpid(), signal.SIGINT)
        return real(self, task)

    monkeypatch.setattr(CaseSolver, "solve", solve)
    sets = ["--set", "vary.samples=5", "--set", "run.duration=0.5 s", "--workers", "1", "--no-plots"]
    target = tmp_path / "study.h5"
    done = CliRunner().invoke(app, ["sweep", str(CONFIGS / "design_tolerances.yaml"), *sets, "-o", str(target)])
    assert done.exit_code == 130, done.output
    assert len(solved) == 2
    assert "2 of 5 cases are in" in done.output
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_of_which_a_library_makes_an_error_is_a_signal(number, code, heeded, monkeypatch, tmp_path):
    """As pyuff does: it catches everything while it writes."""
    import pyuff
    from typer.testing import CliRunner

    from beamsim.cli.app import app

    def write(*_, **__):
        try:
            os.kill(os.getpid(), number)
        except BaseException as error:
            raise RuntimeError("Error writing data-set #58") from error

    short = ["--set", "run.duration=0.5 s", "--no-plots", "-o", str(tmp_path / "case.h5")]
    done = CliRunner().invoke(app, ["run", str(CONFIGS / "one_sided_45hz.yaml"), *short])
    assert done.exit_code == 0, done.output
    monkeypatch.setattr(pyuff.UFF, "write_sets", write)
    before = signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number))
    try:
        done = CliRunner().invoke(app, ["export", str(tmp_path / "case.h5"), "--format", "uff", "-o", str(tmp_path)])
    finally:
        signal.signal(signal.SIGTERM, before)
    assert done.exit_code == code, done.output
    assert done.output == "beamsim: interrupted; no incomplete file was left\n"
    assert os.listdir(tmp_path) == ["case.h5"]


def test_what_is_raised_again_is_what_was_lost(heeded):
    with raised_again() as check:
        check()
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            check()


# --- while a result is written and drawn ------------------------------------------------------------------------------

MASS = """
chain: {masses: [1 kg], springs: [1 kN/m]}
snubbers: [{name: stop, mass: 1, side: below, gap: 1 mm, stiffness: 1e5}]
excitation: {kind: harmonic, applied_to: base, frequency: 5 Hz, level: 2}
"""
SHORT = "run: {duration: 0.2 s, convergence: off}\n"
WRITTEN = {  # what is written at once, in parts, and beside a journal
    "run": ("run", SHORT),
    "long histories": ("run", SHORT.replace("0.2 s", "0.2 s, sample_rate: 1500 kHz")),
    "study": ("sweep", SHORT + "vary: {kind: grid, parameters: [{path: snubbers.stop.gap, values: [1 mm, 2 mm]}]}\n"),
}
WAITS = "beamsim: stopping when case.h5 is written; press again to stop immediately, without it"


@pytest.fixture
def invoked(heeded, monkeypatch, tmp_path):
    """Run the command of a small case in an empty folder."""
    from typer.testing import CliRunner

    from beamsim.cli.app import app

    monkeypatch.chdir(tmp_path)
    before = signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number))  # as `beamsim.cli.main` does

    def invoke(name, *options):
        command, sections = WRITTEN[name]
        Path("case.yaml").write_text(MASS + sections)
        done = CliRunner().invoke(app, [command, "case.yaml", "--quiet", *options])
        Path("case.yaml").unlink()
        return done

    yield invoke
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
    from beamsim.store import declared

    signals_in(monkeypatch, declared, "_write_member", signal.SIGTERM)
    done = invoked(name, *([] if plots else ["--no-plots"]))
    assert "; press again to stop immediately" in done.output
    kept = beamsim.open_result("case.h5")
    assert os.listdir() == ["case.h5"]
    if name == "long histories":  # are cut
        assert done.exit_code == 143, done.output
        assert "the partial result is in case.h5" in done.output
        assert "interrupted during the writing of the histories (65536 of 300001 samples are kept)" in kept.status
        assert kept.time.size == 65536
        return
    assert kept.complete
    if plots:  # which are left out
        assert done.exit_code == 143, done.output
        assert "the whole result is in case.h5; `beamsim plot case.h5` plots it" in done.output
    else:  # nothing is
        assert done.exit_code == 0, done.output
        assert "interrupted" not in done.output


@pytest.mark.parametrize("name", ["run", "long histories"])
def test_a_second_signal_while_the_file_is_written_ends_at_once(name, invoked, monkeypatch):
    from beamsim.store import declared

    signals_in(monkeypatch, declared, "_write_member", signal.SIGINT, signal.SIGINT)
    done = invoked(name)
    assert done.exit_code == 130, done.output
    assert done.output.splitlines()[-2:] == [WAITS, "beamsim: interrupted; no incomplete file was left"]
    assert not os.listdir()


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_while_a_picture_is_written_keeps_the_result(number, code, invoked, monkeypatch):
    from beamsim.plots import save

    whole = save.draw

    def half(figure, path, *given):
        if pictures:
            path.write_bytes(b"half of one")
            os.kill(os.getpid(), number)
        pictures.append(path)
        whole(figure, path, *given)

    pictures = []
    monkeypatch.setattr(save, "draw", half)
    done = invoked("run", "--json")
    assert done.exit_code == code, done.output
    assert "the whole result is in case.h5; `beamsim plot case.h5` plots it" in done.stderr
    listed = json.loads(done.stdout)["files"]
    assert len(listed) == 2
    assert sorted(listed) == sorted(os.listdir())
    assert beamsim.open_result("case.h5").complete


@pytest.mark.parametrize("form", ["csv", "mat", "uff"])
def test_a_signal_while_a_result_is_exported_leaves_nothing_incomplete(form, invoked, monkeypatch):
    from typer.testing import CliRunner

    from beamsim import files
    from beamsim.cli.app import app

    assert invoked("run", "--no-plots").exit_code == 0

    def replace(temporary, target):
        assert temporary.stat().st_size
        os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(files, "_replace", replace)
    done = CliRunner().invoke(app, ["export", "case.h5", "--format", form, "-o", "exported"])
    assert done.exit_code == 130, done.output
    assert [path.name for path in Path().rglob("*") if path.is_file()] == ["case.h5"]


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_a_termination_of_which_a_library_makes_an_error_of_its_own():
    def compile_badly():
        try:
            os.kill(os.getpid(), signal.SIGTERM)
        except KeyboardInterrupt:
            raise ValueError("not compiled") from None

    with pytest.raises(SystemExit) as ended, interruptible():
        compile_badly()
    assert ended.value.code == 143
