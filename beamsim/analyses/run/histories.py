"""What a run reports at its output times, computed when it is read: in blocks, or as a whole.

A block is the same whoever asks for it, so that a history has the same bits in one piece and in many.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import cached_property, partial
from typing import Any, Protocol

import numpy as np

from beamsim.analyses.run.energy import energies, power_factors
from beamsim.analyses.run.output_times import OutputTimes
from beamsim.analyses.run.result import EnergyHistory
from beamsim.fields import by_rows, later
from beamsim.flow.channels import Observed
from beamsim.flow.stretches import MotionInStretches
from beamsim.flow.trajectory import Trajectory
from beamsim.system.channels import Key
from beamsim.typing import Bools, Floats

ENERGIES = tuple(field.name for field in fields(EnergyHistory))
VALUES_A_BLOCK = 2**20  # outputs and states of all times of a block
COMPONENTS = 3  # of the stress at the surface of a plate: sigma_x, sigma_y, tau_xy
_STRESSES_AT_ONCE = 256  # samples
SAMPLES_TO_SEED_STRESS = 2000  # values from which the search for the largest stress of every station starts


HistoryOf = Callable[[Floats, Mapping[Key, Floats]], Floats]  # of times and, by section and quantity, of values there


class Histories(Protocol):
    """A motion at the output times; what its methods return is computed when it is read."""

    @property
    def count(self) -> int:
        """Number of output times."""

    @property
    def time(self) -> Floats:
        """(nt,) s."""

    @property
    def values(self) -> Mapping[Key, Floats]:
        """(nt, k) by section and quantity of the channels."""

    def history(self, of: HistoryOf) -> Floats:
        """(nt,) what follows from times and outputs."""

    def signal(self, of: Callable[[Floats], Floats]) -> Floats:
        """(nt,) what follows from the times alone."""

    def closed(self, contact: int) -> Bools:
        """(nt,) whether a contact touches."""

    def kept(self, values: Floats) -> Floats:
        """(nt,) values that are known."""

    def energies(self) -> EnergyHistory:
        """Energies."""


@dataclass(frozen=True)
class SampledHistories:
    """Those of a motion from time stepping."""

    time: Floats
    values: Mapping[Key, Floats]
    touching: Bools  # (nt, m)
    energy: EnergyHistory

    @property
    def count(self) -> int:
        """Number of output times."""
        return self.time.size

    def history(self, of: HistoryOf) -> Floats:
        """(nt,) what follows from times and outputs."""
        return later(lambda: of(self.time, self.values))

    def signal(self, of: Callable[[Floats], Floats]) -> Floats:
        """(nt,) what follows from the times alone."""
        return later(lambda: of(self.time))

    def closed(self, contact: int) -> Bools:
        """(nt,) whether a contact touches."""
        return self.touching[:, contact]

    def kept(self, values: Floats) -> Floats:
        """(nt,) values that are known."""
        return values

    def energies(self) -> EnergyHistory:
        """Energies."""
        return self.energy


class ExactHistories:
    """Those of a motion in closed form.

    Parameters
    ----------
    observed : channels that are sampled.
    times : of the output.
    """

    def __init__(self, motion: MotionInStretches, observed: Observed, times: OutputTimes) -> None:
        self._motion, self._observed, self.times = motion, observed, times
        most = VALUES_A_BLOCK // (observed.channels.order.size + motion.flow.size)
        if not motion.one_stretch:
            most = min(most, int(motion.stretch_s * times.rate / times.step))
        self.block_size: int = 1 << max(most, 1).bit_length() - 1  # times of a block
        self._latest: dict[str, tuple[int, Any]] = {}  # number and contents of the last block of each kind
        self._work: list[Floats] = [np.zeros(2)]  # dissipated and put in before each block that was reached

    @property
    def count(self) -> int:
        """Number of output times."""
        return self.times.size

    @cached_property
    def time(self) -> Floats:
        """(nt,) s."""
        return self.times.all

    @cached_property
    def values(self) -> Mapping[Key, Floats]:
        """(nt, k) by section and quantity of the channels."""
        blocks = [self._outputs(number) for number in range(self._blocks)]
        return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}

    @property
    def _blocks(self) -> int:
        return int(max(-(-self.count // self.block_size), 1))

    def _rows(self, of_block: Callable[[int], Any], first: int, last: int) -> Any:
        """What blocks hold of the times with numbers ``first`` to ``last``, the last left out."""
        size = self.block_size
        parts = [
            of_block(number)[max(first - number * size, 0) : last - number * size]
            for number in range(first // size, max(-(-last // size), first // size + 1))
        ]
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def _once(self, kind: str, number: int, compute: Callable[[int], Any]) -> Any:
        """The contents of a block, kept until another block of the kind is asked for."""
        if self._latest.get(kind, (-1, None))[0] != number:
            self._latest[kind] = number, compute(number)
        return self._latest[kind][1]

    def _part(self, number: int) -> tuple[Floats, Trajectory]:
        """Times of a block, and the motion from the last time before it on."""
        first = number * self.block_size
        times = self.times.rows(first, min(first + self.block_size, self.count))
        begin = float(self.times.rows(first - 1, first)[0]) if number else 0.0
        return times, self._motion.within(begin, float(times[-1]) if times.size else begin)

    def _outputs(self, number: int) -> Mapping[Key, Floats]:
        def sampled(number: int) -> Mapping[Key, Floats]:
            times, motion = self._part(number)
            return self._observed.channels.split(self._observed.values(motion, times))

        return self._once("outputs", number, sampled)  # type: ignore[no-any-return]

    def _touching(self, number: int) -> Bools:
        def touching(number: int) -> Bools:
            times, motion = self._part(number)
            return motion.flow.system.contacts.touching(motion.phases_at(times))

        return self._once("touching", number, touching)  # type: ignore[no-any-return]

    @cached_property
    def _power_factors(self) -> Any:
        return power_factors(self._motion.flow)

    def _energies(self, number: int) -> EnergyHistory:
        """Energies of a block; those of all blocks before it have to be known, and are computed where they are not."""
        for before in range(len(self._work) - 1, number):
            self._once("energies", before, self._energies_after)
        return self._once("energies", number, self._energies_after)  # type: ignore[no-any-return]

    def _energies_after(self, number: int) -> EnergyHistory:
        times, motion = self._part(number)
        begin = float(self.times.rows(number * self.block_size - 1, number * self.block_size)[0]) if number else 0.0
        history = energies(motion, times, self._power_factors, begin, self._work[number])
        if number == len(self._work) - 1 and times.size:
            self._work.append(np.array([history.dissipated[-1], history.work_in[-1]]))
        return history

    def _history(
        self, of_block: Callable[[int], Any], whole: Callable[[], Any] | None = None, dtype: type = float
    ) -> Any:
        return by_rows(
            self.count, partial(self._rows, of_block), whole=whole, dtype=dtype, block=self.block_size
        )  # fmt: skip

    def history(self, of: HistoryOf) -> Floats:
        """(nt,) what follows from times and outputs."""

        def block(number: int) -> Floats:
            first = number * self.block_size
            return of(self.times.rows(first, min(first + self.block_size, self.count)), self._outputs(number))

        return self._history(block, lambda: of(self.time, self.values))  # type: ignore[no-any-return]

    def signal(self, of: Callable[[Floats], Floats]) -> Floats:
        """(nt,) what follows from the times alone."""
        return by_rows(self.count, lambda a, b: of(self.times.rows(a, b)), block=self.block_size)

    def closed(self, contact: int) -> Bools:
        """(nt,) whether a contact touches."""
        return self._history(lambda number: self._touching(number)[:, contact], dtype=bool)  # type: ignore[no-any-return]

    def kept(self, values: Floats) -> Floats:
        """(nt,) values that are known."""
        return by_rows(self.count, lambda a, b: values[a:b], block=self.block_size)

    @cached_property
    def _all_energies(self) -> EnergyHistory:
        blocks = [self._energies(number) for number in range(self._blocks)]
        return EnergyHistory(*(np.concatenate([getattr(block, name) for block in blocks]) for name in ENERGIES))

    def energies(self) -> EnergyHistory:
        """Energies."""

        def of(name: str) -> Floats:
            return self._history(  # type: ignore[no-any-return]
                lambda number: getattr(self._energies(number), name), lambda: getattr(self._all_energies, name)
            )

        return EnergyHistory(*map(of, ENERGIES))

    def von_mises(self, stress: Observed, of_body: slice) -> Floats:
        """(nx,) largest von Mises stress of the samples; rows are sigma_x, sigma_y and tau_xy of all stations."""
        few = self.times.every(max(1, self.count // SAMPLES_TO_SEED_STRESS)).all
        largest = np.zeros((of_body.stop - of_body.start) // COMPONENTS)
        for first in range(0, few.size, _STRESSES_AT_ONCE):
            sampled = self._motion.sample(few[first : first + _STRESSES_AT_ONCE], stress.linear)[:, of_body]
            x, y, shear = np.moveaxis(sampled.reshape(sampled.shape[0], COMPONENTS, -1), 1, 0)
            largest = np.maximum(largest, (x**2 - x * y + y**2 + 3 * shear**2).max(axis=0))
        return np.sqrt(largest)
