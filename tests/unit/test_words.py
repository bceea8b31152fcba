"""Names of definitions: those that were replaced by terms of the field do not come back."""

import ast
import re
from collections import defaultdict
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest
import yaml

import beamsim

pytestmark = pytest.mark.quick

ROOT = Path(__file__).parents[2]
PACKAGE = Path(beamsim.__file__).parent
WORDS = ROOT / "tests" / "data" / "words.yaml"


STATEMENTS = ast.stmt | ast.ExceptHandler | ast.match_case


class Definition(NamedTuple):
    """The name of something that a module defines."""

    name: str
    place: str  # path of the file of what a module defines, of a member or an argument ``path:Class.function``
    kind: str  # module, function, class, argument, or variable: a field or a constant


def definitions(tree, place):
    """Every function, class, argument, field and constant of a module, nested ones included."""
    for node in ast.iter_child_nodes(tree):
        if not isinstance(node, STATEMENTS):  # in expressions nothing is defined that has a name of its own
            continue
        below = place
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield Definition(node.name, place, "class" if isinstance(node, ast.ClassDef) else "function")
            below = f"{place}{'.' if ':' in place else ':'}{node.name}"
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            every = (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs, node.args.vararg, node.args.kwarg)
            yield from (Definition(each.arg, below, "argument") for each in every if each is not None)
        if isinstance(node, ast.AnnAssign | ast.Assign) and isinstance(tree, ast.ClassDef | ast.Module):
            for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
                names = (name.id for name in ast.walk(target) if isinstance(name, ast.Name))
                yield from (Definition(name, place, "variable") for name in names)
        yield from definitions(node, below)


@cache
def all_definitions():
    """The same of the package, with the modules themselves, whose place is their folder."""
    found = []
    for path in sorted(PACKAGE.rglob("*.py")):
        found.append(Definition(path.stem, path.parent.relative_to(PACKAGE.parent).as_posix(), "module"))
        found += definitions(ast.parse(path.read_text(encoding="utf-8")), path.relative_to(PACKAGE.parent).as_posix())
    return found


@cache
def words():
    """The lists of names."""
    return yaml.safe_load(WORDS.read_text(encoding="utf-8"))


def replaced(section="names"):
    """(name, place, term) of each name that must not be defined at or below a place."""
    return [(entry["name"], entry["in"], entry["use"]) for entry in words()[section]]


def breaches(found, entries):
    """A line for each definition that has a name which was replaced at its place."""
    places = defaultdict(list)
    for word, within, term in entries:
        places[word].append((within, term))
    for name, place, _ in found:
        for within, term in places[name.lstrip("_")]:
            if place == within or place.startswith(tuple(f"{within}{c}" for c in "/:.")):
                yield f"{place}: {name} is called {term}"


def test_no_definition_has_a_name_that_was_replaced():
    assert list(breaches(all_definitions(), replaced())) == []


def test_no_function_has_a_name_that_says_nothing():
    refused = words()["functions"]
    found = {
        f"{each.place}: {each.name} (such as {refused[each.name.lstrip('_')]})"
        for each in all_definitions()
        if each.kind in ("function", "class") and each.name.lstrip("_") in refused
    }
    assert found == set()


def test_no_argument_has_a_name_that_says_nothing():
    arguments = [each for each in all_definitions() if each.kind == "argument"]
    assert list(breaches(arguments, replaced("arguments"))) == []


def test_kinds_of_definitions_are_told_apart():
    source = "LIMIT = 1\nclass A:\n    b: int\n    def _c(self, *, d): ..."
    kinds = {each.name: each.kind for each in definitions(ast.parse(source), "beamsim/a.py")}
    assert kinds == {
        "LIMIT": "variable", "A": "class", "b": "variable", "_c": "function", "self": "argument", "d": "argument"
    }  # fmt: skip


def test_the_places_of_replaced_names_exist():
    """A renamed file or class would take its entries out of force."""
    places = {each.place for each in all_definitions()}
    known = {"beamsim"} | places | {"/".join(place.split("/")[:2]) for place in places}
    assert [place for _, place, _ in replaced() if place not in known] == []


@pytest.mark.parametrize(
    "source",
    [
        "def of_angles(entry): ...",
        "class A:\n    of_angles: float",
        "def f(*, of_angles): ...",
        "def _of_angles(): ...",
    ],
)
def test_a_name_that_comes_back_is_found(source):
    found = definitions(ast.parse(source), "beamsim/results/values.py")
    (line,) = breaches(found, [("of_angles", "beamsim", "hinge_key")])
    assert line.endswith("of_angles is called hinge_key")


def test_a_common_word_is_refused_where_it_named_something_else_alone():
    found = list(definitions(ast.parse("class Law:\n    parts: int\nclass Kit:\n    parts: int"), "beamsim/a.py"))
    assert len(list(breaches(found, [("parts", "beamsim/a.py:Law", "one_sided_springs")]))) == 1


PRIVATE = re.compile(r"(?<![a-z])(said|told|beside|carried|parting)(?![a-z])")  # also between the underscores of names
PLAIN = ("scenario", "structures", "system", "contacts", "inputs", "measurements", "flow", "orbits", "signals")


def private_words(text, place):
    """A line for each of the five words that stood for many things, in names, messages, comments or prose."""
    for number, line in enumerate(text.splitlines(), 1):
        for found in PRIVATE.finditer(line.lower()):
            yield f"{place}:{number}: {found[0]}"


def test_plain_packages_have_no_private_words():
    """In names, strings, docstrings and comments."""
    found = []
    for package in PLAIN:
        for path in sorted((PACKAGE / package).rglob("*.py")):
            found += private_words(path.read_text(encoding="utf-8"), path.relative_to(PACKAGE.parent).as_posix())
    assert found == []


def test_documents_have_no_private_words():
    """Names in code font are checked where they are defined."""
    documents = [*sorted((ROOT / "docs").glob("*.md")), ROOT / "README.md", ROOT / "CHANGELOG.md"]
    prose = {path.name: re.sub(r"`[^`\n]*`", "", path.read_text(encoding="utf-8")) for path in documents}
    assert [line for name, text in prose.items() for line in private_words(text, name)] == []


@pytest.mark.parametrize(
    "text", ["what was said", "self._said_by_unit", "springs beside the stop", "Parting of motions"]
)
def test_a_private_word_that_comes_back_is_found(text):
    assert len(list(private_words(text, "a.py"))) == 1


def test_words_that_contain_a_private_one_are_not_refused():
    assert list(private_words("besides, a folder departing from foretold", "a.py")) == []
