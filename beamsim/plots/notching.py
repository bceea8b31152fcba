"""The notched level of a sweep over frequency, and the responses with the limits that govern it."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from beamsim.analyses.sweep.result import NotchLimit, SweepCurve
from beamsim.plots.drawing import DARK, RED, Curve, Guide, draw_curves, frequency_axis, legend, panels
from beamsim.plots.style import Scale
from beamsim.scenario.limits import limited_quantity
from beamsim.typing import Floats

MOST_LIMITS = 4  # drawn, those with the largest shares
_FREQUENCY = ("", Scale(1.0, ""))  # the last panel has its label


def plot_notched_level(curve: SweepCurve, ax: Axes) -> Axes:
    """The level with and without notches, and the ranges in which it is lowered."""
    notching = curve.notching
    assert notching is not None
    drawn = [
        Curve("specified", notching.frequency_hz, notching.specified, {"color": "0.5", "linestyle": "--"}),
        Curve("notched", notching.frequency_hz, notching.level, {"color": DARK, "linestyle": "-", "linewidth": 1.4}),
    ]
    draw_curves(ax, _FREQUENCY, ("Level", notching.unit), drawn)
    ax.set_yscale("log")
    ax.yaxis.set_major_formatter("{x:g}")
    return ax


def plot_limited_response(curve: SweepCurve, limit: NotchLimit, ax: Axes) -> Axes:
    """Largest magnitude of a limited quantity in every cycle, with its limit; shaded where it governs."""
    assert curve.notching is not None
    order = np.argsort(curve.frequency_hz)
    peak = limited_peak(curve, limit.name)[order]
    level = Guide("limit", limit.limit, {"color": RED, "linestyle": (0, (5, 1.5)), "linewidth": 1.4})
    words = limit.name.replace("probes.", "").replace("snubbers.", "").replace(".", " ")
    response = [Curve("", curve.frequency_hz[order], peak, {"linewidth": 1.0})]
    _, scale = draw_curves(ax, _FREQUENCY, (words, limit.unit), response, [level])
    governed = [part for part in curve.notching.ranges if part.limit == limit.name]
    for number, part in enumerate(governed):
        ax.axvspan(part.from_hz, part.to_hz, color="0.86", linewidth=0, zorder=0,
                   label="_nolegend_" if number else "governs")  # fmt: skip
    legend(ax)
    ax.set_ylim(0.0, 1.25 * max(limit.limit, float(np.nanmax(peak))) * scale.factor)
    return ax


def limited_peak(curve: SweepCurve, name: str) -> Floats:
    """(C,) largest magnitude in each cycle of what a limit of ``sweep.notch_to`` applies to."""
    forces = [n for n, o in curve.outputs.items() if o.quantity == "reaction_force" and o.at == "base"]
    of = limited_quantity(name, *forces[:1])
    assert of is not None
    return curve.envelope_of(of.section, of.item, of.quantity).peak


def notching_figure(curve: SweepCurve, title: str) -> Figure:
    """Level and limited responses over frequency, one above the other."""
    assert curve.notching is not None
    limits = sorted(curve.notching.limits, key=lambda limit: -limit.share)[:MOST_LIMITS]
    figure, axes = panels(title, 1 + len(limits), size=(8.0, 2.6 + 2.2 * len(limits)), sharex=True)
    plot_notched_level(curve, axes[0])
    for limit, ax in zip(limits, axes[1:], strict=True):
        plot_limited_response(curve, limit, ax)
    frequency_axis(axes[-1], float(curve.frequency_hz.min()), float(curve.frequency_hz.max()))
    axes[-1].set_xlabel(f"Excitation frequency (Hz), {curve.direction}")
    return figure
