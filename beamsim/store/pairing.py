"""Assignment of measured channels to the probes and snubbers of a run."""

from __future__ import annotations

from pathlib import Path

from beamsim.analyses.compare.analysis import QUANTITIES
from beamsim.analyses.compare.measured import MeasuredSignal
from beamsim.analyses.run.result import RunResult
from beamsim.errors import Problem, ScenarioError
from beamsim.store.measurement import channel_named, in_si, read_signals


def pair_channels(
    result: RunResult,
    path: Path,
    *,
    place: str | None = None,
    quantity: str | None = None,
    channel: str | None = None,
    unit: str | None = None,
) -> list[tuple[str, str, MeasuredSignal]]:
    """The measured channels of a file that belong to the probes and snubbers of a run by name, in SI units.

    With `channel`, that one is compared with `quantity` (by default the absolute acceleration) at `place` (by
    default the first probe).

    Raises
    ------
    ScenarioError
        If the file cannot be used or no channel matches.
    """
    signals = read_signals(path)
    places = list(dict.fromkeys([*result.probes, *result.snubbers]))
    if place is not None and place not in places:
        raise ScenarioError(Problem("", f"--probe {place} is not in the result", f"it has {', '.join(places)}"))
    if channel is not None or len(signals) == 1:
        compared = quantity or "absolute_acceleration"
        at = place or next(iter(result.snubbers if compared == "force" else result.probes))
        _known(result, at, compared)
        signal = (
            channel_named(signals, channel, compared, path, required=True)
            if channel is not None
            else channel_named(signals, signals[0].name, compared, path)
        )
        return [(at, compared, in_si(signal, unit, compared, "--unit"))]
    pairs: list[tuple[str, str, MeasuredSignal]] = []
    for name in places if place is None else [place]:
        for q in QUANTITIES if quantity is None else [quantity]:
            if name not in (result.snubbers if q == "force" else result.probes):
                continue
            try:
                signal = channel_named(signals, name, q, path, required=True)
            except ScenarioError:
                continue
            pairs.append((name, q, in_si(signal, unit, q, "--unit")))
    if not pairs:
        names = ", ".join(s.name for s in signals[:12])
        raise ScenarioError(
            Problem(
                "",
                f"{path} has no channel named after a probe ({', '.join(places)}) and a quantity",
                f"specify them: --channel NAME --probe NAME --quantity absolute_acceleration; it has {names}",
            )
        )
    return pairs


def _known(result: RunResult, place: str, quantity: str) -> None:
    if quantity not in QUANTITIES:
        raise ScenarioError(
            Problem("", f"--quantity {quantity} is not one of {', '.join(QUANTITIES)}", "choose one of these")
        )
    owners = result.snubbers if quantity == "force" else result.probes
    if place not in owners:
        raise ScenarioError(Problem("", f"--probe {place} has no {quantity}", f"choose from {', '.join(owners)}"))
