"""Relaxed minimisation (Hazim 2010) compared with exact shooting, step by step."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from beamsim.analyses.nnm.result import NormalModeResult, RelaxedComparison
from beamsim.plots.drawing import DARK, HERTZ, RED, Chart, Curve, Guide, Picture, marked

_FACTOR = ("Stiffness factor ε", "")
_FATES = {
    "same": ("o", "near the backbone's motion"),
    "between": ("s", "where a tongue cuts the backbone"),
    "other": ("D", "near another motion"),
    "none": ("x", "near no periodic motion"),
}


def relaxed_figure(result: NormalModeResult) -> Picture:
    """Frequency, differences, functional and cost over the stiffness factor."""
    assert result.relaxed is not None
    relaxed = result.relaxed
    title = f"{result.title}\nrelaxed minimisation (Hazim 2010) and shooting"
    differences = (("frequency", relaxed.frequency_difference), ("shape at rest", relaxed.shape_difference))
    apart = [Curve(text, relaxed.factor, np.where(y > 0, y, np.nan), {"marker": "."}) for text, y in differences]
    missed = ~relaxed.reached
    functional = [Curve("at the end of a step", relaxed.factor, relaxed.functional, {"marker": "."})]
    if missed.any():
        places = np.stack([relaxed.factor, relaxed.functional], axis=1)[missed]
        functional.append(marked("not reached", places, marker="x", markersize=7))
    tolerance = Guide("tolerance", relaxed.tolerance, {"linewidth": 0.9, "linestyle": "--"})
    cost = (
        f"{relaxed.passages.sum()} motions, {relaxed.processor_time_s.sum():.2g} s; "
        f"shooting {relaxed.shooting_passages}, {relaxed.shooting_processor_time_s:.2g} s"
    )
    steps = [Curve("", relaxed.factor, relaxed.passages.astype(float), {"drawstyle": "steps-mid"})]
    charts = [
        Chart(_FACTOR, ("Frequency", HERTZ), list(_frequencies(result, relaxed)), of=""),
        Chart(_FACTOR, ("Difference from shooting", ""), apart, log="y"),
        Chart(_FACTOR, ("Functional", ""), functional, [tolerance], log="y"),
        Chart(_FACTOR, ("Motions computed in a step", ""), steps, title=cost, y_ends=(0.0, None)),
    ]
    return Picture(title, charts, columns=2, size=(9.0, 6.4), sharex=True)


def _frequencies(result: NormalModeResult, relaxed: RelaxedComparison) -> Iterator[Curve]:
    """Shooting's backbone and tongues, and the steps by what they are beside."""
    for k, branch in enumerate(b for b in result.branches if b.kind != "non_brake"):
        style = {"color": DARK if branch.kind == "backbone" else "0.6", "linestyle": "-"}
        yield Curve(("shooting", "shooting, tongues", "")[min(k, 2)], branch.parameter, branch.frequency_hz, style)
    steps = np.stack([relaxed.factor, relaxed.frequency_hz], axis=1)
    for fate, (mark, text) in _FATES.items():
        here = np.array([f == fate for f in relaxed.fate], dtype=bool)
        if here.any():
            marks = {"marker": mark, "markersize": 3.5, "color": RED, "markerfacecolor": "white"}
            yield marked(f"relaxed, {text}", steps[here], **marks)
