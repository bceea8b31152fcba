"""Identification of a snubber: measurements, and the parameters to identify."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from beamsim.scenario import quantities as q
from beamsim.scenario import units
from beamsim.scenario.base import (
    TWO_ITEMS,
    InvalidValueError,
    Path,
    Problems,
    Schema,
    ShortFor,
    Variants,
    Whole,
    count_text,
    demand_rising,
    kind_of,
    problem,
    unknown,
)
from beamsim.scenario.body import Ratios
from beamsim.scenario.connections import HingeStop
from beamsim.scenario.excitation import Excitation, FrequencyRange, Harmonic, level_problems, not_harmonic
from beamsim.scenario.files import DecimalMark, RecordPreparation
from beamsim.scenario.parameters import (
    choices_at,
    find_parameters,
    in_metres,
    listing_problems,
    read_as,
    side_at,
    value_at,
)
from beamsim.scenario.quantities import Rate
from beamsim.scenario.run import Start
from beamsim.scenario.sweep import no_stop_of_hinge

Probability = Annotated[float, q.Quantity(replace(units.RATIO, example="95 %"), above=0.0, below=1.0)]


Bound = Annotated[float | str, q.NumberOrText("60 GPa")]


DynamicPoint = tuple[q.Frequency, q.Stiffness, q.Ratio]
"""Frequency, storage stiffness and loss factor."""
RelaxationPoint = tuple[q.Time, q.Stiffness]
"""Time since the deflection was applied, and force over deflection."""


class PadData(Schema):
    """Measurements on a pad: exactly one of dynamic, relaxation and file."""

    dynamic: tuple[DynamicPoint, ...] | None = None
    """Frequency, storage stiffness and loss factor of each measurement: [[10 Hz, 120 kN/m, 0.08], ...]."""
    relaxation: tuple[RelaxationPoint, ...] | None = None
    """Time since the deflection was applied, and force over deflection: [[1 ms, 190 kN/m], ...]."""
    ramp: q.Duration | None = None
    """Time over which the deflection of a relaxation test rises linearly; by default it is sudden."""
    file: q.FileName | None = None
    """CSV file with either, relative to the scenario's folder; its headings contain units: frequency (Hz), storage
    (kN/m), loss factor, or time (s), stiffness (kN/m). If it has a modulus instead of a stiffness, give height and
    area."""
    columns: tuple[q.Text, ...] = ()
    """Headings of the columns to use, if several have the same dimension."""
    decimal: DecimalMark | None = None
    """Decimal mark in a text file, "." or ","; by default detected from the numbers."""
    branches: Annotated[int, q.WholeNumber(1, 8)] | None = None
    """Number of Maxwell branches; by default the smallest number that fits nearly as well as any larger one."""

    def check(self) -> None:
        """Require one kind of measurement, with points that determine the branches."""
        given = [key for key in ("dynamic", "relaxation", "file") if getattr(self, key) is not None]
        if len(given) != 1:
            message = f"has {' and '.join(given)}" if given else "needs one of dynamic, relaxation and file"
            raise InvalidValueError(
                message, "give for example dynamic: [[10 Hz, 120 kN/m, 0.08], [100 Hz, 150 kN/m, 0.11]]"
            )
        if self.ramp is not None and self.dynamic is not None:
            raise InvalidValueError("goes with a relaxation test", "leave ramp out", ("ramp",))
        if given != ["file"]:
            check_data(getattr(self, given[0]), given[0], self.branches)


def check_data(points: Any, kind: str, branches: int | None) -> None:
    """Refuse pad measurements that are too few or not in order.

    Parameters
    ----------
    points : rows of frequency, Hz, or time, s, with the measured values.
    kind : dynamic or relaxation, the key of the points.
    branches : number of Maxwell branches to fit; None to find it.

    Raises
    ------
    InvalidValueError
        If there are too few points for the branches, they are not in order, or they show no loss.
    """
    least = 2 if branches is None else branches + 1
    if len(points) < least:
        what = count_text(len(points), "measurement")
        raise InvalidValueError(f"has {what}", f"measure at {least} or more", (kind,))
    unit = "Hz" if kind == "dynamic" else "s"
    demand_rising((point[0] for point in points), unit, lambda k: (kind, k, 0), "list the measurements in their order")
    if kind == "dynamic" and all(point[2] == 0.0 for point in points):
        raise InvalidValueError("has no loss at all", "a pad without loss needs a stiffness alone", (kind,))


class Pad(Schema):
    """Rubber pad of the snubber: its size, for Young's modulus E = k height / area, and measurements on it."""

    height: q.Length | None = None
    """Height (in the direction of the force)."""
    area: q.Area | None = None
    """Loaded area."""
    data: PadData | None = None
    """Storage stiffness and loss factor over frequency, or relaxation; Maxwell branches are fitted to them."""

    def check(self) -> None:
        """Require the size, measurements, or both."""
        if (self.height is None) != (self.area is None):
            key = "height" if self.height is None else "area"
            raise InvalidValueError("is missing", "give both height and area", (key,))
        if self.height is None and self.data is None:
            raise InvalidValueError(
                "is missing", "give height and area of the pad, or measurements on it in data", ("height",)
            )


