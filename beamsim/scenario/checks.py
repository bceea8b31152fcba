"""Checks between the sections that describe the structure, its excitation and its run.

Every check yields the problems it finds; those of the other analyses are in `beamsim.scenario.analysis_checks`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Any

from beamsim.errors import Problem
from beamsim.scenario.analysis_checks import (
    MOST_SAMPLES,
    designs,
    identification,
    mode_number,
    modes,
    sweeps,
    unit_problems,
)
from beamsim.scenario.base import Path, Schema, path_text, problem, unknown, walk
from beamsim.scenario.body import Body
from beamsim.scenario.distributed import DistributedLoad, LineLoad, TableShape
from beamsim.scenario.joint import placed
from beamsim.scenario.limits import output_dimension
from beamsim.scenario.output import BendingOutput, JointOutput, MotionOutput, ReactionOutput, RecoveredOutput
from beamsim.scenario.parts import ScenarioParts
from beamsim.scenario.place import AtPlace, BetweenPlaces, MovedSupport, Sited
from beamsim.scenario.quantities import SHAPE_DISPLACEMENTS, SHAPE_VELOCITIES, meant
from beamsim.scenario.run import BodiesStart, ModeStart, PolynomialStart, Run

Problems = Iterator[Problem]


def problems(scenario: ScenarioParts) -> list[Problem]:
    """Return all inconsistencies between the parts of a scenario."""
    missing = list(_structure(scenario))
    if missing:
        return missing
    checks = (
        _bodies,
        _directions, _places, _joints, _names, _outputs, _run, _start, sweeps, identification, modes, designs, _limits,
        _pressed_friction,
    )  # fmt: skip
    return [found for check in checks for found in check(scenario)]


def _structure(scenario: ScenarioParts) -> Problems:
    given = [name for name in ("beam", "chain") if getattr(scenario, name) is not None]
    if not given and not scenario.bodies:
        yield problem(
            (), "the scenario has no structure", "give beam:, chain: or bodies: (beamsim new writes a template)"
        )
    elif len(given) == 2:
        yield problem(("chain",), "and beam exclude each other", "keep one of the two (null removes an inherited one)")
    elif given and scenario.bodies:
        yield problem(("bodies",), f"and {given[0]} exclude each other", f"list the {given[0]} among the bodies")


def _bodies(scenario: ScenarioParts) -> Problems:
    """What is wrong with each body by itself."""
    for name, body in scenario.all_bodies.items():
        yield from body.problems(scenario.body_path(name))
        if not (body.has_default_probe or scenario.probes or scenario.snubbers):
            remedy = f"give probes: [{{name: corner, at: {{body: {name}, node: 24, direction: z}}}}]"
            yield problem(("probes",), f"are missing: {name} has no default place for a probe", remedy)


def _directions(scenario: ScenarioParts) -> Problems:
    """The base and gravity move points of every body."""
    direction = getattr(scenario.excitation, "direction", None)
    gravity = scenario.gravity if isinstance(scenario.gravity, tuple) else ()
    if direction is not None:
        yield from _base_moves(scenario, ("excitation", "direction"), direction, f"= {direction}")
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
        if isinstance(part, MovedSupport):
            yield from _moved_support(scenario, path, part)
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
    """What is wrong with a place of a part of a scenario, written at a path."""
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


def _moved_support(scenario: ScenarioParts, path: Path, moved: MovedSupport) -> Problems:
    """A body or joint that there is not; which supports a body has is known to its model."""
    if moved.joint is not None:
        yield from unknown((*path, "joint"), moved.joint, "joint", (joint.name for joint in scenario.joints))
    else:
        yield from _body_named(scenario, path, moved.body, f"name one: {{body: BODY, support: {moved.support}}}")


def _distributed(scenario: ScenarioParts, path: Path, load: DistributedLoad) -> Problems:
    """A body that is unknown or of another kind, and a part that is not on it."""
    yield from _body_named(scenario, path, load.body, "name one: {body: BODY, line: whole}")
    name = load.body or scenario.default_body
    if name not in scenario.all_bodies:
        return
    body, where = scenario.all_bodies[name], scenario.body_path(name)
    key = "line" if isinstance(load, LineLoad) else "area"
    if body.body_kind != load.acts_on:
        remedy = {
            "beam": "give line: whole, with a level in N/m",
            "plate": "give area: whole, with a level in Pa",
            "chain": "list forces on its masses: excitation: {kind: forces, forces: [...]}",
            "matrices": "list forces at its nodes: excitation: {kind: forces, forces: [...]}",
        }[body.body_kind]
        yield problem((*path, key), f"belongs to a {load.acts_on}, but {path_text(where)} is {body.called}", remedy)
        return
    if load.ends is not None:
        for index, end in enumerate(load.ends):
            yield from body.position_problems(where, (*path, key, index), end, "")
        ends: Any = [body.point(end) for end in load.ends]
        pairs = [ends] if key == "line" else list(zip(*ends, strict=True))
        if any(last <= first for first, last in pairs):
            yield problem((*path, key), "does not end beyond where it begins", "give the lower end first")
    if isinstance(load.shape, TableShape):
        if body.body_kind == "beam":
            for index, position in enumerate(load.shape.x):
                yield from body.position_problems(where, (*path, "shape", "x", index), position, "")
        shape: Any = load.shape.on_the_body(body)
        for key in ("x", "y"):
            for index, (one, two) in enumerate(pairwise(getattr(shape, key) or ()), start=1):
                if two <= one:
                    at = (*path, "shape", key, index)
                    yield problem(at, "does not lie beyond the one before it", "list increasing positions")


def _joints(scenario: ScenarioParts) -> Problems:
    """A rotation acts only between points that turn."""
    for index, joint in enumerate(scenario.joints):
        yield from _joint(scenario, ("joints", index), joint)


def _joint(scenario: ScenarioParts, where: Path, joint: Any) -> Problems:
    for place in joint.places:
        name = place.body or scenario.default_body
        body = scenario.all_bodies.get(name)
        if body is not None and not body.has_slope and joint.turns_against:
            yield problem(
                where,
                f"acts on the rotation of {name}, but the points of a {body.body_kind} only deflect",
                "use kind: hinge, or kind: spring with stiffness alone",
            )
    if len(joint.places) == 2 and len({place.body or scenario.default_body for place in joint.places}) == 1:
        name = joint.places[0].body or scenario.default_body
        if joint.kind != "spring" and scenario.all_bodies[name].has_slope:
            yield problem(
                where, f"joins {name} to itself: the two points would have to deflect alike", "use kind: spring"
            )


def _names(scenario: ScenarioParts) -> Problems:
    shared: list[tuple[Path, Sequence[Any]]] = [
        ((key,), getattr(scenario, key)) for key in ("snubbers", "springs_to_ground", "springs_between", "friction")
    ]
    for name, body in scenario.all_bodies.items():
        shared += [((*scenario.body_path(name), *path), items) for path, items in body.own_names()]
    yield from _unique(shared)
    of_run = () if scenario.run is None else scenario.run.outputs
    named = [(("probes",), scenario.probes), (("outputs",), scenario.outputs), (("run", "outputs"), of_run)]
    yield from _unique(named)
    yield from _unique([(("joints",), scenario.joints)])


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
    checks: dict[type, Any] = {
        MotionOutput: _motion_output, BendingOutput: _bending_output, ReactionOutput: _reaction_output,
        JointOutput: _joint_output, RecoveredOutput: _recovered_output,
    }  # fmt: skip
    for path, output in scenario.requested_outputs:
        if type(output) in checks:
            yield from checks[type(output)](scenario, path, output)
        else:
            yield from _body_named(scenario, path, output.body, "add body: BODY")


def _motion_output(scenario: ScenarioParts, at: Path, output: MotionOutput) -> Problems:
    """Only points of beams have a slope."""
    body = scenario.all_bodies.get(output.place.body or scenario.default_body)
    if body is not None and output.kind == "rotation" and not body.has_slope:
        yield problem(at, f"asks for a slope, but the points of a {body.body_kind} have none", "name a point of a beam")


def _bending_output(scenario: ScenarioParts, at: Path, output: BendingOutput) -> Problems:
    """Only beams and plates bend, only plates have components, and the distance of the fibre must be known."""
    name = output.place.body or scenario.default_body
    body = scenario.all_bodies.get(name)
    if body is None:
        return
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
    """The body must be there; whether it has such a support is known to its model."""
    if output.about is not None and (output.support != "base" or output.kind != "reaction_moment"):
        yield problem((*at, "about"), "belongs to the moment of the base", "leave it out")
    if output.support != "base":
        yield from _body_named(scenario, at, output.body, "add body: BODY")
    elif output.body is not None:
        yield problem((*at, "body"), "belongs to a support; the base holds all bodies", "leave it out")
    elif output.kind == "reaction_moment" or output.direction is not None:
        direction = output.direction or ("ry" if output.kind == "reaction_moment" else "z")
        yield from _base_moves(scenario, (*at, "direction"), direction, f"= {direction}")
    if output.direction is not None and (len(output.direction) == 2) != (output.kind == "reaction_moment"):
        yield problem((*at, "direction"), f"= {output.direction} is none of a {output.kind.replace('_', ' ')}",
                       "forces have x, y and z, moments rx, ry and rz")  # fmt: skip


def _joint_output(scenario: ScenarioParts, at: Path, output: JointOutput) -> Problems:
    """The joint must be there."""
    yield from unknown((*at, "joint"), output.joint, "joint", (joint.name for joint in scenario.joined_by))


def _recovered_output(scenario: ScenarioParts, at: Path, output: RecoveredOutput) -> Problems:
    """The body must have a recovery matrix with this row."""
    yield from _body_named(scenario, at, output.body, "add body: BODY")
    body = scenario.all_bodies.get(output.body or scenario.default_body)
    if body is None:
        return
    if not body.recovered_rows:
        yield problem(
            at, f"needs a recovery matrix, which {output.body or scenario.default_body} lacks",
            "give recovery: {file: panel.op4, name: stress, rows: [skin]} of imported matrices",
        )  # fmt: skip
    else:
        yield from unknown((*at, "row"), output.row, "row of the recovery matrix", body.recovered_rows)


def _run(scenario: ScenarioParts) -> Problems:
    run = scenario.run
    if run is None:
        return
    yield from _sampling(scenario, run)
    yield from _spectrum(scenario, run)
    yield from _impacts(scenario, run)


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


def _spectrum(scenario: ScenarioParts, run: Run) -> Problems:
    spectrum = run.spectrum
    if spectrum.last is not None and spectrum.last > run.duration * (1.0 + 1e-12):
        yield problem(
            ("run", "spectrum", "last"),
            f"= {spectrum.last:g} s is longer than run.duration = {run.duration:g} s",
            "analyse a shorter part, or use a longer run",
        )
    yield from _chosen_frequencies(scenario, run)
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


def _chosen_frequencies(scenario: ScenarioParts, run: Run) -> Problems:
    """Frequencies of the spectra must be told apart, and be below half the rate of a time-stepping run's samples."""
    chosen, tones = run.spectrum.frequencies, scenario.excitation.frequencies_hz
    duration = min(run.spectrum.last or run.duration, run.duration)
    if run.spectrum.periods is not None and len(tones) == 1:
        duration = min(run.spectrum.periods / tones[0], duration)
    stepped = run.method == "reference" or any(located.item.kind == "cubic" for located in scenario.nonlinear_springs)
    for index, frequency in enumerate(chosen):
        at: Path = ("run", "spectrum", "frequencies", index)
        near = min(chosen[:index], key=lambda other: abs(other - frequency), default=-1.0 / duration)
        if abs(near - frequency) * duration < 1.0:
            yield problem(
                at,
                f"= {frequency:g} Hz cannot be distinguished from {near:g} Hz in the {duration:g} s that are analysed",
                f"keep frequencies {1 / duration:g} Hz apart, or analyse a longer part",
            )
        if stepped and frequency >= 0.5 * scenario.sample_rate:
            yield problem(
                at,
                f"= {frequency:g} Hz is not below half of run.sample_rate = {scenario.sample_rate:g} Hz",
                "raise run.sample_rate: spectra of a time-stepping method are those of its samples",
            )


