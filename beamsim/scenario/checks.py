"""Consistency checks between the parts of a scenario.

Every check yields the problems it finds. A check that meets a value that is itself invalid (see
`beamsim.scenario.base`) stops there, and the others continue.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from beamsim.errors import Problem
from beamsim.scenario.base import Path, Schema, UnknownValueError, path_text, suggestion, walk
from beamsim.scenario.body import Body
from beamsim.scenario.distributed import DistributedLoad, distributed_problems
from beamsim.scenario.excitation import Forces, Harmonic, level_problems, sine_problems
from beamsim.scenario.impacts import impact_problems
from beamsim.scenario.joint import body_origins
from beamsim.scenario.limits import Limits, limit_problems
from beamsim.scenario.moved_support import MovedSupport, moved_support_problems
from beamsim.scenario.place import AtPlace, Probe, Sited
from beamsim.scenario.run import BodiesStart, ModeStart, PolynomialStart, Run
from beamsim.scenario.start_shape import DIMENSIONS, ShapeNumber
from beamsim.scenario.whole import ScenarioParts

if TYPE_CHECKING:
    from beamsim.scenario.designs import Vary
    from beamsim.scenario.identification import IdentifyStiffness
    from beamsim.scenario.nnm import NonlinearMode
    from beamsim.scenario.sweep import Sweep

MOST_SAMPLES = 100_000_000
"""Largest number of output samples; longer histories would not fit into memory."""

Problems = Iterator[Problem]


class _Checked(ScenarioParts, Protocol):
    """A scenario with all its sections."""

    bodies: dict[str, Any]
    run: Run | None
    sweep: Sweep | None
    identify_stiffness: IdentifyStiffness | None
    nnm: NonlinearMode | None
    vary: Vary | None
    limits: Limits | None

    @property
    def whole(self) -> Schema: ...
    @property
    def beam(self) -> Body | None: ...
    @property
    def chain(self) -> Body | None: ...
    @property
    def gravity(self) -> Any: ...
    @property
    def joints(self) -> tuple[Any, ...]: ...
    @property
    def springs_to_ground(self) -> tuple[Any, ...]: ...
    @property
    def springs_between(self) -> tuple[Any, ...]: ...
    @property
    def snubbers(self) -> tuple[Any, ...]: ...
    @property
    def friction(self) -> tuple[Any, ...]: ...
    @property
    def all_snubbers(self) -> tuple[Any, ...]: ...
    @property
    def probes(self) -> tuple[Probe, ...]: ...
    @property
    def outputs(self) -> tuple[Any, ...]: ...


def problems(scenario: _Checked) -> list[Problem]:
    """Return all inconsistencies between the parts of a scenario."""
    checks = (
        _structure, _directions, _places, _joints, _names, _outputs, _run, _start, _sweep, _identification, _modes,
        _phase_resonance, _designs, _limits, _pressed_friction,
    )  # fmt: skip
    return [problem for check in checks for problem in _guarded(check(scenario))]


def _guarded(check: Problems) -> Problems:
    """Yield what a check finds until it meets an unknown value."""
    try:
        yield from check
    except UnknownValueError:
        return


def _problem(path: Path, message: str, remedy: str = "") -> Problem:
    return Problem(path_text(path), message, remedy)


def _directions(scenario: _Checked) -> Problems:
    """The base and gravity move points of every body; where several turn, joints must say how they lie."""
    excitation, gravity, bodies = scenario.excitation, scenario.gravity, scenario.all_bodies
    asked: list[tuple[Path, str]] = []
    direction = getattr(excitation, "direction", None)
    if direction is not None:
        asked.append((("excitation", "direction"), direction))
    if isinstance(gravity, tuple):
        asked += [(("gravity", i), "xyz"[i]) for i in range(3) if gravity[i] != 0]
    for path, axis in asked:
        for name, body in bodies.items():
            if axis not in body.base_directions:
                yield _problem(
                    path, f"= {axis} moves no point of {name}, a {body.body_kind}" if path[0] == "excitation"
                    else f"acts along {axis}, in which no point of {name}, a {body.body_kind}, moves",
                    f"use {' or '.join(filter(None, body.base_directions))}",
                )  # fmt: skip
    if direction is not None and direction.startswith("r") and len(bodies) > 1:
        placed = body_origins(scenario.joints, scenario.default_body)
        if set(bodies) - set(placed):
            yield _problem(
                ("excitation", "direction"),
                f"= {direction} turns several bodies, and joints do not say how {', '.join(bodies)} lie to one another",
                "join them by points of beams, or model them as one body",
            )


def _structure(scenario: _Checked) -> Problems:
    given = [name for name in ("beam", "chain") if getattr(scenario, name) is not None]
    if not given and not scenario.bodies:
        yield _problem(
            (), "the scenario has no structure", "give beam:, chain: or bodies: (beamsim new writes a template)"
        )
    elif len(given) == 2:
        yield _problem(("chain",), "and beam exclude each other", "keep one of the two (null removes an inherited one)")
    elif given and scenario.bodies:
        yield _problem(("bodies",), f"and {given[0]} exclude each other", f"list the {given[0]} among the bodies")
    elif given == ["chain"] and any(getattr(s, "position", None) is not None for s in scenario.snubbers):
        yield _problem(("snubbers",), "act on a beam", "list the snubbers of a chain in chain.snubbers, by mass")
    for name, body in scenario.all_bodies.items():
        yield from _guarded(body.problems(scenario.body_path(name)))
        if not (body.has_default_probe or scenario.probes or scenario.snubbers):
            remedy = f"give probes: [{{name: corner, at: {{body: {name}, node: 24, direction: z}}}}]"
            yield _problem(("probes",), f"are missing: {name} has no default place for a probe", remedy)


def _places(scenario: _Checked) -> Problems:
    """Everything that sits somewhere must sit on a body, where it can act."""
    for path, part in walk(scenario):
        if isinstance(part, MovedSupport):
            yield from _guarded(moved_support_problems(scenario, path, part))
        elif isinstance(part, DistributedLoad):
            yield from _guarded(distributed_problems(scenario, path, part))
        else:
            yield from _guarded(place_problems(scenario, path, part))


def place_problems(scenario: _Checked, path: Path, part: Schema) -> Problems:
    """What is wrong with a place of a part of a scenario, written at a path."""
    if path[:1] in (("beam",), ("chain",), ("bodies",)):  # see `_structure`
        return
    if isinstance(part, AtPlace):
        place = part
    elif isinstance(part, Sited) and part.at is None:
        place = part.places[0]
    else:
        return
    name = scenario.default_body
    if place.body is not None:
        name = place.body
        if name not in scenario.all_bodies:
            known = suggestion(name, scenario.all_bodies, "the bodies are")
            yield _problem((*path, "body"), f"= {name} is an unknown body", known)
            return
    elif not name:
        if len(scenario.all_bodies) > 1:
            bodies = ", ".join(scenario.all_bodies)
            yield _problem(
                path,
                f"names no body, and there are several: {bodies}",
                f"name one: at: {{body: {next(iter(scenario.all_bodies))}, position: 270 mm}}",
            )
        return
    body, where = scenario.all_bodies[name], scenario.body_path(name)
    if place.node is not None:
        yield from body.node_problems(where, (*path, "node"))
    elif place.mass is not None:
        yield from body.mass_problems(where, (*path, "mass"), place.mass)
    elif place.position is not None:
        if path[0] == "snubbers" and where == ("chain",):  # see `_structure`
            return
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


def _joints(scenario: _Checked) -> Problems:
    """A rotation acts only between points that turn."""
    for index, joint in enumerate(scenario.joints):
        yield from _guarded(_joint(scenario, ("joints", index), joint))


def _joint(scenario: _Checked, where: Path, joint: Any) -> Problems:
    for place in joint.places:
        name = place.body or scenario.default_body
        body = scenario.all_bodies.get(name)
        if body is not None and not body.has_slope and joint.turns_against:
            yield _problem(
                where,
                f"acts on the rotation of {name}, but the points of a {body.body_kind} only deflect",
                "use kind: hinge, or kind: spring with stiffness alone",
            )
    if len(joint.places) == 2 and len({place.body or scenario.default_body for place in joint.places}) == 1:
        name = joint.places[0].body or scenario.default_body
        if joint.kind != "spring" and scenario.all_bodies[name].has_slope:
            yield _problem(
                where, f"joins {name} to itself: the two points would have to deflect alike", "use kind: spring"
            )


def _names(scenario: _Checked) -> Problems:
    shared: list[tuple[Path, Sequence[Any]]] = [
        ((key,), getattr(scenario, key)) for key in ("snubbers", "springs_to_ground", "springs_between", "friction")
    ]
    for name, body in scenario.all_bodies.items():
        shared += [((*scenario.body_path(name), *path), items) for path, items in body.own_names()]
    yield from _guarded(_unique(shared))
    of_run = () if scenario.run is None else scenario.run.outputs
    named = [(("probes",), scenario.probes), (("outputs",), scenario.outputs), (("run", "outputs"), of_run)]
    yield from _guarded(_unique(named))
    yield from _guarded(_unique([(("joints",), scenario.joints)]))


def _unique(lists: Iterable[tuple[Path, Sequence[Any]]]) -> Problems:
    """Names within lists must be unique."""
    first: dict[str, Path] = {}
    for path, items in lists:
        for index, item in enumerate(items):
            if item.name in first:
                other = path_text(first[item.name])
                yield _problem(
                    (*path, index, "name"), f"= {item.name} is already the name of {other}", "choose another name"
                )
            first.setdefault(item.name, (*path, index))


def _outputs(scenario: _Checked) -> Problems:
    joined = (*scenario.joints, *scenario.springs_between, *scenario.springs_to_ground)
    for path, output in scenario.requested_outputs:
        yield from _guarded(output.problems(path, scenario.all_bodies, scenario.default_body, joined))


def _run(scenario: _Checked) -> Problems:
    run = scenario.run
    if run is None:
        return
    yield from _guarded(_sampling(scenario, run))
    yield from _guarded(_spectrum(scenario, run))
    yield from impact_problems(scenario, run.impacts, run.fatigue, stepped=run.method == "reference")


def _sampling(scenario: _Checked, run: Run) -> Problems:
    rate = run.sample_rate
    if rate is None:
        return
    at = ("run", "sample_rate")
    if rate * run.duration < 1.0:
        yield _problem(
            at,
            f"= {rate:g} Hz gives only one sample in run.duration = {run.duration:g} s",
            "use a higher sample rate, or a longer run",
        )
    elif rate * run.duration > MOST_SAMPLES:
        yield _problem(
            at,
            f"= {rate:g} Hz over run.duration = {run.duration:g} s gives {rate * run.duration:.3g} samples, "
            f"over the limit of {MOST_SAMPLES:.0e}",
            "contacts are found exactly at any sample rate; use a lower one, or a shorter run",
        )
    highest = max(scenario.excitation.frequencies_hz, default=0.0)
    if rate < 2.0 * highest:
        yield _problem(
            at,
            f"= {rate:g} Hz is under twice the excitation frequency of {highest:g} Hz",
            f"use at least {2 * highest:g} Hz; {20 * highest:g} Hz shows the first harmonics",
        )


def _spectrum(scenario: _Checked, run: Run) -> Problems:
    spectrum = run.spectrum
    if spectrum.last is not None and spectrum.last > run.duration * (1.0 + 1e-12):
        yield _problem(
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
        yield _problem(at, "needs an excitation with one frequency", "give last: 0.4 s instead")
    elif spectrum.periods / frequencies[0] > run.duration * (1.0 + 1e-12):
        yield _problem(
            at,
            f"= {spectrum.periods} periods of {frequencies[0]:g} Hz take {spectrum.periods / frequencies[0]:g} s, "
            f"longer than run.duration = {run.duration:g} s",
            f"analyse at most {int(run.duration * frequencies[0])} periods, or run longer",
        )


def _chosen_frequencies(scenario: _Checked, run: Run) -> Problems:
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
            yield _problem(
                at,
                f"= {frequency:g} Hz cannot be distinguished from {near:g} Hz in the {duration:g} s that are analysed",
                f"keep frequencies {1 / duration:g} Hz apart, or analyse a longer part",
            )
        if stepped and run.sample_rate is not None and frequency >= 0.5 * run.sample_rate:
            yield _problem(
                at,
                f"= {frequency:g} Hz is not below half of run.sample_rate = {run.sample_rate:g} Hz",
                "raise run.sample_rate: spectra of a time-stepping method are those of its samples",
            )


def _start(scenario: _Checked) -> Problems:
    start = None if scenario.run is None else scenario.run.start
    if isinstance(start, ModeStart):
        yield from _mode_number(scenario, ("run", "start", "mode"), start.mode)
    at: Path = ("run", "start")
    if isinstance(start, PolynomialStart):
        if len(scenario.all_bodies) > 1:
            yield _problem(
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
        if name not in scenario.all_bodies:
            yield _problem(path, "is an unknown body", suggestion(name, scenario.all_bodies, "the bodies are"))
            continue
        body, where = scenario.all_bodies[name], scenario.body_path(name)
        for quantity in ("displacement", "velocity"):
            numbers = getattr(shape, quantity)
            yield from _units_of_shape(body, (*path, quantity), numbers)
            yield from _guarded(body.start_problems(where, (*path, quantity), numbers))


def _units_of_shape(body: Body, path: Path, numbers: Sequence[float]) -> Problems:
    """Numbers with the unit of another one of the shape."""
    dimensions = DIMENSIONS[str(path[-1])]
    for index, number in enumerate(numbers):
        meant = number.power if isinstance(number, ShapeNumber) else None
        power = body.power_of_start(index)
        if meant is not None and meant != power:
            wanted = dimensions[power] if power < len(dimensions) else None
            yield _problem(
                (*path, index),
                f"is {dimensions[meant].with_article}, but must be "
                f"{f'the coefficient of x^{power}' if wanted is None else wanted.with_article}",
                "write a bare number in SI units" if wanted is None else f"write for example {wanted.example}",
            )


def _mode_number(scenario: _Checked, at: Path, mode: int) -> Problems:
    """Modes of which there are only so many."""
    counts = [body.mode_count for body in scenario.all_bodies.values()]
    known = [count for count in counts if count is not None]
    total = sum(known)
    if len(known) == len(counts) and mode > total:
        what = f"a chain of {total} masses has" if len(counts) == 1 else f"the bodies together have {total} masses and"
        yield _problem(at, f"= {mode}, but {what} {total} modes", f"choose a mode from 1 to {total}")


def _sweep(scenario: _Checked) -> Problems:
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
    for index, level in enumerate(sweep.levels):
        yield from level_problems(excitation, ("sweep", "levels", index), level)
    if sweep.kind == "continuation":
        from beamsim.scenario.continuation_checks import continuation_problems

        yield from continuation_problems(scenario, sweep)
    elif sweep.impacts and not scenario.all_snubbers and not scenario.friction:
        message = "needs a snubber or friction, and there is none"
        yield _problem(("sweep", "impacts"), message, "leave it out, or add a snubber")
    if sweep.kind == "swept_sine":
        if sweep.notch_to is not None:
            from beamsim.scenario.notching import notch_problems

            yield from notch_problems(scenario, sweep.notch_to)
            if not sweep.levels and not sweep.profile and not excitation.level > 0:
                yield _problem(("excitation", "level"), "cannot be lowered to sweep.notch_to", "give a positive level")
        for name, points in (("profile", sweep.profile), ("notches", sweep.notches)):
            for index, point in enumerate(points):
                if point.quantity is not None and point.quantity not in excitation.takes:
                    several = isinstance(excitation, Forces)
                    yield _problem(
                        ("sweep", name, index, "level"),
                        f"is a level of {point.quantity}, "
                        + ("but multiplies the levels of all forces" if several else
                           f"and the excitation is of {excitation.quantity}"),
                        "give a plain number: 0.5" if several else "give it in a unit that fits excitation.applied_to",
                    )  # fmt: skip


def _swept_supports(excitation: Harmonic | Forces) -> Problems:
    """Supports follow a sine of constant frequency only: while the frequency changes, their motion would drift."""
    forces = enumerate(excitation.forces) if isinstance(excitation, Forces) else [(None, excitation)]
    for index, force in forces:
        if isinstance(force.applied_to, MovedSupport):
            yield _problem(
                ("excitation", *(() if index is None else ("forces", index)), "applied_to"),
                "is a support that moves, which a swept sine does not follow",
                "use sweep.kind: stepped or continuation, move the base (applied_to: base), or model what moves the "
                "support as a body",
            )  # fmt: skip


def _identification(scenario: _Checked) -> Problems:
    section = scenario.identify_stiffness
    if section is None:
        return
    from beamsim.scenario.identification_checks import identification_problems

    names = [snubber.name for snubber in scenario.all_snubbers]
    if section.snubber not in names:
        known = suggestion(section.snubber, names, "the snubbers are") if names else "give the snubber in snubbers"
        yield _problem(("identify_stiffness", "snubber"), f"= {section.snubber} is not the name of a snubber", known)
    yield from identification_problems(scenario, scenario.whole, section)


def _modes(scenario: _Checked) -> Problems:
    nnm = scenario.nnm
    if nnm is None:
        return
    yield from _mode_number(scenario, ("nnm", "mode"), nnm.mode)
    if (going := nnm.continue_in).kind == "stiffness_factor":
        key, largest = max(("from", going.from_), ("to", going.to), key=lambda end: end[1])
        for name, body in scenario.all_bodies.items():
            yield from _guarded(body.factor_problems(scenario.body_path(name), key, largest))


def _phase_resonance(scenario: _Checked) -> Problems:
    nnm = scenario.nnm
    if nnm is not None and nnm.phase_resonance is not None:
        from beamsim.scenario.phase_resonance import phase_resonance_problems

        yield from phase_resonance_problems(scenario, nnm.phase_resonance, nnm.solver.kind)


def _designs(scenario: _Checked) -> Problems:
    if scenario.vary is not None:
        from beamsim.scenario.designs import design_problems
        from beamsim.scenario.tolerances import tolerance_problems

        yield from design_problems(scenario.whole, scenario.vary)
        yield from tolerance_problems(scenario)


def _pressed_friction(scenario: _Checked) -> Problems:
    """Friction under the force of a snubber: of one that does not pull, in closed form."""
    snubbers = {snubber.name: snubber for snubber in scenario.all_snubbers}
    rigid = [contact.name for contact in scenario.friction if contact.stiffness is None]
    for index, contact in enumerate(scenario.friction):
        if contact.pressed_by is None:
            continue
        where, name = ("friction", index, "normal_force"), contact.pressed_by
        if name not in snubbers:
            remedy = suggestion(name, snubbers, "the snubbers are") if snubbers else "there is no snubber: give a force"
            yield _problem((*where, "snubber"), f"= {name} is an unknown snubber", remedy)
            continue
        if scenario.run is not None and scenario.run.method == "reference":
            yield _problem(
                where, f"= the force of {name} is followed in closed form alone, not by run.method: reference",
                "leave run.method out, or give a constant force, for example the snubber's mean force in contact",
            )  # fmt: skip
        damped = snubbers[name].damping is not None
        if damped and snubbers[name].law != "no_tension":
            remedy = (
                "leave the snubber's damping out" if snubbers[name].hardening else "give the snubber law: no_tension"
            )
            yield _problem(where, f"= the force of {name} may pull, since its dashpot acts while it opens", remedy)
        elif damped and contact.stiffness is not None:
            yield _problem(
                ("friction", index, "stiffness"),
                f"does not go with the force of {name}: the slider behind a tangential spring follows the rate of the "
                "force, and that of a dashpot depends on accelerations",
                "leave stiffness out, or give the snubber maxwell branches instead of its damping",
            )  # fmt: skip
        if contact.stiffness is None and len(rigid) > 1:
            others = ", ".join(other for other in rigid if other != contact.name)
            yield _problem(
                ("friction", index, "stiffness"), f"is missing, and {others} sticks without a spring as well",
                "give the contact a tangential stiffness",
            )  # fmt: skip


def _limits(scenario: _Checked) -> Problems:
    if scenario.limits is not None:
        yield from limit_problems(scenario, scenario.limits)
