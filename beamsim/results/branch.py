"""The labelled datasets of branches of periodic motions, in SI units.

One table has a row for each branch, another a row for each point of all branches, one branch after the other.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from beamsim.labelled import Dataset, Layout, Variable
from beamsim.orbits.branch import SpecialPoint
from beamsim.outcomes import Outcome
from beamsim.typing import Floats

LARGEST_EVEN = 1e-7  # share of even harmonics of motions that are symmetric but for round-off
_BRANCH, _POINT, _PROBE, _SNUBBER, _OUTPUT = ("branch",), ("point",), ("probe",), ("snubber",), ("output",)
_COORDINATES, _MULTIPLIERS = (*_POINT, "coordinate"), (*_POINT, "multiplier")
FLAGS = ("unstable", "stable")
ENDED = {
    "status": "how it ended, or why it stopped early and what to try",
    "outcome": "code of how it ended",
    "outcome_numbers": "numbers that belong to how it ended, JSON object",
}
"""Columns that say how each row ended, with their meanings."""


def outcome_variables(dims: tuple[str, ...]) -> dict[str, Variable]:
    """The variables of how each row of a table along dimensions ended."""
    return {name: Variable(dims, "", meaning, str) for name, meaning in ENDED.items()}


def endings(outcomes: Iterable[Outcome]) -> dict[str, list[str]]:
    """The values of these variables."""
    texts = [outcome.as_texts() | {"status": outcome.of_part} for outcome in outcomes]
    return {name: [of[name] for of in texts] for name in ENDED}


# --- What every kind of branch has -----------------------------------------------------------------------------------

OF_BRANCHES = {
    "branch": Variable(_BRANCH, "1", "number of the branch, from 0", int),
    "kind": Variable(_BRANCH, "", "response, backbone, tongue or non_brake", str),
    **outcome_variables(_BRANCH),
}
_OF_POINTS = {
    "point": Variable(_POINT, "1", "number of the point", int),
    "point_number": Variable(_POINT, "1", "number of the point along its branch, from 1", int),
    "frequency_hz": Variable(_POINT, "Hz", "frequency of the excitation, or of a free motion"),
    "parameter": Variable(_POINT, "{unit}", "{parameter}"),
    "residual": Variable(_POINT, "1", "largest periodicity error, relative to the size of the motion"),
    "coordinate": Variable(("coordinate",), "1", "number of the coordinate", int),
    "coordinates": Variable(
        _COORDINATES, "kg^0.5 m",
        "coordinates at phase zero of the excitation; of a free motion at its slowest instant",
    ),
    "coordinate_velocities": Variable(_COORDINATES, "kg^0.5 m/s", "their velocities then; zero for a brake orbit"),
    "internal_state": Variable(("internal_state",), "1", "number of the internal state", int),
    "internal_states": Variable((*_POINT, "internal_state"), "m", "internal states of the contacts at that time"),
}  # fmt: skip
OF_MOTIONS = {
    **_OF_POINTS,
    "branch": Variable(_POINT, "1", "number of the branch, from 0", int, names="branches/branch"),
    "stable": Variable(_POINT, "1", "whether the motion is stable", bool, flags=FLAGS),
    "multiplier": Variable(("multiplier",), "1", "number of the Floquet multiplier", int),
    "floquet_multipliers_real": Variable(_MULTIPLIERS, "1", "Floquet multipliers, real part"),
    "floquet_multipliers_imag": Variable(_MULTIPLIERS, "1", "Floquet multipliers, imaginary part"),
    "energy_error": Variable(
        _POINT, "1",
        "imbalance of the energies over a period, relative to the energy; of harmonic balance not its truncation",
    ),
}  # fmt: skip
_EVENT = ("event",)
SPECIAL_POINTS = Layout(
    "special_points",
    "Folds, bifurcations and grazings of all branches, one branch after the other.",
    {
        "event": Variable(_EVENT, "1", "number of the special point", int),
        "branch": Variable(_EVENT, "1", "number of the branch, from 0", int, names="branches/branch"),
        "kind": Variable(
            _EVENT, "", "fold, nonsmooth_fold, period_doubling, neimark_sacker, branch_point, grazing, …", str
        ),
        "parameter": Variable(_EVENT, "{unit}", "parameter of the branch"),
        "frequency_hz": Variable(_EVENT, "Hz", "frequency"),
        "snubber": Variable(_EVENT, "", "snubber that grazes; empty where none does", str),
        "time_s": Variable(_EVENT, "s", "time in the period of a grazing; NaN of other points"),
    },
)


class SpecialRow(NamedTuple):
    """A special point in SI units."""

    kind: str
    parameter: float
    frequency_hz: float
    snubber: str = ""
    time_s: float = np.nan


def special_row(point: SpecialPoint, value: float, frequency_hz: float, contact_names: Sequence[str]) -> SpecialRow:
    """A special point in SI units.

    Parameters
    ----------
    point : as it was located.
    value : of the parameter, as people read it.
    frequency_hz : of the motion, Hz.
    contact_names : (m,) of the system's contacts.

    Returns
    -------
    SpecialRow
        With the name of the contact that grazes, empty where none does.
    """
    name = contact_names[point.contact] if point.contact >= 0 else ""
    return SpecialRow(point.kind, value, frequency_hz, name, point.time)


def special_points_table(rows: Sequence[Sequence[SpecialRow]], unit: str) -> Dataset:
    """The dataset of the special points of branches whose parameter has a unit."""
    branch = np.repeat(np.arange(len(rows)), np.array([len(of) for of in rows], dtype=np.int64))
    flat = [row for of in rows for row in of]
    columns = {name: [getattr(row, name) for row in flat] for name in SpecialRow._fields}
    return SPECIAL_POINTS.dataset({"event": np.arange(1, len(flat) + 1), "branch": branch, **columns}, unit=unit)


def row_numbers(sizes: Sequence[int], column: str, dim: str = "point") -> dict[str, Any]:
    """Numbers of the rows of a table along a dimension, and of their owners in a column, from the sizes of these."""
    owner = np.repeat(np.arange(len(sizes)), np.array(sizes, dtype=np.int64))
    return {dim: np.arange(1, sum(sizes) + 1), column: owner}


def numbered_points(sizes: Sequence[int], column: str = "branch") -> dict[str, Any]:
    """Numbers of points, of their owners in a column, and within these, from the sizes of the owners."""
    within = [np.arange(1, size + 1) for size in (0, *sizes)]
    return row_numbers(sizes, column) | {"point_number": np.concatenate(within)}


def of_states(states: Floats, n: int) -> dict[str, Any]:
    """The values of states (np, N) with n coordinates."""
    internal = states[:, 2 * n :]
    values = {
        "coordinate": np.arange(1, n + 1),
        "coordinates": states[:, :n],
        "coordinate_velocities": states[:, n : 2 * n],
    }
    if not internal.shape[1]:
        return values
    return values | {"internal_state": np.arange(1, internal.shape[1] + 1), "internal_states": internal}


def of_multipliers(multipliers: Sequence[Any]) -> dict[str, Any]:
    """The values of Floquet multipliers (np, m) of each branch; NaN where another branch has more."""
    count = max((of.shape[1] for of in multipliers), default=0)
    whole = np.full((sum(len(of) for of in multipliers), count), complex(np.nan, np.nan))
    begin = 0
    for of in multipliers:
        whole[begin : begin + len(of), : of.shape[1]] = of
        begin += len(of)
    return {
        "multiplier": np.arange(1, count + 1),
        "floquet_multipliers_real": whole.real,
        "floquet_multipliers_imag": whole.imag,
    }


def rows_by_owner(owners: Dataset, rows: Dataset, column: str) -> tuple[Dataset, ...]:
    """The rows of a table by the owners that a column numbers.

    Parameters
    ----------
    owners : a row for each, along the dimension that is called as the column.
    rows : those of one owner after those of another.
    column : of these.

    Returns
    -------
    tuple of Dataset
        For each owner its rows, with what its own row says besides as variables without dimensions.
    """
    numbers, (dim,), labels = rows[column].values, rows[column].dims, owners.labels(column)
    edges = np.searchsorted(numbers, np.arange(len(labels) + 1)).tolist()
    found = []
    for label, (first, end) in zip(labels, pairwise(edges), strict=True):
        about, own = owners.sel(**{column: label}), rows.isel(**{dim: slice(first, end)})
        of_owner = {f"/{rows.name}/{name}": about.items_by_path[f"/{owners.name}/{name}"] for name in about}
        found.append(Dataset(rows.name, of_owner | own.items_by_path))
    return tuple(found)


# --- Forced motions --------------------------------------------------------------------------------------------------

BRANCHES = Layout(
    "branches",
    "The branches of forced periodic motions, a row for each.",
    {
        **OF_BRANCHES,
        "level": Variable(_BRANCH, "{level_unit}", "level of the excitation; NaN if it is the parameter"),
        "period_multiple": Variable(_BRANCH, "1", "periods of the excitation in one of the motion", int),
        "followed": Variable((), "", "what is followed: frequency, level, gap, stiffness or position", str),
        "followed_snubber": Variable((), "", "snubber whose number that is; else empty", str),
    },
)


def _extremes(dims: tuple[str, ...], quantity: str, unit: str) -> dict[str, Variable]:
    """The variables of the extremes of a quantity of every motion."""
    name = quantity.replace("_", " ")
    dims = (*dims, *_POINT)
    return {
        f"max_{quantity}": Variable(dims, unit, f"largest {name} of a cycle or period", optional=True),
        f"min_{quantity}": Variable(dims, unit, f"smallest {name} of a cycle or period", optional=True),
        f"peak_{quantity}": Variable(
            dims, unit, f"largest magnitude of the {name} in a cycle or period", optional=True
        ),
    }


_HARMONIC = (*_PROBE, *_POINT, "harmonic")
POINTS = Layout(
    "points",
    "The points of all branches, one branch after the other.",
    {
        **OF_MOTIONS,
        "probe": Variable(_PROBE, "1", "name of the probe", str),
        **_extremes(_PROBE, "displacement", "m"),
        **_extremes(_PROBE, "absolute_acceleration", "m/s^2"),
        "harmonic": Variable(("harmonic",), "1", "order times period_multiple", int),
        "harmonic_displacement_real": Variable(_HARMONIC, "m", "amplitude of cos(order x phase)", optional=True),
        "harmonic_displacement_imag": Variable(
            _HARMONIC, "m", "minus the amplitude of sin(order x phase)", optional=True
        ),
        "snubber": Variable(_SNUBBER, "1", "name of the snubber", str),
        **_extremes(_SNUBBER, "force", "{force_unit}"),
        "contact_share": Variable((*_SNUBBER, *_POINT), "1", "share of the time in contact"),
        "peak_gap": Variable(
            (*_SNUBBER, *_POINT), "m",
            "largest opening of the contact in a cycle or period, where its gap is limited; NaN in a hinge",
            optional=True,
        ),
        "ring": Variable(("ring",), "1", "name of the ring", str, optional=True),
        "peak_radial_force": Variable(("ring", *_POINT), "N", "largest force of the ring", optional=True),
        "ring_penetration": Variable(("ring", *_POINT), "m", "largest penetration into the ring", optional=True),
        "peak_bending_stress": Variable(
            _POINT, "Pa", "largest bending stress along the beam in a cycle or period, where it is limited",
            optional=True,
        ),
        "output": Variable(_OUTPUT, "1", "name of the output", str),
        "output_quantity": Variable(_OUTPUT, "", "kind of output, such as bending_moment or reaction_force", str),
        "output_unit": Variable(_OUTPUT, "", "unit of the quantity", str),
        "output_at": Variable(_OUTPUT, "", "where it is: a place, a support, a joint or a body", str),
        "output_maximum": Variable((*_OUTPUT, *_POINT), "{unit}", "largest value of a cycle or period"),
        "output_minimum": Variable((*_OUTPUT, *_POINT), "{unit}", "smallest value of a cycle or period"),
        "neglected_harmonics": Variable(
            _POINT, "1", "by harmonic balance, size of the neglected harmonics relative to the motion", optional=True
        ),
    },
)  # fmt: skip
_CURVE = ("special_curve",)
SPECIAL_CURVES = Layout(
    "special_curves",
    "Curves of special points of the branches in frequency and a second parameter, and isolas, a row for each.",
    {
        "special_curve": Variable(_CURVE, "1", "number of the curve, from 0", int),
        "kind": Variable(
            _CURVE, "",
            "fold, nonsmooth_fold, period_doubling, neimark_sacker, grazing, branch_point, or isola: motions of a "
            "closed curve at one value of the second parameter",
            str,
        ),
        "level": Variable(_CURVE, "{level_unit}", "level of the excitation; NaN if it is the parameter"),
        "branch": Variable(_CURVE, "1", "number of the branch with the special point", int, names="branches/branch"),
        "start_hz": Variable(_CURVE, "Hz", "frequency of that point"),
        "touching": Variable(_CURVE, "", "contact that grazes along the whole curve; empty for other kinds", str),
        **outcome_variables(_CURVE),
        "followed": Variable((), "", "second parameter: level, gap, stiffness or position", str),
        "followed_snubber": Variable((), "", "snubber whose number that is; else empty", str),
    },
    optional=True,
)  # fmt: skip
SPECIAL_CURVE_POINTS = Layout(
    "special_curve_points",
    "The points of all curves of special points, one curve after the other.",
    {
        **_OF_POINTS,
        "special_curve": Variable(
            _POINT, "1", "number of the curve, from 0", int, names="special_curves/special_curve"
        ),
        "angle": Variable(
            _POINT, "rad",
            "angle of the multipliers on the unit circle: 0 of a fold, pi of a period doubling; NaN of grazings and "
            "isolas",
        ),
        "probe": Variable(_PROBE, "1", "name of the probe", str),
        "peak_displacement": Variable((*_PROBE, *_POINT), "m", "largest absolute displacement of a period"),
    },
    optional=True,
)  # fmt: skip
SPECIAL_CURVE_EVENTS = Layout(
    "special_curve_events",
    "Special points of curves of special points, one curve after the other.",
    {
        "event": Variable(_EVENT, "1", "number of the event", int),
        "special_curve": Variable(
            _EVENT, "1", "number of the curve, from 0", int, names="special_curves/special_curve"
        ),
        "kind": Variable(
            _EVENT, "",
            "isola, joining_branches (both extremes of a curve of folds), extremum (of another curve), cusp, "
            "resonance_1_1, resonance_1_2, resonance_1_3 or resonance_1_4",
            str,
        ),
        "frequency_hz": Variable(_EVENT, "Hz", "frequency of the excitation"),
        "parameter": Variable(_EVENT, "{unit}", "second parameter"),
    },
    optional=True,
)  # fmt: skip


def harmonics_of(branch: Dataset) -> dict[str, Any]:
    """(np, H + 1) complex amplitudes of the displacements of a branch by probe; none where they are unknown."""
    real, imaginary = (branch.by_label(f"harmonic_displacement_{part}") for part in ("real", "imag"))
    return {name: real[name].values + 1j * imaginary[name].values for name in real}


def is_symmetric(branch: Dataset) -> bool | None:
    """Whether every motion repeats with the other sign after half its period: no even harmonics.

    None where harmonics are missing, and of a period that is an even multiple of the excitation's.
    """
    harmonics = harmonics_of(branch)
    if not harmonics or branch["period_multiple"].item() % 2 == 0:
        return None
    amplitude = np.abs(np.stack(list(harmonics.values())))
    return bool(amplitude[..., ::2].max() <= LARGEST_EVEN * amplitude.max())
