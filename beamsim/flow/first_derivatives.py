"""To which side a motion that starts at a border goes: the first derivative there that is not zero decides."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from beamsim.flow.contact_state import LinearOutput
from beamsim.typing import Floats, Ints

ROUND_OFF = 1e-12  # of the terms of a derivative: below it the derivative counts as zero
EPS = 1e-15  # round-off of a state and of what makes up its rate
HIGHEST_DERIVATIVE = 6  # that is looked at
USUAL_DERIVATIVE = 3  # that decides under most loads: higher ones are computed where it does not


class InputsAtStart(NamedTuple):
    """Derivatives of the inputs and, beside them, of their slopes, from order 0 on: (orders, 2 F) each."""

    value: Floats
    size: Floats  # before parts cancel
    fit: Floats  # round-off of fitted ones


class FunctionsAtStart(NamedTuple):
    """Functions whose first derivatives are sought, and below them the time derivative of the state."""

    functions: int  # how many
    row: Floats  # (functions + N, N)
    load: Floats  # (functions + N, 2 F) for a unit of each input, then of each slope
    row_size: Floats  # absolute values
    load_size: Floats

    @classmethod
    def of(cls, output: LinearOutput, count: int) -> FunctionsAtStart:
        """From an output of which the first ``count`` are the functions."""
        load = np.hstack([output.direct, output.direct_slope])
        return cls(count, output.row, load, np.abs(output.row), np.abs(load))

    def signs(self, inputs: InputsAtStart, state: Floats, highest: int) -> tuple[Floats, Ints]:
        """Signs and orders of the first derivatives that are beyond their round-off, see `decisive`.

        Parameters
        ----------
        inputs : with as many derivatives at least.
        state : (N,).
        highest : order up to which derivatives are looked at.

        Returns
        -------
        signs, orders : (functions,).
        """
        count, load_size, orders = self.functions, self.load_size.T, highest + 1
        rates, rates_size, size = self.row[count:], self.row_size[count:], self.row_size.T
        driven = inputs.value[:orders] @ self.load.T
        y = np.empty((orders, state.size))  # the state and its derivatives
        y[0] = state
        for order in range(1, orders):
            y[order] = rates @ y[order - 1] + driven[order - 1, count:]
        terms = np.abs(y) @ size + inputs.size[:orders] @ load_size
        hidden = inputs.fit[:orders] @ load_size
        added = EPS * terms + hidden
        doubt = np.empty_like(y)
        doubt[0] = EPS * np.abs(state)
        for order in range(1, orders):
            doubt[order] = rates_size @ doubt[order - 1] + added[order - 1, count:]
        value = y @ self.row[:count].T + driven[:, :count]
        return decisive(value, (ROUND_OFF * terms + hidden)[:, :count] + doubt @ size[:, :count])


def decisive(value: Floats, doubt: Floats) -> tuple[Floats, Ints]:
    """(k,) signs and orders of the first derivatives that are beyond their round-off; a sign is 0 where none is.

    ``value`` and ``doubt`` are (orders, k), from order 0 on.
    """
    beyond = np.abs(value) > doubt
    first = beyond.argmax(axis=0)
    at = first, np.arange(first.size)
    return np.where(beyond[at], np.sign(value[at]), 0.0), first
