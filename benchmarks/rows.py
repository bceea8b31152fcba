"""The rows of the table: what each measures, in units of what, and what it should reach."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import beamsim
from beamsim.analyses.studies.plan import check_cases, plan_designs
from beamsim.flow.exact import exact_flow
from beamsim.flow.transient import simulate
from beamsim.system.build import build_system
from beamsim.trust.studies import design_study
from benchmarks.measure import CASE, SECONDS, command, imports, march, processor_time, spent
from benchmarks.newmark import newmark

STUDY = "configs/studies/design_stiffness_gap.yaml"
SWEEP = "configs/sweeps/sweep_up_down.yaml"
PANEL = """\
import beamsim
from benchmarks.rows import many_snubbers
beamsim.run(many_snubbers(100, 20, {duration}))
"""
EXTREMES = ("peak_", "min_", "max_", "largest_", "bending_stress")  # responses of a study that are extreme values

Measurement = Callable[[], float]


class Row(NamedTuple):
    """One task."""

    name: str
    label: str
    unit: str
    prepare: Callable[[bool], tuple[Measurement, float]]  # of "quick": one repetition, and the target in references
    reference: tuple[str, Measurement] = ("march", march)
    repeat: bool = True


def many_snubbers(snubbers: int, modes: int, duration: float) -> Any:
    """The beam of the README above a row of snubbers that are hit one after another, shaken at 65 Hz, 2 g."""
    places = 0.27 * np.linspace(0.1, 1.0, snubbers)
    stiffness = min(151.1e3, 320e3 / snubbers)
    row = [
        {"name": f"s{k}", "position": float(x), "side": "below", "stiffness": stiffness, "gap": 2e-5,
         "damping": {"kind": "ratio", "ratio": 0.02}}
        for k, x in enumerate(places, 1)
    ]  # fmt: skip
    return beamsim.load_scenario(
        {
            "beam": {"length": 0.27, "width": 0.05, "thickness": 0.005, "youngs_modulus": 69e9, "density": 2700.0,
                     "elements": 100, "damping": {"kind": "modal", "ratio": 0.01}},
            "snubbers": row,
            "excitation": {"kind": "harmonic", "applied_to": "base", "level": "2 g", "frequency": 65.0},
            "run": {"duration": duration, "sample_rate": 5e3, "convergence": "off"},
        },
        {"reduction.modes": modes},
    )  # fmt: skip


def run(target: float, **changes: object) -> Callable[[bool], tuple[Measurement, float]]:
    """`beamsim.run` of the README's case with changes, in a warm process."""

    def prepare(quick: bool) -> tuple[Measurement, float]:
        beamsim.run(beamsim.load_scenario(CASE, {**changes, "run.duration": "0.8 s"}))  # compiles
        scenario = beamsim.load_scenario(CASE, changes)
        return lambda: processor_time(lambda: beamsim.run(scenario)), target

    return prepare


def random_run(quick: bool) -> tuple[Measurement, float]:
    """One second of random base motion, 20 to 2000 Hz, at the output rate that is chosen by default.

    Its length is given: a second of a longer motion costs less, so that a length that follows from a first measurement
    would make the row depend on the load.
    """
    data = beamsim.load_scenario(CASE).model_dump(mode="json", by_alias=True, exclude_none=True)
    edges = [{"frequency": 20.0, "density": 0.05}, {"frequency": 2000.0, "density": 0.05}]  # (m/s^2)^2/Hz
    data["excitation"] = {"kind": "random", "applied_to": "base", "seed": 1, "psd": edges}

    def once(duration: float) -> float:
        scenario = beamsim.load_scenario(data | {"run": {"duration": duration, "convergence": "off"}})
        return processor_time(lambda: beamsim.run(scenario)) / duration

    duration = 0.1 if quick else 1.0
    once(duration)  # compiles
    return lambda: once(duration), 300.0


RANDOM_S, STEP = 2.0, 1e-5  # s: of random vibration; a step with its peak force within 0.1 %


def random_vibration() -> Any:
    """The shipped case of random vibration with a stop, without the comparison with a finer model."""
    return beamsim.load_scenario(
        "configs/loads/random_vibration.yaml", {"run.duration": RANDOM_S, "run.convergence": "off"}
    )


def random_case(quick: bool) -> tuple[Measurement, float]:
    """A whole run of that case: motion, peaks, histories, energies, spectra and statistics."""
    beamsim.run(beamsim.load_scenario("configs/loads/random_vibration.yaml", {"run.convergence": "off"}))  # compiles
    return lambda: processor_time(lambda: beamsim.run(random_vibration())), 3.0


