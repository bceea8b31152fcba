"""What the continuation of forced periodic motions hands back."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from beamsim.analyses.orbit_events import OrbitEvent
from beamsim.analyses.result import Result
from beamsim.analyses.sweep.result import SweepCurve
from beamsim.system.structural import ModeTable
from beamsim.typing import Bools, Complexes, Floats


@dataclass(frozen=True)
class ResponseBranch:
    """A branch of forced periodic motions at one level."""

    level: float  # SI; nan where the level is what is followed
    period_multiple: int  # periods of the excitation in one of the motion
    status: str
    frequency_hz: Floats  # (np,) of the excitation
    peak_displacement: dict[str, Floats]  # probe -> (np,) m, largest absolute value
    max_displacement: dict[str, Floats]  # probe -> (np,) m
    min_displacement: dict[str, Floats]  # probe -> (np,) m
    harmonics: dict[str, Complexes]  # probe -> (np, 6) amplitudes at the orders 0 to 5 of the motion's own frequency, m
    peak_force: dict[str, Floats]  # snubber -> (np,) N
    stable: Bools  # (np,)
    floquet_multipliers: Complexes  # (np, N)
    residual: Floats  # (np,)
    special: tuple[OrbitEvent, ...] = ()
    parameter: Floats = field(default_factory=lambda: np.zeros(0))  # (np,) what is followed: Hz, m/s^2, N, m or N/m
    peak_acceleration: dict[str, Floats] = field(default_factory=dict)  # probe -> (np,) m/s^2, absolute
    contact_share: dict[str, Floats] = field(default_factory=dict)  # snubber -> (np,)
    # (np,) largest values of what limits ask for beyond the above: "bending_stress" Pa, "gap <snubber>" m
    limited: dict[str, Floats] = field(default_factory=dict)
    neglected_harmonics: Floats | None = None  # (np,) of harmonic balance: what they are worth, against the motion


@dataclass(frozen=True)
class FoldCurveResult:
    """A fold of a curve in frequency, followed in a second parameter."""

    level: float  # SI; nan where the level is the second parameter
    branch: int  # the branch whose fold it is
    start_hz: float  # where that fold is
    touching: str  # the contact that is just touched all along, where the curve turns back at it; else empty
    status: str
    frequency_hz: Floats  # (np,)
    parameter: Floats  # (np,) the second parameter, SI
    peak_displacement: dict[str, Floats]  # probe -> (np,) m
    residual: Floats  # (np,)


@dataclass(frozen=True)
class OverlayCurve:
    """A swept or stepped sine laid over the curve."""

    source: str  # the file it comes from; empty where it was computed with the curve
    title: str
    curve: SweepCurve


@dataclass(frozen=True)
class ForcedExpansionComparison:
    """Steady motions near a mode by multiple scales, at one level, and how far they are from the exact ones.

    The small factor multiplies springs, dashpots, damping and force together; 1 is the case itself.
    """

    level: float  # SI unit of the excitation
    mode: int  # from 1
    linear_frequency_hz: float
    frequency_hz: Floats  # (np,) along the curve at a factor of one, through its tip
    stable: Bools  # (np,) by the slow flow
    leading: dict[str, Floats]  # probe -> (np,) m, largest deflection of a period, to leading order
    first: dict[str, Floats]  # probe -> (np,) m, with the first-order correction
    backbone_hz: Floats  # (np,) frequency of the nonlinear mode with the same leading amplitude, to first order
    factor: Floats  # (E,) falling
    factor_frequency_hz: Floats  # (E,) excitation's: the detuning shrinks with the factor
    difference: Floats  # (E, 2) largest of a period, against the motion's size; leading and first order; nan: none near
    orders: Floats  # (E - 1, 2) observed; 1 and 2 expected
    stability_agrees: Bools  # (E,) the exact multipliers say what the slow flow says


@dataclass(frozen=True)
class FrequencyResponse(Result):
    """Everything `beamsim sweep` of kind continuation computes."""

    branches: tuple[ResponseBranch, ...]
    modes: ModeTable
    parameter: str = "frequency"  # what is followed: frequency, level, gap, stiffness or position
    unit: str = "Hz"
    snubber: str = ""  # whose number is followed
    level_unit: str = ""  # of the branches' levels
    method: str = "shooting"
    fold_curves: tuple[FoldCurveResult, ...] = ()
    second_parameter: str = ""  # what folds are followed in; empty where they are not
    second_unit: str = ""
    second_snubber: str = ""
    overlay: dict[str, OverlayCurve] = field(default_factory=dict)  # by the name of its group in the file
    expansion: tuple[ForcedExpansionComparison, ...] = ()  # for weak springs, where it was asked for
