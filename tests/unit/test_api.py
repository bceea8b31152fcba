"""The package's names: all there, and none imported before it is asked for."""

import subprocess
import sys
from pkgutil import resolve_name

import pytest

import beamsim
from beamsim.kinds import KINDS

pytestmark = pytest.mark.quick


@pytest.mark.parametrize("name", beamsim.__all__)
def test_every_name_resolves_and_is_documented(name):
    value = getattr(beamsim, name)
    assert name == "__version__" or value.__doc__
    assert name in dir(beamsim)


@pytest.mark.parametrize("name", KINDS)
def test_everything_that_belongs_to_a_kind_is_there(name):
    kind = KINDS[name]
    for place in (kind.analysis, kind.result, kind.figures):
        assert callable(resolve_name(place)), place
    for place in (kind.analysis, kind.result):
        assert getattr(beamsim, place.partition(":")[2]) is resolve_name(place)
        assert place.partition(":")[2] in beamsim.__all__  # type checkers know those alone
    entries = {entry.name for entry in resolve_name(kind.result).SUMMARY}
    assert {entry.shown for entry in resolve_name(kind.result).SUMMARY} - {""} <= entries


def test_other_names_are_refused():
    with pytest.raises(AttributeError, match="no attribute 'fly'"):
        beamsim.fly  # noqa: B018


@pytest.mark.parametrize("what", ["import beamsim", "import beamsim; beamsim.ScenarioError"])
def test_importing_costs_nothing(what):
    heavy = ("numpy", "scipy", "numba", "pydantic", "h5py", "matplotlib", "typer", "yaml")
    code = f"{what}; import sys; print([name for name in {heavy} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.strip() == "[]"


def test_a_run_needs_few_modules_of_the_package():
    """Those of a case with a beam, with writing, printing and plotting; fourteen of them read files of measurements."""
    code = (
        "import sys, beamsim.cli.app, beamsim.cli.command, beamsim.structures.beam;"
        "from beamsim.kinds import KINDS; from pkgutil import resolve_name;"
        "[resolve_name(place) for place in KINDS['run'] if place.startswith('beamsim.')];"
        "print(sum(name.partition('.')[0] == 'beamsim' for name in sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120)
    assert 100 < int(done.stdout) <= 151


def test_help_needs_no_mathematics():
    code = (
        "import sys; from typer.testing import CliRunner; from beamsim.cli.app import app;"
        "assert CliRunner().invoke(app, ['--help']).exit_code == 0;"
        "print([name for name in ('numpy', 'scipy', 'numba', 'h5py', 'matplotlib') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.strip() == "[]"
