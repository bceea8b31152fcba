"""Damped structure excited on its nonlinear normal mode: predicted level, exact motion, response about resonance.

The prediction is an energy balance along the backbone; the exact motion at phase resonance comes from shooting. Both
are in :mod:`beamsim.orbits.phase_resonance`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, pairwise
from typing import Any

import numpy as np

from beamsim.analyses.nnm.layouts import (
    PHASE_RESONANCE,
    PREDICTED_LEVELS,
    RESONANCE_CURVES,
    UNCONTROLLED,
    UNCONTROLLED_SPECTRA,
)
from beamsim.analyses.nnm.orbits import SAMPLES_PER_PERIOD, line_frequencies, march_periods
from beamsim.analyses.nnm.paths import motions_scale
from beamsim.errors import Problem, ScenarioError
from beamsim.flow.periodic_flow import PeriodicForcing
from beamsim.labelled import Dataset
from beamsim.orbits.branch import BranchPoint, OrbitBranch
from beamsim.orbits.continuation import CLOSED_CURVE, Branch, BranchStep, Settings, solve_at
from beamsim.orbits.free_orbits import BrakeOrbits
from beamsim.orbits.phase_resonance import (
    Appropriation,
    appropriate_force,
    find_phase_resonance,
    quadrature,
)
from beamsim.orbits.shooting import ForcedOrbits
from beamsim.orbits.tracing import join_directions
from beamsim.outcomes import (
    COMPLETE,
    Outcome,
    OutcomeKind,
    Progress,
    Where,
    first_with_others,
    interruption,
    report_progress,
    stop_requested,
)
from beamsim.responses.energies import LARGEST_ERROR
from beamsim.responses.loads import periodic_flow, periodic_forcing
from beamsim.responses.orbit_energies import imbalance_outcome
from beamsim.responses.periodic_motion import Measurement
from beamsim.results.branch import endings, of_multipliers, row_numbers
from beamsim.results.values import DISPLACEMENT
from beamsim.scenario.excitation import Harmonic
from beamsim.signals.records import RECTANGULAR
from beamsim.system.build import build_system
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Bools, Complexes, Floats, not_none, of_kind

SCALED_POINTS = 25  # points of a backbone whose motions differ only by a factor
ATTEMPTS = 8  # intermediate levels that are tried
LARGEST_LEVEL_RATIO = 3.0  # ratio of an intermediate level to the target
POINTS_BETWEEN_ATTEMPTS = 5  # points of the backbone between two attempts along its stiffness factor
LEVEL_STEP = 0.1  # of the logarithm of the level
DRAWN_LEVEL_RATIO = 1.5  # highest drawn level over the highest level


@dataclass(frozen=True)
class PredictedLevels:
    """Levels from the energy balance at np motions of a backbone; see `PREDICTED_LEVELS`."""

    energy: Floats  # (np,)
    frequency_hz: Floats  # (np,)
    level: Floats  # (np,)
    dissipated: Floats  # (np,)
    contact_share: Floats  # (np,)
    amplitude: Floats  # (probes, np)


@dataclass(frozen=True)
class ResponseAboutResonance:
    """Branch of np forced periodic motions about a resonance; see `RESONANCE_CURVES`."""

    outcome: Outcome
    frequency_hz: Floats  # (np,)
    amplitude: Floats  # (probes, np)
    stable: Bools  # (np,)
    energy_error: Floats  # (np,)


@dataclass(frozen=True)
class UncontrolledMotion:
    """Motion of the damped structure from a state of the mode, under the predicted force, over P whole periods."""

    time: Floats  # (nt,) s, without the end point
    displacement: Floats  # (probes, nt) m
    frequency_hz: Floats  # (nf,) lines of the spectrum over all these periods
    line: Floats  # (probes, nf) m, zero to peak
    departure: Floats  # (P,) largest distance from the mode in each period, in the energy norm
    instants: Floats  # (2,) s, in the last period, when the mode is at rest
    shapes: Floats  # (2, nx) m, deflection of the structure at these instants
    mode_shapes: Floats  # (2, nx) m, deflection of the mode


@dataclass(frozen=True, kw_only=True)
class ResonantMotion:
    """Prediction and exact forced motion at one level; see `PHASE_RESONANCE`."""

    level: float
    predicted_frequency_hz: float
    predicted_energy: float
    predicted_amplitude: Floats  # (probes,)
    uncontrolled: UncontrolledMotion | None  # None if contacts chatter
    # of the exact motion, if it was found
    found: bool = False
    frequency_hz: float = np.nan
    amplitude: Floats  # (probes,)
    level_for_amplitude: float = np.nan
    stable: bool = False
    multipliers: Complexes  # (m,)
    residual: float = np.nan
    quadrature: float = np.nan
    energy_error: float = np.nan
    curve: ResponseAboutResonance | None = None


@dataclass(frozen=True)
class PhaseResonanceLevels:
    """Forced motions on a nonlinear mode at several levels."""

    outcome: Outcome  # incomplete if the motion of a level was not found
    quantity: str  # of the level
    unit: str  # of the level
    probes: Sequence[str]
    compared_probe_index: int  # index of the probe with the largest motion, whose amplitude is compared
    scales: bool  # True if the level is proportional to the amplitude at a constant frequency
    predicted: PredictedLevels
    motions: Sequence[ResonantMotion]

    @property
    def datasets(self) -> dict[str, Dataset]:
        """Labelled datasets, by name."""
        motions, probes = self.motions, {"probe": self.probes}
        curves = [(k, m.curve) for k, m in enumerate(motions) if m.curve is not None]
        held = [(k, m.uncontrolled) for k, m in enumerate(motions) if m.uncontrolled is not None]
        values: dict[str, Any] = {
            "level_index": np.arange(len(motions)),
            "quantity": self.quantity, "compared_probe": self.probes[self.compared_probe_index], "scales": self.scales,
            **{name: text for name, (text,) in endings([self.outcome]).items()},
            **{name: [getattr(motion, name) for motion in motions] for name in ("predicted_amplitude", "amplitude")},
            **of_multipliers([motion.multipliers[None, :] for motion in motions]),
            "curve_status": ["" if motion.curve is None else motion.curve.outcome.of_part for motion in motions],
        }  # fmt: skip
        if held:
            values |= _values_by_level([motion.uncontrolled for motion in motions])
        of_levels = [{"level_unit": self.unit}] * len(motions)
        datasets = {
            "phase_resonance": PHASE_RESONANCE.table(motions, of_levels, **probes, **values),
            "predicted_levels": PREDICTED_LEVELS.dataset(
                {"point": np.arange(1, self.predicted.level.size + 1), **probes, **vars(self.predicted)},
                level_unit=self.unit,
            ),
        }
        if curves:
            datasets["resonance_curves"] = RESONANCE_CURVES.dataset(
                {
                    **row_numbers(_sizes([motion.curve for motion in motions], "frequency_hz"), "level_index"),
                    **probes,
                    **{
                        name: np.concatenate([getattr(curve, name) for _, curve in curves], axis=-1)
                        for name in ("frequency_hz", "stable", "energy_error", "amplitude")
                    },
                }
            )  # fmt: skip
        for layout, x, y in ((UNCONTROLLED, "time", "displacement"), (UNCONTROLLED_SPECTRA, "frequency_hz", "line")):
            if held:
                own = {name: np.concatenate([getattr(of, name) for _, of in held], axis=-1) for name in (x, y)}
                rows = row_numbers(_sizes([motion.uncontrolled for motion in motions], x), "level_index", "sample")
                datasets[layout.name] = layout.dataset({**rows, **probes, **own})
        return datasets


def _sizes(levels: Sequence[Any], name: str) -> list[int]:
    """Lengths of an array attribute of each level; 0 for a level that is None."""
    return [0 if of is None else getattr(of, name).size for of in levels]


def _values_by_level(motions: Sequence[UncontrolledMotion | None]) -> dict[str, Any]:
    """Values of the uncontrolled motions, level by level; NaN if a level has none."""
    known = next(each for each in motions if each is not None)
    values: dict[str, Any] = {}
    for name in ("departure", "instants", "shapes", "mode_shapes"):
        nothing = np.full(getattr(known, name).shape, np.nan)
        values[name] = np.array([nothing if of is None else getattr(of, name) for of in motions])
    counts = {"period": known.departure.size, "instant": 2, "station": known.shapes.shape[1]}
    return values | {dim: np.arange(1, count + 1) for dim, count in counts.items()}


@dataclass(frozen=True)
class _BackboneMotion:
    """Motion of the backbone, multiplied by ``scale``, with the force that sustains it."""

    flow: Any
    period_motion: Any
    energy: float
    share: float  # share of the energy in the requested mode, at rest
    force: Appropriation
    measurement: Measurement
    scale: float = 1.0

    @cached_property
    def peak(self) -> Floats:
        """(probes,) largest deflections in a period at a scale of one, m."""
        return self.measurement.of_flow_map(self.flow, self.period_motion).peak

    @property
    def level(self) -> float:
        return self.scale * self.force.level

    @property
    def frequency_hz(self) -> float:
        return self.force.omega / (2 * np.pi)

    def states(self, times: Floats) -> Floats:
        """(nt, 2n) states at any times, counted from the start of the force's period."""
        inside = (times + self.force.shift) % self.period_motion.duration
        order = np.argsort(inside, kind="stable")
        out = np.empty((times.size, 2 * self.flow.system.size))
        out[order] = self.scale * self.flow.states_at(self.period_motion, inside[order])
        return out

    def with_scale(self, factor: float) -> _BackboneMotion:
        return replace(self, scale=self.scale * factor, energy=self.energy * factor**2)


