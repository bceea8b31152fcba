"""Families of alike cases: the first ones are tests of their own, all others one test."""

import pytest
from sampling import first_apart


def test_every_case_that_fails_among_the_others_is_named(tmp_path):
    @first_apart(("number", "word"), 2, [(1, "a"), (2, "b"), (3, "c"), (4, "d"), (5, "e")])
    def check(number, word, tmp_path):
        assert not list(tmp_path.iterdir())
        (tmp_path / word).touch()
        assert number % 2 == 0

    (mark,) = check.pytestmark
    names, cases = mark.args
    first, second, others = (dict(zip(names, case.values, strict=True)) for case in cases)
    assert (first, second) == ({"number": 1, "word": "a"}, {"number": 2, "word": "b"})
    check(**others | {"number": 4, "word": "d"}, tmp_path=tmp_path)
    (tmp_path / "d").unlink()
    with pytest.raises(AssertionError) as caught:
        check(**others, tmp_path=tmp_path)
    assert "(3, 'c'): AssertionError" in str(caught.value)
    assert "(5, 'e'): AssertionError" in str(caught.value)
    assert "(4, 'd')" not in str(caught.value)


def test_one_other_case_is_a_test_of_its_own():
    @first_apart("number", 1, [1, 2])
    def check(number):
        assert number

    assert [case.values for case in check.pytestmark[0].args[1]] == [(1,), (2,)]
