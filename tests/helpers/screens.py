"""Reader of first screens and of result files that shares no code with what prints them.

A screen is a title with a verdict, statements, the line of what was understood, a table, sentences, and the files. Each
sentence, each part of the verdict and each cell is compared with the numbers of the file by a rule of
`tests/helpers/sentences`; what no rule recognises is a fault, too.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import yaml

GRAVITY = 9.80665
PREFIXES = {"": 1.0, "G": 1e9, "M": 1e6, "k": 1e3, "m": 1e-3, "µ": 1e-6, "n": 1e-9, "p": 1e-12}
UNITS = {
    unit: (unit, 1.0)
    for unit in ("m", "s", "N", "Pa", "J", "W", "rad", "N m", "N/m", "N s/m", "N s", "m/s", "N m/rad", "N m s/rad",
                 "rad/s", "rad/s^2", "N m s", "kg m^2", "1/s", "N^2/Hz", "m^2/Hz")
}  # fmt: skip
UNITS |= {
    "g": ("m/s^2", GRAVITY), "m/s^2": ("m/s^2", 1.0), "Hz": ("Hz", 1.0), "": ("1", 1.0), "%": ("1", 0.01),
    "deg": ("rad", math.pi / 180), "min": ("s", 60.0), "h": ("s", 3600.0), "days": ("s", 86400.0),
    "years": ("s", 365.25 * 86400.0), "kg": ("kg", 1.0), "dB": ("dB", 1.0), "g^2/Hz": ("m^2/s^3", GRAVITY**2),
}  # fmt: skip
NUMBER = r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?"
QUANTITY = rf"(?:{NUMBER}(?: (?:[a-zA-Zµ%][\w/^]*(?: (?:m|s|m/rad|s/m|s/rad|m s/rad)(?![\w/]))?))?|infinity|unknown)"
"""A number with a unit, as screens print it."""


def unit_of(text: str) -> tuple[str, float]:
    """SI unit and factor of a printed unit.

    Raises
    ------
    KeyError
        If there is no such unit.
    """
    if text in UNITS:
        return UNITS[text]
    unit, factor = UNITS[text[1:]]
    return unit, factor * PREFIXES[text[0]]


def rounds_to(text: str, value: float, digits: int = 3) -> bool:
    """Whether a printed number is a value that was rounded to at least so many significant digits.

    >>> rounds_to("76.9", 76.94), rounds_to("0.77", 0.7664, 2), rounds_to("200", 197.7, 2), rounds_to("200", 231.0, 2)
    (True, True, True, False)
    """
    number = float(text)
    mantissa = text.lower().partition("e")[0]
    if "." in mantissa or "e" in text:
        power = int(text.partition("e")[2] or 0)
        half = 0.5 * 10.0 ** (power - len(mantissa.partition(".")[2]))
        return abs(number - value) <= half * (1 + 1e-6) + 1e-12 * abs(value)
    if digits == 1 and abs(number - value) <= 0.5 * (1 + 1e-6):  # with no more decimals than a larger value has
        return True
    return any(math.isclose(float(f"{value:.{n}g}"), number, rel_tol=1e-12) for n in range(max(digits, 1), 16))


@dataclass
class ResultFacts:
    """What a result file says, read with h5py; and what was seen of it on the screen so far."""

    path: Path
    command: str
    attributes: dict[str, Any] = field(default_factory=dict)
    summary: dict[str, Any] = field(default_factory=dict)
    data: dict[str, np.ndarray] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    printed: set[tuple[str, str]] = field(default_factory=set)  # entry and place, of cells
    statistics: dict[str, str] = field(default_factory=dict)  # by label of a limit, of random runs

    def __post_init__(self) -> None:
        with h5py.File(self.path) as file:
            self.attributes = {name: _plain(value) for name, value in file.attrs.items()}
            attributes = dict(file["summary"].attrs) if "summary" in file else {}
            encoded = str(attributes.pop("json_encoded", "")).split()
            for name, value in attributes.items():
                self.summary[name] = json.loads(value) if name in encoded else _plain(value)
            file.visititems(self._keep)
        self.scenario = yaml.safe_load(self.attributes["scenario"])

    def _keep(self, name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset):
            values = item[()]
            values = values.decode() if isinstance(values, bytes) else values
            if getattr(values, "dtype", None) is not None and values.dtype.kind == "O":
                texts = [x.decode() if isinstance(x, bytes) else x for x in values.ravel()]
                values = np.array(texts).reshape(values.shape)
            if getattr(values, "dtype", None) == np.uint8:  # truth values
                values = values.astype(bool)
            self.data[name], self.units[name] = values, str(item.attrs.get("units", "1"))

    @property
    def kind(self) -> str:
        """Kind of the result."""
        return str(self.attributes["kind"])

    @property
    def title(self) -> str:
        """Title of the case, empty without one."""
        return str(self.attributes.get("title", ""))

    @property
    def convergence(self) -> dict[tuple[str, str], float]:
        """Relative changes with a finer model, by entry and place."""
        found = self.summary.get("convergence") or {}
        return {
            (entry, place): math.nan if change is None else change
            for entry, of in found.items()
            for place, change in (of if isinstance(of, dict) else {"": of}).items()
        }

    def keys(self, name: str) -> set[tuple[str, str]]:
        """Entries and places of a list such as ``doubtful``."""
        return {(entry, place) for entry, _, place in (key.partition(".") for key in self.summary.get(name) or ())}

    def labels(self, name: str) -> list[str]:
        """The values of a coordinate; none where it is missing."""
        return [str(x) for x in np.atleast_1d(self.data[name])] if name in self.data else []

    def row(self, dataset: str, coordinate: str, name: str) -> np.ndarray:
        """The row of a variable that belongs to a name."""
        return self.data[dataset][self.labels(coordinate).index(name)]

    @property
    def kept_modes(self) -> int:
        """Modes of the model."""
        return int(self.data["modes/kept_modes"])

    def first_mode(self, state: str) -> int | None:
        """Index of the first natural frequency of a state that is none of a rigid body."""
        frequencies = self.data.get(f"modes/{state}_frequencies_hz")
        elastic = [] if frequencies is None else [k for k, hz in enumerate(frequencies[: self.kept_modes]) if hz > 0.0]
        return elastic[0] if elastic else None


def _plain(value: Any) -> Any:
    value = value.item() if isinstance(value, np.generic) else value
    return value.decode() if isinstance(value, bytes) else value


Check = Callable[..., Iterator[str]]
"""Of facts, and what was recognised: yields contradictions."""


@dataclass(frozen=True)
class Rule:
    """What recognises a text, and what compares it with the file."""

    where: str  # verdict, statement, line, heading
    pattern: re.Pattern[str]
    check: Check


RULES: list[Rule] = []


def rule(where: str, pattern: str) -> Callable[[Check], Check]:
    """Declare how texts of a pattern are compared; ``Q`` in it is a quantity, ``N`` a number."""
    pattern = pattern.replace("<Q>", f"({QUANTITY})").replace("<N>", f"({NUMBER})")

    def declared(check: Check) -> Check:
        RULES.append(Rule(where, re.compile(pattern), check))
        return check

    return declared


def differs(facts: ResultFacts, text: str, value: float | None, unit: str, key: tuple[str, str] | None = None,
            digits: int = 3) -> Iterator[str]:  # fmt: skip
    """Contradictions between a printed quantity and a value.

    Parameters
    ----------
    facts : of the file.
    text : number and unit.
    value : SI; None and nan are unknown.
    unit : SI, in which the value is.
    key : entry and place of the summary, where its mark and its change with a finer model are known.
    digits : significant digits with which it is printed at least, unless its change supports no more.
    """
    if value is None or math.isnan(value):
        if text != "unknown":
            yield f"{text!r} is printed of what is not known"
        return
    if math.isinf(value):
        if text != "infinity":
            yield f"{text!r} is printed of what is infinite"
        return
    number, _, printed_unit = text.partition(" ")
    try:
        si_unit, factor = unit_of(printed_unit)
        if unit.startswith("kg") and printed_unit.endswith("g"):  # grams, with a prefix
            si_unit, factor = "kg", 1e-3 * PREFIXES[printed_unit[:-1]]
        float(number)
    except (KeyError, ValueError):
        yield f"{text!r} has no known unit"
        return
    if si_unit != unit and value != 0.0:
        yield f"{text!r} is in {si_unit}, its value in {unit}"
        return
    if key is not None and (change := facts.convergence.get(key)):
        digits = min(digits, max(math.ceil(-math.log10(change)), 1))
    if not rounds_to(number, value / factor, digits):
        yield f"{text!r} is printed of {value / factor:.6g} {printed_unit}"


def split_mark(text: str) -> tuple[str, str]:
    """A cell without the mark of a doubt, and the mark."""
    return (text[:-2], text[-1]) if text[-2:] in (" *", " ~", " ^") else (text, "")


def cell(facts: ResultFacts, text: str, value: float | None, unit: str, key: tuple[str, str]) -> Iterator[str]:
    """Contradictions of a cell: its number, its unit, and its mark of a doubt.

    Parameters
    ----------
    facts, text, value, unit, key : as of `differs`.
    """
    plain, mark = split_mark(text)
    yield from differs(facts, plain, value, unit, key)
    yield from wrong_mark(facts, text, mark, key)


def wrong_mark(facts: ResultFacts, text: str, mark: str, key: tuple[str, str]) -> Iterator[str]:
    """Contradictions between the mark of a cell and what the file says of its value."""
    facts.printed.add(key)
    jumps = facts.keys("without_limit")
    doubts = {"*": facts.keys("doubtful"), "~": facts.keys("after_divergence"), "^": jumps}
    right = next((each for each, keys in doubts.items() if key in keys), "")
    if mark != right:
        yield f"{text!r} has the mark {mark!r} where the file says {right!r} of {'.'.join(key)}"


@dataclass(frozen=True)
class Screen:
    """The parts of a first screen."""

    verdict: str
    statements: list[str]
    understood: str
    header: list[str]
    rows: list[list[str]]
    lines: list[str]
    foot: str


STARTS = (
    r"harmonic|random|sampled|matched|step\b|half sine|trapezoid|sawtooth|swept sine|steady sine|stepped sine|sine at|"
    r"first mode|no excitation|low-pass|run: |sweep: |polynomial"
)
WRAPPED = re.compile(rf"(?:{STARTS})|\d+ (?:grazing|fold|period|Neimark|nonsmooth|branch|symmetry|pitchfork)")
WIDTH = 160


def _unwrapped(lines: list[str]) -> list[str]:
    """Lines in which what was wrapped at `WIDTH` is one again."""
    whole: list[str] = []
    last = ""
    for line in lines:
        first = line.split(" ", 1)[0]
        if whole and first and WRAPPED.match(whole[-1]) and len(last) <= WIDTH < len(last) + 1 + len(first):
            whole[-1] += f" {line}"
        else:
            whole.append(line)
        last = line
    return whole


def read_screen(text: str, facts: ResultFacts, is_heading: Callable[[str], bool]) -> Screen:
    """Divide a screen into its parts."""
    first, *others = text.rstrip("\n").split("\n")
    if others[-1].startswith("processor time of the command "):  # which no file has
        others.pop()
    title = facts.title or first.partition("  ")[0]
    if not first.startswith(title):
        raise ValueError(f"the screen begins with {first!r}, not with the title")
    body, foot = _unwrapped(others[:-1]), others[-1]
    begin = next((k for k, line in enumerate(body) if _cells(line, is_heading)), None)
    before = body if begin is None else body[:begin]
    header, rows, end = [], [], begin
    if begin is not None:
        at = [m.start() for m in re.finditer(r"(?:(?<=   )|^)\S", body[begin])]
        at = at if at[0] == 0 else [0, *at]
        header = [body[begin][a:b].strip() for a, b in zip(at, [*at[1:], None], strict=True)]
        end = begin + 1
        while end < len(body) and _is_row(body[end], at):
            rows.append([body[end][a:b].strip() for a, b in zip(at, [*at[1:], None], strict=True)])
            end += 1
    after = [] if end is None else body[end:]
    understood = [line for line in before if re.match(STARTS, line)]
    statements = [line for line in before if not re.match(STARTS, line)]
    return Screen(first[len(title) :].strip(), statements, "; ".join(understood), header, rows, after, foot)


def _cells(line: str, is_heading: Callable[[str], bool]) -> bool:
    """Whether a line is the headings of a table."""
    found = [part for part in re.split(r" {3,}", line.strip()) if part]
    return bool(found) and (line[0] == " " or len(found) > 1) and all(map(is_heading, found))


def _is_row(line: str, at: list[int]) -> bool:
    """Whether a line has a cell below each heading."""
    return all(line[a - 3 : a].strip() == "" and line[a : a + 1].strip() != "" for a in at if a) and len(line) > at[-1]