class MonteCarlo(Schema):
    """Monte Carlo samples around the measured frequencies, to check the first-order uncertainty."""

    samples: q.SteppedCount = 10_000
    """Number of samples."""
    seed: q.RandomSeed = 0
    """Seed of the random generator."""


class ParameterUncertainty(Schema):
    """Uncertainty of a structural parameter; its contribution to the uncertainty of the stiffness is reported."""

    parameter: q.Text
    """Path of the number, for example beam.thickness or beam.point_masses[*].mass."""
    uncertainty: q.Ratio
    """Standard deviation, relative to the value."""


class ParameterToIdentify(Schema):
    """A parameter to identify; may be abbreviated to its path."""

    parameter: q.Text
    """Path of the number, for example beam.youngs_modulus; [*] scales all items of a list by one factor."""
    bounds: Annotated[tuple[Bound, ...], TWO_ITEMS] = ()
    """Lowest and highest value, with or without unit."""
    prior: q.Ratio | None = None
    """Standard deviation of the prior, relative to the value in the scenario; no prior by default."""


IdentifiedParameter = Annotated[ParameterToIdentify, ShortFor("parameter")]


class MeasuredShapes(Schema):
    """Mode shapes measured without the snubber; the modal assurance criterion compares them with the model."""

    positions: Annotated[tuple[q.PositionOrShare, ...], Field(min_length=2)]
    """Positions of the measured deflections on the body with the snubber, in m or as shares of its length: 60 %; for a
    chain numbers of masses."""
    shapes: Annotated[tuple[tuple[q.Coefficient, ...], ...], Field(min_length=1)]
    """Deflections of each mode at these positions, from the first mode on, with any scaling."""

    def check(self) -> None:
        """Refuse shapes with a wrong number of values, or zero."""
        for index, shape in enumerate(self.shapes):
            if len(shape) != len(self.positions):
                raise InvalidValueError(
                    f"has {len(shape)} values for {len(self.positions)} positions",
                    "give one deflection per position",
                    ("shapes", index),
                )
            if not any(shape):
                raise InvalidValueError(
                    "is zero everywhere", "leave out modes that were not measured", ("shapes", index)
                )

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems: a snubber between two bodies, and positions that are not on its body."""
        sought = scenario.identify_stiffness.snubber
        bodies = next((each.bodies for each in scenario.located_snubbers if each.item.name == sought), ())
        if len(bodies) > 1:
            message = f"contains the shapes of one body, but {sought} acts between {' and '.join(bodies)}"
            yield problem(path, message, "leave it out")
        elif bodies and bodies[0] in scenario.all_bodies:
            body, where = scenario.all_bodies[bodies[0]], scenario.body_path(bodies[0])
            for index, position in enumerate(self.positions):
                yield from body.shape_problems(where, (*path, "positions", index), position)


class _AnyTest(Schema):
    """Common part of all tests."""

    name: q.Name | None = None
    """Name in tables and in leave_out; by default the file."""
    probe: q.Name | None = None
    """Probe that corresponds to the sensor; by default the first one."""
    gain: q.PositiveNumber = 1.0
    """Recorded over true value, if the calibration of the channel is uncertain; estimate may contain its path."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """A problem if the probe does not exist."""
        yield from _problems_of_probe(scenario, path, self.probe)


def _problems_of_probe(scenario: Whole, path: Path, name: str | None) -> Problems:
    """A problem if a named probe does not exist."""
    if name is not None:
        yield from unknown((*path, "probe"), name, "probe", (probe.name for probe in scenario.effective_probes))


class _RecordedTest(_AnyTest, RecordPreparation):
    """Common part of tests with a measured signal in a file."""

    file: q.FileName
    """Measured signal or spectrum: CSV, HDF5 (also a beamsim result), netCDF, MATLAB, UFF dataset 58, TDMS, MDF or LVM;
    the path is relative to the scenario's folder."""
    channel: q.Text | None = None
    """Column, dataset or UFF label to read; by default the one with the name of the probe, or the only one."""
    decimal: DecimalMark | None = None
    """Decimal mark in a text file, "." or ","; by default detected from the numbers."""
    quantity: Literal["absolute_acceleration", "displacement", "absolute_displacement", "velocity"] = (
        "absolute_acceleration"
    )
    """The measured quantity; displacement and velocity are relative to the base."""
    unit: q.Text | None = None
    """Unit of the values in the file, for example g or mm; by default the unit in the file."""
    axis_unit: q.Text | None = None
    """Unit of the times or frequencies in the file, for example ms; by default the unit in the file."""
    phase: Literal["free", "of_excitation"] = "free"
    """free: the time origin of the record is unknown, and a delay is fitted; of_excitation: it is that of the
    excitation."""
    noise: q.Ratio | None = None
    """Standard deviation of a harmonic, or of a sample of a transient, relative to the largest one; by default
    estimated from the scatter of the signal."""

    @property
    def label(self) -> str:
        """Name of the test for messages."""
        return self.name or self.file


