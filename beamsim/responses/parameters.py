r"""The parameter of a response: from a scenario to a continuation problem, and from its unknown to SI numbers.

A parameter of one snubber moves the contacts, with exact derivatives. The dashpot of a damping ratio follows,
:math:`c = 2 \xi k / \Omega`, with :math:`\Omega` the first natural frequency with the snubber closed. From its mode v,
:math:`\partial\Omega^2/\partial k = (\phi^T v)^2` and
:math:`\partial\Omega^2/\partial x = 2 k\, (\phi^T v)(\phi'^T v)`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.errors import ScenarioError, locating
from beamsim.flow.periodic_flow import ContactDirection, PeriodicFlow, PeriodicForcing
from beamsim.orbits.harmonic_balance import ForcedBalance
from beamsim.orbits.shooting import ForcedOrbits
from beamsim.outcomes import Outcome
from beamsim.responses.loads import periodic_flow, periodic_forcing
from beamsim.scenario import Scenario
from beamsim.scenario.base import Path
from beamsim.scenario.excitation import Forces, Harmonic
from beamsim.scenario.sweep import Continuation, HarmonicBalance, SnubberPath
from beamsim.structures.assembly import snubber_site
from beamsim.structures.places import Place
from beamsim.system.build import SystemFamily, build_family
from beamsim.system.structural import StructuralSystem
from beamsim.typing import not_none, of_kind


@dataclass(frozen=True)
class FollowedParameter:
    """A parameter, its range, and the unknown of the continuation that represents it.

    The continuation's unknown is the angular frequency, the level, or for a snubber's number a coordinate that runs
    from 1 to 2, so that steps relative to it fit whatever the number is (a gap of zero included).
    """

    kind: str  # frequency, level, gap, stiffness or position
    first: float  # SI, frequencies in Hz
    last: float
    unit: str
    points_at: tuple[float, ...] = ()  # SI, values at which every branch gets a point
    snubber: str = ""
    moved_snubber: VariedSnubber | None = None

    def to_unknown(self, value: float) -> float:
        """The continuation's unknown at a value."""
        if self.kind == "frequency":
            return 2 * np.pi * value
        return value if self.kind == "level" else 1.0 + (value - self.first) / (self.last - self.first)

    def from_unknown(self, unknown: Any) -> Any:
        """The value at one unknown or many."""
        if self.kind == "frequency":
            return unknown / (2 * np.pi)
        return unknown if self.kind == "level" else self.first + (unknown - 1.0) * (self.last - self.first)

    def in_user_unit(self, outcome: Outcome) -> Outcome:
        """An outcome with its parameter in the user's unit."""
        return outcome.in_unit(self.from_unknown, self.unit)

    def system(self, reference: StructuralSystem, unknown: float) -> StructuralSystem:
        """The system at a value of the continuation's unknown; frequency and level do not change it."""
        return reference if self.moved_snubber is None else self.moved_snubber.system(self.from_unknown(unknown))

    @property
    def label(self) -> str:
        """Name of the parameter, and of its snubber."""
        what = "excitation frequency" if self.kind == "frequency" else self.kind
        return f"{what} {self.snubber}".strip()

    def path(self, flow: PeriodicFlow) -> Callable[[float], tuple[PeriodicFlow, ContactDirection]]:
        """A function that gives the flow at a value of the unknown, and the derivatives of its contacts."""

        def at(unknown: float) -> tuple[PeriodicFlow, ContactDirection]:
            contacts, rates = not_none(self.moved_snubber)(self.from_unknown(unknown))
            step = self.last - self.first
            by_unknown = ContactDirection(
                step * rates.stiffness, step * rates.dashpot, step * rates.gap, step * rates.shape,
                step * rates.base_participation,
            )  # fmt: skip
            return flow.with_contacts(contacts), by_unknown

        return at


