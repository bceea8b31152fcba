"""The documents stay true to the code."""

import ast
import importlib.util
import json
import re
from pathlib import Path

import pytest

import beamsim
from beamsim.scenario.jsonschema import json_schema

pytestmark = pytest.mark.quick

ROOT = Path(__file__).parents[2]
PACKAGE = Path(beamsim.__file__).parent


def test_json_schema_file_is_the_one_the_program_prints():
    """Regenerate with `beamsim schema -o docs/scenario.schema.json`."""
    assert json.loads((ROOT / "docs/scenario.schema.json").read_text(encoding="utf-8")) == json_schema()


def test_result_files_are_documented_as_they_are_declared():
    """Renew with `python -m beamsim.store.describe docs/result_files.md`."""
    from beamsim.store.describe import MARK, regenerate

    text = (ROOT / "docs/result_files.md").read_text(encoding="utf-8")
    assert MARK in text
    assert regenerate(text) == text
    assert regenerate(text.replace("| `time` | s |", "| `time` | h |")) == text


def test_the_cases_of_the_page_about_writing_cases_load():
    text = (ROOT / "docs/cases.md").read_text(encoding="utf-8")
    cases = re.findall(r"```yaml\n(.*?)```", text, flags=re.S)
    assert cases
    for case in cases:
        beamsim.load_scenario(case)


@pytest.mark.parametrize("document", ["README.md", "CONTRIBUTING.md"])
def test_files_named_in_a_document_exist(document):
    text = (ROOT / document).read_text(encoding="utf-8")
    for name in re.findall(r"(?:beamsim|configs|docs|benchmarks|tests)/[\w/.-]+\.(?:yaml|md|png|py|json)", text):
        assert ((PACKAGE.parent if name.startswith("beamsim/") else ROOT) / name).exists(), name