def _impacts(scenario: ScenarioParts, run: Run) -> Problems:
    """Statistics of impacts and of stress that this structure, or time stepping, does not have."""
    cubic = any(located.item.kind == "cubic" for located in scenario.nonlinear_springs)
    for where, settings in (("run.impacts", run.impacts), ("run.fatigue", run.fatigue)):
        if settings is not None and run.method == "reference":
            yield Problem(where, "needs the motion in closed form", "leave run.method: reference out")
        elif settings is not None and cubic:
            yield Problem(
                where, "needs the motion in closed form, which cubic springs do not have",
                "leave it out, or replace the cubic springs by piecewise-linear ones",
            )  # fmt: skip
    if run.impacts is not None and not scenario.all_snubbers:
        yield Problem("run.impacts", "needs a snubber, and there is none", "leave it out, or add a snubber")
    if run.fatigue is not None and not any(body.gives_stress for body in scenario.all_bodies.values()):
        yield Problem(
            "run.fatigue", "needs a body whose stress is known",
            "leave it out, or give a beam's extreme_fibre and youngs_modulus",
        )  # fmt: skip


def _start(scenario: ScenarioParts) -> Problems:
    start = None if scenario.run is None else scenario.run.start
    if isinstance(start, ModeStart):
        yield from mode_number(scenario, ("run", "start", "mode"), start.mode)
    at: Path = ("run", "start")
    if isinstance(start, PolynomialStart):
        if len(scenario.all_bodies) > 1:
            yield problem(
                at,
                f"gives one shape, and there are {len(scenario.all_bodies)} bodies",
                f"name the body: start: {{bodies: {{{next(iter(scenario.all_bodies))}: {{displacement: [...]}}}}}}",
            )
            return
        given = dict.fromkeys(scenario.all_bodies, start)
    elif isinstance(start, BodiesStart):
        at = (*at, "bodies")
        given = start.bodies
    else:
        return
    for name, shape in given.items():
        path = (*at, name) if isinstance(start, BodiesStart) else at
        yield from unknown(path, name, "body", scenario.all_bodies)
        if name not in scenario.all_bodies:
            continue
        body, where = scenario.all_bodies[name], scenario.body_path(name)
        for quantity in ("displacement", "velocity"):
            numbers = getattr(shape, quantity)
            yield from _units_of_shape(body, (*path, quantity), numbers)
            yield from body.start_problems(where, (*path, quantity), numbers)


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
    """Friction under the force of a snubber: of one that does not pull, in closed form."""
    snubbers = {snubber.name: snubber for snubber in scenario.all_snubbers}
    rigid = [contact.name for contact in scenario.friction if contact.stiffness is None]
    for index, contact in enumerate(scenario.friction):
        if contact.pressed_by is None:
            continue
        where, name = ("friction", index, "normal_force"), contact.pressed_by
        yield from unknown((*where, "snubber"), name, "snubber", snubbers, "there is no snubber: give a force")
        if name not in snubbers:
            continue
        if scenario.run is not None and scenario.run.method == "reference":
            yield problem(
                where, f"= the force of {name} is followed in closed form alone, not by run.method: reference",
                "leave run.method out, or give a constant force, for example the snubber's mean force in contact",
            )  # fmt: skip
        damped = snubbers[name].damping is not None
        if damped and snubbers[name].law != "no_tension":
            remedy = (
                "leave the snubber's damping out" if snubbers[name].hardening else "give the snubber law: no_tension"
            )
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