def fixed_step() -> float:
    """Newmark's method on the same modes and load: the motion alone, without peaks between steps or statistics."""
    system = build_system(random_vibration())
    dynamics, contacts = system.dynamics, system.dynamics.contacts
    times = STEP * np.arange(round(RANDOM_S / STEP) + 1)
    load = np.outer(system.forcing.signal[0](times), system.forcing.load[0])
    matrices = dynamics.stiffness, dynamics.damping, -contacts.sign[:, None] * contacts.shape
    laws = contacts.stiffness, contacts.dashpot, contacts.gap
    newmark(matrices, laws, load[:2], system.initial_state, STEP, 0.0)  # compiles
    return processor_time(lambda: newmark(matrices, laws, load, system.initial_state, STEP, 0.0))


def study(parameter: str, marches: float) -> Callable[[bool], tuple[Measurement, float]]:
    """One case of a study on one worker: the study's processor time over the number of its cases."""

    def prepare(quick: bool) -> tuple[Measurement, float]:
        def plan(points: int) -> Any:
            changes: dict[str, Any] = {"vary.parameters[1].points": points, "vary.parameters[0].points": 2}
            if parameter != "snubbers":
                varied = [
                    {"path": "beam.thickness", "from": 4.5e-3, "to": 5.5e-3, "points": 2},
                    {"path": "beam.length", "from": 0.271, "to": 0.28, "points": points},
                ]
                changes = {"vary.parameters": varied}
            planned = plan_designs(beamsim.load_scenario(STUDY, changes))
            check_cases(planned)
            return planned

        def once(planned: Any) -> float:
            return processor_time(lambda: design_study(planned, workers=1)) / len(planned.cases)

        few = plan(3)
        table = design_study(few, workers=1)
        assert table.complete, table.status
        asked = sum(name.rpartition("/")[2].startswith(EXTREMES) for name in table.responses)
        cases = min(1000, 6 if quick else int(SECONDS / once(few)))
        planned = plan(max(cases // 2, 3))
        return lambda: once(planned), marches + 0.5 * asked

    return prepare


def ensemble(workers: int, quick: bool) -> tuple[Measurement, float]:
    """One of many draws of gap, stiffness and level of the README's case, for the peak force."""
    scenario, rng = beamsim.load_scenario(CASE), np.random.default_rng(1)

    def once(count: int) -> float:
        draws = {
            "snubbers.tip.gap": rng.normal(0.0, 2e-5, count),
            "snubbers.tip.stiffness": rng.uniform(100e3, 200e3, count),
            "excitation.level": rng.uniform(15.0, 25.0, count),
        }
        return processor_time(lambda: beamsim.ensemble(scenario, draws, ["peak_force"], workers=workers)) / count

    once(3)  # compiles
    return lambda: once(20 if quick else 1000), 4.0


def search(workers: int, quick: bool) -> tuple[Measurement, float]:
    """One design of a search for gap and stiffness of the README's case: the search's time over its designs."""
    parameters = [
        {"path": "snubbers.tip.gap", "from": 0.0, "to": 5e-4},
        {"path": "snubbers.tip.stiffness", "from": 2e4, "to": 5e5, "spacing": "logarithmic"},
    ]
    aims = {"minimise": "peak_force", "parameters": parameters, "most_cases": 20 if quick else 300}
    planned = plan_designs(beamsim.load_scenario(CASE, {"optimise": aims}))

    def once() -> float:
        begin = spent()
        result = design_study(planned, workers=workers)
        return (spent() - begin) / result.count

    once()  # compiles
    return once, 5.0


@contextmanager
def _temporary(*names: str) -> Iterator[dict[str, str]]:
    """Environment with variables set to empty folders."""
    with tempfile.TemporaryDirectory() as folder:
        yield {name: str(Path(folder, name)) for name in names}


def cli(target: float, *arguments: str, fresh: tuple[str, ...] = ()) -> Callable[[bool], tuple[Measurement, float]]:
    """A command in a fresh process; `fresh` names environment variables of folders that are to be empty."""

    def once() -> float:
        with _temporary("OUT", *fresh) as folders:
            out = folders.pop("OUT")
            where = ["-o", out] if arguments[0] == "run" else []
            return command(["-m", "beamsim", *arguments, *where], folders).seconds

    def prepare(quick: bool) -> tuple[Measurement, float]:
        if not fresh:
            once()  # compiles
        return once, target

    return prepare


def panel(duration: float, modes: int, snubbers: int, target: float) -> Callable[[bool], tuple[Measurement, float]]:
    """The march of many snubbers and modes; time of an event."""

    def prepare(quick: bool) -> tuple[Measurement, float]:
        system = build_system(many_snubbers(snubbers, modes, duration))

        def once() -> float:
            events = 0

            def work() -> None:
                nonlocal events
                events = simulate(exact_flow(system, duration), system.initial_state).event_time.size

            return processor_time(work) / events

        return once, target

    return prepare


def whole_panel(quick: bool) -> tuple[Measurement, float]:
    """A run of 100 snubbers."""
    beamsim.run(many_snubbers(4, 20, 0.02))
    scenario = many_snubbers(100, 20, 0.1)
    return lambda: processor_time(lambda: beamsim.run(scenario)), 2500.0


def panel_memory(duration: float) -> float:
    """Largest memory of a run of 100 snubbers, MB."""
    return command(["-c", PANEL.format(duration=duration)]).megabytes


def sweep(quick: bool) -> tuple[Measurement, float]:
    """A swept sine of six modes in one direction, 20 to 400 Hz at 2 oct/min; time of a cycle."""
    changes = {"reduction.modes": 6, "sweep.direction": "up", "sweep.levels": ["2 g"], "sweep.convergence": "off"}
    beamsim.sweep(beamsim.load_scenario(SWEEP, changes | {"sweep.to": "25 Hz"}))
    scenario = beamsim.load_scenario(SWEEP, changes)

    def once() -> float:
        cycles = 0

        def work() -> None:
            nonlocal cycles
            cycles = beamsim.sweep(scenario).summary["cycles"]

        return processor_time(work) / cycles

    return once, 0.06


def continuation(from_: float, to: float, **settings: object) -> Measurement:
    """Processor time of a response curve of the README's case, after a short one that compiles."""

    def of(last: float) -> Any:
        section = {"kind": "continuation", "from": from_, "to": last, **settings}
        return beamsim.load_scenario(CASE, {"sweep": section})

    beamsim.continuation(of(1.01 * from_))
    scenario = of(to)
    return lambda: processor_time(lambda: beamsim.continuation(scenario))


def harmonic_balance(quick: bool) -> tuple[Measurement, float]:
    """Response curve with 31 harmonics."""
    return continuation(60.0, 120.0, method={"kind": "harmonic_balance", "harmonics": 31}), 4.0


def shooting() -> float:
    """Processor time of the same response curve by shooting."""
    return continuation(60.0, 120.0)()


MARCH = ("march", march)
IMPORT = ("import", imports)
FRESH = ("NUMBA_CACHE_DIR", "MPLCONFIGDIR")
ROWS = (
    Row("run", "`beamsim.run` of the README's case, warm", "ms", run(25.0, **{"run.convergence": "off"})),
    Row("run-convergence", "the same with the convergence of every figure", "ms", run(50.0)),
    Row("study-snubbers", "one case of a study that varies snubber numbers", "ms", study("snubbers", 12.0)),
    Row("study-beam", "one case of a study that varies beam numbers", "ms", study("beam", 12.0)),
    Row("ensemble", "one of 1000 draws of gap, stiffness, level: peak force", "ms", partial(ensemble, 1), repeat=False),
    Row("ensemble-2", "the same by two processes, with their start", "ms", partial(ensemble, 2), repeat=False),
    Row("search", "one design of a search for gap and stiffness: peak force", "ms", partial(search, 1), repeat=False),
    Row("search-2", "the same by two processes, with their start", "ms", partial(search, 2), repeat=False),
    Row("plots", "`beamsim run` with its plots, warm cache", "s", cli(3.2, "run", CASE), IMPORT),
    Row("validate", "`beamsim validate`", "s", cli(1.5, "validate", CASE), IMPORT),
    Row("first", "first `beamsim run` after installation", "s", cli(13.0, "run", CASE, fresh=FRESH), IMPORT, False),
    Row("long", "50 s at 20 kHz", "s", run(1000.0, **{"run.duration": "50 s"}), repeat=False),
    Row("random", "random input, 20 to 2000 Hz, default rate: one second", "s", random_run),
    Row("random_fixed_step", "2 s of random vibration with a stop, all of the run", "s", random_case,
        ("fixed step of 10 us, the motion alone", fixed_step)),
    Row("snubbers-100", "100 snubbers, 20 modes, 0.1 s", "s", whole_panel, repeat=False),
    Row("snubbers-100-memory", "largest memory of that; reference: half as long", "MB",
        lambda quick: (lambda: panel_memory(0.1), 1.1), ("half as long", lambda: panel_memory(0.05)), False),
    Row("snubbers-16", "16 snubbers, 100 modes: one event", "us", panel(0.4, 100, 16, 0.24)),
    Row("snubbers-4", "4 snubbers, 100 modes: one event", "us", panel(0.2, 100, 4, 0.1)),
    Row("balance", "harmonic balance, H = 31, 60 to 120 Hz", "s", harmonic_balance, ("shooting", shooting), False),
    Row("sweep", "swept sine 20 to 400 Hz, 6 modes, one direction: one cycle", "us", sweep),
    Row("continuation", "continuation 20 to 400 Hz, main branch with stability", "s",
        lambda quick: (continuation(20.0, 400.0, side_branches="none"), 6000.0), repeat=False),
    Row("continuation-all", "the same with side branches, to the default limit on points", "s",
        lambda quick: (continuation(20.0, 400.0), 6000.0), repeat=False),
)  # fmt: skip
