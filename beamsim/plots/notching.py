"""The notched level of a sweep over frequency, and the responses with the limits that govern it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from beamsim.analyses.sweep.result import NotchLimit, SweepCurve
from beamsim.plots.style import finish, put_title, scale_for
from beamsim.scenario.notching import limited_quantity

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from beamsim.typing import Floats

MOST_LIMITS = 4  # drawn, those with the largest shares
_LEVEL, _RESPONSE, _LIMIT, _GOVERNED = "#0b3c5d", "#0b3c5d", "#d1495b", "0.86"


def plot_notched_level(curve: SweepCurve, ax: Axes) -> Axes:
    """The level with and without notches, and the ranges in which it is lowered."""
    notching = curve.notching
    assert notching is not None
    scale = scale_for(notching.unit, notching.level)
    ax.plot(notching.frequency_hz, notching.specified * scale.factor, color="0.5", linestyle="--", label="specified")
    ax.plot(notching.frequency_hz, notching.level * scale.factor, color=_LEVEL, linewidth=1.4, label="notched")
    ax.set_yscale("log")
    ax.yaxis.set_major_formatter("{x:g}")
    unit = f" ({scale.unit})" if scale.unit else ""
    finish(ax, "", f"Level{unit}")
    ax.legend(loc="best", frameon=False, fontsize="small")
    return ax


def plot_limited_response(curve: SweepCurve, limit: NotchLimit, ax: Axes) -> Axes:
    """Largest magnitude of a limited quantity in every cycle, with its limit; shaded where it governs."""
    assert curve.notching is not None
    order = np.argsort(curve.frequency_hz)
    peak = limited_peak(curve, limit.name)[order]
    scale = scale_for(limit.unit, np.append(peak, limit.limit))
    ax.plot(curve.frequency_hz[order], peak * scale.factor, color=_RESPONSE, linewidth=1.0)
    ax.axhline(limit.limit * scale.factor, color=_LIMIT, linestyle=(0, (5, 1.5)), linewidth=1.4, label="limit")
    governed = [part for part in curve.notching.ranges if part.limit == limit.name]
    for number, part in enumerate(governed):
        ax.axvspan(part.from_hz, part.to_hz, color=_GOVERNED, linewidth=0, zorder=0,
                   label="governs" if number == 0 else None)  # fmt: skip
    unit = f" ({scale.unit})" if scale.unit else ""
    finish(ax, "", f"{limit.name.replace('probes.', '').replace('snubbers.', '').replace('.', ' ')}{unit}")
    ax.set_ylim(0.0, 1.25 * max(limit.limit, float(np.nanmax(peak))) * scale.factor)
    ax.legend(loc="upper right", frameon=False, fontsize="small", ncols=2)
    return ax


def limited_peak(curve: SweepCurve, name: str) -> Floats:
    """(C,) largest magnitude in each cycle of what a limit of ``sweep.notch_to`` applies to."""
    forces = [n for n, o in curve.outputs.items() if o.quantity == "reaction_force" and o.at == "base"]
    of = limited_quantity(name, *forces[:1])
    assert of is not None
    return curve.envelope_of(of.section, of.item, of.quantity).peak


def notching_figure(curve: SweepCurve, title: str, frequency_axis: Callable[[Axes], None]) -> Figure:
    """Level and limited responses over frequency, one above the other."""
    from matplotlib.figure import Figure

    assert curve.notching is not None
    limits = sorted(curve.notching.limits, key=lambda limit: -limit.share)[:MOST_LIMITS]
    figure = Figure(figsize=(8.0, 2.6 + 2.0 * len(limits)), layout="constrained")
    if title:
        put_title(figure, title)
    axes = list(figure.subplots(1 + len(limits), 1, sharex=True, squeeze=False).ravel())
    plot_notched_level(curve, axes[0])
    for limit, ax in zip(limits, axes[1:], strict=True):
        plot_limited_response(curve, limit, ax)
    for ax in axes:
        frequency_axis(ax)
    axes[-1].set_xlabel(f"Excitation frequency (Hz), {curve.direction}")
    return figure
