"""The shipped configs, each loaded once in a process."""

from functools import cache
from pathlib import Path

import yaml

from beamsim.scenario import Scenario, load_scenario

PATHS = sorted((Path(__file__).parents[2] / "configs").glob("*.yaml"))
COMMANDS = {"run": "run", "sweep": "sweep", "nnm": "nnm", "identify_stiffness": "identify-stiffness"}
"""Section -> command; studies are in test_design_configs.py."""


@cache
def shipped(path: Path) -> Scenario:
    """The scenario of a shipped config, as it stands."""
    return load_scenario(path)


def asked(path):
    """The commands that a config has a section for: of its own, or where it has none, of the file that it extends."""
    scenario, own = shipped(path), yaml.safe_load(path.read_text(encoding="utf-8"))
    sections = [section for section in COMMANDS if getattr(scenario, section) is not None]
    sections = [section for section in sections if section in own] or (
        [] if {"vary", "optimise"} & own.keys() else sections
    )
    return [COMMANDS[section] for section in sections if not (section == "sweep" and scenario.study is not None)]
