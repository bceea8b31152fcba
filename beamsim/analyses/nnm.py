"""``beamsim nnm``: a nonlinear normal mode followed in stiffness, energy or frequency, with all it meets."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from beamsim.analyses.nnm_results import BranchJump, ModeBranch, NormalModeResult, OrbitMotion
from beamsim.analyses.orbit_events import OrbitEvent
from beamsim.analyses.run import versions
from beamsim.dynamics.backbone import Backbone
from beamsim.dynamics.continuation import BranchPoint, Settings, solve_at
from beamsim.dynamics.reversible import BrakeOrbits, ContactStiffness, follow_modes, linear_mode, mode_points
from beamsim.dynamics.smooth_flow import CubicStiffness
from beamsim.errors import Problem, ScenarioError
from beamsim.model.build import build_system
from beamsim.model.equilibrium import find_equilibrium
from beamsim.model.snubbers import springs_of
from beamsim.model.structure import StructuralSystem
from beamsim.model.system import PiecewiseLinearSystem
from beamsim.scenario.excitation import NoExcitation

if TYPE_CHECKING:
    from beamsim.scenario import Scenario

__all__ = ["conservative_system", "nnm"]

Floats = NDArray[np.float64]

SAMPLES = 1024  # of a period, in the stored motion
HARMONICS = 20
POINTS = 100  # of a backbone
MOST_POINTS = 3000  # in frequency
MOST_ENERGY = 1e8  # times that of the first point, in frequency
START_ATTEMPTS = 12  # decades of energy tried for a linear motion to begin with


def conservative_system(scenario: Scenario) -> StructuralSystem:
    """The scenario's structure without excitation, damping and dashpots."""
    system = build_system(scenario.model_copy(update={"run": None, "excitation": NoExcitation()}))
    dynamics = system.dynamics
    contacts = dynamics.contacts
    none = np.zeros_like(contacts.dashpot)
    undamped = replace(
        dynamics,
        damping=np.zeros_like(dynamics.damping),
        contacts=replace(contacts, dashpot=none, no_tension=np.zeros(contacts.count, dtype=bool)),
    )
    return replace(system, dynamics=undamped)


