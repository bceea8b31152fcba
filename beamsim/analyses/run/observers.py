"""Base of observers that evaluate a motion chunk by chunk while it is marched (impacts, stresses).

Every chunk is passed once and need not be kept.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

from beamsim.flow.trajectory import Trajectory
from beamsim.outcomes import Interrupted, Stop, check_stop, stop_requests


class ChunkObserver(ABC):
    """Evaluate one chunk after the other; each chunk when the next one arrives, or when the result is requested.

    For a motion of one chunk, slow evaluations therefore come after the values of the motion itself.

    Parameters
    ----------
    stop : polled during a march; if it returns True there is no result.
    """

    def __init__(self, stop: Stop) -> None:
        self._stop, self._interrupted = stop, False
        self._latest: Trajectory | None = None

    def add(self, chunk: Trajectory) -> None:
        """Pass the next chunk."""
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
            If this or an earlier chunk was not evaluated.
        """
        if self._interrupted:
            raise Interrupted
        if self._latest is not None:
            check_stop()
            self.evaluate(self._latest)
        self._latest = None

    @abstractmethod
    def evaluate(self, chunk: Trajectory) -> None:
        """Evaluate a chunk that follows the previous ones."""
