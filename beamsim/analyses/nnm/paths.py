"""Backbone of a nonlinear normal mode in stiffness factor, energy or frequency."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from beamsim.contacts.equilibrium import find_equilibrium
from beamsim.contacts.snubbers import springs_of
from beamsim.errors import ScenarioError
from beamsim.orbits.backbone import MODE_LOST, Backbone, Jump
from beamsim.orbits.branch import INTERRUPTED, REACHED_END, BranchPoint, OrbitBranch
from beamsim.orbits.continuation import Branch, BranchStep, Settings, solve_at
from beamsim.orbits.free_orbits import BrakeOrbits, linear_mode
from beamsim.orbits.spring_families import SpringFamily
from beamsim.orbits.tongues import LEAST_SHARE
from beamsim.outcomes import Outcome, OutcomeKind, Progress, Where, report_progress, until_stop
from beamsim.scenario.sweep import NonlinearMode
from beamsim.system.equations import PiecewiseLinearSystem
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, not_none

UNITS = {"stiffness_factor": "1", "energy": "J", "frequency": "Hz"}
POINTS = 100  # of a backbone
SMALL_J = 1e-6  # energy of a motion that is nearly linear
MOST_ENERGY = 1e8  # times that of the first point, in frequency
_NAMES = {"stiffness_factor": "stiffness factor"}
_REMEDIES_BEYOND_TONGUE = {  # remedies: ways to a motion beyond a tongue that avoid it
    "stiffness_factor": "use another energy (nnm.energy), or another mode",
    "energy": "use continue_in: {kind: stiffness_factor} with nnm.energy beyond it, or use another mode",
}
ROUND_OFF = 1e-12  # of a stiffness factor
START_SHARES = (1.0, 1e-3, 1e-6)  # of the first energy, tried if no motion is linear


@dataclass(frozen=True)
class ModeBranches:
    """Backbone with the branches that leave it."""

    backbone: OrbitBranch
    tongues: tuple[OrbitBranch, ...] = ()
    jumps: tuple[Jump, ...] = ()
    non_brake: tuple[OrbitBranch, ...] = ()  # found by full-period shooting
    # origins of the non-brake branches, along the backbone and its tongues
    symmetry_breakings: tuple[BranchPoint, ...] = ()

    @property
    def all_branches(self) -> tuple[OrbitBranch, ...]:
        """All branches, the backbone first."""
        return (self.backbone, *self.tongues, *self.non_brake)

    @property
    def gaps(self) -> set[float]:
        """Parameters of the backbone's points directly before a jump."""
        return {jump.start for jump in self.jumps}

    @property
    def problem(self) -> BrakeOrbits:
        """The shooting problem of the backbone and the tongues."""
        problem: BrakeOrbits = self.backbone.problem
        return problem

    def at_factor(self, factor: float) -> BranchPoint | None:
        """Motion at a stiffness factor between the points of the backbone; None if a jump crosses the factor."""
        points, gaps = self.backbone.points, self.gaps
        for a, b in pairwise(points):
            low, high = sorted((a.parameter, b.parameter))
            if low - ROUND_OFF <= factor <= high + ROUND_OFF:
                if a.parameter in gaps and low < factor < high:
                    return None
                return BranchStep(self.problem, a, b, Settings(iterations=12)).at_parameter(factor)
        return None


