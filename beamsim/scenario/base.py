"""Base class of all sections of a scenario, and tools that the sections share.

Every class is frozen and refuses unknown keys. The docstring below a field is its description; users see it in their
editor through the JSON Schema.
"""

from __future__ import annotations

import ast
import inspect
import math
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from itertools import pairwise
from typing import Any, ClassVar, Literal, Self, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, GetCoreSchemaHandler, GetJsonSchemaHandler, Tag, model_validator
from pydantic_core import CoreSchema, core_schema

from beamsim.errors import Problem

Path = tuple[str | int, ...]
Problems = Iterator[Problem]
Mark = tuple[str | None, int | None]
"""File and line."""
NO_MARK: Mark = (None, None)
Whole = Any
"""The complete scenario. Sections are checked against it but cannot import its class, which imports theirs."""


TWO_ITEMS = Field(min_length=2, max_length=2)
LONGEST_VALUE = 60  # characters of a value in a message
MOST_NAMES = 40  # listed in a message
LEAST_LIKENESS = 0.65  # similarity of two words above which one is suggested for the other

_KEY = r"[A-Za-z_](?:[\w -]*[\w-])?"
_ITEM = r"\[(?:\*|\w(?:[\w .+-]*[\w+-])?)\]"
_NAME = re.compile(_KEY)
_PATH = re.compile(rf"[A-Za-z_][\w-]*(?:{_ITEM})*(?:\.{_KEY}(?:{_ITEM})*)*")
_PATH_PART = re.compile(rf"({_KEY})|({_ITEM})")


def path_parts(path: str) -> list[str | int]:
    """Split a path as the user wrote it into keys, names, indices and ``*``; empty if it is not a valid path.

    Brackets hold an index, ``*`` for every item, or a name; such a name may contain points.

    >>> path_parts("snubbers.hard stop.gap"), path_parts("bodies.panel.point_masses[*].mass")
    (['snubbers', 'hard stop', 'gap'], ['bodies', 'panel', 'point_masses', '*', 'mass'])
    >>> path_parts("snubbers[0].gap"), path_parts("probes[no. 1].position"), path_parts("snubbers[0")
    (['snubbers', 0, 'gap'], ['probes', 'no. 1', 'position'], [])
    """
    if not _PATH.fullmatch(path):
        return []
    parts = (key or item[1:-1] for key, item in _PATH_PART.findall(path))
    return [int(part) if part.isdecimal() else part for part in parts]


def path_text(path: Path) -> str:
    """Write a path as the user would; `path_parts` reads it back.

    >>> path_text(("snubbers", 0, "position"))
    'snubbers[0].position'
    >>> path_text(("bodies", "1.5 m", "length"))
    'bodies[1.5 m].length'
    """
    text = ""
    for part in path:
        in_brackets = isinstance(part, int) or (text and not _NAME.fullmatch(part))
        text += f"[{part}]" if in_brackets else f".{part}" if text else str(part)
    return text


class InvalidValueError(ValueError):
    """An invalid value. Validators raise it; the caller, who knows the path of the value, adds the path.

    Parameters
    ----------
    message : what is wrong; follows the path of the value (``beam.length`` + ``must be ...``).
    remedy : what to do about it.
    at : path below the value that is validated.
    """

    def __init__(self, message: str, remedy: str = "", path: Path = ()) -> None:
        super().__init__(message)
        self.message, self.remedy, self.at = message, remedy, path

    def problem(self, path: Path) -> Problem:
        """Convert to a problem of the value at a path."""
        return problem((*path, *self.at), self.message, self.remedy)


def problem(path: Path, message: str, remedy: str = "", mark: Mark = NO_MARK) -> Problem:
    """Make a problem of the value at a path of the scenario.

    Parameters
    ----------
    path : of the value.
    message : what is wrong, written so that it can follow the path, as in `InvalidValueError`.
    remedy : what to do about it.
    mark : file and line, if already known.

    Returns
    -------
    Problem
    """
    return Problem(path_text(path), message, remedy, *mark)


def demand_rising(
    values: Iterable[float],
    unit: str,
    path_of: Callable[[int], Path],
    remedy: str = "list them from the lowest to the highest",
) -> None:
    """Refuse a list of numbers that does not increase.

    Parameters
    ----------
    values : the numbers, in SI units.
    unit : their unit, for the message.
    path_of : path of a number, by its index.
    remedy : what to do about it.

    Raises
    ------
    InvalidValueError
        At the first number that is not larger than the one before it.
    """
    for index, (one, two) in enumerate(pairwise(values), start=1):
        if not two > one:
            raise InvalidValueError(
                f"= {two:g} {unit} is not larger than the one before, {one:g} {unit}", remedy, path_of(index)
            )


