"""Checks between the sections of a scenario; every check yields the problems it finds."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import pairwise
from typing import Any

from beamsim.errors import Problem
from beamsim.scenario import units
from beamsim.scenario.base import Path, Schema, Unfit, counted, path_parts, path_text, problem, unknown, walk
from beamsim.scenario.body import AtPlace, BetweenPlaces, Body, Located, MovedStop, MovedSupport, OnSupport, Sited
from beamsim.scenario.connections import HingeStop, PiecewiseLinearSpring, SpringToGround, placed
from beamsim.scenario.distributed import DistributedLoad, TableShape
from beamsim.scenario.excitation import (
    Forces,
    Harmonic,
    MatchedInput,
    Notch,
    ProfilePoint,
    RandomInput,
    not_harmonic,
    sine_problems,
)
from beamsim.scenario.files import CurveFile
from beamsim.scenario.parameters import (
    bounds_of,
    case_count,
    choices_at,
    find_parameters,
    inputs_with_seed,
    resolve_parameter,
    tolerances_of,
    value_at,
    value_count,
    varied_parameters,
)
from beamsim.scenario.parts import ScenarioParts
from beamsim.scenario.quantities import SHAPE_DISPLACEMENTS, SHAPE_VELOCITIES, LevelValue, Rate, meant
from beamsim.scenario.reporting import (
    BASE_FORCE,
    QUANTITIES_OF,
    BendingOutput,
    JointOutput,
    Limits,
    MotionOutput,
    ReactionOutput,
    RecoveredOutput,
    limited_quantity,
    output_dimension,
    unit_of_dimension,
)
from beamsim.scenario.run import MOST_FREQUENCIES, BodiesStart, ModeStart, PolynomialStart, Run
from beamsim.scenario.studies import (
    IdentifyStiffness,
    LatinHypercube,
    MeasuredShapes,
    Reliability,
    Sobol,
    SoughtParameter,
    SweepTest,
    Tolerances,
    Zipped,
)
from beamsim.scenario.sweep import Continuation, HarmonicBalance, LevelPath, PhaseResonance, PositionPath, SnubberPath

MOST_SAMPLES = 50_000_000
"""Largest number of samples of histories; more would not fit into memory."""
INPUT = "input"  # name of the excitation among the signals of spectra and statistics
MOST_CASES = 200_000
"""Largest number of cases of a study."""

Problems = Iterator[Problem]


def problems(scenario: ScenarioParts) -> list[Problem]:
    """Return all inconsistencies between the parts of a scenario."""
    if not scenario.all_bodies:
        remedy = "give beam:, chain: or bodies: (beamsim new writes a template)"
        return [problem((), "the scenario has no structure", remedy)]
    if unfit := list(_bodies(scenario)):  # from which rates and frequencies follow
        return [*unfit, *_places(scenario)]
    checks = (
        _directions, _places, _joints, _names, _outputs, _run, _start, _sweeps, _unfollowed, _levels, _identification,
        _modes, _cases, _tolerances, _sensitivities, _limits, _pressed_friction,
    )  # fmt: skip
    return [found for check in checks for found in check(scenario)]


def _bodies(scenario: ScenarioParts) -> Problems:
    """What is wrong with each body by itself."""
    for name, body in scenario.all_bodies.items():
        yield from body.problems(scenario.body_path(name))


def _directions(scenario: ScenarioParts) -> Problems:
    """The base and gravity move points of every body."""
    for path, driven in scenario.excitation.items:
        if (direction := driven.direction) is not None:
            yield from _base_moves(scenario, ("excitation", *path, "direction"), direction, f"= {direction}")
    gravity = scenario.gravity if isinstance(scenario.gravity, tuple) else ()
    for k, (axis, component) in enumerate(zip("xyz", gravity, strict=False)):
        if component != 0:
            yield from _base_moves(scenario, ("gravity", k), axis, f"acts along {axis}, which")


def _base_moves(scenario: ScenarioParts, at: Path, direction: str, what: str) -> Problems:
    """A motion of the base must move points of every body; where it turns several, joints must say how they lie."""
    bodies = scenario.all_bodies
    for name, body in bodies.items():
        if direction not in body.base_directions:
            remedy = f"use {' or '.join(filter(None, body.base_directions))}"
            yield problem(at, f"{what} moves no point of {name}, a {body.body_kind}", remedy)
    known = placed(scenario.joints, bodies, scenario.default_body).of_first_group
    if direction.startswith("r") and len(bodies) > 1 and bodies.keys() - known.keys():
        yield problem(
            at, f"{what} turns several bodies, and joints do not say how {', '.join(bodies)} lie to one another",
            "join them by points of beams, or model them as one body",
        )  # fmt: skip


def _places(scenario: ScenarioParts) -> Problems:
    """Everything that sits somewhere must sit on a body, where it can act."""
    for path, part in walk(scenario):
        if isinstance(part, MovedSupport) and part.joint is not None:
            linear = (each.name for each in scenario.joined_by if each.kind not in ("cubic", "piecewise_linear"))
            yield from unknown((*path, "joint"), part.joint, "joint", linear)
        elif isinstance(part, MovedSupport | OnSupport):  # which supports a body has is known to its model
            yield from _body_named(scenario, path, part.body, f"name one: {{body: BODY, support: {part.support}}}")
        elif isinstance(part, MovedStop):
            movable = [each.item.name for each in scenario.written_snubbers if hasattr(each.item, "mounted_on")]
            yield from unknown((*path, "snubber"), part.snubber, "snubber", movable)
        elif isinstance(part, DistributedLoad):
            yield from _distributed(scenario, path, part)
        else:
            yield from place_problems(scenario, path, part)


def _body_named(scenario: ScenarioParts, at: Path, body: str | None, example: str) -> Problems:
    """A body that there is not, or none named where there are several; ``example`` shows how with BODY for its name."""
    bodies = scenario.all_bodies
    if body is not None:
        yield from unknown((*at, "body"), body, "body", bodies)
    elif len(bodies) > 1:
        remedy = example.replace("BODY", next(iter(bodies)))
        yield problem(at, f"names no body, and there are several: {', '.join(bodies)}", remedy)


def place_problems(scenario: ScenarioParts, path: Path, part: Schema) -> Problems:
    """What is wrong with the place of a part of a scenario.

    Parameters
    ----------
    scenario : that has the bodies.
    path : where the part is written.
    part : a place, or what sits at one or between two.

    Yields
    ------
    Problem
    """
    if isinstance(part, AtPlace):
        yield from _place(scenario, path, (*path, "mass"), part)
    elif isinstance(part, Sited) and part.at is None:
        yield from _place(scenario, path, (*path, "mass"), part.place)
    elif isinstance(part, BetweenPlaces):
        key, ends = part.ends
        for index, number in enumerate(ends):
            if isinstance(number, int):
                yield from _place(scenario, path, (*path, key, index), AtPlace(mass=number))


def _place(scenario: ScenarioParts, path: Path, number: Path, place: AtPlace) -> Problems:
    """What is wrong with a place at a path; ``number`` is where its mass is written."""
    holder = scenario.body_at(path)
    if holder and place.body is not None:
        yield problem((*path, "body"), f"= {place.body} is named in the list of {holder}", "leave it out")
        return
    if not holder:
        yield from _body_named(scenario, path, place.body, "name one: at: {body: BODY, position: 270 mm}")
    name = holder or place.body or scenario.default_body
    if name not in scenario.all_bodies:
        return
    body, where = scenario.all_bodies[name], scenario.body_path(name)
    if place.node is not None:
        yield from body.node_problems(where, (*path, "node"))
    elif place.mass is not None:
        yield from body.mass_problems(where, number, place.mass)
    elif place.position is not None:
        sited = "" if "outputs" in path[:2] else _SITED.get(str(path[0]), "a force")
        yield from body.position_problems(where, (*path, "position"), place.position, sited)


_SITED = {
    "snubbers": "a snubber",
    "springs_to_ground": "a spring",
    "springs_between": "a spring",
    "probes": "",
    "constant_forces": "",
    "joints": "",
    "friction": "a friction contact",
}
"""What sits at places of a section; nothing for what may sit on a support."""


def _distributed(scenario: ScenarioParts, path: Path, load: DistributedLoad) -> Problems:
    """A body that is unknown or of another kind, and a part that is not on it."""
    yield from _body_named(scenario, path, load.body, "name one: {body: BODY, line: whole}")
    name = load.body or scenario.default_body
    if name not in scenario.all_bodies:
        return
    body, where = scenario.all_bodies[name], scenario.body_path(name)
    key = load.part
    if body.body_kind != load.acts_on:
        message = f"belongs to a {load.acts_on}, but {path_text(where)} is {body.called}"
        yield problem((*path, key), message, body.how_to_load)
        return
    if load.ends is not None:
        for index, end in enumerate(load.ends):
            yield from body.position_problems(where, (*path, key, index), end, "")
        ends: Any = [body.point(end) for end in load.ends]
        pairs = [ends] if key == "line" else list(zip(*ends, strict=True))
        if any(last <= first for first, last in pairs):
            yield problem((*path, key), "does not end beyond where it begins", "give the lower end first")
    if isinstance(load.shape, TableShape):
        shape: Any = load.shape.on_the_body(body)
        for axis, key in enumerate(("x", "y")):
            for index, position in enumerate(getattr(shape, key) or ()):
                yield from body.beyond(where, (*path, "shape", key, index), position, axis)
            for index, (one, two) in enumerate(pairwise(getattr(shape, key) or ()), start=1):
                if two <= one:
                    at = (*path, "shape", key, index)
                    yield problem(at, "does not lie beyond the one before it", "list increasing positions")


def _joints(scenario: ScenarioParts) -> Problems:
    """A rotation acts only between points that turn."""
    for index, joint in enumerate(scenario.joints):
        where: Path = ("joints", index)
        names = [place.body or scenario.default_body for place in joint.places]
        for name in names:
            body = scenario.all_bodies.get(name)
            if body is not None and not body.has_slope and joint.turns_against:
                yield problem(
                    where,
                    f"acts on the rotation of {name}, but the points of a {body.body_kind} only deflect",
                    "use kind: hinge, or kind: spring with stiffness alone",
                )
        itself = len(names) == 2 and names[0] == names[1]
        if itself and joint.kind != "spring" and scenario.all_bodies[names[0]].has_slope:
            message = f"joins {names[0]} to itself: the two points would have to deflect alike"
            yield problem(where, message, "use kind: spring")


def _names(scenario: ScenarioParts) -> Problems:
    shared: list[tuple[Path, Sequence[Any]]] = [
        ((key,), getattr(scenario, key)) for key in ("snubbers", "springs_to_ground", "springs_between", "friction")
    ]
    for name, body in scenario.all_bodies.items():
        shared += [((*scenario.body_path(name), key), items) for key, items in body.own_lists.items()]
    yield from _unique(shared)
    of_run = () if scenario.run is None else scenario.run.outputs
    named = [(("probes",), scenario.probes), (("outputs",), scenario.outputs), (("run", "outputs"), of_run)]
    yield from _unique(named)
    yield from _unique([(("joints",), scenario.joints)])
    for index, joint in enumerate(scenario.joints):
        yield from _unique([(("joints", index, "stops"), getattr(joint, "stops", ()))])


def _unique(lists: Iterable[tuple[Path, Sequence[Any]]]) -> Problems:
    """Names within lists must be unique."""
    first: dict[str, Path] = {}
    for path, items in lists:
        for index, item in enumerate(items):
            if item.name in first:
                other = path_text(first[item.name])
                yield problem(
                    (*path, index, "name"), f"= {item.name} is already the name of {other}", "choose another name"
                )
            first.setdefault(item.name, (*path, index))


def _outputs(scenario: ScenarioParts) -> Problems:
    for path, output in scenario.requested_outputs:
        if isinstance(output, JointOutput):
            joints = (joint.name for joint in scenario.joined_by)
            yield from unknown((*path, "joint"), output.joint, "joint", joints)
            continue
        if not isinstance(output, Sited) and getattr(output, "support", "") != "base":
            yield from _body_named(scenario, path, output.body, "add body: BODY")
        name = (output.place if isinstance(output, Sited) else output).body or scenario.default_body
        body = scenario.all_bodies.get(name)
        if isinstance(output, ReactionOutput):
            yield from _reaction_output(scenario, path, output)
        elif isinstance(output, MotionOutput) and output.kind == "rotation" and body is not None and not body.has_slope:
            message = f"asks for a slope, but the points of a {body.body_kind} have none"
            yield problem(path, message, "name a point of a beam")
        elif isinstance(output, BendingOutput) and body is not None:
            yield from _bending_output(path, output, name, body)
        elif isinstance(output, RecoveredOutput) and body is not None:
            yield from _recovered_output(path, output, name, body)


def _bending_output(at: Path, output: BendingOutput, name: str, body: Body) -> Problems:
    """Only beams and plates bend, only plates have components, and the distance of the fibre must be known."""
    what = output.kind.replace("_", " ")
    if body.body_kind not in ("beam", "plate"):
        yield problem(
            at, f"asks for a {what}, but {name} is of the kind {body.body_kind}", "name a point of a beam or plate"
        )
    elif output.component is not None and body.body_kind == "beam":
        yield problem((*at, "component"), f"belongs to a plate, but {name} is a beam", "leave it out")
    elif output.kind == "strain" and body.gives_strain:
        return
    elif output.kind == "strain" and body.body_kind == "plate":
        yield problem(at, f"needs the thickness of {name}, which its stiffnesses do not tell", "give its thickness")
    elif output.kind != "bending_moment" and not body.gives_stress:
        yield problem(
            at, f"needs the outermost fibre of {name}, which its bending stiffness does not tell",
            "give a section, or ask for kind: bending_moment",
        )  # fmt: skip


def _reaction_output(scenario: ScenarioParts, at: Path, output: ReactionOutput) -> Problems:
    """Which supports a body has is known to its model."""
    if output.about is not None and (output.support != "base" or output.kind != "reaction_moment"):
        yield problem((*at, "about"), "belongs to the moment of the base", "leave it out")
    of_base = output.support == "base"
    if of_base and output.body is not None:
        yield problem((*at, "body"), "belongs to a support; the base holds all bodies", "leave it out")
    elif of_base and (output.kind == "reaction_moment" or output.direction is not None):
        direction = output.direction or ("ry" if output.kind == "reaction_moment" else "z")
        yield from _base_moves(scenario, (*at, "direction"), direction, f"= {direction}")
    if output.direction is not None and (len(output.direction) == 2) != (output.kind == "reaction_moment"):
        yield problem((*at, "direction"), f"= {output.direction} is none of a {output.kind.replace('_', ' ')}",
                       "forces have x, y and z, moments rx, ry and rz")  # fmt: skip


def _recovered_output(at: Path, output: RecoveredOutput, name: str, body: Body) -> Problems:
    """The body must have a recovery matrix with this row."""
    if not body.recovered_rows:
        yield problem(
            at, f"needs a recovery matrix, which {name} lacks",
            "give recovery: {file: panel.op4, name: stress, rows: [skin]} of imported matrices",
        )  # fmt: skip
    else:
        yield from unknown((*at, "row"), output.row, "row of the recovery matrix", body.recovered_rows)


def _run(scenario: ScenarioParts) -> Problems:
    run = scenario.run
    if run is None:
        return
    yield from _sampling(scenario, run)
    yield from _stepping(scenario, run)
    yield from _spectrum(scenario, run)
    yield from _impacts(scenario, run)
    if run.srs is not None or scenario.excitation.stationary:
        yield from _names_of_input(scenario)
    for _, item in scenario.excitation.items:
        if item.kind == "matched" and run.duration < item.duration * (1 - 1e-9):
            message = f"= {run.duration:g} s ends before the matched record, of {item.duration:g} s"
            yield Problem("run.duration", message, "run longer: what follows the record counts, too")
    if run.test_duration is not None and not scenario.excitation.stationary:
        yield Problem("run.test_duration", "is that of a test with a random input, of which the run is a sample",
                      "leave it out, or simulate the whole test by run.duration")  # fmt: skip


def _sampling(scenario: ScenarioParts, run: Run) -> Problems:
    rate = scenario.sample_rate
    at = ("run", "sample_rate") if run.sample_rate is not None else ("run", "duration")
    given = f"= {rate:g} Hz over run.duration = {run.duration:g} s"
    if run.sample_rate is None:
        given = f"= {run.duration:g} s at the {rate:g} Hz that the excitation asks for"
    if rate * run.duration < 1.0:
        yield problem(
            at,
            f"= {rate:g} Hz gives only one sample in run.duration = {run.duration:g} s",
            "use a higher sample rate, or a longer run",
        )
    elif rate * run.duration > MOST_SAMPLES:
        yield problem(
            at,
            f"{given} gives {rate * run.duration:.3g} samples, over the limit of {MOST_SAMPLES:.0e}",
            "contacts are found exactly at any sample rate; use a lower one, or a shorter run",
        )
    highest = max(scenario.excitation.frequencies_hz, default=0.0)
    if rate < 2.0 * highest:
        yield problem(
            at,
            f"= {rate:g} Hz is under twice the excitation frequency of {highest:g} Hz",
            f"use at least {2 * highest:g} Hz; {20 * highest:g} Hz shows the first harmonics",
        )


def _cubic(scenario: ScenarioParts) -> bool:
    """Whether the motion has no closed form, because of a cubic spring."""
    return any(located.item.kind == "cubic" for located in scenario.nonlinear_springs)


def _stepping(scenario: ScenarioParts, run: Run) -> Problems:
    """Settings of time stepping that do nothing in this run."""
    if run.method == "reference":
        return
    cubic = _cubic(scenario)
    does = "which is integrated by DOP853" if cubic else "which is in closed form"
    for key in ("integrator",) if cubic else ("integrator", "rtol", "atol"):
        if getattr(run, key) != type(run).model_fields[key].default:
            message = f"= {getattr(run, key)} does nothing in this run, {does}"
            yield problem(("run", key), message, "leave it out, or give method: reference")


def _spectrum(scenario: ScenarioParts, run: Run) -> Problems:
    spectrum = run.spectrum
    if run.method == "reference" and spectrum.to is not None:
        message = f"= {spectrum.to:g} Hz does nothing: spectra of time stepping go up to half of the sample rate"
        yield problem(("run", "spectrum", "to"), message, "leave it out, or give that run.sample_rate")
    if spectrum.last is not None and spectrum.last > run.duration * (1.0 + 1e-12):
        yield problem(
            ("run", "spectrum", "last"),
            f"= {spectrum.last:g} s is longer than run.duration = {run.duration:g} s",
            "analyse a shorter part, or use a longer run",
        )
    yield from _frequencies_of_spectra(scenario, run)
    if spectrum.periods is None:
        return
    at = ("run", "spectrum", "periods")
    frequencies = scenario.excitation.frequencies_hz
    if len(frequencies) != 1:
        yield problem(at, "needs an excitation with one frequency", "give last: 0.4 s instead")
    elif spectrum.periods / frequencies[0] > run.duration * (1.0 + 1e-12):
        yield problem(
            at,
            f"= {spectrum.periods} periods of {frequencies[0]:g} Hz take {spectrum.periods / frequencies[0]:g} s, "
            f"longer than run.duration = {run.duration:g} s",
            f"analyse at most {int(run.duration * frequencies[0])} periods, or run longer",
        )


def _frequencies_of_spectra(scenario: ScenarioParts, run: Run) -> Problems:
    """Chosen frequencies must be told apart, and none may lie beyond the highest that a spectrum can have."""
    chosen, tones = run.spectrum.frequencies, scenario.excitation.frequencies_hz
    duration = min(run.spectrum.last or run.duration, run.duration)
    if run.spectrum.periods is not None and len(tones) == 1:
        duration = min(run.spectrum.periods / tones[0], duration)
    asked: dict[Path, float] = {("run", "spectrum", "frequencies", k): value for k, value in enumerate(chosen)}
    for index, (at, frequency) in enumerate(asked.items()):
        near = min(chosen[:index], key=lambda other: abs(other - frequency), default=-1.0 / duration)
        if abs(near - frequency) * duration < 1.0:
            yield problem(
                at,
                f"= {frequency:g} Hz cannot be distinguished from {near:g} Hz in the {duration:g} s that are analysed",
                f"keep frequencies {1 / duration:g} Hz apart, or analyse a longer part",
            )
    if run.method == "reference" or _cubic(scenario):
        for at, frequency in asked.items():
            if frequency >= 0.5 * scenario.sample_rate:
                yield problem(
                    at,
                    f"= {frequency:g} Hz is not below half of run.sample_rate = {scenario.sample_rate:g} Hz",
                    "raise run.sample_rate: spectra of a time-stepping method are those of its samples",
                )
        return
    if run.spectrum.to is not None:
        asked["run", "spectrum", "to"] = run.spectrum.to
    for at, frequency in asked.items():
        if frequency * duration > MOST_FREQUENCIES:
            yield problem(
                at,
                f"= {frequency:g} Hz has {frequency * duration:.4g} periods in the {duration:g} s that are analysed "
                f"(at most {MOST_FREQUENCIES})",
                f"analyse a shorter part, run.spectrum.last: {0.95 * MOST_FREQUENCIES / frequency:.2g} s",
            )


def _names_of_input(scenario: ScenarioParts) -> Problems:
    """Names of places with a spectrum that is listed beside that of the input, which is called input."""
    for section in ("probes", "snubbers", "outputs"):
        for k, item in enumerate(getattr(scenario, section)):
            if item.name == INPUT:
                message = f"= {INPUT} is the name of the input's own spectrum and statistics"
                yield problem((section, k, "name"), message, "choose another name")


def _impacts(scenario: ScenarioParts, run: Run) -> Problems:
    """Statistics of impacts and of stress that this structure, or time stepping, does not have."""
    cubic = _cubic(scenario)
    for where, settings in (("run.impacts", run.impacts), ("run.fatigue", run.fatigue)):
        if settings is not None and run.method == "reference":
            yield Problem(where, "needs the motion in closed form", "leave run.method: reference out")
        elif settings is not None and cubic:
            yield Problem(
                where, "needs the motion in closed form, which cubic springs do not have",
                "leave it out, or replace the cubic springs by piecewise-linear ones",
            )  # fmt: skip
    if run.from_ and (run.method == "reference" or cubic or (run.impacts is None and not scenario.friction)):
        message = f"= {run.from_:g} s says from when on impacts and sliding count, and this run counts none"
        yield Problem("run.from", message, "leave it out, or add impacts: {}")
    elif run.from_ >= run.duration:
        yield Problem(
            "run.from", f"= {run.from_:g} s is not before the end, {run.duration:g} s", "give an earlier time"
        )
    if run.impacts is not None and not scenario.all_snubbers:
        yield Problem("run.impacts", "needs a snubber, and there is none", "leave it out, or add a snubber")
    if run.fatigue is not None:
        yield from _stress_known(scenario, "run.fatigue")


def _stress_known(scenario: ScenarioParts, at: str) -> Problems:
    if not any(body.gives_stress for body in scenario.all_bodies.values()):
        remedy = "leave it out, or give a beam's extreme_fibre and youngs_modulus"
        yield Problem(at, "needs a body whose stress is known", remedy)


def _start(scenario: ScenarioParts) -> Problems:
    start = None if scenario.run is None else scenario.run.start
    at: Path = ("run", "start")
    if isinstance(start, ModeStart):
        yield from _mode_number(scenario, (*at, "mode"), start.mode)
    elif isinstance(start, PolynomialStart) and len(scenario.all_bodies) > 1:
        named = f"{{bodies: {{{next(iter(scenario.all_bodies))}: {{displacement: [...]}}}}}}"
        message = f"gives one shape, and there are {len(scenario.all_bodies)} bodies"
        yield problem(at, message, f"name the body: start: {named}")
    elif isinstance(start, PolynomialStart):
        yield from _shape_of_start(scenario.all_bodies[scenario.default_body], at, start)
    elif isinstance(start, BodiesStart):
        for name, shape in start.bodies.items():
            yield from unknown((*at, "bodies", name), name, "body", scenario.all_bodies)
            if name in scenario.all_bodies:
                yield from _shape_of_start(scenario.all_bodies[name], (*at, "bodies", name), shape)


def _shape_of_start(body: Body, at: Path, start: PolynomialStart) -> Problems:
    """What is wrong with the displacements and velocities of a body."""
    for path, numbers in (((*at, key), getattr(start, key)) for key in ("displacement", "velocity")):
        yield from _units_of_shape(body, path, numbers)
        yield from body.start_problems(path, numbers)


def _units_of_shape(body: Body, path: Path, numbers: Sequence[float]) -> Problems:
    """Numbers with the unit of another one of the shape."""
    dimensions = SHAPE_DISPLACEMENTS if path[-1] == "displacement" else SHAPE_VELOCITIES
    for index, number in enumerate(numbers):
        said, power = meant(number), body.power_of_start(index)
        if said is not None and int(said) != power:
            wanted = dimensions[power] if power < len(dimensions) else None
            yield problem(
                (*path, index),
                f"is {dimensions[int(said)].with_article}, but must be "
                f"{f'the coefficient of x^{power}' if wanted is None else wanted.with_article}",
                "write a bare number in SI units" if wanted is None else f"write for example {wanted.example}",
            )


def _pressed_friction(scenario: ScenarioParts) -> Problems:
    """Friction under the force of a snubber: of one that does not pull."""
    snubbers = {snubber.name: snubber for snubber in scenario.all_snubbers}
    rigid = [contact.name for _, _, contact, _ in scenario.located_friction if contact.stiffness is None]
    for index, contact in enumerate(scenario.friction):
        if contact.pressed_by is None:
            continue
        where, name = ("friction", index, "normal_force"), contact.pressed_by
        yield from unknown((*where, "snubber"), name, "snubber", snubbers, "there is no snubber: give a force")
        if name not in snubbers:
            continue
        damped = snubbers[name].damping is not None
        if damped and snubbers[name].law != "no_tension":
            remedy = "leave the snubber's damping out" if snubbers[name].yields else "give the snubber law: no_tension"
            yield problem(where, f"= the force of {name} may pull, since its dashpot acts while it opens", remedy)
        elif damped and contact.stiffness is not None:
            yield problem(
                ("friction", index, "stiffness"),
                f"does not go with the force of {name}: the slider behind a tangential spring follows the rate of the "
                "force, and that of a dashpot depends on accelerations",
                "leave stiffness out, or give the snubber maxwell branches instead of its damping",
            )  # fmt: skip
        if contact.stiffness is None and len(rigid) > 1:
            others = ", ".join(other for other in rigid if other != contact.name)
            yield problem(
                ("friction", index, "stiffness"), f"is missing, and {others} sticks without a spring as well",
                "give the contact a tangential stiffness",
            )  # fmt: skip


SWEPT = ("swept_sine", "stepped")  # sweeps that give a response over frequency


def _limits(scenario: ScenarioParts) -> Problems:
    """Limits on quantities that this structure does not have."""
    limits = scenario.limits
    if limits is None:
        return
    if limits.bending_stress is not None:
        yield from _stress_known(scenario, "limits.bending_stress")
    for name in ("rms_displacement", "rms_acceleration"):
        if getattr(limits, name) is not None and not scenario.excitation.stationary and scenario.run is None:
            yield Problem(f"limits.{name}", "needs a run", "limit peaks, or add run: {duration: 1 s}")
    if limits.rms_force is not None and not scenario.excitation.stationary:
        message = f"is of a stationary input, and the excitation is {scenario.excitation.kind}"
        yield Problem("limits.rms_force", message, "limit peak_force")
    sine = scenario.excitation.kind != "none" and not any(sine_problems(scenario.excitation, "sweep"))
    if limits.gapping is not None and (not sine or getattr(scenario.sweep, "kind", "stepped") not in SWEPT):
        yield Problem("limits.gapping", "needs a run or a sweep of a harmonic excitation", "limit gap instead")
    yield from _limit_curves(scenario, limits)
    for name in type(limits).model_fields:
        moment, of_place = name.endswith("moment"), getattr(limits, name)
        snubbers = moment or name.endswith(("force", "gap", "gapping"))
        both = name == "gapping"
        stops = [stop for stop in scenario.all_snubbers if both or isinstance(stop, HingeStop) == moment]
        if snubbers and of_place is not None and not stops:
            what, remedy = ("stops of hinges", "stops to a hinge") if moment else ("snubbers", "a snubber")
            message = f"limits the {what}, and there are none"
            yield Problem(f"limits.{name}", message, f"add {remedy}, or leave it out")
        elif isinstance(of_place, dict) and name not in ("outputs", *limits.curves):
            known = [each.name for each in (stops if snubbers else scenario.effective_probes)]
            for place in of_place:
                yield from unknown(("limits", name, place), place, "snubber" if snubbers else "probe", known)
    outputs = {output.name: output for _, output in scenario.requested_outputs}
    for name, limit in (limits.outputs or {}).items():
        path: Path = ("limits", "outputs", name)
        yield from unknown(path, name, "output", outputs, "list it in outputs")
        if name not in outputs:
            continue
        dimension = output_dimension(outputs[name], scenario.all_bodies, scenario.default_body)
        kind = outputs[name].kind.replace("_", " ")
        yield from _unit_problems(path, limit, dimension, f"and the output is a {kind}")


def _limit_curves(scenario: ScenarioParts, limits: Limits) -> Problems:
    """Curves of spectra that are not asked for, and of places that there are not."""
    run = scenario.run
    asked = {  # whether there is what is limited, what that is, and a remedy
        "srs": (run is not None and run.srs is not None, "shock response spectra",
                "add run.srs: {from: 10 Hz, to: 2 kHz}"),
        "psd": (run is not None and scenario.excitation.stationary, "a run with a stationary input",
                "limit peaks or srs, or give random noise or a record with stationary: true"),
        "response": (getattr(scenario.sweep, "kind", "") in SWEPT, "a sweep in frequency",
                     "limit peaks, or add sweep: {kind: swept_sine, ...} or {kind: stepped, ...}"),
    }  # fmt: skip
    probes, snubbers = ([each.name for each in of] for of in (scenario.effective_probes, scenario.all_snubbers))
    places = (each.applied_to for _, each in scenario.excitation.items)
    supports = [at.label for at in places if isinstance(at, MovedSupport) and not at.rotates]
    for name, place, points in limits.given_curves():
        path, of_force, (given, needed, remedy) = ("limits", name, place), False, asked[name]
        if not given:
            yield problem(path, f"needs {needed}", remedy)
        elif name != "srs" and not isinstance(points, CurveFile):
            said = meant(points[0][1])
            of_force = said in {each.name for each in (units.FORCE_PSD, units.MOMENT_PSD, units.FORCE, units.MOMENT)}
            other = [k for k, (_, level) in enumerate(points) if meant(level) != said]
            if other:
                yield problem((*path, other[0], 1), "is of another quantity than the first", "give all in one unit")
        more = {"srs": [INPUT, *supports], "psd": [INPUT]}.get(name, [])
        more += snubbers if name != "srs" and isinstance(points, CurveFile) else []
        yield from unknown(path, place, "place", snubbers if of_force else [*probes, *more])


def _levels(scenario: ScenarioParts) -> Problems:
    """Levels of the analyses in a unit of another quantity than the excitation's."""
    excitation = scenario.excitation
    if not isinstance(excitation, Harmonic | Forces):
        return
    factors = isinstance(excitation, Forces)
    but = "but multiplies the levels of all forces" if factors else f"and the excitation is of {excitation.quantity}"
    for section in ("sweep", "nnm", "identify_stiffness"):
        for path, part in walk(getattr(scenario, section), (section,)):
            if "start" in path or "excitation" in path:  # a test's own
                continue
            stated = part.quantity if isinstance(part, ProfilePoint | Notch) else None
            fits = (excitation.quantity,) if stated is None else excitation.takes
            for key, name in type(part).keys().items():
                held = part.__dict__.get(name)
                for k, level in enumerate(held if isinstance(held, tuple) else (held,)):
                    said = (stated or level.quantity) if isinstance(level, LevelValue) else None
                    if said is not None and said not in fits:
                        at = (*path, key, k) if isinstance(held, tuple) else (*path, key)
                        remedy = "give a plain number: 0.5" if factors else "give it in the unit of excitation.level"
                        yield problem(at, f"is a level of {said}, {but}", remedy)


