"""Names of degrees of freedom, as finite-element programs give them: a node and a direction."""

from __future__ import annotations

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
"""Directions of a node in the order of their numbers 1 to 6."""
MODAL = "modal"
"""Direction of a coordinate that belongs to no node: a mode, or a scalar point."""

Dof = tuple[int, str]
"""Node and direction."""