def test_the_set_up_of_contributing_is_the_readme_s():
    command = next(line for line in (ROOT / "README.md").read_text(encoding="utf-8").splitlines() if "[dev]" in line)
    assert command in (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").splitlines()


def test_every_package_has_its_place_in_contributing():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    for path in PACKAGE.iterdir():
        if path.is_dir() and (path / "__init__.py").exists():
            assert f"`{path.name}`" in text, path.name


def test_modules_that_the_project_s_settings_name_exist():
    named = re.findall(r'"(beamsim(?:\.\w+)+)"', (ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert "beamsim.flow.kernels" in named
    assert [name for name in named if importlib.util.find_spec(name) is None] == []


@pytest.fixture
def site_pages(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    import site_pages.commands
    import site_pages.relative_values
    import site_pages.scenario_keys
    import site_pages.tutorial

    return site_pages


def test_the_reference_has_every_key_and_every_command(site_pages):
    """Renew the keys with `python -m docs.site_pages.scenario_keys`."""
    keys, commands = site_pages.scenario_keys.page(), site_pages.commands.page()
    assert site_pages.scenario_keys.PAGE.read_text(encoding="utf-8").rstrip() == keys.rstrip()
    parts = [part for part in json_schema()["$defs"].values() if "description" in part]
    assert keys.count("\n## ") == len(parts) + 1  # and one of the units
    assert all(f"| `{key}` |" in keys for part in parts for key in part["properties"] if key != "extends")
    for command in ("run", "sweep", "nnm", "identify-stiffness", "compare", "pad", "check", "export-structure", "new"):
        assert f"## `beamsim {command}`" in commands
    assert "| `--set PATH=VALUE` |" in commands
    assert "| `--output, -o PATH` |" in commands


def test_what_every_relative_value_is_relative_to_is_said(site_pages):
    """Say it of a new key in `docs/site_pages/relative_values.py`, and renew the page."""
    pages = site_pages.relative_values
    said = [name for _, of in pages.CHAPTERS.values() for name in of]
    assert sorted(said) == sorted(pages.relative_fields())
    assert pages.PAGE.read_text(encoding="utf-8").rstrip() == pages.page().rstrip()
    known = set(pages.relative_fields().values())
    assert {"snubbers[].damping.ratio", "run.sample_rate", "excitation.rise", "beam.nodes"} <= known
    assert not known & {"beam.length", "snubbers[].stiffness", "excitation.frequency"}  # twin: these are absolute


def test_the_files_of_the_tutorial_load_and_its_pictures_are_those_of_its_commands(site_pages, tmp_path):
    text = site_pages.tutorial.SOURCE.read_text(encoding="utf-8")
    files = dict(site_pages.tutorial._FILE.findall(text))
    for name, content in files.items():
        (tmp_path / name).write_text(content, encoding="utf-8")
    for name in files:
        beamsim.load_scenario(tmp_path / name)
    assert {Path(name).stem for name in files} >= {
        picture.split("_")[0] for _, picture in site_pages.tutorial._PICTURE.findall(text)
    }
    assert site_pages.tutorial._COMMANDS.findall(text)


def test_the_readme_is_short():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").split()) <= 900


def broken_links(path):
    """Links of a Markdown file to files and headings that do not exist; addresses of the web are not followed."""
    found = []
    for link in re.findall(r"\]\(([^)\s]+)\)", path.read_text(encoding="utf-8")):
        file, _, heading = link.partition("#")
        target = path.parent / file if file else path
        if "://" not in link and not (target.exists() and (not heading or heading in headings(target))):
            found.append(link)
    return found


def headings(path):
    """Names by which links refer to the headings of a Markdown file."""
    text = re.sub(r"^```.*?^```", "", path.read_text(encoding="utf-8"), flags=re.S | re.M)
    return {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in re.findall(r"^#+ (.*)$", text, re.M)}


@pytest.mark.parametrize("document", [*sorted(path.name for path in ROOT.glob("*.md")), "configs/README.md"])
def test_links_of_documents_outside_the_site_resolve(document):
    """Of those inside it, sphinx-build -W reports every broken link and every page that no table of contents lists."""
    assert broken_links(ROOT / document) == []


def test_a_broken_link_is_found(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(
        "# One `word`: two\n[a](#one-word-two) [b](page.md#two) [c](other.md) [d](https://e.f)", encoding="utf-8"
    )
    assert broken_links(page) == ["page.md#two", "other.md"]


def test_the_first_page_of_the_site_has_the_commands_of_the_readme():
    readme, index = ((ROOT / name).read_text(encoding="utf-8") for name in ("README.md", "docs/index.md"))
    commands = re.findall(r"^(?:python3 -m|beamsim .*configs).*$", readme, re.M)
    assert len(commands) == 2 + 5
    assert [command for command in commands if command not in index.replace("&&\n  ", "&& ")] == []


def named_functions(text):
    """Dotted names that a page has in code font or as the first word of a line of a code block."""
    blocks = "\n".join(re.findall(r"```\n(.*?)```", text, re.S))
    found = re.findall(r"`([a-z_]+(?:\.\w+)+)`", text) + re.findall(r"^ *((?:\w+\.)+\w+)(?= |$)", blocks, re.M)
    return {name for name in found if (PACKAGE / name.partition(".")[0]).is_dir()}


def is_defined(name):
    """Whether a dotted name below the package is a module, or a function, class, constant or method of one."""
    *words, last = name.split(".")
    for count in range(len(words) + 1, 0, -1):
        path = PACKAGE.joinpath(*[*words, last][:count])
        if path.is_dir() or path.with_suffix(".py").exists():
            break
    members = [*words, last][count:]
    if path.is_dir() or not members:
        return not members
    nodes = ast.parse(path.with_suffix(".py").read_text(encoding="utf-8")).body
    for member in members:
        found = [node for node in nodes if member in names_of(node)]
        if not found:
            return False
        nodes = getattr(found[0], "body", [])
    return True


def names_of(node):
    """Names that a statement defines."""
    targets = getattr(node, "targets", [getattr(node, "target", None)])
    return {getattr(node, "name", None), *(getattr(target, "id", None) for target in targets)}


@pytest.mark.parametrize("document", ["architecture.md", "from_yaml_to_picture.md"])
def test_functions_that_a_page_about_the_code_names_exist(document):
    names = named_functions((ROOT / "docs" / document).read_text(encoding="utf-8"))
    assert "flow.transient.MotionInChunks.chunks" in names
    assert [name for name in sorted(names) if not is_defined(name)] == []
    assert not is_defined("flow.transient.MotionInChunks.parts")
