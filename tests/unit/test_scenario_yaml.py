"""YAML that doesn't bite: numbers and booleans of YAML 1.2, no silent duplicates, every value located."""

import pytest

from beamsim.errors import ScenarioError
from beamsim.scenario.tree import from_python, locate, parse

pytestmark = pytest.mark.quick


def problems(text):
    with pytest.raises(ScenarioError) as caught:
        parse(text, "case.yaml")
    return [str(problem) for problem in caught.value.problems]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("2e5", 2e5),
        ("1e-3", 1e-3),
        (".5", 0.5),
        ("5.", 5.0),
        ("-1.5E+2", -150.0),
        ("+3", 3),
        ("12", 12),
        ("010", 10),
        ("0o17", 15),
        ("0x1F", 31),
        ("true", True),
        ("False", False),
        ("null", None),
        ("~", None),
        ("", None),
        # text, whatever YAML 1.1 says
        ("off", "off"),
        ("on", "on"),
        ("yes", "yes"),
        ("no", "no"),
        ("y", "y"),
        ("1:30", "1:30"),
        ("2024-01-01", "2024-01-01"),
        ("1_000", "1_000"),
        ("5 mm", "5 mm"),
        ("'true'", "true"),
        ('"2e5"', "2e5"),
        ("=", "="),
    ],
)
def test_scalars(text, value):
    read = parse(f"key: {text}\n")["key"]
    assert read == value
    assert type(read) is type(value)


def test_infinities_reach_the_fields_which_refuse_them():
    assert parse("a: .inf\n") == {"a": float("inf")}
    assert parse("a: -.Inf\n") == {"a": float("-inf")}
    assert parse("a: .nan\n")["a"] != parse("a: .nan\n")["a"]


def test_every_value_knows_its_line():
    root = parse(
        "# comment\nbeam:\n  length: 1\n  point_masses:\n    - {position: 1,\n       mass: 2}\ntitle: x\n", "f"
    )
    assert locate(root, ("beam",)) == ("f", 2)
    assert locate(root, ("beam", "length")) == ("f", 3)
    assert locate(root, ("beam", "point_masses", 0)) == ("f", 5)
    assert locate(root, ("beam", "point_masses", 0, "mass")) == ("f", 6)
    assert locate(root, ("beam", "point_masses", 0, "missing")) == ("f", 5)
    assert locate(root, ("beam", "point_masses", 7)) == ("f", 4)
    assert locate(root, ("title", "deeper")) == ("f", 7)
    assert locate(root, ("absent",)) == ("f", None)


def test_duplicates_are_all_reported():
    assert problems("beam:\n  length: 1\n  length: 2\ntitle: a\ntitle: b\n") == [
        "case.yaml:3: beam.length is given twice, first in line 2; keep one of the two",
        "case.yaml:5: title is given twice, first in line 4; keep one of the two",
    ]


def test_anchors_aliases_and_merge_keys():
    text = "base: &b {x: 1, y: 2}\nother: {<<: *b, y: 3}\nboth: {<<: [*b, {z: 4, x: 9}]}\nsame: *b\n"
    assert parse(text) == {
        "base": {"x": 1, "y": 2},
        "other": {"x": 1, "y": 3},
        "both": {"x": 1, "y": 2, "z": 4},
        "same": {"x": 1, "y": 2},
    }
    assert "merges (<<) a value that is not a mapping" in problems("a: {<<: 3}\n")[0]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("beam: {a: 1\nfoo: 2\n", "case.yaml:2: is not YAML"),
        ("beam:\n\tlength: 1\n", "case.yaml:2: is not YAML: tabs cannot indent"),
        ("a: 'open\n", "is not YAML"),
        ("a: b: c\n", "case.yaml:1: is not YAML"),
        ("a: [1\nb: 2\n", "is the [ of line 1 closed"),
        ("a: {b: 1 c: 2}\n", "is the { of line 1 closed, with commas between its items?"),
        (
            "length 8  # no colon\nwidth: 4\n",
            "; line 1 has no colon between key and value",
        ),
        ("a: *unknown\n", "undefined alias"),
        ("a: 1\n---\nb: 2\n", "case.yaml:2: contains a second document"),
        ("a: !!python/object:os.system [x]\n", "a has the tag"),
        ("a: !mine x\n", "a has the tag !mine"),
        ("a: !mine {x: 1}\n", "a has the tag !mine"),
        ("a: !!float x\n", "a = x is not a valid float"),
        ("a: !!bool x\n", "a = x is not a valid bool"),
        ("a: 1\n2: b\n", "case.yaml:2: has the key 2, which is not text"),
        ("? [a]\n: b\n", "which is not text"),
        ("a: &x\n  b: *x\n", "a.b contains itself through an alias"),
        ("a: 1\nb: \x00\n", "case.yaml:2: contains a character that YAML does not allow (U+0000)"),
        ("a: " + "[" * 800 + "\n", "is nested too deeply"),
        (
            "a: &a [1,1,1,1,1,1,1,1,1,1]\n"
            + "".join(f"{b}: &{b} [{','.join(['*' + a] * 10)}]\n" for a, b in zip("abcde", "bcdef", strict=True)),
            "unfolds to more than",
        ),
    ],
)
def test_not_yaml(text, says):
    assert says in problems(text)[0]


def test_python_values():
    numpy = pytest.importorskip("numpy")
    value = {
        "a": numpy.float64(0.5),
        "b": numpy.int64(3),
        "c": numpy.arange(2),
        "d": (True, None, "x"),
        "e": numpy.float32(2),
    }
    plain = from_python(value)
    assert plain == {"a": 0.5, "b": 3, "c": [0, 1], "d": [True, None, "x"], "e": 2.0}
    assert [type(plain[key]) for key in "abe"] == [float, int, float]
