"""The result file of ``beamsim identify-stiffness``.

``/stiffness`` is the identified stiffness with its uncertainty as attributes; ``/modes`` and ``/modes_without`` are the
tables of measured and predicted frequencies; ``/sensitivity``, ``/curves/mode_<n>``, ``/profile``, ``/update``,
``/mac`` and ``/nonlinear`` are there where they were asked for. Attributes of ``/summary`` are the printed numbers.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from beamsim.analyses.identify.result import (
    FrequencyCurve,
    FrequencyTable,
    IdentificationResult,
    ModelUpdate,
    NonlinearEstimate,
    ParameterEstimate,
    Profile,
    Sensitivity,
    StiffnessEstimate,
    TestFit,
)
from beamsim.store import schema
from beamsim.store.datasets import native, put, texts, words
from beamsim.store.outcomes import outcome_attributes, read_outcome
from beamsim.store.schema import Field
from beamsim.store.stored import LazyScenario, creating, reading, root_fields, write_root
from beamsim.typing import Floats

COMMAND = "identify-stiffness"

_MODE = Field("mode", "1", "number of the mode")
_TABLE = (
    Field("measured_hz", "Hz", "measured natural frequency"),
    Field("predicted_hz", "Hz", "predicted natural frequency"),
    Field("difference_percent", "percent", "100 (predicted - measured) / measured"),
)
_STIFFNESS = Field("stiffness", "N/m", "stiffness of the snubber")
_CURVE = Field("frequency_hz", "Hz", "natural frequency with a spring of that stiffness")
_MISFIT = Field("misfit", "1", "chi squared above its minimum, all other parameters fitted again")
_SENSITIVITY = (
    Field("value", "1", "value of the parameter, SI units"),
    Field("relative", "1", "d ln k / d ln p: relative change of the stiffness for that of the parameter"),
    Field("uncertainty", "1", "relative standard deviation of the parameter"),
    Field("contribution", "1", "relative standard deviation of the stiffness due to the parameter"),
)
_ESTIMATE = (
    Field("before", "1", "value in the scenario, SI units"),
    Field("value", "1", "estimated value, SI units"),
    Field("standard_deviation", "1", "standard deviation, SI units"),
)
_HARMONICS = (
    Field("measured", "", "measured harmonic"),
    Field("before", "", "harmonic predicted with the scenario's values"),
    Field("predicted", "", "harmonic predicted with the estimated values"),
)


def write_identification(result: IdentificationResult, path: Path | str) -> Path:
    """Write ``result`` to ``path``; an existing file is replaced only when the new one is complete.

    Raises
    ------
    ResultFileError
        When the file cannot be written.
    """
    with creating(path) as file:
        write_root(file, result, COMMAND, processor_time_s=result.processor_time_s)
        _write_stiffness(file, result)
        if result.with_snubber is not None:
            _write_table(file.create_group("modes"), result.with_snubber)
        _write_table(file.create_group("modes_without"), result.without_snubber)
        if result.sensitivities:
            group = file.create_group("sensitivity")
            names = _names(group, [s.parameter for s in result.sensitivities])
            for field in _SENSITIVITY:
                put(group, field, [getattr(s, field.name) for s in result.sensitivities], names)
        for curve in result.curves:
            group = file.create_group(f"curves/mode_{curve.mode}")
            axis = put(group, _STIFFNESS, curve.stiffness, scale=True)
            put(group, _CURVE, curve.frequency_hz, axis)
        if result.profile is not None:
            _write_profile(file.create_group("profile"), result.profile)
        if result.mac is not None:
            _write_mac(file, result.mac)
        _write_update(file, result)
        _write_nonlinear(file, result)
    return Path(path)


def _write_stiffness(file: h5py.File, result: IdentificationResult) -> None:
    estimate = result.estimate
    if estimate is None:
        return
    dataset = put(file, _STIFFNESS, estimate.stiffness)
    numbers = (
        "snubber", "method", "residual", "standard_deviation", "total_standard_deviation", "coverage",
        "monte_carlo_standard_deviation", "monte_carlo_samples", "monte_carlo_unreachable", "uncertainty_from",
        "eigenvalue_solutions",
    )  # fmt: skip
    dataset.attrs.update({name: getattr(estimate, name) for name in numbers})
    dataset.attrs.update(outcome_attributes(estimate.outcome))
    for name in ("interval", "interval_first_order", "monte_carlo_interval", "individual", "reach_hz", "condition"):
        dataset.attrs[name] = np.asarray(getattr(estimate, name), dtype=float)
    dataset.attrs["fit_to"] = np.array(estimate.fit_to)
    dataset.attrs["pad_youngs_modulus_pa"] = result.pad_modulus


def _write_mac(file: h5py.File, mac: Floats) -> None:
    axes = [
        put(file, Field(f"mac_{kind}", "1", f"number of the {kind} shape"), np.arange(1, size + 1), scale=True)
        for kind, size in zip(("measured", "predicted"), mac.shape, strict=True)
    ]
    put(file, Field("mac", "1", "modal assurance criterion, measured by predicted shapes"), mac, *axes)


def _write_table(group: h5py.Group, table: FrequencyTable) -> None:
    mode = put(group, _MODE, table.mode, scale=True)
    for field in _TABLE:
        put(group, field, getattr(table, field.name), mode)


def _write_profile(group: h5py.Group, profile: Profile) -> None:
    group.attrs["parameter"] = profile.parameter
    axis = put(group, Field("value", "1", f"{profile.parameter}, SI units"), profile.value, scale=True)
    put(group, _MISFIT, profile.misfit, axis)


def _write_parameters(group: h5py.Group, parameters: Sequence[ParameterEstimate], correlation: Any) -> None:
    names = _names(group, [p.parameter for p in parameters])
    for field in _ESTIMATE:
        put(group, field, [getattr(p, field.name) for p in parameters], names)
    intervals = np.array([p.interval for p in parameters]).reshape(-1, 2)
    ends = put(group, Field("end", "1", "which end of a range"), words(("lower", "upper")), scale=True)
    interval = Field("interval", "1", "lower and upper end of the confidence interval, SI units")
    put(group, interval, intervals, names, ends)
    bounds = np.array([p.bounds for p in parameters]).reshape(-1, 2)
    put(group, Field("bounds", "1", "lower and upper bound of the search, SI units"), bounds, names, ends)
    put(
        group, Field("prior", "1", "relative standard deviation known beforehand"), [p.prior for p in parameters], names
    )
    bound = Field("at_bound", "1", "whether the estimate lies on its bound", ("inside", "on_its_bound"))
    put(group, bound, [p.at_bound for p in parameters], names)
    put(group, Field("correlation", "1", "correlation of the parameters' logarithms"), correlation, names, names)


def _write_update(file: h5py.File, result: IdentificationResult) -> None:
    update = result.update
    if update is None:
        return
    group = file.create_group("update")
    _write_parameters(group, update.parameters, update.correlation)
    group.attrs.update(
        {"misfit_before": update.misfit_before, "misfit_after": update.misfit_after, "evaluations": update.evaluations}
    )
    group.attrs["choices"] = json.dumps(update.choices)
    group.attrs["alternatives"] = json.dumps(schema.plain([list(pair) for pair in update.alternatives]))
    group.attrs["scenario"] = update.scenario.to_yaml()
    _write_table(group.create_group("frequencies_before"), update.before)
    _write_table(group.create_group("frequencies_after"), update.after)
    for i, profile in enumerate(update.profiles, 1):
        _write_profile(group.create_group(f"profiles/{i}"), profile)


def _write_nonlinear(file: h5py.File, result: IdentificationResult) -> None:
    found = result.nonlinear
    if found is None:
        return
    group = file.create_group("nonlinear")
    _write_parameters(group, found.parameters, found.correlation)
    numbers = (
        "misfit_before", "misfit", "degrees_of_freedom", "starts", "starts_agreeing", "responses", "processor_time_s",
        "coverage",
    )  # fmt: skip
    group.attrs.update({name: getattr(found, name) for name in numbers})
    group.attrs.update(outcome_attributes(found.outcome))
    group.attrs["warnings"] = json.dumps(list(found.warnings), ensure_ascii=False)
    for i, profile in enumerate(found.profiles, 1):
        _write_profile(group.create_group(f"profiles/{i}"), profile)
    for i, test in enumerate(found.tests, 1):
        _write_test(group.create_group(f"tests/{i}"), test)


def _write_test(group: h5py.Group, test: TestFit) -> None:
    numbers = ("name", "probe", "quantity", "unit", "frequency_hz", "delay_s")
    group.attrs.update({name: getattr(test, name) for name in numbers})
    order = put(group, Field("order", "1", "frequency over excitation frequency"), test.order, scale=True)
    for field in _HARMONICS:
        value = getattr(test, field.name)
        for part in ("real", "imag"):
            described = field._replace(
                name=f"{field.name}_{part}", units=test.unit, long_name=f"{field.long_name}, {part} part"
            )
            put(group, described, getattr(value, part), order)
    noise = Field("noise", test.unit, "standard deviation of each part of a measured harmonic")
    put(group, noise, test.noise, order)


def _names(group: h5py.Group, names: Sequence[str]) -> h5py.Dataset:
    return put(group, Field("parameter", "1", "path of the parameter in the scenario"), words(names), scale=True)


class StoredIdentification(LazyScenario, IdentificationResult):
    """An identification read from a file, enough to print and draw it again."""


def open_identification(path: Path | str) -> StoredIdentification:
    """Read a file written by ``beamsim identify-stiffness`` back.

    Raises
    ------
    ResultFileError
        When the file is missing, damaged, or holds something else.
    """
    with reading(path, COMMAND) as file:
        return StoredIdentification.of(_fields(file))


def _fields(file: h5py.File) -> dict[str, Any]:
    sensitivities: tuple[Sensitivity, ...] = ()
    if "sensitivity" in file:
        group = file["sensitivity"]
        columns = (group["value"][()].tolist(), group["relative"][()].tolist(), group["uncertainty"][()].tolist())
        sensitivities = tuple(
            Sensitivity(name, *row) for name, *row in zip(texts(group["parameter"]), *columns, strict=True)
        )
    curves = sorted(
        (
            FrequencyCurve(int(name.removeprefix("mode_")), group["stiffness"][()], group["frequency_hz"][()])
            for name, group in file.get("curves", {}).items()
        ),
        key=lambda curve: curve.mode,
    )
    return {
        **root_fields(file),
        "estimate": _read_stiffness(file),
        "with_snubber": _read_table(file["modes"]) if "modes" in file else None,
        "without_snubber": _read_table(file["modes_without"]),
        "sensitivities": sensitivities,
        "curves": tuple(curves),
        "profile": _read_profile(file["profile"]) if "profile" in file else None,
        "update": _read_update(file),
        "mac": file["mac"][()] if "mac" in file else None,
        "nonlinear": _read_nonlinear(file),
        "pad_modulus": float(file["stiffness"].attrs["pad_youngs_modulus_pa"]) if "stiffness" in file else np.nan,
        "processor_time_s": float(file.attrs["processor_time_s"]),
    }


def _pair(values: Any) -> tuple[float, float]:
    return float(values[0]), float(values[1])


def _read_stiffness(file: h5py.File) -> StiffnessEstimate | None:
    if "stiffness" not in file:
        return None
    dataset = file["stiffness"]
    numbers = native(
        dataset, "snubber", "method", "residual", "standard_deviation", "total_standard_deviation",
        "coverage", "monte_carlo_standard_deviation", "monte_carlo_samples", "monte_carlo_unreachable",
        "uncertainty_from", "eigenvalue_solutions",
    )  # fmt: skip
    return StiffnessEstimate(
        outcome=read_outcome(dataset.attrs),
        stiffness=float(dataset[()]),
        fit_to=tuple(int(mode) for mode in dataset.attrs["fit_to"]),
        individual=dataset.attrs["individual"],
        reach_hz=dataset.attrs["reach_hz"],
        condition=dataset.attrs["condition"],
        interval=_pair(dataset.attrs["interval"]),
        interval_first_order=_pair(dataset.attrs["interval_first_order"]),
        monte_carlo_interval=_pair(dataset.attrs["monte_carlo_interval"]),
        **numbers,
    )


def _read_table(group: h5py.Group) -> FrequencyTable:
    return FrequencyTable(group["mode"][()], group["measured_hz"][()], group["predicted_hz"][()])


def _read_profile(group: h5py.Group) -> Profile:
    return Profile(str(group.attrs["parameter"]), group["value"][()], group["misfit"][()])


def _read_profiles(group: h5py.Group) -> tuple[Profile, ...]:
    numbered = sorted(group.get("profiles", {}).items(), key=lambda item: int(item[0]))
    return tuple(_read_profile(item) for _, item in numbered)


def _read_parameters(group: h5py.Group) -> tuple[ParameterEstimate, ...]:
    return tuple(
        ParameterEstimate(
            name, float(before), float(value), float(deviation), _pair(interval), _pair(bounds), float(prior), bool(at)
        )
        for name, before, value, deviation, interval, bounds, prior, at in zip(
            texts(group["parameter"]),
            *(
                group[key][()]
                for key in ("before", "value", "standard_deviation", "interval", "bounds", "prior", "at_bound")
            ),
            strict=True,
        )
    )


def _read_update(file: h5py.File) -> ModelUpdate | None:
    if "update" not in file:
        return None
    from beamsim.scenario import load_scenario

    group = file["update"]
    return ModelUpdate(
        parameters=_read_parameters(group),
        choices=json.loads(group.attrs["choices"]),
        alternatives=tuple((text, np.inf if m is None else m) for text, m in json.loads(group.attrs["alternatives"])),
        correlation=group["correlation"][()],
        before=_read_table(group["frequencies_before"]),
        after=_read_table(group["frequencies_after"]),
        profiles=_read_profiles(group),
        warnings=(),
        scenario=load_scenario(str(group.attrs["scenario"])),
        **native(group, "misfit_before", "misfit_after", "evaluations"),
    )


def _read_nonlinear(file: h5py.File) -> NonlinearEstimate | None:
    if "nonlinear" not in file:
        return None
    group = file["nonlinear"]
    tests = [item for _, item in sorted(group["tests"].items(), key=lambda item: int(item[0]))]
    return NonlinearEstimate(
        outcome=read_outcome(group.attrs),
        parameters=_read_parameters(group),
        correlation=group["correlation"][()],
        tests=tuple(_read_test(item) for item in tests),
        profiles=_read_profiles(group),
        warnings=tuple(json.loads(group.attrs["warnings"])),
        **native(
            group, "misfit_before", "misfit", "degrees_of_freedom", "starts", "starts_agreeing", "responses",
            "processor_time_s", "coverage",
        ),
    )  # fmt: skip


def _read_test(group: h5py.Group) -> TestFit:
    values = {
        field.name: group[f"{field.name}_real"][()] + 1j * group[f"{field.name}_imag"][()] for field in _HARMONICS
    }
    return TestFit(
        order=group["order"][()],
        noise=group["noise"][()],
        **values,
        **native(group, "name", "probe", "quantity", "unit", "frequency_hz", "delay_s"),
    )
