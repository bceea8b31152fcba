r"""How the stiffness behind a frequency depends on every number of the structure.

At a fixed frequency :math:`k = -1 / (s^T D^{-1} s)` with the dynamic stiffness :math:`D = K - \omega^2 M` and the
deflection row s of the spring's point. With the closed structure's mode scaled as :math:`v = k D^{-1} s`,

.. math:: \frac{\partial k}{\partial p} = -v^T \frac{\partial D}{\partial p} v + 2 k\, \frac{\partial s}{\partial p} v,

one linear solve for all parameters. The beam's length follows from the others because k, made
adimensional, depends on adimensional numbers only.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.structures.assembly import assemble, snubber_site
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.scenario import Scenario
    from beamsim.structures.structure import Path, Structure


def stiffness_sensitivities(scenario: Scenario, snubber: str, omega: float) -> dict[Path, float]:
    """d ln k / d ln p by place, k being the stiffness at the snubber that makes omega (rad/s) a natural frequency.

    What sits on the beam's end moves with it when the length changes.
    """
    structure = assemble(scenario)
    contact = scenario.located_snubber(snubber)
    site = snubber_site(contact)
    squared = (omega / structure.frequency_scale) ** 2
    v, k = _mode(structure, structure.row(site), squared)
    return structure.sensitivities(scenario.body_path(structure.name), site, contact.path, v, k, squared)


def _mode(model: Structure, row: Floats, squared: float) -> tuple[Floats, float]:
    """Scaled mode v and scaled stiffness k at a scaled omega^2."""
    stiffness: Any = model.factor.T @ model.factor
    dynamic = stiffness - squared * model.mass
    if model.size <= 400:
        x = np.linalg.solve(dynamic.toarray(), row)
    else:
        from scipy.sparse.linalg import spsolve

        x = np.asarray(spsolve(dynamic.tocsc(), row))
    k = -1.0 / float(row @ x)
    return k * x, k
