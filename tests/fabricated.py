"""Results that no solver made, for the tests of what comes after the solver."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np

from beamsim.analyses.run.layouts import BODIES, EVENTS, HISTORIES
from beamsim.analyses.run.result import RunResult
from beamsim.analyses.run.spectra import Label, spectra_of_samples
from beamsim.analyses.run.summary import spectral_lines
from beamsim.analyses.studies.responses import limited_response, matches_request
from beamsim.cases import CaseOutcome
from beamsim.outcomes import COMPLETE, Outcome
from beamsim.results.values import with_verdicts
from beamsim.scenario.body import LocatedItem
from beamsim.scenario.excitation import NoExcitation
from beamsim.structures.places import ALONG_BEAM, MASSES, Recovery, Stations
from beamsim.system.structural import MODES, contact_units

YAML = """\
title: Fabricated, 65 Hz
beam: {length: 0.27, width: 0.05, thickness: 0.005, youngs_modulus: 69.0e+9, density: 2700.0}
snubbers:
  - {name: tip, position: 0.27, side: below, stiffness: 151100.0}
excitation: {kind: harmonic, applied_to: base, level: 19.6133, frequency: 65.0}
run: {duration: 0.4, sample_rate: 10000.0}
"""


@dataclass(frozen=True)
class FabricatedScenario:
    """What a result needs of a scenario, without the scenario layer."""

    title: str = "Fabricated, 65 Hz"
    bodies_of_places: dict[str, dict[str, str]] = field(default_factory=dict)
    display_scales: dict[str, tuple[float, str]] = field(default_factory=dict)
    excitation: NoExcitation = field(default_factory=NoExcitation)
    limits: None = None
    all_bodies: dict[str, object] = field(default_factory=dict)
    effective_probes: tuple[object, ...] = ()
    located_snubbers: tuple[LocatedItem, ...] = ()
    run: object = field(default_factory=lambda: SimpleNamespace(low_pass=None))

    def to_yaml(self) -> str:
        return YAML

    def file_records(self, *, unchanged_only: bool) -> dict[str, object]:
        return {}


def fabricate(
    *,
    snubbers: tuple[str, ...] = ("tip",),
    probes: tuple[str, ...] = ("tip", "middle"),
    chain: bool = False,
    frequency: float = 65.0,
    outcome: Outcome = COMPLETE,
    rate: float = 10_000.0,
    duration: float = 0.4,
) -> RunResult:
    """A run's result made of closed-form pieces: two half sines a period, the smaller one in contact."""
    time = np.arange(round(duration * rate) + 1) / rate
    omega = 2 * np.pi * (frequency if np.isfinite(frequency) else 65.0)
    w = np.where(np.sin(omega * time) > 0, 4e-4, 1e-4) * np.sin(omega * time)
    v = np.where(np.sin(omega * time) > 0, 4e-4, 1e-4) * omega * np.cos(omega * time)
    base = 2 * 9.80665 * np.sin(omega * time)
    where = {name: float(k + 1) if chain else 0.27 / (k + 1) for k, name in enumerate(probes)}
    share = 1.0 / np.arange(1, max(len(probes), len(snubbers)) + 1)[:, None]
    of_probes, of_stops, closed = share[: len(probes)], share[: len(snubbers)], w < 0
    values = {
        "time": time,
        "base_motion": ["z"], "base_acceleration": base[None], "base_displacement": -base[None] / omega**2,
        "energy_work_in": 1e-3 * time, "energy_dissipated": 5e-4 * time, "energy_stored": 5e-4 * time,
        "probe": probes, "position": list(where.values()), "displacement": w * of_probes,
        "absolute_displacement": w * of_probes - base / omega**2, "velocity": np.tile(v, (len(probes), 1)),
        "absolute_acceleration": -(omega**2) * w * of_probes + base,
        "snubber": snubbers, "snubber_side": ["above" if k % 2 else "below" for k in range(len(snubbers))],
        "snubber_position": [float(k + 1) if chain else 0.27 / (k + 1) for k in range(len(snubbers))],
        "snubber_gap": [1e-4 * k for k in range(len(snubbers))],
        **{f"snubber_{name}": [value] * len(snubbers) for name, value in (
            ("stiffness", 151_100.0), ("dashpot", 12.3), ("preload", np.nan), ("blocked_force", 0.0),
            ("stiffness_ratio", 51.8),
        )},
        "snubber_force": np.where(closed, -151_100.0 * w, 0.0) * of_stops,
        **{f"snubber_{name}": np.tile(x, (len(snubbers), 1)) for name, x in (
            ("penetration", -w), ("closed", closed), ("displacement", w), ("velocity", v)
        )},
    }  # fmt: skip
    histories = HISTORIES.dataset(values, {"snubber": [contact_units("m")] * len(snubbers)}, base_unit="m")
    instants = np.arange(1, int(2 * duration * 65)) / 130.0
    n = instants.size if snubbers else 0
    number = np.arange(n)
    events = EVENTS.dataset(
        {"event": number + 1, "time": instants[:n], "snubber": np.zeros_like(number), "closing": number % 2 == 0}
    )
    settings = SimpleNamespace(last=duration / 2, periods=None, window="hann", frequencies=())
    quantities = (("absolute_acceleration", "m/s^2"), ("displacement", "m"))
    labels = [Label(name, *of) for name in probes for of in quantities]
    samples = np.array([histories[label.quantity].sel(probe=label.name).values for label in labels])
    spectra = spectra_of_samples(time, samples, labels, settings, frequency, {})
    x = np.arange(1.0, 3.0) if chain else np.linspace(0, 0.27, 11)
    curve = (x / x[-1]) ** 2
    along = {
        "body": ["beam"], "station": np.arange(1, x.size + 1), "station_body": np.zeros(x.size, dtype=np.int64),
        "position": x, "peak_bending_stress": 2e7 * (1 - x / 0.27), "static_shape": -2e-5 * curve,
        "extreme_time": np.array([0.3, 0.2]), "extreme_shape": np.array([-1e-4 * curve, 4e-4 * curve]),
    }  # fmt: skip
    body = ("chain", MASSES) if chain else ("beam", ALONG_BEAM)
    stations = Stations.of_recoveries([Recovery(*body, x, np.zeros((x.size, 0)))])
    of_modes = {
        "mode": np.array([1, 2]), "open_frequencies_hz": np.array([52.7, 328.5]),
        "closed_frequencies_hz": np.array([196.0, 447.1]), "damping_ratios": np.array([0.01, np.nan]),
        "closed_damping_ratios": np.array([0.02, np.nan]), "kept_modes": 2, "static_vectors": len(snubbers),
        "highest_frequency_hz": 1000.0, "reduction_bound": 1e-5, "shapes": np.vstack([curve, curve**2]),
        "snubber": snubbers, "dashpot": np.zeros(len(snubbers)), "dashpot_from": ["none written"] * len(snubbers),
        **stations.columns(),
    }  # fmt: skip
    modes = MODES.dataset(of_modes, {"snubber": [contact_units("m")] * len(snubbers)}, **stations.position_words)
    summary = {
        "peak_displacement_m": dict.fromkeys(probes, 4e-4),
        "min_displacement_m": dict.fromkeys(probes, -1e-4),
        "max_displacement_m": dict.fromkeys(probes, 4e-4),
        "peak_acceleration_g": dict.fromkeys(probes, 8.5),
        "peak_force_n": dict.fromkeys(snubbers, 15.11),
        "contact_share": dict.fromkeys(snubbers, 0.5),
        "contacts": dict.fromkeys(snubbers, 26),
        "events": int(n),
        "energy_error": 3e-13,
        "processor_time_s": 0.0012,
        "spectral_lines": spectral_lines(spectra),
        "static_force_n": dict.fromkeys(snubbers, float("nan")),
        "blocked_force_n": dict.fromkeys(snubbers, 0.0),
        "gap_m": dict.fromkeys(snubbers, 0.0),
        "stiffness_ratio": dict.fromkeys(snubbers, 51.8),
        "open_frequencies_hz": [52.7, 328.5],
        "closed_frequencies_hz": [196.0, 447.1],
        "kept_modes": 2,
        "static_vectors": len(snubbers),
        "reduction_bound": 1e-5,
        "highest_frequency_hz": 400.0,
        "status": outcome.text,
        "method": "exact",
        "linear": None if not snubbers else False,
    }  # fmt: skip
    if not chain:
        summary |= {"largest_bending_stress_pa": 2e7, "largest_bending_stress_position_m": 0.0}
    datasets = {"histories": histories, "events": events, "spectra": spectra, "modes": modes}
    return RunResult(
        scenario=FabricatedScenario(),  # type: ignore[arg-type]
        outcome=outcome,
        datasets=datasets | ({} if chain else {"bodies": BODIES.dataset(along)}),
        summary=summary,
        warnings=("a fabricated warning",),
        wall_time_s=0.25,
        created="2026-01-01T00:00:00+00:00",
        beamsim_version="0.1.0",
        provenance={"numpy": "2.0"},
    )


def solved_case(
    limits: dict[str, float], index: int, values: dict[str, Any], changes: dict[str, tuple[float, float]] | None = None,
    **fields: Any,
) -> CaseOutcome:  # fmt: skip
    """The outcome of a case with some responses, as its run would have it.

    Parameters
    ----------
    limits : by name, SI units.
    index, values, fields : of the outcome.
    changes : by limit the value less and plus its change with a finer model; by default it does not change.
    """
    margins = {}
    for name, limit in limits.items():
        found = [x for response, x in values.items() if matches_request(limited_response(name), response)]
        value = max(found, default=float("nan"))
        lowest, highest = (changes or {}).get(name, (value, value))
        margins[name] = {"limit": limit, "value": value, "lowest": lowest, "highest": highest, "at": ""}
    return CaseOutcome(index, values, margins=with_verdicts(margins), **fields)
