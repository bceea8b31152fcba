"""Pictures of coexisting motions: which start comes to which, and the motions over frequency with their shares."""

from __future__ import annotations

import numpy as np

from beamsim.analyses.coexisting.result import CoexistingResult
from beamsim.plots.drawing import HERTZ, MOST_CURVES, Chart, Curve, Picture, curve_style, marks_curve
from beamsim.results.values import Value, peaks_in

_MARKS = "os^Dvx"
_LABELS = ("stable, marks by share of the starts", "not periodic", "unstable")
LARGEST_MARK, SMALLEST_MARK = 13.0, 3.0  # points, of a motion that all starts come to, or none


def basins(result: CoexistingResult, frequency_index: int) -> Chart:
    """The starts at a frequency in the plane of the first two coordinates that vary, marked by where they end.

    Of one coordinate the number of the motion is drawn over it.
    """
    starts, motions = result["starts"], result["motions"]
    hz = float(starts["frequency_hz"].values[frequency_index])
    ends, known = starts["destination"].values[frequency_index], starts["cycles"].values[frequency_index] > 0
    names, units = (starts[f"coordinate_{of}"].values.tolist() for of in ("name", "unit"))
    every = zip(names, units, starts["start"].values.T, strict=True)
    drawn = [(name.capitalize(), unit, x) for name, unit, x in every if np.ptp(x) > 0.0]
    x_axis, y_axis = [*drawn, ("Number of the motion", "", ends.astype(float))][:2]
    there = motions["frequency_hz"].values == hz
    shares = zip(*(motions[name].values[there].tolist() for name in ("number", "share")), strict=True)
    labels = {number: f"motion {number}, {100 * share:.3g} %" for number, share in shares}
    curves = []
    for number, label in (labels | {0: "not settled"}).items():
        places = np.column_stack([x_axis[2], y_axis[2]])[known & (ends == number)]
        style = {"color": curve_style(number - 1)["color"] if number else "0.6", "markersize": 3.5}
        curves += (
            [marks_curve(label, places, marker=_MARKS[(number - 1) % len(_MARKS)], **style)] if places.size else []
        )
    more = f", {len(drawn) - 2} more coordinates drawn" if len(drawn) > 2 else ""
    title = f"{hz:.6g} Hz, {int(known.sum())} starts{more}"
    return Chart(
        x_axis[:2], y_axis[:2], curves, integer_axes="y" if len(drawn) < 2 else "", curve_noun="motions", title=title
    )


def peaks(result: CoexistingResult, value: Value, name: str) -> Chart:
    """The largest values of all motions over frequency: full marks of stable ones, as large as their shares."""
    curves: list[Curve] = []
    of_value, motions = dict(peaks_in(result["points"]))[value][name], result["motions"]
    columns = (motions[of].values.tolist() for of in ("frequency_hz", "period_cycles", "stable", "share"))
    for hz, period, stable, share, peak in zip(*columns, of_value.tolist(), strict=True):
        which = (0 if period else 1) if stable else 2
        label, colour = _LABELS[which], curve_style(which)["color"]
        size = max(SMALLEST_MARK, LARGEST_MARK * float(np.sqrt(np.nan_to_num(share))))
        face = {"markerfacecolor": colour if stable else "white", "markersize": size, "alpha": 0.8}
        known = any(curve.label == label for curve in curves)
        curves.append(marks_curve("" if known else label, (hz, peak), marker="o", color=colour, **face))
    y_axis = (f"{value.label.capitalize()} of {name}", value.unit)
    return Chart(("Excitation frequency", HERTZ), y_axis, curves, curve_noun="", y_ends=(0.0, None))


def coexisting_figures(result: CoexistingResult) -> dict[str, Picture]:
    """What is followed of each motion, by probe and snubber, and the basins at each frequency."""
    followed = [(value, list(of)[:MOST_CURVES]) for value, of in peaks_in(result["points"]) if value.in_sweeps]
    of_value = {
        (value.name.removeprefix("peak_"), name): peaks(result, value, name) for value, of in followed for name in of
    }
    charts = {"_".join(key): chart for key, chart in of_value.items()}
    charts |= {f"basins_{hz:g}Hz": basins(result, k) for k, hz in enumerate(result["starts"].labels("frequency_hz"))}
    return {name: Picture(result.title, [chart]) for name, chart in charts.items()}
