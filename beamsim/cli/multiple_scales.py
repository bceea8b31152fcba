"""``--compare multiple_scales`` for nonlinear modes and response curves: rows of the table and summary."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from beamsim.analyses.response.result import ForcedExpansionComparison, FrequencyResponse

POLE_MARGIN = 3.0  # a pole further away than this multiple of the largest small factor does not affect the orders


def compare_response(result: FrequencyResponse) -> FrequencyResponse:
    """The response curve together with the expansion near its mode."""
    from beamsim.analyses.response.forced_expansion import compare_forced_expansion
    from beamsim.cli.conclusion import located

    with located(result.scenario):
        expansion = compare_forced_expansion(result.scenario)
    summary = {**result.summary, "multiple_scales": [forced_expansion_summary(c) for c in expansion]}
    return replace(result, expansion=expansion, summary=summary)


def expansion_rows(s: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Label and text of every row about a mode, from the summary's ``multiple_scales``."""
    frequency, initial = s["observed_order_frequency"], s["observed_order_initial"]
    expected, uniform = s["expected_order_initial"], s["observed_order_uniform"]
    series = f"{s['linear_frequency_hz']:.6g} Hz {s['first_order_hz']:+.4g} e {s['second_order_hz']:+.4g} e² Hz"
    yield "multiple scales", f"{series}, for factors e well below {s['factors_well_below']:.2g}"
    first, second = s["frequency_hz"][0]
    exact = s["exact_frequency_hz"][0]
    head = f"{first:.6g} Hz at first order, {second:.6g} Hz at second"
    if math.isfinite(exact):
        off = s["initial_difference"][0]
        head += f", exact {exact:.6g} Hz; initial vector off by {off[0]:.2g} and {off[1]:.2g}"
    else:
        head += "; no exact motion found near it"
    yield f"at e = {s['factor'][0]:.4g}", head
    yield "observed orders", f"frequency {frequency[0]:.2f} and {frequency[1]:.2f} (expected 2 and 3)"
    at = f" at these factors, {s['orders_from']:.2g} to {s['orders_to']:.2g}"
    yield (
        "",
        f"initial vector {initial[0]:.2f} and {initial[1]:.2f} (expected {expected[0]:.2f} and {expected[1]:.2f}{at})",
    )
    if s["asymptotic_well_below"] < POLE_MARGIN * s["orders_from"]:
        pole = s["nearest_pole"]
        yield (
            "",
            f"initial vector 2 and 3 for e well below {s['asymptotic_well_below']:.2g}: harmonic {pole['harmonic']} is "
            f"close to mode {pole['mode']}; with divisors at the frequency of the motion {uniform[0]:.2f} and "
            f"{uniform[1]:.2f}",
        )


def forced_expansion_summary(comparison: ForcedExpansionComparison) -> dict[str, Any]:
    """Numbers for ``--json``, of one level."""
    near = comparison.difference[:, 0] < math.inf  # False where no exact motion was found
    return {
        "level": comparison.level,
        "mode": comparison.mode,
        "linear_frequency_hz": comparison.linear_frequency_hz,
        "points": int(comparison.frequency_hz.size),
        "stable_points": int(comparison.stable.sum()),
        "largest_first_order_m": {name: float(x.max()) for name, x in comparison.first.items()},
        "factor": comparison.factor[near].tolist(),
        "difference": comparison.difference[near].tolist(),
        "observed_orders": [_last_order(comparison.orders[:, k]) for k in (0, 1)],
        "stability_agrees": bool(near.any() and comparison.stability_agrees[near].all()),
    }


def _last_order(orders: Any) -> float:
    """The order between the two smallest factors."""
    seen = [float(x) for x in orders if math.isfinite(x)]
    return seen[-1] if seen else math.nan


def forced_expansion_rows(comparisons: tuple[ForcedExpansionComparison, ...]) -> Iterator[tuple[str, str]]:
    """Label and text of every row of the table, level by level."""
    for c in comparisons:
        s = forced_expansion_summary(c)
        yield (
            "multiple scales",
            f"level {c.level:.4g}: mode {c.mode}, {s['points']} points, {s['stable_points']} of them stable",
        )
        if not s["factor"]:
            yield "", "no exact motion was found near the expansion for any factor on springs, damping and force"
            continue
        whole = c.factor[0] == s["factor"][0]
        at = "at factor 1" if whole else f"at a factor of {s['factor'][0]:.2g}, the largest sufficiently small one"
        yield "", f"differs by {s['difference'][0][0]:.2g} (leading) and {s['difference'][0][1]:.2g} (first order) {at}"
        orders = s["observed_orders"]
        agrees = "agrees" if s["stability_agrees"] else "differs somewhere"
        yield "", f"observed orders {orders[0]:.2f} and {orders[1]:.2f} (expected 1 and 2); stability {agrees}"
