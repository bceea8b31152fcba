"""The part ``/random`` of a run's result file: densities, statistics and transmissibilities."""

from __future__ import annotations

from typing import Any

import h5py
import numpy as np

from beamsim.analyses.run.random_response import RandomResponse, SignalStatistics
from beamsim.store import schema
from beamsim.store.datasets import put
from beamsim.store.schema import Field

_NUMBERS = (
    "mean", "rms", "standard_deviation", "highest", "lowest", "crest_factor", "kurtosis", "crossing_rate_hz",
    "peaks_over_2_sigma", "peaks_over_3_sigma",
)  # fmt: skip


def write_random(file: h5py.File, response: RandomResponse | None) -> None:
    """Write the group, where there is a response to write."""
    if response is None:
        return
    group = file.create_group("random")
    group.attrs["start_s"] = response.start_s
    frequency = put(group, Field("frequency_hz", "Hz", "frequency"), response.frequency_hz, scale=True)
    for index, signal in enumerate((response.input, *response.signals)):
        place = group.create_group(f"{schema.group_name(signal.name)}/{signal.quantity}")
        place.attrs.update({"name": signal.name, "index": index, "unit": signal.unit})
        place.attrs.update({name: getattr(signal, name) for name in _NUMBERS})
        field = Field("density", f"({signal.unit})^2/Hz", f"one-sided spectral density of the {signal.quantity}")
        put(place, field, signal.density, frequency)
    for name, value in response.transmissibility.items():
        place = group[schema.group_name(name)]
        unit = "1" if response.input.unit == "m/s^2" else "m/N"
        put(place, Field("transmissibility_real", unit, "response over input (H1), real part"), value.real, frequency)
        put(
            place,
            Field("transmissibility_imag", unit, "response over input (H1), imaginary part"),
            value.imag,
            frequency,
        )
        put(place, Field("coherence", "1", "coherence of response and input"), response.coherence[name], frequency)


def read_random(file: h5py.File) -> RandomResponse | None:
    """Read the group back; None where there is none."""
    if "random" not in file:
        return None
    group = file["random"]
    found: list[tuple[int, SignalStatistics]] = []
    transfer: dict[str, Any] = {}
    coherence: dict[str, Any] = {}
    for place in group.values():
        if not isinstance(place, h5py.Group):
            continue
        for quantity, signal in place.items():
            if isinstance(signal, h5py.Group):
                a = signal.attrs
                numbers = {name: float(a[name]) for name in _NUMBERS}
                statistics = SignalStatistics(
                    name=a["name"], quantity=quantity, unit=a["unit"], density=signal["density"][()], **numbers
                )
                found.append((int(a["index"]), statistics))
        if "coherence" in place:
            name = next(s.attrs["name"] for s in place.values() if isinstance(s, h5py.Group))
            transfer[name] = np.asarray(place["transmissibility_real"][()] + 1j * place["transmissibility_imag"][()])
            coherence[name] = place["coherence"][()]
    signals = [statistics for _, statistics in sorted(found, key=lambda item: item[0])]
    order = [s.name for s in signals[1:] if s.name in transfer]
    return RandomResponse(
        float(group.attrs["start_s"]),
        group["frequency_hz"][()],
        signals[0],
        tuple(signals[1:]),
        {name: transfer[name] for name in dict.fromkeys(order)},
        {name: coherence[name] for name in dict.fromkeys(order)},
    )