def _mode_number(scenario: ScenarioParts, at: Path, mode: int) -> Problems:
    """Modes of which there are only so many."""
    counts = [body.mode_count for body in scenario.all_bodies.values()]
    known = [count for count in counts if count is not None]
    total = sum(known)
    if len(known) == len(counts) and mode > total:
        what = f"a chain of {total} masses has" if len(counts) == 1 else f"the bodies together have {total} masses and"
        yield problem(at, f"= {mode}, but {what} {total} modes", f"choose a mode from 1 to {total}")


# --- sweeps ---


def _sweeps(scenario: ScenarioParts) -> Problems:
    """What a sweep does not fit."""
    sweep, excitation = scenario.sweep, scenario.excitation
    if sweep is None:
        return
    run, unfit = scenario.run, list(sine_problems(excitation, "sweep"))
    yield from unfit
    if run is not None and run.low_pass is not None and getattr(sweep, "accelerations", True):
        message = f"reports accelerations that run.low_pass = {run.low_pass:g} Hz, the band of runs, does not filter"
        yield problem(("sweep",), message, "leave the run out here (run: null), or its low_pass, or the sweep")
    if unfit:
        return
    assert isinstance(excitation, Harmonic | Forces)
    if sweep.kind == "swept_sine":
        samples = sweep.duration * (sweep.history_rate or 0.0)
        if samples > MOST_SAMPLES:
            yield problem(
                ("sweep", "history_rate"),
                f"= {sweep.history_rate:g} Hz over {sweep.duration:g} s gives {samples:.3g} samples, over the limit of "
                f"{MOST_SAMPLES:.0e}",
                "lower it, or leave it out: envelopes and harmonics are exact without it",
            )
    if sweep.kind == "continuation":
        yield from _continuation(scenario, sweep)
    elif sweep.kind == "coexisting":
        yield from _coexisting(scenario, sweep)
    elif sweep.impacts and not scenario.all_snubbers and not scenario.located_friction:
        message = "needs a snubber or friction, and there is none"
        yield problem(("sweep", "impacts"), message, "leave it out, or add a snubber")
    if sweep.kind == "swept_sine" and sweep.notch_to is not None:
        yield from _notch_problems(scenario, sweep.notch_to)
        if not sweep.levels and not sweep.profile and not excitation.level > 0:
            yield problem(("excitation", "level"), "cannot be lowered to sweep.notch_to", "give a positive level")


