"""Cost of a motion against modes, snubbers, elements, events, duration and sample rate, as a picture with slopes.

python -m benchmarks.scaling [--quick] [--output docs/images/scaling.png]

Every point is processor time, the smallest of some repetitions, of one call in a warm process. A slope is that of the
straight line through the last three points of a curve, in logarithms: 1 is linear.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # spinning idle threads would count as processor time

import numpy as np

import beamsim
from beamsim.flow.exact import exact_flow
from beamsim.flow.transient import simulate
from beamsim.system.build import build_system
from benchmarks.measure import CASE, processor_time
from benchmarks.rows import many_snubbers

REPETITIONS = 3


class Point(NamedTuple):
    """What one measurement gives, by the label of its curve: seconds."""

    at: float
    seconds: dict[str, float]


def march(scenario: Any, duration: float) -> dict[str, float]:
    """An event of the march with its contact states at hand, and a contact state."""
    system = build_system(scenario)
    first, again, built, events = np.inf, np.inf, 0, 1
    for _ in range(REPETITIONS):
        flow = exact_flow(system, duration)
        call = lambda flow=flow: simulate(flow, system.initial_state)  # noqa: E731
        first = min(first, processor_time(call))
        built = len(flow.visited_phases)
        again = min(again, processor_time(call))
        events = max(call().event_time.size, 1)
    return {"an event": again / events, "a contact state": max(first - again, 0.0) / max(built, 1)}


def by_modes(modes: float) -> Point:
    """A beam with four snubbers."""
    case = many_snubbers(4, int(modes), 0.1)
    elements = max(100, int(modes))
    scenario = beamsim.load_scenario(case.model_dump(mode="json", by_alias=True, exclude_none=True),
                                     {"beam.elements": elements})  # fmt: skip
    return Point(modes, march(scenario, 0.1))


def by_snubbers(count: float) -> Point:
    """A beam with 20 modes; the static vector of every snubber adds a coordinate."""
    return Point(count, march(many_snubbers(int(count), 20, 0.05), 0.05))


def by_elements(elements: float) -> Point:
    """Building the model of the README's case."""
    scenario = beamsim.load_scenario(CASE, {"beam.elements": int(elements), "reduction.modes": 6})
    return Point(
        elements, {"building the model": min(processor_time(lambda: build_system(scenario)) for _ in range(2))}
    )


def by_events(events: float) -> Point:
    """The README's case, 107 events in 0.8 s, for longer."""
    scenario = beamsim.load_scenario(CASE, {"reduction.modes": 6})
    duration = 0.8 * events / 107.0
    system, found = build_system(scenario), 1

    def work() -> None:
        nonlocal found
        found = simulate(exact_flow(system, duration), system.initial_state, max_events=10_000_000).event_time.size

    seconds = min(processor_time(work) for _ in range(2 if events < 1e5 else 1))
    return Point(found, {"the march": seconds})


def by_duration(duration: float) -> Point:
    """`beamsim.run` of the README's case at 20 kHz."""
    return _run(duration, {"run.duration": duration})


def by_sample_rate(rate: float) -> Point:
    """`beamsim.run` of the README's case."""
    return _run(rate, {"run.sample_rate": rate})


def _run(at: float, changes: dict[str, Any]) -> Point:
    scenario = beamsim.load_scenario(CASE, {"run.convergence": "off", **changes})
    seconds = min(processor_time(lambda: beamsim.run(scenario).summary) for _ in range(2))
    return Point(at, {"`beamsim.run`": seconds})


CURVES: dict[str, tuple[Callable[[float], Point], tuple[float, ...]]] = {
    "modes": (by_modes, (6, 12, 25, 50, 100, 200, 400)),
    "snubbers": (by_snubbers, (1, 3, 10, 30, 100)),
    "elements": (by_elements, (20, 60, 200, 400, 900, 2000)),
    "events": (by_events, (1e2, 1e3, 1e4, 1e5, 1e6)),
    "duration, s": (by_duration, (0.4, 0.8, 3.2, 12.8, 51.2)),
    "sample rate, Hz": (by_sample_rate, (1e3, 4e3, 16e3, 64e3, 256e3)),
}


def slope(at: np.ndarray, seconds: np.ndarray) -> float:
    """Of the last three points, in logarithms."""
    return float(np.polyfit(np.log(at[-3:]), np.log(np.maximum(seconds[-3:], 1e-9)), 1)[0])


def draw(curves: dict[str, list[Point]], target: Path) -> None:
    """One picture of all curves."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 7.0), layout="constrained")
    for axes, (name, points) in zip(figure.subplots(2, 3).flat, curves.items(), strict=True):
        at = np.array([point.at for point in points])
        for label in points[0].seconds:
            milliseconds = 1e3 * np.array([point.seconds[label] for point in points])
            axes.loglog(at, milliseconds, "o-", label=f"{label.strip('`')}: slope {slope(at, milliseconds):.1f}")
        axes.set_xlabel(name)
        axes.set_ylabel("processor time, ms")
        axes.grid(visible=True, which="major", alpha=0.4)
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False)
    figure.savefig(target, dpi=110)


def main() -> None:
    """Measure, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="the three smallest points of every curve")
    parser.add_argument("--output", type=Path, default=Path("docs/images/scaling.png"))
    arguments = parser.parse_args()
    curves: dict[str, list[Point]] = {}
    for name, (measure, places) in CURVES.items():
        chosen = places[:3] if arguments.quick else places
        measure(chosen[0])  # compiles
        curves[name] = [measure(place) for place in chosen]
        at = np.array([point.at for point in curves[name]])
        for label in curves[name][0].seconds:
            seconds = np.array([point.seconds[label] for point in curves[name]])
            row = "  ".join(f"{x:g}: {1e3 * s:.3g} ms" for x, s in zip(at, seconds, strict=True))
            print(f"{name:16s}{label:20s}{row}   slope {slope(at, seconds):.2f}", flush=True)
    draw(curves, arguments.output)


if __name__ == "__main__":
    main()
