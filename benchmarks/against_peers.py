"""The exact march compared with a compiled DOP853, as one would write it for these cases: time, error and ratio.

``python -m benchmarks.against_peers``. The integrator is compiled by Numba, takes SciPy's coefficients, has an adaptive
step and knows nothing of the contacts: steps go across openings and closings, and only the error estimate notices.
Where pyYeti is installed, its Newmark solver follows, with the stop as a nonlinear force.
Motions are compared at a hundred times, at which steps end. The reference is the integrator with a tolerance of 1e-13.
Response curves follow, compared with programs for harmonic balance (`benchmarks.peer_curves`).
"""

from __future__ import annotations

import argparse
import importlib.util
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numba
import numpy as np
from scipy.integrate._ivp import dop853_coefficients as dop

import beamsim
from beamsim.flow.exact import exact_flow
from beamsim.flow.transient import simulate
from beamsim.system.build import build_system
from benchmarks import peer_curves
from benchmarks.measure import CASE, processor_time

CASES: dict[str, tuple[str, dict[str, object]]] = {
    "README's run (0.8 s)": (CASE, {}),
    "two masses at 0.65 rad/s (500 s)": (
        "configs/continuation/chain_two_dof.yaml", {"excitation.frequency": "0.65 rad/s", "run.duration": "500 s"},
    ),
}  # fmt: skip
TOLERANCES = (1e-6, 1e-9, 1e-12)
REFERENCE = 1e-13
CHECKED = 100  # times at which motions are compared
REPETITIONS = 5
STEPS = (200, 800, 3200)  # of the Newmark solver between two of these times

Floats = Any


class Equations(NamedTuple):
    """q'' + C q' + K q = constant + cosine cos(w t) + sine sin(w t) + pushes of one-sided springs with dashpots."""

    stiffness: Floats  # (n,)
    damping: Floats  # (n, n)
    loads: Floats  # (3, n) constant, cosine, sine
    omega: float  # rad/s
    row: Floats  # (m, n) of the penetrations, positive where it grows
    gap: Floats  # (m,) m
    spring: Floats  # (m,) N/m
    dashpot: Floats  # (m,) N s/m


def equations(system: Any) -> Equations:
    """Those of a built system with a harmonic load and snubbers that do not feel the motion of the base."""
    dynamics, contacts = system.dynamics, system.dynamics.contacts
    omega = 2 * np.pi * system.excitation_frequency_hz
    quarter = np.array([0.0, 0.5 * np.pi / omega])
    signals = np.array([signal(quarter) for signal in system.forcing.signal])
    cosine, sine = signals.T @ system.forcing.load
    closed = contacts.arrays.force[:, 1]  # of the second phase: penetration, its rate, 1
    return Equations(
        dynamics.stiffness, np.ascontiguousarray(dynamics.damping), np.array([dynamics.constant_load, cosine, sine]),
        omega, -contacts.sign[:, None] * contacts.shape, contacts.gap, closed[:, 0].copy(), closed[:, 1].copy(),
    )  # fmt: skip


@numba.njit(cache=True)
def _rate(t, y, e, out):  # type: ignore[no-untyped-def]
    n = e.stiffness.size
    c, s = np.cos(e.omega * t), np.sin(e.omega * t)
    for i in range(n):
        out[i] = y[n + i]
        a = e.loads[0, i] + e.loads[1, i] * c + e.loads[2, i] * s - e.stiffness[i] * y[i]
        for j in range(n):
            a -= e.damping[i, j] * y[n + j]
        out[n + i] = a
    for j in range(e.gap.size):
        depth, speed = -e.gap[j], 0.0
        for i in range(n):
            depth += e.row[j, i] * y[i]
            speed += e.row[j, i] * y[n + i]
        if depth > 0.0:
            push = e.spring[j] * depth + e.dashpot[j] * speed
            for i in range(n):
                out[n + i] -= e.row[j, i] * push


@numba.njit(cache=True)
def _dop853(e, start, times, rtol, scale, A, B, C, E3, E5):  # type: ignore[no-untyped-def]
    """States (nt, 2n) at times and the number of evaluations (Hairer, Norsett, Wanner, Solving ODEs I, II.10)."""
    size, stages = start.size, B.size
    K, y, stage, out = np.zeros((stages + 1, size)), start.copy(), np.zeros(size), np.zeros((times.size, size))
    t, h, evaluations = 0.0, 1e-3 / e.omega, 0
    _rate(t, y, e, K[0])
    for k in range(times.size):
        while t < times[k]:
            step = min(h, times[k] - t)
            for s in range(1, stages):
                for i in range(size):
                    stage[i] = y[i]
                    for r in range(s):
                        stage[i] += step * A[s, r] * K[r, i]
                _rate(t + C[s] * step, stage, e, K[s])
            for i in range(size):
                stage[i] = y[i]
                for r in range(stages):
                    stage[i] += step * B[r] * K[r, i]
            _rate(t + step, stage, e, K[stages])
            evaluations += stages
            fifth = third = 0.0
            for i in range(size):
                a = b = 0.0
                for r in range(stages + 1):
                    a += E5[r] * K[r, i]
                    b += E3[r] * K[r, i]
                allowed = rtol * max(abs(y[i]), abs(stage[i]), scale[i])
                fifth += (a / allowed) ** 2
                third += (b / allowed) ** 2
            error = 0.0
            if fifth > 0.0:
                error = step * fifth / np.sqrt((fifth + 0.01 * third) * size)
            if error < 1.0:
                t = times[k] if step == times[k] - t else t + step
                y[:] = stage
                K[0] = K[stages]
            if error >= 1.0 or step == h:  # a step that was cut at a time says nothing about the next one
                h = step * min(10.0, max(0.2, 0.9 * error ** (-0.125))) if error > 0.0 else 10.0 * step
        out[k] = y
    return out, evaluations


