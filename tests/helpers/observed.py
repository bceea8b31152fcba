"""Channels of systems, and rows of a test's own, as outputs of a flow."""

from __future__ import annotations

import numpy as np

from beamsim.flow.channels import outputs_of
from beamsim.flow.exact import ExactFlow
from beamsim.results.values import ACCELERATION
from beamsim.system.equations import RowsOf, Sizes
from beamsim.system.structural import StructuralSystem


def all_outputs(system: StructuralSystem, flow: ExactFlow) -> RowsOf:
    """All channels of a system that are no energies."""
    return outputs_of(flow, system.channels.linear)


def accelerations(system: StructuralSystem, flow: ExactFlow) -> RowsOf:
    """Absolute accelerations of the probes."""
    return outputs_of(flow, system.channels.of_keys(ACCELERATION).linear)


def rows(flow: ExactFlow, count: int, **given: object) -> RowsOf:
    """Rows of which some parts are given, the others being zero."""
    dynamics = flow.system
    sizes = Sizes(dynamics.size, dynamics.contacts.count, len(flow.forcing.signal), 0)
    return outputs_of(flow, sizes.rows(count, **given))


def velocities(flow: ExactFlow) -> RowsOf:
    """Velocities of all coordinates."""
    return rows(flow, flow.system.size, velocity=np.eye(flow.system.size))
