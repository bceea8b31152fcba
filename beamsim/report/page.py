"""HTML page about one result, which is self-contained and needs no network.

The first two printed pages are for a customer: verdict, question, model and limits; then summary, three pictures, and
reliability. An appendix follows. The plotting library is embedded once, compressed.
"""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from html import escape
from importlib.resources import files
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from beamsim.errors import MethodError, visible
from beamsim.plots.animation import Scene
from beamsim.plots.drawing import Picture, write


@dataclass(frozen=True)
class PageVerdict:
    """Verdict at the top of the page."""

    kind: str  # good, bad, doubt, or empty without a verdict
    text: str
    reasons: Sequence[str] = ()


@dataclass(frozen=True)
class Cells:
    """Table with a heading; cells that begin with a sign of `MARKS` are coloured."""

    heading: Sequence[str]
    rows: Sequence[Sequence[str]]
    title: str = ""


POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
"""Content security policy: a browser loads only what is in the page."""
NOTE = (
    "Deflection relative to the base, magnified to the scale shown, with the shape functions of the model; slow around "
    "contact. A stop is red and thick while it presses."
)
MARKS = {"+ ": "good-cell", "! ": "bad-cell"}


@dataclass
class Page:
    """Contents of a page, with sections in the order of their addition."""

    title: str
    about: str
    verdict: PageVerdict
    sections: list[tuple[str, str]] = field(default_factory=list)  # heading and HTML
    plots: list[dict[str, Any]] = field(default_factory=list)
    animation: dict[str, Any] | None = None
    appendix: str = ""  # heading of its first section

    def add(self, heading: str, *parts: str) -> None:
        """Add a section of HTML parts, unless all are empty."""
        if any(parts):
            self.sections.append((heading, "\n".join(part for part in parts if part)))

    def plot(self, name: str, panels: Sequence[dict[str, Any]], columns: int) -> str:
        """Zoomable plots in a number of columns, from their plotly descriptions."""
        first = len(self.plots)
        self.plots += panels
        places = "".join(
            f'<div id="plot-{first + k}" style="height:{panel["layout"]["height"]}px"></div>'
            for k, panel in enumerate(panels)
        )
        return caption_plot(name, f'<div class="pair">{places}</div>' if columns > 1 else places)

    def animated(self, scene: dict[str, Any], caption: str) -> str:
        """Canvas that plays a scene (one per page), as HTML."""
        self.animation = scene
        return player_html(scene, caption)

    def html(self) -> str:
        """Complete page."""
        marks = "".join(f'<a href="#s{k}">{escape(name)}</a>' for k, (name, _) in enumerate(self.sections))
        reasons = "".join(f"<li>{escape(text)}</li>" for text in self.verdict.reasons)
        body = [
            f"<h1>{escape(self.title)}</h1>",
            f'<p class="about">{escape(self.about)}</p>',
            f'<div class="verdict {self.verdict.kind}"><strong>{escape(self.verdict.text)}</strong>'
            f"{f'<ul>{reasons}</ul>' if reasons else ''}</div>",
            f"<nav>{marks}</nav>",
            *(_section(k, name, html, name == self.appendix) for k, (name, html) in enumerate(self.sections)),
            "<noscript><p>The plots and the animation need JavaScript.</p></noscript>",
        ]
        data = {"plots": self.plots, "animation": self.animation}
        scripts = [
            f'<script type="application/json" id="data">{script_json(data)}</script>',
            *([f'<script type="text/plain" id="plotly">{plotly()}</script>'] if self.plots else []),
            f"<script>{asset('player.js')}</script>",
            f"<script>{asset('page.js' if self.plots else 'animation.js')}</script>",
        ]
        return document(self.title, "<main>" + "\n".join(body) + "</main>", scripts)


def _section(number: int, name: str, html: str, first_of_appendix: bool) -> str:
    title = '<h1 class="appendix">Appendix</h1>' if first_of_appendix else ""
    style = name.lower().replace(" ", "-")
    return f'{title}<section id="s{number}" class="{style}"><h2>{escape(name)}</h2>\n{html}</section>'


def document(title: str, body: str, scripts: Iterable[str]) -> str:
    """An HTML file with the style of reports.

    Parameters
    ----------
    title : of the page.
    body, scripts : HTML; the scripts follow the body.

    Returns
    -------
    Text of the file.
    """
    page = "\n".join(
        [
            "<!DOCTYPE html>",
            f'<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>',
            f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1"><link rel="icon" href="data:,">',
            f"<style>{asset('page.css')}</style></head><body>",
            body, *scripts, "</body></html>", "",
        ]
    )  # fmt: skip
    return visible(page)


