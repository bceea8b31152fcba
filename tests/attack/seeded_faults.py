"""Faults seeded into a copy of the event search: each must be caught by the random systems.

A copy of the package with one change compiles its kernels and runs in a process of its own; events and states of its
motions are compared as in `comparison`. The first systems are aimed at double eigenvalues and slow decays.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
KERNELS = "beamsim/flow/kernels.py"

SEEDED = {
    "step towards a zero 40 % too long": (
        KERNELS,
        "return 2.0 * g / (root - slope)",
        "return 2.8 * g / (root - slope)",
    ),
    "bound on the curvature a tenth": (
        KERNELS,
        "            noise = EPS * (8.0 + r * tau) * level\n",
        "            noise = EPS * (8.0 + r * tau) * level\n            bound *= 0.1\n",
    ),
    "bound without the cross term of tau e^(lambda tau)": (
        KERNELS,
        "bound = (r2 * reach + 2.0 * r) * level",
        "bound = r2 * reach * level",
    ),
    "bound without the last term of powers": (KERNELS, "+ p * (p - 1.0)) * rp * level", ") * rp * level"),
    "sign in the slope": (
        KERNELS,
        "value.real, value.imag, slope.real, slope.imag",
        "value.real, value.imag, slope.real, -slope.imag",
    ),
    "decay taken at the far end": (
        KERNELS,
        "math.exp(lam.real * (tau if lam.real < 0.0 else reach))",
        "math.exp(lam.real * reach)",
    ),
    "only the first contact is watched": (
        KERNELS,
        "    step, hit = reach - tau, NO_EVENT\n    for j in range(guards.count):",
        "    step, hit = reach - tau, NO_EVENT\n    for j in range(min(1, guards.count)):",
    ),
    "released faces start from the wrong side": (
        KERNELS,
        "        y[tables.first[contact] + i] = total",
        "        y[tables.first[contact] + i] = -total",
    ),
    "segments outlast their series": (
        KERNELS,
        "            whole = tables.horizon[state] >= H",
        "            whole = True",
    ),
    "breaks of the input are run over": (
        KERNELS,
        "                stop = inputs.start[piece + 1]",
        "                pass",
    ),
    "the curvature is taken for that of the first term": (
        KERNELS,
        "            bound = r2 * level\n",
        "            bound = r2 * level if b == 0 else 0.0\n",
    ),
    "late by 1e9 times the round-off": (
        KERNELS,
        "        if lifted < tolerance:",
        "        if lifted < -1e9 * tolerance:",
    ),
}
"""What is changed: file, text, and what stands there instead."""

NONE = (KERNELS, "EPS = ", "EPS = ")  # the twin: nothing is changed, and nothing may be found

CHILD = """
import sys
from pathlib import Path
from comparison import caught
from random_systems import AIMED
print(caught([*AIMED, *range(int(sys.argv[1]), int(sys.argv[2]))], Path(sys.argv[3])))
"""


def catch(name, first, last):
    """What the systems of seeds first … last - 1 say about a seeded fault: the first difference, or ''."""
    file, text, instead = SEEDED.get(name, NONE)
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        shutil.copytree(ROOT / "beamsim", copy / "beamsim", ignore=shutil.ignore_patterns("__pycache__"))
        source = (copy / file).read_text(encoding="utf-8")
        if source.count(text) != 1:
            raise AssertionError(f"{name}: the text to change is there {source.count(text)} times")
        (copy / file).write_text(source.replace(text, instead), encoding="utf-8")
        paths = [str(copy), str(ROOT / "tests/attack"), str(ROOT / "tests/helpers")]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
        environment = {k: v for k, v in environment.items() if not k.startswith(("COVERAGE_", "NUMBA_CACHE_DIR"))}
        environment["NUMBA_OPT"] = "1"  # half of the compilation: the fault is one of mathematics
        done = subprocess.run(
            [sys.executable, "-W", "ignore", "-c", CHILD, str(first), str(last), folder],
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            timeout=1200,
            check=False,
        )
    if done.returncode:
        raise AssertionError(f"{name}: {done.stderr[-2000:]}")
    return done.stdout.strip()
