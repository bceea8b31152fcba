"""What tests ask of branches of periodic motions: their special points, and complex values."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from types import SimpleNamespace

import pytest

from beamsim.orbits.continuation import Settings

COLUMNS = ("branch", "kind", "parameter", "frequency_hz", "snubber", "time_s")


@contextmanager
def long_steps() -> Iterator[None]:
    """Branches are followed in few long steps: for tests that compare their ends, or a point that they ask for."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("beamsim.orbits.tracing.Settings", partial(Settings, step=0.1, largest_step=0.25))
        yield


def events_of(result, branch=None):
    """The special points of a result, each with its columns as attributes; of one branch where its number is given."""
    table = result["special_points"]
    rows = zip(*(table[name].values.tolist() for name in COLUMNS), strict=True)
    points = [SimpleNamespace(**dict(zip(COLUMNS, row, strict=True))) for row in rows]
    return [point for point in points if branch in (None, point.branch)]


def peaks_of(points, name, quantity="displacement", end="peak"):
    """(np,) largest magnitudes of a quantity at a probe or snubber; with ``end`` max or min the extremes."""
    return points[f"{end}_{quantity}"].by_label()[name].values


def multipliers(branch):
    """(np, m) complex Floquet multipliers."""
    real, imaginary = (branch[f"floquet_multipliers_{part}"].values for part in ("real", "imag"))
    return real + 1j * imaginary


def of_kind(result, kind):
    """The branches of a kind, such as tongue."""
    return [branch for branch in result.branches if branch["kind"].item() == kind]
