"""Scenarios: the YAML a user writes, checked, in SI units, with located errors.

Never here: numerics, apart from unit conversion and what a default value needs.
Begin with `scenario`, the whole scenario and how it is read; every section has a module of its own.

>>> from beamsim.scenario import load_scenario
>>> scenario = load_scenario('''
... chain: {masses: [1, 1], springs: [1, 1, 1]}
... excitation: {kind: harmonic, applied_to: {mass: 2}, level: 0.1 N, frequency: 0.8 rad/s}
... ''')
>>> round(scenario.excitation.frequency, 6)
0.127324
"""

from __future__ import annotations

from beamsim.scenario.scenario import Scenario, Source, load_scenario, scenario_of, template

__all__ = ["Scenario", "Source", "load_scenario", "scenario_of", "template"]
