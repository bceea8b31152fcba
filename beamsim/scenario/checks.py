"""Consistency checks between the parts of a scenario.

Every check yields the problems it finds. A check that meets a value that is itself invalid (see
`beamsim.scenario.base`) stops there, and the others continue.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from difflib import get_close_matches
from typing import TYPE_CHECKING

from beamsim.errors import Problem
from beamsim.scenario.base import Path, Schema, UnknownValueError, path_text, walk
from beamsim.scenario.beam import PointMass
from beamsim.scenario.continuation import Continuation, continuation_problems
from beamsim.scenario.designs import design_problems
from beamsim.scenario.excitation import Harmonic
from beamsim.scenario.identification_checks import identification_problems
from beamsim.scenario.limits import limit_problems
from beamsim.scenario.names import Named
from beamsim.scenario.nnm import StiffnessFactorContinuation
from beamsim.scenario.phase_resonance import phase_resonance_problems
from beamsim.scenario.place import AtMass, AtPosition, ConstantForce, OneOfTwoPlaces, Probe
from beamsim.scenario.quantities import LevelValue
from beamsim.scenario.run import ModeStart, PolynomialStart
from beamsim.scenario.snubber import LinkSnubber, MassSnubber, Snubber
from beamsim.scenario.spring import BetweenMasses, OnMass, PiecewiseLinearSpring
from beamsim.scenario.sweep import SweptSine

if TYPE_CHECKING:
    from beamsim.scenario.beam import Beam
    from beamsim.scenario.chain import Chain
    from beamsim.scenario.run import Run
    from beamsim.scenario.scenario import Scenario

MOST_SAMPLES = 100_000_000
"""Largest number of output samples; longer histories would not fit into memory."""

Found = Iterator[Problem]


def problems(scenario: Scenario) -> list[Problem]:
    """Return all inconsistencies between the parts of a scenario."""
    checks = (
        _structure, _places, _names, _run, _start, _sweep, _identification, _modes, phase_resonance_problems, _designs,
        _limits,
    )  # fmt: skip
    return [problem for check in checks for problem in _guarded(check(scenario))]


def _guarded(found: Found) -> Found:
    """Yield what a check finds until it meets an unknown value."""
    try:
        yield from found
    except UnknownValueError:
        return


def _problem(path: Path, message: str, remedy: str = "") -> Problem:
    return Problem(path_text(path), message, remedy)


def _structure(scenario: Scenario) -> Found:
    if scenario.beam is None and scenario.chain is None:
        yield _problem((), "the scenario has no structure", "give beam: or chain: (beamsim new writes a template)")
    elif scenario.beam is not None and scenario.chain is not None:
        yield _problem(("chain",), "and beam exclude each other", "keep one of the two (null removes an inherited one)")
    elif scenario.chain is not None and scenario.snubbers:
        yield _problem(("snubbers",), "act on a beam", "list the snubbers of a chain in chain.snubbers, by mass")
    beam = scenario.beam
    if beam is not None and beam.elements == 1 and beam.supports.left == beam.supports.right == "clamped":
        inside = [mass for mass in beam.point_masses if 0.0 < mass.position < beam.length]
        if not inside:
            yield _problem(
                ("beam", "elements"), "= 1 leaves no degree of freedom between two clamped ends", "use 2 or more"
            )


def _places(scenario: Scenario) -> Found:
    """Everything with a place must be on the structure, where it can act."""
    for path, part in walk(scenario):
        yield from _guarded(_place(scenario, path, part))


def _place(scenario: Scenario, path: Path, part: Schema) -> Found:
    position: float | None = None
    mass: int | None = None
    if isinstance(part, (LinkSnubber, BetweenMasses)):
        key = "between" if isinstance(part, LinkSnubber) else "masses"
        for index, number in enumerate(getattr(part, key)):
            yield from _on_chain(scenario, (*path, key, index), number)
    elif isinstance(part, OneOfTwoPlaces):
        position, mass = part.position, part.mass
    elif isinstance(part, (AtPosition, Snubber, PointMass)):
        position = part.position
    elif isinstance(part, (AtMass, MassSnubber, OnMass)):
        mass = part.mass
    if position is not None:
        yield from _on_beam(scenario, path, part, position)
    if mass is not None:
        yield from _on_chain(scenario, (*path, "mass"), mass)


def _on_beam(scenario: Scenario, path: Path, part: Schema, position: float) -> Found:
    beam, at = scenario.beam, (*path, "position")
    if beam is None:
        if scenario.chain is not None and not isinstance(part, Snubber):
            yield _problem(at, "applies to a beam, but the structure is a chain", "give a mass by its number, mass: 1")
        return
    if position > beam.length:
        given = _distinct(position, beam.length)
        yield _problem(
            at,
            f"= {given[0]} m lies beyond beam.length = {given[1]} m",
            f"positions run from 0 to {given[1]} m, from the left end",
        )
        return
    held = _held_end(beam, position)
    if held is None or isinstance(part, (PointMass, Probe, ConstantForce)):
        return
    end, support = held
    what = "a snubber" if isinstance(part, Snubber) else "a force"
    yield _problem(
        at,
        f"= {position:g} m is the {support} {end} end, which cannot deflect: {what} has no effect there",
        f"move it along the beam, or change beam.supports.{end}",
    )


def _distinct(a: float, b: float) -> tuple[str, str]:
    """Print two numbers with enough digits to distinguish them."""
    for digits in range(6, 18):
        texts = f"{a:.{digits}g}", f"{b:.{digits}g}"
        if texts[0] != texts[1]:
            return texts
    return repr(a), repr(b)


def _held_end(beam: Beam, position: float) -> tuple[str, str] | None:
    """Return (end, support) if no deflection is possible at the position."""
    if position == 0.0 and beam.supports.left in ("clamped", "pinned"):
        return "left", beam.supports.left
    if position == beam.length and beam.supports.right in ("clamped", "pinned"):
        return "right", beam.supports.right
    return None


def _on_chain(scenario: Scenario, at: Path, mass: int) -> Found:
    if scenario.chain is None:
        if scenario.beam is not None:
            yield _problem(
                at, "applies to a chain, but the structure is a beam", "give a position on the beam, position: 270 mm"
            )
    elif mass > scenario.chain.count:
        count = scenario.chain.count
        yield _problem(at, f"= {mass}, but the chain has {count} masses", f"masses are numbered from 1 to {count}")


def _names(scenario: Scenario) -> Found:
    chain = scenario.chain
    if chain is not None:
        lists = ("snubbers", "springs_to_ground", "springs_between")
        yield from _guarded(_unique((("chain", name), getattr(chain, name)) for name in lists))
    yield from _guarded(_unique([(("snubbers",), scenario.snubbers)]))
    yield from _guarded(_unique([(("probes",), scenario.probes)]))


def _unique(lists: Iterable[tuple[Path, Sequence[Named | Probe]]]) -> Found:
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


def _run(scenario: Scenario) -> Found:
    run = scenario.run
    if run is None:
        return
    yield from _guarded(_sampling(scenario, run))
    yield from _guarded(_spectrum(scenario, run))


def _sampling(scenario: Scenario, run: Run) -> Found:
    rate = run.sample_rate
    if rate is None:
        return
    at = ("run", "sample_rate")
    if rate * run.duration < 1.0:
        yield _problem(
            at,
            f"= {rate:g} Hz gives no second sample in run.duration = {run.duration:g} s",
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


def _spectrum(scenario: Scenario, run: Run) -> Found:
    spectrum = run.spectrum
    if spectrum.last is not None and spectrum.last > run.duration * (1.0 + 1e-12):
        yield _problem(
            ("run", "spectrum", "last"),
            f"= {spectrum.last:g} s is longer than run.duration = {run.duration:g} s",
            "analyse a shorter part, or use a longer run",
        )
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


def _start(scenario: Scenario) -> Found:
    start = None if scenario.run is None else scenario.run.start
    if isinstance(start, ModeStart) and scenario.chain is not None and start.mode > scenario.chain.count:
        count = scenario.chain.count
        yield _problem(
            ("run", "start", "mode"),
            f"= {start.mode}, but a chain of {count} masses has {count} modes",
            f"choose a mode from 1 to {count}",
        )
    if not isinstance(start, PolynomialStart):
        return
    for name in ("displacement", "velocity"):
        values: tuple[float, ...] = getattr(start, name)
        at = ("run", "start", name)
        if scenario.chain is not None:
            yield from _guarded(_one_a_mass(at, values, scenario.chain.count))
        elif scenario.beam is not None:
            yield from _guarded(_fits_supports(at, values, scenario.beam))


def _one_a_mass(at: Path, values: tuple[float, ...], count: int) -> Found:
    if values and len(values) != count:
        given = f"{len(values)} {'number' if len(values) == 1 else 'numbers'}"
        yield _problem(at, f"has {given} for {count} masses", "give one number per mass, or leave it out")


def _fits_supports(at: Path, polynomial: tuple[float, ...], beam: Beam) -> Found:
    """Reject a shape with a deflection or slope that the supports prevent."""
    for end, support, x in (("left", beam.supports.left, 0.0), ("right", beam.supports.right, beam.length)):
        for what, order, held in (
            ("deflection", 0, support in ("clamped", "pinned")),
            ("slope", 1, support in ("clamped", "guided")),
        ):
            terms = [c * (j if order else 1) * x ** (j - order) for j, c in enumerate(polynomial) if j >= order]
            scale = sum(
                abs(c) * (j if order else 1) * beam.length ** (j - order) for j, c in enumerate(polynomial) if j
            )
            scale += 0.0 if order or not polynomial else abs(polynomial[0])
            if held and abs(sum(terms)) > 1e-9 * scale:
                of = what if at[-1] == "displacement" else f"{what} velocity"
                yield _problem(
                    at,
                    f"= [{', '.join(f'{c:g}' for c in polynomial)}] has the {of} {sum(terms):g} "
                    f"at the {support} {end} end, where it must be 0",
                    "choose a polynomial in x that the supports allow (coefficients of 1, x, x^2, ...)",
                )


def _sweep(scenario: Scenario) -> Found:
    sweep, excitation = scenario.sweep, scenario.excitation
    if sweep is None:
        return
    if not isinstance(excitation, Harmonic):
        yield _problem(
            ("sweep",),
            f"sweeps the frequency of a harmonic excitation, but this one is {excitation.kind}",
            "give excitation: {kind: harmonic, applied_to: base, level: 2 g, frequency: 65 Hz}",
        )
        return
    for index, level in enumerate(sweep.levels):
        meant = level.quantity if isinstance(level, LevelValue) else None
        if meant not in (None, excitation.quantity):
            yield _problem(
                ("sweep", "levels", index),
                f"is given in a unit of {meant}, and the excitation's level is of {excitation.quantity}",
                "give the levels of the sweep in the unit of excitation.level",
            )
    if isinstance(sweep, Continuation):
        yield from continuation_problems(scenario, sweep)
    if isinstance(sweep, SweptSine):
        for name, points in (("profile", sweep.profile), ("notches", sweep.notches)):
            for index, point in enumerate(points):
                if point.quantity is not None and (point.quantity == "force") is excitation.on_base:
                    yield _problem(
                        ("sweep", name, index, "level"),
                        f"is a level of {point.quantity}, and the excitation is of {excitation.quantity}",
                        "give it in a unit that fits excitation.applied_to",
                    )


def _identification(scenario: Scenario) -> Found:
    section = scenario.identify_stiffness
    if section is None:
        return
    names = [snubber.name for snubber in scenario.all_snubbers]
    if section.snubber not in names:
        at, close = ("identify_stiffness", "snubber"), get_close_matches(section.snubber, names, n=1)
        known = f"did you mean {close[0]}?" if close else f"the snubbers are {', '.join(names)}"
        yield _problem(
            at, f"= {section.snubber} is not the name of a snubber", known if names else "give the snubber in snubbers"
        )
    yield from identification_problems(scenario, section)


def _modes(scenario: Scenario) -> Found:
    if scenario.chain is None or scenario.nnm is None:
        return
    if scenario.nnm.mode > scenario.chain.count:
        count = scenario.chain.count
        yield _problem(
            ("nnm", "mode"),
            f"= {scenario.nnm.mode}, but a chain of {count} masses has {count} modes",
            f"choose a mode from 1 to {count}",
        )
    if isinstance(scenario.nnm.continue_in, StiffnessFactorContinuation):
        yield from _guarded(_factor(scenario.chain, scenario.nnm.continue_in))


def _factor(chain: Chain, going: StiffnessFactorContinuation) -> Found:
    """The factor multiplies changes of slope; no slope of a softening spring may become negative."""
    key, largest = max(("from", going.from_), ("to", going.to), key=lambda end: end[1])
    for name in ("springs_to_ground", "springs_between"):
        for index, spring in enumerate(getattr(chain, name)):
            if not isinstance(spring, PiecewiseLinearSpring):
                continue
            slope = spring.slope_at_rest
            least = slope + largest * (min(spring.stiffnesses) - slope)
            if least < 0:
                yield _problem(
                    ("nnm", "continue_in", key),
                    f"= {largest:g} gives chain.{name}[{index}] the slope {least:g} N/m: the factor multiplies its "
                    f"changes of slope from the {slope:g} N/m at rest",
                    f"go up to {slope / (slope - min(spring.stiffnesses)):.6g} at most",
                )


def _designs(scenario: Scenario) -> Found:
    if scenario.vary is not None:
        yield from design_problems(scenario, scenario.vary)


def _limits(scenario: Scenario) -> Found:
    if scenario.limits is not None:
        yield from limit_problems(scenario, scenario.limits)
