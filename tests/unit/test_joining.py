"""Files for those who cite the program, report something or contribute: they are valid and agree with the project."""

import re
import tomllib
from pathlib import Path

import pytest
import yaml

pytestmark = pytest.mark.quick

ROOT = Path(__file__).parents[2]
FORMS = sorted(path for path in (ROOT / ".github/ISSUE_TEMPLATE").glob("*.yml") if path.name != "config.yml")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_the_citation_agrees_with_the_project_and_states_no_version():
    """A version or a date would be out of date after the next release. CI also validates the file with cffconvert."""
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["cff-version"] == "1.2.0"
    assert citation["type"] == "software"
    assert citation["license"] == PROJECT["license"]
    assert citation["repository-code"] == PROJECT["urls"]["Source"]
    assert citation["authors"] == PROJECT["authors"]
    assert citation["keywords"] == PROJECT["keywords"]
    assert {"title", "message", "abstract"} <= set(citation)
    assert not {"version", "date-released", "commit"} & set(citation)


@pytest.mark.parametrize("path", FORMS, ids=lambda path: path.stem)
def test_forms_of_issues_are_complete(path):
    """The keys that GitHub requires; it ignores a form without them."""
    form = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert {"name", "description", "body"} <= set(form)
    fields = [item for item in form["body"] if item["type"] != "markdown"]
    assert {item["type"] for item in fields} <= {"textarea", "input", "dropdown", "checkboxes"}
    assert len({item["id"] for item in fields}) == len(fields)
    assert all(item["attributes"]["label"] for item in fields)
    assert all(item["attributes"]["options"] for item in fields if item["type"] == "dropdown")


def test_a_wrong_number_needs_its_case_and_the_source_of_the_right_one():
    form = yaml.safe_load((ROOT / ".github/ISSUE_TEMPLATE/1-wrong-number.yml").read_text(encoding="utf-8"))
    required = {item["id"] for item in form["body"] if item.get("validations", {}).get("required")}
    assert {"case", "value", "expected", "source"} <= required


def test_links_of_the_chooser_of_issues_lead_to_the_project_s_repository():
    chooser = yaml.safe_load((ROOT / ".github/ISSUE_TEMPLATE/config.yml").read_text(encoding="utf-8"))
    repositories = {re.match(r"https://github\.com/[^/]+/[^/]+", link["url"])[0] for link in chooser["contact_links"]}
    stated = {url.removesuffix(".git") for url in PROJECT.get("urls", {}).values()}
    assert len(repositories) == 1
    assert not stated or any(url.startswith(repositories.copy().pop()) for url in stated)


@pytest.mark.parametrize("name", ["CONTRIBUTING.md", "CODE_OF_CONDUCT.md", "SECURITY.md", "README.md"])
def test_links_to_files_and_headings_exist(name):
    text = (ROOT / name).read_text(encoding="utf-8")
    headings = {re.sub(r"[^\w\- ]", "", h.lower()).replace(" ", "-") for h in re.findall(r"^#+ (.*)$", text, re.M)}
    for target in re.findall(r"\]\((?!https?:)([^)\s]+)\)", text):
        file, _, heading = target.partition("#")
        assert (ROOT / file).exists(), target
        assert file or heading in headings, target
