"""Varied parameters: lists, ranges and tolerances of any numbers of a scenario, as a grid, zipped or sampled."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from beamsim.scenario.base import BY_FORM, Schema, Variants, fail
from beamsim.scenario.quantities import NotNegativeWhole, NumberOrText, Quantile, SteppedCount, Text

AnyValue = Annotated[float | str, NumberOrText(words=True)]
Spacing = Literal["linear", "logarithmic"]


class _Parameter(Schema):
    """What all varied parameters share."""

    path: Text
    """Path of the number or choice, for example beam.thickness, snubbers.tip.gap or beam.point_masses[*].mass."""
    also: tuple[Text, ...] = ()
    """Other paths that take the same value, such as a probe that moves with a snubber."""


class ListedParameter(_Parameter):
    """A list of values."""

    known_by: ClassVar[tuple[str, ...]] = ("values",)

    values: Annotated[tuple[AnyValue, ...], Field(min_length=1)]
    """The values, with or without unit; or choices, such as supports."""


class _Ranged(_Parameter):
    """A parameter with a range."""

    known_by: ClassVar[tuple[str, ...]] = ("from",)

    from_: AnyValue = Field(alias="from")
    """First value."""
    to: AnyValue
    """Last value."""
    spacing: Spacing = "linear"
    """Whether the values or their logarithms are evenly spaced, or sampled uniformly."""


class _Toleranced(_Parameter):
    """A parameter with a tolerance about its value in the scenario."""

    known_by: ClassVar[tuple[str, ...]] = ("tolerance",)

    tolerance: AnyValue
    """Deviation to either side: in percent of the scenario's value, or in the quantity's own unit."""


class RangedParameter(_Ranged):
    """Evenly spaced values of a range."""

    points: SteppedCount
    """Number of values."""


class TolerancedParameter(_Toleranced):
    """The value in the scenario and its tolerance."""

    points: SteppedCount = 3
    """Number of values from the lowest to the highest."""


class SampledRange(_Ranged):
    """Any value of a range."""


class SampledTolerance(_Toleranced):
    """Any value within the tolerance about the value in the scenario."""

    distribution: Literal["uniform", "normal"] = "uniform"
    """Uniform within the tolerance; or normal, truncated at the tolerance of three standard deviations."""


AnyParameter = Annotated[
    ListedParameter | TolerancedParameter | RangedParameter,
    Variants(
        "names no values",
        "give path with values: [...], with from, to and points, or with a tolerance",
    ),
]
SampledParameter = Annotated[
    SampledTolerance | SampledRange,
    Variants("names no range to sample", "give path with from and to, or with a tolerance"),
]


class _Study(Schema):
    """What all kinds of studies share."""

    responses: tuple[Text, ...] = ()
    """Responses that are computed, such as peak_force; all by default, of which the bending stress takes longest."""
    minimise: Text = ""
    """Response that is smallest in the best case that meets every limit: a quantity such as peak_force, which counts
    where it is largest, or a response by name, such as snubbers/tip/peak_force. Without it the best case is the one
    with the largest margin."""
    maximise: Text = ""
    """Response that is largest in the best case; see minimise."""

    def check(self) -> None:
        """Refuse two objectives."""
        if self.minimise and self.maximise:
            raise fail("stands beside minimise", "name one objective, minimise or maximise", ("maximise",))


class Tolerances(Schema):
    """What manufacture leaves open: every case is solved as it is, and again for each of a sample of deviations."""

    samples: SteppedCount = 20
    """Number of deviations, a Latin-hypercube sample; it is the same for all cases."""
    seed: NotNegativeWhole = 0
    """Seed of the random generator."""
    quantile: Quantile = 1.0
    """Limits and the objective judge a case by this quantile of its values, counted from the good side; by default by
    the worst of them."""
    parameters: Annotated[tuple[SampledTolerance, ...], Field(min_length=1)]
    """The numbers with a tolerance. That of a varied number is about its value in each case."""

    def check(self) -> None:
        """Refuse a quantile beyond what the realisations, the nominal one among them, can tell from the worst."""
        if self.quantile < 1.0 and math.ceil(self.quantile * self.samples) >= self.samples:
            enough = math.ceil(round(1.0 / (1.0 - self.quantile), 6))
            raise fail(
                f"= {100 * self.quantile:.10g} % of {self.samples + 1} realisations is the worst of them",
                f"give samples: {enough} or more, or leave quantile out", ("quantile",),
            )  # fmt: skip


class _ToleratedStudy(_Study):
    """What the kinds of studies share that choose among cases."""

    tolerances: Tolerances | None = None
    """Deviations of each case, by which it is judged."""


class Grid(_ToleratedStudy):
    """Every combination of the parameters' values."""

    kind: Literal["grid"] = "grid"
    """Every combination."""
    parameters: Annotated[tuple[AnyParameter, ...], Field(min_length=1)]
    """The varied parameters."""


class Zipped(_ToleratedStudy):
    """All first values together, all second values together, and so on."""

    kind: Literal["zip"] = "zip"
    """Values paired by position."""
    parameters: Annotated[tuple[AnyParameter, ...], Field(min_length=1)]
    """The varied parameters; all need the same number of values."""


class LatinHypercube(_ToleratedStudy):
    """A Latin-hypercube sample: one value of every parameter in each of `samples` equally likely intervals."""

    kind: Literal["latin_hypercube"] = "latin_hypercube"
    """A Latin-hypercube sample."""
    samples: SteppedCount
    """Number of cases."""
    seed: NotNegativeWhole = 0
    """Seed of the random generator."""
    parameters: Annotated[tuple[SampledParameter, ...], Field(min_length=1)]
    """The varied parameters."""


class Sobol(_Study):
    """A sample for Sobol' indices: which parameter accounts for which share of a response's variance."""

    kind: Literal["sobol"] = "sobol"
    """A sample for Sobol' indices."""
    samples: SteppedCount
    """Size n of the sample, a power of two; there are n times the number of parameters plus two cases."""
    seed: NotNegativeWhole = 0
    """Seed of the random generator."""
    parameters: Annotated[tuple[SampledParameter, ...], Field(min_length=1)]
    """The varied parameters, which are independent of each other."""


Vary = Annotated[Grid | Zipped | LatinHypercube | Sobol, BY_FORM]
