"""Factories shared by the tests."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from functools import cache
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

# as on the command line, and before numpy is loaded: the matrices are small, and the tests have the processors already
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("MKL_NUM_THREADS", "1")

import durations
import kernels
import numpy as np
import pytest
import typer.testing
from durations import pytest_addoption, pytest_collection_modifyitems
from hypothesis import settings

from beamsim.analyses.run.result import RunResult
from beamsim.contacts.contacts import Contacts
from beamsim.contacts.laws import kelvin_voigt
from beamsim.contacts.pads import no_tension as relaxing
from beamsim.inputs.signal import Signal
from beamsim.system.equations import Forcing, PiecewiseLinearSystem
from tests.helpers.solved import SharedCommands

# Tests are not a package (importmode=importlib), so the shared module is loaded by its place.
_spec = spec_from_file_location("fabricated", Path(__file__).with_name("fabricated.py"))
assert _spec is not None
assert _spec.loader is not None
_fabricated = sys.modules.setdefault(_spec.name, module_from_spec(_spec))  # its dataclasses look there
_spec.loader.exec_module(_fabricated)

# The commands are built once in a process, not once for each call, which takes longer than many of them.
typer.testing._get_command = cache(typer.testing._get_command)  # type: ignore[attr-defined]

# the same examples in every run of continuous integration; fresh ones on a developer's machine
settings.register_profile("ci", derandomize=True)
if os.environ.get("CI"):
    settings.load_profile("ci")


__all__ = ["pytest_addoption", "pytest_collection_modifyitems"]  # hooks


def pytest_configure(config: pytest.Config) -> None:
    """Record durations on request, and let workers and the commands that tests start keep bytecode beside the sources.

    Where the environment forbids that, each process compiles the package's sources again: a third of a short command.
    """
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    durations.configure(config)


@contextmanager
def _keeping_all() -> Generator[None]:
    """Make objects that stay: no search for garbage meanwhile, and none through them later; both take long."""
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
        gc.collect()
        gc.freeze()


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Collect the tests; afterwards look for garbage a seventieth as often as usual, which was a tenth of the time."""
    with _keeping_all():
        collected = yield
    gc.set_threshold(50_000, 20, 20)
    return collected


@pytest.fixture(scope="module", autouse=True)
def no_garbage_of_other_modules() -> Iterator[None]:
    """Let no cycle of objects outlive its module; figures and results would fill the memory between rare searches."""
    yield
    gc.collect()


@pytest.fixture(scope="session", autouse=True)
def no_processor_time_on_screens() -> Iterator[None]:
    """Many commands run in the process of the tests, whose processor time is not theirs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("beamsim.cli.command.WORTH_STATING_S", np.inf)
        yield


@pytest.fixture(scope="session", autouse=True)
def compiled_kernels(request: pytest.FixtureRequest) -> None:
    """Under xdist, share the compilation of the kernels between the workers, so that none is compiled by each.

    Numba's cache on disk is common to all processes: what a worker has not compiled here it reads from there later,
    unless it needs it before the worker whose share it is has finished. Without xdist, kernels compile when called.
    A process that compiles keeps up to 600 MB until it ends, so that where nothing is compiled yet, others do it.
    """
    worker = getattr(request.config, "workerinput", None)
    if worker is None:
        return
    share = (int(worker["workerid"].removeprefix("gw")), worker["workercount"])
    if not kernels.any_compiled():
        subprocess.run([sys.executable, kernels.__file__, *map(str, share)], check=True)
    with _keeping_all():
        kernels.call(*share)


@pytest.fixture(scope="session")
def solve(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> SharedCommands:
    """Execute a command on a shipped config, unless a test of this session has done it, or of one before it.

    Sessions have what they solved in common where the environment names a folder for it.
    """
    folder = tmp_path_factory.getbasetemp()
    of_session = (folder.parent if hasattr(request.config, "workerinput") else folder) / "solved"
    return SharedCommands(Path(os.environ.get("SOLVED_COMMANDS", of_session)))


@pytest.fixture(scope="session")
def make_contacts() -> Callable[..., Contacts]:
    def make(shape, stiffness, dashpot=0.0, gap=0.0, sign=1.0, on_ground=False, no_tension=False):
        shape = np.atleast_2d(np.asarray(shape, dtype=float))

        def spread(value, kind=float):
            return np.array(np.broadcast_to(np.asarray(value, dtype=kind), shape.shape[0]))

        laws = [relaxing if one else kelvin_voigt for one in spread(no_tension, bool)]
        numbers = zip(laws, spread(stiffness).tolist(), spread(dashpot).tolist(), strict=True)
        return Contacts(
            shape, spread(sign), spread(gap), spread(on_ground, bool), tuple(law(k, c) for law, k, c in numbers)
        )

    return make


@pytest.fixture(scope="session")
def make_system(make_contacts) -> Callable[..., PiecewiseLinearSystem]:
    def make(omega, damping, constant_load=None, **contacts):
        omega = np.asarray(omega, dtype=float)
        damping = np.asarray(damping, dtype=float)
        if damping.ndim == 1:
            damping = np.diag(damping)
        load = np.zeros(omega.size) if constant_load is None else np.asarray(constant_load, dtype=float)
        return PiecewiseLinearSystem(omega**2, damping, make_contacts(**contacts), load)

    return make


@pytest.fixture(scope="session")
def no_forcing() -> Callable[[int], Forcing]:
    def make(n: int) -> Forcing:
        return Forcing(np.zeros((0, n)), ())

    return make


@pytest.fixture(scope="session")
def two_tones() -> tuple[Signal, Signal]:
    """An acceleration with two tones and the displacement without drift that belongs to it."""
    amplitude, omega, phase = np.array([1.0, 0.5]), np.array([1.3, 4.1]), np.array([0.3, 0.2])
    return Signal.harmonic(amplitude, omega, phase), Signal.harmonic(-amplitude / omega**2, omega, phase)


@pytest.fixture
def heeded() -> Iterator[None]:
    """SIGINT as it is in a foreground process, wherever the tests run."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def without_examination(monkeypatch: pytest.MonkeyPatch) -> None:
    """No other process reads edited HDF5 files first, which takes a third of a second a file: HDF5 survives them."""

    def survived(command: list[str], **_: Any) -> subprocess.CompletedProcess[bytes]:
        assert "examine" in command[3]
        return subprocess.CompletedProcess(command, 0, b"", b"")

    monkeypatch.setattr("subprocess.run", survived)


@pytest.fixture
def fabricated_run() -> Callable[..., RunResult]:
    """Factory of consistent results that no solver made."""
    factory: Callable[..., RunResult] = _fabricated.fabricate
    return factory
