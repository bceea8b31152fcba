"""The processor time that a solver uses, without what it takes to compile its kernels when they are first called."""

from __future__ import annotations

import threading
import time as clock


class Stopwatch:
    """The processor time of something that may begin again within itself, as one compilation calls for others."""

    def __init__(self) -> None:
        self.spent, self._begun, self._depth = 0.0, 0.0, 0  # s, s
        self._lock = threading.Lock()

    def start(self) -> None:
        """Begin, or begin again within."""
        with self._lock:
            self._begun = self._begun if self._depth else clock.process_time()
            self._depth += 1

    def stop(self) -> None:
        """End what was begun last."""
        with self._lock:
            self._depth -= 1
            self.spent += 0.0 if self._depth else clock.process_time() - self._begun


COMPILATION = Stopwatch()


def processor_time() -> float:
    """s, that this process has used, compilation apart: differences are those of a solver."""
    return clock.process_time() - COMPILATION.spent