def _notch_problems(scenario: ScenarioParts, limits: Mapping[str, float]) -> Problems:
    """Limits on what this structure does not have, and limits in a unit of something else."""
    outputs = {output.name: output for output in scenario.outputs}  # sweeps have none of the run alone
    hinged = _hinged(scenario)
    names = {
        "probes": [probe.name for probe in scenario.effective_probes],
        "snubbers": [snubber.name for snubber in scenario.all_snubbers],
        "outputs": list(outputs),
    }
    for name, limit in limits.items():
        path: Path = ("sweep", "notch_to", name)
        of = limited_quantity(name, scenario.base_force or BASE_FORCE.name)
        if of is None:
            example = "write for example probes.tip.acceleration, snubbers.tip.force, base.force or outputs.gauge"
            yield problem(path, "names nothing that can be limited", example)
        elif name == "base.force" and scenario.base_force is None and BASE_FORCE.name in outputs:
            yield problem(path, f"needs the name {BASE_FORCE.name}, which another output has", "rename that output")
        elif name != "base.force" and of.item not in names[of.section]:
            yield from unknown(path, of.item, of.section.removesuffix("s"), names[of.section])
        else:
            output = outputs.get(of.item, BASE_FORCE)
            of_output = output_dimension(output, scenario.all_bodies, scenario.default_body)
            dimension = of_output if of.section == "outputs" else QUANTITIES_OF[of.section][of.quantity]
            dimension = units.MOMENT if of.section == "snubbers" and of.item in hinged else dimension
            if of.section == "outputs" and output.kind in ("kinetic_energy", "strain_energy"):
                yield problem(path, "is an energy, which sweeps do not follow", "limit another quantity")
            yield from _unit_problems(path, limit, dimension, f"which is none of {getattr(dimension, 'name', '')}")


