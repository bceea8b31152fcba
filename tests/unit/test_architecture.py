"""The package's shape, read from its source: circles, layers, and what no module may do.

Each rule has a list of known exceptions. A list only shrinks: a new exception fails, and so does an entry that is no
longer needed, until it is removed from the list.
"""

import ast
import tomllib
from collections import defaultdict
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

KNOWN_MODULE_CIRCLES: list[set[str]] = []
KNOWN_PACKAGE_CIRCLES: list[set[str]] = []
KNOWN_STRUCTURE_TESTS: set[str] = set()
KNOWN_STATUS_COMPARISONS: set[str] = set()
KNOWN_SHARED_CLASS_NAMES: set[str] = set()
KNOWN_UNDESCRIBED_PACKAGES: set[str] = set()


# --- reading ----------------------------------------------------------------------------------------------------------


@cache
def modules():
    """Syntax tree of every module by its dotted name; a package's name stands for its ``__init__``."""
    trees = {}
    for path in sorted((ROOT / "beamsim").rglob("*.py")):
        name = ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
        trees[name] = ast.parse(path.read_text(encoding="utf-8"))
    return trees


@cache
def nodes():
    """Every node of every module's tree, by the module's name."""
    return {name: list(ast.walk(tree)) for name, tree in modules().items()}


PACKAGES = sorted(".".join(path.parent.relative_to(ROOT).parts) for path in (ROOT / "beamsim").rglob("__init__.py"))


def read_imports(trees):
    """Modules imported by each module, given by its nodes, in functions and under TYPE_CHECKING too."""
    imports = {name: set() for name in trees}
    for name, tree in trees.items():
        for node in tree:
            if isinstance(node, ast.Import):
                imports[name] |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 0, f"{name} imports relatively"
                inside = {f"{node.module}.{alias.name}" for alias in node.names}
                imports[name] |= {x if x in trees else node.module for x in inside}
        imports[name] = {x for x in imports[name] if x in trees and x != name}
    return imports


@cache
def imports_of_modules():
    return read_imports(nodes())


def package_of(module):
    """The package a module lies in; a package lies in itself, a module beside the packages counts as one."""
    parent = module.rpartition(".")[0]
    return module if module in PACKAGES or parent == "beamsim" else parent


def package_imports(imports):
    """The same between packages; the public names of ``beamsim/__init__`` and ``__main__`` are the way in, left out."""
    packages = defaultdict(set)
    for module, targets in imports.items():
        if module not in ("beamsim", "beamsim.__main__"):
            packages[package_of(module)] |= {package_of(x) for x in targets} - {package_of(module)}
    return packages


def circles(graph):
    """Strongly connected components of more than one node (Tarjan's algorithm)."""
    index, low, stack, found = {}, {}, [], []

    def visit(node):
        index[node] = low[node] = len(index)
        stack.append(node)
        for target in sorted(graph.get(node, ())):
            if target not in index:
                visit(target)
                low[node] = min(low[node], low[target])
            elif target in stack:
                low[node] = min(low[node], index[target])
        if low[node] == index[node]:
            at = stack.index(node)
            if len(stack) - at > 1:
                found.append(set(stack[at:]))
            del stack[at:]

    for node in sorted(graph):
        if node not in index:
            visit(node)
    return found


# --- rules ------------------------------------------------------------------------------------------------------------


def assert_only_known(found, known):
    assert not found - known, f"new: {sorted(found - known)}"
    assert not known - found, f"gone, remove from the list: {sorted(known - found)}"


def assert_only_known_circles(found, known):
    new = [sorted(circle) for circle in found if not any(circle <= old for old in known)]
    assert not new, f"new circles: {new}"
    gone = [sorted(old) for old in known if not any(circle <= old for circle in found)]
    assert not gone, f"gone, remove from the list: {gone}"


def test_no_module_is_part_of_an_import_circle():
    assert_only_known_circles(circles(imports_of_modules()), KNOWN_MODULE_CIRCLES)


def test_no_package_is_part_of_an_import_circle():
    assert_only_known_circles(circles(package_imports(imports_of_modules())), KNOWN_PACKAGE_CIRCLES)


