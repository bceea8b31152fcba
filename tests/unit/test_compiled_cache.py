"""Where compiled code is kept if neither the package's folder nor the home folder can be written."""

import gc
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import pytest

import beamsim
from beamsim.flow.compiled import njit

PACKAGE = Path(beamsim.__file__).parent
NOWHERE = "/dev/null/nowhere"  # cannot be made, not even by an administrator

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs /dev/null")


@pytest.fixture
def installed(tmp_path):
    """A copy of the package in which no folder for compiled code can be made."""
    shutil.copytree(PACKAGE, tmp_path / "site/beamsim", ignore=shutil.ignore_patterns("__pycache__"))
    for folder in (tmp_path / "site/beamsim").rglob("*/"):
        if folder.is_dir():
            (folder / "__pycache__").touch()
    return tmp_path / "site"


def python(site, code, **environment):
    # Lines of the copy are not lines of the package: a measurement of coverage does not follow there.
    left_out = ("NUMBA_CACHE_DIR", "COVERAGE_")
    kept = {key: value for key, value in os.environ.items() if not key.startswith(left_out)}
    where = {"PYTHONPATH": str(site), "HOME": NOWHERE, "XDG_CACHE_HOME": NOWHERE, "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run(
        [sys.executable, "-c", code],
        env={**kept, **where, **environment},
        cwd=site,
        capture_output=True,
        text=True,
        timeout=300,
    )


SAY = "import sys; from beamsim.cli import show_warning; import warnings; warnings.showwarning = show_warning; "
COMPILE = (
    "import os, beamsim.flow.orbit_kernels, beamsim.flow.sweep_kernels, beamsim.flow.taylor_kernels; "
    "print(beamsim.flow.__file__, os.environ.get('NUMBA_CACHE_DIR'))"
)


def test_a_private_temporary_folder(installed, tmp_path):
    (tmp_path / "temporary").mkdir()
    done = python(installed, SAY + COMPILE, TMPDIR=str(tmp_path / "temporary"))
    assert done.returncode == 0, done.stderr
    assert str(installed) in done.stdout
    (folder,) = (tmp_path / "temporary").iterdir()
    assert str(folder) in done.stdout
    assert folder.stat().st_mode & 0o077 == 0
    (line,) = done.stderr.splitlines()
    assert line.startswith("beamsim: warning: neither the package's folder nor the home folder can be written")
    assert str(folder) in line
    assert "NUMBA_CACHE_DIR" in line


def test_a_folder_of_somebody_else_is_not_used(installed, tmp_path):
    """Compiled code is executed: a folder that others can write is refused."""
    folder = tmp_path / f"beamsim-{os.getuid()}"
    folder.mkdir()
    folder.chmod(0o777)
    done = python(installed, SAY + COMPILE, TMPDIR=str(tmp_path))
    assert done.returncode == 0, done.stderr
    (line,) = done.stderr.splitlines()
    assert "every process compiles" in line
    assert not list(folder.iterdir())


def test_nowhere(installed):
    """No folder at all: the kernels are compiled in memory, and work."""
    add = "from beamsim.flow.compiled import njit\nf = njit(cache=True)(eval('lambda x: x + 1'))\nprint(f(1))"
    code = "import tempfile; tempfile.tempdir = '/dev/null/nowhere'\n" + SAY + "\n" + COMPILE
    done = python(installed, code + "\n" + add)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "2"
    (line,) = done.stderr.splitlines()
    assert "every process compiles" in line


@pytest.mark.slow
def test_a_change_of_one_file_compiles_its_callers_in_other_files_again(installed, tmp_path):
    """An upgrade replaces the sources and leaves the compiled code: no kernel may go on calling an old one."""
    flow, cache = installed / "beamsim/flow", tmp_path / "cache"
    inner, outer = flow / "inner_kernels.py", flow / "outer_kernels.py"
    head = "from beamsim.flow.compiled import njit\n"
    outer.write_text(
        f"{head}from beamsim.flow.inner_kernels import f\n@njit(cache=True)\ndef g(x):\n    return f(x) + 1\n"
    )
    values = []
    for factor in (2, 2, 3):
        inner.write_text(f"{head}@njit(cache=True)\ndef f(x):\n    return {factor} * x\n")
        code = "from beamsim.flow.outer_kernels import g; print(g(10), sum(g.stats.cache_hits.values()))"
        done = python(installed, code, NUMBA_CACHE_DIR=str(cache))
        assert done.returncode == 0, done.stderr
        values.append(done.stdout.split())
    assert values == [["21", "0"], ["21", "1"], ["31", "0"]]


TWO_KERNELS = """
from beamsim.flow.compiled import kernel
@kernel
def f(x):
    return 2 * x
@kernel
def g(x):
    return 3 * x
"""


LOAD_AND_COMPILE = """
import sys
from beamsim.cli import show_notices
show_notices()
from beamsim.flow.two_kernels import f, g
print(f(1) + g(1), "numba.typed.typeddict" in sys.modules)
print("then", file=sys.stderr, flush=True)
print(g({another}))
"""


def test_the_first_compilation_is_announced_on_standard_error(installed, tmp_path):
    """What is compiled is loaded without all that compiling imports; another type is compiled after that."""
    (installed / "beamsim/flow/two_kernels.py").write_text(TWO_KERNELS)
    first, second = (
        python(installed, LOAD_AND_COMPILE.format(another=another), NUMBA_CACHE_DIR=str(tmp_path / "cache"))
        for another in (1.0, 2j)
    )
    assert (first.stdout, second.stdout) == ("5 True\n3.0\n", "5 False\n6j\n")
    notice = "beamsim: compiling the numerical kernels"
    assert [line.startswith(notice) for line in first.stderr.splitlines()] == [True, False]
    assert [line.startswith(notice) for line in second.stderr.splitlines()] == [False, True]


