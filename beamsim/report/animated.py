"""A page that shows an animation alone."""

from __future__ import annotations

from html import escape

from beamsim.plots.animation import Scene
from beamsim.report.page import asset, document, embedded, player_html

NOTE = (
    "Deflection relative to the base, magnified to the scale shown, with the shape functions of the model; slow around "
    "contact. A stop is red and thick while it presses."
)


def animation_page(scene: Scene) -> str:
    """The HTML file, which opens without a network."""
    described = scene.as_json()
    body = f"<main><h1>{escape(scene.title or 'Motion')}</h1>{player_html(described, NOTE)}</main>"
    data = embedded({"plots": [], "animation": described})
    scripts = [
        f'<script type="application/json" id="data">{data}</script>',
        *(f"<script>{asset(name)}</script>" for name in ("player.js", "animation.js")),
    ]
    return document(scene.title, body, scripts)
