"""Examples of quantities that suit their keys, where the example of the dimension would mislead."""

from __future__ import annotations

_EXAMPLES = {
    "m": {
        "width": "50 mm", "thickness": "5 mm", "diameter": "20 mm", "outer_diameter": "20 mm", "wall_thickness": "2 mm",
        "web_thickness": "3 mm", "flange_thickness": "4 mm", "extreme_fibre": "6 mm", "height": "20 mm",
        "gap": "0.1 mm", "peak_displacement": "1 mm", "side": "30 mm", "y": "100 mm",
    },
    "s": {
        "rise": "0.5 ms", "fall": "0.5 ms", "minimum_rest": "1 ms", "longest_time": "1 s", "period": "0.1 s",
        "relaxation_time": "40 ms", "time": "5 ms",
    },
    "Hz": {
        "sample_rate": "20 kHz", "history_rate": "1 kHz", "resample": "2 kHz", "low_pass": "2 kHz",
        "highest_frequency": "2 kHz",
    },
    "N": {"preload": "5 N", "peak_force": "50 N", "force_threshold": "1 N"},
}  # fmt: skip
"""By the SI unit and the key."""


def example_of(key: str, unit: str) -> str | None:
    """How to write the quantity of a key, by its SI unit; None where the example of its dimension serves.

    >>> example_of("wall_thickness", "m")
    '2 mm'
    """
    return _EXAMPLES.get(unit, {}).get(key)