LITERALS = """
from beamsim.flow.compiled import inner, kernel
@inner
def power(x, k):
    return x ** k
@kernel
def f(x, k):
    return power(x, 2) + power(x, 3) + power(x, k)
"""


def test_numbers_that_are_written_out_are_no_types_of_their_own(installed, tmp_path):
    (installed / "beamsim/flow/literal_kernels.py").write_text(LITERALS)
    code = "from beamsim.flow.literal_kernels import f, power; print(f(2, 1), len(power.signatures))"
    done = python(installed, code, NUMBA_CACHE_DIR=str(tmp_path / "cache"))
    assert done.stdout == "14 1\n", done.stderr


RUN_AND_COUNT = """
import gc, sys
from numba.core.dispatcher import Dispatcher
from beamsim.cli import main
sys.argv = ["beamsim", "run", {case!r}, "--no-plots", "--json", "-o", {folder!r}]
try:
    main()
except SystemExit as end:
    assert not end.code, end.code
ours = [x for x in gc.get_objects() if isinstance(x, Dispatcher) and x.py_func.__module__.startswith("beamsim")]
compiled = {{f"{{x.py_func.__module__}}.{{x.py_func.__name__}}": len(x.signatures) for x in ours if x.signatures}}
print(len(compiled), [name for name, count in compiled.items() if count > 1], file=sys.stderr)
"""


@pytest.mark.slow
def test_a_first_run_compiles_every_kernel_for_one_type(tmp_path):
    case = PACKAGE.parent / "configs/one_sided_65hz.yaml"
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(PACKAGE.parent)}
    environment["NUMBA_OPT"] = "1"  # what is compiled does not depend on how well, and takes half as long
    done = subprocess.run(
        [sys.executable, "-c", RUN_AND_COUNT.format(case=str(case), folder=str(tmp_path))],
        env=environment, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["status"] == "complete"
    *lines, counts = done.stderr.splitlines()  # among them progress, on a slow machine before the notice
    assert sum(line.startswith("beamsim: compiling the numerical kernels for this processor") for line in lines) == 1
    number, _, several = counts.partition(" ")
    assert int(number) <= 45  # of about 100: those of other commands are left alone
    assert several == "[]"


@pytest.mark.slow
def test_an_index_that_names_a_class_of_an_older_version_is_written_anew(installed, tmp_path):
    """Compiled code is listed by the types of its arguments, which an upgrade may rename."""
    kernels, cache = installed / "beamsim/flow/pair_kernels.py", tmp_path / "cache"
    code = (
        "import beamsim.flow.pair_kernels as k; "
        "print(k.add(next(t for t in (getattr(k, 'Old', 0), getattr(k, 'New', 0)) if t)(1, 2)), "
        "sum(k.add.stats.cache_hits.values()))"
    )
    values = []
    for name in ("Old", "New", "New"):
        kernels.write_text(
            "from typing import NamedTuple\nfrom beamsim.flow.compiled import njit\n"
            f"class {name}(NamedTuple):\n    a: int\n    b: int\n"
            "@njit(cache=True)\ndef add(pair):\n    return pair.a + pair.b\n"
        )
        done = python(installed, code, NUMBA_CACHE_DIR=str(cache))
        assert (done.returncode, done.stderr) == (0, "")
        values.append(done.stdout.split())
    assert values == [["3", "0"], ["3", "0"], ["3", "1"]]


def test_a_cache_that_cannot_be_written_later(tmp_path, monkeypatch):
    """A full disk while compiled code is saved, and a damaged file, cost a compilation and no more."""
    from beamsim.errors import CacheWarning
    from beamsim.flow import compiled

    source = tmp_path / "kernel_of_test.py"
    source.write_text("from beamsim.flow.compiled import njit\n@njit(cache=True)\ndef twice(x):\n    return 2 * x\n")
    monkeypatch.syspath_prepend(tmp_path)
    import kernel_of_test

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(kernel_of_test.twice._cache, "_save_overload", full)
    compiled._warn_once.cache_clear()
    with pytest.warns(CacheWarning, match="No space left on device"):
        assert kernel_of_test.twice(2) == 4

    def damaged(*_):
        raise EOFError

    monkeypatch.setattr(kernel_of_test.twice._cache, "_load_overload", damaged)
    assert kernel_of_test.twice(2.5) == 5.0  # warned once


@pytest.fixture
def searches():
    """Searches for garbage, which come as often as usual: the other tests have set them apart."""
    usual, begun, frozen = gc.get_threshold(), [], gc.get_freeze_count()

    def note(phase, _):
        if phase == "start":
            begun.append(gc.isenabled())

    gc.unfreeze()
    gc.set_threshold(700, 10, 10)
    gc.callbacks.append(note)
    yield begun
    gc.callbacks.remove(note)
    gc.set_threshold(*usual)
    if frozen:
        gc.freeze()


def test_a_compilation_searches_no_garbage(searches):
    """They took a sixth of it; afterwards there are some again, also after one that fails."""
    assert njit()(lambda x: x**2 + 1)(3.0) == 10.0
    assert len(searches) <= 2  # more than a hundred otherwise
    assert gc.isenabled()
    gc.set_threshold(10**9)
    gc.collect()
    njit()(lambda x: x**3 + 1)(3.0)
    assert gc.get_count()[0] < 500  # thousands of new objects otherwise, which the next search would go through
    with pytest.raises(numba.TypingError):
        njit()(lambda x: x.missing)(3.0)
    assert gc.isenabled()
