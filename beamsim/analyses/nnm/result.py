"""The result of ``beamsim nnm``: branches of nonlinear normal modes, one motion, and comparisons."""

from __future__ import annotations

import numpy as np

from beamsim.analyses.branch import ModeBranch, OrbitMotion
from beamsim.analyses.result import CONVERGENCE, PROCESSOR_TIME, STATUS, Result
from beamsim.fields import (
    Counter,
    Entry,
    attribute,
    axis,
    dataset,
    declared,
    ending,
    group,
    members,
    per_probe,
    stored,
    table,
)
from beamsim.outcomes import Outcome
from beamsim.structures.stations import Stations
from beamsim.system.structural import ModeTable
from beamsim.typing import Bools, Complexes, Floats, Ints

SAFELY = 3.0  # factors this much below the expansion's reach count as small
UNITS = {"stiffness_factor": "1", "energy": "J", "frequency": "Hz"}

_POINT = (Counter("point", "number of the point along the branch"),)
_FACTOR = ("factor",)
_ORDER = ("factor", Counter("order", "order of the expansion", 0))
_STEP = (Counter("step", "number of the step"), _ORDER[1])
_STATIONS = ("instants", "position")


@declared
class BranchJump:
    """A gap in a backbone where an internal resonance cuts it."""

    start: float = dataset("{unit}", "parameter of the last point before")
    end: float = dataset("{unit}", "parameter of the first point beyond")
    mode: int = dataset("1", "the other mode, from 1; 0 where unknown")
    ratio: int = dataset("1", "n of n:1; 0 where unknown")


# --- The damped structure held on its mode ---------------------------------------------------------------------------


@declared(along=_POINT)
class PredictedLevels:
    """The level that energy balance asks for along a backbone."""

    energy: Floats = dataset("J", "energy from static equilibrium")
    frequency_hz: Floats = dataset("Hz", "frequency of the motion")
    level: Floats = dataset("{unit}", "level of the excitation that holds the motion")
    dissipated: Floats = dataset("J", "energy taken by damping in a period")
    contact_share: Floats = dataset("1", "share of it that the contacts' dashpots take")
    amplitude: dict[str, Floats] = per_probe("m", "largest deflection of a period")


@declared(along=_POINT)
class ResponseAboutResonance:
    """Forced periodic motions about a resonance."""

    outcome: Outcome = ending("how the branch ended")
    frequency_hz: Floats = dataset("Hz", "frequency of the excitation")
    peak_displacement: dict[str, Floats] = per_probe("m", "largest deflection of a period", name="amplitude")
    stable: Bools = dataset("1", "whether the motion is stable", flags=("unstable", "stable"))
    energy_error: Floats = dataset("1", "imbalance of the energies over a period, relative to the energy")


@declared
class HeldMotion:
    """The damped structure from a state of the mode on, under the predicted force."""

    time: Floats = axis("s", "time")  # (nt,) whole periods, the end left out
    displacement: dict[str, Floats] = per_probe("m", "displacement", along=("time",))
    frequency_hz: Floats = axis("Hz", "frequency of the line")  # (nf,) over all these periods
    amplitude: dict[str, Floats] = per_probe(
        "m", "amplitude of the line, zero to peak", along=("frequency_hz",), name="line"
    )
    departure: Floats = dataset(  # in the norm of energy, against the mode's
        "1", "largest distance from the mode in a period, in energy", along=(Counter("period", "number of the period"),)
    )
    instants: Floats = axis("s", "instants in the last period at which the mode is at rest")  # (2,)
    shapes: Floats = dataset("m", "deflection of the held structure at that instant", along=_STATIONS)
    mode_shapes: Floats = dataset("m", "deflection of the mode at that instant", along=_STATIONS)