@dataclass(frozen=True)
class _LevelSetup:
    """Data that all levels share."""

    orbits: BrakeOrbits
    points: Sequence[BranchPoint]
    damped: StructuralSystem
    excitation: Harmonic
    loads: PeriodicForcing
    mode: int  # from 0
    factor: float  # of the nonlinear springs at the end of the backbone
    motions_scale: bool
    unit: str  # of the level

    @cached_property
    def motions(self) -> list[_BackboneMotion]:
        """Motions of the backbone from its lowest energy to its highest."""
        return [self.motion(p) for p in self.ascending]

    @cached_property
    def ascending(self) -> list[BranchPoint]:
        """Points of the backbone in the same order."""
        return sorted(self.points, key=lambda p: float(p.data.energy))

    def motion(self, point: BranchPoint) -> _BackboneMotion:
        """Motion of a point of the backbone, with the force that it needs."""
        flow, whole = self.orbits.cycle(point)
        load = self.loads.at(2 * np.pi / whole.duration, 1.0)[0].sum(axis=0)
        try:
            force = appropriate_force(self.damped.dynamics, flow, whole, load)
        except ValueError as error:
            raise ScenarioError.at(
                "excitation.applied_to", f"cannot sustain a motion: {error}", "apply it elsewhere"
            ) from None
        if force.dissipated <= 0:
            raise ScenarioError.at(
                "nnm.phase_resonance",
                "has no damping to balance: without damping the motion grows at every level",
                "give the structure or a snubber damping",
            )
        q, _, factor, _ = self.orbits.split(point.u)
        share = float(self.orbits.share(q, factor)[self.mode])
        return _BackboneMotion(flow, whole, float(point.data.energy), share, force, self.free_measurement)

    @cached_property
    def free_measurement(self) -> Measurement:
        """Displacements of the probes as measured in free motions."""
        return Measurement(self.damped, None, self.damped.channels.of_keys(DISPLACEMENT))

    @cached_property
    def forced_measurement(self) -> Measurement:
        """Displacements of the probes as measured in forced motions."""
        return Measurement(self.damped, self.excitation, self.free_measurement.channels)

    def amplitudes(self, motion: _BackboneMotion) -> Floats:
        """(probes,) largest deflection in a period, m."""
        return np.asarray(motion.scale * motion.peak)

    def motion_with(self, target: float, measure: Callable[[_BackboneMotion], float]) -> _BackboneMotion | None:
        """Motion with a target level (or amplitude); None if the backbone has none.

        In the tongue of an internal resonance the level rises without bound: the motion with the largest share in the
        requested mode is returned.
        """
        if self.motions_scale:
            one = self.motion(self.points[-1])
            return one.with_scale(target / measure(one))
        off = [measure(m) - target for m in self.motions]
        crossings: list[_BackboneMotion] = []
        edges: list[_BackboneMotion] = []
        for k, (a, b) in enumerate(pairwise(self.ascending)):
            if off[k] * off[k + 1] > 0:
                continue
            try:
                crossing = self._crossing(a, b, lambda p: measure(self.motion(p)) - target, (off[k], off[k + 1]))
            except ScenarioError:  # in a tongue the force may do no work, and no level sustains the motion
                crossing = None
            if crossing is not None:
                crossings.append(self.motion(crossing))
            else:  # no motion exists across a tongue: use the nearer edge
                edges.append(self.motions[k if abs(off[k]) <= abs(off[k + 1]) else k + 1])
        return max(crossings or edges, key=lambda m: m.share, default=None)

    def _crossing(
        self, a: BranchPoint, b: BranchPoint, deviation: Callable[[BranchPoint], float], values: tuple[float, float],
        halvings: int = 4,
    ) -> BranchPoint | None:  # fmt: skip
        """Motion between two neighbours where ``deviation`` vanishes; bisected if a thin tongue lies between."""
        crossing = BranchStep(self.orbits, a, b, Settings(iterations=12)).locate(deviation, values)
        if crossing is not None or halvings == 0:
            return crossing
        halfway = 0.5 * (a.parameter + b.parameter)
        middle = solve_at(self.orbits, 0.5 * (a.u + b.u), Settings(iterations=12), halfway)
        if middle is None:
            return None
        value = deviation(middle)
        if value * values[0] <= 0:
            return self._crossing(a, middle, deviation, (values[0], value), halvings - 1)
        return self._crossing(middle, b, deviation, (value, values[1]), halvings - 1)

    def problem(self, level: float, omega: float, factor: float | None = None) -> ForcedOrbits:
        """Shooting problem of the damped structure at a level; by default with the springs at the backbone's end."""
        system, factor = self.damped, self.factor if factor is None else factor
        dynamics = replace(system.dynamics, contacts=system.dynamics.contacts.scaled(factor))
        cubic = system.cubic and replace(system.cubic, stiffness=factor * system.cubic.stiffness)
        return ForcedOrbits(periodic_flow(replace(system, dynamics=dynamics, cubic=cubic), self.loads, omega, level))