def player_html(scene: Mapping[str, Any], note: str) -> str:
    """HTML of the canvas and its controls."""
    left, right, low, high = scene["limits"]
    height = round(min(max(560 * (high - low) / 2.2, 260), 700))
    if scene["in_space"]:  # one scale for both axes
        height = round(1000 * (high - low) / (right - left))
    speeds = "".join(
        f'<option value="{value}"{" selected" if value == 1 else ""}>{value} x</option>'
        for value in (0.25, 0.5, 1, 2, 4)
    )
    return (
        f'<canvas id="animation" width="1000" height="{height}"></canvas>'
        '<div class="controls"><button id="play" type="button">Pause</button>'
        '<input id="position" type="range" min="0" value="0" aria-label="Frame">'
        f'<select id="pace" aria-label="Speed">{speeds}</select></div><p class="note">{escape(note)}</p>'
    )


def animation_page(scene: Scene) -> str:
    """Self-contained HTML file of an animation."""
    described = scene.as_json()
    body = f"<main><h1>{escape(scene.title or 'Motion')}</h1>{player_html(described, NOTE)}</main>"
    data = script_json({"plots": [], "animation": described})
    scripts = [
        f'<script type="application/json" id="data">{data}</script>',
        *(f"<script>{asset(name)}</script>" for name in ("player.js", "animation.js")),
    ]
    return document(scene.title, body, scripts)


def table(cells: Cells) -> str:
    """HTML of a table."""
    title = f"<h3>{escape(cells.title)}</h3>" if cells.title else ""
    heading = "".join(f"<th>{escape(text)}</th>" for text in cells.heading)
    rows = "".join("<tr>" + "".join(_cell(text) for text in row) + "</tr>" for row in cells.rows)
    return f'{title}<div class="wide"><table><tr>{heading}</tr>{rows}</table></div>' if cells.rows else ""


def _cell(text: str) -> str:
    mark = next((style for sign, style in MARKS.items() if text.startswith(sign)), "")
    shown = escape(text[2:] if mark else text)
    return f'<td class="text {mark}">{shown}</td>' if mark else f'<td class="text">{shown}</td>'


def label_rows(rows: Iterable[tuple[str, str]]) -> str:
    """HTML of the rows (label and text) of a printed table."""
    lines = "".join(
        f'<tr><td class="label">{escape(label)}</td><td class="text">{escape(text)}</td></tr>' for label, text in rows
    )
    return f'<div class="wide"><table>{lines}</table></div>' if lines else ""


def preformatted_html(text: str) -> str:
    """HTML of preformatted text."""
    return f"<pre>{escape(text)}</pre>"


def picture(drawn: Picture, name: str) -> str:
    """HTML of an embedded picture."""
    stream = BytesIO()
    write(drawn, stream)
    coded = base64.b64encode(stream.getvalue()).decode()
    return f'<img alt="{escape(name.replace("_", " "))}" src="data:image/png;base64,{coded}">'


def caption_plot(name: str, html: str) -> str:
    """HTML of a plot with its caption."""
    words = "Shock response spectra" if name == "srs" else name.replace("_", " ").capitalize()
    return f"<figure><figcaption>{escape(words)}</figcaption>{html}</figure>"


def script_json(data: Any) -> str:
    """JSON that is safe inside a script element; arrays have five decimals."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False, default=lambda array: np.round(array, 5).tolist())
    return text.replace("<", "\\u003c").replace(">", "\\u003e")  # no end or comment of a script, nor ]]>


@cache
def asset(name: str) -> str:
    """Text of a style or script file of this package."""
    return (files("beamsim.report") / name).read_text(encoding="utf-8")


@cache
def plotly() -> str:
    """The library that draws the plots, compressed, as text.

    Raises
    ------
    MethodError
        If it is not installed.
    """
    spec = find_spec("plotly")  # without a slow import
    folders = [] if spec is None else list(spec.submodule_search_locations or ())
    for folder in folders:
        script = Path(folder) / "package_data" / "plotly.min.js"
        if script.is_file():
            return base64.b64encode(gzip.compress(script.read_bytes(), 9, mtime=0)).decode()
    raise MethodError(
        "report", "needs the package plotly, whose script draws the plots", "pip install 'beamsim[report]'"
    )
