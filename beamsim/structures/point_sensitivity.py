r"""How the stiffness behind a frequency depends on every number of the structure.

At a fixed frequency :math:`k = -1 / (s^T D^{-1} s)` with the dynamic stiffness :math:`D = K - \omega^2 M` and the
deflection row s of the spring's point. With the closed structure's mode scaled as :math:`v = k D^{-1} s`,

.. math:: \frac{\partial k}{\partial p} = -v^T \frac{\partial D}{\partial p} v + 2 k\, \frac{\partial s}{\partial p} v,

one linear solve for all parameters. The beam's length follows from the others because k, made
adimensional, depends on adimensional numbers only.

A spring between two bodies that nothing else joins has :math:`1/k = 1/k_1 + 1/k_2`, with the stiffness
:math:`k_i` that would give body i alone the frequency.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.structures.assembly import assemble, snubber_site
from beamsim.structures.places import spring_ends
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.scenario import Scenario
    from beamsim.structures.structure import Path, Structure


def stiffness_sensitivities(scenario: Scenario, snubber: str, omega: float) -> dict[Path, float]:
    """d ln k / d ln p by place, k being the stiffness at the snubber that makes omega (rad/s) a natural frequency.

    The numbers are those of the bodies that the snubber acts on. What sits on a beam's end moves with it when the
    length changes.
    """
    contact = scenario.located_snubber(snubber)
    paths = [(*contact.path, *path) for path in contact.item.place_paths]
    ends = spring_ends(snubber_site(contact), paths)
    compliance: dict[str, float] = {}
    rates: dict[str, dict[Path, float]] = {}
    for name in contact.bodies:
        body = assemble(scenario, [name])
        squared = (omega / body.frequency_scale) ** 2
        on_body = [end for end in ends if end.place.body == name]
        row = np.sum([end.sign * body.deflection_row(end.place) for end in on_body], axis=0)
        if not row.any():  # a support: the body adds no compliance
            continue
        v, k = _mode(body, row, squared)
        compliance[name] = 1.0 / (k * body.stiffness_scale)
        rates[name] = body.sensitivities(scenario.body_path(name), on_body, v, k, squared)
    total = sum(compliance.values())
    return {path: compliance[name] / total * rate for name, part in rates.items() for path, rate in part.items()}


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
