"""Which tests there are: of many alike cases the first ones are tests of their own, all others are one test.

Those of an optional package are skipped without it.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable
from functools import wraps
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

Test = Callable[..., None]
OTHERS = "others"


def needs(package: str) -> pytest.MarkDecorator:
    """Skip tests where an optional package is missing; it is not loaded by processes that run none of them."""
    return pytest.mark.skipif(find_spec(package) is None, reason=f"needs {package}")


class _Others(tuple[Any, ...]):
    """Cases that one test checks."""


def first_apart(
    names: str | tuple[str, ...], count: int, cases: Iterable[Any], ids: Callable[[Any], str] | None = None
) -> Callable[[Test], Test]:
    """`pytest.mark.parametrize` with the first cases, and with all others as one test, which reports all that fail.

    Each of the others has an empty folder as `tmp_path` and a `monkeypatch` of its own.
    """
    several = not isinstance(names, str)
    first = names[0] if several else names
    cases = list(cases)
    count = len(cases) if len(cases) == count + 1 else count  # one is no family
    label = ids or (lambda case: None)
    values = [pytest.param(*case, id=label(case)) if several else pytest.param(case, id=label(case))
              for case in cases[:count]]  # fmt: skip
    if cases[count:]:
        values.append(pytest.param(_Others(cases[count:]), *[None] * (len(names) - 1 if several else 0), id=OTHERS))

    def decorate(test: Test) -> Test:
        @wraps(test)
        def one_or_all(**arguments: Any) -> None:
            others = arguments[first]
            if not isinstance(others, _Others):
                test(**arguments)
                return
            failures = []
            for k, case in enumerate(others):
                given = dict(zip(names, case, strict=True)) if several else {first: case}
                try:
                    _check(test, arguments | given, k)
                except Exception as error:
                    failures.append(f"{label(case) or case!r}: {type(error).__name__}: {error}")
            assert not failures, "\n".join(failures)

        one_or_all.__signature__ = inspect.signature(test)  # type: ignore[attr-defined]
        marked: Test = pytest.mark.parametrize(names, values)(one_or_all)
        return marked

    return decorate


def _check(test: Test, arguments: dict[str, Any], number: int) -> None:
    """Call a test with what it would have for itself if it were not one of many."""
    if "tmp_path" in arguments:
        folder: Path = arguments["tmp_path"] / f"case_{number}"
        folder.mkdir()
        arguments["tmp_path"] = folder
    if "monkeypatch" not in arguments:
        test(**arguments)
        return
    with pytest.MonkeyPatch.context() as patch:
        test(**arguments | {"monkeypatch": patch})
