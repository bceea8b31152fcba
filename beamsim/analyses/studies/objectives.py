"""What a study asks for: responses, or sums of them, that shall be small or large; and what judges a case."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from beamsim.analyses.studies.responses import describe, means
from beamsim.errors import ScenarioError
from beamsim.scenario import Scenario
from beamsim.scenario.units import Dimension, UnitError, read_quantity
from beamsim.typing import Floats, Ints


class Objective(NamedTuple):
    """An objective: the value by which cases are compared."""

    # quantities, whose worst place counts, or names of responses, by value that counts as one where they are added up;
    # none: the smallest margin
    terms: tuple[tuple[str, float], ...] = ()
    largest: bool = True  # whether large values are better

    @property
    def sign(self) -> float:
        """Factor of a value, 1 or -1, so that smaller is better."""
        return -1.0 if self.largest else 1.0

    @property
    def text(self) -> str:
        """For people."""
        return f"{'largest' if self.largest else 'smallest'} {self.label}"

    @property
    def label(self) -> str:
        """Label of the value that is to be large or small."""
        return " + ".join(name.replace("/", " ").replace("_", " ") for name, _ in self.terms) or "margin"

    @property
    def name(self) -> str:
        """Name of its values in a result."""
        return self.label.replace(" ", "_")

    def of(self, responses: Mapping[str, Floats]) -> Floats | None:
        """Its values; None where it has no terms, or one of them means no response.

        Parameters
        ----------
        responses : by name, of one shape; nan where not known.

        Returns
        -------
        Array of that shape
        """
        total: Floats | None = None
        for name, one in self.terms:
            asked = [values for response, values in responses.items() if means(name, response)]
            if not asked:
                return None
            term = worst_of(asked, large_is_good=self.largest) / one
            total = term if total is None else total + term
        return total

    def unit(self, responses: Iterable[str], output_units: Mapping[str, str]) -> str:
        """Unit of its values; ``output_units`` by name of the scenario's outputs."""
        if len(self.terms) != 1:
            return "1"
        return describe(next(name for name in responses if means(self.terms[0][0], name)), output_units)[0]


def objectives(scenario: Scenario) -> tuple[Objective, ...]:
    """Objectives of a study, one or two; by default the smallest margin of a case, which shall be large.

    Raises
    ------
    ScenarioError
        If a value that counts as one is none of its response.
    """
    units, found = scenario.output_units, list[Objective]()
    for goal in ("minimise", "maximise"):
        aim = getattr(scenario.study, goal, "")
        each = [{aim: None}] if isinstance(aim, str) else [aim] if isinstance(aim, dict) else [{a: None} for a in aim]
        for terms in (terms for terms in each if terms != {"": None}):
            ones = []
            for name, one in terms.items():
                unit = describe(name, units)[0].removeprefix("1")
                dimension = Dimension(name.replace("_", " "), unit, f"1 {unit}".rstrip(), gravity=unit == "m/s^2")
                try:
                    ones.append((name, 1.0 if one is None else read_quantity(one, dimension)))
                    if not ones[-1][1] > 0.0:
                        raise UnitError("must be positive", "give the value that counts as one")
                except UnitError as error:
                    at = f"optimise.{goal}.{name}"
                    raise scenario.located(ScenarioError.at(at, f"= {one} {error.message}", error.remedy)) from None
            found.append(Objective(tuple(ones), goal == "maximise"))
    return tuple(found) or (Objective(),)


def worst_of(columns: Sequence[Floats], *, large_is_good: bool) -> Floats:
    """The worst of the known values of several arrays of one shape; nan where none is known."""
    values = np.stack(columns)
    badness = np.where(np.isnan(values), -np.inf, -values if large_is_good else values)
    return np.asarray(np.take_along_axis(values, badness.argmax(axis=0)[None], axis=0)[0])


def deciding_realisations(values: Floats, quantile: float, *, large_is_good: bool) -> Ints:
    """The realisation of each case by which it is judged.

    Parameters
    ----------
    values : (cases, realisations)
    quantile : of the values, from the good side; 1 is the worst.
    large_is_good : whether that is the side of large values.

    Returns
    -------
    (cases,) array
        That at the quantile, or the first one that is not known.
    """
    badness = -values if large_is_good else values
    order = np.argsort(badness, axis=1, kind="stable")  # nan comes last
    unknown = np.isnan(badness)
    place = math.ceil(quantile * (values.shape[1] - 1))
    return np.where(unknown.any(axis=1), unknown.argmax(axis=1), order[:, place])


def deciding_values(values: Floats, quantile: float, *, large_is_good: bool) -> Floats:
    """(cases,) values by which cases are judged, those of `deciding_realisations`."""
    return of_realisation(values, deciding_realisations(values, quantile, large_is_good=large_is_good))


def of_realisation(column: Floats, realisation: Ints) -> Floats:
    """(cases,) values of a column (cases, realisations) at one realisation of each case."""
    return np.asarray(column[np.arange(realisation.size), realisation])
