"""Charts of the response to a random or measured input."""

from __future__ import annotations

import numpy as np

from beamsim.analyses.run.result import RandomResponse
from beamsim.plots.drawing import MOST_CURVES, PALE, Chart, Curve, curve_style
from beamsim.plots.style import ROUND_OFF, Scale, scale_for
from beamsim.typing import Bools

DENSITY_SHOWN = 1e-7  # of the largest density, below which nothing is shown
POWER_SHOWN = 1e-3  # of the input's largest density, below which a transmissibility is that of leakage and round-off
_FREQUENCY = ("Frequency", "Hz")


def density(response: RandomResponse, note: str = "") -> Chart:
    """Spectral densities of the input and of the absolute accelerations of the probes (displacements under a force).

    Thick grey lines are those of the linear structures with every snubber always open and always closed.
    """
    on_base = response.input.unit == "m/s^2"
    quantity = "absolute_acceleration" if on_base else "displacement"
    drawn = [*([response.input] if on_base else []), *(s for s in response.signals if s.quantity == quantity)]
    unit = scale_for("m/s^2" if on_base else "m", *(np.sqrt(s.density[1:]) for s in drawn))
    squared = f"({unit.unit})²" if "/" in unit.unit else f"{unit.unit}²"
    f, top = response.frequency_hz[1:], max((float(np.max(s.density[1:])) for s in drawn), default=0.0)
    curves = [
        Curve(s.name if np.any(s.density[1:] > DENSITY_SHOWN * top) else f"{s.name} (over before)", f, s.density[1:])
        for s in drawn
    ]
    linear = []
    for signal in [s for s in drawn[:MOST_CURVES] if s.density_open is not None][:1]:
        for name, dashes in (("open", "-"), ("closed", "-.")):
            value = np.asarray(getattr(signal, f"density_{name}"))[1:]
            style = {"color": PALE, "linewidth": 2.2, "linestyle": dashes, "zorder": 1}
            words = f"{signal.name}, linear, always {name}"
            linear.append(Curve(words, f, np.where(value > 0.0, value, np.nan), style))
    up = (f"{'Acceleration' if on_base else 'Displacement'} density", Scale(unit.factor**2, f"{squared}/Hz"))
    chart = Chart(_FREQUENCY, up, curves, log="xy", of="signals", marks=linear, note=note)
    if not top > 0:
        return chart
    last = f[np.max([s.density[1:] for s in drawn], axis=0) >= top * DENSITY_SHOWN][-1] * 1.1
    room = 300.0 if note else 3.0  # above the curves
    return chart._replace(x_ends=(float(f[0]), float(last)), y_ends=(top * DENSITY_SHOWN, room * top))


def has_transmissibility(response: RandomResponse) -> bool:
    """Whether the input has power: a shock may be over before the part of the run that the densities are of."""
    return bool(response.transmissibility) and bool(np.any(_driven(response)))


def _driven(response: RandomResponse) -> Bools:
    """(nf,) where a transmissibility is not one of leakage and round-off."""
    power = response.input.density
    return np.asarray((power > max(POWER_SHOWN * power.max(), ROUND_OFF**2)) & (response.frequency_hz > 0.0))


def transmissibility(response: RandomResponse) -> Chart:
    """Magnitude of response over input, with gaps where the input has no power; lines are those of the densities."""
    driven, on_base = _driven(response), response.input.unit == "m/s^2"
    curves = [
        Curve(name, response.frequency_hz, np.where(driven, np.abs(value), np.nan), curve_style(k))
        for k, (name, value) in enumerate(response.transmissibility.items(), int(on_base))  # 0 of the densities: input
    ]
    up = ("Transmissibility", "") if on_base else ("Displacement / force", Scale(1.0, "m/N"))
    return Chart(_FREQUENCY, up, curves, log="xy", of="probes")


def crossings(response: RandomResponse) -> Chart:
    """Rates at which the signals cross levels upwards, over those of their means, and that of a Gaussian signal."""
    assert response.level is not None
    level = response.level
    curves = [
        Curve(f"{s.name} {s.quantity.replace('_', ' ')}", level, s.crossings_hz / s.crossing_rate_hz)
        for s in response.signals
        if s.crossings_hz is not None and s.crossing_rate_hz > 0
    ]
    grey = {"color": "0.6", "linewidth": 2.2, "linestyle": "-", "zorder": 0}
    gaussian = Curve("Gaussian", level, np.exp(-0.5 * level**2), grey)
    least = min((float(np.min(c.y, where=c.y > 0, initial=1.0)) for c in curves[:MOST_CURVES]), default=1.0)
    across, up = ("Level above the mean (standard deviations)", ""), ("Upward crossings, those of the mean = 1", "")
    return Chart(across, up, curves, log="y", of="signals", marks=[gaussian], y_ends=(0.5 * least, 3.0))