def _unit_problems(path: Path, limit: float, dimension: units.Dimension | None, but: str) -> Problems:
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


def _unfollowed(scenario: ScenarioParts) -> Problems:
    """Stops that move by themselves or with a support, which runs alone follow, and supports that move.

    Supports follow a sine of constant frequency only: while the frequency changes, their motion would drift.
    """
    sections: dict[str, Any] = {"sweep": scenario.sweep, "identify_stiffness": scenario.identify_stiffness}
    if scenario.nnm is not None:
        sections["nnm.phase_resonance"] = scenario.nnm.phase_resonance
    used = [name for name, section in sections.items() if section is not None]
    sine = "phase resonance" if "nnm.phase_resonance" in used else ""
    sine = "a swept sine" if getattr(scenario.sweep, "kind", "") == "swept_sine" else sine
    remedy = f"leave {' and '.join(used)} out, or mount it on the base"
    driven = scenario.excitation.items if used else []
    for path, each in driven:
        at = ("excitation", *path, "applied_to")
        if isinstance(each.applied_to, MovedStop):
            yield problem(at, f"is a stop that moves, which {used[0]} does not follow", remedy)
        elif isinstance(each.applied_to, MovedSupport) and sine:
            yield problem(
                at, f"is a support that moves, which {sine} does not follow",
                "use sweep.kind: stepped or continuation, move the base (applied_to: base), or model what moves the "
                "support as a body",
            )  # fmt: skip
    if any(isinstance(each.applied_to, MovedSupport) for _, each in driven):
        for at, _, snubber, _ in scenario.located_snubbers:
            if isinstance(getattr(snubber, "mounted_on", None), OnSupport):
                message = f"= {snubber.mounted_on.support} carries the stop along, which {used[0]} does not follow"
                yield problem((*at, "mounted_on", "support"), message, remedy)


