"""Modes of the structure of a scenario at a snubber."""

from __future__ import annotations

import numpy as np

from beamsim.scenario import Scenario
from beamsim.structures.assembly import assemble, snubber_site
from beamsim.structures.modes import DENSE_LIMIT, natural_modes
from beamsim.structures.places import Place
from beamsim.structures.reduction import reduce_model
from beamsim.structures.secular import SpringPoint
from beamsim.structures.structure import LoadPattern
from beamsim.typing import Floats


def snubber_point(scenario: Scenario, name: str, requested: int = 1) -> SpringPoint:
    """Modes of the bodies that a snubber acts on, every contact open: all of the finite-element model's.

    A model with more degrees of freedom than `DENSE_LIMIT` gives `requested` + 60 modes and the static vector of the
    snubber, which carries the static compliance of the rest.
    """
    snubber = scenario.located_snubber(name)
    model, site = assemble(scenario, snubber.bodies), snubber_site(snubber)
    row = model.row(site)
    if model.size <= DENSE_LIMIT:
        modes = natural_modes(model)
        omega, vectors = modes.omega, modes.vectors
    else:
        patterns = [LoadPattern(model.row(loaded), loaded) for loaded in model.loaded_sites([site])]
        # 60: Modes of a large model that are kept beyond those requested; a static vector represents the others.
        basis = reduce_model(model, patterns, count=requested + 60)
        omega, vectors = basis.omega, basis.vectors
    return SpringPoint.of_modes(omega * model.frequency_scale, row @ vectors / np.sqrt(model.mass_scale))


def free_frequencies(scenario: Scenario, snubber: str, count: int) -> Floats:
    """Natural frequencies, every contact open, of the bodies that a snubber acts on, Hz.

    Zeros of rigid-body modes come first, then `count` others (or all there are).
    """
    model = assemble(scenario, scenario.located_snubber(snubber).bodies)
    count += model.rigid.shape[1]
    return np.asarray(natural_modes(model, count=count).omega[:count] * model.frequency_scale / (2 * np.pi))


def mode_shapes(scenario: Scenario, snubber: str, count: int, positions: tuple[float, ...]) -> tuple[Floats, Floats]:
    """Modes, every contact open, of the one body that a snubber acts on; rigid-body modes left out.

    Returns
    -------
    (count,) natural frequencies, Hz, and (count, p) deflections at the p positions.
    """
    bodies = scenario.located_snubber(snubber).bodies
    model = assemble(scenario, bodies)
    rigid = model.rigid.shape[1]
    modes = natural_modes(model, count=count + rigid).first(count + rigid)
    frequencies = modes.omega[rigid:] * model.frequency_scale / (2 * np.pi)
    return np.asarray(frequencies), np.asarray(
        (model.rows([Place(bodies[0], x) for x in positions]) @ modes.vectors[:, rigid:]).T
    )
