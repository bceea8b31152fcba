"""Whether a picture can be read: what of its texts is cut off or covered, and which of its axes tell nothing."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from beamsim.plots.drawing import Picture, plain_text
from beamsim.typing import Floats

ROUND_OFF = 1.0  # pixel
TOUCHING = 2.0  # pixels that two tick labels may share: the box of a text is higher and wider than its letters


def faults(picture: Picture) -> list[str]:
    """What of a picture cannot be read at its own size, in words; nothing of a good one.

    Parameters
    ----------
    picture : of any kind.
    """
    with plain_text():
        figure = picture.figure()
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
    return [*_cut(figure, canvas.get_renderer()), *_covered(figure, canvas.get_renderer()), *_untold(figure)]


def _box(text: Text, renderer: Any) -> Bbox:
    text.get_window_extent(renderer)  # gives an annotation its place; with its leader, which may pass under texts
    return Text.get_window_extent(text, renderer)


def _corners(text: Text, renderer: Any) -> Floats:
    """(4, 2) pixels, of the box around the letters of a text, which may be turned."""
    outer, turn = _box(text, renderer), np.deg2rad(text.get_rotation())
    text.set_rotation(0.0)
    size = _box(text, renderer).size - 2.0 * TOUCHING
    text.set_rotation(np.rad2deg(turn))
    along = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    corners = 0.5 * size * [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
    return np.asarray(0.5 * (outer.min + outer.max) + corners @ along)


def _overlap(one: Floats, other: Floats) -> bool:
    """Whether two rectangles have a point in common: no side of either has them on its two sides."""
    sides = np.concatenate([one[1:3] - one[:2], other[1:3] - other[:2]])
    here, there = one @ sides.T, other @ sides.T
    return bool(np.all((here.max(axis=0) > there.min(axis=0)) & (there.max(axis=0) > here.min(axis=0))))


def _shown(text: Text) -> bool:
    return bool(text.get_visible() and text.get_text().strip())


def _ticks(ax: Axes) -> Iterator[list[Text]]:
    """Labels of the ticks within the ends of each axis of a panel."""
    for axis in (ax.xaxis, ax.yaxis):
        low, high = sorted(axis.get_view_interval())
        margin = 1e-9 * (high - low)
        labels = [
            tick.label1
            for tick in [*axis.get_major_ticks(), *axis.get_minor_ticks()]
            if low - margin <= tick.get_loc() <= high + margin
        ]
        yield [label for label in labels if _shown(label)] if ax.get_visible() and axis.get_visible() else []


def _texts(figure: Figure) -> list[Text]:
    """Every text that is drawn; of ticks those within their axis."""
    ticks = {id(text) for ax in figure.axes for axis in (ax.xaxis, ax.yaxis) for text in axis.findobj(Text)}
    ticks -= {id(axis.label) for ax in figure.axes for axis in (ax.xaxis, ax.yaxis)}
    others = [text for text in figure.findobj(Text) if id(text) not in ticks and _shown(text)]
    return [*others, *(label for ax in figure.axes for labels in _ticks(ax) for label in labels)]


def _cut(figure: Figure, renderer: Any) -> Iterator[str]:
    whole = figure.bbox.padded(ROUND_OFF)
    for text in _texts(figure):
        box = _box(text, renderer)
        if not (whole.x0 <= box.x0 and box.x1 <= whole.x1 and whole.y0 <= box.y0 and box.y1 <= whole.y1):
            yield f"{text.get_text()!r} is cut off"


def _covered(figure: Figure, renderer: Any) -> Iterator[str]:
    ticks = [labels for ax in figure.axes for labels in _ticks(ax)]
    of_ticks = {id(label) for labels in ticks for label in labels}
    others = [text for text in _texts(figure) if id(text) not in of_ticks]
    for texts in (*ticks, others):
        boxes = [(text.get_text(), _corners(text, renderer)) for text in texts]
        for (one, here), (other, there) in combinations(boxes, 2):
            if _overlap(here, there):
                yield f"{one!r} and {other!r} overlap"


def _untold(figure: Figure) -> Iterator[str]:
    """Panels without anything in them, and axes with numbers whose size no two of them tell."""
    for number, ax in enumerate(figure.axes):
        if not ax.get_visible():
            continue
        if not (ax.lines or ax.collections or ax.images or ax.patches or ax.containers):
            yield f"panel {number} is empty"
        for name, labels in zip("xy", _ticks(ax), strict=True):
            texts = [label.get_text() for label in labels]
            drawn = np.ptp(getattr(ax.dataLim, f"interval{name}"))  # nothing between: a single value is drawn
            if len(texts) == 1 and drawn > 0.0 and not ax.containers:
                yield f"panel {number}: {texts[0]!r} alone is on the {name} axis"
            if len(set(texts)) < len(texts):
                yield f"panel {number}: the {name} axis repeats a number: {texts}"
