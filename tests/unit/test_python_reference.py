"""The page of the Python interface has every public name with its members, and an example of each."""

import inspect
import re
from pathlib import Path
from pkgutil import resolve_name

import pytest

import beamsim
from beamsim.kinds import KINDS

pytestmark = pytest.mark.quick

PAGE = Path(__file__).parents[2] / "docs/api.md"
ENTRY = re.compile(
    r"^\.\. auto(function|class|exception):: beamsim\.(\w+)(?:\(\))?\n"
    r"(?:   :members: ((?:.+\n(?:      )?)+?)(?=\.\.|```))?",
    re.M,
)
OF_THE_PACKAGE = {  # members of the classes that the package itself calls
    "Result": {"with_summary", "with_outcome", "interrupted", "unit_of"},
    "Dataset": {"records", "read", "assign"},
    "LabelledArray": {"array"},
}


def entries():
    """Kind and listed members of every name on the page."""
    found = ENTRY.findall(PAGE.read_text(encoding="utf-8"))
    assert len(found) == len({name for _, name, _ in found}), "a name is on the page twice"
    return {name: (kind, re.findall(r"\w+", members)) for kind, name, members in found}


ENTRIES = entries()
PUBLIC = [name for name in dir(beamsim) if not name.startswith("_")]
RESULTS = [place.partition(":")[2] for place in (kind.result for kind in KINDS.values())]


def test_the_page_has_every_public_name_and_no_other():
    assert sorted(ENTRIES) == sorted(PUBLIC)
    assert PAGE.read_text(encoding="utf-8").count("auto") == len(ENTRIES) + 1  # and the package: the pattern reads all
    assert set(RESULTS) <= set(ENTRIES)


@pytest.mark.parametrize("name", PUBLIC)
def test_every_public_name_has_an_example_and_says_what_it_is(name):
    value = getattr(beamsim, name)
    assert ">>> " in value.__doc__
    assert inspect.isclass(value) == (ENTRIES[name][0] != "function")
    if ENTRIES[name][0] == "function":
        assert all(f"\n{part}\n---" in inspect.cleandoc(value.__doc__) for part in ("Parameters", "Examples", "Raises"))


def documented(cls, member):
    """Whether a member of a class, or of one that it is derived from, has a docstring or a documenting comment."""
    for base in cls.__mro__[:-1]:
        if member in vars(base) and (text := inspect.getdoc(vars(base)[member])):
            return bool(text)
        source = inspect.getsource(base)
        if re.search(rf"^    {member}: .*#: |^    {member}: .*\n    \"\"\"", source, re.M):
            return True
    return False


@pytest.mark.parametrize("name", [name for name, (kind, _) in ENTRIES.items() if kind != "function"])
def test_listed_members_exist_and_are_documented(name):
    cls = getattr(beamsim, name)
    assert [member for member in ENTRIES[name][1] if not documented(cls, member)] == []


@pytest.mark.parametrize("name", ["Result", "Dataset", "LabelledArray", *RESULTS])
def test_members_that_a_user_meets_are_listed(name):
    """Those of the class itself; the page lists what all results have once."""
    cls = getattr(beamsim, name)
    inner = set().union(*OF_THE_PACKAGE.values())
    own = {member for member in (*vars(cls), *cls.__annotations__) if member[0] != "_" and not member.isupper()}
    assert own - inner - set(ENTRIES[name][1]) == set()


def test_datasets_of_results_are_on_the_page_of_result_files():
    page = (PAGE.parent / "result_files.md").read_text(encoding="utf-8")
    for kind in KINDS.values():
        for layout in resolve_name(kind.result).DATASETS:
            assert f"### `/{layout.name}`" in page


def test_the_text_of_a_parameter_is_not_taken_for_its_type(monkeypatch):
    """Napoleon reads what follows the colon on the first line of a parameter as a type."""
    monkeypatch.syspath_prepend(str(PAGE.parent))
    from site_pages.docstrings import described_parameters

    lines = [
        "Run.",
        "",
        "Parameters",
        "----------",
        "time, gap : s, m, of the",
        "    run.",
        "",
        "Returns",
        "-------",
        "a : b",
    ]
    assert list(described_parameters(lines)) == [
        *lines[:4], "time, gap", "    s, m, of the", "    run.", *lines[6:],
    ]  # fmt: skip


def test_a_missing_docstring_is_found():
    class Undocumented:
        def member(self):
            pass

    assert not documented(Undocumented, "member")
