"""Tables of branches of periodic motions, and one motion in time, for ``beamsim nnm``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from beamsim.analyses.nnm.layouts import BRANCHES, MOTION, POINTS
from beamsim.analyses.nnm.paths import UNITS, ModeBranches, ModePath
from beamsim.flow.periodic_flow import FlowMap, PeriodicFlow
from beamsim.labelled import Dataset
from beamsim.orbits.branch import FailedSearch, OrbitBranch
from beamsim.orbits.continuation import BranchStep, Settings
from beamsim.orbits.free_orbits import BrakeOrbits, slowest_instant
from beamsim.orbits.special_points import special_points as special_points_on
from beamsim.outcomes import stop_requested
from beamsim.responses.orbit_energies import energy_error
from beamsim.results.branch import (
    SpecialRow,
    endings,
    numbered_points,
    of_multipliers,
    of_states,
    special_points_table,
    special_row,
)
from beamsim.signals.records import RECTANGULAR
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Complexes, Floats

STORED_SAMPLES = 1024  # in a period of the stored motion
HARMONICS = 20
PERIODS = 50  # of the time history of the spectrum, as in the thesis
SAMPLES_PER_PERIOD = 512  # samples per period of the marched motion


def mode_shape(field: Floats, vector: Floats, reference_shape: Floats) -> Floats:
    """Linear mode at the stations, scaled like another shape for drawing.

    Parameters
    ----------
    field : (nx, n) deflection at the stations for a unit of each coordinate.
    vector : (n,) coordinates of the mode.
    reference_shape : (nx,) the other shape, m.

    Returns
    -------
    (nx,) array
        m, with the largest deflection and the sign of the other shape.
    """
    shape = field @ vector
    return np.asarray(
        shape
        / np.abs(shape).max()
        * float(np.abs(reference_shape).max())
        * np.sign(float(shape @ reference_shape) or 1.0),
        dtype=float,
    )


@dataclass(frozen=True)
class ModeBranch:
    """Branch of np free motions of n coordinates, each at its instant of smallest kinetic energy.

    The fields are variables of `POINTS`.
    """

    branch: OrbitBranch
    parameter: Floats  # (np,) in report units
    frequency_hz: Floats  # (np,)
    energy: Floats  # (np,)
    share: Floats  # (np,)
    residual: Floats  # (np,)
    energy_error: Floats  # (np,)
    states: Floats  # (np, 2n)
    least_kinetic: Floats  # (np,)
    stable: Sequence[bool]  # (np,)
    multipliers: Complexes  # (np, m)
    half_period_difference: Floats | None = None  # (np,) for a backbone by full-period shooting


def mode_branch(
    job: ModePath, brake: BrakeOrbits, branch: OrbitBranch, half_period_difference: Floats | None = None
) -> ModeBranch:
    """Compute the variables of a branch in SI units.

    Brake orbits, and motions found over the whole period with a fixed phase, are given at their start; non-brake orbits
    at their slowest instant.

    Parameters
    ----------
    job : path with the parameter of the branch, the structure and the requested mode.
    brake : shooting problem of the backbone.
    branch : branch of brake orbits, or of motions found over the whole period.
    half_period_difference : (np,) differences from half-period shooting, if known.

    Returns
    -------
    ModeBranch
        Branch with the energy error of each motion.
    """
    n, orbits = brake.n, branch.orbits
    states = np.array([orbit.state[: 2 * n] for orbit in orbits])
    least = np.zeros(len(orbits))
    if branch.problem is brake:
        shares = [brake.share_at(point) for point in branch.points]
    else:
        for k, point in enumerate(branch.points):
            flow, flow_map = point.data.flow, point.data.flow_map
            time, kinetic = slowest_instant(flow, flow_map, n)
            instant = np.array([time if branch.kind == "non_brake" else 0.0])
            states[k], least[k] = flow.states_at(flow_map, instant)[0, : 2 * n], kinetic / point.data.energy
        factors = [branch.problem.split(point.u)[2] for point in branch.points]
        shares = [brake.share(state[:n], factor, state[n:]) for state, factor in zip(states, factors, strict=True)]
    return ModeBranch(
        branch,
        parameter=np.array([job.in_report_unit(p.parameter) for p in branch.points]),
        frequency_hz=np.array([orbit.frequency_hz for orbit in orbits]),
        energy=np.array([orbit.energy for orbit in orbits]),
        share=np.array([share[job.mode] for share in shares]),
        residual=np.array([orbit.residual for orbit in orbits]),
        energy_error=np.array([energy_error(p.data.flow, p.data.flow_map) for p in branch.points]),
        states=states,
        least_kinetic=least,
        stable=[orbit.stable for orbit in orbits],
        multipliers=np.array([orbit.multipliers for orbit in orbits]),
        half_period_difference=half_period_difference,
    )


_SAME_NAMES = ("parameter", "frequency_hz", "energy", "share", "residual", "energy_error", "least_kinetic", "stable")


def mode_datasets(job: ModePath, branches: Sequence[ModeBranch], special: Sequence[SpecialRow]) -> dict[str, Dataset]:
    """Datasets of branches, their points, and the special points of the backbone, by name.

    Parameters
    ----------
    job : path with the parameter of the branches, and the structure.
    branches : branches, the backbone first.
    special : special points of the backbone.
    """
    unit, field = UNITS[job.parameter], job.system.deflection
    states = np.concatenate([each.states for each in branches])
    about = {
        "branch": np.arange(len(branches)),
        "kind": [each.branch.kind for each in branches],
        "mode": [each.branch.mode + 1 for each in branches],
        "ratio": [each.branch.ratio for each in branches],
        "continued_in": job.parameter,
        "method": job.settings.method.kind,
        **endings(each.branch.outcome for each in branches),
    }
    differences = None
    if any(each.half_period_difference is not None for each in branches):
        differences = np.concatenate([
            np.full(each.parameter.size, np.nan) if each.half_period_difference is None else each.half_period_difference
            for each in branches
        ])  # fmt: skip
    values = {
        **numbered_points([each.parameter.size for each in branches]),
        **{name: np.concatenate([getattr(each, name) for each in branches]) for name in _SAME_NAMES},
        **of_states(states, field.shape[1]),
        **of_multipliers([each.multipliers for each in branches]),
        "station": np.arange(1, field.shape[0] + 1),
        # one after the other: multiplying all states at once rounds differently
        "initial_displacement": np.concatenate([each.states[:, : field.shape[1]] @ field.T for each in branches]),
        "half_period_difference": differences,
    }
    return {
        "branches": BRANCHES.dataset(about),
        "points": POINTS.dataset(values, unit=unit, parameter=job.parameter.replace("_", " ")),
        "special_points": special_points_table([special, *[()] * (len(branches) - 1)], unit),
    }


def special_points(job: ModePath, branches: ModeBranches) -> tuple[tuple[SpecialRow, ...], list[FailedSearch], bool]:
    """Locate folds, branch points and grazings along a backbone, but not across its jumps.

    Parameters
    ----------
    job : path with the parameter of the backbone.
    branches : with the backbone.

    Returns
    -------
    special : the points, in the order of the backbone.
    failed : searches that ended in a numerical error.
    stopped : True after an interruption.
    """
    special: list[SpecialRow] = []
    failed: list[FailedSearch] = []
    names, orbits = job.system.contact_names, branches.problem
    settings = Settings(iterations=10)
    for a, b in pairwise(branches.backbone.points):
        if a.parameter in branches.gaps:
            continue
        if stop_requested():
            return tuple(special), failed, True
        for located in special_points_on(BranchStep(orbits, a, b, settings), failed):
            period = orbits.split(located.point.u)[1]
            special.append(special_row(located, job.in_report_unit(located.parameter), 1.0 / period, names))
    return tuple(special), failed, False


def orbit_motion(
    system: StructuralSystem, flow: Any, state: Floats, period: float, mode: Floats, branch: int = 0, point: int = 1
) -> Dataset:
    """Dataset of one motion over a period from a state, and its spectrum over 50 periods of the exact flow.

    The motion is marched without correction to the periodic orbit: an unstable one drifts away, and the spectrum then
    shows it.

    Parameters
    ----------
    system : system of the motion.
    flow : flow of this system without damping and loads.
    state : (2n,) coordinates and their velocities at the start.
    period : s.
    mode : (n,) coordinates of the linear mode for the picture.
    branch, point : index of the branch, from 0, and number of the point along it, from 1.

    Returns
    -------
    Dataset
        `MOTION`, with the drift after the 50 periods.

    Raises
    ------
    ArithmeticError
        If contacts chatter, or the motion overflows.
    """
    n = system.dynamics.size
    start = np.zeros(flow.size)
    start[: 2 * n] = state
    whole = flow.flow_map(start, period)
    time = np.linspace(0.0, period, STORED_SAMPLES + 1)
    states = flow.states_at(whole, time)
    q, v, delta = states[:, :n], states[:, n : 2 * n], flow.penetration_of(states, time)[0]
    shapes = [probe.shape for probe in system.probes]
    over, last = march_periods(flow, start, period, PERIODS)
    w = np.concatenate([np.maximum(np.sqrt(flow.system.stiffness), 0.2 * np.pi / period), np.ones(n)])
    off = np.linalg.norm(w * (last.end - start)[: 2 * n]) / np.linalg.norm(w * start[: 2 * n])
    record = over.reshape(PERIODS * SAMPLES_PER_PERIOD, -1)[:, :n]
    harmonics = np.array([RECTANGULAR.amplitudes(q[:-1] @ shape)[: HARMONICS + 1] for shape in shapes])
    laws = flow.system.contacts.laws
    values = {
        "branch": branch,
        "branch_point": point,
        "periods": PERIODS,
        "drift": float(off),
        "time": time,
        "probe": [probe.name for probe in system.probes],
        "displacement": np.array([q @ shape for shape in shapes]),
        "velocity": np.array([v @ shape for shape in shapes]),
        "order": np.arange(HARMONICS + 1),
        "harmonic_real": harmonics.real,
        "harmonic_imag": harmonics.imag,
        "spectrum_frequency_hz": line_frequencies(period, PERIODS),
        "spectrum": np.array([np.abs(RECTANGULAR.amplitudes(record @ shape)) for shape in shapes]),
        "snubber": [snubber.name for snubber in system.snubbers],
        "force": np.array([laws[i].static_force(delta[:, i]) for i in range(len(system.snubbers))]),
        **_drawn_shapes(system, q, mode),
    }
    return MOTION.dataset(values, {"snubber": [{"force_unit": each.force_unit} for each in system.snubbers]})


def _drawn_shapes(system: StructuralSystem, q: Floats, mode: Floats) -> dict[str, Any]:
    """Deflections at the stations for coordinates (nt, n) of a motion, and for the linear mode."""
    deflection = q @ system.deflection.T
    return {
        "station": np.arange(1, deflection.shape[1] + 1),
        "deflection": deflection,
        "instant": np.array([0.0, 0.5]),
        "extreme_shapes": deflection[[0, STORED_SAMPLES // 2]],
        "linear_shape": mode_shape(system.deflection, mode, deflection[0]),
    }


def march_periods(flow: PeriodicFlow, start: Floats, period: float, periods: int) -> tuple[Floats, FlowMap]:
    """March a motion over many periods, without correction to the periodic orbit.

    Parameters
    ----------
    flow : flow of the system.
    start : (N,) initial state.
    period : s.
    periods : number P of periods.

    Returns
    -------
    states : (P, RATE, N) at equal steps.
    last : flow map of the last period.

    Raises
    ------
    ArithmeticError : if contacts chatter, or the motion overflows.
    """
    times = period * np.arange(SAMPLES_PER_PERIOD) / SAMPLES_PER_PERIOD
    states, flow_map = [], flow.flow_map(start, period)
    for k in range(periods):
        flow_map = flow.flow_map(flow_map.end, period) if k else flow_map
        states.append(flow.states_at(flow_map, times))
    return np.array(states), flow_map


def line_frequencies(period: float, periods: int) -> Floats:
    """(nf,) frequencies, Hz, of the spectral lines of a motion over some periods."""
    return np.arange(periods * SAMPLES_PER_PERIOD // 2 + 1) / (periods * period)
