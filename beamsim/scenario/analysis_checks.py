"""Checks between the sections of sweeps, identification, nonlinear modes and studies and the rest of the scenario."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pydantic_core import PydanticCustomError

from beamsim.errors import Problem
from beamsim.scenario import units
from beamsim.scenario.base import Path, fail, path_parts, path_text, problem, refused, unknown
from beamsim.scenario.body import Located
from beamsim.scenario.designs import Sobol, Vary, Zipped
from beamsim.scenario.excitation import Excitation, Forces, Harmonic, sine_problems
from beamsim.scenario.identification import IdentifyStiffness, MeasuredShapes, SoughtParameter
from beamsim.scenario.joint import SpringToGround
from beamsim.scenario.limits import BASE_FORCE, QUANTITIES_OF, limited_quantity, output_dimension, unit_of_dimension
from beamsim.scenario.nnm import PhaseResonance
from beamsim.scenario.parameters import choices_at, find_parameters, read_as, value_at
from beamsim.scenario.parts import ScenarioParts
from beamsim.scenario.place import MovedSupport
from beamsim.scenario.quantities import FACTOR, meant
from beamsim.scenario.sweep import Continuation, HarmonicBalance, LevelPath, PositionPath, SnubberPath
from beamsim.scenario.varied import (
    VariedParameter,
    case_count,
    resolve_parameter,
    tolerances_of,
    value_count,
    varied_parameters,
)

MOST_SAMPLES = 50_000_000
"""Largest number of samples of histories; more would not fit into memory."""
MOST_CASES = 200_000
"""Largest number of cases of a study."""

Problems = Iterator[Problem]


def level_problems(excitation: Excitation, path: Path, level: float | None) -> Problems:
    """A level elsewhere in the scenario in a unit of another quantity than the excitation's."""
    quantity, said = getattr(excitation, "quantity", None), meant(level)
    if said not in (None, quantity):
        yield problem(
            path,
            f"is given in a unit of {said}, and the excitation's level is of {quantity}"
            if quantity != FACTOR
            else f"is given in a unit of {said}, but multiplies the levels of all forces",
            "give it in the unit of excitation.level" if quantity != FACTOR else "give a plain number: 0.5",
        )


def mode_number(scenario: ScenarioParts, at: Path, mode: int) -> Problems:
    """Modes of which there are only so many."""
    counts = [body.mode_count for body in scenario.all_bodies.values()]
    known = [count for count in counts if count is not None]
    total = sum(known)
    if len(known) == len(counts) and mode > total:
        what = f"a chain of {total} masses has" if len(counts) == 1 else f"the bodies together have {total} masses and"
        yield problem(at, f"= {mode}, but {what} {total} modes", f"choose a mode from 1 to {total}")


# --- sweeps ---


def sweeps(scenario: ScenarioParts) -> Problems:
    """What a sweep does not fit."""
    sweep, excitation = scenario.sweep, scenario.excitation
    if sweep is None:
        return
    unfit = list(sine_problems(excitation, "sweep"))
    yield from unfit
    if unfit:
        return
    assert isinstance(excitation, Harmonic | Forces)
    if sweep.kind == "swept_sine":
        yield from _swept_supports(excitation)
        samples = sweep.duration * (sweep.history_rate or 0.0)
        if samples > MOST_SAMPLES:
            yield problem(
                ("sweep", "history_rate"),
                f"= {sweep.history_rate:g} Hz over {sweep.duration:g} s gives {samples:.3g} samples, over the limit of "
                f"{MOST_SAMPLES:.0e}",
                "lower it, or leave it out: envelopes and harmonics are exact without it",
            )
    for index, level in enumerate(sweep.levels):
        yield from level_problems(excitation, ("sweep", "levels", index), level)
    if sweep.kind == "continuation":
        yield from _continuation(scenario, sweep)
    elif sweep.impacts and not scenario.all_snubbers and not scenario.friction:
        message = "needs a snubber or friction, and there is none"
        yield problem(("sweep", "impacts"), message, "leave it out, or add a snubber")
    if sweep.kind == "swept_sine":
        if sweep.notch_to is not None:
            yield from notch_problems(scenario, sweep.notch_to)
            if not sweep.levels and not sweep.profile and not excitation.level > 0:
                yield problem(("excitation", "level"), "cannot be lowered to sweep.notch_to", "give a positive level")
        for name, points in (("profile", sweep.profile), ("notches", sweep.notches)):
            for index, point in enumerate(points):
                if point.quantity is not None and point.quantity not in excitation.takes:
                    several = isinstance(excitation, Forces)
                    yield problem(
                        ("sweep", name, index, "level"),
                        f"is a level of {point.quantity}, "
                        + ("but multiplies the levels of all forces" if several else
                           f"and the excitation is of {excitation.quantity}"),
                        "give a plain number: 0.5" if several else "give it in a unit that fits excitation.applied_to",
                    )  # fmt: skip


