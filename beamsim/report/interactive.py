"""Figures of matplotlib as descriptions for plotly: every plot of the package becomes one that can be zoomed and read.

Curves, bars, areas, heat maps and labels of a figure keep colours, dashes, scales and limits; a figure that holds
something else is to be shown as it is, which `plotly_of` says with None. Curves of many points are thinned to what a
screen shows: the lowest and highest value of every few samples of a history, and points at equal distances along a
curve that turns back.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.typing import Floats, Ints

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_POINTS = 3000  # of a curve
PANEL, SINGLE = 270, 380  # px, height of one of several panels and of one alone
MOST_DECADES, MOST_POWERS = 3.0, 8  # of an axis with digits between powers of ten; labelled powers
_BARRED = 0.2  # share of the width between panels with colour bars
_GAP = (0.09, 70)  # between panels: share of the width, px
_MARKERS = {
    "o": "circle", ".": "circle", "s": "square", "^": "triangle-up", "v": "triangle-down", "D": "diamond",
    "d": "diamond-tall", "x": "x-thin", "+": "cross-thin", "*": "star", "|": "line-ns", "_": "line-ew",
    "6": "triangle-up", "7": "triangle-down", ">": "triangle-right", "<": "triangle-left",
}  # fmt: skip
_STEPS = {"steps-post": "hv", "steps-pre": "vh", "steps": "vh", "steps-mid": "hvh"}
_PIXEL = 96 / 72  # px in a point


def plotly_of(figure: Figure) -> dict[str, Any] | None:
    """Data and layout of a figure for plotly; None where it holds what has no counterpart (filled contours)."""
    panels = [ax for ax in figure.axes if ax.get_visible() and ax.get_label() != "<colorbar>"]
    if not panels or any(_unknown(ax) for ax in panels):
        return None
    rows, columns = _grid(panels)
    barred = any(ax.get_label() == "<colorbar>" for ax in figure.axes)
    height = SINGLE if rows == 1 else PANEL * rows
    layout: dict[str, Any] = {
        "height": height, "margin": {"l": 70, "r": 20, "t": 40, "b": 55}, "annotations": [], "shapes": [],
        "hovermode": "closest", "paper_bgcolor": "white", "plot_bgcolor": "white",
        "font": {"family": "system-ui, sans-serif", "size": 12, "color": "#222"},
        "legend": {"orientation": "h", "x": 0, "xanchor": "left", "y": 1.01, "yanchor": "bottom",
                   "font": {"size": 11}},
    }  # fmt: skip
    if any(_title(ax) for ax in panels):
        layout["legend"]["y"] = 1.0 + 20 / (height - 95)  # above the titles
    data: list[dict[str, Any]] = []
    for number, ax in enumerate(panels, 1):
        suffix = "" if number == 1 else str(number)
        _place(layout, ax, suffix, rows, columns, height, _BARRED if barred else _GAP[0])
        named = ax.get_legend() is not None
        for trace in _traces(ax):
            _fit_bar(trace, layout[f"xaxis{suffix}"]["domain"], layout[f"yaxis{suffix}"]["domain"])
            trace |= {"xaxis": f"x{suffix}", "yaxis": f"y{suffix}"}
            trace["showlegend"] = named and bool(trace.get("name"))
            if trace.get("name"):
                trace["legendgroup"] = trace["name"]
            data.append(trace)
        layout["shapes"] += list(_shapes(ax, suffix))
        layout["annotations"] += list(_annotations(ax, suffix))
    return {"data": data, "layout": layout}


def _unknown(ax: Axes) -> bool:
    from matplotlib.contour import ContourSet

    return ax.name != "rectilinear" or any(isinstance(c, ContourSet) and c.filled for c in ax.collections)


def _grid(panels: Sequence[Axes]) -> tuple[int, int]:
    specs: list[Any] = [ax.get_subplotspec() for ax in panels]
    if any(spec is None for spec in specs):
        return len(panels), 1
    rows, columns = specs[0].get_gridspec().get_geometry()
    return rows, columns


def _place(layout: dict[str, Any], ax: Axes, suffix: str, rows: int, columns: int, height: int, across: float) -> None:
    """Give a panel its axes and its share of the figure."""
    spec: Any = ax.get_subplotspec()
    row, column = (spec.rowspan.start, spec.colspan.start) if spec is not None else (int(suffix or 1) - 1, 0)
    down = _GAP[1] / (height - 95)
    room = across if across > _GAP[0] else 0.0  # to the right of the last one
    width = (1 - room - across * (columns - 1)) / columns
    tall = (1 - down * (rows - 1)) / rows
    left, top = column * (width + across), 1 - row * (tall + down)
    domains = ([left, left + width], [max(top - tall, 0.0), top])
    for letter, other, domain, axis, limits, scale, label in (
        ("x", "y", domains[0], ax.xaxis, ax.get_xlim(), ax.get_xscale(), ax.get_xlabel()),
        ("y", "x", domains[1], ax.yaxis, ax.get_ylim(), ax.get_yscale(), ax.get_ylabel()),
    ):
        limits = float(limits[0]), float(limits[1])
        logarithmic = scale == "log"
        layout[f"{letter}axis{suffix}"] = {
            "domain": domain, "anchor": f"{other}{suffix}", "title": {"text": plain(label), "standoff": 8},
            "type": "log" if logarithmic else "linear",
            "range": [math.log10(end) if logarithmic else end for end in limits],
            "showline": True, "linecolor": "#444", "gridcolor": "#e4e4e4", "zeroline": False, "ticks": "outside",
            "exponentformat": "power", "automargin": letter == "y",
            **(_decades(*limits) if logarithmic else {}), **_ticks(axis),
        }  # fmt: skip
    if title := _title(ax):
        layout["annotations"].append(
            {"text": plain(title), "xref": f"x{suffix} domain", "yref": f"y{suffix} domain", "x": 0.5, "y": 1.0,
             "yanchor": "bottom", "showarrow": False, "font": {"size": 12}}
        )  # fmt: skip


def _title(ax: Axes) -> str:
    return str(ax.get_title() or ax.get_title(loc="left"))


def _decades(low: float, high: float) -> dict[str, Any]:
    """Numbers on a logarithmic axis: 1, 2, 5 or all digits written out, powers of ten alone over many decades."""
    decades = math.log10(high / low)
    if decades > MOST_DECADES:
        return {"dtick": math.ceil(decades / MOST_POWERS)}
    return {"dtick": "D2" if decades > 1.0 else "D1", "tickformat": "~g"}


def _fit_bar(trace: dict[str, Any], across: Sequence[float], upright: Sequence[float]) -> None:
    """Put the colour bar of a trace beside its panel."""
    bar = trace.get("colorbar") or trace.get("marker", {}).get("colorbar")
    if bar is not None:
        bar |= {"x": across[1] + 0.008, "xanchor": "left", "y": sum(upright) / 2, "len": upright[1] - upright[0]}
        bar |= {"lenmode": "fraction", "tickfont": {"size": 10}}


def _ticks(axis: Any) -> dict[str, Any]:
    """Ticks that were set by hand: none, or those with texts."""
    from matplotlib.ticker import FixedFormatter, FixedLocator

    locator: Any = axis.get_major_locator()
    formatter = axis.get_major_formatter()
    if not isinstance(locator, FixedLocator):
        return {}
    ticks = [float(each) for each in locator()]
    if not ticks:
        return {"showticklabels": False, "ticks": "", "showgrid": False, "showline": False}
    if isinstance(formatter, FixedFormatter):
        return {"tickvals": ticks, "ticktext": [plain(text) for text in formatter.seq]}
    return {"tickvals": ticks}


def _traces(ax: Axes) -> Iterator[dict[str, Any]]:
    """Areas and heat maps first, so that curves lie on them."""
    for image in ax.images:
        yield _image(image)
    for collection in ax.collections:
        yield from _collection(collection)
    yield from _areas(ax)
    for line in sorted(ax.lines, key=lambda each: each.get_zorder()):
        if line.get_visible() and _in_data(ax, line) == (True, True):
            trace = _line(ax, line)
            if trace is not None:
                yield trace


def _in_data(ax: Axes, artist: Any) -> tuple[bool, bool]:
    """Whether x and y of what is drawn are data."""
    return tuple(artist.get_transform().contains_branch_seperately(ax.transData))


def _line(ax: Axes, line: Any) -> dict[str, Any] | None:
    x, y = (_filled(v) for v in line.get_data(orig=False))
    marker = _MARKERS.get(str(line.get_marker()))
    drawn = line.get_linestyle() not in ("None", "none", " ", "") and line.get_linewidth() > 0
    if x.size == 0 or not (marker or drawn):
        return None
    if drawn and line.get_drawstyle() == "default":
        keep = thinning(ax, x, y)
        x, y = x[keep], y[keep]
    trace: dict[str, Any] = {"type": "scatter", "mode": "+".join(["lines"] * drawn + ["markers"] * bool(marker))}
    trace |= {"x": numbers(x, 8), "y": numbers(y)}
    name = str(line.get_label())
    if not name.startswith("_"):
        trace["name"] = plain(name)
    colour = _colour(line.get_color(), line.get_alpha())
    if drawn:
        trace["line"] = {"color": colour, "width": round(max(line.get_linewidth() * _PIXEL, 1.0), 2)}
        dashes = getattr(line, "_unscaled_dash_pattern", (0, None))[1]
        if dashes is not None:
            lengths = [max(each * line.get_linewidth() * _PIXEL, 1.0) for each in dashes]
            trace["line"]["dash"] = ",".join(f"{each:.1f}px" for each in lengths)
        if line.get_drawstyle() in _STEPS:
            trace["line"]["shape"] = _STEPS[line.get_drawstyle()]
    if marker:
        edge = _colour(line.get_markeredgecolor(), line.get_alpha())
        thin = "thin" in marker or "line" in marker
        face = edge if thin else _colour(line.get_markerfacecolor(), line.get_alpha())
        trace["marker"] = {
            "symbol": marker, "size": round(line.get_markersize() * _PIXEL, 1), "color": face,
            "line": {"color": edge, "width": 1.2},
        }  # fmt: skip
    trace["hovertemplate"] = "%{x:.6~g}, %{y:.5~g}"
    return trace


def _areas(ax: Axes) -> Iterator[dict[str, Any]]:
    """Bars, polygons and steps, those of one colour together."""
    labels = {id(patch): container.get_label() for container in ax.containers for patch in container}
    areas: dict[tuple[str, str, str, float], list[Any]] = {}
    for patch in ax.patches:
        if not patch.get_visible() or _in_data(ax, patch) != (True, True):
            continue
        vertices = patch.get_patch_transform().transform_path(patch.get_path()).to_polygons(closed_only=False)
        label = str(labels.get(id(patch), patch.get_label()))
        edge = _colour(patch.get_edgecolor()) if patch.get_linewidth() else "rgba(0,0,0,0)"
        face = _colour(patch.get_facecolor()) if patch.get_fill() else "rgba(0,0,0,0)"
        key = ("" if label.startswith("_") else plain(label), face, edge, float(patch.get_linewidth()))
        areas.setdefault(key, []).extend(vertices)
    for (name, face, edge, width), polygons in areas.items():
        yield _area(polygons, name, face, edge, width)


def _area(polygons: Sequence[Any], name: str, face: str, edge: str, width: float) -> dict[str, Any]:
    xy = _joined(polygons)
    trace = {
        "type": "scatter", "mode": "lines", "fill": "toself", "fillcolor": face, "x": numbers(xy[:, 0], 8),
        "y": numbers(xy[:, 1]), "line": {"color": edge, "width": round(width * _PIXEL, 2)}, "hoverinfo": "x+y",
    }  # fmt: skip
    return trace | ({"name": name} if name else {})


def _joined(parts: Sequence[Any]) -> Floats:
    """(k, 2) polygons or lines one after the other, with a gap between them."""
    gap = np.full((1, 2), np.nan)
    return np.concatenate([each for part in parts for each in (part, gap)][:-1] or [gap])


def _collection(collection: Any) -> Iterator[dict[str, Any]]:
    from matplotlib.collections import LineCollection, PathCollection, PolyCollection, QuadMesh
    from matplotlib.contour import ContourSet

    if not collection.get_visible():
        return
    label = str(collection.get_label())
    name = "" if label.startswith("_") else plain(label)
    levels: Any = getattr(collection, "levels", ())
    if isinstance(collection, QuadMesh):
        yield _mesh(collection)
    elif isinstance(collection, ContourSet):
        colours, widths = collection.get_edgecolor(), np.atleast_1d(collection.get_linewidth())
        for k, path in enumerate(collection.get_paths()):
            if polygons := path.to_polygons(closed_only=False):
                colour, width = _colour(colours[k % len(colours)]), float(widths[k % len(widths)])
                yield {**_stroke(polygons, colour, width), "text": f"{levels[k]:.4g}", "hoverinfo": "text"}
    elif isinstance(collection, LineCollection):
        colours, widths = collection.get_edgecolor(), np.atleast_1d(collection.get_linewidth())
        trace = _stroke(collection.get_segments(), _colour(colours[0]), float(widths[0]))
        yield trace | ({"name": name} if name else {})
    elif isinstance(collection, PathCollection):
        yield _points(collection, name)
    elif isinstance(collection, PolyCollection):
        polygons = [vertices for path in collection.get_paths() for vertices in path.to_polygons(closed_only=False)]
        yield _area(polygons, name, _colour(collection.get_facecolor()[0]), "rgba(0,0,0,0)", 0.0)


def _stroke(segments: Sequence[Any], colour: str, width: float) -> dict[str, Any]:
    xy = _joined(segments)
    line = {"color": colour, "width": round(width * _PIXEL, 2)}
    return {"type": "scatter", "mode": "lines", "x": numbers(xy[:, 0], 8), "y": numbers(xy[:, 1]), "line": line}


def _points(collection: Any, name: str) -> dict[str, Any]:
    xy = np.ma.filled(collection.get_offsets(), np.nan)
    sizes = np.sqrt(np.atleast_1d(collection.get_sizes())) * _PIXEL
    marker: dict[str, Any] = {"size": round(float(sizes.max()), 1)}
    if collection.get_array() is not None:
        low, high = collection.get_clim()
        marker |= {"color": numbers(np.ma.filled(collection.get_array(), np.nan)), "cmin": low, "cmax": high}
        marker |= {"colorscale": _colour_scale(collection), "showscale": True, "colorbar": _bar(collection)}
    else:
        marker["color"] = _colour(collection.get_facecolor()[0])
    trace = {"type": "scatter", "mode": "markers", "x": numbers(xy[:, 0], 8), "y": numbers(xy[:, 1]), "marker": marker}
    return trace | ({"name": name} if name else {})


def _mesh(mesh: Any) -> dict[str, Any]:
    corners = np.asarray(mesh.get_coordinates())
    values = _filled(mesh.get_array())
    return _heat(mesh, corners[0, :, 0], corners[:, 0, 1], values.reshape(corners.shape[0] - 1, corners.shape[1] - 1))


def _image(image: Any) -> dict[str, Any]:
    values = _filled(image.get_array())
    left, right, bottom, top = image.get_extent()
    x, y = np.linspace(left, right, values.shape[1] + 1), np.linspace(top, bottom, values.shape[0] + 1)
    return _heat(image, x, y, values)


def _heat(mappable: Any, x: Floats, y: Floats, values: Floats) -> dict[str, Any]:
    low, high = mappable.get_clim()
    return {
        "type": "heatmap", "x": numbers(x, 8), "y": numbers(y, 8), "z": [numbers(row) for row in values],
        "zmin": low, "zmax": high, "colorscale": _colour_scale(mappable), "colorbar": _bar(mappable),
        "hovertemplate": "%{x:.6~g}, %{y:.6~g}: %{z:.5~g}<extra></extra>",
    }  # fmt: skip


def _bar(mappable: Any) -> dict[str, Any]:
    bar = mappable.colorbar
    label = "" if bar is None else bar.ax.get_ylabel() or bar.ax.get_xlabel()
    return {"title": {"text": plain(label), "side": "right"}, "thickness": 14, "outlinewidth": 0}


def _colour_scale(mappable: Any) -> list[list[Any]]:
    return [[float(share), _colour(mappable.cmap(share))] for share in np.linspace(0.0, 1.0, 11)]


def _shapes(ax: Axes, suffix: str) -> Iterator[dict[str, Any]]:
    """Lines and bands across a whole panel."""
    across: list[Any] = [
        each for each in (*ax.lines, *ax.patches) if each.get_visible() and _in_data(ax, each) != (True, True)
    ]
    for artist in across:
        in_x, in_y = _in_data(ax, artist)
        if in_x == in_y:
            continue
        line = hasattr(artist, "get_xdata")
        if line:
            x, y = (np.asarray(v, dtype=float) for v in artist.get_data(orig=False))
        else:
            x, y = artist.get_patch_transform().transform(artist.get_path().vertices).T
        shape: dict[str, Any] = {
            "type": "line" if line else "rect", "layer": "below", "xref": f"x{suffix}" if in_x else f"x{suffix} domain",
            "yref": f"y{suffix}" if in_y else f"y{suffix} domain",
            "x0": float(x.min()), "x1": float(x.max()), "y0": float(y.min()), "y1": float(y.max()),
        }  # fmt: skip
        if line:
            shape["line"] = {"color": _colour(artist.get_color(), artist.get_alpha()), "width": artist.get_linewidth()}
            shape["line"]["dash"] = {"-": "solid", ":": "dot"}.get(artist.get_linestyle(), "dash")
        else:
            shape |= {"fillcolor": _colour(artist.get_facecolor()), "line": {"width": 0}}
        if ax.get_legend() is not None and not str(artist.get_label()).startswith("_"):
            shape |= {"name": plain(str(artist.get_label())), "showlegend": True}
        yield shape


def _annotations(ax: Axes, suffix: str) -> Iterator[dict[str, Any]]:
    from matplotlib.text import Annotation

    texts: list[Any] = list(ax.texts)
    for text in texts:
        if not text.get_visible() or not text.get_text():
            continue
        note = isinstance(text, Annotation)
        in_data = text.xycoords == "data" if isinstance(text, Annotation) else _in_data(ax, text) == (True, True)
        x, y = text.xy if isinstance(text, Annotation) else text.get_position()
        if in_data and ax.get_xscale() == "log":
            x = math.log10(x) if x > 0 else 0.0
        if in_data and ax.get_yscale() == "log":
            y = math.log10(y) if y > 0 else 0.0
        described: dict[str, Any] = {
            "text": plain(text.get_text()), "x": float(x), "y": float(y), "showarrow": False,
            "xref": f"x{suffix}" if in_data else f"x{suffix} domain",
            "yref": f"y{suffix}" if in_data else f"y{suffix} domain",
            "xanchor": str(text.get_ha()),
            "yanchor": {"center_baseline": "middle", "baseline": "bottom", "center": "middle"}.get(
                str(text.get_va()), str(text.get_va())
            ),
            "font": {"size": round(max(float(text.get_size()) * 1.1, 9.0), 1), "color": _colour(text.get_color())},
        }  # fmt: skip
        if note and isinstance(text, Annotation) and text.anncoords == "offset points":
            right, up = (float(v) * _PIXEL for v in text.xyann)
            described |= {"xshift": round(right, 1), "yshift": round(up, 1)}
        yield described


def _filled(values: Any) -> Floats:
    """Masked values become nan."""
    filled: Floats = np.ma.filled(np.ma.asarray(values, dtype=float), np.nan)
    return filled


def thinning(ax: Axes, x: Floats, y: Floats) -> Ints:
    """Numbers of the points that draw the same curve on a screen."""
    if x.size <= MOST_POINTS:
        return np.arange(x.size)
    finite = np.isfinite(x) & np.isfinite(y)
    if np.all(finite) and np.all(np.diff(x) >= 0.0):
        length = -(-2 * x.size // MOST_POINTS)
        whole = x.size // length * length
        blocks, first = y[:whole].reshape(-1, length), np.arange(whole // length) * length
        ends = np.append(0, np.arange(min(whole, x.size - 1), x.size))
        return np.unique(np.concatenate([first + blocks.argmin(axis=1), first + blocks.argmax(axis=1), ends]))
    spans = [max(abs(high - low), 1e-300) for low, high in (ax.get_xlim(), ax.get_ylim())]
    steps = np.hypot(np.diff(np.where(finite, x, 0.0)) / spans[0], np.diff(np.where(finite, y, 0.0)) / spans[1])
    steps = np.where(finite[1:] & finite[:-1], steps, 0.0)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    number = np.floor(along / (along[-1] or 1.0) * MOST_POINTS)
    keep = np.concatenate([[True], np.diff(number) > 0])
    edge = np.concatenate([[False], finite[1:] != finite[:-1]])  # both sides of a gap
    keep |= edge | np.concatenate([edge[1:], [True]])
    return np.flatnonzero(keep)


def numbers(values: Floats, digits: int = 6) -> list[float | None]:
    """Plain numbers with so many digits; None where there is none."""
    return [float(f"{value:.{digits}g}") if math.isfinite(value) else None for value in np.asarray(values, float)]


def _colour(colour: Any, alpha: float | None = None) -> str:
    from matplotlib.colors import to_rgba

    red, green, blue, opacity = to_rgba(colour, alpha)
    parts = ",".join(str(round(255 * part)) for part in (red, green, blue))
    return f"rgb({parts})" if opacity == 1.0 else f"rgba({parts},{opacity:.3g})"


def plain(text: str) -> str:
    """A text for plotly, which reads a little HTML."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace("\n", "<br>")
