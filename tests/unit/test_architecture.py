"""The package's shape, read from its source: circles of imports, and what every package and class says of itself.

The order of the layers is the contract of import-linter in `pyproject.toml`.
"""

import ast
from collections import defaultdict
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import NamedTuple

import pytest

import beamsim

pytestmark = pytest.mark.quick

PACKAGE = Path(beamsim.__file__).parent
PACKAGES = sorted(".".join(path.parent.relative_to(PACKAGE.parent).parts) for path in PACKAGE.rglob("__init__.py"))


EXITS = ("NOT_CONVERGED", "LIMIT_EXCEEDED")


class Content(NamedTuple):
    """What is asked of a module; the syntax trees of all of them would take 200 MB."""

    imports: frozenset[str]  # modules, and names in modules
    classes: frozenset[str]
    exits: frozenset[str]  # codes of results that it names
    docstring: str


def content_of(source):
    """The same of the source of a module; what is imported in functions and under TYPE_CHECKING counts."""
    tree = ast.parse(source)
    imports, classes, exits = set(), set(), set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            imports |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"relative import from {node.module}"
            imports |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.ClassDef):
            classes.add(node.name)
        elif isinstance(node, ast.Attribute) and node.attr in EXITS:
            exits.add(node.attr)
    return Content(frozenset(imports), frozenset(classes), frozenset(exits), ast.get_docstring(tree) or "")


@cache
def modules():
    """Content of every module by its dotted name; a package's name stands for its ``__init__``."""
    return {
        ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__"): content_of(
            path.read_text(encoding="utf-8")
        )
        for path in sorted(PACKAGE.rglob("*.py"))
    }


def imports_of(contents):
    """Which of these modules each of them imports."""
    modules_of = {
        name: {each if each in contents else each.rpartition(".")[0] for each in content.imports}
        for name, content in contents.items()
    }
    return {name: (imported & contents.keys()) - {name} for name, imported in modules_of.items()}


def package_of(module):
    """The package a module lies in; a package lies in itself, a module beside the packages counts as one."""
    parent = module.rpartition(".")[0]
    return module if module in PACKAGES or parent == "beamsim" else parent


def test_no_modules_and_no_packages_import_each_other_in_a_circle():
    imports = imports_of(modules())
    TopologicalSorter(imports).prepare()
    packages = defaultdict(set)
    for module, targets in imports.items():
        if module not in ("beamsim", "beamsim.__main__"):  # the public names are the way in
            packages[package_of(module)] |= {package_of(x) for x in targets} - {package_of(module)}
    TopologicalSorter(packages).prepare()


def test_a_circle_under_type_checking_and_one_within_a_function_are_found():
    source = {
        "beamsim.a.x": "if TYPE_CHECKING:\n    from beamsim.b.y import Y",
        "beamsim.b.y": "def f():\n    import beamsim.c",
        "beamsim.c": "from beamsim.a import x",
        "beamsim.d": "import beamsim.c",
    }
    graph = imports_of({name: content_of(text) for name, text in source.items()})
    with pytest.raises(CycleError):
        TopologicalSorter(graph).prepare()
    del graph["beamsim.c"]
    TopologicalSorter(graph).prepare()


def test_what_a_result_exits_with_is_decided_in_one_place():
    """An exception without a result has a code of its own."""
    decided = {(name, code) for name, content in modules().items() for code in content.exits}
    assert {name for name, _ in decided} == {"beamsim.outcomes", "beamsim.errors"}
    assert {code for name, code in decided if name == "beamsim.errors"} == {"NOT_CONVERGED"}


def test_no_two_classes_share_a_name():
    homes = defaultdict(set)
    for name, content in modules().items():
        for each in content.classes:
            homes[each].add(name)
    assert {name: places for name, places in homes.items() if len(places) > 1} == {}


@pytest.mark.parametrize("name", PACKAGES[1:])
def test_every_package_says_what_it_holds_what_it_never_does_and_where_to_begin(name):
    text = modules()[name].docstring
    assert len(text.splitlines()) >= 3
    assert "Never here:" in text
    assert "Begin with" in text
