"""Processor time of calls and commands, and of the references to which the rows of the table are compared."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

import beamsim
from beamsim.flow.exact import exact_flow
from beamsim.flow.transient import simulate
from beamsim.system.build import build_system

CASE = "configs/one_sided_65hz.yaml"
IMPORTS = "import numpy, scipy.linalg, scipy.sparse, matplotlib.figure, pydantic"
MOST_REPETITIONS = 7
SECONDS = 4.0  # after which a measurement is not repeated


class Spent(NamedTuple):
    """What a command took."""

    seconds: float  # of a processor, with all its threads
    megabytes: float  # largest memory


def spent() -> float:
    """s, processor time of this process and of those that it started and that have ended."""
    return time.process_time() + sum(os.times()[2:4])


def processor_time(function: Callable[[], Any]) -> float:
    """Processor time of one call, s."""
    begin = spent()
    function()
    return spent() - begin


def command(arguments: Sequence[str], environment: Mapping[str, str] | None = None) -> Spent:
    """Run Python with arguments and say what it took.

    Raises
    ------
    RuntimeError
        If it fails, or on a system that does not tell what a process took.
    """
    if not hasattr(os, "wait4"):
        raise RuntimeError("this system does not tell the processor time of a command")
    inherited = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    process = subprocess.Popen(
        [sys.executable, *arguments],
        env={**inherited, **(environment or {})},  # with bytecode, as after an installation
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"`python {' '.join(arguments)}` ends with code {process.returncode}")
    unit = 1e-6 if sys.platform == "darwin" else 1e-3
    return Spent(usage.ru_utime + usage.ru_stime, usage.ru_maxrss * unit)


def imports() -> float:
    """Processor time of importing the libraries of a run with pictures in a fresh process, s."""
    return command(["-c", IMPORTS]).seconds


@cache
def _readme_system() -> tuple[Any, float]:
    scenario = beamsim.load_scenario(CASE)
    assert scenario.run is not None
    return build_system(scenario), scenario.run.duration


def march() -> float:
    """Processor time of the march of the README's case, its contact states included, s."""
    system, duration = _readme_system()
    return min(processor_time(lambda: simulate(exact_flow(system, duration), system.initial_state)) for _ in range(10))


def interleaved(once: Callable[[], float], reference: Callable[[], float], *, repeat: bool) -> tuple[float, float]:
    """Smallest value of a measurement and of its reference, taken in turns."""
    values, references = [once()], [reference()]
    begin = time.perf_counter()
    while repeat and len(values) < MOST_REPETITIONS and time.perf_counter() - begin < SECONDS:
        values.append(once())
        references.append(reference())
    return min(values), min(references)
