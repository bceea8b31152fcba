"""Numbers at the edge of floating point, damaged result files, and paths that cannot be written."""

import copy
import gzip
from pathlib import Path

import h5py
import numpy as np
import pytest
from sampling import first_apart
from shipped import config_path

from beamsim.errors import BeamsimError, ScenarioError
from beamsim.scenario import load_scenario
from beamsim.system.build import build_system
from tests.helpers.commands import invoke

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "tests/data/results"
EDGES = (1e308, 5e-324, -1e308, 9e29, 2e-30, -9e29, 1e15)


def numbers(value, path=()):
    if isinstance(value, (dict, list)):
        for key, item in value.items() if isinstance(value, dict) else enumerate(value):
            yield from numbers(item, (*path, key))
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        yield path


@first_apart("name", 1, ["chain_cubic", "one_sided_65hz", "two_panels"])
def test_extreme_numbers_are_refused_or_computed_with(name):
    """`beam.length: 1e308` and the like were internal errors; nothing but a located refusal may come of them."""
    scenario = load_scenario(config_path(name))
    case = scenario.model_dump(mode="json", by_alias=True, exclude_none=True)  # defaults among the numbers
    for chain in [case["chain"]] if "chain" in case else []:
        chain["dashpots"] = [0.0] * len(chain["springs"])
    case.get("run", {}).pop("sample_rate", None)
    refused = 0
    for path in numbers(case):
        for edge in EDGES:
            changed = copy.deepcopy(case)
            owner = changed
            for part in path[:-1]:
                owner = owner[part]
            owner[path[-1]] = edge
            try:
                scenario = load_scenario(changed)
                assert all(scenario.warnings)
                build_system(scenario)
            except BeamsimError:
                refused += 1
    assert refused > 100


def damaged(path, name, how):
    """Replace one dataset of a result file."""
    with h5py.File(path, "a") as file:
        shape = file[name].shape
        del file[name]
        new = {
            "text": "hello", "number": 1.0, "longer": np.zeros((*shape[:-1], (shape or (1,))[-1] + 3)),
            "two dimensions": np.zeros((2, 2)), "empty": np.zeros(0), "opaque": np.zeros(3, dtype="V4"),
        }  # fmt: skip
        if how == "group":
            file.create_group(name)
        elif how != "missing":
            file[name] = new[how]


HOWS = ("text", "number", "longer", "two dimensions", "empty", "opaque", "group", "missing")
STORED = ("run_chain", "nnm", "continuation", "designs", "compare")


# each kind of damage in two kinds of results, each of which has three or four; tests/property/test_damaged_files.py has
# many more
@pytest.mark.parametrize(
    ("stored", "how"), [(STORED[(k + first) % 5], how) for k, how in enumerate(HOWS) for first in (0, 3)]
)
def test_datasets_of_wrong_type_or_shape(tmp_path, stored, how, without_examination):
    """No command ends with an internal error, whatever has become of a dataset."""
    source = gzip.decompress((RESULTS / f"{stored}.h5.gz").read_bytes())
    path = tmp_path / "r.h5"
    path.write_bytes(source)
    with h5py.File(path) as file:
        names = []
        file.visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None)
    rng = np.random.default_rng(hash_of(stored + how))
    for name in rng.choice(names, 1):
        path.write_bytes(source)
        damaged(path, name, how)
        for command in (
            ["info"],
            ["export", "--format", "csv", "-o", tmp_path],
            ["export", "--format", "mat", "-o", tmp_path],
        ):
            done = invoke(command[0], path, *command[1:])
            assert done.exit_code in (0, 2), (name, command, done.output, done.exception)
            assert "internal error" not in done.output


def hash_of(text):
    return sum(ord(letter) * 31**k for k, letter in enumerate(text)) % 2**32


def test_a_plot_of_a_damaged_history(tmp_path, without_examination):
    path = tmp_path / "r.h5"
    for how, says in (
        ("text", "is along no axes, not probe, time"),
        ("two dimensions", "damaged"),
        ("longer", "damaged"),
    ):
        path.write_bytes(gzip.decompress((RESULTS / "run_chain.h5.gz").read_bytes()))
        damaged(path, "histories/displacement", how)
        done = invoke("plot", path, "-o", tmp_path)
        assert done.exit_code == 2, done.output
        assert says in done.output
        assert "run the case again" in done.output


def test_times_that_are_not_finite_are_not_animated(tmp_path, without_examination):
    """The motion was computed again up to an end that never came."""
    path = tmp_path / "r.h5"
    path.write_bytes(gzip.decompress((RESULTS / "run_chain.h5.gz").read_bytes()))
    with h5py.File(path, "a") as file:
        file["histories/time"][...] = np.nan
    done = invoke("animate", path, "-o", tmp_path)
    assert done.exit_code == 2, done.output
    assert "damaged (its times are not those of a run); run the case again" in done.output


def test_an_empty_output_is_refused():
    done = invoke("run", ROOT / "configs/one_sided_65hz.yaml", "-o", "")
    assert done.exit_code == 2
    assert "it is empty; give a file or a folder" in done.output


@pytest.mark.parametrize(
    ("length", "message"),
    [
        (2_000_000, r"case\.yaml.*has 2e\+06 characters, more than the 1e\+06 of the longest scenario"),
        (10_000_000, r"case\.yaml: has 10 MB, more than the 4 MB of the largest such file"),
    ],
)
def test_a_long_document_is_refused_unread(tmp_path, monkeypatch, length, message):
    """A title of 10 MB took 18 s to refuse: sizes are checked before reading, lengths before YAML is parsed."""
    monkeypatch.setattr("yaml.compose", lambda *_, **__: pytest.fail("the document is parsed"))
    (tmp_path / "case.yaml").write_text("title: " + "x" * length + "\n")
    with pytest.raises(ScenarioError, match=message):
        load_scenario(tmp_path / "case.yaml")