@declared(kw_only=True)
class ResonantMotion:
    """One level: the mode it should hold, and the forced motion that is found."""

    level: float = attribute("{unit}", "level of the excitation")
    predicted_frequency_hz: float = attribute("Hz", "frequency of the motion predicted")
    predicted_energy: float = attribute("J", "its energy")
    predicted_amplitude: dict[str, float] = per_probe("m", "its largest deflection")
    found: bool = attribute(
        "", "whether the exact motion was found; the fields that derive from it are NaN where it was not"
    )
    frequency_hz: float = attribute("Hz", "frequency of the exact motion")
    amplitude: dict[str, float] = per_probe("m", "its largest deflection")
    level_for_amplitude: float = attribute("{unit}", "level predicted for the amplitude found at the probe")
    stable: bool = attribute("", "whether it is stable")
    floquet_multipliers: Complexes = dataset("1", "Floquet multipliers", along=(Counter("multiplier", "number", 0),))
    residual: float = attribute("1", "largest periodicity error, relative to the size of the motion")
    quadrature: float = attribute("1", "cosine of the lag between force and deflection")
    curve: ResponseAboutResonance | None = group("curve", ResponseAboutResonance, default=None)
    held: HeldMotion | None = group("held", HeldMotion, default=None)
    energy_error: float = attribute(
        "1", "imbalance of the energies over a period, relative to the energy", default=float("nan")
    )


@declared
class PhaseResonanceResult:
    """A nonlinear mode held by a force, at several levels."""

    outcome: Outcome = ending("whether every level's motion was found")
    quantity: str = attribute("", "of the level: force, acceleration, velocity or displacement")
    unit: str = attribute("", "unit of the level")
    probe: str = attribute("", "probe whose amplitude is compared: the one that moves most")
    # no gap, no load
    scales: bool = attribute("", "whether the level is proportional to the amplitude at a constant frequency")
    predicted: PredictedLevels = group("predicted", PredictedLevels)
    motions: tuple[ResonantMotion, ...] = members("levels", ResonantMotion)

    @property
    def status(self) -> str:
        """complete, or the levels without a motion."""
        return self.outcome.text

    @property
    def complete(self) -> bool:
        """Whether every level's motion was found."""
        return self.outcome.complete


# --- Other methods beside the exact motions --------------------------------------------------------------------------


@declared
class ExpansionPath:
    """Frequency and initial condition of a nonlinear normal mode against the stiffness factor, to orders 0, 1 and 2."""

    mode: int = attribute("1", "number of the mode")
    energy: float = attribute("J", "energy from static equilibrium")
    linear_frequency_hz: float = attribute("Hz", "natural frequency")
    first_hz: float = attribute("Hz", "change of the frequency per factor, at the linear mode's amplitude")
    second_hz: float = attribute("Hz", "change of the frequency per squared factor")
    factor: Floats = axis("1", "stiffness factor")
    frequency_hz: Floats = dataset("Hz", "frequency to each order", along=_ORDER)  # (E, 3)
    # (E, 3, n) the shape at rest at t = 0
    coordinates: Floats = dataset("kg^0.5 m", "initial vector to each order", along=(*_ORDER, "coordinate"))
    initial_displacement: Floats = dataset("m", "deflection at rest to each order", along=(*_ORDER, "position"))
    partner: int = attribute("1", "mode with the largest first-order component")
    harmonic: int = attribute("1", "its harmonic")
    reach: float = attribute("1", "factors should be well below this one")
    uniform_coordinates: Floats = dataset(
        "kg^0.5 m", "initial vector of the uniform expansion to each order", along=(*_ORDER, "coordinate")
    )
    pole: float = attribute("1", "factor above which the initial vector is not yet at its asymptotic order")
    pole_mode: int = attribute("1", "mode whose coordinate it is; 0 for none")
    pole_harmonic: int = attribute("1", "harmonic that is close to it")

    @property
    def small(self) -> float:
        """Factors up to this one count as small."""
        return self.reach / SAFELY * (1.0 + 1e-9)


@declared(along=_FACTOR)
class ExactModes:
    """Exact motions at the same energy (shooting); nan where none was found near the expansion."""

    frequency_hz: Floats = dataset("Hz", "frequency by shooting")
    coordinates: Floats = dataset("kg^0.5 m", "coordinates at rest", along=("factor", "coordinate"))
    initial_displacement: Floats = dataset("m", "deflection at rest", along=("factor", "position"))
    residual: Floats = dataset("1", "largest periodicity error, relative to the size of the motion")