def excite_mode(
    system: StructuralSystem, orbits: BrakeOrbits, points: Sequence[BranchPoint], progress: Progress
) -> PhaseResonanceLevels:
    """Sustain a nonlinear mode by the scenario's excitation, at all levels of its ``nnm.phase_resonance``.

    Parameters
    ----------
    system : structure without damping, of a scenario with ``nnm.phase_resonance`` and a harmonic excitation.
    orbits, points : shooting problem and points of its backbone.
    progress : called with the completed fraction of the levels.

    Returns
    -------
    PhaseResonanceLevels
        Predicted levels along the backbone, and a motion for each level that was computed before an interruption.

    Raises
    ------
    ScenarioError
        If the force acts at a node, nothing is damped, or a level lies beyond the backbone.
    """
    scenario, scales = system.scenario, motions_scale(system)
    settings, excitation = not_none(scenario.nnm), of_kind(Harmonic, scenario.excitation)
    section = not_none(settings.phase_resonance)
    damped = build_system(scenario.model_copy(update={"run": None}))
    factor = orbits.split(points[-1].u)[2]
    loads, unit = periodic_forcing(scenario, damped), scenario.level_unit or "1"
    shared = _LevelSetup(orbits, points, damped, excitation, loads, settings.mode - 1, factor, scales, unit)
    levels = [float(level) for level in section.levels] or [excitation.level]
    predicted = _predict_levels(shared, levels)
    compared = int(np.argmax(predicted.amplitude.max(axis=1)))
    motions = []
    for index, level in enumerate(levels):
        at = f"nnm.phase_resonance.levels[{index}]" if section.levels else "excitation.level"
        motion = shared.motion_with(level, lambda m: m.level)
        if motion is None:
            raise ScenarioError(_unreached_level(shared, predicted, level, at))
        motions.append(_resonance(shared, motion, level, compared, section.span, section.periods))
        report_progress(progress, (index + 1) / len(levels))
        if stop_requested():
            break
    return PhaseResonanceLevels(
        outcome=_check_balance(_levels_outcome(motions, len(levels), unit), motions, unit),
        quantity=str(excitation.quantity),
        unit=unit,
        probes=[probe.name for probe in damped.probes],
        compared_probe_index=compared,
        scales=scales,
        predicted=predicted,
        motions=motions,
    )


