"""The first screen of a result: what an engineer decides by. The rest is behind ``--verbose`` and in ``info``."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from beamsim.analyses.result import Result
from beamsim.analyses.run.result import RunResult
from beamsim.analyses.sweep.result import SweepResult
from beamsim.analyses.values import STANDARD_GRAVITY, limit_label
from beamsim.cli.report import length_text, predicted
from beamsim.cli.sweep_report import at_frequency, notch_texts
from beamsim.cli.tables import NONE, aligned, counted, percent
from beamsim.plots.style import is_known, scale_for
from beamsim.scenario.quantities import amplitude_unit

SHOWN = 4  # outputs, and levels of contacts
DIGITS = 3  # at most; fewer where the convergence supports no more


class Screen(NamedTuple):
    """What is printed of a result below its title."""

    verdict: str  # beside the title
    headings: tuple[str, ...]  # of the columns; the first has none
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[str, ...]


def screen_text(result: Result, screen: Screen, files: Sequence[str]) -> str:
    """A result's first screen.

    Parameters
    ----------
    result : with its title, outcome and warnings.
    screen : of the result.
    files : written by the command, the result file first.
    """
    head = f"{result.title or files[0]}  "
    lines = [head + screen.verdict]
    statements = result.outcome.displayed(scale_for).statements
    lines += [f"{text[:1].upper()}{text[1:]}" for text in statements if text != "complete"]
    lines += aligned([screen.headings, *screen.rows]) if screen.rows else []
    lines += screen.lines
    notes = f"{counted(len(result.warnings), 'note')} (-v shows them); " if result.warnings else ""
    plots = f", {counted(len(files) - 1, 'plot')}" if len(files) > 1 else ""
    return "\n".join([*lines, f"{notes}{files[0]}{plots}"])


class Printed:
    """Numbers of a summary as text, to the digits that their convergence supports, with marks.

    Parameters
    ----------
    summary : of a result.
    """

    def __init__(self, summary: Mapping[str, Any]) -> None:
        self._summary = summary
        self._doubtful, self._after = set(summary.get("doubtful", ())), set(summary.get("after_parting", ()))
        self._met: set[str] = set()
        self.largest_change = 0.0

    def number(self, value: float, unit: str, entry: str, place: str = "", size: float | None = None) -> str:
        """A number with its unit.

        Parameters
        ----------
        value : in ``unit``.
        unit : SI, or g.
        entry, place : of the summary, whose change counts.
        size : magnitude that chooses prefix and decimals, by default that of the value.
        """
        if not is_known(value):
            return "unknown"
        key = f"{entry}.{place}" if place else entry
        changes = self._summary.get("convergence", {}).get(entry, {})
        change = changes.get(place) if isinstance(changes, Mapping) else changes
        if change is not None:
            self.largest_change = max(self.largest_change, change)
        mark = " *" if key in self._doubtful else " ~" if key in self._after else ""
        self._met |= {mark.strip()}
        si = STANDARD_GRAVITY if unit == "g" else 1.0
        scale = scale_for("m/s^2" if unit == "g" else unit, si * (value if size is None else size))
        shown = _rounded(value * si * scale.factor, si * scale.factor * abs(size or value), digits_of(change))
        return f"{shown} {scale.unit}{mark}".rstrip()

    def legend(self) -> Iterator[str]:
        """What the marks mean that were printed."""
        if "*" in self._met:
            yield "* changes by more than 2 % with a finer model"
        if "~" in self._met:
            yield "~ one of many motions: depends on what follows after the contact sequences diverge"


def digits_of(change: float | None) -> int:
    """Significant digits of a value that changes by so much, relatively.

    >>> digits_of(None), digits_of(2e-5), digits_of(0.0078), digits_of(0.05), digits_of(0.4)
    (3, 3, 3, 2, 1)
    """
    return DIGITS if change is None or change <= 0.0 else min(max(math.ceil(-math.log10(change)), 1), DIGITS)


def _rounded(value: float, size: float, digits: int) -> str:
    """A value with as many decimals as its size has in so many digits."""
    decimals = digits - 1 - math.floor(math.log10(size)) if size > 0.0 else 0
    return f"{round(value, decimals) + 0.0:.{max(decimals, 0)}f}"


def _verdict(result: Result, change: float) -> str:
    """Whether the values can be trusted, in a few words; ``change`` is the largest that is printed."""
    summary = result.summary
    model, doubtful = summary.get("convergence_model") or {"reason": "not known"}, summary.get("doubtful")
    if not result.complete:
        said = "INCOMPLETE" if result.outcome.cut_short else "NOT RELIABLE"
    elif model["reason"]:
        said = f"not checked with a finer model ({model['reason']})"
    elif doubtful:
        said = f"NOT CONVERGED: {counted(len(doubtful), 'value')}"
    elif not model["modes"]:
        said = "all modes kept"
    elif summary.get("after_parting"):
        said = f"one of many motions, means within {percent(change, 2)}"
    else:
        said = f"converged within {percent(change, 2)}"
    error = summary.get("energy_error")
    return f"{said}, energy error {error:.0e}" if is_known(error) else said


def _limits(compared: Mapping[str, Mapping[str, Any]]) -> dict[str, list[str]]:
    """By place the verdict on each limit."""
    verdicts: dict[str, list[str]] = {}
    for name, item in compared.items():
        used = item["value"] / item["limit"] if item["limit"] else math.inf
        said = f"EXCEEDED, {100 * used:.0f} %" if item["exceeded"] else f"ok, {100 * (1 - used):.0f} % left"
        said = said if is_known(item["value"]) else "unknown"
        verdicts.setdefault(str(item["at"] or ""), []).append(f"{limit_label(name)} {said}")
    return verdicts


def _modes(result: RunResult | SweepResult) -> Iterator[str]:
    """The first natural frequency with its damping, contacts open and closed."""
    modes = result.modes
    elastic = [k for k, f in enumerate(modes.open_frequencies_hz[: modes.kept_modes]) if f > 0.0]
    if not elastic:
        return
    k = elastic[0]
    ratio = float(modes.damping_ratios[k])
    damping = f" ({percent(ratio, 2)})" if is_known(ratio) else ""
    text = f"first mode {modes.open_frequencies_hz[k]:.3g} Hz open{damping}"
    yield f"{text}, {modes.closed_frequencies_hz[k]:.3g} Hz closed" if result.scenario.located_snubbers else text


def _contact_levels(result: RunResult | SweepResult) -> Iterator[str]:
    """From which level on the linear motion opens or closes each snubber, where that is not with every motion."""
    unit = amplitude_unit(getattr(result.scenario.excitation, "quantity", None) or "acceleration")
    texts = [
        f"{name} {predicted(of, unit)[0]}"
        for name, of in result.summary.get("gapping", {}).items()
        if of.get("level", True) and of.get("sigmas", True)
    ]
    yield from texts[:SHOWN]
    if len(texts) > SHOWN:
        yield f"{len(texts) - SHOWN} more contacts: -v shows from which level on they open or close"


def _of_columns(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> tuple[tuple[str, ...], tuple[Any, ...]]:
    """The columns in which something is."""
    rows = list(rows)
    kept = [k for k in range(len(headings)) if k == 0 or any(row[k] not in ("", NONE) for row in rows)]
    return tuple(headings[k] for k in kept), tuple(tuple(row[k] for k in kept) for row in rows)


def run_screen(result: RunResult) -> Screen:
    """Forces, contact, displacements, accelerations and limits by place."""
    s, printed = result.summary, Printed(result.summary)
    limits = _limits(s.get("margins", {}))
    rows = [_place(s, printed, name, limits) for name in dict.fromkeys((*result.snubbers, *result.probes))]
    headings, kept = _of_columns(("", "peak force", "in contact, times", "displacement", "acceleration", "limit"), rows)
    facts, stress = list(_modes(result)), s.get("largest_bending_stress_pa")
    if stress is not None and is_known(stress):
        body = f"{s['largest_bending_stress_body']}, " if "largest_bending_stress_body" in s else ""
        where = f"{body}x = {length_text(s['largest_bending_stress_position_m'])}"
        facts.insert(0, f"bending stress {printed.number(stress, 'Pa', 'largest_bending_stress_pa')} at {where}")
    lines = [*(["; ".join(facts)] if facts else []), *_contact_levels(result)]
    outputs = [
        f"{name} {printed.number(peak, s['output_unit'][name], 'peak_output', name)}"
        for name, peak in s.get("peak_output", {}).items()
    ]
    if outputs:
        more = f" and {len(outputs) - SHOWN} more" if len(outputs) > SHOWN else ""
        lines.append(f"peaks of outputs: {', '.join(outputs[:SHOWN])}{more}")
    lines += [f"damage of {name} {body['damage']:.2g}" for name, body in s.get("fatigue", {}).items()]
    shown = {row[0] for row in rows}
    lines += [f"{text}{f' at {at}' if at else ''}" for at, texts in limits.items() if at not in shown for text in texts]
    if compared := s.get("against"):
        apart = percent(compared["largest_state_difference"], 2)
        lines.append(f"{compared['method']}: displacements differ by at most {apart}{_until(result, compared)}")
    lines += printed.legend()
    return Screen(_verdict(result, printed.largest_change), headings, kept, tuple(lines))


def _until(result: RunResult, compared: Mapping[str, Any]) -> str:
    until = compared["agrees_until_s"]
    whole = until >= result.time[-1]
    return "" if whole else f" until {until:.4g} s, where the contact sequences diverge"


def _place(s: Mapping[str, Any], printed: Printed, name: str, limits: Mapping[str, list[str]]) -> tuple[str, ...]:
    """The row of a probe, of a snubber, or of both."""
    force = contact = displacement = acceleration = NONE
    if name in s["peak_force_n"]:
        force = printed.number(s["peak_force_n"][name], "N", "peak_force_n", name)
        contact = f"{percent(s['contact_share'][name])}, {s['contacts'][name]}"
    if name in s["max_displacement_m"]:
        low, high = (
            printed.number(s[entry][name], "m", entry, name, s["peak_displacement_m"][name])
            for entry in ("min_displacement_m", "max_displacement_m")
        )
        first, _, unit = low.partition(" ")
        displacement = f"{first} to {high}" if high.partition(" ")[2].startswith(unit) else f"{low} to {high}"
        acceleration = printed.number(s["peak_acceleration_g"][name], "g", "peak_acceleration_g", name)
    return name, force, contact, displacement, acceleration, "; ".join(limits.get(name, ()))


def sweep_screen(result: SweepResult) -> Screen:
    """The largest values of each curve, with their frequency and place."""
    s, printed = result.summary, Printed(result.summary)
    of = (
        ("peak_force_n", "force", "N"), ("peak_displacement_m", "displacement", "m"),
        ("peak_acceleration_g", "acceleration", "g"),
    )  # fmt: skip
    rows = []
    for name, curve in result.curves.items():
        level = scale_for(curve.level_unit, curve.level)
        row = [f"{curve.direction}, {curve.level * level.factor:.4g} {level.unit}".rstrip()]
        for entry, field, unit in of:
            values = s[entry].get(name, {})
            place = max(values, key=lambda at: values[at], default="")
            at = at_frequency(curve, field, place)
            where = f", {place}" if len(values) > 1 else ""
            row.append(f"{printed.number(values[place], unit, entry, f'{name} {place}')}{at}{where}" if at else NONE)
        shares = s["contact_share"].get(name, {})
        row.append(", ".join(percent(share) for share in shares.values()) or NONE)
        rows.append(row)
    headings, kept = _of_columns(("", "peak force", "displacement", "acceleration", "in contact"), rows)
    limits = [f"{text} at {at}" for at, texts in _limits(s.get("margins", {})).items() for text in texts]
    notches = [f"{name} {text}" for name, text in list(notch_texts(result).items())[:SHOWN]]
    lines = (*_modes(result), *_contact_levels(result), *notches, *limits, *printed.legend())
    return Screen(_verdict(result, printed.largest_change), headings, kept, lines)