@dataclass(frozen=True)
class ResponseModel:
    """Model of a scenario's continuation: system, loads and parameter."""

    scenario: Scenario
    system: StructuralSystem
    loads: PeriodicForcing
    followed: FollowedParameter
    second: FollowedParameter | None  # second parameter of curves of special points
    frequency_hz: float  # of the excitation, if it is constant
    levels: tuple[float, ...]

    @property
    def settings(self) -> Continuation:
        """The section ``sweep`` of the scenario."""
        return of_kind(Continuation, self.scenario.sweep)

    def problem(self, level: float) -> ForcedOrbits | ForcedBalance:
        """The continuation problem of one level, by the method of the scenario.

        Raises
        ------
        ScenarioError : where the snubbers' law is beyond harmonic balance, or does not go with cubic springs.
        """
        f, settings = self.followed, self.settings
        hz = f.first if f.kind == "frequency" else self.frequency_hz
        parameter: Literal["frequency", "level"] = "frequency" if f.kind == "frequency" else "level"
        if isinstance(settings.method, HarmonicBalance):
            with locating({"contacts": "snubbers", "harmonics": "sweep.method.harmonics"}):
                return ForcedBalance(
                    self.system.dynamics, self.loads, settings.method.harmonics, parameter, 2 * np.pi * hz, level,
                    cubic=self.system.cubic,
                )  # fmt: skip
        try:
            flow = periodic_flow(self.system, self.loads, 2 * np.pi * hz, f.first if f.kind == "level" else level)
        except ValueError as error:
            raise ScenarioError.at(
                "chain.snubbers", f"cannot be followed: {error}", "use method: harmonic_balance"
            ) from error
        return ForcedOrbits(flow, parameter if f.moved_snubber is None else f.path(flow))


def response_model(scenario: Scenario) -> ResponseModel:
    """Build the model of a scenario's continuation.

    Raises
    ------
    ScenarioError
        Where the scenario has no continuation or no harmonic excitation, or cannot be built.
    """
    settings, excitation = scenario.sweep, scenario.excitation
    if not isinstance(settings, Continuation):
        raise ScenarioError.at(
            "sweep.kind", "is not continuation", "write `sweep: {kind: continuation, from: …, to: …}`"
        )
    if not isinstance(excitation, Harmonic | Forces):
        raise ScenarioError.at("excitation.kind", "has no frequency to follow", "use a harmonic excitation")
    levels = settings.levels or (excitation.level,)
    for at, level in [(f"sweep.levels[{k}]", x) for k, x in enumerate(settings.levels)] or [
        ("excitation.level", excitation.level)
    ]:
        if settings.parameter.kind != "level" and level == 0:
            raise scenario.located(ScenarioError.at(at, "= 0 excites nothing", "give a positive level"))
    parameter: Any = settings.parameter.in_metres(scenario)
    second: Any = None if settings.follow_points_in is None else settings.follow_points_in.in_metres(scenario)
    highest = excitation.frequency
    if parameter.kind == "frequency":
        highest = max(parameter.from_, parameter.to)
    level = excitation.level if excitation.level else 1.0
    forced = scenario.model_copy(update={"run": None, "excitation": excitation.at(highest, level)})
    moving = [p for p in (parameter, second) if p is not None and p.kind == "position"]
    ends = None
    if moving:
        values = [x for p in moving for x in (p.from_, p.to)]
        site = of_kind(Place, snubber_site(not_none(moving[0].changed(scenario))))
        ends = replace(site, point=min(values)), replace(site, point=max(values))
    family = build_family(forced, ends)
    system = family.system
    loads = periodic_forcing(forced, system)
    return ResponseModel(
        scenario,
        system,
        loads,
        _parameter_of(scenario, family, "sweep.continue_in", parameter),
        None if second is None else _parameter_of(scenario, family, "sweep.follow_points_in", second),
        excitation.frequency,
        tuple(float(x) for x in levels),
    )


