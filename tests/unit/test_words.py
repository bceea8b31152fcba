"""Names of definitions: those that were replaced by terms of the field do not come back."""

import ast
import re
from collections import defaultdict
from functools import cache
from pathlib import Path

import pytest
import yaml

pytestmark = pytest.mark.quick

ROOT = Path(__file__).parents[2]
WORDS = ROOT / "tests" / "data" / "words.yaml"


def definitions(tree, place):
    """Name and place of every function, class, argument, field and constant of a module, nested ones included.

    The place of what a module defines is the path of its file, that of a member or an argument
    ``path:Class.function``.
    """
    for node in ast.iter_child_nodes(tree):
        below = place
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name, place
            below = f"{place}{'.' if ':' in place else ':'}{node.name}"
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            every = (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs, node.args.vararg, node.args.kwarg)
            yield from ((each.arg, below) for each in every if each is not None)
        if isinstance(node, ast.AnnAssign | ast.Assign) and isinstance(tree, ast.ClassDef | ast.Module):
            for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
                yield from ((name.id, place) for name in ast.walk(target) if isinstance(name, ast.Name))
        yield from definitions(node, below)


@cache
def all_definitions():
    """The same of the package, with the modules themselves, whose place is their folder."""
    found = []
    for path in sorted((ROOT / "beamsim").rglob("*.py")):
        place = path.relative_to(ROOT).as_posix()
        found.append((path.stem, path.parent.relative_to(ROOT).as_posix()))
        found += definitions(ast.parse(path.read_text(encoding="utf-8")), place)
    return found


def replaced():
    """(name, place, term) of each name that must not be defined at or below a place."""
    return [
        (entry["name"], entry["in"], entry["use"])
        for entry in yaml.safe_load(WORDS.read_text(encoding="utf-8"))["names"]
    ]


def breaches(found, entries):
    """A line for each definition that has a name which was replaced at its place."""
    places = defaultdict(list)
    for word, within, term in entries:
        places[word].append((within, term))
    for name, place in found:
        for within, term in places[name.lstrip("_")]:
            if place == within or place.startswith(tuple(f"{within}{c}" for c in "/:.")):
                yield f"{place}: {name} is called {term}"


def test_no_definition_has_a_name_that_was_replaced():
    assert list(breaches(all_definitions(), replaced())) == []


def functions_and_classes(tree):
    """Names of all functions and classes of a module, without leading underscores."""
    return {
        node.name.lstrip("_")
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
    }


def test_no_function_has_a_name_that_says_nothing():
    refused = yaml.safe_load(WORDS.read_text(encoding="utf-8"))["functions"]
    found = {
        f"{path.relative_to(ROOT).as_posix()}: {name} (such as {refused[name]})"
        for path in (ROOT / "beamsim").rglob("*.py")
        for name in functions_and_classes(ast.parse(path.read_text(encoding="utf-8"))) & refused.keys()
    }
    assert found == set()


def arguments(tree, place):
    """Name and place of every argument of the functions of a module, lambdas left out."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            listed = (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs, node.args.vararg, node.args.kwarg)
            yield from ((argument.arg, place) for argument in listed if argument is not None)


def test_no_argument_has_a_name_that_says_nothing():
    entries = [(e["name"], e["in"], e["use"]) for e in yaml.safe_load(WORDS.read_text(encoding="utf-8"))["arguments"]]
    found = []
    for path in sorted((ROOT / "beamsim").rglob("*.py")):
        found += arguments(ast.parse(path.read_text(encoding="utf-8")), path.relative_to(ROOT).as_posix())
    assert list(breaches(found, entries)) == []


def test_an_argument_with_a_refused_name_is_found():
    found = list(arguments(ast.parse("class A:\n    def f(self, at): ..."), "beamsim/scenario/body.py"))
    assert len(list(breaches(found, [("at", "beamsim/scenario", "path")]))) == 1


def test_a_method_with_a_refused_name_is_found():
    assert functions_and_classes(ast.parse("class A:\n    def _asked(self): ...")) == {"A", "asked"}


def test_the_places_of_replaced_names_exist():
    """A renamed file or class would take its entries out of force."""
    places = {place for _, place in all_definitions()} | {f"{place}" for _, place in all_definitions()}
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
        for path in sorted((ROOT / "beamsim" / package).rglob("*.py")):
            found += private_words(path.read_text(encoding="utf-8"), path.relative_to(ROOT).as_posix())
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
