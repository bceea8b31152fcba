"""Collects figures of the package that differ from those computed apart."""

import numpy as np

CLOSE = 1e-6  # of the largest value of the quantity
JUMPY = 3e-6  # the same of accelerations, whose parabolas are coarser


class Compared:
    """Counts figures and collects what differs."""

    def __init__(self, what=""):
        self.count, self.differences, self.what = 0, [], what

    def __call__(self, name, theirs, ours, scale=None, close=CLOSE):
        theirs, ours = np.asarray(theirs, dtype=float), np.asarray(ours, dtype=float)
        scale = np.abs(ours).max(initial=0.0) if scale is None else scale
        self.count += theirs.size
        bad = ~(np.abs(theirs - ours) <= close * max(scale, 1e-300))
        if bad.any():
            pair = (theirs, ours) if theirs.size < 4 else (theirs[bad][0], np.broadcast_to(ours, bad.shape)[bad][0])
            self.differences.append(f"{self.what} {name}: {pair[0]} instead of {pair[1]}".strip())

    def add(self, other):
        """What another one has compared."""
        self.count += other.count
        self.differences += other.differences