def _parameter_of(scenario: Scenario, family: SystemFamily, at: str, path: Any) -> FollowedParameter:
    first, last, unit = float(path.from_), float(path.to), path.unit
    points_at = tuple(map(float, path.points_at))
    if not isinstance(path, SnubberPath):
        return FollowedParameter(path.kind, first, last, unit or scenario.level_unit or "1", points_at)
    located, system = not_none(path.changed(scenario)), family.system
    snubber: Any = located.item
    contacts = [i for i, stop in enumerate(scenario.located_snubbers) if stop.path == located.path]
    damping = snubber.damping
    ratio = damping.ratio if damping is not None and damping.kind == "ratio" else None
    kind = path.kind
    if kind == "stiffness" and ratio and system.cubic is not None:
        raise scenario.located(
            ScenarioError.at(
                "chain.snubbers",
                "have a damping ratio, whose dashpot changes with the stiffness that is followed",
                "with cubic springs give the dashpot itself: damping: {kind: viscous, coefficient: …}",
            )
        )
    if system.dynamics.contacts.laws[contacts[0]].rebuild is None and (
        kind == "stiffness" or (kind == "position" and ratio)
    ):
        raise scenario.located(
            ScenarioError.at(
                f"{at}.kind",
                f"= {kind} changes the stiffness or dashpot of {snubber.name}, whose contact law is "
                "not made of these two alone",
                "continue in the gap, the level or the frequency",
            )
        )
    place = snubber.place_paths[0] if kind == "position" else ()
    moved = VariedSnubber(family, (*located.path, *place, kind), tuple(contacts), kind, ratio)
    return FollowedParameter(kind, first, last, unit, points_at, snubber.name, moved)


@dataclass(frozen=True)
class VariedSnubber:
    """A snubber, or a pair of stops, with another gap, stiffness or position.

    Parameters
    ----------
    family : the systems, in coordinates common to all values.
    path : of the number in the scenario.
    contacts : numbers of its contacts: one, or the two of a pair.
    quantity : "gap" (m), "stiffness" (N/m) or "position" (m).
    damping_ratio : of the snubber's dashpot; None if the dashpot is given by its coefficient, or there is none.
    """

    family: SystemFamily
    path: Path
    contacts: tuple[int, ...]
    quantity: str
    damping_ratio: float | None = None

    def system(self, value: float) -> StructuralSystem:
        """The system of the scenario with this value, probes, outputs and stresses included."""
        return self.family.at(self.path, value)

    def __call__(self, value: float) -> tuple[Contacts, ContactDirection]:
        """The contacts at a value of the parameter, and their derivatives by it.

        Raises
        ------
        ArithmeticError : at a stiffness that is not positive.
        """
        if self.quantity == "stiffness" and value <= 0:
            raise ArithmeticError("the stiffness became negative")
        contacts = self.family.contacts_at(self.path, value)
        rates = ContactDirection.of(contacts)
        for i in self.contacts:
            self._differentiate(contacts, rates, i, value)
        return contacts, rates

    def _differentiate(self, contacts: Contacts, rates: ContactDirection, i: int, value: float) -> None:
        """Write the derivatives of one contact at a value of the parameter."""
        if self.quantity == "gap":
            rates.gap[i] = 1.0
        elif self.quantity == "stiffness":
            rates.stiffness[i] = 1.0
        else:
            site = of_kind(Place, self.family.model.snubber_sites[i])
            rates.shape[i], rates.base_participation[i] = self.family.rates_along(replace(site, point=value))
        law = contacts.laws[i]
        if self.damping_ratio is not None and self.quantity != "gap" and law.dashpot:
            omega_squared, k, phi = self.family.system.dynamics.stiffness, law.stiffness, contacts.shape[i]
            square = (2 * self.damping_ratio * k / law.dashpot) ** 2
            values, vectors = np.linalg.eigh(np.diag(omega_squared) + k * np.outer(phi, phi))
            v = vectors[:, int(np.argmin(np.abs(values - square)))]
            moved = float(phi @ v)
            slope = moved**2 * rates.stiffness[i] + 2 * k * moved * float(rates.shape[i] @ v)
            rates.dashpot[i] = law.dashpot * (rates.stiffness[i] / k - 0.5 * slope / square)