def notch_problems(scenario: ScenarioParts, limits: Mapping[str, float]) -> Problems:
    """Limits on what this structure does not have, and limits in a unit of something else."""
    outputs = scenario.outputs_of_sweeps
    names = {
        "probes": [probe.name for probe in scenario.effective_probes],
        "snubbers": [snubber.name for snubber in scenario.all_snubbers],
        "outputs": list(outputs),
    }
    for name, limit in limits.items():
        path: Path = ("sweep", "notch_to", name)
        of = limited_quantity(name, scenario.base_force or BASE_FORCE.name)
        if of is None:
            yield problem(
                path,
                "names nothing that can be limited",
                "write for example probes.tip.acceleration, snubbers.tip.force, base.force or outputs.gauge",
            )
            continue
        dimension: units.Dimension | None = units.FORCE
        if name != "base.force":
            yield from unknown(path, of.item, of.section.removesuffix("s"), names[of.section])
            if of.item not in names[of.section]:
                continue
            if of.section == "outputs":
                if outputs[of.item].kind in ("kinetic_energy", "strain_energy"):
                    yield problem(path, "is an energy, which sweeps do not follow", "limit another quantity")
                    continue
                dimension = output_dimension(outputs[of.item], scenario.all_bodies, scenario.default_body)
            else:
                dimension = QUANTITIES_OF[of.section][of.quantity]
        elif BASE_FORCE.name in outputs and scenario.base_force is None:
            yield problem(path, f"needs the name {BASE_FORCE.name}, which another output has", "rename that output")
            continue
        yield from unit_problems(
            path, limit, dimension, "" if dimension is None else f"which is none of {dimension.name}"
        )


def unit_problems(path: Path, limit: float, dimension: units.Dimension | None, but: str) -> Problems:
    """A limit in a unit of something else.

    Parameters
    ----------
    path : of the limit.
    limit : its value, which remembers its unit.
    dimension : of what is limited; None of rows of recovery matrices, which have units of their own.
    but : what is limited, for the message.
    """
    said = meant(limit)
    if dimension is None and said is not None:
        yield problem(path, "has a unit, and the output has one of its own", "give a plain number in that unit")
    elif dimension is not None and said not in (None, unit_of_dimension(dimension)):
        yield problem(path, f"is in {said or 'no unit'}, {but}", f"write {dimension.example}")


def _swept_supports(excitation: Harmonic | Forces) -> Problems:
    """Supports follow a sine of constant frequency only: while the frequency changes, their motion would drift."""
    forces = enumerate(excitation.forces) if isinstance(excitation, Forces) else [(None, excitation)]
    for index, force in forces:
        if isinstance(force.applied_to, MovedSupport):
            yield problem(
                ("excitation", *(() if index is None else ("forces", index)), "applied_to"),
                "is a support that moves, which a swept sine does not follow",
                "use sweep.kind: stepped or continuation, move the base (applied_to: base), or model what moves the "
                "support as a body",
            )  # fmt: skip


def _continuation(scenario: ScenarioParts, sweep: Continuation) -> Problems:
    """Inconsistencies between a continuation and its structure and excitation."""
    given: list[tuple[str, Any]] = [("follow_folds_in", sweep.follow_folds_in), ("continue_in", sweep.continue_in)]
    for key, path in given:
        if isinstance(path, LevelPath):
            for name, level in (("from", path.from_), ("to", path.to)):
                yield from level_problems(scenario.excitation, ("sweep", key, name), level)
        if isinstance(path, SnubberPath):
            yield from _snubber_problems(scenario, f"sweep.{key}", path)
    second = sweep.follow_folds_in
    if second is not None:
        present = _value_in_scenario(scenario, sweep, second)
        low, high = sorted((float(second.from_), float(second.to)))
        if present is not None and not low <= present <= high:
            yield Problem(
                "sweep.follow_folds_in",
                f"runs from {low:g} to {high:g}, which leaves out the scenario's own {second.kind} of {present:g}, "
                "where the folds are found",
                "widen the range to hold it",
            )
    if isinstance(sweep.method, HarmonicBalance) and not (scenario.all_snubbers or scenario.nonlinear_springs):
        yield Problem(
            "sweep.method", "= harmonic_balance needs a snubber or a nonlinear spring", "use shooting, or add a snubber"
        )