def _continuation(scenario: ScenarioParts, sweep: Continuation) -> Problems:
    """Inconsistencies between a continuation and its structure and excitation."""
    given: list[tuple[str, Any]] = [("follow_folds_in", sweep.follow_folds_in), ("continue_in", sweep.continue_in)]
    unfit = [
        found
        for key, path in given
        if isinstance(path, SnubberPath)
        for found in _snubber_problems(scenario, f"sweep.{key}", path)
    ]
    yield from unfit or _range_problems(scenario, sweep)
    if isinstance(sweep.method, HarmonicBalance) and not (scenario.all_snubbers or scenario.nonlinear_springs):
        yield Problem(
            "sweep.method", "= harmonic_balance needs a snubber or a nonlinear spring", "use shooting, or add a snubber"
        )


def _coexisting(scenario: ScenarioParts, sweep: Any) -> Problems:
    """Probes that are missing, and pulses of a base that rests."""
    names, lists = [probe.name for probe in scenario.effective_probes], {"disturbances": sweep.disturbances}
    for key, items in (lists | {"starts.box": getattr(sweep.starts, "box", ())}).items():
        for k, each in enumerate(items):
            at: Path = ("sweep", *key.split("."), k)
            if each.probe:
                yield from unknown((*at, "probe"), each.probe, "probe", names)
            elif not getattr(scenario.excitation, "on_base", False):
                yield problem(at, "is a pulse of the base, which rests", "use kind: impulse, or excite the base")


