"""Values that come from a whole motion, found again in another motion of the same case.

These are root mean squares and lines of the spectra, and the statistics of a random or sampled response.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np

from beamsim.analyses.run.histories import Histories
from beamsim.analyses.run.random_response import statistics_of
from beamsim.analyses.run.records import Record, SampledRecord
from beamsim.analyses.run.result import MAIN_QUANTITY, STATISTICS, RandomResponse, RunResult, ShockResponse, Spectrum
from beamsim.analyses.run.spectra import records_of
from beamsim.analyses.run.spectrum import WORTH_LISTING, found_again
from beamsim.analyses.run.summary import resting
from beamsim.analyses.values import ACCELERATION, DISPLACEMENT, FORCE, STANDARD_GRAVITY
from beamsim.flow.channels import Observed
from beamsim.flow.trajectory import Trajectory
from beamsim.scenario import Scenario
from beamsim.system.structural import StructuralSystem
from beamsim.trust.values import Values
from beamsim.typing import Floats

FEWEST_PERIODS = 8  # of the excitation, in a part whose lines are compared

SpectrumKey = tuple[str, str]  # probe and quantity


@dataclass(frozen=True)
class DerivedValues:
    """The spectra and statistics of a run.

    Parameters
    ----------
    scenario : of the run.
    spectra : by probe and quantity.
    random : statistics of the response; None where the input is neither random nor sampled.
    times : (nt,) s, output times.
    shock : shock response spectra; None where they were not asked for.
    still : probes and quantities that are 0 but for round-off.
    """

    scenario: Scenario
    spectra: Mapping[SpectrumKey, Spectrum]
    random: RandomResponse | None
    times: Floats
    shock: ShockResponse | None
    still: frozenset[SpectrumKey]  # probes and quantities that are 0 but for round-off

    @classmethod
    def of(cls, result: RunResult) -> Self:
        """Those of a run."""
        spectra = {key: s for key, s in result.spectra.items() if key[0] in result.probes}
        still = frozenset(key for key in spectra if resting(*key, result.summary))
        times = np.zeros(0) if result.random is None else result.time
        return cls(result.scenario, spectra, result.random, times, result.srs, still)

    def resting(self, probe: str, quantity: str) -> bool:
        """Whether a quantity of a probe is 0 but for round-off, of which root mean squares say nothing."""
        return (probe, quantity) in self.still

    def reported(self) -> Values:
        """The figures as they are in the result."""
        reported = {
            key: (np.reshape([[line.frequency_hz, line.amplitude] for line in s.lines], (-1, 2)).T, s.rms or 0.0)
            for key, s in self.spectra.items()
        }
        figures = _by_name({key: (*lines, rms) for key, (lines, rms) in reported.items()})
        if self.random is not None:
            figures["random"] = {
                f"{s.name} {s.quantity} {key}": getattr(s, key) for s in self.random.signals for key in STATISTICS
            }
        if self.shock is not None:
            figures["srs"] = _highest(self.shock)
        return figures

    def again(self, system: StructuralSystem, motion: Trajectory | Histories, parts: int = 1) -> list[Values]:
        """The figures of another motion, in equal parts of what is analysed."""
        of_parts = [
            _by_name({key: (*found_again(records[key], s), records[key].rms()) for key, s in self.spectra.items()})
            for records in self._records(system, motion, parts)
        ]
        if self.random is not None:
            for figures, statistics in zip(of_parts, self._statistics(system, motion, parts), strict=True):
                figures["random"] = statistics
        if self.shock is not None:
            shock = _highest(self._shock_response(system, motion))
            for figures in of_parts:
                figures["srs"] = shock
        return of_parts

    def _shock_response(self, system: StructuralSystem, motion: Trajectory | Histories) -> ShockResponse:
        from beamsim.analyses.run.shock_response import shock_response

        assert self.scenario.run is not None
        assert self.scenario.run.srs is not None
        if isinstance(motion, Histories):
            return shock_response(self.scenario.run.srs, system, (motion.time, motion.of(ACCELERATION)))
        return shock_response(self.scenario.run.srs, system, motion)

    def parts(self, most: int) -> int:
        """Into how many parts a motion can be divided, each long enough for the lines of a spectrum."""
        s = next(iter(self.spectra.values()))
        periods = s.duration_s * s.excitation_hz
        return min(most, max(int(periods / FEWEST_PERIODS), 1)) if np.isfinite(periods) else most

    def _records(
        self, system: StructuralSystem, motion: Trajectory | Histories, parts: int
    ) -> Iterator[Mapping[SpectrumKey, Record]]:
        s, channels = next(iter(self.spectra.values())), system.channels.of_keys(ACCELERATION, DISPLACEMENT)
        keys = [(channel.name, channel.quantity) for channel in channels.channels]
        if isinstance(motion, Histories):
            inside = motion.time >= s.start_s * (1 - 1e-12)
            rate = (motion.time.size - 1) / float(motion.time[-1] - motion.time[0])
            samples = np.hstack([motion.of(key)[inside] for key in channels.places])
            yield {key: SampledRecord(motion.time[inside], x, rate) for key, x in zip(keys, samples.T, strict=True)}
            return
        span = s.start_s, min(s.start_s + s.duration_s, motion.end)
        records = [record for record, _ in records_of(self.scenario, system, motion, channels, span)]
        if parts == 1:
            yield dict(zip(keys, records, strict=True))
            return
        for indices in np.array_split(np.arange(records[0].x.size), parts):  # of samples: two motions are compared
            pieces = [SampledRecord(r.time[indices], r.x[indices], r.rate) for r in records]
            yield dict(zip(keys, pieces, strict=True))

    def _statistics(
        self, system: StructuralSystem, motion: Trajectory | Histories, parts: int
    ) -> Iterator[dict[str, float]]:
        assert self.random is not None
        channels = system.channels.of_keys(ACCELERATION, DISPLACEMENT, FORCE)
        if isinstance(motion, Histories):
            times, values = motion.time, np.hstack([motion.of(key) for key in channels.places])
        else:
            times = self.times[self.times <= motion.end]
            values = Observed(motion.flow, channels).values(motion, times)
        after = times >= self.random.start_s
        rate = (times.size - 1) / float(times[-1] - times[0])
        names = (f"{channel.name} {channel.quantity}" for channel in channels.channels)
        signals = dict(zip(names, values[after].T, strict=True))
        divided = {name: np.array_split(x, parts) for name, x in signals.items()}
        for k in range(parts):
            statistics = {name: statistics_of(pieces[k], rate) for name, pieces in divided.items()}
            yield {f"{name} {key}": values[key] for name, values in statistics.items() for key in STATISTICS}


def _highest(shock: ShockResponse) -> dict[str, float]:
    return {name: point["maximax_g"] for name, point in shock.summary().items()}


def line_changes(
    spectra: Mapping[SpectrumKey, Spectrum], changes: Mapping[str, Mapping[str, float]]
) -> tuple[dict[SpectrumKey, tuple[float, ...]], dict[str, float]]:
    """Relative changes of the lines of each spectrum, and by spectrum the largest over its strongest line.

    The change of a line is that of its amplitude, or of its frequency if that is larger. A line at the frequency of a
    static vector is no figure of the structure, and has none (nan); neither has a mean below the least amplitude of the
    other lines, which may be leakage.
    """
    of_lines: dict[SpectrumKey, tuple[float, ...]] = {}
    largest: dict[str, float] = {}
    for key, s in spectra.items():
        names = [_line(key, k) for k in range(len(s.lines))]
        amplitude = [changes["line_amplitude"].get(name, np.nan) for name in names]
        both = np.maximum(amplitude, [changes["line_frequency"].get(name, 0.0) for name in names])
        physical = np.array([line.kind != "residual" for line in s.lines])
        sizes = np.array([line.amplitude for line in s.lines]) * physical
        if sizes.size == 0 or sizes.max() == 0:
            continue
        told = physical.copy()
        told[0] &= sizes[0] >= WORTH_LISTING * sizes.max()
        of_lines[key] = tuple(np.where(told, both, np.nan).tolist())
        largest[" ".join(key)] = float(np.nanmax(np.where(physical, amplitude, 0.0) * sizes) / sizes.max())
    return of_lines, largest


def _line(key: SpectrumKey, number: int) -> str:
    return f"{key[0]} {key[1]} {number}"


def _by_name(spectra: Mapping[SpectrumKey, tuple[Floats, Floats, float]]) -> Values:
    """From frequencies and amplitudes of lines and the root mean square, by spectrum."""
    lines = [(_line(key, k), float(f), float(a)) for key, (fs, amplitudes, _) in spectra.items()
             for k, (f, a) in enumerate(zip(fs, amplitudes, strict=True))]  # fmt: skip
    rms = {key: value for key, (_, _, value) in spectra.items()}
    return {
        "line_frequency": {name: f for name, f, _ in lines},
        "line_amplitude": {name: a for name, _, a in lines},
        "rms_displacement_m": {key[0]: x for key, x in rms.items() if key[1] != MAIN_QUANTITY},
        "rms_acceleration_g": {key[0]: x / STANDARD_GRAVITY for key, x in rms.items() if key[1] == MAIN_QUANTITY},
    }
