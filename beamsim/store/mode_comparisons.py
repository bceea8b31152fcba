"""The groups ``thesis`` and ``multiple_scales`` of a file of ``beamsim nnm``: other methods beside exact motions."""

from __future__ import annotations

import h5py
import numpy as np

from beamsim.analyses.nnm.result import ExactModes, ExpansionComparison, ExpansionPath, RelaxedComparison
from beamsim.store.datasets import native, put, read_stations, texts
from beamsim.store.schema import Field

_FACTOR = Field("factor", "1", "stiffness factor")
_STEP = Field("step", "1", "number of the step")
_RELAXED = (
    Field("frequency_hz", "Hz", "frequency"),
    Field("functional", "1", "the functional at the end of its minimisation"),
    Field("passages", "1", "motions computed"),
    Field("processor_time_s", "s", "processor time"),
    Field("exact_frequency_hz", "Hz", "frequency of the backbone by shooting"),
    Field("frequency_difference", "1", "from the backbone, relative"),
    Field("shape_difference", "1", "from the backbone, relative, in the norm of the linear strain energy"),
)
_FLAGS = (
    Field("reached", "1", "whether the functional fell below the tolerance", ("no", "yes")),
    Field("jumped", "1", "whether the step left the motion that the one before was on", ("no", "yes")),
)
_COORDINATES = Field("coordinates", "kg^0.5 m", "coordinates at rest")
_SHAPE = Field("initial_displacement", "m", "deflection at rest")
_FATE = Field("fate", "1", "same, other, none or between: what exact motion it is beside")
_RELAXED_NUMBERS = ("steps", "tolerance", "status", "shooting_passages", "shooting_processor_time_s")

_PATH_NUMBERS = (
    "mode", "energy", "linear_frequency_hz", "first_hz", "second_hz", "partner", "harmonic", "reach", "pole",
    "pole_mode", "pole_harmonic",
)  # fmt: skip
_PATH = (
    Field("frequency_hz", "Hz", "frequency to each order"),
    _COORDINATES._replace(long_name="initial vector to each order"),
    _SHAPE._replace(long_name="deflection at rest to each order"),
    Field("uniform_coordinates", "kg^0.5 m", "initial vector of the uniform expansion to each order"),
)
_EXACT = (
    Field("frequency_hz", "Hz", "frequency by shooting"),
    _COORDINATES,
    _SHAPE,
    Field("residual", "1", "largest miss of periodicity, against the motion's size"),
)
_DIFFERENCES = (
    Field("frequency_difference", "1", "of the frequency to each order, relative"),
    Field("initial_difference", "1", "of the initial vector to each order, in the norm of the linear strain energy"),
    Field("uniform_difference", "1", "of the uniform expansion's initial vector to each order"),
)
_ORDERS = (
    Field("frequency_orders", "1", "observed orders of the frequency's difference between neighbouring factors"),
    Field("initial_orders", "1", "the same of the initial vector"),
    Field("expected_orders", "1", "those of the initial vector against the uniform expansion"),
    Field("uniform_orders", "1", "those of the uniform expansion's initial vector"),
)


def write_relaxed(
    parent: h5py.Group, relaxed: RelaxedComparison, position: h5py.Dataset, coordinate: h5py.Dataset
) -> None:
    """Write the group ``thesis``; ``position`` and ``coordinate`` are the scales of stations and coordinates."""
    group = parent.create_group("thesis")
    group.attrs.update({name: getattr(relaxed, name) for name in _RELAXED_NUMBERS})
    factor = put(group, _FACTOR, relaxed.factor, scale=True)
    for field in (*_RELAXED, *_FLAGS):
        put(group, field, getattr(relaxed, field.name), factor)
    put(group, _COORDINATES, relaxed.coordinates, factor, coordinate)
    put(group, _SHAPE, relaxed.initial_displacement, factor, position)
    put(group, _FATE, np.array(relaxed.fate, dtype=h5py.string_dtype("utf-8")), factor)


def read_relaxed(parent: h5py.Group) -> RelaxedComparison | None:
    """Inverse of `write_relaxed`; None where there is no such group."""
    if "thesis" not in parent:
        return None
    group = parent["thesis"]
    return RelaxedComparison(
        **native(group, *_RELAXED_NUMBERS),
        **{field.name: group[field.name][()] for field in (_FACTOR, *_RELAXED, _COORDINATES, _SHAPE)},
        **{field.name: group[field.name][()].astype(bool) for field in _FLAGS},
        fate=tuple(texts(group["fate"])),
    )


def write_expansion(
    parent: h5py.Group, comparison: ExpansionComparison, position: h5py.Dataset, coordinate: h5py.Dataset
) -> None:
    """Write the group ``multiple_scales`` of a nonlinear mode; the scales are those of stations and coordinates."""
    group = parent.create_group("multiple_scales")
    path = comparison.path
    group.attrs.update({name: getattr(path, name) for name in _PATH_NUMBERS})
    factor = put(group, _FACTOR, path.factor, scale=True)
    order = put(group, Field("order", "1", "order of the expansion"), np.arange(3), scale=True)
    step = put(group, _STEP, np.arange(1, path.factor.size), scale=True)
    third = {_SHAPE.name: (position,), _COORDINATES.name: (coordinate,), "uniform_coordinates": (coordinate,)}
    for field in _PATH:
        put(group, field, getattr(path, field.name), factor, order, *third.get(field.name, ()))
    for field in _DIFFERENCES:
        put(group, field, getattr(comparison, field.name), factor, order)
    for field in _ORDERS:
        put(group, field, getattr(comparison, field.name), step, order)
    own = group.create_group("exact")
    for field in _EXACT:
        put(own, field, getattr(comparison.exact, field.name), factor, *third.get(field.name, ()))


def read_expansion(parent: h5py.Group) -> ExpansionComparison | None:
    """Inverse of `write_expansion`; None where there is no such group."""
    if "multiple_scales" not in parent:
        return None
    group = parent["multiple_scales"]
    factor = group[_FACTOR.name][()]
    path = ExpansionPath(
        **native(group, *_PATH_NUMBERS),
        factor=factor,
        stations=read_stations(parent),
        **{field.name: group[field.name][()] for field in _PATH},
    )
    exact = ExactModes(factor=factor, **{field.name: group["exact"][field.name][()] for field in _EXACT})
    return ExpansionComparison(path, exact, **{field.name: group[field.name][()] for field in _DIFFERENCES + _ORDERS})