def _limits(scenario: ScenarioParts) -> Problems:
    """Limits on quantities that this structure does not have."""
    limits, bodies = scenario.limits, scenario.all_bodies.values()
    if limits is None:
        return
    if limits.bending_stress is not None and not any(body.gives_stress for body in bodies):
        if all(body.body_kind == "chain" for body in bodies):
            yield Problem("limits.bending_stress", "applies to a beam, but the structure is a chain", "leave it out")
        else:
            yield Problem(
                "limits.bending_stress",
                "needs a beam whose section is known",
                "give its extreme_fibre and youngs_modulus",
            )
    for name in ("peak_force", "gap"):
        if getattr(limits, name) is not None and not scenario.all_snubbers:
            yield Problem(f"limits.{name}", "limits the snubbers, and there are none", "add a snubber, or leave it out")
    outputs = {output.name: output for _, output in scenario.requested_outputs}
    for name, limit in (limits.outputs or {}).items():
        path: Path = ("limits", "outputs", name)
        yield from unknown(path, name, "output", outputs, "list it in outputs")
        if name not in outputs:
            continue
        dimension = output_dimension(outputs[name], scenario.all_bodies, scenario.default_body)
        kind = outputs[name].kind.replace("_", " ")
        yield from unit_problems(path, limit, dimension, f"and the output is a {kind}")