def layer_of_each_top_level_name():
    """0 for the lowest layer of import-linter's contract; layers share a number where they stand side by side."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    (layers,) = (contract["layers"] for contract in contracts if contract["type"] == "layers")
    return {name.strip(): rank for rank, layer in enumerate(reversed(layers)) for name in layer.split("|")}


def test_every_module_imports_from_lower_layers_only():
    rank = layer_of_each_top_level_name()
    wrong = []
    for module, targets in imports_of_modules().items():
        if module in ("beamsim", "beamsim.__main__"):
            continue
        here = ".".join(module.split(".")[:2])
        assert here in rank, f"{here} has no place among the layers of pyproject.toml"
        for target in targets:
            there = ".".join(target.split(".")[:2])
            if here != there and rank.get(there, len(rank)) >= rank[here]:
                wrong.append(f"{module} imports {target}")
    assert not wrong


STRUCTURE_NAMES = {"beam", "chain", "of_beam", "of_chain", "is_beam", "is_chain"}


def asks_for_the_kind_of_structure(node):
    """Whether a node decides by what a structure is: ``x.beam is None``, ``if x.chain``, ``isinstance(x, Beam...)``."""

    def names_a_kind(value):
        name = value.attr if isinstance(value, ast.Attribute) else getattr(value, "id", "")
        return isinstance(value, ast.Attribute | ast.Name) and name in STRUCTURE_NAMES

    if isinstance(node, ast.Compare):
        none = any(isinstance(x, ast.Constant) and x.value is None for x in node.comparators)
        kinds = {"beam", "chain", "plate"} & {x.value for x in ast.walk(node) if isinstance(x, ast.Constant)}
        asked = isinstance(node.left, ast.Attribute | ast.Subscript) and ast.unparse(node.left).endswith("kind")
        return (none and names_a_kind(node.left)) or (bool(kinds) and asked)
    if isinstance(node, ast.BoolOp):
        return any(names_a_kind(value) for value in node.values)
    if isinstance(node, ast.If | ast.IfExp | ast.While):
        return names_a_kind(node.test) or (isinstance(node.test, ast.UnaryOp) and names_a_kind(node.test.operand))
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "isinstance":
        return any(
            word.startswith(("Beam", "Chain"))
            for part in ast.walk(node.args[1])
            for word in [part.attr if isinstance(part, ast.Attribute) else getattr(part, "id", "")]
            if word != "BeamsimError"
        )
    return False


def test_nothing_above_structures_asks_for_the_kind_of_structure():
    found = {
        name
        for name, tree in nodes().items()
        if not name.startswith(("beamsim.structures", "beamsim.scenario"))
        and any(asks_for_the_kind_of_structure(node) for node in tree)
    }
    assert_only_known(found, KNOWN_STRUCTURE_TESTS)


WORDINGS = ("complete", "converged", "interrupted", "stopped")


def is_status(value):
    if isinstance(value, ast.Subscript):
        value = value.slice
    text = {ast.Attribute: "attr", ast.Name: "id", ast.Constant: "value"}.get(type(value))
    word = getattr(value, text) if text else ""
    return isinstance(word, str) and (word == "status" or word.endswith("_status"))


def is_wording(value):
    return isinstance(value, ast.Constant) and str(value.value).startswith(WORDINGS)


def is_text(value):
    if isinstance(value, ast.Tuple | ast.List | ast.Set):
        return any(is_text(x) for x in value.elts)
    literal = isinstance(value, ast.JoinedStr) or (isinstance(value, ast.Constant) and isinstance(value.value, str))
    return literal or (isinstance(value, ast.Name) and value.id.isupper())


def compares_a_status_with_text(node):
    """Whether a node decides by the wording of a status: ``status == "..."``, ``status.startswith(...)``, ``re``."""
    if isinstance(node, ast.Compare):
        sides = [node.left, *node.comparators]
        statuses = [x for x in sides if is_status(x) and not isinstance(x, ast.Constant)]
        return any(map(is_wording, sides)) or (bool(statuses) and any(is_text(x) for x in sides if x not in statuses))
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
        if node.func.attr in ("startswith", "endswith", "find", "partition", "split"):
            return is_status(node.func.value)
        if node.func.attr in ("match", "search", "fullmatch", "findall"):
            return any(is_status(x) for x in node.args)
    return False


def test_no_status_is_compared_with_text():
    found = {name for name, tree in nodes().items() if any(compares_a_status_with_text(node) for node in tree)}
    assert_only_known(found, KNOWN_STATUS_COMPARISONS)


def test_no_two_classes_share_a_name():
    homes = defaultdict(set)
    for name, tree in nodes().items():
        for node in tree:
            if isinstance(node, ast.ClassDef):
                homes[node.name].add(name)
    assert_only_known({name for name, modules in homes.items() if len(modules) > 1}, KNOWN_SHARED_CLASS_NAMES)


def test_array_types_are_named_in_one_module():
    for name, tree in modules().items():
        if name == "beamsim.typing":
            continue
        for node in tree.body:
            targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
            named = {getattr(target, "id", None) for target in targets}
            assert not named & {"Floats", "Complexes", "Ints", "Bools"}, f"{name} names an array type itself"


def test_every_package_says_what_it_holds_what_it_never_does_and_where_to_begin():
    found = set()
    for name in PACKAGES[1:]:
        text = ast.get_docstring(modules()[name]) or ""
        if not (len(text.splitlines()) >= 3 and "Never here:" in text and "Begin with" in text):
            found.add(name)
    assert_only_known(found, KNOWN_UNDESCRIBED_PACKAGES)


# --- that the rules can fail ------------------------------------------------------------------------------------------


def test_a_circle_under_type_checking_and_one_within_a_function_are_found():
    source = {
        "beamsim.a.x": "if TYPE_CHECKING:\n    from beamsim.b.y import Y",
        "beamsim.b.y": "def f():\n    import beamsim.c",
        "beamsim.c": "from beamsim.a import x",
        "beamsim.d": "import beamsim.c",
    }
    graph = read_imports({name: list(ast.walk(ast.parse(text))) for name, text in source.items()})
    assert circles(graph) == [{"beamsim.a.x", "beamsim.b.y", "beamsim.c"}]
    del graph["beamsim.c"]
    assert circles(graph) == []


def test_lists_of_exceptions_only_shrink():
    assert_only_known({"a"}, {"a"})
    assert_only_known_circles([{"a", "b"}], [{"a", "b", "c"}])
    for found, known in ((["a"], []), ([], ["a"])):
        with pytest.raises(AssertionError):
            assert_only_known(set(found), set(known))
    for found, known in (([{"a", "b"}], []), ([], [{"a", "b"}])):
        with pytest.raises(AssertionError):
            assert_only_known_circles(found, known)


@pytest.mark.parametrize(
    ("text", "asks"),
    [
        ("x.beam is None", True),
        ("a if s.chain else b", True),
        ("before.beam or before.chain", True),
        ("isinstance(x, BeamModel)", True),
        ("structure.kind == 'beam'", True),
        ("itertools.chain(a, b)", False),
        ("isinstance(x, BeamsimError)", False),
        ("scenario.run is None", False),
    ],
)
def test_tests_of_the_kind_of_structure_are_recognised(text, asks):
    assert any(asks_for_the_kind_of_structure(node) for node in ast.walk(ast.parse(text))) is asks


@pytest.mark.parametrize(
    ("text", "compares"),
    [
        ("status == 'complete'", True),
        ("branch.status.startswith('complete')", True),
        ("s['status'] not in ('complete', other)", True),
        ("status == INTERRUPTED", True),
        ("re.search(pattern, result.status)", True),
        ("solution.status == 1", False),
        ("outcome is Outcome.COMPLETE", False),
        ("name == 'status'", False),
        ("next(s for s in found if s != 'complete')", True),
    ],
)
def test_comparisons_of_a_status_with_text_are_recognised(text, compares):
    assert any(compares_a_status_with_text(node) for node in ast.walk(ast.parse(text))) is compares


# --- outcomes ---------------------------------------------------------------------------------------------------------

KNOWN_UNUSED_OUTCOMES: set[str] = set()


def test_every_outcome_is_given_by_something():
    from beamsim.outcomes import OutcomeCode

    used = {
        node.attr
        for name, tree in modules().items()
        if name not in ("beamsim.outcomes", "beamsim.store.outcomes")
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "OutcomeCode"
    }
    unused = (
        {code.name for code in OutcomeCode} - used - {"COMPLETE", "STOPPED"}
    )  # a constant of its own, and what old files say
    assert_only_known(unused, KNOWN_UNUSED_OUTCOMES)