def _value_in_scenario(scenario: ScenarioParts, sweep: Continuation, path: Any) -> float | None:
    if isinstance(path, LevelPath):
        return float(sweep.levels[0]) if sweep.levels else getattr(scenario.excitation, "level", None)
    index = snubber_index(scenario, path)
    if index is None:
        return None
    if path.kind != "position":
        return getattr(scenario.all_snubbers[index], path.kind)  # type: ignore[no-any-return]
    return scenario.all_snubbers[index].places[0].position  # type: ignore[no-any-return]


def snubber_index(scenario: ScenarioParts, path: SnubberPath) -> int | None:
    """Which snubber a path means; None where it means none."""
    names = [snubber.name for snubber in scenario.all_snubbers]
    if path.snubber is None:
        return 0 if len(names) == 1 else None
    return names.index(path.snubber) if path.snubber in names else None


def _snubber_problems(scenario: ScenarioParts, at: str, path: Any) -> Problems:
    names = [snubber.name for snubber in scenario.all_snubbers]
    if not names:
        yield Problem(f"{at}.kind", f"= {path.kind} needs a snubber, and there is none", "add one to snubbers")
        return
    index = snubber_index(scenario, path)
    if index is None:
        if path.snubber is None:
            yield Problem(f"{at}.snubber", "is missing", f"there are several: choose one of {', '.join(names)}")
            return
        yield from unknown((*path_parts(at), "snubber"), path.snubber, "snubber", names)
        return
    preloaded = [snubber.name for snubber in scenario.all_snubbers if snubber.preload is not None]
    if preloaded:
        yield Problem(
            f"{at}.kind",
            f"= {path.kind} would change the gap that the preload of {preloaded[0]} asks for at every step",
            "give its gap instead of its preload",
        )
    if isinstance(path, PositionPath):
        yield from _position_problems(scenario, at, path, scenario.located_snubbers[index])


def _position_problems(scenario: ScenarioParts, at: str, path: PositionPath, located: Located) -> Problems:
    if len(located.item.places) > 1:
        yield Problem(f"{at}.kind", "= position moves a snubber between two places", "follow gap or stiffness")
        return
    name = located.item.places[0].body or located.body
    body = scenario.all_bodies.get(name)
    if body is None:
        return
    for key, value in (("from", path.from_), ("to", path.to)):
        problems = list(body.movable_problems(scenario.body_path(name), (*path_parts(at), key), value))
        yield from problems
        if problems and problems[0].path.endswith(".kind"):
            return


# --- identification ---

_TOP = "identify_stiffness"


def identification(scenario: ScenarioParts) -> Problems:
    """What an identification does not fit."""
    section = scenario.identify_stiffness
    if section is None:
        return
    names = (snubber.name for snubber in scenario.all_snubbers)
    yield from unknown((_TOP, "snubber"), section.snubber, "snubber", names, "give the snubber in snubbers")
    yield from _measurements(scenario, section)


def _measurements(scenario: ScenarioParts, section: IdentifyStiffness) -> Problems:
    """Parameters that do not exist, bounds that make no sense, tests that nothing predicts."""
    if section.shapes_without is not None:
        yield from _shapes(scenario, section, section.shapes_without)
    for index, known in enumerate(section.parameter_uncertainty):
        try:
            _known(scenario, known.parameter)
        except PydanticCustomError as error:
            yield refused(error, (_TOP, "parameter_uncertainty", index))
    yield from _all_sought(scenario, section.update, (_TOP, "update"), words=True)
    if section.nonlinear is None:
        return
    yield from _all_sought(scenario, section.nonlinear.estimate, (_TOP, "nonlinear", "estimate"), words=False)
    if not isinstance(scenario.excitation, Harmonic):
        yield Problem(
            f"{_TOP}.nonlinear",
            f"needs a harmonic excitation, but this one is {scenario.excitation.kind}",
            "give excitation: {kind: harmonic, applied_to: base, level: 2 g, frequency: 65 Hz}",
        )
    names = [probe.name for probe in scenario.effective_probes]
    for index, test in enumerate(section.nonlinear.tests):
        if test.probe is not None:
            yield from unknown((_TOP, "nonlinear", "tests", index, "probe"), test.probe, "probe", names)
        if isinstance(scenario.excitation, Harmonic):
            yield from level_problems(scenario.excitation, (_TOP, "nonlinear", "tests", index, "level"), test.level)


