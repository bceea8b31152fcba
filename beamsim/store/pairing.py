"""Assignment of measured channels to the probes and snubbers of a run."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from beamsim.analyses.compare.analysis import QUANTITIES
from beamsim.analyses.run.result import RunResult
from beamsim.analyses.sweep.result import SweepResult
from beamsim.errors import Problem, ScenarioError
from beamsim.measurements.channels import channel_named, holds_name, in_si, read_signals
from beamsim.measurements.signal import MeasuredSignal


def pair_channels(
    result: RunResult | SweepResult,
    path: Path,
    *,
    place: str | None = None,
    quantity: str | None = None,
    channel: str | None = None,
    unit: str | None = None,
    axis_unit: str | None = None,
) -> list[tuple[str, str, MeasuredSignal]]:
    """The measured channels of a file that belong to the probes and snubbers of a result by name, in SI units.

    With `channel`, or in a file with one, that one is compared with `quantity` (by default what its name or unit says,
    else the absolute acceleration) at `place` (by default the one it is named after, or the only one).

    Raises
    ------
    ScenarioError
        If the file cannot be used or no channel matches.
    """
    signals = read_signals(path, axis_unit)
    probes, snubbers = _places(result)
    places = list(dict.fromkeys([*probes, *snubbers]))
    if place is not None and place not in places:
        raise ScenarioError(Problem("", f"--probe {place} is not in the result", f"it has {', '.join(places)}"))
    if channel is not None or len(signals) == 1:
        signal = channel_named(
            signals, channel or signals[0].name, quantity or "absolute_acceleration", path, required=channel is not None
        )
        compared = quantity or _quantity_of(signal.name, signal.unit or unit or "")
        at = place or _place_of(signal, snubbers if compared == "force" else probes, path)
        _known(snubbers if compared == "force" else probes, at, compared)
        return [(at, compared, in_si(signal, unit, compared, "--unit"))]
    pairs: list[tuple[str, str, MeasuredSignal]] = []
    for name in places if place is None else [place]:
        for q in QUANTITIES if quantity is None else [quantity]:
            if name not in (snubbers if q == "force" else probes):
                continue
            try:
                signal = channel_named(signals, name, q, path, required=True)
            except ScenarioError:
                continue
            pairs.append((name, q, signal))
    if not pairs:
        names = ", ".join(s.name for s in signals[:12])
        raise ScenarioError(
            Problem(
                "",
                f"{path} has no channel named after a probe ({', '.join(places)}) and a quantity",
                f"specify them: --channel NAME --probe NAME --quantity absolute_acceleration; it has {names}",
            )
        )
    try:
        return [(name, q, in_si(signal, unit, q, "--unit")) for name, q, signal in pairs]
    except ScenarioError as error:
        several = list(dict.fromkeys(q for _, q, _ in pairs))
        if unit is None or len(several) == 1:
            raise
        problem = error.problems[0]
        remedy = f"the file has {', '.join(several)}: choose one with --quantity, for example --quantity {several[0]}"
        raise ScenarioError(Problem(problem.path, problem.message, remedy)) from None


def _quantity_of(channel: str, unit: str) -> str:
    """The quantity that a channel's name or unit says."""
    spoken = channel.lower().replace("_", " ")
    longest_first = sorted(QUANTITIES, key=len, reverse=True)
    by_name = next((q for q in longest_first if q.replace("_", " ") in spoken), "")
    if by_name or not unit:
        return by_name or "absolute_acceleration"
    for q in ("absolute_acceleration", "velocity", "force", "displacement"):
        try:
            in_si(MeasuredSignal(channel, np.zeros(0), np.zeros(0)), unit, q, "")
        except ScenarioError:
            continue
        return q
    return "absolute_acceleration"


def _place_of(signal: MeasuredSignal, places: list[str], path: Path) -> str:
    """The probe or snubber that a channel is named after, or the only one.

    Raises
    ------
    ScenarioError
        If there are several and the channel's name says none or more than one of them.
    """
    named = [name for name in places if holds_name(signal.name, name)]
    if len(named) == 1 or (not named and len(places) == 1):
        return (named or places)[0]
    what = f"is named after {' and '.join(named)}" if named else "is named after none of the probes"
    raise ScenarioError(
        Problem("", f"{path}: the channel {signal.name} {what}", f"say where it was measured: --probe {places[0]}"
                f" (there are {', '.join(places)})")
    )  # fmt: skip


def _places(result: RunResult | SweepResult) -> tuple[list[str], list[str]]:
    """Names of the probes and snubbers of a result."""
    if isinstance(result, RunResult):
        return list(result.probes), list(result.snubbers)
    curves = result.curves.values()
    return list(dict.fromkeys(p for c in curves for p in c.displacement)), list(
        dict.fromkeys(s for c in curves for s in c.force)
    )


def _known(owners: list[str], place: str, quantity: str) -> None:
    if quantity not in QUANTITIES:
        raise ScenarioError(
            Problem("", f"--quantity {quantity} is not one of {', '.join(QUANTITIES)}", "choose one of these")
        )
    if place not in owners:
        raise ScenarioError(Problem("", f"--probe {place} has no {quantity}", f"choose from {', '.join(owners)}"))