@dataclass
class ModePath:
    """Continuation parameter with its range, and the structure as a function of the stiffness factor."""

    system: StructuralSystem
    family: SpringFamily
    mode: int  # from 0
    parameter: str
    first: float
    last: float
    energy: float
    basis: tuple[Floats, Floats] | None
    away_from: Floats | None

    @property
    def settings(self) -> NonlinearMode:
        """Section ``nnm`` of the scenario."""
        return not_none(self.system.scenario.nnm)

    def follow(self, progress: Progress) -> ModeBranches:
        """Trace the backbone and the branches that leave it, until the end of the range or an interruption.

        Raises
        ------
        ScenarioError
            If no motion exists to start from.
        """
        if self.parameter == "stiffness_factor":
            by_factor = BrakeOrbits(self.family, energy=self.energy)
            linear = solve_at(by_factor, linear_mode(by_factor, self.mode, 0.0, self.away_from), Settings(), 0.0)
            if linear is None:
                where = f"= {self.mode + 1} gives no motion to start from"
                raise ScenarioError.at("nnm.mode", where, "use another mode")
            if self.first != 0.0:
                linear = self._first_motion(by_factor, linear, self.first)
            return self._backbone(by_factor, linear, self.last, progress)
        orbits, start = self._nearly_linear_motion()
        if self.parameter == "frequency":
            return self._in_frequency(orbits, start, progress)
        if abs(start.parameter - self.to_unknown(self.first)) > 1e-12:
            start = self._first_motion(orbits, start, self.to_unknown(self.first), " J")
        return self._backbone(orbits, start, self.to_unknown(self.last), progress)

    def _nearly_linear_motion(self) -> tuple[BrakeOrbits, BranchPoint]:
        """Motion that is small enough to be linear, or nearly linear."""
        orbits = BrakeOrbits(self.family, "energy", basis=self.basis)
        value = np.log(self.first if self.parameter == "energy" else self.energy)
        for _ in range(12):  # decades of energy
            guess = linear_mode(orbits, self.mode, value, self.away_from)
            point = solve_at(orbits, guess, Settings(), value)
            if point is not None:
                period = orbits.split(point.u)[1]
                shift = abs(period * float(orbits.omega[self.mode]) / (2 * np.pi) - 1.0)
                if shift < 1e-3 and float(orbits.share_at(point)[self.mode]) > 0.9:
                    return orbits, point
            value -= np.log(10.0)
        for share in START_SHARES:
            grown = self._grow_springs(orbits, share * (self.first if self.parameter == "energy" else self.energy))
            if grown is not None:
                return orbits, grown
        raise ScenarioError.at(
            "nnm.continue_in.from",
            f"= {self.first:g} has no nearly linear motion below it as a starting point",
            "give a lower energy, or a gap or preload that leaves small motions linear",
        )

    def _grow_springs(self, orbits: BrakeOrbits, energy: float) -> BranchPoint | None:
        """Motion of a given energy, traced from zero stiffness of the nonlinear springs.

        Needed if even small motions are nonlinear, for example with some gaps zero and others not.
        """
        away = self.away_from if self.basis is None or self.away_from is None else -self.away_from
        by_factor = BrakeOrbits(self.family, energy=energy)
        linear = solve_at(by_factor, linear_mode(by_factor, self.mode, 0.0, away), Settings(), 0.0)
        if linear is None:
            return None
        growth = Backbone(by_factor, linear, 1.0, self.mode, points=POINTS)
        q, period, _, _ = by_factor.split(list(growth)[-1].u)
        if not growth.outcome.complete:
            return None
        value = float(np.log(energy))
        point = solve_at(orbits, orbits.unknowns(q, period, value), Settings(), value)
        if point is None or float(orbits.share_at(point)[self.mode]) <= LEAST_SHARE:
            return None
        return point

    def _first_motion(self, orbits: BrakeOrbits, start: BranchPoint, first: float, unit: str = "") -> BranchPoint:
        """Motion at the beginning of the range, traced from a nearly linear one."""
        lead_in = Backbone(orbits, start, first, self.mode, points=1)
        reached = list(lead_in)[-1]
        if lead_in.outcome.code != REACHED_END:
            asked, possible = (f"{self.in_report_unit(x):.4g}{unit}" for x in (first, reached.parameter))
            problem = f"= {asked} cannot be reached: {self.outcome_in_report_unit(lead_in.outcome, reached)}"
            raise ScenarioError.at("nnm.continue_in.from", problem, f"begin at {possible} or below")
        return reached

    def _in_frequency(self, orbits: BrakeOrbits, start: BranchPoint, progress: Progress) -> ModeBranches:
        """Trace in frequency, starting where the backbone in energy passes the first frequency."""
        first, last = self.to_unknown(self.first), self.to_unknown(self.last)
        low, high = sorted((first, last))
        in_energy = Backbone(orbits, start, start.parameter + 30.0, self.mode, points=1)
        before: BranchPoint | None = None
        begin: BranchPoint | None = None
        by_frequency = BrakeOrbits(self.family, "frequency", basis=self.basis)
        passed: list[float] = []
        for point in in_energy:
            omega = 2 * np.pi / float(point.u[-2])
            passed.append(omega / (2 * np.pi))
            if before is not None and (2 * np.pi / float(before.u[-2]) - first) * (omega - first) <= 0:
                begin = _at_frequency(by_frequency, before, point, first, last - first)
                if begin is not None:
                    break
            before = point
        if begin is None:
            raise ScenarioError.at(
                "nnm.continue_in.from",
                f"= {self.first:g} Hz is not reached by mode {self.mode + 1}",
                f"choose one between {min(passed):.6g} and {max(passed):.6g} Hz, which its backbone passes (with "
                "gaps at internal resonances)",
            )
        branch = Branch(by_frequency, begin, low, high, Settings(most_points=3000))
        points: list[BranchPoint] = []
        unbounded = False
        for point in until_stop(_reporting(branch, begin.parameter, last, progress)):
            points.append(point)
            if not 1.0 / MOST_ENERGY < point.data.energy / begin.data.energy < MOST_ENERGY:
                unbounded = True
                break
        outcome = branch.outcome
        if unbounded:
            outcome = Outcome.of(
                OutcomeKind.STOPPED, "energy_unbounded",
                f"the energy is {point.data.energy:.3g} J and grows without bound at nearly constant frequency (a "
                "tongue of internal resonance)",
                at=point.parameter, remedy="use energy as the continuation parameter instead",
            )  # fmt: skip
        return ModeBranches(
            OrbitBranch(by_frequency, points, self.outcome_in_report_unit(outcome, points[-1]), kind="backbone")
        )

    def _backbone(self, orbits: BrakeOrbits, start: BranchPoint, last: float, progress: Progress) -> ModeBranches:
        backbone = Backbone(orbits, start, last, self.mode, points=POINTS)
        points = list(until_stop(_reporting(backbone, start.parameter, last, progress)))
        outcome = self.outcome_in_report_unit(backbone.outcome, points[-1])
        if outcome.code == MODE_LOST:
            outcome = outcome.copy_with(remedy=_REMEDIES_BEYOND_TONGUE[self.parameter])
        branch = OrbitBranch(orbits, points, outcome, kind="backbone")
        tongues = (replace(t, outcome=self.outcome_in_report_unit(t.outcome, t.points[-1])) for t in backbone.tongues)
        return ModeBranches(branch, tuple(tongues), tuple(backbone.jumps))

    def to_unknown(self, value: float) -> float:
        """Continuation unknown of a parameter value: logarithm of the energy, or frequency in rad/s."""
        if self.parameter == "energy":
            return float(np.log(value))
        return 2 * np.pi * value if self.parameter == "frequency" else value

    def in_report_unit(self, value: float) -> float:
        """Parameter value of a continuation unknown: J instead of the logarithm, Hz instead of rad/s."""
        if self.parameter == "energy":
            return float(np.exp(value))
        return value / (2 * np.pi) if self.parameter == "frequency" else value

    def outcome_in_report_unit(self, outcome: Outcome, last: BranchPoint | None = None) -> Outcome:
        """Outcome of a path with the parameter in report units; at its last point if that is given."""
        if last is not None and outcome.code == INTERRUPTED.code:
            outcome = outcome.copy_with(place=Where(last.parameter))
        return outcome.in_unit(self.in_report_unit, UNITS[self.parameter], _NAMES.get(self.parameter, ""))