@declared(along=_STEP)
class ExpansionComparison:
    """Expansion against exact motion."""

    path: ExpansionPath = group("", ExpansionPath)
    exact: ExactModes = group("exact", ExactModes)
    frequency_difference: Floats = dataset("1", "relative error of the frequency to each order", along=_ORDER)
    initial_difference: Floats = dataset(
        "1", "error of the initial vector to each order, in the norm of the linear strain energy", along=_ORDER
    )
    frequency_orders: Floats = dataset(
        "1", "observed orders of the frequency's difference between neighbouring factors"
    )
    initial_orders: Floats = dataset(
        "1", "observed orders of the initial vector's difference between neighbouring factors"
    )
    expected_orders: Floats = dataset("1", "expected orders of the initial vector, by the uniform expansion")
    uniform_difference: Floats = dataset(
        "1", "error of the uniform expansion's initial vector to each order", along=_ORDER
    )
    uniform_orders: Floats = dataset("1", "observed orders of the uniform expansion's initial vector")


@declared(along=_FACTOR)
class RelaxedComparison:
    """A path of relaxed minimisation, step by step, and the exact motions at the same factors."""

    steps: int = attribute("1", "steps asked for")
    tolerance: float = attribute("1", "tolerance of the functional")
    outcome: Outcome = ending("how the path ended")
    factor: Floats = axis("1", "stiffness factor")  # (S,) of the steps taken; the last may not have been reached
    frequency_hz: Floats = dataset("Hz", "frequency")
    functional: Floats = dataset("1", "functional over twice the energy at the end of its minimisation")
    passages: Ints = dataset("1", "motions computed")
    processor_time_s: Floats = dataset("s", "processor time")
    reached: Bools = dataset("1", "whether the functional fell below the tolerance", flags=("no", "yes"))
    coordinates: Floats = dataset("kg^0.5 m", "coordinates at rest", along=("factor", "coordinate"))
    initial_displacement: Floats = dataset("m", "deflection at rest", along=("factor", "position"))
    # nan where a tongue cuts it
    exact_frequency_hz: Floats = dataset("Hz", "frequency of the backbone by shooting")
    frequency_difference: Floats = dataset("1", "difference of the frequency from the backbone, relative")
    shape_difference: Floats = dataset(
        "1", "difference of the shape from the backbone, relative, in the norm of the linear strain energy"
    )
    fate: tuple[str, ...] = dataset("1", "exact motion near it: same, other, none or between")
    jumped: Bools = dataset("1", "whether the step left the motion that the one before was on", flags=("no", "yes"))
    shooting_passages: int = attribute("1", "motions computed for the backbone, its tongues and the same factors")
    shooting_processor_time_s: float = attribute("s", "processor time of shooting")

    @property
    def status(self) -> str:
        """complete, or why it ended early."""
        return self.outcome.text

    @property
    def steps_reached(self) -> int:
        """Number of steps whose functional fell below the tolerance."""
        return int(np.count_nonzero(self.reached))

    @property
    def cost_ratio(self) -> float:
        """Processor time over that of shooting."""
        return float(self.processor_time_s.sum() / max(self.shooting_processor_time_s, 1e-9))


# --- The result ------------------------------------------------------------------------------------------------------

