"""Faults seeded into the event search, and into what resolves places: each must be caught.

A copy of the package with one change in its search runs in a process of its own, compiled or interpreted; events and
states of its motions are compared as in `comparison`. The first systems are aimed at double eigenvalues, slow decays.
A module that resolves places is changed as it is imported, and the tests of places run on it.
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
        "    step, hit, put_below = reach - tau, NO_EVENT, False\n    for j in range(guards.count):",
        "    step, hit, put_below = reach - tau, NO_EVENT, False\n    for j in range(min(1, guards.count)):",
    ),
    "released faces start from the wrong side": (
        KERNELS,
        "        y[tables.first[contact] + i] = total",
        "        y[tables.first[contact] + i] = -total",
    ),
    "segments outlast their series": (
        KERNELS,
        "            H = min(stop - t, tables.horizon[state])",
        "            H = stop - t",
    ),
    "breaks of the input are run over": (
        KERNELS,
        "return piece, min(end, inputs.start[piece + 1]) if piece < last else end",
        "return piece, end",
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

BODY, PLACES, PARAMETERS = "beamsim/scenario/body.py", "beamsim/structures/places.py", "beamsim/scenario/parameters.py"
OF_PLACES = {
    "a share is taken for metres": (BODY, "x = side * position.value if", "x = position.value if"),
    "a share of half the length": (BODY, "x = side * position.value if", "x = 0.5 * side * position.value if"),
    "y is a share of the length": (BODY, "self.metres(position[1], 1)", "self.metres(position[1], 0)"),
    "nothing is beyond its body": (BODY, "        if x > side:\n", "        if x > 2.0 * side:\n"),
    "ends are where round-off puts them": (BODY, "return side if same_position(x, side) else x", "return x"),
    "places are on the first body": (PLACES, "name = place.body or body", "name = next(iter(sections))"),
    "parts that are loaded are of the first body": (
        PLACES,
        "(sections[body].point(end) for end in ends)",
        "(next(iter(sections.values())).point(end) for end in ends)",
    ),
    "places of outputs are left out": (
        "beamsim/system/outputs.py",
        "        place = site_in(self.model.scenario, output)\n",
        "        place = site_in(self.model.scenario, output)\n"
        "        place = replace(place, point=getattr(output.place.position, 'value', place.point))\n",
    ),
    "positions y of a table are shares of the length": (
        "beamsim/scenario/distributed.py",
        "body.metres(each, axis)",
        "body.metres(each)",
    ),
    "tables reach beyond their body": (
        "beamsim/scenario/distributed.py",
        "yield from body.position_problems_of_side(body_path, (*path, key, index), position, axis)",
        "pass",
    ),
    "values are along the first side": (PARAMETERS, "int(second and len(body.sides) > 1)", "0"),
    "a number of a pair is read as the first": (PARAMETERS, "if k in first or not first)", "if k == 0)"),
    "measured shapes are on the first body": (
        PARAMETERS,
        'named = found[0].bodies[0] if found else ""',
        "named = next(iter(scenario.all_bodies))",
    ),
    "bounds reach beyond their body": (
        "beamsim/scenario/identification.py",
        "        for bound in (low, high):\n",
        "        for bound in ():\n",
    ),
    "shares of a list are those of the nominal length": (
        "beamsim/scenario/studies.py",
        "return str(read) if isinstance(read, q.Rate | Share) else read",
        "return str(read) if isinstance(read, q.Rate) else in_metres(scenario, place, read)",
    ),
    "a snubber moves along the first body": (
        "beamsim/scenario/sweep.py",
        "return located.item, scenario.all_bodies[name]",
        "return located.item, next(iter(scenario.all_bodies.values()))",
    ),
    "shapes are compared at shares of a metre": (
        "beamsim/analyses/identify/analysis.py",
        "tuple(map(body.metres, measured.positions))",
        "tuple(getattr(p, 'value', p) for p in measured.positions)",
    ),
}
"""The same in what resolves places."""

CHILD = """
import sys
from pathlib import Path
from comparison import caught
from random_systems import AIMED
print(caught([*AIMED, *range(int(sys.argv[1]), int(sys.argv[2]))], Path(sys.argv[3])))
"""


def catch(name, first, last, compiled=True):
    """What the systems of seeds first … last - 1 say about a seeded fault: the first difference, or ''.

    A fault that the first of them shows is found sooner without the compilation of the kernels.
    """
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
        environment["NUMBA_DISABLE_JIT"] = str(int(not compiled))
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


AS_IMPORTED = """
import sys
from importlib.machinery import PathFinder, SourceFileLoader
import pytest

module, text, instead, *tests = sys.argv[1:]

class Changed(SourceFileLoader):
    def get_code(self, name):
        return compile(self.get_data(self.path).decode().replace(text, instead), self.path, "exec")

class Finder(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        spec = super().find_spec(name, path, target)
        if name == module:
            spec.loader = Changed(name, spec.origin)
        return spec

sys.meta_path.insert(0, Finder)
raise SystemExit(pytest.main(["-x", "-q", "-n", "0", "-p", "no:cacheprovider", "-m", "not slow", *tests]))
"""


def caught_by_tests(name, tests=("tests/property/test_places.py",)):
    """The first test that fails with a fault in what resolves places, '' where all pass; any other name is of none."""
    file, text, instead = OF_PLACES.get(name, NONE)
    if (ROOT / file).read_text(encoding="utf-8").count(text) != 1:
        raise AssertionError(f"{name}: the text to change is not there once")
    module = file.removesuffix(".py").replace("/", ".")
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", AS_IMPORTED, module, text, instead, *tests],
        cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    failed = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    if done.returncode not in (0, 1, 2) or bool(done.returncode) != bool(failed):
        raise AssertionError(f"{name}: {done.stdout[-1000:]}{done.stderr[-1000:]}")
    return failed[0] if failed else ""