def _at_frequency(
    orbits: BrakeOrbits, a: BranchPoint, b: BranchPoint, omega: float, forward: float
) -> BranchPoint | None:
    """Motion at a frequency between two motions, excluding the state of rest (which has every frequency)."""
    wa, wb = 2 * np.pi / float(a.u[-2]), 2 * np.pi / float(b.u[-2])
    share = 0.0 if wa == wb else (omega - wa) / (wb - wa)
    for s in (share, 1.0, 0.0):
        q = (1 - s) * a.u[: orbits.n] + s * b.u[: orbits.n]
        guess = orbits.unknowns(q, 2 * np.pi / omega, omega)
        point = solve_at(orbits, guess, Settings(iterations=15), omega, forward)
        if point is not None and 0.5 * a.data.energy < point.data.energy < 2.0 * b.data.energy:
            return point
    return None


def _reporting(points: Iterable[BranchPoint], first: float, last: float, progress: Progress) -> Iterable[BranchPoint]:
    for point in points:
        report_progress(progress, (point.parameter - first) / (last - first))
        yield point


def flexible_mode(system: StructuralSystem, mode: int) -> int:
    """Index of mode ``mode`` (from 1), checked: it vibrates, and nonlinear springs act on the structure.

    Raises
    ------
    ScenarioError
    """
    if not 1 <= mode <= system.kept_modes:
        raise ScenarioError.at(
            "nnm.mode",
            f"= {mode} is not among the {system.kept_modes} modes of the model",
            "choose a lower mode, or raise reduction.modes or beam.elements",
        )
    if system.dynamics.stiffness[mode - 1] <= 0:
        raise ScenarioError.at(
            "nnm.mode", f"= {mode} is a rigid-body mode, which does not vibrate", "use a higher mode"
        )
    if system.dynamics.contacts.count == 0 and system.cubic is None:
        raise ScenarioError.at("nnm", "needs a snubber or a cubic spring", "add one under snubbers")
    return mode - 1


