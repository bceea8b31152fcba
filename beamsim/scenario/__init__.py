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

from beamsim.scenario.beam import Beam, ElasticSupport, PointMass, SandwichBeam, SegmentedBeam, StiffnessBeam, Supports
from beamsim.scenario.body import Body, Located
from beamsim.scenario.chain import Chain
from beamsim.scenario.continuation import Continuation
from beamsim.scenario.damping import ModalDamping, RayleighDamping, ViscousDamping
from beamsim.scenario.designs import Grid, LatinHypercube, Sobol, Zipped
from beamsim.scenario.driven import AppliedTo
from beamsim.scenario.excitation import Excitation, HalfSine, Harmonic, MultiTone, NoExcitation, Step, Tone
from beamsim.scenario.identification import IdentifyStiffness, Pad
from beamsim.scenario.jsonschema import json_schema
from beamsim.scenario.limits import Limits
from beamsim.scenario.loading import load_scenario
from beamsim.scenario.nnm import (
    ContinueIn,
    EnergyContinuation,
    FrequencyContinuation,
    NonlinearMode,
    StiffnessFactorContinuation,
)
from beamsim.scenario.nnm_method import ExpansionMethod, FullPeriodMethod, RelaxedMinimisationMethod, ShootingMethod
from beamsim.scenario.place import AtPlace, ConstantForce, PlacedForce, Probe
from beamsim.scenario.quantities import Rate
from beamsim.scenario.run import (
    BodiesStart,
    ModeStart,
    PolynomialStart,
    Reduction,
    ReleasedForceStart,
    Run,
    SpectrumSettings,
)
from beamsim.scenario.scenario import Scenario
from beamsim.scenario.sections import GeneralSection, RectangleSection, SandwichSection, TubeSection
from beamsim.scenario.snubber import (
    BodySnubber,
    ChainSnubber,
    LinkSnubber,
    MassSnubber,
    Snubber,
    SnubberRatioDamping,
    SnubberViscousDamping,
)
from beamsim.scenario.spring import (
    CubicGroundSpring,
    CubicLinkSpring,
    GroundSpring,
    LinearGroundSpring,
    LinearLinkSpring,
    LinkSpring,
    PiecewiseLinearGroundSpring,
    PiecewiseLinearLinkSpring,
)
from beamsim.scenario.sweep import SteppedSine, Sweep, SweptSine
from beamsim.scenario.template import template

__all__ = [
    "AppliedTo",
    "AtPlace",
    "Beam",
    "BodiesStart",
    "Body",
    "BodySnubber",
    "Chain",
    "ChainSnubber",
    "ConstantForce",
    "Continuation",
    "ContinueIn",
    "CubicGroundSpring",
    "CubicLinkSpring",
    "ElasticSupport",
    "EnergyContinuation",
    "Excitation",
    "ExpansionMethod",
    "FrequencyContinuation",
    "FullPeriodMethod",
    "GeneralSection",
    "Grid",
    "GroundSpring",
    "HalfSine",
    "Harmonic",
    "IdentifyStiffness",
    "LatinHypercube",
    "Limits",
    "LinearGroundSpring",
    "LinearLinkSpring",
    "LinkSnubber",
    "LinkSpring",
    "Located",
    "MassSnubber",
    "ModalDamping",
    "ModeStart",
    "MultiTone",
    "NoExcitation",
    "NonlinearMode",
    "Pad",
    "PiecewiseLinearGroundSpring",
    "PiecewiseLinearLinkSpring",
    "PlacedForce",
    "PointMass",
    "PolynomialStart",
    "Probe",
    "Rate",
    "RayleighDamping",
    "RectangleSection",
    "Reduction",
    "RelaxedMinimisationMethod",
    "ReleasedForceStart",
    "Run",
    "SandwichBeam",
    "SandwichSection",
    "Scenario",
    "SegmentedBeam",
    "ShootingMethod",
    "Snubber",
    "SnubberRatioDamping",
    "SnubberViscousDamping",
    "Sobol",
    "SpectrumSettings",
    "Step",
    "SteppedSine",
    "StiffnessBeam",
    "StiffnessFactorContinuation",
    "Supports",
    "Sweep",
    "SweptSine",
    "Tone",
    "TubeSection",
    "ViscousDamping",
    "Zipped",
    "json_schema",
    "load_scenario",
    "template",
]
