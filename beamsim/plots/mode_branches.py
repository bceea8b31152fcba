"""Branches of nonlinear normal modes: backbone curve and frequency–energy plot."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from beamsim.analyses.branch import ModeBranch
from beamsim.analyses.nnm.result import NormalModeResult
from beamsim.plots.branches import explain_dashes, mark_special, plot_branch
from beamsim.plots.drawing import curve_style, finish, legend, name_beside
from beamsim.plots.style import scale_for
from beamsim.typing import Floats

Curve = tuple[Floats, Floats]

WIDE = 20.0  # ratio of the largest to the smallest amplitude that asks for a logarithmic axis
DECADE = 10.0  # the same of the energies: a logarithmic axis has no room for its numbers below

BRANCH_NAMES = {
    "backbone": "backbone",
    "tongue": "tongue of internal resonance",
    "non_brake": "non-brake orbits",
}
_STYLES = {"backbone": (0, 1.4), "tongue": (1, 1.0), "non_brake": (2, 1.4)}  # colour, width


def plot_backbone(result: NormalModeResult, ax: Axes) -> Axes:
    """Frequency over the stiffness factor, or largest deflection over frequency where energy or frequency changes.

    Unstable stretches are dashed, tongues named, jumps grey, special points marked.
    """
    if result.parameter == "stiffness_factor":
        _branches(ax, result, [(b.parameter, b.frequency_hz) for b in result.branches])
        finish(ax, "Stiffness factor ε", "Frequency (Hz)")
    else:
        largest = [np.abs(b.initial_displacement).max(axis=1) for b in result.branches]
        scale = scale_for("m", *largest)
        if float(np.max(largest[0])) > WIDE * float(np.min(largest[0])):
            ax.set_yscale("log")
        curves = [(b.frequency_hz, y * scale.factor) for b, y in zip(result.branches, largest, strict=True)]
        _branches(ax, result, curves)
        finish(ax, "Frequency (Hz)", f"Largest deflection at the extreme ({scale.unit})")
    legend(ax)
    return ax


def plot_frequency_energy(result: NormalModeResult, ax: Axes) -> Axes:
    """Frequency–energy plot, drawn likewise."""
    if float(np.max(result.backbone.energy)) > DECADE * float(np.min(result.backbone.energy)):
        ax.set_xscale("log")
    _branches(ax, result, [(b.energy, b.frequency_hz) for b in result.branches])
    finish(ax, "Energy (J)", "Frequency (Hz)")
    legend(ax)
    return ax


def _branches(ax: Axes, result: NormalModeResult, curves: list[Curve]) -> None:
    """Every branch as a curve, the backbone cut at its jumps, with marks and names."""
    _jumps(ax, result, curves[0])
    named: set[str] = set()
    dashed = False
    for branch, (x, y) in zip(result.branches, curves, strict=True):
        text = BRANCH_NAMES[branch.kind]
        colour, width = _STYLES[branch.kind]
        label = "_nolegend_" if text in named else text
        named.add(text)
        cuts = _cuts(result) if branch.kind == "backbone" else np.zeros(0, dtype=int)
        x, y, stable = np.insert(x, cuts, np.nan), np.insert(y, cuts, np.nan), np.insert(branch.stable, cuts, True)
        plot_branch(ax, x, y, stable, color=curve_style(colour)["color"], width=width, label=label)
        dashed = dashed or not bool(branch.stable.all())
    if dashed:
        explain_dashes(ax)
    _marks(ax, result, curves)
    _name_tongues(ax, result, curves)


def _at(branch: ModeBranch, parameter: float) -> int:
    """The point of a branch closest to a parameter."""
    return int(np.argmin(np.abs(branch.parameter - parameter)))


def _jumps(ax: Axes, result: NormalModeResult, curve: Curve) -> None:
    for k, jump in enumerate(result.jumps):
        ends = [_at(result.backbone, p) for p in (jump.start, jump.end)]
        ax.plot(
            curve[0][ends], curve[1][ends], color="0.5", linewidth=2.6, alpha=0.5, solid_capstyle="butt", zorder=0,
            label="_nolegend_" if k else "jump over a tongue",
        )  # fmt: skip


def _cuts(result: NormalModeResult) -> NDArray[np.int_]:
    """Places in the backbone before which a jump ends."""
    return np.unique([_at(result.backbone, jump.start) + 1 for jump in result.jumps]).astype(int)


def _marks(ax: Axes, result: NormalModeResult, curves: list[Curve]) -> None:
    """Special points, each on the branch that it is closest to (some lie on tongues)."""
    special = result.backbone.special
    for kind in dict.fromkeys(e.kind for e in special):
        places = []
        for event in (e for e in special if e.kind == kind):
            off = [
                np.abs(b.frequency_hz / event.frequency_hz - 1.0)
                + np.abs(b.parameter - event.parameter) / max(float(np.ptp(result.backbone.parameter)), 1e-300)
                for b in result.branches
            ]
            which = int(np.argmin([float(o.min()) for o in off])) if kind == "symmetry_breaking" else 0
            k = int(np.argmin(off[which]))
            places.append((float(curves[which][0][k]), float(curves[which][1][k])))
        mark_special(ax, kind, places)


def _name_tongues(ax: Axes, result: NormalModeResult, curves: list[Curve]) -> None:
    """n:m beside every resonance, each once."""
    x, y = curves[0]
    places: dict[str, tuple[float, float]] = {}
    for jump in result.jumps:
        if jump.ratio and jump.mode:
            at = _at(result.backbone, jump.start)
            places.setdefault(f"{jump.ratio}:1, mode {jump.mode}", (float(x[at]), float(y[at])))
    name_beside(ax, places)