def pyyeti_newmark(e: Equations, start: Floats, step: float, count: int) -> Floats:
    """Displacements (count, n) at the steps of pyYeti's Newmark solver, the stop's dashpot by backward differences."""
    from pyyeti.ode import SolveNewmark

    n, times = e.stiffness.size, step * np.arange(count)
    loads = e.loads[0] + np.outer(np.cos(e.omega * times), e.loads[1]) + np.outer(np.sin(e.omega * times), e.loads[2])

    def push(d: Floats, j: int, h: float) -> Floats:
        depth = e.row @ d[:, j] - e.gap
        speed = e.row @ (d[:, j] - d[:, j - 1]) / h if j else np.zeros(e.gap.size)
        return np.where(depth > 0.0, -e.spring * depth - e.dashpot * speed, 0.0)

    solver = SolveNewmark(np.eye(n), e.damping, np.diag(e.stiffness), step)
    solver.def_nonlin({"stops": (push, e.row.T)})
    return solver.tsolve(loads.T, d0=start[:n], v0=start[n:]).d.T


def measured(work: Callable[[], Any], repetitions: int = REPETITIONS) -> tuple[float, Any]:
    """Least processor time of several calls, s, and what the last one returns."""
    results: list[Any] = [work()]  # compiles
    return min(processor_time(lambda: results.append(work())) for _ in range(repetitions)), results[-1]


def compare(label: str, case: str, changes: dict[str, object]) -> None:
    """Print one case: a row for the march and for each tolerance of the integrator."""
    scenario = beamsim.load_scenario(case, changes)
    assert scenario.run is not None
    system, duration = build_system(scenario), scenario.run.duration
    times = duration * np.arange(1, CHECKED + 1) / CHECKED
    seconds, motion = measured(lambda: simulate(exact_flow(system, duration), system.initial_state))
    shape = system.probes[0].shape
    exact = motion.states_at(times)
    n = system.dynamics.size
    scale = np.repeat([np.abs(exact[:, :n]).max(), np.abs(exact[:, n:]).max()], n)
    problem = equations(system)
    tables = (dop.A[: dop.N_STAGES, : dop.N_STAGES], dop.B, dop.C[: dop.N_STAGES], dop.E3, dop.E5)

    def stepped(rtol: float) -> tuple[Floats, int]:
        return _dop853(problem, system.initial_state, times, rtol, 1e-3 * scale, *tables)  # type: ignore[no-any-return]

    reference = stepped(REFERENCE)[0][:, :n] @ shape
    peak = np.abs(reference).max()

    def row(method: str, cost: float, states: Floats, work: str) -> None:
        error = np.abs(states[:, :n] @ shape - reference).max() / peak
        print(f"| {label} | {method} | {1e3 * cost:.3g} ms | {cost / seconds:.3g} | {error:.1e} | {work} |")

    row("beamsim", seconds, exact, f"{motion.event_time.size} events")
    for rtol in TOLERANCES:
        cost, (states, evaluations) = measured(lambda rtol=rtol: stepped(rtol))  # type: ignore[misc]
        row(f"DOP853, rtol {rtol:g}", cost, states, f"{evaluations} evaluations")
    if importlib.util.find_spec("pyyeti") is None:
        print("pyYeti is not installed: skipped")
        return
    for steps in STEPS:
        count, step = CHECKED * steps + 1, duration / (CHECKED * steps)
        cost, moved = measured(partial(pyyeti_newmark, problem, system.initial_state, step, count), repetitions=1)
        row(f"pyYeti, Newmark, step {step:.2g} s", cost, moved[steps::steps], f"{count - 1} steps")


def main() -> None:
    """Print the table."""
    argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0]).parse_args()
    print("| case | method | processor time | ratio | error of the first probe, over its peak | work |")
    print("|---|---|---|---|---|---|")
    for label, (case, changes) in CASES.items():
        compare(label, case, changes)
    print()
    for line in peer_curves.rows():
        print(line, flush=True)


if __name__ == "__main__":
    main()
