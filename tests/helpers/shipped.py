"""The shipped configs, each loaded once in a process."""

import re
from collections.abc import Collection
from functools import cache
from pathlib import Path

import yaml

from beamsim.scenario import Scenario, load_scenario

CONFIGS = Path(__file__).parents[2] / "configs"
PATHS = sorted(CONFIGS.rglob("*.yaml"), key=lambda path: path.stem)
LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # the compiled one where there is one
COMMANDS = {"run": "run", "sweep": "sweep", "nnm": "nnm", "identify_stiffness": "identify-stiffness"}
"""Section -> command; studies are in test_design_configs.py."""


def config_path(name: str) -> Path:
    """The file of a shipped config by its name, which is unique in all folders."""
    (path,) = (path for path in PATHS if path.stem == name)
    return path


@cache
def shipped(path: Path) -> Scenario:
    """The scenario of a shipped config, as it stands."""
    return load_scenario(path)


def _sort(value, key=""):
    """What a part of a scenario is but for titles, names, files and the size of its numbers."""
    if isinstance(value, dict):
        return {name: _sort(part, name) for name, part in value.items() if name not in ("title", "name", "file")}
    if isinstance(value, (list, tuple)):
        parts = [_sort(part, key) for part in value]
        return parts if parts and isinstance(parts[0], dict) else sorted({repr(part) for part in parts})
    return (value > 0) - (value < 0) if isinstance(value, (int, float)) and not isinstance(value, bool) else value


@cache
def _sort_of(path: Path, without: frozenset[str]) -> str:
    written = shipped(path).model_dump(exclude_unset=True, by_alias=True)
    return repr(_sort({name: part for name, part in written.items() if name not in without}))


def one_of_each_sort(paths: list[Path], without: Collection[str] = ()) -> list[Path]:
    """The first of those shipped configs that differ only in names and in the size of numbers, such as frequencies.

    What they have in the sections `without` does not tell them apart.
    """
    first: dict[str, Path] = {}
    for path in paths:
        first.setdefault(_sort_of(path, frozenset(without)), path)
    return list(first.values())


def asked(path):
    """The commands that a config has a section for: of its own, or where it has none, of the file that it extends."""
    scenario, own = shipped(path), yaml.load(path.read_text(encoding="utf-8"), LOADER)
    sections = [section for section in COMMANDS if getattr(scenario, section) is not None]
    sections = [section for section in sections if section in own] or (
        [] if {"vary", "optimise"} & own.keys() else sections
    )
    if not sections and scenario.study is None and not scenario.excitation.items:
        return ["static"]
    return [COMMANDS[section] for section in sections if not (section == "sweep" and scenario.study is not None)]


def unfit(scenario, texts):
    """Notes that advise what a scenario has, or what changes nothing in it."""
    written = {
        r"run\.low_pass": scenario.run is not None and scenario.run.low_pass is not None,
        r"run\.impacts": scenario.run is not None and scenario.run.impacts is not None,
        r"give reduction": scenario.reduction is not None,
        r"raise reduction\.|leave reduction out": scenario.reduction is None,
        r"elements": not scenario.has_mesh,
    } | {
        rf"snubbers\.{re.escape(snubber.name)}: .*law: no_tension": snubber.law == "no_tension"
        for snubber in scenario.all_snubbers
    }
    yield from (text for text in texts for advice, there in written.items() if there and re.search(advice, text))