def _range_problems(scenario: ScenarioParts, sweep: Continuation) -> Problems:
    """Points beyond the range, and a second range that leaves out where the folds are."""
    at: Path = ("sweep",) if sweep.continue_in is None else ("sweep", "continue_in")
    second = sweep.follow_folds_in
    try:
        parameter = in_metres(scenario, sweep.parameter)
        parameter.check()
        parameter.demand_inside(parameter.points_at, ("points_at",))
        if second is not None:
            at, second = ("sweep", "follow_folds_in"), in_metres(scenario, second)
            second.check()
        present = None if second is None else _value_in_scenario(scenario, sweep, second)
    except Unfit as error:
        yield error.problem(at)
        return
    if second is None:
        return
    low, high = sorted((float(second.from_), float(second.to)))
    if present is not None and not low <= present <= high:
        yield Problem(
            "sweep.follow_folds_in",
            f"runs from {low:g} to {high:g}, which leaves out the scenario's own {second.kind} of {present:g}, "
            "where the folds are found",
            "widen the range to hold it",
        )


def in_metres(scenario: ScenarioParts, path: Any) -> Any:
    """What a continuation goes along, positions of a snubber on its body in m."""
    return path.on_the_body(_moved(scenario, path)[1]) if isinstance(path, PositionPath) else path


def _moved(scenario: ScenarioParts, path: SnubberPath) -> tuple[Any, Body]:
    """The snubber that changes, and the body that it is on."""
    located = changed_snubber(scenario, path)
    assert located is not None
    if (name := located.bodies[0]) not in scenario.all_bodies:
        raise Unfit(f"is on {name}, an unknown body", "name another body there", ("snubber",))
    return located.item, scenario.all_bodies[name]


def _value_in_scenario(scenario: ScenarioParts, sweep: Continuation, path: Any) -> float | None:
    if isinstance(path, LevelPath):
        return float(sweep.levels[0]) if sweep.levels else getattr(scenario.excitation, "level", None)
    snubber, body = _moved(scenario, path)
    place = snubber.places[0].position
    return body.metres(place) if isinstance(path, PositionPath) else getattr(snubber, path.kind)


def changed_snubber(scenario: ScenarioParts, path: SnubberPath) -> Located | None:
    """The snubber, or pair of stops, that a path means; None where it means none."""
    written = scenario.written_snubbers
    if path.snubber is None:
        return written[0] if len(written) == 1 else None
    return next((located for located in written if located.item.name == path.snubber), None)


def _hinged(scenario: ScenarioParts) -> set[str]:
    """Names of the stops of hinges."""
    return {stop.name for stop in scenario.all_snubbers if isinstance(stop, HingeStop)}


def _no_stop_of_hinge(at: str, name: str) -> Problem:
    return Problem(at, f"= {name} is a stop of a hinge", "vary joints[0].stops[0].stiffness or angle in a study")


def _snubber_problems(scenario: ScenarioParts, at: str, path: Any) -> Problems:
    names = [located.item.name for located in scenario.written_snubbers]
    located, where = changed_snubber(scenario, path), (*path_parts(at), "snubber")
    if located is None:
        pairs = [each.item.name for each in scenario.written_snubbers for stop in each.item.stops
                 if stop.name == path.snubber]  # fmt: skip
        if path.snubber is None:
            remedy = f"there are several: choose one of {', '.join(names)}" if names else "add one to snubbers"
            yield problem(where, "is missing", remedy)
        elif pairs:
            message = f"= {path.snubber} is one stop of a pair, and both have the same {path.kind}"
            yield problem(where, message, f"name the pair: {pairs[0]}, or write two snubbers, side: above and below")
        else:
            yield from unknown(where, path.snubber, "snubber", names, "add one to snubbers")
        return
    if located.item.name in _hinged(scenario):
        yield _no_stop_of_hinge(f"{at}.snubber", located.item.name)
        return
    preloaded = [snubber.name for snubber in scenario.all_snubbers if snubber.preload is not None]
    if preloaded:
        yield Problem(
            f"{at}.kind",
            f"= {path.kind} would change the gap that the preload of {preloaded[0]} asks for at every step",
            "give its gap instead of its preload",
        )
    if isinstance(path, PositionPath):
        yield from _position_problems(scenario, at, path, located)