class SteadyTest(_RecordedTest):
    """A measured steady vibration; keys that are missing are as in the excitation of the scenario."""

    kind: Literal["steady"] = "steady"
    """A steady vibration, compared by its harmonics; the default kind."""
    frequency: q.Frequency | None = None
    """Excitation frequency of this test."""
    level: q.Level | None = None
    """Excitation level of this test, in the quantity of the scenario's excitation; a frequency response is multiplied
    by it."""
    harmonics: Annotated[int, q.WholeNumber(1, 500)] = 6
    """Number of harmonics of the excitation frequency in the fit; a frequency response has one."""
    last: q.Duration | None = None
    """Use only this last part of a time signal, when the vibration is steady; by default all of it."""


class TransientTest(_RecordedTest):
    """A measured transient, compared with a run sample by sample after its mean is removed."""

    kind: Literal["transient"]
    """A released start, a shock, a decay, or any measured force or base motion."""
    quantity: Literal["absolute_acceleration", "displacement", "velocity"] = "absolute_acceleration"
    """The measured quantity; displacement and velocity are relative to the base."""
    excitation: Excitation | None = None
    """Excitation in this test; by default that of the scenario. A recorded base motion is {kind: sampled, file:
    drop.csv, column: base}."""
    start: Start | None = None
    """Initial state in this test, as run.start; by default that of the run, or static equilibrium."""
    begin: q.Time = 0.0
    """Start of excitation and motion, after the first sample; with phase: free it may be off by a tenth of the compared
    duration."""
    duration: q.Duration | None = None
    """Duration of the comparison from there on; by default the rest of the record."""