def _levels_outcome(motions: Sequence[ResonantMotion], levels: int, unit: str) -> Outcome:
    """Outcome of all levels: interrupted, or some without a motion at phase resonance."""
    if len(motions) < levels:
        return interruption(f"after {len(motions)} of {levels} levels of nnm.phase_resonance")
    missing = [m.level for m in motions if not m.found]
    if not missing:
        return COMPLETE
    return Outcome.of(
        OutcomeKind.INCOMPLETE, "no_phase_resonance",
        "the damping is too strong for a single harmonic force to sustain the mode, or an internal resonance is "
        "close: no forced motion at phase resonance was found near the prediction",
        at=Where(missing, unit, "level"), remedy="try another level",
    )  # fmt: skip


def _check_balance(outcome: Outcome, motions: Sequence[ResonantMotion], unit: str) -> Outcome:
    """Mark the outcome as not reliable if a motion at phase resonance, or one about it, violates the energy balance."""
    parts = [] if outcome.complete else [outcome]
    for m in motions:
        curve = None if m.curve is None else m.curve.energy_error
        errors = np.append(np.zeros(0) if curve is None else curve, m.energy_error if m.found else 0.0)
        bad = ~(errors <= LARGEST_ERROR)
        if np.any(bad):
            lost = imbalance_outcome(float(errors.max()), int(bad.sum()), Where(m.level, unit, "level"))
            parts.insert(0, lost)
    return first_with_others(parts) if parts else outcome