def _shapes(scenario: ScenarioParts, section: IdentifyStiffness, shapes: MeasuredShapes) -> Problems:
    """Measured shapes are those of the one body that the snubber acts on; their positions must lie on it."""
    at = (_TOP, "shapes_without")
    snubbers = [located for located in scenario.located_snubbers if located.item.name == section.snubber]
    bodies = snubbers[0].bodies if snubbers else ()
    if len(bodies) > 1:
        yield problem(
            at,
            f"holds the shapes of one body, and {section.snubber} acts between {' and '.join(bodies)}",
            "leave it out",
        )
    elif bodies and bodies[0] in scenario.all_bodies:
        body, where = scenario.all_bodies[bodies[0]], scenario.body_path(bodies[0])
        for index, position in enumerate(shapes.positions):
            yield from body.shape_problems(where, (*at, "positions", index), position)


def _is_number(scenario: ScenarioParts, place: Path) -> bool:
    return not choices_at(scenario, place) and not isinstance(value_at(scenario, place), str)


def _known(scenario: ScenarioParts, path: str) -> None:
    """Demand numbers at a path."""
    if not all(_is_number(scenario, place) for place in find_parameters(scenario, path, (), ("parameter",))):
        raise fail(f"= {path} is not a number", "name a number", ("parameter",))


def _sought(scenario: ScenarioParts, item: SoughtParameter, *, words: bool) -> None:
    """Demand numbers that the bounds hold; ``words`` where a choice may be sought too, and numbers by a factor."""
    path, at = item.parameter, ("parameter",)
    places = find_parameters(scenario, path, (), at)
    choices = choices_at(scenario, places[0])
    if choices and words and "supports" in places[0]:
        if item.bounds or item.prior is not None:
            among = f"= {path} is a choice between {', '.join(choices)}: it has no bounds and no prior"
            raise fail(among, "leave them out; every choice is tried", at)
        return
    _known(scenario, path)
    values = [value_at(scenario, place) for place in places]
    if words and not all(value > 0 for value in values):
        zero = f"= {path} is zero in this scenario, and is varied by a factor"
        raise fail(zero, "give it a rough value to start from, or leave it out", at)
    if not item.bounds:
        return
    low, high = (read_as(scenario, places[0], bound, ("bounds",)) for bound in item.bounds)
    if not low < high:
        raise fail(f"= [{low:g}, {high:g}] is empty", "give the lower bound first", ("bounds",))
    if not low <= values[0] <= high:
        raise fail(
            f"= [{low:g}, {high:g}] does not hold the scenario's value {values[0]:g}, where the search starts",
            "widen the bounds, change the value, or write the unit", ("bounds",),
        )  # fmt: skip


def _all_sought(scenario: ScenarioParts, items: Sequence[SoughtParameter], at: Path, *, words: bool) -> Problems:
    """What is wrong with each of them, and numbers that are listed twice."""
    seen: dict[Path, int] = {}
    for index, item in enumerate(items):
        try:
            _sought(scenario, item, words=words)
            first = min(seen.setdefault(place, index) for place in find_parameters(scenario, item.parameter))
        except PydanticCustomError as error:
            yield refused(error, (*at, index))
            continue
        if first != index:
            message = f"= {item.parameter} is listed twice, also by {path_text((*at, first))}"
            yield problem((*at, index, "parameter"), message, "list every parameter once")


# --- nonlinear modes ---


def modes(scenario: ScenarioParts) -> Problems:
    """What a nonlinear normal mode does not fit."""
    nnm = scenario.nnm
    if nnm is None:
        return
    yield from mode_number(scenario, ("nnm", "mode"), nnm.mode)
    if (going := nnm.continue_in).kind == "stiffness_factor":
        key, largest = max(("from", going.from_), ("to", going.to), key=lambda end: end[1])
        for name, body in scenario.all_bodies.items():
            yield from body.factor_problems(scenario.body_path(name), key, largest)
    if nnm.phase_resonance is not None:
        yield from _phase_resonance(scenario, nnm.phase_resonance, nnm.method.kind)


def _phase_resonance(scenario: ScenarioParts, section: PhaseResonance, method: str) -> Problems:
    """What a scenario lacks, or has too much of, to hold its mode by a force; ``method`` is that of the mode."""
    excitation = scenario.excitation
    if method == "multiple_scales":
        yield Problem("nnm.phase_resonance", "needs the exact mode, not its expansion", "use method: shooting")
    if not isinstance(excitation, Harmonic):
        yield Problem(
            "nnm.phase_resonance",
            f"needs a harmonic excitation, but this one is {excitation.kind}",
            "give excitation: {kind: harmonic, applied_to: base, level: 1 g, frequency: 50 Hz} (or a force at a "
            "position); the frequency is computed",
        )
        return
    if isinstance(excitation.applied_to, MovedSupport):
        yield Problem(
            "excitation.applied_to", "is a support that moves, which phase resonance does not account for",
            "move the base (applied_to: base), or apply a force",
        )  # fmt: skip
        return
    for index, level in enumerate(section.levels):
        yield from level_problems(excitation, ("nnm", "phase_resonance", "levels", index), level)
    if not section.levels and not excitation.level > 0:
        yield Problem("excitation.level", "is zero and sustains no motion", "give nnm.phase_resonance.levels")
    if excitation.on_base:
        yield from _driven_through_contacts(scenario)