def nnm(scenario: Scenario, progress: Callable[[float], None] | None = None) -> NormalModeResult:
    """Follow the nonlinear normal mode that a scenario asks for.

    Raises
    ------
    ScenarioError
        Where the scenario asks for no mode, or for one that doesn't exist.
    """
    begin, processor = clock.perf_counter(), clock.process_time()
    if scenario.nnm is None:
        raise ScenarioError(Problem("nnm", "is missing", "add for example `nnm: {mode: 1}`"))
    system = conservative_system(scenario)
    job = _prepare(scenario, system)
    followed = job.follow(progress)
    spent = clock.process_time() - processor
    last = followed.orbits.mode(followed.points[-1])
    motion, stations = _motion(system, followed)
    field = _stations(system)
    position = system.modes.position if system.beam is None else system.beam.position
    shape = field @ followed.orbits.vectors[:, job.mode]
    at_rest = stations[[0, (stations.shape[0] - 1) // 2]]
    largest = float(np.abs(at_rest[0]).max())
    shape = shape / np.abs(shape).max() * largest * np.sign(float(shape @ at_rest[0]) or 1.0)
    branches = _branches(system, job, followed)
    backbone = branches[0]
    status = "complete" if followed.status.startswith("complete") else followed.status
    summary: dict[str, Any] = {
        "mode": job.mode + 1,
        "continued_in": job.parameter,
        "points": int(backbone.parameter.size),
        "start": _end(backbone, 0),
        "end": _end(backbone, -1),
        "period_s": last.period,
        "stable_points": int(np.count_nonzero(backbone.stable)),
        "largest_residual": float(backbone.residual.max()),
        "smallest_share": float(backbone.share.min()),
        "internal_resonances": [
            {"mode": b.mode, "ratio": b.ratio, "parameter": float(b.parameter[0]), "points": int(b.parameter.size)}
            for b in branches[1:]
        ],
        "jumps": [vars(jump) for jump in followed.jumps],
        "grazings": sum(1 for event in backbone.special if event.kind == "grazing"),
        "linear_frequency_hz": float(followed.orbits.omega[job.mode] / (2 * np.pi)),
        "processor_time_s": spent,
        "status": status,
    }
    return NormalModeResult(
        scenario=scenario,
        mode=job.mode + 1,
        parameter=job.parameter,
        status=status,
        branches=branches,
        jumps=followed.jumps,
        position=position,
        linear_shape=shape,
        extreme_shapes=at_rest,
        motion=motion,
        modes=system.modes,
        summary=summary,
        warnings=(*scenario.warnings, *system.warnings),
        wall_time_s=clock.perf_counter() - begin,
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        provenance=versions(),
    )


@dataclass
class _Followed:
    """A backbone with what was found beside it."""

    orbits: BrakeOrbits
    points: list[BranchPoint]
    status: str
    tongues: tuple[Any, ...] = ()
    jumps: tuple[BranchJump, ...] = ()


@dataclass
class _Job:
    """What to follow, from where to where."""

    family: ContactStiffness | CubicStiffness
    mode: int  # from 0
    parameter: str
    first: float
    last: float
    energy: float
    basis: tuple[Floats, Floats] | None
    away_from: Floats | None

    def follow(self, progress: Callable[[float], None] | None) -> _Followed:
        if self.parameter == "stiffness_factor":
            return self._in_factor(progress)
        if self.parameter == "energy":
            return self._in_energy(np.log(self.first), np.log(self.last), progress)
        return self._in_frequency(progress)

    def _in_factor(self, progress: Callable[[float], None] | None) -> _Followed:
        orbits = BrakeOrbits(self.family, energy=self.energy)
        start = solve_at(orbits, linear_mode(orbits, self.mode, 0.0, self.away_from), Settings(), 0.0)
        if start is None:
            raise ScenarioError(
                Problem("nnm.mode", f"= {self.mode + 1} gives no motion to begin with", "ask for another")
            )
        if self.first != 0.0:
            way = Backbone(orbits, start, self.first, self.mode, points=40)
            start = list(way)[-1]
            if not way.status.startswith("complete"):
                raise ScenarioError(
                    Problem("nnm.continue_in.from", f"= {self.first:g} was not reached: {way.status}", "begin at 0")
                )
        return self._backbone(orbits, start, self.last, progress)

    def _small(self) -> tuple[BrakeOrbits, BranchPoint]:
        """A motion so small that it is linear, or nearly so."""
        orbits = BrakeOrbits(self.family, "energy", basis=self.basis)
        value = np.log(self.first if self.parameter == "energy" else self.energy)
        for _ in range(START_ATTEMPTS):
            guess = linear_mode(orbits, self.mode, value, self.away_from)
            point = solve_at(orbits, guess, Settings(), value)
            if point is not None:
                mode = orbits.mode(point)
                shift = abs(mode.period * float(orbits.omega[self.mode]) / (2 * np.pi) - 1.0)
                if shift < 1e-3 and float(mode.share[self.mode]) > 0.9:
                    return orbits, point
            value -= np.log(10.0)
        raise ScenarioError(
            Problem(
                "nnm.continue_in.from",
                f"= {self.first:g} has no nearly linear motion below it to begin with",
                "give a lower energy, or a gap or preload that leaves small motions linear",
            )
        )

    def _in_energy(self, first: float, last: float, progress: Callable[[float], None] | None) -> _Followed:
        orbits, start = self._small()
        if abs(start.parameter - first) > 1e-12:
            way = Backbone(orbits, start, first, self.mode, points=60)
            start = list(way)[-1]
            if not way.status.startswith("complete"):
                raise ScenarioError(
                    Problem(
                        "nnm.continue_in.from", f"was not reached: {way.status}", "give a lower energy to begin with"
                    )
                )
        return self._backbone(orbits, start, last, progress)

    def _in_frequency(self, progress: Callable[[float], None] | None) -> _Followed:
        orbits, start = self._small()
        first, last = 2 * np.pi * self.first, 2 * np.pi * self.last
        low, high = sorted((first, last))
        way = Backbone(orbits, start, start.parameter + 30.0, self.mode, points=200)
        before: BranchPoint | None = None
        found: BranchPoint | None = None
        by_frequency = BrakeOrbits(self.family, "frequency", basis=self.basis)
        for point in way:
            omega = 2 * np.pi / float(point.u[-2])
            if before is not None and (2 * np.pi / float(before.u[-2]) - first) * (omega - first) <= 0:
                found = _at_frequency(by_frequency, before, point, first, last - first)
                if found is not None:
                    break
            before = point
        if found is None:
            raise ScenarioError(
                Problem(
                    "nnm.continue_in.from",
                    f"= {self.first:g} Hz is not reached by mode {self.mode + 1}",
                    f"choose one beyond {orbits.omega[self.mode] / (2 * np.pi):.6g} Hz that its backbone passes",
                )
            )
        branch = follow_modes(by_frequency, found, low, high, Settings(most_points=MOST_POINTS))
        points: list[BranchPoint] = []
        status = ""
        for point in _reporting(branch, found.parameter, last, progress):
            points.append(point)
            if not 1.0 / MOST_ENERGY < point.data.energy / found.data.energy < MOST_ENERGY:
                status = (
                    f"stopped at {point.parameter / (2 * np.pi):.6g} Hz: the energy is {point.data.energy:.3g} J and "
                    "runs away at nearly constant frequency (a tongue of internal resonance); follow the energy instead"
                )
                break
        return _Followed(by_frequency, points, status or branch.status)

    def _backbone(
        self, orbits: BrakeOrbits, start: BranchPoint, last: float, progress: Callable[[float], None] | None
    ) -> _Followed:
        backbone = Backbone(orbits, start, last, self.mode, points=POINTS)
        points = list(_reporting(backbone, start.parameter, last, progress))
        jumps = tuple(BranchJump(self.shown(j.start), self.shown(j.end), j.mode + 1, j.ratio) for j in backbone.jumps)
        return _Followed(orbits, points, backbone.status, tuple(backbone.tongues), jumps)

    def shown(self, value: float) -> float:
        """The parameter as people read it: J instead of its logarithm, Hz instead of rad/s."""
        if self.parameter == "energy":
            return float(np.exp(value))
        return value / (2 * np.pi) if self.parameter == "frequency" else value


def _at_frequency(
    orbits: BrakeOrbits, a: BranchPoint, b: BranchPoint, omega: float, forward: float
) -> BranchPoint | None:
    """The motion of a frequency between two motions; never the rest, which has every frequency."""
    wa, wb = 2 * np.pi / float(a.u[-2]), 2 * np.pi / float(b.u[-2])
    share = 0.0 if wa == wb else (omega - wa) / (wb - wa)
    for s in (share, 1.0, 0.0):
        q = (1 - s) * a.u[: orbits.n] + s * b.u[: orbits.n]
        guess = orbits.unknowns(q, 2 * np.pi / omega, omega)
        point = solve_at(orbits, guess, Settings(iterations=15), omega, forward)
        if point is not None and 0.5 * a.data.energy < point.data.energy < 2.0 * b.data.energy:
            return point
    return None


def _reporting(
    points: Iterable[BranchPoint], first: float, last: float, progress: Callable[[float], None] | None
) -> Iterable[BranchPoint]:
    for point in points:
        if progress is not None:
            progress((point.parameter - first) / (last - first))
        yield point


def _prepare(scenario: Scenario, system: StructuralSystem) -> _Job:
    settings = scenario.nnm
    assert settings is not None
    mode = settings.mode - 1
    dynamics = system.dynamics
    contacts = dynamics.contacts
    if mode >= system.modes.kept_modes:
        raise ScenarioError(
            Problem(
                "nnm.mode",
                f"= {settings.mode} is not among the {system.modes.kept_modes} modes of the model",
                "choose a lower mode, or raise reduction.modes or beam.elements",
            )
        )
    if dynamics.stiffness[mode] <= 0:
        raise ScenarioError(
            Problem(
                "nnm.mode", f"= {settings.mode} is a rigid-body mode, which does not vibrate", "ask for a higher mode"
            )
        )
    if contacts.count == 0 and system.cubic.count == 0:
        raise ScenarioError(Problem("nnm", "has no snubber or cubic spring to work on", "add one under snubbers"))
    loaded = bool(np.any(dynamics.constant_load))
    touching = not np.any(contacts.gap) and not loaded and system.cubic.count == 0
    going = settings.continue_in
    energy = settings.energy
    if going.kind != "stiffness_factor" and touching:
        raise ScenarioError(
            Problem(
                "nnm.continue_in.kind",
                f"= {going.kind} changes nothing: with every gap zero the frequency does not depend on the energy",
                "use stiffness_factor, or give a gap",
            )
        )
    if going.kind == "stiffness_factor" and energy is None:
        if not touching:
            raise ScenarioError(
                Problem(
                    "nnm.energy",
                    "is missing: with a gap, a load or a cubic spring the motion depends on its energy",
                    "add for example `energy: 0.1 J`",
                )
            )
        energy = 1.0
    family: ContactStiffness | CubicStiffness
    basis = None
    if system.cubic.count:
        if np.any(contacts.gap < 0) or loaded:
            raise ScenarioError(
                Problem(
                    "nnm", "follows structures with cubic springs that rest at zero deflection only",
                    "leave out prestress, gravity and constant forces",
                )
            )  # fmt: skip
        family = CubicStiffness(dynamics, system.cubic.shape, system.cubic.stiffness)
    elif np.any(contacts.gap < 0) or loaded:
        family = ContactStiffness(dynamics, _equilibrium(system))
        if going.kind != "stiffness_factor":
            basis = family.modes_at_rest()
    else:
        family = ContactStiffness(dynamics)
    away = (contacts.sign @ contacts.shape) if contacts.count else None
    if away is not None and basis is not None:
        away = -away  # at rest with the contacts closed, where the closed structure's modes share out all the energy
    first = getattr(going, "from_", 0.0)
    return _Job(
        family, mode, going.kind, float(first), float(going.to), 1e-6 if energy is None else float(energy), basis, away
    )


def _equilibrium(system: StructuralSystem) -> Callable[[PiecewiseLinearSystem], Floats]:
    rigid = int(np.count_nonzero(system.dynamics.stiffness == 0))

    def rest(dynamics: PiecewiseLinearSystem) -> Floats:
        found = find_equilibrium(
            dynamics.stiffness, rigid, springs_of(dynamics.contacts), dynamics.constant_load[None, :]
        )
        if found.q is None:
            raise ScenarioError(
                Problem("nnm", f"has no static equilibrium to vibrate about: {found.reason}", "support the structure")
            )
        return found.q

    return rest


def _stations(system: StructuralSystem) -> Floats:
    """(nx, n) deflection at the stations for a unit of each coordinate."""
    if system.beam is not None:
        return system.beam.deflection
    return np.asarray(system.modes.shapes.T)


def _motion(system: StructuralSystem, followed: _Followed) -> tuple[OrbitMotion, Floats]:
    """The last point's motion over a period, from rest to rest."""
    point = followed.points[-1]
    passage, flow = point.data.passage, point.data.flow
    whole = flow.carry(passage.start, 2 * passage.duration)
    time = np.linspace(0.0, whole.duration, SAMPLES + 1)
    states = flow.states_at(whole, time)
    n = system.dynamics.size
    q, v = states[:, :n], states[:, n:]
    delta = np.maximum(flow.penetration(whole, time)[0], 0.0) * flow.system.contacts.stiffness
    probes = {p.name: p.shape for p in system.probes}
    harmonics = {}
    for name, shape in probes.items():
        c = 2.0 * np.fft.rfft(q[:-1] @ shape)[: HARMONICS + 1] / SAMPLES
        c[0] *= 0.5
        harmonics[name] = c
    stations = q @ _stations(system).T
    motion = OrbitMotion(
        time,
        {name: q @ shape for name, shape in probes.items()},
        {name: v @ shape for name, shape in probes.items()},
        {s.name: delta[:, i] for i, s in enumerate(system.snubbers)},
        stations,
        harmonics,
    )
    return motion, stations


def _branch(
    system: StructuralSystem, job: _Job, orbits: BrakeOrbits, points: list[BranchPoint], status: str, **kind: Any
) -> ModeBranch:
    modes = [orbits.mode(point) for point in points]
    field = _stations(system)
    shapes = np.array([m.shape for m in modes])
    return ModeBranch(
        status=status,
        parameter=np.array([job.shown(p.parameter) for p in points]),
        frequency_hz=np.array([m.frequency for m in modes]),
        energy=np.array([m.energy for m in modes]),
        share=np.array([m.share[job.mode] for m in modes]),
        residual=np.array([m.residual for m in modes]),
        coordinates=shapes,
        initial_displacement=shapes @ field.T,
        stable=np.array([m.stable for m in modes]),
        floquet_multipliers=np.array([m.multipliers for m in modes]),
        **kind,
    )


def _branches(system: StructuralSystem, job: _Job, followed: _Followed) -> tuple[ModeBranch, ...]:
    special: list[OrbitEvent] = []
    names = [s.name for s in system.snubbers]
    gaps = {jump.start for jump in followed.jumps}
    settings = Settings(iterations=10)
    for a, b in zip(followed.points[:-1], followed.points[1:], strict=True):
        if job.shown(a.parameter) in gaps or followed.orbits.same_events(a, b):
            continue
        for found in mode_points(followed.orbits, a, b, settings):
            period = followed.orbits.split(found.point.u)[1]
            name = names[found.contact] if found.contact >= 0 else ""
            special.append(OrbitEvent(found.kind, job.shown(found.parameter), 1.0 / period, name, found.time))
    out = [
        _branch(system, job, followed.orbits, followed.points, followed.status, kind="backbone", special=tuple(special))
    ]
    out += [
        _branch(
            system, job, followed.orbits, tongue.points, tongue.status, kind="tongue", mode=tongue.mode + 1,
            ratio=tongue.ratio,
        )
        for tongue in followed.tongues
    ]  # fmt: skip
    return tuple(out)


def _end(branch: ModeBranch, index: int) -> dict[str, float]:
    return {
        "parameter": float(branch.parameter[index]),
        "frequency_hz": float(branch.frequency_hz[index]),
        "energy_j": float(branch.energy[index]),
    }