def _predict_levels(setup: _LevelSetup, levels: list[float]) -> PredictedLevels:
    """Compute the levels along the backbone."""
    if setup.motions_scale:
        motion = setup.motion(setup.points[-1])
        drawn = np.geomspace(0.1 * min(levels), DRAWN_LEVEL_RATIO * max(levels), SCALED_POINTS)
        motions = [motion.with_scale(level / motion.level) for level in drawn]
    else:
        motions = setup.motions
    return PredictedLevels(
        energy=np.array([m.energy for m in motions]),
        frequency_hz=np.array([m.frequency_hz for m in motions]),
        level=np.array([m.level for m in motions]),
        dissipated=np.array([m.scale**2 * m.force.dissipated for m in motions]),
        contact_share=np.array([m.force.by_contacts / m.force.dissipated for m in motions]),
        amplitude=np.array([setup.amplitudes(m) for m in motions]).T,
    )


def _unreached_level(setup: _LevelSetup, predicted: PredictedLevels, level: float, at: str) -> Problem:
    """Problem of a level outside the backbone, with the energy that it would need (extrapolated as a power law)."""
    unit, e, levels = setup.unit, predicted.energy, predicted.level
    above = level > levels.max()
    k = slice(-2, None) if above else slice(0, 2)
    slope = float(np.diff(np.log(levels[k]))[0] / np.diff(np.log(e[k]))[0]) if e.size > 1 else 0.5
    slope = slope if 0.1 < slope < 10.0 else 0.5
    end = -1 if above else 0
    needed = e[end] * (level / levels[end]) ** (1.0 / slope)
    return Problem(
        at,
        f"= {level:g} {unit} lies {'beyond' if above else 'below'} the backbone, whose motions from {e[0]:.3g} to "
        f"{e[-1]:.3g} J need {levels.min():.4g} to {levels.max():.4g} {unit}",
        f"follow it to about {needed:.2g} J (nnm.continue_in: {{kind: energy, …}}), or use another level",
    )