def _position_problems(scenario: ScenarioParts, at: str, path: PositionPath, located: Located) -> Problems:
    if len(located.item.places) > 1:
        yield Problem(f"{at}.kind", "= position moves a snubber between two places", "follow gap or stiffness")
        return
    if any(spring.item.kind == "cubic" for spring in scenario.nonlinear_springs):
        yield Problem(
            f"{at}.kind", "= position moves a snubber, which is not followed with cubic springs",
            "follow gap or stiffness, or make the springs piecewise_linear",
        )  # fmt: skip
    name = located.item.places[0].body or located.body
    body = scenario.all_bodies.get(name)
    if body is None:
        return
    if len(body.sides) != 1:
        message = f"= position moves along a beam, but the structure is {body.called}"
        yield Problem(f"{at}.kind", message, "follow gap or stiffness, or vary the place in a study")
        return
    for key, value in (("from", path.from_), ("to", path.to)):
        yield from body.position_problems(scenario.body_path(name), (*path_parts(at), key), value, "a snubber")


# --- identification ---

_TOP = "identify_stiffness"


def _identification(scenario: ScenarioParts) -> Problems:
    """Parameters that do not exist, bounds that make no sense, tests that nothing predicts."""
    section = scenario.identify_stiffness
    if section is None:
        return
    snubbers = (snubber.name for snubber in scenario.all_snubbers)
    yield from unknown((_TOP, "snubber"), section.snubber, "snubber", snubbers, "give the snubber in snubbers")
    if section.snubber in _hinged(scenario):
        yield _no_stop_of_hinge(f"{_TOP}.snubber", section.snubber)
    if section.shapes_without is not None:
        yield from _shapes(scenario, section, section.shapes_without)
    uncertain = (_TOP, "parameter_uncertainty")
    yield from _each_once(section.parameter_uncertainty, uncertain, lambda each: _known(scenario, each.parameter))
    yield from _each_once(section.update, (_TOP, "update"), lambda each: _sought(scenario, each, words=True))
    if section.nonlinear is None:
        return
    estimate = section.nonlinear.estimate
    yield from _each_once(estimate, (_TOP, "nonlinear", "estimate"), lambda each: _sought(scenario, each, words=False))
    steady = any(test.kind != "transient" for test in section.nonlinear.used.values())
    if steady and not isinstance(scenario.excitation, Harmonic):
        yield not_harmonic(f"{_TOP}.nonlinear", "a harmonic excitation", scenario.excitation)
    names = [probe.name for probe in scenario.effective_probes]
    for index, test in enumerate(section.nonlinear.tests):
        if test.probe is not None:
            yield from unknown((_TOP, "nonlinear", "tests", index, "probe"), test.probe, "probe", names)
        for k, peak in enumerate(test.peaks if isinstance(test, SweepTest) else ()):
            if peak.probe is not None:
                yield from unknown((_TOP, "nonlinear", "tests", index, "peaks", k, "probe"), peak.probe, "probe", names)
    if any(isinstance(test, SweepTest) and test.file for test in section.nonlinear.tests):
        return  # whose rows have names too
    labels = [test.label for test in section.nonlinear.tests]
    for index, name in enumerate(section.nonlinear.leave_out):
        yield from unknown((_TOP, "nonlinear", "leave_out", index), name, "test", labels)


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


def _known(scenario: ScenarioParts, path: str) -> list[Path]:
    """The places of a path, at which there must be numbers."""
    places = find_parameters(scenario, path, ("parameter",))
    if any(choices_at(scenario, place) or isinstance(value_at(scenario, place), str | Rate) for place in places):
        raise Unfit(f"= {path} is not a number", "name a number", ("parameter",))
    return places


def _sought(scenario: ScenarioParts, item: SoughtParameter, *, words: bool) -> list[Path]:
    """The places that are sought, at which there must be numbers that the bounds hold.

    Parameters
    ----------
    scenario : that has them.
    item : what is sought.
    words : whether a choice may be sought too, and numbers by a factor.
    """
    path, at = item.parameter, ("parameter",)
    places = find_parameters(scenario, path, at)
    choices = choices_at(scenario, places[0])
    if choices and words and "supports" in places[0]:
        if item.bounds or item.prior is not None:
            among = f"= {path} is a choice between {', '.join(choices)}: it has no bounds and no prior"
            raise Unfit(among, "leave them out; every choice is tried", at)
        return places
    values = [value_at(scenario, place) for place in _known(scenario, path)]
    if words and not all(value > 0 for value in values):
        zero = f"= {path} is zero in this scenario, and is varied by a factor"
        raise Unfit(zero, "give it a rough value to start from, or leave it out", at)
    if not item.bounds:
        return places
    low, high = bounds_of(scenario, item)
    if not low < high:
        raise Unfit(f"= [{low:g}, {high:g}] is empty", "give the lower bound first", ("bounds",))
    if not low <= values[0] <= high:
        raise Unfit(
            f"= [{low:g}, {high:g}] does not hold the scenario's value {values[0]:g}, where the search starts",
            "widen the bounds, change the value, or write the unit", ("bounds",),
        )  # fmt: skip
    return places


def _each_once(items: Sequence[Any], section: Path, places_of: Callable[[Any], Iterable[Path]]) -> Problems:
    """What is wrong with each of the numbers that a section lists, and those that are listed twice.

    Parameters
    ----------
    items : as they are listed.
    section : path of the list.
    places_of : the places of a number; raises `Unfit`.

    Yields
    ------
    Problem
    """
    taken: dict[Path, int] = {}
    for index, item in enumerate(items):
        try:
            first = min((taken.setdefault(place, index) for place in places_of(item)), default=index)
        except Unfit as error:
            yield error.problem((*section, index))
            continue
        if first != index:
            key = "parameter" if hasattr(item, "parameter") else "path"
            message = f"= {getattr(item, key)} takes a number that {path_text((*section, first))} takes already"
            yield problem((*section, index, key), message, "list every number once")


# --- nonlinear modes ---


def _modes(scenario: ScenarioParts) -> Problems:
    """What a nonlinear normal mode does not fit."""
    nnm = scenario.nnm
    if nnm is None:
        return
    yield from _mode_number(scenario, ("nnm", "mode"), nnm.mode)
    if (going := nnm.continue_in).kind == "stiffness_factor":
        key, largest = max(("from", going.from_), ("to", going.to), key=lambda end: end[1])
        for path, _, spring, _ in scenario.nonlinear_springs:
            if isinstance(spring, PiecewiseLinearSpring):
                yield from _slope_by_factor(path, spring, key, largest)
    if nnm.phase_resonance is not None:
        yield from _phase_resonance(scenario, nnm.phase_resonance, nnm.method.kind)