def energy_of_factors(system: StructuralSystem, energy: float | None) -> float:
    """Energy at which the stiffness factor changes; 1 J if the motion does not depend on it.

    Raises
    ------
    ScenarioError
        If the motion depends on the energy and none is given.
    """
    if energy is not None:
        return float(energy)
    if not motions_scale(system):
        raise ScenarioError.at(
            "nnm.energy",
            "is missing: with a gap, a load or a cubic spring the motion depends on its energy",
            "add for example `energy: 0.1 J`",
        )
    return 1.0


def spring_family(system: StructuralSystem) -> SpringFamily:
    """Structure as a function of the factor on its nonlinear springs.

    Raises
    ------
    ScenarioError
        If it has cubic springs and does not rest at zero deflection.
    """
    dynamics = system.dynamics
    loaded = bool(np.any(dynamics.contacts.clearances < 0) or np.any(dynamics.constant_load))
    if system.cubic is not None and loaded:
        raise ScenarioError.at(
            "nnm",
            "needs zero deflection at rest if the structure has cubic springs",
            "leave out prestress, gravity and constant forces",
        )
    rigid = int(np.count_nonzero(dynamics.stiffness == 0))

    def rest(moved: PiecewiseLinearSystem) -> Floats:
        springs = springs_of(moved.contacts)
        acting = springs.take(springs.stiffness != 0)  # none at a factor of zero
        equilibrium = find_equilibrium(moved.stiffness, rigid, acting, moved.constant_load[None, :])
        if equilibrium.q is None:
            reason = f"has no static equilibrium to vibrate about: {equilibrium.reason}"
            raise ScenarioError.at("nnm", reason, "support the structure")
        return equilibrium.q

    return SpringFamily(dynamics, rest if loaded else None, cubic=system.cubic)


def mode_path(system: StructuralSystem) -> ModePath:
    """Path that a scenario requests, for its structure without damping and excitation.

    Raises
    ------
    ScenarioError
        If the mode does not exist, or the parameter has no effect.
    """
    settings = not_none(system.scenario.nnm)
    mode = flexible_mode(system, settings.mode)
    contacts = system.dynamics.contacts.split()
    parameter = settings.continue_in
    if settings.phase_resonance is not None and parameter.kind == "stiffness_factor" and not motions_scale(system):
        raise ScenarioError.at(
            "nnm.phase_resonance",
            "needs one structure, but continue_in: stiffness_factor changes its springs",
            "use continue_in: {kind: energy, from: 1 uJ, to: 1 J}",
        )
    if parameter.kind != "stiffness_factor" and motions_scale(system):
        raise ScenarioError.at(
            "nnm.continue_in.kind",
            f"= {parameter.kind} has no effect: with every gap zero the frequency does not depend on the energy",
            "use stiffness_factor, or give a gap",
        )
    energy = energy_of_factors(system, settings.energy) if parameter.kind == "stiffness_factor" else SMALL_J
    family = spring_family(system)
    basis = None
    if family.equilibrium is not None and parameter.kind != "stiffness_factor":
        basis = family.modes_at_rest()
    away = (contacts.sign @ contacts.shape) if contacts.count else None
    if away is not None and basis is not None:
        away = -away  # closed contacts at rest: the modes of the closed structure share all the energy
    first = getattr(parameter, "from_", 0.0)
    return ModePath(system, family, mode, parameter.kind, float(first), float(parameter.to), energy, basis, away)


def motions_scale(system: StructuralSystem) -> bool:
    """True if motions of all energies are the same up to a factor: no gap, no load, no cubic spring."""
    dynamics = system.dynamics
    return not (np.any(dynamics.contacts.clearances) or np.any(dynamics.constant_load) or system.cubic is not None)
