"""What the identification hands back: frozen dataclasses with shapes and units, ready to store or draw."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from beamsim.analyses.result import Result
from beamsim.outcomes import COMPLETE, Outcome
from beamsim.typing import Complexes, Floats, Ints

if TYPE_CHECKING:
    from beamsim.scenario import Scenario


@dataclass(frozen=True)
class FrequencyTable:
    """Measured and predicted natural frequencies, as in tables 1.2 and 1.3 of the thesis."""

    mode: Ints  # (m,) numbers, from 1
    measured_hz: Floats  # (m,) nan where only the prediction is known
    predicted_hz: Floats  # (m,)

    @property
    def difference_percent(self) -> Floats:
        """(m,) 100 (predicted - measured) / measured."""
        return 100 * (self.predicted_hz - self.measured_hz) / self.measured_hz


@dataclass(frozen=True)
class StiffnessEstimate:
    """A snubber's stiffness with its uncertainty."""

    snubber: str
    method: str  # "secular" or "thesis"
    stiffness: float  # N/m
    fit_to: tuple[int, ...]  # numbers of the modes used
    individual: Floats  # (len(fit_to),) N/m, from each of these modes alone (nan where it is out of reach)
    reach_hz: Floats  # (len(fit_to), 2) Hz, what any stiffness can reach
    condition: Floats  # (len(fit_to),) k df/dk / f of each of these modes: relative change in f for one in k
    residual: float  # root mean square of (predicted - measured) / measured over the modes used
    standard_deviation: float  # N/m, first order; nan where no uncertainty is known
    interval_first_order: tuple[float, float]  # N/m, symmetric
    interval: tuple[float, float]  # N/m, one mode: the frequency's interval carried over; several: profile likelihood
    monte_carlo_standard_deviation: float  # N/m
    monte_carlo_interval: tuple[float, float]  # N/m
    monte_carlo_samples: int
    monte_carlo_unreachable: float  # share of samples that no stiffness explains
    coverage: float  # probability of the intervals
    total_standard_deviation: float  # N/m, with the uncertainty of the structure's parameters
    uncertainty_from: str  # "given", "scatter" of the modes, or "" (unknown)
    eigenvalue_solutions: int
    outcome: Outcome = COMPLETE  # or why it did not converge


@dataclass(frozen=True)
class Sensitivity:
    """How the identified stiffness depends on one number of the structure."""

    parameter: str
    value: float  # SI
    relative: float  # d ln k / d ln p: percent of k for a percent of p
    uncertainty: float  # relative standard deviation of p (nan where not given)

    @property
    def contribution(self) -> float:
        """Relative standard deviation of k that comes from this parameter (nan where unknown)."""
        return abs(self.relative) * self.uncertainty


@dataclass(frozen=True)
class ParameterEstimate:
    """A number found by a fit."""

    parameter: str
    before: float  # the scenario's value, SI (of the first item for [*])
    value: float  # SI
    standard_deviation: float  # SI; nan where it cannot be told
    interval: tuple[float, float]  # SI
    bounds: tuple[float, float]  # SI
    prior: float  # relative standard deviation; nan without
    at_bound: bool


@dataclass(frozen=True)
class Profile:
    """Profile likelihood of one parameter: misfit with all other parameters fitted again."""

    parameter: str
    value: Floats  # (p,) SI
    misfit: Floats  # (p,) chi^2 above its minimum


@dataclass(frozen=True)
class ModelUpdate:
    """The beam's own parameters, from frequencies measured without the snubber."""

    parameters: tuple[ParameterEstimate, ...]
    choices: dict[str, str]  # supports that were chosen, by path
    alternatives: tuple[tuple[str, float], ...]  # every combination of supports tried, with its misfit
    correlation: Floats  # (p, p)
    before: FrequencyTable
    after: FrequencyTable
    misfit_before: float  # chi^2, priors included
    misfit_after: float
    profiles: tuple[Profile, ...]
    evaluations: int  # eigenvalue solutions
    warnings: tuple[str, ...]
    scenario: Scenario  # with the parameters found


@dataclass(frozen=True)
class FrequencyCurve:
    """A natural frequency against the stiffness of the spring, for the plot."""

    mode: int
    stiffness: Floats  # (p,) N/m, increasing
    frequency_hz: Floats  # (p,)


@dataclass(frozen=True)
class TestFit:
    """One nonlinear test: measured and predicted harmonics."""

    __test__ = False  # not a test case, whatever its name

    name: str
    probe: str
    quantity: str
    unit: str
    frequency_hz: float  # of the excitation
    order: Floats  # (h,) harmonic numbers
    measured: Complexes  # (h,) amplitude e^{i phase} of A sin(2 pi f n t + phase), clock of the measurement
    noise: Floats  # (h,) standard deviation of real and imaginary part
    before: Complexes  # (h,) predicted with the scenario's values
    predicted: Complexes  # (h,) with the estimated values
    delay_s: float  # measured(t) = predicted(t + delay)


@dataclass(frozen=True)
class NonlinearEstimate:
    """Parameters from nonlinear tests."""

    parameters: tuple[ParameterEstimate, ...]
    correlation: Floats  # (p, p)
    tests: tuple[TestFit, ...]
    misfit_before: float  # chi^2
    misfit: float  # chi^2
    degrees_of_freedom: int
    starts: int
    starts_agreeing: int  # that ended in the best minimum
    profiles: tuple[Profile, ...]
    responses: int  # periodic responses computed
    processor_time_s: float
    coverage: float
    warnings: tuple[str, ...]
    outcome: Outcome = COMPLETE


@dataclass(frozen=True)
class IdentificationResult(Result):
    """Everything `beamsim identify-stiffness` computes."""

    estimate: StiffnessEstimate | None
    with_snubber: FrequencyTable | None
    without_snubber: FrequencyTable
    sensitivities: tuple[Sensitivity, ...]
    curves: tuple[FrequencyCurve, ...]
    profile: Profile | None  # of the stiffness
    update: ModelUpdate | None
    mac: Floats | None  # (measured, predicted) modal assurance criterion
    nonlinear: NonlinearEstimate | None
    pad_modulus: float  # Pa; nan without pad
    processor_time_s: float = 0.0
