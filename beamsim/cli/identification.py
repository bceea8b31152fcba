"""Command ``identify-stiffness``."""

from __future__ import annotations

from beamsim.analyses.identify.analysis import identify_stiffness
from beamsim.cli.command import compute_and_save, load_for_command
from beamsim.cli.session import CommandOptions
from beamsim.measurements.channels import read_tests


def identify(options: CommandOptions) -> None:
    """Identify stiffness and damping of stops from tests."""
    scenario, target = load_for_command("identify-stiffness", options)
    settings = scenario.identify_stiffness
    has_tests = settings is not None and settings.nonlinear is not None
    compute_and_save(
        "identify-stiffness", target, options,
        lambda progress, stop: identify_stiffness(
            scenario, read_tests(scenario) if has_tests else (), progress, stop
        ),
        f"identifying {options.case.name}",
    )  # fmt: skip
