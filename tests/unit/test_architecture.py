"""The package's shape, read from its source: circles of imports, and what every package and class says of itself.

The order of the layers is the contract of import-linter in `pyproject.toml`.
"""

import ast
from collections import defaultdict
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

pytestmark = pytest.mark.quick

ROOT = Path(__file__).parents[2]
PACKAGES = sorted(".".join(path.parent.relative_to(ROOT).parts) for path in (ROOT / "beamsim").rglob("__init__.py"))


PATHS = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
    for path in sorted((ROOT / "beamsim").rglob("*.py"))
}
"""Of every module by its dotted name; a package's name stands for its ``__init__``."""


def parsed(name):
    """Syntax tree of a module; all of them together would take 200 MB."""
    return ast.parse(PATHS[name].read_text(encoding="utf-8"))


def imports_of(names, parsed=parsed):
    """Modules imported by each module, in functions and under TYPE_CHECKING too; `parsed` gives the tree of one."""
    imports = {name: set() for name in names}
    for name in names:
        for node in ast.walk(parsed(name)):
            if isinstance(node, ast.Import):
                imports[name] |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 0, f"{name} imports relatively"
                inside = {f"{node.module}.{alias.name}" for alias in node.names}
                imports[name] |= {x if x in imports else node.module for x in inside}
        imports[name] = {x for x in imports[name] if x in imports and x != name}
    return imports


def package_of(module):
    """The package a module lies in; a package lies in itself, a module beside the packages counts as one."""
    parent = module.rpartition(".")[0]
    return module if module in PACKAGES or parent == "beamsim" else parent


def test_no_modules_and_no_packages_import_each_other_in_a_circle():
    imports = imports_of(PATHS)
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
    graph = imports_of(source, lambda name: ast.parse(source[name]))
    with pytest.raises(CycleError):
        TopologicalSorter(graph).prepare()
    del graph["beamsim.c"]
    TopologicalSorter(graph).prepare()


def test_what_a_result_exits_with_is_decided_in_one_place():
    """An exception without a result has a code of its own."""
    decided = {
        (name, node.attr)
        for name in PATHS
        for node in ast.walk(parsed(name))
        if isinstance(node, ast.Attribute) and node.attr in ("NOT_CONVERGED", "LIMIT_EXCEEDED")
    }
    assert {name for name, _ in decided} == {"beamsim.outcomes", "beamsim.errors"}
    assert {code for name, code in decided if name == "beamsim.errors"} == {"NOT_CONVERGED"}


def test_no_two_classes_share_a_name():
    homes = defaultdict(set)
    for name in PATHS:
        for node in ast.walk(parsed(name)):
            if isinstance(node, ast.ClassDef):
                homes[node.name].add(name)
    assert {name: places for name, places in homes.items() if len(places) > 1} == {}


@pytest.mark.parametrize("name", PACKAGES[1:])
def test_every_package_says_what_it_holds_what_it_never_does_and_where_to_begin(name):
    text = ast.get_docstring(parsed(name)) or ""
    assert len(text.splitlines()) >= 3
    assert "Never here:" in text
    assert "Begin with" in text
