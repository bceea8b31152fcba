"""Branches of periodic motions in SI units, with the quantities at probes and snubbers: a class for each kind."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from beamsim.fields import (
    Counter,
    attribute,
    axis,
    dataset,
    declared,
    ending,
    group,
    key,
    members,
    per_probe,
    per_snubber,
    stored,
    table,
)
from beamsim.orbits.branch import SpecialPoint
from beamsim.outcomes import Outcome
from beamsim.results.values import AlongCurve
from beamsim.typing import Bools, Complexes, Floats

_POINT = (Counter("point", "number of the point along the branch"),)
STATION = Counter("station", "number of the station of the mode shapes", shared=True)
LARGEST_EVEN = 1e-7  # share of even harmonics of motions that are symmetric but for round-off
_COORDINATES = (*_POINT, Counter("coordinate", "number of the coordinate"))


@declared
class SpecialPointResult:
    """A special point of a branch."""

    kind: str = dataset("1", "kind of special point")  # fold, nonsmooth_fold, period_doubling, branch_point, grazing, …
    parameter: float = dataset("{unit}", "parameter of the branch")
    frequency_hz: float = dataset("Hz", "frequency")
    snubber: str = dataset("1", "snubber that grazes", default="")
    time_s: float = dataset("s", "time in the period of a grazing", default=np.nan)


def special_result(
    special: SpecialPoint, value: float, frequency_hz: float, contact_names: Sequence[str]
) -> SpecialPointResult:
    """A special point in SI numbers.

    Parameters
    ----------
    special : as it was located.
    value : of the parameter, as people read it.
    frequency_hz : of the motion, Hz.
    contact_names : (m,) of the system's contacts.

    Returns
    -------
    SpecialPointResult
        With the name of the contact that grazes, empty where none does.
    """
    name = contact_names[special.contact] if special.contact >= 0 else ""
    return SpecialPointResult(special.kind, value, frequency_hz, name, special.time)


def of_states(states: Floats, n: int) -> dict[str, Any]:
    """The fields of a branch that hold states (np, N) of n coordinates."""
    return {
        "coordinates": states[:, :n],
        "coordinate_velocities": states[:, n : 2 * n],
        "internal_states": states[:, 2 * n :] if states.shape[1] > 2 * n else None,
    }


@declared(along=("time",))
class OrbitMotion:
    """One period of one motion, from the instant of smallest kinetic energy, and its spectrum."""

    time: Floats = axis("s", "time")  # (nt,) both ends included
    displacement: dict[str, Floats] = per_probe("m", "displacement")
    velocity: dict[str, Floats] = per_probe("m/s", "velocity")
    force: dict[str, Floats] = per_snubber("N", "contact force, positive when it pushes")
    stations: Floats = dataset("m", "deflection at the stations", along=("time", STATION), name="deflection")
    harmonics: dict[str, Complexes] = per_probe(  # (21,) amplitude of e^{i k omega t}, zero to peak
        "m", "amplitude of cos(order x phase)", along=(Counter("order", "order of the harmonic", 0),), name="harmonic",
        imaginary="minus the amplitude of sin(order x phase)",
    )  # fmt: skip
    periods: int = attribute("1", "periods of the time history of the spectrum")
    spectrum_frequency_hz: Floats = axis("Hz", "frequency")  # (nf,) a step of 1 / (periods x period)
    spectrum: dict[str, Floats] = per_probe(
        "m", "single-sided amplitude, zero to peak", along=("spectrum_frequency_hz",)
    )
    drift: float = attribute("1", "relative difference of the states at the end and at the start of these periods")

    @property
    @stored(
        dataset(
            "m", "deflection at the slowest instant and half a period later", along=("instant", STATION),
            name="extreme_shapes",
        )
    )  # fmt: skip
    def at_rest(self) -> Floats:
        """(2, nx) m, deflection at the slowest instant and half a period later: the extremes of a brake orbit."""
        return self.stations[[0, (self.time.size - 1) // 2]]

    @property
    @stored(axis("1", "share of the period"))
    def instant(self) -> Floats:
        """(2,) instants of `at_rest`."""
        return np.array([0.0, 0.5])

    @property
    def underway(self) -> Floats:
        """(2, nx) m, deflection an eighth and three eighths of a period later."""
        return self.stations[[(self.time.size - 1) // 8, 3 * (self.time.size - 1) // 8]]


@declared(along=_POINT)
class ChannelExtremes:
    """One channel of a probe or snubber, motion by motion of a branch."""

    name: str = key("name of the probe or snubber")
    quantity: str  # "displacement", "absolute_acceleration", "force", ...
    unit: str
    maximum: Floats = dataset("{unit}", "largest {quantity} of a cycle or period", name="max")
    minimum: Floats = dataset("{unit}", "smallest {quantity} of a cycle or period", name="min")

    @property
    @stored(dataset("{unit}", "largest magnitude of the {quantity} in a cycle or period", name="peak"))
    def peak(self) -> Floats:
        """(np,) largest absolute value."""
        return np.maximum(np.abs(self.maximum), np.abs(self.minimum))


@declared(along=_POINT)
class OutputExtremes:
    """One of the `outputs`, motion by motion of a branch."""

    name: str = key("name of the output")
    quantity: str = attribute("", "what it is, such as bending_moment or reaction_force")
    unit: str = attribute("", "unit of the quantity")
    at: str = attribute("", "where it is: a place, a support, a joint or a body")
    maximum: Floats = dataset("{unit}", "largest value of a cycle or period")
    minimum: Floats = dataset("{unit}", "smallest value of a cycle or period")

    @property
    def peak(self) -> Floats:
        """(np,) largest absolute value."""
        return np.maximum(np.abs(self.maximum), np.abs(self.minimum))


@declared(kw_only=True, along=_POINT)
class BranchResult:
    """A branch of periodic motions: what every kind has."""

    kind: str = attribute("", "response, fold, backbone, tongue or non_brake")
    outcome: Outcome = ending("how the branch ended")
    frequency_hz: Floats = dataset("Hz", "frequency of the excitation, or of a free motion")
    parameter: Floats = dataset("{unit}", "{parameter_meaning}")
    unit: str = attribute("", "unit of the parameter", name="parameter_unit")
    parameter_meaning: str = attribute("", "what the parameter is", name="parameter_meaning")
    residual: Floats = dataset("1", "largest periodicity error, relative to the size of the motion")
    coordinates: Floats = dataset(
        "kg^0.5 m", "coordinates at phase zero of the excitation; of a free motion at its slowest instant",
        along=_COORDINATES,
    )  # fmt: skip
    coordinate_velocities: Floats = dataset(
        "kg^0.5 m/s", "their velocities then; of a brake orbit zero", along=_COORDINATES
    )
    internal_states: Floats | None = dataset(
        "m", "internal states of the contacts then", default=None,
        along=(*_POINT, Counter("internal_state", "number of the internal state")),
    )  # fmt: skip


@declared(kw_only=True)
class FoldBranch(BranchResult):
    """Folds, or grazings, of a branch of forced motions, in frequency and a second parameter."""

    kind: str = attribute("", "fold", default="fold")
    level: float = attribute("{level_unit}", "level of the excitation; NaN if it is the parameter")
    branch: int = attribute("1", "number of the branch with the fold")
    start_hz: float = attribute("Hz", "frequency of that fold")
    touching: str = attribute("", "contact that grazes along the whole branch; empty for a fold", default="")
    peak_displacement: dict[str, Floats] = per_probe("m", "largest absolute displacement of a period", along=_POINT)


@declared(kw_only=True, along=_POINT)
class MotionBranch(BranchResult):
    """A branch of motions in one parameter, with their stability and its special points."""

    stable: Bools = dataset("1", "whether the motion is stable", flags=("unstable", "stable"))
    floquet_multipliers: Complexes = dataset(
        "1", "Floquet multipliers", along=(*_POINT, Counter("multiplier", "number of the Floquet multiplier"))
    )
    special: tuple[SpecialPointResult, ...] = table(
        "/special_points", SpecialPointResult, Counter("event", "number of the special point")
    )
    energy_error: Floats | None = dataset(
        "1",
        "imbalance of the energies over a period, relative to the energy; of harmonic balance not its truncation",
        default=None,
    )


@declared(kw_only=True, along=_POINT)
class ResponseBranch(MotionBranch, AlongCurve):
    """A branch of forced motions at one level."""

    kind: str = attribute("", "response", default="response")
    level: float = attribute("{level_unit}", "level of the excitation; NaN if it is the parameter")
    period_multiple: int = attribute("1", "periods of the excitation in one of the motion")
    probes: tuple[ChannelExtremes, ...] = members(
        "", ChannelExtremes, "probe", by=("name", "quantity", "unit"), split="quantity"
    )
    snubbers: tuple[ChannelExtremes, ...] = members(
        "", ChannelExtremes, "snubber", by=("name", "quantity", "unit"), split="quantity"
    )
    harmonics: dict[str, Complexes] = per_probe(  # (np, 6)
        "m", "amplitude of cos(order x phase)", along=(*_POINT, Counter("harmonic", "order times period_multiple", 0)),
        name="harmonic_displacement",
        imaginary="minus that of sin(order x phase)",
    )  # fmt: skip
    outputs: dict[str, OutputExtremes] = members("", OutputExtremes, "output", prefix="output_", default_factory=dict)
    neglected_harmonics: Floats | None = dataset(
        "1", "size of the neglected harmonics relative to the motion", default=None
    )

    @property
    def cycles_at(self) -> tuple[Floats, Bools]:
        """(np,) the parameter, and which motions are stable."""
        return self.parameter, self.stable

    @property
    def order(self) -> Floats | None:
        """Orders of `harmonics`."""
        if not self.harmonics:
            return None
        return np.arange(next(iter(self.harmonics.values())).shape[1]) / self.period_multiple

    @property
    def symmetric(self) -> bool | None:
        """Whether every motion repeats with the other sign after half its period: no even harmonics.

        None where harmonics are missing, and of a period that is an even multiple of the excitation's.
        """
        if not self.harmonics or self.period_multiple % 2 == 0:
            return None
        amplitude = np.abs(np.stack(list(self.harmonics.values())))
        return bool(amplitude[..., ::2].max() <= LARGEST_EVEN * amplitude.max())


@declared(kw_only=True, along=_POINT)
class ModeBranch(MotionBranch):
    """A branch of free motions, given at the instant of smallest kinetic energy: at rest, of a brake orbit.

    The backbone is that of the mode, a tongue one of an internal resonance, and non-brake orbits are never at rest.
    """

    mode: int = attribute("1", "the other mode of a tongue or a non-brake branch, from 1; else 0")
    ratio: int = attribute("1", "n of n:1, likewise")
    energy: Floats = dataset("J", "energy from static equilibrium")
    share: Floats = dataset("1", "share of the energy in the requested mode, at the slowest instant")
    least_kinetic: Floats = dataset("1", "kinetic energy at the slowest instant, share of the energy; zero at rest")
    initial_displacement: Floats = dataset("m", "deflection at the slowest instant", along=(*_POINT, STATION))
    # None of half-period shooting itself
    half_period_difference: Floats = dataset(
        "1", "from half-period shooting: largest of period and state, relative", default=None
    )
    motion: OrbitMotion | None = group("motion", OrbitMotion, default=None)  # of the point shown in the plots
