"""Maxwell branches: what makes a pad or a spring relax."""

from __future__ import annotations

from beamsim.scenario.base import Schema
from beamsim.scenario.quantities import Duration, NonNegativeStiffness


class Maxwell(Schema):
    """A spring in series with a dashpot, beside what it is given for."""

    stiffness: NonNegativeStiffness
    """Stiffness of its spring: what a sudden deflection adds."""
    relaxation_time: Duration
    """Time in which its force falls by the factor e at a constant deflection: dashpot over stiffness."""
