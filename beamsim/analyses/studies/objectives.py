"""Objectives of a study: responses or sums of them to minimise or maximise, and the values that judge a case."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from beamsim.analyses.studies.responses import describe, matches_request
from beamsim.errors import ScenarioError
from beamsim.scenario import Scenario
from beamsim.scenario.units import Dimension, UnitError, read_quantity
from beamsim.typing import Floats, Ints


class Objective(NamedTuple):
    """Objective by which cases are compared."""

    # quantities (at their worst place) or names of responses, with the value that counts as one when they are added;
    # empty: the smallest margin
    terms: tuple[tuple[str, float], ...] = ()
    maximised: bool = True  # True if large values are better

    @property
    def sign(self) -> float:
        """1 or -1: factor that makes smaller values better."""
        return -1.0 if self.maximised else 1.0

    @property
    def text(self) -> str:
        """Description, such as "smallest peak force"."""
        return f"{'largest' if self.maximised else 'smallest'} {self.label}"

    @property
    def label(self) -> str:
        """Label of the value to minimise or maximise."""
        return " + ".join(name.replace("/", " ").replace("_", " ") for name, _ in self.terms) or "margin"

    @property
    def name(self) -> str:
        """Name of its values in a result."""
        return self.label.replace(" ", "_")

    def of(self, responses: Mapping[str, Floats]) -> Floats | None:
        """Compute its values; None if it has no terms, or a term matches no response.

        Parameters
        ----------
        responses : responses by name, all of one shape; nan if unknown.

        Returns
        -------
        Array of that shape
        """
        total: Floats | None = None
        for name, one in self.terms:
            asked = [values for response, values in responses.items() if matches_request(name, response)]
            if not asked:
                return None
            term = worst_of(asked, large_is_good=self.maximised) / one
            total = term if total is None else total + term
        return total

    def unit(self, responses: Iterable[str], output_units: Mapping[str, str]) -> str:
        """Unit of its values; ``output_units`` are the units of the scenario's outputs by name."""
        if len(self.terms) != 1:
            return "1"
        return describe(next(name for name in responses if matches_request(self.terms[0][0], name)), output_units)[0]


def objectives(scenario: Scenario) -> tuple[Objective, ...]:
    """Objectives of a study, one or two; by default maximise the smallest margin of a case.

    Raises
    ------
    ScenarioError
        If the value that counts as one has the wrong dimension.
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
    """Worst of the known values of several arrays of one shape; nan if none is known."""
    values = np.stack(columns)
    badness = np.where(np.isnan(values), -np.inf, -values if large_is_good else values)
    return np.asarray(np.take_along_axis(values, badness.argmax(axis=0)[None], axis=0)[0])


def deciding_realisations(values: Floats, quantile: float, *, large_is_good: bool) -> Ints:
    """Realisation of each case by which it is judged.

    Parameters
    ----------
    values : (cases, realisations)
    quantile : quantile of the values, counted from the good side; 1 is the worst.
    large_is_good : True if large values are good.

    Returns
    -------
    (cases,) array
        The one at the quantile, or the first unknown one.
    """
    badness = -values if large_is_good else values
    order = np.argsort(badness, axis=1, kind="stable")  # nan comes last
    unknown = np.isnan(badness)
    place = math.ceil(quantile * (values.shape[1] - 1))
    return np.where(unknown.any(axis=1), unknown.argmax(axis=1), order[:, place])


def deciding_values(values: Floats, quantile: float, *, large_is_good: bool) -> Floats:
    """(cases,) values of the realisations by which cases are judged, see `deciding_realisations`."""
    return of_realisation(values, deciding_realisations(values, quantile, large_is_good=large_is_good))


def of_realisation(column: Floats, realisation: Ints) -> Floats:
    """(cases,) values of a column (cases, realisations) at the given realisation of each case."""
    return np.asarray(column[np.arange(realisation.size), realisation])