class MeasuredPeak(Schema):
    """A measured peak in a sweep: the largest magnitude at a probe."""

    probe: q.Name | None = None
    """Probe of the peak; by default that of the test."""
    frequency: q.Frequency | None = None
    """Frequency of the peak; omit it if the peak is at the jump."""
    absolute_acceleration: q.PositiveAcceleration | None = None
    """Peak of the absolute acceleration."""
    displacement: q.Length | None = None
    """Peak of the displacement relative to the base."""
    scatter: q.Ratio = 0.02
    """Standard deviation, relative to the value."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """A problem if the probe does not exist."""
        yield from _problems_of_probe(scenario, path, self.probe)

    def check(self) -> None:
        """Require exactly one value."""
        if (self.absolute_acceleration is None) == (self.displacement is None):
            raise InvalidValueError("has no value, or two", "give absolute_acceleration or displacement")

    @property
    def quantity(self) -> Literal["absolute_acceleration", "displacement"]:
        """The measured quantity."""
        return "displacement" if self.absolute_acceleration is None else "absolute_acceleration"

    @property
    def value(self) -> float:
        """Its value, SI."""
        value = self.displacement if self.absolute_acceleration is None else self.absolute_acceleration
        assert value is not None
        return value


class SweepTest(_AnyTest, FrequencyRange):
    """A slow sine sweep: its jump and peaks, or a file with a table of such sweeps."""

    kind: Literal["sweep"]
    """Peaks and jump of a sweep, compared with the periodic motions that a slow sweep follows."""
    name: q.Name
    """Name in tables and in leave_out; rows of a file get a number, or have their own names."""
    file: q.FileName | None = None
    """CSV table with headings and units, one row per sweep. The columns are the keys below (level, direction, jump) and
    peaks (tip frequency, tip absolute_acceleration, tip scatter); missing columns or cells have the values given
    here."""
    decimal: DecimalMark | None = None
    """Decimal mark in a text file, "." or ","; by default detected from the numbers."""
    level: q.Level | None = None
    """Excitation level of this test, in the quantity of the scenario's excitation."""
    direction: Literal["up", "down"] = "up"
    """Direction of the sweep."""
    falling_range_remedy: ClassVar[str] = "give the lowest frequency first, and direction: down"

    rate: q.SweepRate | None = None
    """Sweep rate; a warning tells if it was too fast for steady vibration."""
    jump: q.Frequency | None = None
    """Frequency at which the amplitude jumps."""
    scatter: q.Frequency
    """Standard deviation of the frequencies."""
    peaks: tuple[MeasuredPeak, ...] = ()
    """The measured peaks."""

    def check(self) -> None:
        """Require a measured value, or a file with them."""
        super().check()
        if self.file is None and self.jump is None and not self.peaks:
            raise InvalidValueError("has neither jump nor peaks", "give one of them, or a file", ("peaks",))
        if self.file is not None and (self.jump is not None or self.peaks):
            raise InvalidValueError("has a file, and also jump or peaks", "write all rows into the file", ("file",))

    @property
    def label(self) -> str:
        """Name of the test for messages."""
        return self.name


AnyTest = Annotated[
    SteadyTest | TransientTest | SweepTest,
    Variants(
        "is not a test", "give kind: steady (or none), transient or sweep",
        lambda test: f"<{str(kind_of(test) or 'steady').title()}Test>",
    ),
]  # fmt: skip