def _slope_by_factor(path: Path, spring: PiecewiseLinearSpring, key: str, factor: float) -> Problems:
    """The factor multiplies changes of slope; no slope of a softening spring may become negative."""
    slope, softest = spring.linear_stiffness, min(spring.stiffnesses)
    least = slope + factor * (softest - slope)
    if least < 0:
        yield problem(
            ("nnm", "continue_in", key),
            f"= {factor:g} gives {path_text(path)} the slope {least:g} N/m: the factor multiplies its changes of slope "
            f"from the {slope:g} N/m at rest",
            f"go up to {slope / (slope - softest):.6g} at most",
        )


def _phase_resonance(scenario: ScenarioParts, section: PhaseResonance, method: str) -> Problems:
    """What a scenario lacks, or has too much of, to hold its mode by a force; ``method`` is that of the mode."""
    excitation = scenario.excitation
    if method == "multiple_scales":
        yield Problem("nnm.phase_resonance", "needs the exact mode, not its expansion", "use method: shooting")
    if not isinstance(excitation, Harmonic):
        yield not_harmonic("nnm.phase_resonance", "a harmonic excitation, whose frequency is computed", excitation)
        return
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


def _cases(scenario: ScenarioParts) -> Problems:
    """Unknown paths, values that their fields do not accept, too many cases."""
    vary = scenario.study
    if vary is None:
        return
    yield from _parameter_problems(scenario, vary.parameters, (vary.section, "parameters"))
    if isinstance(vary, Zipped):
        counts = [value_count(parameter) for parameter in vary.parameters]
        if len(set(counts)) > 1:
            yield Problem(
                "vary.parameters",
                f"have {', '.join(map(str, counts))} values, which cannot be zipped",
                "give all of them equally many, or write kind: grid",
            )
    if isinstance(vary, LatinHypercube | Reliability):
        yield from _correlation_problems(vary, ("vary",))
    if isinstance(vary, Reliability):
        yield from _reliability(scenario, vary)
    if isinstance(vary, Sobol) and vary.samples & (vary.samples - 1):
        power = 2 ** (vary.samples - 1).bit_length()
        yield Problem("vary.samples", f"= {vary.samples} is not a power of two", f"take {power // 2} or {power}")
    if isinstance(vary, Sobol) and len(vary.parameters) < 2:
        yield Problem("vary.parameters", "has one, which causes all of the variance", "write kind: latin_hypercube")
    count = case_count(vary)
    if count > MOST_CASES:
        yield Problem(
            vary.section,
            f"asks for {count:.3g} cases (at most {MOST_CASES:,} are computed)".replace(",", " "),
            "take fewer values of each parameter, or sample: kind: latin_hypercube with samples: 1000",
        )


def _reliability(scenario: ScenarioParts, vary: Reliability) -> Problems:
    """Nothing or a whole number that scatters, no limit, random inputs with a method for numbers alone."""
    inputs = inputs_with_seed(scenario.excitation)
    if not (vary.parameters or inputs):
        yield Problem("vary.parameters", "is empty, and the excitation is not random", "list the numbers that scatter")
    if scenario.limits is None:
        yield Problem("limits", "is missing, so that there is nothing to exceed", "add limits: {peak_force: 50 N}")
    matched = any(isinstance(item, MatchedInput) for _, item in inputs)
    if inputs and vary.method in ("form", "importance_sampling"):
        yield Problem(
            "vary.method", f"= {vary.method} is for numbers alone, and the excitation is random",
            "write monte_carlo" if matched else "write subset, or monte_carlo",
        )  # fmt: skip
    elif matched and vary.method == "subset":
        message = "= subset takes small steps between realisations, and a matched record has none between two seeds"
        yield Problem("vary.method", message, "write monte_carlo")
    for k, parameter in enumerate(vary.parameters):
        with suppress(Unfit):  # is reported with the parameter
            if resolve_parameter(scenario, parameter).whole:
                message = f"= {parameter.path} is a whole number, which does not scatter"
                yield problem(("vary", "parameters", k, "path"), message, "leave it out")
    for at, item in inputs:
        if isinstance(item, RandomInput) and item.amplitudes == "fixed":
            place = ("excitation", *at, "amplitudes")
            yield problem(place, "= fixed is no Gaussian process", "leave it out, or write random")


def _parameter_problems(scenario: ScenarioParts, parameters: Sequence[Any], section: Path) -> Problems:
    """What is wrong with the parameters that a section lists, each alone and with the others."""
    yield from _each_once(parameters, section, lambda each: resolve_parameter(scenario, each).set_by)


def _correlation_problems(sample: LatinHypercube | Reliability | Tolerances, section: Path) -> Problems:
    """Correlations of what is no parameter, of one with itself, or stated twice; samples too small to have them."""
    paths, stated = [parameter.path for parameter in sample.parameters], set[frozenset[str]]()
    for k, correlation in enumerate(sample.correlations):
        at, pair = (*section, "correlations", k, "between"), frozenset(correlation.between)
        for j, path in enumerate(correlation.between):
            yield from unknown((*at, j), path, "parameter", paths)
        if len(pair) < 2 or pair in stated:
            what = "are one parameter" if len(pair) < 2 else "have a correlation already"
            yield problem(at, f"= {', '.join(correlation.between)} {what}", "name two parameters, each pair once")
        stated.add(pair)
    if stated and sample.samples <= len(paths):
        message = f"= {sample.samples} is too few for correlations of {counted(len(paths), 'parameter')}"
        yield problem((*section, "samples"), message, f"take more than {len(paths)}")


def _sensitivities(scenario: ScenarioParts) -> Problems:
    """Unknown paths, numbers that are named twice, and those that have no derivative."""
    asked = () if scenario.run is None else scenario.run.sensitivities
    section = ("run", "sensitivities")
    problems = list(_parameter_problems(scenario, asked, section))
    yield from problems
    for k, number in enumerate([] if problems else [resolve_parameter(scenario, each) for each in asked]):
        settings = any(place[0] == "run" and place[1] != "start" for place in number.places)
        if settings or number.whole:
            what = "is a setting of the run" if settings else "is a whole number"
            remedy = "name a number of the structure, the excitation or the start"
            yield problem((*section, k), f"= {number.path} {what}, which has no derivative", remedy)


def _tolerances(scenario: ScenarioParts) -> Problems:
    """Unknown paths, deviations that a field does not accept, whole numbers, numbers that are varied only in part."""
    tolerances = tolerances_of(scenario)
    if tolerances is None or scenario.study is None:
        return
    section: Path = (scenario.study.section, "tolerances")
    problems = list(_parameter_problems(scenario, tolerances.parameters, (*section, "parameters")))
    yield from problems
    yield from _correlation_problems(tolerances, section)
    try:
        varied = varied_parameters(scenario)
    except Unfit:
        return  # reported where it is varied
    if problems:
        return
    for k, asked in enumerate(tolerances.parameters):
        number = resolve_parameter(scenario, asked)
        at = path_text((*section, "parameters", k, "path"))
        if number.whole:
            yield Problem(at, f"= {asked.path} is a whole number, which has no tolerance", "vary it: values: [...]")
        for other in varied:
            if set(number.places) & set(other.places) and set(number.places) != set(other.places):
                message = f"= {number.path} is varied in part, as {other.path}"
                yield Problem(at, message, f"write the path as it is varied: {other.path}, with the same `also`")