def _resonance(
    setup: _LevelSetup, motion: _BackboneMotion, level: float, compared_probe: int, span: float, periods: int
) -> ResonantMotion:
    """Compute the exact motion near a prediction, the response about it, and the uncontrolled motion."""
    problem = setup.problem(level, motion.force.omega)
    point = _exact_motion(setup, problem, motion, level)
    left_alone = _uncontrolled_motion(setup, problem, motion, periods)
    predicted: dict[str, Any] = {
        "level": level,
        "predicted_frequency_hz": motion.frequency_hz,
        "predicted_energy": motion.energy,
        "predicted_amplitude": setup.amplitudes(motion),
        "uncontrolled": left_alone,
    }
    if point is None:
        nothing = np.full(len(setup.damped.probes), np.nan)
        return ResonantMotion(**predicted, amplitude=nothing, multipliers=np.zeros(0, dtype=complex))
    orbit = problem.orbit(point)
    cosine = quadrature(problem, point)[0]
    motion_found = setup.forced_measurement.of(problem, [point])[0]
    amplitude = motion_found.peak
    balanced = setup.motion_with(float(amplitude[compared_probe]), lambda m: float(setup.amplitudes(m)[compared_probe]))
    return ResonantMotion(
        **predicted,
        found=True,
        frequency_hz=point.parameter / (2 * np.pi),
        amplitude=amplitude,
        level_for_amplitude=np.nan if balanced is None else balanced.level,
        stable=orbit.stable,
        multipliers=orbit.multipliers,
        residual=orbit.residual,
        quadrature=cosine,
        energy_error=motion_found.energy_error,
        curve=_curve(setup, problem, point, span),
    )


def _exact_motion(
    setup: _LevelSetup, problem: ForcedOrbits, motion: _BackboneMotion, level: float
) -> BranchPoint | None:
    """Exact motion at phase resonance, from the prediction or via other motions of the same backbone."""
    for beginning, way in _paths_to_motion(setup, problem, motion, level):
        z, omega, point = beginning.states(np.zeros(1))[0], beginning.force.omega, None
        for here in way:
            point = find_phase_resonance(here, z, omega)
            if point is None:
                break
            z, omega = point.u[: 2 * setup.damped.dynamics.size], point.parameter
        if point is not None:
            return point
    problem.level = level
    return None