def _hashable(value: Any) -> Any:
    """A hashable copy of a field's value; equal mappings give equal results."""
    if isinstance(value, dict):
        return frozenset((key, _hashable(part)) for key, part in value.items())
    return tuple(map(_hashable, value)) if isinstance(value, list) else value


class Schema(BaseModel):
    """A frozen section of a scenario; it stores what the user wrote.

    A default that depends on other numbers is not stored. Its field has the name of the key with an underscore appended
    (``rise_``) and is None if the key is missing; a property with the name of the key (``rise``) gives the value.
    """

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        allow_inf_nan=False,
        validate_by_name=True,
        validate_by_alias=True,
        defer_build=True,
    )

    distinguishing_keys: ClassVar[tuple[str, ...]] = ()
    """Keys that distinguish this class from the other members of a union, see `Variants`; ``section: sandwich`` if the
    kind of the section below the key distinguishes it."""

    uncompared_keys: ClassVar[tuple[str, ...]] = ()
    """Keys that are ignored when two sections are compared."""

    unit_attributes: ClassVar[Mapping[str, str]] = {}
    """For each key the attribute that `as_plain_data` always writes, because a unit implies it; None to write
    nothing."""

    def check(self) -> None:
        """Check the fields against each other; raises `InvalidValueError`."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems of this section in its scenario, at a path; the sections below it report their own."""
        yield from ()

    def find_warnings(self, scenario: Whole, path: Path) -> Iterator[str]:
        """A sentence for each questionable value of this section in its scenario."""
        yield from ()

    def exclude(self, key: str, *others: str, remedy: str = "keep one of the two") -> None:
        """Refuse a key that is given together with one of the others."""
        names, fields = self.keys(), type(self).model_fields
        given = []
        for each in (*others, key):
            value, default = getattr(self, names[each]), fields[names[each]].get_default(call_default_factory=True)
            if value is not None and (default is None or value != default):
                given.append(each)
        if key in given and given[0] != key:
            raise InvalidValueError(f"and {given[0]} exclude each other", remedy, (key,))

    @classmethod
    def key_of(cls, name: str) -> str:
        """The YAML key of the field with a name."""
        return cls.model_fields[name].alias or name

    @classmethod
    @cache
    def keys(cls) -> dict[str, str]:
        """Map each YAML key to the name of its field."""
        return {field.alias or name: name for name, field in cls.model_fields.items()}

    @classmethod
    @cache
    def attributes(cls) -> dict[str, str]:
        """Map each YAML key to the attribute that gives its value or its default."""
        return {key: key if hasattr(cls, key) else name for key, name in cls.keys().items()}

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy with other values, given by key or by field name; they are not checked."""
        keys = self.keys()
        changed = {keys.get(name, name): value for name, value in (update or {}).items()}
        return super().model_copy(update=changed, deep=deep)

    def __eq__(self, other: object) -> bool:
        names = [name for key, name in self.attributes().items() if key not in self.uncompared_keys]
        return type(other) is type(self) and all(getattr(self, name) == getattr(other, name) for name in names)

    def __hash__(self) -> int:
        names = [name for key, name in self.attributes().items() if key not in self.uncompared_keys]
        return hash((type(self), *(_hashable(getattr(self, name)) for name in names)))

    @model_validator(mode="before")
    @classmethod
    def _without_null(cls, data: Any) -> Any:
        """Treat a key with the value ``null`` as missing."""
        if not isinstance(data, dict):
            return data
        known = cls.keys().keys() | cls.model_fields.keys()
        return {key: value for key, value in data.items() if value is not None or key not in known}

    @model_validator(mode="after")
    def _run_checks(self) -> Self:
        self.check()
        return self


def descriptions(schema: type[Schema]) -> dict[str, str]:
    """Map the name of every field to the docstring below it.

    Docstrings are read from the source only when an editor's schema or a message needs them: reading them at every
    start would take a third of the import time.
    """
    docstrings: dict[str, str] = {}
    for base in reversed(schema.__mro__):
        if issubclass(base, Schema) and base is not Schema:
            docstrings |= _docstrings(base.__module__).get(base.__name__, {})
    return docstrings


@cache
def _docstrings(module: str) -> dict[str, dict[str, str]]:
    """Map class and field to the docstring, for one module."""
    return {
        item.name: {
            field.target.id: inspect.cleandoc(str(doc.value.value))
            for field, doc in pairwise(item.body)
            if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
            and isinstance(doc, ast.Expr) and isinstance(doc.value, ast.Constant)
        }
        for item in ast.parse(inspect.getsource(sys.modules[module])).body
        if isinstance(item, ast.ClassDef)
    }  # fmt: skip


def walk(value: object, path: Path = ()) -> Iterator[tuple[Path, Schema]]:
    """Yield every section that the user wrote (no defaults), with its path."""
    parts: Iterable[tuple[Any, object]] = ()
    if isinstance(value, Schema):
        yield path, value
        held, written = value.__dict__, value.model_fields_set
        parts = [(key, held[name]) for key, name in value.keys().items() if name in written]
    elif isinstance(value, tuple):
        parts = enumerate(value)
    elif isinstance(value, dict):
        parts = value.items()
    for key, part in parts:
        if isinstance(part, (Schema, tuple, dict)):
            yield from walk(part, (*path, key))


def as_plain_data(value: object) -> Any:
    """A section as plain data with its YAML keys, numbers in SI units."""
    if isinstance(value, Schema):
        written = dict[str, Any]()
        for key, name in value.keys().items():
            held = value.__dict__[name]
            given = name in value.model_fields_set or name == "kind"
            empty = isinstance(held, (tuple, dict)) and not held
            empty = empty and held == type(value).model_fields[name].get_default(call_default_factory=True)
            if key in value.unit_attributes and (stated := getattr(value, value.unit_attributes[key])) is not None:
                written[key] = stated
            elif given and held is not None and not empty:
                written[key] = as_plain_data(held)
        return written
    if isinstance(value, (tuple, list)):
        return [as_plain_data(item) for item in value]
    if isinstance(value, dict):
        return {key: as_plain_data(item) for key, item in value.items()}
    if value is None or isinstance(value, (bool, int, str)):
        return value
    return float(value) if isinstance(value, float) else str(value)


def nested_annotations(annotation: Any) -> Iterator[Any]:
    """Yield an annotation and everything nested in it: types, metadata, words."""
    yield annotation
    for inner in get_args(annotation):
        yield from nested_annotations(inner)


def words_of(annotation: Any) -> tuple[str, ...]:
    """Words that an annotation, or a member of a union in it, allows."""
    words = (get_args(each) for each in nested_annotations(annotation) if get_origin(each) is Literal)
    return tuple(str(word) for each in words for word in each)


def kind_of(value: Any) -> object:
    """The value of ``kind`` of raw data or of a section; None if it has none."""
    return value.get("kind") if isinstance(value, dict) else getattr(value, "kind", None)


def kinds_of(schema: type[Schema]) -> tuple[str, ...]:
    """The values of ``kind`` that a class accepts; empty if its kind is optional."""
    field = schema.model_fields.get("kind")
    kinds = () if field is None else get_args(field.annotation)
    return kinds if len(kinds) == 1 or (field is not None and field.is_required()) else ()


def tag_of(member: Any) -> str:
    """Tag of a union member in the location of an error, in angle brackets."""
    metadata = getattr(member, "__metadata__", ())
    inner = get_args(member)[0] if metadata else member
    for item in metadata:
        if isinstance(item, Tag):
            return item.tag
    if isinstance(inner, type) and issubclass(inner, Schema):
        return f"<{inner.__name__}>"
    form = {Literal: "<text>", tuple: "<list>", dict: "<mapping>"}.get(get_origin(inner))
    return form or next((item.form for item in metadata if hasattr(item, "form")), "")


@dataclass(frozen=True)
class Variants:
    """Marks a union whose member is chosen by the form of the raw value.

    A mapping is chosen by its key ``kind``, if the members differ in it, and by `Schema.distinguishing_keys`; a member
    without such keys takes every other mapping. A union may also contain words, a list, a mapping by names, and a
    number or text. If there is a message, it replaces all errors about the choice.
    """

    message: str = ""
    remedy: str = ""
    # function that gives the tag of a raw value or section, if the form is not enough
    tag_function: Callable[[Any], str | None] | None = None

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        members = {tag_of(member): member for member in get_args(source)}
        inner = {tag: get_args(each)[0] if hasattr(each, "__metadata__") else each for tag, each in members.items()}
        sections = {tag: of for tag, of in inner.items() if isinstance(of, type) and issubclass(of, Schema)}
        kinds = {tag: kinds_of(schema) for tag, schema in sections.items()}
        by_kind = len({kind for each in kinds.values() for kind in each}) > 1
        others = {tag: member for tag, member in members.items() if tag not in sections}
        forms = _UnionMembers(sections, kinds, others, by_kind, by_kind or bool(self.message))
        return core_schema.tagged_union_schema(
            {tag: handler.generate_schema(member) for tag, member in members.items()},
            self.tag_function or forms.tag,
            custom_error_type="variants" if self.message else None,
            custom_error_message=self.message or None,
            custom_error_context={"remedy": self.remedy},
        )


@dataclass(frozen=True)
class _UnionMembers:
    """The members of a union by tag; finds the member that a value belongs to."""

    sections: dict[str, type[Schema]]
    kinds: dict[str, tuple[str, ...]]  # of the sections
    non_mappings: dict[str, Any]  # words, lists, mappings by names, numbers and text
    has_kinds: bool  # whether ``kind`` distinguishes the sections
    has_message: bool  # whether there is a message for values that match no member

    def tag(self, value: Any) -> str | None:
        """Tag of the union member that a raw value or section belongs to; None if it belongs to none."""
        if isinstance(value, Schema):
            return next((tag for tag, schema in self.sections.items() if isinstance(value, schema)), None)
        sections = self.sections
        usual = [tag for tag, schema in sections.items() if not schema.distinguishing_keys]
        if isinstance(value, dict) and sections:
            if self.has_kinds:
                usual = [tag for tag, kinds in self.kinds.items() if value.get("kind") in kinds]
                sections = {tag: sections[tag] for tag in usual}
            for tag, schema in sections.items():
                for key, _, kind in (known.partition(": ") for known in schema.distinguishing_keys):
                    if (held := value.get(key)) is not None and (not kind or kind_of(held) == kind):
                        return tag
            return next(iter(usual), None)
        for form, types in (("<mapping>", dict), ("<list>", (list, tuple))):
            if isinstance(value, types) and form in self.non_mappings:
                return form
        text = self.non_mappings.get("<text>")
        if text is not None and isinstance(value, str) and (value in get_args(text) or hasattr(text, "__metadata__")):
            return "<text>"
        if self.has_message:
            number = not isinstance(value, str) or any(character.isdigit() for character in value)
            return "<number>" if "<number>" in self.non_mappings and number else None
        forms = [tag for tag in ("<number>", "<text>") if tag in self.non_mappings]
        return next(iter(forms + usual), next(reversed(sections), None))


BY_FORM = Variants()


@dataclass(frozen=True)
class ShortFor:
    """Marks a mapping that may be abbreviated to a text, which is then the value of one key."""

    key: str
    words: tuple[str, ...] = ()

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self._long, handler(source))

    def _long(self, value: Any) -> Any:
        meant = isinstance(value, str) and value in (self.words or (value,))
        return {self.key: value} if meant else value

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        alone = {"enum": list(self.words)} if self.words else {"minLength": 1}
        return {"anyOf": [{"type": "string"} | alone, handler(schema)]}


def count_text(number: int, noun: str, plural: str = "") -> str:
    """A number with its noun.

    >>> count_text(1, "value"), count_text(2, "mass", "masses")
    ('1 value', '2 masses')

    Parameters
    ----------
    number : how many there are.
    noun : what is counted, in the singular.
    plural : by default the noun with an s.

    Returns
    -------
    str
    """
    return f"{number} {noun if number == 1 else plural or noun + 's'}"


def distinct(a: float, b: float) -> tuple[str, str]:
    """Print two numbers with enough digits to distinguish them."""
    for digits in range(6, 18):
        texts = f"{a:.{digits}g}", f"{b:.{digits}g}"
        if texts[0] != texts[1]:
            return texts
    return repr(a), repr(b)


def suggestion(name: str, names: Iterable[str], introduction: str) -> str:
    """The remedy for an unknown name.

    Parameters
    ----------
    name : the unknown name.
    names : the known names.
    introduction : text before the list of all names if none is similar ("the bodies are").

    Returns
    -------
    str
        A question with the similar name, else ``introduction`` with all names.
    """
    names = list(names)
    meant = closest_name(name, names)
    more = f", ... ({len(names)} in all)" if len(names) > MOST_NAMES else ""
    return f"did you mean {meant}?" if meant else f"{introduction} {', '.join(names[:MOST_NAMES])}{more}"


SYNONYMS = {
    "above": "top over upper up",
    "below": "bottom under beneath underneath lower down",
    "clamped": "fixed built_in encastre encastred",
    "coefficient": "c mu friction_coefficient damping_coefficient damping_constant",
    "density": "rho",
    "duration": "t_end end_time total_time",
    "excitation": "load loads loading",
    "factor": "scale scale_factor scaling multiplier",
    "from": "min minimum low lower",
    "gap": "clearance play backlash",
    "half_sine": "shock pulse",
    "harmonic": "sine sin sinusoidal dwell",
    "level": "amplitude magnitude acceleration",
    "peak_acceleration": "acceleration max_acceleration",
    "peak_displacement": "displacement deflection max_displacement",
    "peak_force": "force contact_force max_force",
    "pinned": "simply_supported hinged",
    "point_masses": "added_mass added_masses lumped_mass lumped_masses concentrated_masses tip_mass",
    "poissons_ratio": "nu poisson",
    "points": "values",
    "position": "location coordinate x",
    "preload": "prestress interference",
    "probes": "sensors accelerometers measurement_points",
    "quality": "q q_factor amplification",
    "ratio": "zeta xi lehr critical_damping",
    "rotary_inertia": "moment_of_inertia rotational_inertia inertia",
    "sample_rate": "fs dt time_step sampling_frequency",
    "sampled": "file record time_history accelerogram",
    "samples": "n draws",
    "second_moment": "i iy izz moment_of_inertia area_moment",
    "snubbers": "stops stop bumpers contacts end_stops",
    "stiffness": "k spring_constant spring_rate",
    "supports": "boundary_conditions boundaries bc constraints",
    "swept_sine": "sweep chirp sine_sweep",
    "to": "max maximum high upper",
    "title": "name heading",
    "youngs_modulus": "e modulus elastic_modulus modulus_of_elasticity",
}
"""For each key, other words that engineers use for it."""


def closest_name(name: str, names: Iterable[str]) -> str:
    """The known name that a name probably means: a synonym, else a similar spelling; empty if there is none.

    A name that differs in a number is not taken for a spelling mistake.

    >>> closest_name("bottom", ["below", "above", "both"]), closest_name("stop_12", ["stop_1", "stop_2"])
    ('below', '')
    """
    word, numbers = re.sub(r"[\s-]", "_", name.lower()), re.findall(r"\d+", name)
    known = {each.lower(): each for each in names if not numbers or re.findall(r"\d+", each) in ([], numbers)}
    means = [each for key, words in SYNONYMS.items() if word in words.split() for each in [known.get(key)] if each]
    alike = means or [known[each] for each in get_close_matches(word, known, n=1, cutoff=LEAST_LIKENESS)]
    if not alike:  # thickness_mm, e_modulus, Length
        alike = [known[each] for each in known if min(len(each), len(word)) > 3 and (each in word or word in each)]
    return alike[0] if alike else ""


def unknown(
    path: Path, name: str, kind: str, known_names: Iterable[str], remedy_without_any: str = ""
) -> Iterator[Problem]:
    """Yield a problem if a name is not among the known ones.

    Parameters
    ----------
    path : where the name is written.
    name : the name.
    kind : what it names, in the singular ("body").
    known_names : the known names.
    remedy_without_any : the remedy if there are no known names.

    Yields
    ------
    Problem
        One problem, or none if the name is known.
    """
    names = list(known_names)
    if name not in names:
        plural = kind.removesuffix("y") + ("ies" if kind.endswith("y") else "s")
        remedy = suggestion(name, names, f"the {plural} are") if names else remedy_without_any or f"there is no {kind}"
        yield problem(path, f"names no {kind}" if path[-1] == name else f"= {name} is an unknown {kind}", remedy)


def named_twice(named: Iterable[tuple[Path, Any]]) -> Problems:
    """Names that are not unique; ``named`` gives each section with its path."""
    first: dict[str, Path] = {}
    for path, item in named:
        if (other := first.setdefault(item.name, path)) is not path:
            message = f"= {item.name} is already the name of {path_text(other)}"
            yield problem((*path, "name"), message, "choose another name")


def single_line(value: object) -> str:
    """Show a raw value as the user would write it, shortened.

    >>> single_line({"kind": "modal", "on": True})
    '{kind: modal, on: true}'
    """
    text = _flow(value)
    return text if len(text) <= LONGEST_VALUE else text[: LONGEST_VALUE - 1] + "…"


def _flow(value: object) -> str:
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return value if value and value == value.strip() and value.isprintable() else repr(value)
    if isinstance(value, float):
        return f"{value:.12g}"
    if isinstance(value, int) and abs(value) >= 10**LONGEST_VALUE:  # Python refuses to print more than 4,300 digits
        return f"a whole number of about {value.bit_length() * math.log10(2):.0f} digits"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_flow(item)}" for key, item in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_flow(item) for item in value) + "]"
    return str(value)
