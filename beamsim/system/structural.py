"""What `build_system` hands to the analyses: one structure, ready to move."""

from __future__ import annotations

from dataclasses import dataclass

from beamsim.contacts.equilibrium import CubicSprings
from beamsim.contacts.springs import SpringInfo
from beamsim.fields import Counter, attribute, axis, dataset, declared, key
from beamsim.inputs.signal import Signal
from beamsim.system.equations import Forcing, PiecewiseLinearSystem
from beamsim.typing import Floats


@dataclass(frozen=True)
class ProbeRow:
    """A place whose motion is recorded: deflection = shape @ q, relative to the base."""

    name: str
    position: float  # m along the beam; the mass number for a chain
    shape: Floats  # (n,) deflection for a unit of each coordinate, 1/sqrt(kg)


@declared
class SnubberNumbers:
    """The numbers that describe a snubber, all resolved."""

    name: str = key("name of the snubber")
    position: float = attribute(
        "m", "position along the beam; the number of the mass in a chain, halfway for a snubber between two masses"
    )
    side: str = attribute("", "below or above; between two masses approach or separation")
    stiffness: float = attribute("N/m", "stiffness")
    dashpot: float = attribute("N s/m", "damping constant")
    gap: float = attribute("m", "clearance, positive when open; resolved where a preload was given")
    preload: float = attribute("N", "contact force at static equilibrium; NaN where there is none")
    blocked_force: float = attribute("N", "stiffness times max(-gap, 0): the force if the structure could not move")
    stiffness_ratio: float = attribute("1", "k L^3 / (E I); in a chain, over its largest spring stiffness")


@dataclass(frozen=True)
class SnubberInfo(SnubberNumbers):
    """One snubber of a model."""

    shape: Floats  # (n,) deflection for a unit of each coordinate, 1/sqrt(kg)


@dataclass(frozen=True)
class BeamRecovery:
    """Deflection and bending moment along a beam for a unit of each coordinate.

    Stations are the nodes, the element midpoints and the points where forces act.
    """

    position: Floats  # (nx,) m
    deflection: Floats  # (nx, n) 1/sqrt(kg)
    bending_moment: Floats  # (nx, n) N m per coordinate; E I w'', positive where the beam's top is in compression
    stress_per_moment: float  # extreme_fibre / I, Pa per N m
    base_moment: Floats  # (nx,) N m per m/s^2 of base acceleration, to be added: static share of the modes left out


_MODE = (Counter("mode", "mode number"),)


@declared
class ModeTable:
    """Natural frequencies and mode shapes of the reduced model."""

    # (r,), every snubber closed: piecewise-linear springs as at rest
    open_frequencies_hz: Floats = dataset("Hz", "natural frequencies with every contact open", along=_MODE)
    closed_frequencies_hz: Floats = dataset("Hz", "natural frequencies with every contact closed", along=_MODE)
    shapes: Floats = dataset(  # (r, nx)
        "kg^-0.5", "mode shapes of the open structure, unit modal mass", along=(*_MODE, "position")
    )
    position: Floats = axis("{position_unit}", "{position_meaning}")  # (nx,)
    damping_ratios: Floats = dataset(  # (r,) nan for rigid-body modes
        "1", "modal damping ratios of the open structure", along=_MODE
    )
    kept_modes: int = attribute("1", "number of modes kept by the reduction")
    static_vectors: int = attribute("1", "number of static vectors kept by the reduction")
    highest_frequency_hz: float = attribute("Hz", "the highest frequency that the reduction was made for")
    reduction_error: float = attribute("1", "estimated relative error of the reduction")  # see docs/theory.md
    position_unit: str = attribute("", "m along a beam, 1 where masses are numbered", name="units", at="position")

    @property
    def position_meaning(self) -> str:
        """What `position` is."""
        return "position along the beam" if self.position_unit == "m" else "mass number"


@dataclass(frozen=True)
class StructuralSystem:
    """A scenario turned into mathematics, with what is needed to turn the solution back.

    Coordinates q are mass-normalised (M = I) and relative to the base: absolute = relative + base, the
    influence of the base being 1 on every deflection.
    """

    dynamics: PiecewiseLinearSystem
    forcing: Forcing
    initial_state: Floats  # (2 n,) q then q'
    probes: tuple[ProbeRow, ...]
    base_acceleration: Signal | None  # m/s^2; None where the base is at rest
    base_velocity: Signal | None  # m/s
    base_displacement: Signal | None  # m
    snubbers: tuple[SnubberInfo, ...]
    beam: BeamRecovery | None  # None for a chain
    modes: ModeTable
    static_equilibrium: Floats | None  # (n,) base at d = 0; None where there is none, or more than one
    static_reason: str  # why there is no static equilibrium; empty where there is one
    excitation_frequency_hz: float  # nan where there is none, or several
    cubic: CubicSprings
    springs: tuple[SpringInfo, ...] = ()  # nonlinear ones; one-sided parts follow the snubbers in ``dynamics.contacts``
    warnings: tuple[str, ...] = ()

    @property
    def contact_names(self) -> tuple[str, ...]:
        """(m,) whose each of the contacts is: a snubber's name, or that of a piecewise-linear spring."""
        parts = [spring.name for spring in self.springs for _ in range(spring.gap.size)]
        return (*(snubber.name for snubber in self.snubbers), *parts)
