"""What a declared field may be, read from its annotation on every version of Python."""

from typing import Optional, Union

import numpy as np
import pytest

from beamsim.fields import attribute, dataset, declared, members_of
from beamsim.typing import Floats


@declared
class Level:
    given: float = attribute("m", "a number")
    perhaps: float | None = attribute("m", "a number or none", default=None)
    named: Optional[str] = attribute("", "a text or none", default=None)  # noqa: UP045
    either: Union[Floats, None] = dataset("m", "an array or none", default=None)  # noqa: UP007
    later: "Floats | None" = dataset("m", "an array or none, as a text", default=None)


@declared
class Higher(Level):
    own: tuple[str, ...] | None = attribute("", "texts or none", default=None)


@pytest.mark.parametrize(
    ("name", "annotation", "optional"),
    [
        ("given", float, False), ("perhaps", float, True), ("named", str, True), ("either", Floats, True),
        ("later", Floats, True), ("own", tuple[str, ...], True),
    ],
)  # fmt: skip
def test_a_field_that_may_be_none_is_known_with_its_type(name, annotation, optional):
    member = next(member for member in members_of(Higher) if member.name == name)
    assert (member.annotation, member.optional) == (annotation, optional)
    assert np.isscalar(member.declaration.meaning)