def _paths_to_motion(
    setup: _LevelSetup, problem: ForcedOrbits, motion: _BackboneMotion, level: float
) -> Iterator[tuple[_BackboneMotion, Iterable[ForcedOrbits]]]:
    """Starting motions, each with the problems that lead from it to the requested one.

    In thin tongues of internal resonance, which damping fills, the undamped mode is no good start. Other motions are
    therefore continued in the level, or in the stiffness factor along a backbone.
    """
    yield motion, [problem]

    def problems_at(levels: Floats) -> Iterator[ForcedOrbits]:
        for problem.level in levels.tolist():
            yield problem

    if setup.motions_scale:
        last = len(setup.points) - 1
        for begin in range(
            last - POINTS_BETWEEN_ATTEMPTS, max(last - ATTEMPTS * POINTS_BETWEEN_ATTEMPTS, -1), -POINTS_BETWEEN_ATTEMPTS
        ):
            other = setup.motion(setup.points[begin])
            factors = (setup.orbits.split(point.u)[2] for point in setup.points[begin:last])
            softer = (setup.problem(level, other.force.omega, factor) for factor in factors)
            yield other.with_scale(level / other.level), chain(softer, [problem])
        return
    near = [m for m in setup.motions if 1.0 / LARGEST_LEVEL_RATIO < m.level / level < LARGEST_LEVEL_RATIO]
    near.sort(key=lambda m: abs(np.log(m.level / level)) - m.share)
    for other in near[:ATTEMPTS]:
        count = 1 + int(abs(np.log(level / other.level)) / LEVEL_STEP)
        yield other, problems_at(np.geomspace(other.level, level, count + 1))


def _curve(setup: _LevelSetup, problem: ForcedOrbits, point: BranchPoint, span: float) -> ResponseAboutResonance:
    """Compute the response on both sides of a resonance."""
    low, high = (1.0 - span) * point.parameter, (1.0 + span) * point.parameter
    first = point.orient(1.0)
    halves: list[OrbitBranch] = []
    for start in (first, first.reverse()):
        branch = Branch(problem, start, low, high, Settings(most_points=600))
        points = list(branch)
        halves.append(OrbitBranch(problem, points, branch.outcome.in_unit(lambda omega: omega / (2 * np.pi), "Hz")))
        if branch.outcome.code == CLOSED_CURVE:
            break
    followed = join_directions(*halves)
    motions = setup.forced_measurement.of(problem, followed.points)
    return ResponseAboutResonance(
        outcome=COMPLETE if all(half.outcome.complete for half in halves) else followed.outcome,
        frequency_hz=followed.values / (2 * np.pi),
        amplitude=np.array([motion.peak for motion in motions]).T,
        stable=np.array([orbit.stable for orbit in followed.orbits]),
        energy_error=np.array([m.energy_error for m in motions]),
    )


def _uncontrolled_motion(
    setup: _LevelSetup, problem: ForcedOrbits, motion: _BackboneMotion, periods: int
) -> UncontrolledMotion | None:
    """Motion of the damped structure from the predicted state under the predicted force; None if contacts chatter."""
    flow = problem.flow.with_loads(motion.force.omega, motion.level)
    system = setup.damped.dynamics
    n, T = system.size, motion.period_motion.duration
    mode = motion.states(T * np.arange(SAMPLES_PER_PERIOD) / SAMPLES_PER_PERIOD)
    weight = np.concatenate([np.sqrt(system.stiffness), np.ones(n)])
    size = float(np.sqrt(2.0 * motion.energy))
    start = np.zeros(flow.size)
    start[: 2 * n] = mode[0]
    try:
        states, last = march_periods(flow, start, T, periods)
    except ArithmeticError:
        return None
    departure = np.linalg.norm((states[..., : 2 * n] - mode) * weight, axis=2).max(axis=1) / size
    # the mode is at rest at its own time 0 and half a period later
    rest = np.sort((np.array([0.0, 0.5 * T]) - motion.force.shift) % T)
    field = setup.damped.deflection
    whole = states.reshape(periods * SAMPLES_PER_PERIOD, -1)[:, :n]
    displacement = np.array([whole @ probe.shape for probe in setup.damped.probes])
    return UncontrolledMotion(
        time=np.arange(periods * SAMPLES_PER_PERIOD) * (T / SAMPLES_PER_PERIOD),
        displacement=displacement,
        frequency_hz=line_frequencies(T, periods),
        line=np.array([np.abs(RECTANGULAR.amplitudes(x)) for x in displacement]),
        departure=departure,
        instants=(periods - 1) * T + rest,
        shapes=flow.states_at(last, rest)[:, :n] @ field.T,
        mode_shapes=motion.states(rest)[:, :n] @ field.T,
    )
