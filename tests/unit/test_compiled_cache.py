"""Where compiled code is kept, and when it is compiled again."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import beamsim

PACKAGE = Path(beamsim.__file__).parent
NOWHERE = "/dev/null/nowhere"  # cannot be made, not even by an administrator

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs /dev/null")

TWO_KERNELS = """
from beamsim.flow.compiled import kernel
@kernel
def f(x):
    return 2 * x
@kernel
def g(x):
    return f(x) + 1
"""


@pytest.fixture
def installed(tmp_path):
    """A copy of the package with two small kernels, where no folder of the user can be written."""
    shutil.copytree(PACKAGE, tmp_path / "site/beamsim", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "site/beamsim/flow/two_kernels.py").write_text(TWO_KERNELS)
    return tmp_path / "site"


def python(site, code, **environment):
    # Lines of the copy are not lines of the package: a measurement of coverage does not follow there.
    left_out = ("NUMBA_CACHE_DIR", "COVERAGE_")
    kept = {key: value for key, value in os.environ.items() if not key.startswith(left_out)}
    where = {"PYTHONPATH": str(site), "HOME": NOWHERE, "XDG_CACHE_HOME": NOWHERE, "LOCALAPPDATA": NOWHERE}
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**kept, **where, **environment},
        cwd=site,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return done


CALL = """
import warnings
from beamsim.cli import prepare_streams, show_warning
prepare_streams()
warnings.showwarning = show_warning
from beamsim.flow.two_kernels import f, g
print(g(10), sum(g.stats.cache_hits.values()))
"""
NOTICE = "beamsim: compiling the numerical kernels"


def test_the_users_folder_of_caches(installed, tmp_path):
    """The first process compiles and says so; the second does not."""
    first, second = (python(installed, CALL, XDG_CACHE_HOME=str(tmp_path / "caches")) for _ in range(2))
    assert (first.stdout, second.stdout) == ("21 0\n", "21 1\n")
    (line,) = first.stderr.splitlines()
    assert line.startswith(NOTICE)
    assert not second.stderr
    (folder,) = (tmp_path / "caches/beamsim").iterdir()
    assert folder.stat().st_mode & 0o077 == 0


TIMED = """
import time
from beamsim.flow.compiled import processor_time
solver, process = processor_time(), time.process_time()
g(1.0)
print(processor_time() - solver, time.process_time() - process)
"""


def test_nowhere(installed):
    """No folder at all: the kernels are compiled in memory, and work; the time of a solver is without that.

    The first sweep of a process was said to take 32 s for 0.5 s; one kernel is compiled while another is.
    """
    done = python(installed, CALL + TIMED)
    called, timed = done.stdout.splitlines()
    assert called == "21 0"
    solver, process = map(float, timed.split())
    assert 0.0 <= solver < 0.2 * process
    (line,) = done.stderr.splitlines()
    assert "every process compiles" in line
    assert "NUMBA_CACHE_DIR" in line


def test_a_change_of_one_file_compiles_its_callers_in_other_files_again(installed, tmp_path):
    """An upgrade replaces the sources and leaves the compiled code: no kernel may go on calling an old one."""
    flow, cache = installed / "beamsim/flow", tmp_path / "cache"
    inner, outer = flow / "inner_kernels.py", flow / "outer_kernels.py"
    head = "from beamsim.flow.compiled import kernel\n"
    outer.write_text(f"{head}from beamsim.flow.inner_kernels import f\n@kernel\ndef g(x):\n    return f(x) + 1\n")
    values = []
    for factor in (2, 2, 3):
        inner.write_text(f"{head}@kernel\ndef f(x):\n    return {factor} * x\n")
        code = "from beamsim.flow.outer_kernels import g; print(g(10), sum(g.stats.cache_hits.values()))"
        # Python's own compiled files do not see a change of the same size within the same second
        without = {"NUMBA_CACHE_DIR": str(cache), "PYTHONDONTWRITEBYTECODE": "1"}
        values.append(python(installed, code, **without).stdout.split())
    assert values == [["21", "0"], ["21", "1"], ["31", "0"]]


RUN_AND_COUNT = """
import gc, sys
from beamsim.cli import main
sys.argv = ["beamsim", "run", {case!r}, "--no-plots", "--json", "-o", {folder!r}]
try:
    main()
except SystemExit as end:
    assert not end.code, end.code
kernels = [x for x in gc.get_objects() if hasattr(type(x), "nopython_signatures")]
compiled = {{x.py_func.__qualname__: sum(x.stats.cache_misses.values()) for x in kernels}}
print({{name: count for name, count in compiled.items() if count}}, file=sys.stderr)
"""


def test_after_a_warm_up_a_run_compiles_nothing(tmp_path):
    """In the cache of all tests, so that nothing is compiled for this one alone."""
    case = PACKAGE.parent / "configs/one_sided_65hz.yaml"
    environment = {**os.environ, "PYTHONPATH": str(PACKAGE.parent)}
    commands = ["-m", "beamsim", "warmup", "--json"], ["-c", RUN_AND_COUNT.format(case=str(case), folder=str(tmp_path))]
    for command in commands:
        done = subprocess.run([sys.executable, *command], env=environment, capture_output=True, text=True, timeout=600)
        assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["status"] == "complete"
    assert done.stderr.splitlines()[-1] == "{}"
