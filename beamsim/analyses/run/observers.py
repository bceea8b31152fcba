"""What takes long and is taken of a motion chunk by chunk, while it is marched: impacts, stresses.

Every chunk is seen once and may be forgotten.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

from beamsim.flow.trajectory import Trajectory
from beamsim.outcomes import Interrupted, Stop, check_stop, stop_requests


class ChunkObserver(ABC):
    """Evaluates chunk after chunk, the latest one when the next comes or when the result is asked for.

    What takes long is so computed after the values of the motion itself, if the motion is one chunk.

    Parameters
    ----------
    stop : asked during a march whether to end; there is no result then.
    """

    def __init__(self, stop: Stop) -> None:
        self._stop, self._interrupted = stop, False
        self._latest: Trajectory | None = None

    def add(self, chunk: Trajectory) -> None:
        """Take the next chunk."""
        try:
            with stop_requests(self._stop, at_once=True):
                self.finish()
        except Interrupted:
            self._interrupted = True
        self._latest = chunk

    def finish(self) -> None:
        """Evaluate the latest chunk.

        Raises
        ------
        Interrupted
            If this or an earlier chunk is not evaluated.
        """
        if self._interrupted:
            raise Interrupted
        if self._latest is not None:
            check_stop()
            self.evaluate(self._latest)
        self._latest = None

    @abstractmethod
    def evaluate(self, chunk: Trajectory) -> None:
        """Include a chunk, as the one after those before."""