def _driven_through_contacts(scenario: ScenarioParts) -> Problems:
    """Springs to the ground through which a moving base excites the structure too; its work has no single conjugate."""
    for path, _, snubber, _ in scenario.located_snubbers:
        if getattr(snubber, "mounted_on", "base") == "ground":
            yield Problem(
                f"{path_text(path)}.mounted_on",
                "= ground lets the moving base push through the contact too, which phase resonance does not account "
                "for",
                "mount it on the base, or apply a point force",
            )
    for path, _, spring, _ in scenario.nonlinear_springs:
        if isinstance(spring, SpringToGround):
            yield Problem(
                f"{path_text(path)}.kind",
                f"= {getattr(spring, 'kind', '')} lets the moving base push through a nonlinear spring, which phase "
                "resonance does not account for",
                "apply a force to a mass instead",
            )


# --- studies ---


def designs(scenario: ScenarioParts) -> Problems:
    """What is wrong with varied numbers and their tolerances."""
    if scenario.vary is not None:
        yield from _cases(scenario, scenario.vary)
        yield from _tolerances(scenario)


def _cases(scenario: ScenarioParts, vary: Vary) -> Problems:
    """Unknown paths, values that their fields do not accept, too many cases."""
    yield from parameter_problems(scenario, vary.parameters, ("vary", "parameters"))
    if isinstance(vary, Zipped):
        counts = [value_count(parameter) for parameter in vary.parameters]
        if len(set(counts)) > 1:
            yield Problem(
                "vary.parameters",
                f"have {', '.join(map(str, counts))} values, which cannot be zipped",
                "give all of them equally many, or write kind: grid",
            )
    if isinstance(vary, Sobol) and vary.samples & (vary.samples - 1):
        power = 2 ** (vary.samples - 1).bit_length()
        yield Problem("vary.samples", f"= {vary.samples} is not a power of two", f"take {power // 2} or {power}")
    count = case_count(vary)
    if count > MOST_CASES:
        yield Problem(
            "vary",
            f"asks for {count:.3g} cases (at most {MOST_CASES:,} are computed)".replace(",", " "),
            "take fewer values of each parameter, or sample: kind: latin_hypercube with samples: 1000",
        )


def parameter_problems(scenario: ScenarioParts, parameters: Sequence[Any], section: Path) -> Problems:
    """What is wrong with the parameters that a section lists, each alone and with the others."""
    taken: dict[Path, int] = {}
    for index, parameter in enumerate(parameters):
        at = (*section, index)
        try:
            varied = resolve_parameter(scenario, parameter)
        except PydanticCustomError as error:
            yield refused(error, at)
            continue
        for place in varied.places:
            if taken.setdefault(place, index) != index:
                yield problem(
                    (*at, "path"),
                    f"= {varied.path} is varied twice, also by {path_text(('vary', 'parameters', taken[place]))}",
                    "list every parameter once",
                )
                break


_TOLERATED: Path = ("vary", "tolerances", "parameters")


def _tolerances(scenario: ScenarioParts) -> Problems:
    """Unknown paths, deviations that a field does not accept, whole numbers, numbers that are varied only in part."""
    tolerances = tolerances_of(scenario)
    if tolerances is None:
        return
    problems = list(parameter_problems(scenario, tolerances.parameters, _TOLERATED))
    yield from problems
    try:
        varied = varied_parameters(scenario)
    except PydanticCustomError:
        return  # reported where it is varied
    if problems:
        return
    for k, asked in enumerate(tolerances.parameters):
        number = resolve_parameter(scenario, asked)
        at = path_text((*_TOLERATED, k, "path"))
        if number.whole:
            yield Problem(at, f"= {asked.path} is a whole number, which has no tolerance", "vary it: values: [...]")
        yield from _partly_varied(at, number, varied)


def _partly_varied(at: str, number: VariedParameter, varied: tuple[VariedParameter, ...]) -> Problems:
    places: set[Any] = set(number.places)
    for other in varied:
        if places & set(other.places) and places != set(other.places):
            yield Problem(
                at,
                f"= {number.path} is varied in part, as {other.path}",
                f"write the path as it is varied: {other.path}, with the same `also`",
            )
