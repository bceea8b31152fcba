"""Result of a comparison of mode shapes."""

from __future__ import annotations

import numpy as np

from beamsim.analyses.result import Result
from beamsim.fields import Counter, Entry, attribute, dataset, declared, stored
from beamsim.typing import Floats, Ints

_MEASURED = Counter("measured", "number of the measured mode")
_PREDICTED = Counter("predicted", "number of the computed mode")
UNPAIRED = 0.2  # largest MAC of a pair that is none


@declared(along=(_MEASURED,))
class ModeComparison(Result):
    """Result of ``beamsim compare-modes``."""

    SUMMARY = (
        Entry("pairs", "", "by measured mode: number, measured_hz, predicted (0 where no mode fits), predicted_hz, "
                 "difference (relative, of the prediction), mac", "modes"),
        Entry("lowest_mac", "1", "smallest MAC of the pairs, 0 where a mode has no partner", "lowest MAC"),
        Entry("largest_difference", "1", "largest relative difference of a paired frequency",
                 "largest difference of frequency"),
    )  # fmt: skip

    contacts: str = attribute("", "open or closed: how the snubbers are in the computed modes")
    source: str = attribute("", "file of the measured shapes")
    measured_hz: Floats = dataset("Hz", "measured natural frequency")
    predicted_hz: Floats = dataset("Hz", "computed natural frequency", along=(_PREDICTED,))
    mac: Floats = dataset(
        "1", "modal assurance criterion |m^H p|^2 / (m^H m p^T p) of measured and computed shapes at the places",
        along=(_MEASURED, _PREDICTED),
    )  # fmt: skip
    auto_mac: Floats = dataset(
        "1", "MAC of computed shapes with each other: near 1 off the diagonal, the places cannot tell them apart",
        along=(_PREDICTED, Counter("other", "number of the other computed mode")),
    )  # fmt: skip
    paired: Ints = dataset("1", "number of the computed mode of each measured one, 0 where none fits")

    @property
    @stored(dataset("1", "computed over measured frequency less 1; NaN where no mode fits"))
    def difference(self) -> Floats:
        """(m,) relative difference of the frequencies of each pair."""
        has_pair = self.paired > 0
        computed = np.where(has_pair, self.predicted_hz[np.maximum(self.paired, 1) - 1], np.nan)
        return np.asarray(computed / self.measured_hz - 1.0)
