"""The result file of ``beamsim compare``, and the pairing of measured channels with a run."""

from __future__ import annotations

import json
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import h5py
import numpy as np

from beamsim.analyses.compare import QUANTITIES, Comparison
from beamsim.analyses.measured import MeasuredSignal
from beamsim.analyses.results import RunResult
from beamsim.errors import Problem, ScenarioError
from beamsim.files import replacing
from beamsim.store import schema
from beamsim.store.identification import put
from beamsim.store.measurement import channel_named, in_si, read_signals
from beamsim.store.schema import Field

__all__ = ["COMMAND", "pair_channels", "write_comparison"]

COMMAND = "compare"


def pair_channels(
    result: RunResult,
    path: Path,
    *,
    place: str | None = None,
    quantity: str | None = None,
    channel: str | None = None,
    unit: str | None = None,
) -> list[tuple[str, str, MeasuredSignal]]:
    """The measured channels of a file that belong to a run's probes and snubbers, by their names, in SI units.

    With `channel`, that one is compared with `quantity` (by default the absolute acceleration) at `place` (by
    default the first probe).

    Raises
    ------
    ScenarioError
        Where the file cannot be used or nothing in it matches.
    """
    signals = read_signals(path)
    places = list(dict.fromkeys([*result.probes, *result.snubbers]))
    if place is not None and place not in places:
        raise ScenarioError(Problem("", f"--probe {place} is not in the result", f"it has {', '.join(places)}"))
    if channel is not None or len(signals) == 1:
        wanted = quantity or "absolute_acceleration"
        at = place or next(iter(result.snubbers if wanted == "force" else result.probes))
        _known(result, at, wanted)
        found = (
            channel_named(signals, channel, wanted, path, required=True)
            if channel is not None
            else channel_named(signals, signals[0].name, wanted, path)
        )
        return [(at, wanted, in_si(found, unit, wanted, "--unit"))]
    pairs: list[tuple[str, str, MeasuredSignal]] = []
    for name in places if place is None else [place]:
        for q in QUANTITIES if quantity is None else [quantity]:
            if name not in (result.snubbers if q == "force" else result.probes):
                continue
            try:
                found = channel_named(signals, name, q, path, required=True)
            except ScenarioError:
                continue
            pairs.append((name, q, in_si(found, unit, q, "--unit")))
    if not pairs:
        names = ", ".join(s.name for s in signals[:12])
        raise ScenarioError(
            Problem(
                "",
                f"{path} has no channel named after a probe ({', '.join(places)}) and what it measured",
                f"say which: --channel NAME --probe NAME --quantity absolute_acceleration; it has {names}",
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


def write_comparison(comparison: Comparison, result: RunResult, path: Path | str) -> Path:
    """Write a comparison; an existing file is replaced only when the new one is complete.

    Raises
    ------
    ResultFileError
        When the file cannot be written.
    """
    from beamsim import __version__

    with replacing(path) as temporary, h5py.File(temporary, "x") as file:
        file.attrs.update(
            {
                "schema_version": schema.SCHEMA_VERSION,
                "beamsim_version": __version__,
                "command": COMMAND,
                "scenario": result.scenario.to_yaml(),
                "title": comparison.title,
                "status": "complete",
                "created": datetime.now(UTC).isoformat(timespec="seconds"),
                "wall_time_s": 0.0,
                "warnings": json.dumps(list(comparison.warnings), ensure_ascii=False),
            }
        )
        for index, c in enumerate(comparison.channels, 1):
            group = file.create_group(f"channels/{index}")
            names = ("place", "quantity", "unit", "channel", "source", "excitation_hz", "delay_s", "rms_difference")
            group.attrs.update({name: getattr(c, name) for name in names})
            order = put(group, Field("order", "1", "frequency over excitation frequency"), c.order, scale=True)
            columns: Sequence[tuple[Field, object]] = (
                (Field("predicted", c.unit, "predicted harmonic, zero to peak"), np.abs(c.predicted)),
                (Field("measured", c.unit, "measured harmonic, zero to peak"), np.abs(c.measured)),
                (Field("difference_db", "dB", "20 log10(predicted / measured)"), c.difference_db),
                (Field("phase_difference_deg", "degree", "predicted over measured, aligned"), c.phase_difference_deg),
                (Field("measured_noise", c.unit, "standard deviation of the measured harmonic"), c.measured_noise),
            )
            for field, values in columns:
                put(group, field, values, order)
            for kind in ("predicted", "measured"):
                part = group.create_group(kind + "_history")
                time = put(part, schema.TIME, getattr(c, f"{kind}_time"), scale=True)
                put(part, Field(c.quantity, c.unit, f"{kind} {c.quantity}"), getattr(c, f"{kind}_history"), time)
                spectrum = getattr(c, f"{kind}_spectrum")
                part = group.create_group(kind + "_spectrum")
                axis, amplitude, level = schema.spectrum_fields(c.quantity, c.unit)
                frequency = put(part, axis, spectrum.frequency_hz, scale=True)
                put(part, amplitude, spectrum.amplitude, frequency)
                put(part, level, spectrum.amplitude_db, frequency)
        file.create_group("summary").attrs.update(schema.encode_summary(comparison.summary))
    return Path(path)