class NonlinearFit(Schema):
    """Identification of parameters from measured nonlinear vibrations."""

    estimate: Annotated[tuple[IdentifiedParameter, ...], Field(min_length=1)]
    """Parameters to identify, for example snubbers.tip.gap or beam.damping.ratio."""
    tests: Annotated[tuple[AnyTest, ...], Field(min_length=1)]
    """The measured vibrations, transients and sweeps."""
    leave_out: tuple[q.Text, ...] = ()
    """Names or files of tests to ignore."""
    starts: q.SmallCount = 5
    """Number of starting points: the values in the scenario, and random points around them."""
    spread: q.Ratio = 0.3
    """Relative spread of the random starting points about the values in the scenario."""
    seed: q.RandomSeed = 0
    """Seed of the random starting points."""
    profiles: bool = True
    """Whether to compute the profile likelihood of every parameter, for the plot."""

    @property
    def used_tests(self) -> dict[int, SteadyTest | TransientTest | SweepTest]:
        """The tests that are used, by their number in the list."""
        return {k: test for k, test in enumerate(self.tests) if test.label not in self.leave_out}

    @property
    def tests_with_files(self) -> dict[int, SteadyTest | TransientTest]:
        """The tests with a file, by number."""
        return {k: test for k, test in self.used_tests.items() if not isinstance(test, SweepTest)}

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems: parameters that cannot be identified, an unsuitable excitation, unknown tests in leave_out."""
        yield from listing_problems(
            self.estimate, (*path, "estimate"), lambda each: _sought_places(scenario, each, words=False)
        )
        steady = any(test.kind != "transient" for test in self.used_tests.values())
        if steady and not isinstance(scenario.excitation, Harmonic):
            yield not_harmonic(path, "a harmonic excitation", scenario.excitation)
        if not any(isinstance(test, SweepTest) and test.file for test in self.tests):  # rows of a file have names too
            labels = [test.label for test in self.tests]
            for index, name in enumerate(self.leave_out):
                yield from unknown((*path, "leave_out", index), name, "test", labels)

    def check(self) -> None:
        """Require at least one test."""
        if not self.used_tests:
            raise InvalidValueError("leaves no test", "keep one", ("leave_out",))


class IdentifyStiffness(Schema):
    """Measurements and settings for the identification of a snubber's stiffness."""

    snubber: q.Name
    """Name of the snubber whose stiffness is identified."""
    measured_without: tuple[q.Frequency, ...] = ()
    """Natural frequencies measured without the snubber, from the first on; they check the model of the structure.

    If there are several bodies: frequencies of those that the snubber acts on.
    """
    measured_with: tuple[q.Frequency, ...] = ()
    """Natural frequencies measured with the snubber permanently in contact, from the first on."""
    fit_to: Annotated[tuple[q.Count, ...], Field(min_length=1)] = (1,)
    """Numbers of the modes used in the fit."""
    method: Literal["secular", "thesis"] = "secular"
    """secular: closed form, to machine precision; thesis: k grows in steps of 1 % until the frequency fits (Hazim
    2010)."""
    tolerance: q.Ratio = 1e-3
    """Method thesis: relative frequency error at which the iteration stops."""
    most_solutions: q.Count = 20_000
    """Method thesis: largest number of eigenvalue solutions."""
    uncertainty: Ratios = 0.0
    """Relative standard deviation of a measured frequency, or a list with one value for each mode."""
    coverage: Probability = 0.95
    """Coverage probability of the confidence intervals."""
    monte_carlo: MonteCarlo = MonteCarlo.model_construct()
    """Check of the uncertainty by random sampling."""
    parameter_uncertainty: tuple[ParameterUncertainty, ...] = ()
    """Uncertain parameters of the structure."""
    update: tuple[IdentifiedParameter, ...] = ()
    """Structural parameters to update from measured_without before the snubber is identified."""
    shapes_without: MeasuredShapes | None = None
    """Mode shapes measured without the snubber."""
    nonlinear: NonlinearFit | None = None
    """Identification of damping and contact parameters from measured nonlinear vibrations."""
    pad: Pad | None = None
    """Pad of the snubber; gives its Young's modulus, and Maxwell branches from measurements on the pad."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems: an unknown snubber or parameter, invalid bounds, levels whose unit does not fit the excitation."""
        snubbers = {snubber.name: snubber for snubber in scenario.all_snubbers}
        where = (*path, "snubber")
        yield from unknown(where, self.snubber, "snubber", snubbers, "give the snubber in snubbers")
        if isinstance(snubbers.get(self.snubber), HingeStop):
            yield from no_stop_of_hinge(where, self.snubber)
        if self.parameter_uncertainty:
            uncertain = (*path, "parameter_uncertainty")
            yield from listing_problems(
                self.parameter_uncertainty, uncertain, lambda each: _numbers(scenario, each.parameter)
            )
        if self.update:
            yield from listing_problems(
                self.update, (*path, "update"), lambda each: _sought_places(scenario, each, words=True)
            )
        if self.nonlinear is not None:
            yield from level_problems(scenario, path, self)

    def check(self) -> None:
        """Refuse unordered frequencies, modes without a measurement, and more unknowns than measurements."""
        remedy = "list the frequencies from the first mode on; are the two swapped?"
        demand_rising(self.measured_without, "Hz", lambda k: ("measured_without", k), remedy)
        demand_rising(self.measured_with, "Hz", lambda k: ("measured_with", k), remedy)
        of_pad = self.pad is not None and self.pad.data is not None
        of_structure = self.update and self.measured_without
        if not self.measured_with and self.nonlinear is None and not of_structure and not of_pad:
            raise InvalidValueError(
                "is missing, and there are no nonlinear tests",
                "give the frequencies with permanent contact, measured_with: [196.5 Hz], or nonlinear tests",
                ("measured_with",),
            )
        self._modes()
        self._uncertainties()
        if self.update:
            self._check_update()

    def _check_update(self) -> None:
        free = [item for item in self.update if item.prior is None]
        if len(free) < len(self.update) and self.uncertainty == 0.0:
            raise InvalidValueError(
                "is missing, and a prior of update is to be weighed against the measured frequencies",
                "write for example uncertainty: 0.3 %",
                ("uncertainty",),
            )
        if len(free) > len(self.measured_without):
            given = count_text(len(self.measured_without), "measured frequency", "measured frequencies")
            raise InvalidValueError(
                f"asks for {len(free)} unknowns without prior from {given}",
                "measure more modes in measured_without, seek fewer parameters, or give them a prior: 5 %",
                ("update",),
            )

    def uncertainty_of(self, mode: int) -> float:
        """Relative standard deviation of the measured frequency of a mode (from 1)."""
        if isinstance(self.uncertainty, tuple):
            return self.uncertainty[min(mode, len(self.uncertainty)) - 1]
        return self.uncertainty

    def _modes(self) -> None:
        if not self.measured_with:
            return
        count = len(self.measured_with)
        for index, mode in enumerate(self.fit_to):
            if mode > count:
                raise InvalidValueError(
                    f"= {mode}, but measured_with has {count_text(count, 'frequency', 'frequencies')}",
                    "list only modes that were measured",
                    ("fit_to", index),
                )
            if mode in self.fit_to[:index]:
                raise InvalidValueError(f"= {mode} is listed twice", "list every mode once", ("fit_to", index))
        if self.method == "thesis" and len(self.fit_to) > 1:
            raise InvalidValueError(
                "= thesis fits one mode, but fit_to has several",
                "keep one mode in fit_to, or use method: secular",
                ("method",),
            )

    def _uncertainties(self) -> None:
        given = self.uncertainty if isinstance(self.uncertainty, tuple) else (self.uncertainty,)
        if min(given) == 0.0 < max(given):
            raise InvalidValueError(
                "= 0 for one mode and not for another would give that mode all the weight",
                "give every mode its uncertainty, or none",
                ("uncertainty", given.index(0.0)),
            )
        for index, value in enumerate(given):
            if value > 0.2:
                raise InvalidValueError(
                    f"= {value:g} means {100 * value:g} % of a frequency",
                    f"write {value:g} % if that was meant",
                    ("uncertainty", index) if isinstance(self.uncertainty, tuple) else ("uncertainty",),
                )


