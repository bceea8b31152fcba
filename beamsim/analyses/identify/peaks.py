"""Peaks and jumps of a sine sweep that was slow, as the periodic motions of the model have them.

A sweep follows the branch of periodic motions up to a fold, jumps to the motion at the same frequency that the branch
comes to next, and so on. Peaks are the largest ones on what it follows. Folds and maxima are located on the branch, so
that they are as smooth in the parameters as the motions are; beside known ones they are located without a new branch.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pydantic import ValidationError

from beamsim.analyses.continuation.branches import Budget, Tracer, trace_range
from beamsim.analyses.continuation.motion import Measurement
from beamsim.analyses.continuation.paths import periodic_forcing
from beamsim.analyses.continuation.refinement import cut
from beamsim.analyses.identify.fit import UnpredictableError
from beamsim.analyses.identify.records import Compared, Misfit, Prediction, Test, fit_of
from beamsim.analyses.identify.result import SweepFit
from beamsim.flow.variational import VariationalFlow, motion_on
from beamsim.measurements.read import ending_of, read_rows
from beamsim.measurements.signal import MeasurementError, split_heading
from beamsim.orbits.branch import BranchPoint, share_of_step
from beamsim.orbits.continuation import Settings, correct, correct_across, locate, solve_at
from beamsim.orbits.shooting import ForcedOrbits
from beamsim.scenario import Scenario
from beamsim.scenario.base import path_text
from beamsim.scenario.excitation import Harmonic
from beamsim.scenario.loading import describe
from beamsim.scenario.studies import SweepTest
from beamsim.system.build import build_system
from beamsim.system.parts import SharedBuilds
from beamsim.typing import Floats, of_kind

_EXACT = Settings(iterations=15)
_NEAR = 2e-2  # of a known feature, likewise, within which one of a neighbouring model is looked for
_APART = 1e-3  # between the motions that give a peak as a parabola, in the scale of a branch


class Feature(NamedTuple):
    """A point of a branch that a sweep shows."""

    kind: str  # jump, landing (after a jump), top, or start
    point: BranchPoint


@dataclass
class _Curve:
    """The branch of a model, its features and the peaks that are measured on it."""

    orbits: ForcedOrbits
    measurement: Measurement
    channels: tuple[int, ...]  # of each peak, among those that are measured
    test: SweepTest

    @property
    def way(self) -> float:
        """1 where the frequency rises, else -1."""
        return 1.0 if self.test.direction == "up" else -1.0

    @cached_property
    def points(self) -> tuple[BranchPoint, ...]:
        """The branch between both frequencies of a sweep, in its direction."""
        low, high = 2 * np.pi * self.test.from_, 2 * np.pi * self.test.to
        found = trace_range(Tracer(self.orbits, (0.5 * low, 2.0 * high)), low, high, Budget(4000, np.inf))
        pieces = [piece for branch in found for piece in cut(branch, low, high)]
        whole = [piece for piece in pieces if piece.span[0] <= low * (1 + 1e-9) and piece.span[1] >= high * (1 - 1e-9)]
        if not whole:
            raise UnpredictableError("the branch of periodic motions does not reach from one frequency to the other")
        points = tuple(whole[0].points)
        return points if (points[-1].parameter - points[0].parameter) * self.way > 0 else points[::-1]

    def heights(self, point: BranchPoint) -> Floats:
        """Of each measured peak."""
        return self.measurement.of_passage(*self.orbits.cycle(point)).peak[list(self.channels)]

    def moved(self, point: BranchPoint, distance: float) -> BranchPoint:
        """The motion so far along the tangent of a point."""
        t, guess = point.tangent, point.u + distance * point.scale * point.tangent
        found = correct(self.orbits, guess, t, point.scale, _EXACT, reference=t)
        if found is None:
            raise UnpredictableError("a motion beside a peak or jump was not found")
        return found

    def fold(self, a: BranchPoint, b: BranchPoint) -> BranchPoint | None:
        """The fold between two points."""
        return locate(self.orbits, a, b, lambda p: float(p.tangent[-1]), _EXACT)

    def top(self, point: BranchPoint, peak: int) -> BranchPoint | None:
        """The largest peak beside a point, by parabolas through three of them; None where there is none."""
        for _ in range(_EXACT.iterations):
            sides = [self.heights(self.moved(point, side * _APART))[peak] for side in (-1.0, 1.0)]
            slope, bend = sides[1] - sides[0], sides[0] + sides[1] - 2.0 * self.heights(point)[peak]
            if bend >= 0.0:
                return None
            away = -0.5 * slope / bend
            # 20: of these distances, furthest way in one go
            point = self.moved(point, _APART * float(np.clip(away, -20, 20)))
            if abs(away) < 1.0:
                return point
        return None

    def landing(self, near: BranchPoint, frequency: float) -> BranchPoint:
        """The motion at the frequency of a jump after it."""
        point = solve_at(self.orbits, near.u, _EXACT, frequency)
        if point is None:
            raise UnpredictableError("the motion after a jump was not found")
        return point

    def beside(self, known: Feature, jump: Feature | None, peak: int = 0) -> Feature:
        """A feature beside one of a neighbouring model."""
        if known.kind == "jump" and jump is not None:
            return jump
        centre = correct_across(self.orbits, known.point.u, _EXACT) if known.kind in ("jump", "top") else None
        found: BranchPoint | None = None
        if known.kind == "landing" and jump is not None:
            found = self.landing(known.point, jump.point.parameter)
        elif known.kind == "start":
            found = solve_at(self.orbits, known.point.u, _EXACT)
        elif centre is not None and known.kind == "jump":
            found = self.fold(*(self.moved(centre, side * _NEAR) for side in (-1.0, 1.0)))
        elif centre is not None:
            found = self.top(centre, peak)
        if found is None or (known.kind == "top" and _determinant(found) * _determinant(known.point) < 0):
            raise UnpredictableError("a peak or jump beside a known one was not found, or lies beyond a fold")
        return Feature(known.kind, found)

    @cached_property
    def followed(self) -> tuple[list[list[Feature]], Feature | None]:
        """The parts of the branch that a sweep follows, with their ends, and its first jump."""
        parts, part, first = list[list[Feature]](), list[Feature](), None
        way, rest = self.way, iter(pairwise(self.points))
        for a, b in rest:
            part.append(Feature("start", a))
            if (b.parameter - a.parameter) * way > 0 and float(b.tangent[-1]) * float(a.tangent[-1]) > 0:
                continue
            fold = self.fold(a, b)
            if fold is None:
                raise UnpredictableError("a fold of the branch was not located")
            parts, part = [*parts, [*part, Feature("jump", fold)]], []
            first = first or parts[-1][-1]
            for c, d in rest:  # to where the branch passes the frequency of the fold again
                if (c.parameter - fold.parameter) * way <= 0 < (d.parameter - fold.parameter) * way:
                    part.append(Feature("landing", self.landing(c, fold.parameter)))
                    break
            else:
                raise UnpredictableError("after a jump there is no motion within from and to: give a wider range")
        return [*parts, [*part, Feature("start", self.points[-1])]], first

    def highest(self) -> tuple[Feature, ...]:
        """Where each peak is largest on what a sweep follows."""
        places = [(part, k) for part in self.followed[0] for k in range(len(part))]
        heights = np.array([self.heights(part[k].point) for part, k in places])
        return tuple(self._highest(places[at], peak) for peak, at in enumerate(np.argmax(heights, axis=0)))

    def _highest(self, place: tuple[Sequence[Feature], int], peak: int) -> Feature:
        part, k = place
        inner = part[max(k - 1, 0)].point, part[min(k + 1, len(part) - 1)].point
        found = self.top(part[k].point, peak)
        inside = found is not None and 0.0 <= share_of_step(*inner, found) <= 1.0
        return Feature("top", found) if found is not None and inside else part[k]


def _determinant(point: BranchPoint) -> float:
    """A number with the sign of that of the derivative by the state, which changes at folds alone."""
    return point.orientation * float(point.tangent[-1])


def sweeps_of(test: SweepTest, folder: Path, probes: Sequence[str]) -> list[SweepTest]:
    """The rows of a test's file, or the test itself where it has none.

    Parameters
    ----------
    test : of the scenario.
    folder : where the path of the file begins.
    probes : names that headings of peaks may begin with.

    Returns
    -------
    list of SweepTest
        With the names of the file, or numbered ones; what the file does not say is as in the test.

    Raises
    ------
    MeasurementError
        If the file cannot be read, or a row is no test: with its line.
    """
    if test.file is None:
        return [test]
    ending_of(folder / test.file)  # of a file that exists
    (heading, *rows), mark = read_rows(folder / test.file)
    columns = [(*split_heading(cell), cell) for cell in heading.cells]
    tests = []
    for number, row in enumerate(rows, 1):
        if len(row.cells) != len(columns):
            message = f"has {len(row.cells)} columns in line {row.line} instead of {len(columns)}"
            raise MeasurementError(message, "correct the line")
        keys: dict[str, Any] = {"kind": "sweep", "name": f"{test.name} {number}", "from": test.from_, "to": test.to}
        peaks = dict[str, dict[str, str]]()
        for (name, unit, written), cell in zip(columns, row.cells, strict=True):
            probe, _, key = name.replace("absolute acc", "absolute_acc").rpartition(" ")
            if not unit and name not in ("name", "direction"):
                raise MeasurementError(f"states no unit in its heading {written}", "write for example jump (Hz)")
            if probe not in ("", *probes):
                raise MeasurementError(f"has no probe in its heading {written}", f"probes are {', '.join(probes)}")
            value = f"{cell if mark == ',' or not unit else cell.replace(',', '.')} {unit}".rstrip()
            of_test = not probe and key in ("name", "level", "direction", "from", "to", "rate", "jump", "scatter")
            if cell:
                (keys if of_test else peaks.setdefault(probe, {"probe": probe} if probe else {}))[key] = value
        try:
            sweep = SweepTest.model_validate({"scatter": test.scatter, **keys, "peaks": [*peaks.values()]})
        except ValidationError as error:
            at, message, remedy = describe(SweepTest, error.errors(include_url=False)[0])
            raise MeasurementError(f"line {row.line}: {path_text(at)} {message}", remedy) from None
        tests.append(test.model_copy(update={key: getattr(sweep, key) for key in sweep.model_fields_set}))
    return tests


@dataclass(frozen=True)
class SweepPrediction(Prediction):
    """What a slow sweep shows: the motion is that of its largest peak."""

    curve: _Curve
    jump: Feature | None
    tops: tuple[Feature, ...]  # of each measured peak
    numbers: Floats  # (r,) predicted, with a gain of 1
    bandwidth: float  # Hz, of the decay at the largest peak


@dataclass(frozen=True)
class SweptPeaks(Test):
    """Measured peaks and the jump of a slow sweep at one level and in one direction."""

    what: tuple[str, ...]  # each number is: a jump, or frequency or height of a peak
    measured: Floats  # (r,) Hz, and units of the peaks
    sigma: Floats  # (r,)
    test: SweepTest
    places: tuple[tuple[str, str], ...]  # probe and quantity of each peak

    @classmethod
    def of(cls, number: int, test: SweepTest, probe: str) -> SweptPeaks:
        """A row of a table.

        Parameters
        ----------
        number : of the test in the list of the scenario.
        test : what is said of it.
        probe : where peaks are that name no probe.
        """
        rows = [] if test.jump is None else [("jump", test.jump, test.scatter)]
        places = []
        for peak in test.peaks:
            name = peak.probe or probe
            places.append((name, peak.quantity))
            if peak.frequency is not None:
                rows.append((f"frequency of {name}", peak.frequency, test.scatter))
            rows.append((f"peak of {name}", peak.value, peak.scatter * peak.value))
        what, measured, sigma = zip(*rows, strict=True)
        places = places or [(probe, "displacement")]  # for the picture
        return cls(
            number, test.label, *places[0], True, False, what, np.array(measured), np.array(sigma), test, tuple(places)
        )

    @property
    def size(self) -> int:
        """Number of measured values."""
        return self.measured.size

    def case(self, scenario: Scenario) -> Scenario:
        """The scenario at the level of this test."""
        harmonic, test = of_kind(Harmonic, scenario.excitation), of_kind(SweepTest, fit_of(scenario).tests[self.number])
        level = self.test.level if test.file else test.level
        return scenario.model_copy(update={"excitation": harmonic.at(test.to, level), "run": None})

    def predicted(self, case: Scenario, near: Any, shared: SharedBuilds) -> SweepPrediction:
        """Jump and peaks; see `Transient.predicted`."""
        test, curve = self.test, self._curve(case, shared)
        try:
            found = None if near is None else self._beside(curve, near)
            jump, tops = found or self._whole(curve)
        except (ArithmeticError, np.linalg.LinAlgError) as error:
            raise UnpredictableError(f"{self.name}: {error}") from error
        numbers = [] if test.jump is None or jump is None else [jump.point.parameter / (2 * np.pi)]
        for k, (peak, top) in enumerate(zip(test.peaks, tops, strict=False)):
            numbers += [] if peak.frequency is None else [top.point.parameter / (2 * np.pi)]
            numbers.append(float(curve.heights(top.point)[k]))
        multipliers, (flow, passage) = curve.orbits.multipliers(tops[0].point), curve.orbits.cycle(tops[0].point)
        bandwidth = -float(np.log(np.abs(multipliers).max())) / (np.pi * passage.duration)
        touching, motion = passage.event_time.size > 0, motion_on(of_kind(VariationalFlow, flow).exact, passage)
        system = curve.measurement.system
        return SweepPrediction(system, motion, touching, curve, jump, tops, np.array(numbers), bandwidth)

    def _curve(self, case: Scenario, shared: SharedBuilds) -> _Curve:
        """The branch of a case and what is measured along it."""
        system, harmonic = build_system(case, shared, recovered=False), of_kind(Harmonic, case.excitation)
        if system.cubic.count:
            raise UnpredictableError("cubic springs have no exact flow")
        omega, loads = 2 * np.pi * harmonic.frequency, periodic_forcing(case, system)
        orbits = ForcedOrbits(VariationalFlow(system.dynamics, loads, omega, harmonic.level), "frequency")
        keys = dict.fromkeys(("probes", quantity) for _, quantity in (*self.places, ("", "displacement")))
        channels = system.channels.of_keys(*keys)
        columns = {(each.name, each.quantity): k for each, k in channels.located}
        return _Curve(
            orbits, Measurement(system, harmonic, channels, 1), tuple(columns[at] for at in self.places), self.test
        )

    @staticmethod
    def _beside(curve: _Curve, near: SweepPrediction) -> tuple[Feature | None, tuple[Feature, ...]] | None:
        """Jump and peaks beside those of a neighbouring model."""
        with suppress(ArithmeticError, np.linalg.LinAlgError):
            jump = None if near.jump is None else curve.beside(near.jump, None)
            return jump, tuple(curve.beside(top, jump, k) for k, top in enumerate(near.tops))
        return None

    def _whole(self, curve: _Curve) -> tuple[Feature | None, tuple[Feature, ...]]:
        """Jump and peaks on the whole branch."""
        _, jump = curve.followed
        if self.test.jump is not None and jump is None:
            raise UnpredictableError(f"{self.name}: the model does not jump")
        return jump, curve.highest()

    def compared(self, prediction: Any, gain: float, near: Compared | None) -> Compared:
        """Numbers beside the table; see `Transient.compared`."""
        heights = np.array([what.startswith("peak") for what in self.what])
        numbers = prediction.numbers * np.where(heights, gain, 1.0)
        residuals = (numbers - self.measured) / self.sigma
        return Compared(replace(prediction, numbers=numbers), 0.0, residuals, np.zeros(self.size))

    def fitted(self, part: Misfit, before: Compared, found: Compared) -> SweepFit:
        """See `Transient.fitted`."""
        prediction: SweepPrediction = found.values
        points = prediction.curve.points
        return SweepFit(
            **self.described(part, found),
            level=prediction.curve.orbits.level,
            direction=self.test.direction,
            what=self.what,
            measured=self.measured,
            noise=self.sigma,
            before=before.values.numbers,
            predicted=prediction.numbers,
            branch_frequency_hz=np.array([point.parameter for point in points]) / (2 * np.pi),
            branch_peak=np.array([prediction.curve.heights(point)[0] for point in points]),
        )

    def _unstable(self, prediction: SweepPrediction) -> float | None:
        """Hz, the first motion that is followed and not stable, up to the last one that is compared."""
        curve, jump = prediction.curve, prediction.jump
        ends = [*(prediction.tops if self.test.peaks else ()), *([jump] if jump and self.test.jump else [])]
        last = max(curve.way * end.point.parameter for end in ends)
        inner = [f for part in curve.followed[0] for f in part if f.kind == "start"]
        inner += [top for top in prediction.tops if top.kind == "top"]  # at folds and landings round-off decides
        lost = [curve.way * f.point.parameter for f in inner if not curve.orbits.orbit(f.point).stable]
        first = min(lost, default=np.inf)
        return curve.way * first / (2 * np.pi) if first <= last else None

    def doubts(self, prediction: Any) -> list[str]:
        """Also warnings where a sweep does not show what is predicted: a peak comes right after a jump, a motion is not
        stable, or the sweep is too fast (0.1 times the square of the bandwidth, in Hz, by integrated ones)."""
        said, most = [], 0.1 * prediction.bandwidth**2
        hertz = 0.0 if self.test.rate is None else self.test.rate.value
        if self.test.rate is not None and self.test.rate.unit == "oct/s":
            hertz *= np.log(2.0) * prediction.tops[0].point.parameter / (2 * np.pi)
        if self.test.peaks and any(top.kind == "landing" for top in prediction.tops):
            said.append(
                "its peak is the one right after the jump, which overshoots however slow the sweep is; give the "
                "amplitude to which it settles there, or leave peaks out"
            )
        if (lost := self._unstable(prediction)) is not None:
            said.append(
                f"the motion at {lost:.4g} Hz is not stable: the sweep leaves it otherwise than at a fold, and what "
                "follows is not the peak or jump of motions with its period; narrow from and to, or fit the time "
                "history of the sweep as a transient"
            )
        elif hertz > most:
            said.append(
                f"{hertz:.3g} Hz/s is fast for a bandwidth of {prediction.bandwidth:.3g} Hz: above {most:.3g} Hz/s "
                "peaks and jumps are late and not those of steady vibrations; fit the time history of the sweep as a "
                "transient"
            )
        return [*super().doubts(prediction), *(f"{self.name}: {each}" for each in said)]
