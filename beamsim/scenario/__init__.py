"""Scenarios: the YAML a user writes, checked, in SI units, with located errors.

Never here: numerics, apart from the units and what a default needs.
Begin with `scenario`, the whole, and `loading`; every section has a module of its own.

>>> from beamsim.scenario import load_scenario
>>> scenario = load_scenario('''
... chain: {masses: [1, 1], springs: [1, 1, 1]}
... excitation: {kind: harmonic, applied_to: {mass: 2}, level: 0.1 N, frequency: 0.8 rad/s}
... ''')
>>> round(scenario.excitation.frequency, 6)
0.127324
"""

from __future__ import annotations

from beamsim.scenario.beam import Beam
from beamsim.scenario.body import AtPlace, Located, ModalDamping, RayleighDamping
from beamsim.scenario.chain import Chain
from beamsim.scenario.connections import (
    LinkSnubber,
    Snubber,
    SnubberRatioDamping,
    SnubberViscousDamping,
)
from beamsim.scenario.excitation import Excitation, HalfSine, Harmonic, MultiTone, NoExcitation, Step
from beamsim.scenario.loading import load_scenario, template
from beamsim.scenario.quantities import Rate
from beamsim.scenario.reporting import Limits
from beamsim.scenario.run import ModeStart, PolynomialStart, ReleasedForceStart, Run, SpectrumSettings
from beamsim.scenario.scenario import Scenario
from beamsim.scenario.sweep import EnergyContinuation, StiffnessFactorContinuation, SweptSine

__all__ = [
    "AtPlace",
    "Beam",
    "Chain",
    "EnergyContinuation",
    "Excitation",
    "HalfSine",
    "Harmonic",
    "Limits",
    "LinkSnubber",
    "Located",
    "ModalDamping",
    "ModeStart",
    "MultiTone",
    "NoExcitation",
    "PolynomialStart",
    "Rate",
    "RayleighDamping",
    "ReleasedForceStart",
    "Run",
    "Scenario",
    "Snubber",
    "SnubberRatioDamping",
    "SnubberViscousDamping",
    "SpectrumSettings",
    "Step",
    "StiffnessFactorContinuation",
    "SweptSine",
    "load_scenario",
    "template",
]
