"""The result file of ``beamsim compare``, and the pairing of measured channels with a run."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

from beamsim.analyses.compare.analysis import QUANTITIES, ChannelComparison, Comparison
from beamsim.analyses.compare.measured import MeasuredSignal
from beamsim.analyses.run.result import RunResult
from beamsim.errors import Problem, ScenarioError
from beamsim.store import schema
from beamsim.store.datasets import native, put
from beamsim.store.measurement import channel_named, in_si, read_signals
from beamsim.store.schema import Field
from beamsim.store.spectra import read_spectrum, write_spectrum
from beamsim.store.stored import LazyScenario, creating, reading, root_fields, write_root

COMMAND = "compare"
_NUMBERS = (
    "place", "quantity", "unit", "channel", "source", "excitation_hz", "delay_s", "has_phase", "rms_difference",
)  # fmt: skip


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


def write_comparison(comparison: Comparison, path: Path | str) -> Path:
    """Write a comparison; an existing file is replaced only when the new one is complete.

    Raises
    ------
    ResultFileError
        When the file cannot be written.
    """
    with creating(path) as file:
        write_root(file, comparison, COMMAND)
        for index, channel in enumerate(comparison.channels, 1):
            _write_channel(file.create_group(f"channels/{index}"), channel)
    return Path(path)


def _write_channel(group: h5py.Group, c: ChannelComparison) -> None:
    group.attrs.update({name: getattr(c, name) for name in _NUMBERS})
    order = put(group, Field("order", "1", "frequency over excitation frequency"), c.order, scale=True)
    for kind, value in (("predicted", c.predicted), ("measured", c.measured)):
        put(group, Field(kind, c.unit, f"{kind} harmonic, zero to peak"), np.abs(value), order)
        phase = Field(f"{kind}_phase_deg", "degree", f"phase of the {kind} harmonic as a sine, on the predicted clock")
        put(group, phase, np.degrees(np.angle(value)), order)
        part = group.create_group(f"{kind}_history")
        time = put(part, schema.TIME, getattr(c, f"{kind}_time"), scale=True)
        put(part, Field(c.quantity, c.unit, f"{kind} {c.quantity}"), getattr(c, f"{kind}_history"), time)
        write_spectrum(group.create_group(f"{kind}_spectrum"), getattr(c, f"{kind}_spectrum"))
    put(group, Field("difference_db", "dB", "20 log10(predicted / measured)"), c.difference_db, order)
    put(
        group, Field("phase_difference_deg", "degree", "predicted over measured, aligned"), c.phase_difference_deg,
        order,
    )  # fmt: skip
    put(group, Field("measured_noise", c.unit, "standard deviation of the measured harmonic"), c.measured_noise, order)


class StoredComparison(LazyScenario, Comparison):
    """A comparison read from a file."""


def open_comparison(path: Path | str) -> StoredComparison:
    """Read a file written by ``beamsim compare`` back.

    Raises
    ------
    ResultFileError
        When the file is missing, damaged, or holds something else.
    """
    with reading(path, COMMAND) as file:
        channels = sorted(file["channels"].items(), key=lambda item: int(item[0]))
        return StoredComparison.of(
            {**root_fields(file), "channels": tuple(_read_channel(group) for _, group in channels)}
        )


def _read_channel(group: h5py.Group) -> ChannelComparison:
    fields = native(group, *_NUMBERS)
    fields["has_phase"] = bool(fields["has_phase"])
    for kind in ("predicted", "measured"):
        fields[kind] = group[kind][()] * np.exp(1j * np.radians(group[f"{kind}_phase_deg"][()]))
        part = group[f"{kind}_history"]
        fields[f"{kind}_time"] = part["time"][()]
        fields[f"{kind}_history"] = part[fields["quantity"]][()]
        fields[f"{kind}_spectrum"] = read_spectrum(group[f"{kind}_spectrum"])
    return ChannelComparison(order=group["order"][()], measured_noise=group["measured_noise"][()], **fields)
