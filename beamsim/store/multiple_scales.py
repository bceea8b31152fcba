"""The group ``multiple_scales`` of the files of ``beamsim nnm`` and ``beamsim sweep``: expansions beside exact motions.

Beside a response curve, ``multiple_scales/<n>`` is one level. Beside a nonlinear mode the group is one expansion.
"""

from __future__ import annotations

from collections.abc import Sequence

import h5py
import numpy as np

from beamsim.analyses.response.result import ForcedExpansionComparison
from beamsim.store.datasets import named_group, native, ordered, put
from beamsim.store.schema import Field

GROUP = "multiple_scales"
_FREQUENCY = Field("frequency_hz", "Hz", "excitation frequency")
_STABLE = Field("stable", "1", "whether the slow flow contracts", ("unstable", "stable"))
_BACKBONE = Field("backbone_hz", "Hz", "frequency of the nonlinear mode of the same amplitude, to first order")
_LEADING = Field("leading", "m", "largest deflection of a period, to leading order")
_FIRST = Field("first", "m", "largest deflection of a period, to first order")
_FACTOR = Field("factor", "1", "factor of springs, damping and force")
_AT = Field("factor_frequency_hz", "Hz", "excitation frequency at the factor")
_DIFFERENCE = Field("difference", "1", "from the exact motion, against its size: leading and first order")
_ORDERS = Field("orders", "1", "observed orders between a factor and the next")
_AGREES = Field("stability_agrees", "1", "whether exact and slow stability agree", ("no", "yes"))


def write_forced_expansion(parent: h5py.Group, comparisons: Sequence[ForcedExpansionComparison]) -> None:
    """Write the group; nothing where there are no comparisons."""
    for index, c in enumerate(comparisons):
        group = parent.create_group(f"{GROUP}/{index}")
        names = ("level", "mode", "linear_frequency_hz")
        group.attrs.update({name: getattr(c, name) for name in names} | {"index": index})
        number = put(group, Field("point", "1", "number of the point"), np.arange(1, c.stable.size + 1), scale=True)
        for field in (_FREQUENCY, _STABLE, _BACKBONE):
            put(group, field, getattr(c, field.name), number)
        for k, name in enumerate(c.leading):
            probe = named_group(group, "probes", name, k)
            put(probe, _LEADING, c.leading[name], number)
            put(probe, _FIRST, c.first[name], number)
        factor = put(group, _FACTOR, c.factor, scale=True)
        order = put(group, Field("order", "1", "order of the expansion"), np.array([0, 1]), scale=True)
        step = put(group, Field("step", "1", "number of the step"), np.arange(1, c.factor.size), scale=True)
        put(group, _AT, c.factor_frequency_hz, factor)
        put(group, _DIFFERENCE, c.difference, factor, order)
        put(group, _ORDERS, c.orders, step, order)
        put(group, _AGREES, c.stability_agrees, factor)


def read_forced_expansion(parent: h5py.Group) -> tuple[ForcedExpansionComparison, ...]:
    """Inverse of `write_forced_expansion`."""
    return tuple(_read(group) for group in ordered(parent, GROUP))


def _read(group: h5py.Group) -> ForcedExpansionComparison:
    probes = ordered(group, "probes")
    plain = (_FREQUENCY, _BACKBONE, _FACTOR, _AT, _DIFFERENCE, _ORDERS)
    return ForcedExpansionComparison(
        **native(group, "level", "mode", "linear_frequency_hz"),
        **{field.name: group[field.name][()] for field in plain},
        stable=group["stable"][()].astype(bool),
        stability_agrees=group["stability_agrees"][()].astype(bool),
        leading={str(p.attrs["name"]): p["leading"][()] for p in probes},
        first={str(p.attrs["name"]): p["first"][()] for p in probes},
    )
