"""The shipped configs, each loaded once in a process."""

from functools import cache
from pathlib import Path

from beamsim.scenario import Scenario, load_scenario

PATHS = sorted((Path(__file__).parents[2] / "configs").glob("*.yaml"))


@cache
def shipped(path: Path) -> Scenario:
    """The scenario of a shipped config, as it stands."""
    return load_scenario(path)
