"""What a declared field may be."""

import pytest

from beamsim.fields import attribute, dataset, declared, filled, members_of
from beamsim.typing import Floats


@declared
class Level:
    given: "float" = attribute("m", "a number")
    perhaps: "float | None" = attribute("m", "a number or none", default=None)
    array: "Floats | None" = dataset("m", "an array or none", default=None)
    by_name: "dict[str, float]" = dataset("m", "a number for each probe", per="probes", default_factory=dict)
    unwritten: int = attribute("1", "a number", default=1)


@declared
class Higher(Level):
    own: "tuple[str, ...] | None" = attribute("", "texts or none", default=None)


@pytest.mark.parametrize(
    ("name", "scalar", "default"),
    [
        ("given", float, "required"), ("perhaps", float, None), ("array", None, None), ("by_name", float, {}),
        ("unwritten", int, 1), ("own", None, None),
    ],
)  # fmt: skip
def test_a_field_is_known_with_its_type_and_its_default(name, scalar, default):
    member = next(member for member in members_of(Higher) if member.name == name)
    assert member.scalar is scalar
    assert ("required" if member.default is None else member.default()) == default
    assert member.declaration.meaning


def test_texts_are_filled_from_the_innermost_owner():
    owners = (Level(2.0), {"given": 3.0, "quantity": "peak_force"})
    assert filled("{given} {quantity:words} of {quantity}", owners) == "2.0 peak force of peak_force"
    with pytest.raises(KeyError, match="no field other"):
        filled("{other}", owners)