def _numbers(scenario: Whole, path: str) -> list[Path]:
    """Paths of the numbers that a path of the user stands for."""
    places = find_parameters(scenario, path, ("parameter",))
    if any(choices_at(scenario, place) or isinstance(value_at(scenario, place), str | Rate) for place in places):
        raise InvalidValueError(f"= {path} is not a number", "name a number", ("parameter",))
    return places


def _sought_places(scenario: Whole, parameter: ParameterToIdentify, *, words: bool) -> list[Path]:
    """Paths of the numbers of a parameter to identify; they must lie within its bounds.

    Parameters
    ----------
    scenario : with the numbers.
    parameter : the parameter to identify.
    words : whether it may also be a choice of words, or several numbers with a common factor.
    """
    path, at = parameter.parameter, ("parameter",)
    places = find_parameters(scenario, path, at)
    choices = choices_at(scenario, places[0])
    if choices and words and "supports" in places[0]:
        if parameter.bounds or parameter.prior is not None:
            among = f"= {path} is a choice between {', '.join(choices)}: it has no bounds and no prior"
            raise InvalidValueError(among, "leave them out; every choice is tried", at)
        return places
    values = [value_at(scenario, place) for place in _numbers(scenario, path)]
    if words and not all(value > 0 for value in values):
        zero = f"= {path} is zero in this scenario, and is varied by a factor"
        raise InvalidValueError(zero, "give it a rough value to start from, or leave it out", at)
    if not parameter.bounds:
        return places
    low, high = bounds_of(scenario, parameter)
    if not low < high:
        raise InvalidValueError(f"= [{low:g}, {high:g}] is empty", "give the lower bound first", ("bounds",))
    if not low <= values[0] <= high:
        raise InvalidValueError(
            f"= [{low:g}, {high:g}] does not contain the scenario's value {values[0]:g}, where the search starts",
            "widen the bounds, change the value, or write the unit", ("bounds",),
        )  # fmt: skip
    return places


def bounds_of(scenario: Whole, parameter: ParameterToIdentify) -> tuple[float, float]:
    """Lowest and highest value of a parameter to identify, in SI units; infinite if no bounds are given.

    Raises
    ------
    InvalidValueError
        If the field would refuse a bound, or a bound of a position lies beyond its body.
    """
    if not parameter.bounds:
        return -math.inf, math.inf
    place = find_parameters(scenario, parameter.parameter)[0]
    low, high = (in_metres(scenario, place, read_as(scenario, place, bound, ("bounds",))) for bound in parameter.bounds)
    if (side := side_at(scenario, place)) is not None:
        for bound in (low, high):
            beyond = scenario.all_bodies[side.body].position_problems_of_side(
                scenario.body_path(side.body), ("bounds",), bound, side.axis
            )
            for found in beyond:
                raise InvalidValueError(found.message, found.remedy, ("bounds",))
    return low, high
