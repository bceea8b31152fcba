"""What a release is made of agrees: the changelog's sections, the conda recipe and pyproject.toml."""

import hashlib
import re
import subprocess
import sys
import tomllib
from itertools import pairwise
from pathlib import Path

import pytest
import yaml

pytestmark = pytest.mark.quick
ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
RECIPE = yaml.safe_load((ROOT / "recipe" / "recipe.yaml").read_text(encoding="utf-8"))
CONDA_NAMES = {"matplotlib": "matplotlib-base"}  # without the toolkits of windows
CHANGELOG = """# Changelog

## [Unreleased]

### Added

- Something.

## [0.2.0] - 2027-02-03

### Fixed

- A number ([theory](docs/theory.md), [a page](https://example.org), [above](#changelog)).

## [0.2.0rc1]

- Not dated.

## [0.1.0] - 2027-01-02
"""


def called(script, *arguments):
    command = [sys.executable, str(ROOT / ".ci" / script), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, encoding="utf-8", timeout=60, check=False)


@pytest.fixture
def changelog(tmp_path):
    path = tmp_path / "CHANGELOG.md"
    path.write_text(CHANGELOG, encoding="utf-8")
    return path


def test_the_notes_of_a_version_are_its_section(changelog):
    done = called("notes.py", "v0.2.0", "--changelog", changelog)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("### Fixed\n\n- A number ([theory](docs/theory.md)")
    assert "Something" not in done.stdout
    assert "Not dated" not in done.stdout


def test_links_of_notes_lead_to_the_files_of_the_tag(changelog):
    text = called("notes.py", "v0.2.0", "--changelog", changelog, "--links", "https://host/blob/v0.2.0").stdout
    assert re.findall(r"\]\((\S+?)\)", text) == [
        "https://host/blob/v0.2.0/docs/theory.md", "https://example.org", "#changelog"
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("tag", "message"),
    [
        ("v0.3.0", r"no section '## \[0.3.0\] - DATE' \(it has: Unreleased, 0.2.0, 0.2.0rc1, 0.1.0\). Rename"),
        ("v0.2", r"no section '## \[0.2\]"),
        ("v0.2.0rc1", "write the date of the release"),
        ("v0.1.0", r"the section \[0.1.0\] is empty"),
        ("0.2.0", "the tag of a release is v and its version"),
    ],
)
def test_a_tag_without_notes_fails_the_release(changelog, tag, message):
    done = called("notes.py", tag, "--changelog", changelog)
    assert (done.returncode, done.stdout) == (1, "")
    assert re.search(message, done.stderr)


def test_the_changelog_is_sorted_by_release():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    first, *releases = re.findall(r"^## (.*)$", text, re.MULTILINE)
    assert first == "[Unreleased]"
    found = [re.fullmatch(r"\[(\d+)\.(\d+)\.(\d+)\] - (\d{4}-\d\d-\d\d)", each) for each in releases]
    assert all(found), releases
    order = [(tuple(map(int, each.groups()[:3])), each[4]) for each in found]
    assert all(newer[0] > older[0] and newer[1] >= older[1] for newer, older in pairwise(order))
    kinds = {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}
    assert set(re.findall(r"^### (.*)$", text, re.MULTILINE)) <= kinds


def of_conda(requirements):
    """'numpy>=2.0' as 'numpy >=2.0'."""
    pairs = [re.fullmatch(r"([\w.-]+)(>=[\d.]+)", each).groups() for each in requirements]
    return sorted(f"{CONDA_NAMES.get(name, name)} {bound}" for name, bound in pairs)


def test_the_recipe_has_the_requirements_of_the_package():
    """Which conda takes from the recipe, pip from pyproject.toml."""
    project, needed = PROJECT["project"], RECIPE["requirements"]
    extras = [one for name, some in project["optional-dependencies"].items() if name != "dev" for one in some]
    python = ["python >=${{ python_min }}"]
    assert needed["run"] == python + needed["run"][1:]
    assert sorted(needed["run"][1:]) == of_conda(project["dependencies"])
    assert sorted(needed["run_constraints"]) == of_conda(extras)
    assert needed["host"][:2] == ["python ${{ python_min }}.*", "pip"]
    assert sorted(needed["host"][2:]) == of_conda(PROJECT["build-system"]["requires"])
    assert project["requires-python"] == f">={RECIPE['context']['python_min']}"


def test_the_recipe_describes_the_package():
    project, about = PROJECT["project"], RECIPE["about"]
    assert RECIPE["package"]["name"] == project["name"]
    assert (about["summary"], about["license"]) == (project["description"], project["license"])
    assert about["homepage"] == project["urls"]["Source"]
    assert [about["license_file"]] == project["license-files"]
    points = [f"{name} = {place}" for name, place in project["scripts"].items()]
    assert RECIPE["build"]["python"]["entry_points"] == points
    for name in RECIPE["tests"][1]["files"]["source"]:
        assert (ROOT / name).is_file()


def test_the_recipe_of_a_release_has_the_checksum_of_its_sdist(tmp_path):
    sdist = tmp_path / "beamsim-1.2.3.tar.gz"
    sdist.write_bytes(b"files")
    made = yaml.safe_load(called("recipe.py", sdist).stdout)
    changed = {"version": "1.2.3", "sha256": hashlib.sha256(b"files").hexdigest()}
    assert made == RECIPE | {"context": RECIPE["context"] | changed}
    refused = called("recipe.py", tmp_path / "beamsim-1.2.3-py3-none-any.whl")
    assert (refused.returncode, refused.stdout) == (1, "")
    assert "needs the path of a sdist" in refused.stderr