_SUMMARY = (
    STATUS,
    Entry("mode", of="mode", label="backbone"),
    Entry("continued_in", of="parameter"),
    Entry("points", "1", "points of the backbone"),
    Entry("energy_error", "1", "largest change of the energy along a motion of any branch, relative to the energy"),
    Entry("stable_points", "1", "those of them that are stable"),
    Entry("start", "", "first point of the backbone: parameter, frequency, energy", "start"),
    Entry("end", "", "last point of the backbone: parameter, frequency, energy", "end"),
    Entry("period_s", "s", "period of the last point"),
    Entry("linear_frequency_hz", "Hz", "frequency of the linear mode", "linear frequency"),
    Entry("internal_resonances", "", "by tongue: mode, ratio, parameter where it leaves the backbone, points",
             "internal resonances"),
    Entry("jumps", "", "gaps of the backbone at tongues: start and end in the parameter, mode and ratio where known",
             "jumps over tongues"),
    Entry("grazings", "1", "grazing contacts along the backbone", "grazings"),
    Entry("special_points", "", "folds and branch points of the backbone: kind, parameter, frequency",
             "special points"),
    Entry("requested_points", "", "points at the energies and frequencies asked for: quantity, value, branch and point "
             "(from 1), parameter, frequency, energy, share, stable or not", "points asked for"),
    Entry("full_period", "", "of full-period shooting: difference from half-period shooting, symmetry breakings and "
             "branches of non-brake orbits", "full period"),
    Entry("multiple_scales", "", "of the expansion: frequencies, differences from exact motions and observed orders",
             "multiple scales"),
    Entry("thesis", "", "of relaxed minimisation: steps, functional, differences from exact motions and cost",
             "relaxed minimisation"),
    Entry("phase_resonance", "", "of forced motions at phase resonance: quantity, unit, probe, and level by level "
             "what was predicted and found", "phase resonance"),
    Entry("motion_frequency_hz", "Hz", "frequency of the motion that is drawn"),
    Entry("motion_drift", "1", "how far it is from its start after the periods of its spectrum, relative", "spectrum",
             "motion.drift"),
    Entry("motion_periods", "1", "number of these periods", of="motion.periods"),
    Entry("largest_residual", "1", "largest residual of the periodicity condition along the backbone",
             "largest residual"),
    Entry("smallest_share", "1", "smallest share of the energy in the mode at the slowest instant, along the backbone",
             "share of energy"),
    *CONVERGENCE,
    PROCESSOR_TIME,
)  # fmt: skip


@declared
class NormalModeResult(Result):
    """Everything `beamsim nnm` computes."""

    SUMMARY = _SUMMARY

    mode: int = attribute("1", "number of the mode")
    parameter: str = attribute("", "stiffness_factor, energy or frequency", name="continued_in")
    method: str = attribute("", "shooting, full_period, multiple_scales or relaxed_minimisation")
    stations: Stations = group("", Stations)  # before what is along them
    branches: tuple[ModeBranch, ...] = members("branches", ModeBranch)  # the backbone first
    jumps: tuple[BranchJump, ...] = table("jumps", BranchJump, Counter("jump", "number of the jump"))
    linear_shape: Floats = dataset(
        "m", "linear mode with the largest deflection of the motion that is drawn", along=("position",)
    )
    motion_branch: int = attribute("1", "branch whose motion is drawn: the backbone, or the first non-brake branch")
    motion_point: int = attribute("1", "point of it: the last, or the furthest from rest")
    modes: ModeTable = group("modes", ModeTable)
    phase_resonance: PhaseResonanceResult | None = group(
        "phase_resonance", PhaseResonanceResult, default=None
    )  # where asked for, as the rest
    expansion: ExpansionComparison | None = group("multiple_scales", ExpansionComparison, default=None)
    relaxed: RelaxedComparison | None = group("thesis", RelaxedComparison, default=None)

    @property
    def backbone(self) -> ModeBranch:
        """The branch of the mode itself."""
        return self.branches[0]

    @property
    def tongues(self) -> tuple[ModeBranch, ...]:
        """The branches of internal resonance."""
        return tuple(b for b in self.branches if b.kind == "tongue")

    @property
    def non_brake(self) -> tuple[ModeBranch, ...]:
        """The branches of orbits that are not brake orbits."""
        return tuple(b for b in self.branches if b.kind == "non_brake")

    @property
    def motion(self) -> OrbitMotion:
        """The motion that is drawn."""
        motion = self.branches[self.motion_branch].motion
        assert motion is not None
        return motion

    @property
    def half_period_difference(self) -> Floats | None:
        """(np,) relative, of a backbone by full-period shooting from half-period shooting."""
        return self.backbone.half_period_difference

    @property
    def unit(self) -> str:
        """Unit of the branches' parameter."""
        return UNITS[self.parameter]

    @property
    @stored(axis("1", "number of the coordinate"))
    def coordinate(self) -> Ints:
        """(n,) from 1."""
        return np.arange(1, self.backbone.coordinates.shape[1] + 1)
