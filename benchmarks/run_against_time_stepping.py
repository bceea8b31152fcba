"""Closed-form flow against time stepping for the 65 Hz case of the thesis: processor time and error.

    python -m benchmarks.run_against_time_stepping [--quick]

One process, processor time, ratios to the exact flow. The error of a method is the largest difference of any
coordinate from the exact flow over 0.8 s, relative to the peak of the coordinate. For each method the table shows the
cheapest tolerance with an error of at most 1e-9, or the tightest tolerance if none achieves this. Newmark's method and
HHT, compiled, have rows for steps of 1e-5 s and 1e-6 s.
"""

from __future__ import annotations

import argparse
import os
import time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # spinning idle threads would count as processor time

import numpy as np
from numba import njit
from scipy.integrate import ode

import beamsim
from beamsim.flow.exact import exact_flow
from beamsim.flow.reference import TimeStepping, integrate
from beamsim.flow.transient import simulate
from beamsim.system.build import build_system
from benchmarks.newmark import HHT_ALPHA, newmark

CASE = "configs/one_sided_65hz.yaml"
TARGET = 1e-9
TIMES = np.linspace(0.0, 0.8, 401)


def best_of(function, repeats):
    """Smallest processor time of a call, s, and its result."""
    best = np.inf
    for _ in range(repeats):
        begin = time.process_time()
        result = function()
        best = min(best, time.process_time() - begin)
    return best, result


def exact(modes, repeats=20):
    """Processor time of building the contact states and computing the motion, no sampled output."""
    system = build_system(beamsim.load_scenario(CASE, {"reduction": {"modes": modes}}))
    seconds, trajectory = best_of(lambda: simulate(exact_flow(system, 0.8), system.initial_state), repeats)
    return system, seconds, trajectory


def difference(y, exact_y):
    """Largest difference relative to the peak of the displacements or of the velocities."""
    n = y.shape[1] // 2
    d, e = np.abs(y - exact_y), np.abs(exact_y)
    return max(d[:, :n].max() / e[:, :n].max(), d[:, n:].max() / e[:, n:].max())


def scipy_methods(system, exact_y, methods, tolerances):
    """Cheapest run of each ``solve_ivp`` method that reaches the target; slower runs are stopped."""
    best = np.inf
    for method in methods:
        for rtol in tolerances:
            flow = exact_flow(system, 0.8)
            begin = time.process_time()

            def watch(fraction, begin=begin, limit=best):
                if time.process_time() - begin > limit * max(fraction, 0.05):
                    raise TimeoutError

            try:
                stepping = TimeStepping(flow, method, rtol=rtol, atol=1e-3 * rtol)
                result = integrate(stepping, system.initial_state, TIMES, progress=watch)
            except TimeoutError:
                yield f"{method:20s} slower than the best so far, at rtol {rtol:g}"
                break
            seconds = time.process_time() - begin
            error = difference(result.y, exact_y)
            if error <= TARGET or rtol == tolerances[-1]:
                best = min(best, seconds if error <= TARGET else np.inf)
                yield method, rtol, seconds, error
                break


def compiled_dop853(system, exact_y):
    """``scipy.integrate.ode('dop853')`` with a compiled right-hand side; the tolerance is tightened to the target."""
    dynamics = system.dynamics
    contacts = dynamics.contacts
    n = dynamics.size
    stiffness, damping = dynamics.stiffness, dynamics.damping
    phi, k, c, gap = contacts.shape[0], contacts.stiffness[0], contacts.dashpot[0], contacts.gap[0]
    load = system.forcing.load[0]
    amplitude = 2.0 * 9.80665
    omega = 2 * np.pi * system.excitation_frequency_hz

    @njit
    def right_hand_side(t, y):
        out = np.empty(2 * n)
        q, v = y[:n], y[n:]
        delta, rate = -gap - phi @ q, -(phi @ v)
        force = k * delta + c * rate if delta > 0.0 else 0.0
        a = amplitude * np.sin(omega * t)
        out[:n] = v
        out[n:] = -stiffness * q - damping @ v + load * a + phi * force
        return out

    right_hand_side(0.0, system.initial_state)
    last = None
    for rtol in (1e-9, 1e-10, 1e-11, 1e-12, 1e-13):
        solver = ode(right_hand_side).set_integrator("dop853", rtol=rtol, atol=1e-3 * rtol, nsteps=10**8)
        solver.set_initial_value(system.initial_state, 0.0)
        begin = time.process_time()
        y = np.array([system.initial_state] + [solver.integrate(t) for t in TIMES[1:]])
        seconds = time.process_time() - begin
        last = ("ode dop853, compiled", rtol, seconds, difference(y, exact_y))
        if last[3] <= TARGET:
            break
    return last


def fixed_steps(system, exact_y):
    """Newmark's method and HHT with steps of one length."""
    dynamics, contacts = system.dynamics, system.dynamics.contacts
    matrices = dynamics.stiffness, dynamics.damping, -contacts.sign[:, None] * contacts.shape
    laws = contacts.stiffness, contacts.dashpot, contacts.gap
    omega = 2 * np.pi * system.excitation_frequency_hz
    for name, alpha in (("Newmark", 0.0), ("HHT", HHT_ALPHA)):
        for step in (1e-5, 1e-6):
            times = step * np.arange(round(TIMES[-1] / step) + 1)
            load = np.outer(2.0 * 9.80665 * np.sin(omega * times), system.forcing.load[0])
            newmark(matrices, laws, load[:2], system.initial_state, step, alpha)  # compiles
            begin = time.process_time()
            y, _ = newmark(matrices, laws, load, system.initial_state, step, alpha)
            seconds = time.process_time() - begin
            every = round((TIMES[1] - TIMES[0]) / step)
            yield f"{name}, compiled", step, seconds, difference(y[::every], exact_y)


def main():
    """Print the table."""
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--quick", action="store_true", help="DOP853 only")
    quick = arguments.parse_args().quick
    exact(6, 1)
    system, six, trajectory = exact(6)
    _, everything, whole = exact("all")
    print(f"exact, 6 modes      {six * 1e3:8.2f} ms  {trajectory.event_time.size} events, "
          f"{trajectory.evaluations} evaluations")  # fmt: skip
    print(f"exact, all modes    {everything * 1e3:8.2f} ms  {everything / six:.1f} times six modes "
          f"({whole.y.shape[1] // 2} coordinates)")  # fmt: skip
    exact_y = trajectory.states_at(TIMES)
    methods = ["DOP853"] if quick else ["DOP853", "LSODA", "RK45", "Radau", "BDF"]
    tolerances = [1e-9, 1e-10, 1e-11, 1e-12, 1e-13]
    for row in fixed_steps(system, exact_y):
        print_row(six, row, "step")
    print_row(six, compiled_dop853(system, exact_y))
    for row in scipy_methods(system, exact_y, methods, tolerances):
        print_row(six, row)


def print_row(six, row, setting="rtol"):
    """One line of the table: time and ratio to the exact flow with six modes."""
    if isinstance(row, str):
        print(row, flush=True)
        return
    method, value, seconds, error = row
    print(
        f"{method:20s}{seconds * 1e3:8.0f} ms  {seconds / six:8.0f} times, error {error:.1e} at {setting} {value:g}",
        flush=True,
    )


if __name__ == "__main__":
    main()
