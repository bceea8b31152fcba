"""The bound on what samples of a motion of very many equal pieces fold, see `beamsim.flow.fourier_kernels.folded`.

Where two whole pieces follow each other in one contact state, only the jumps of the inputs' derivatives count. These
are linear in the amplitudes on either side, so that they come from products of matrices.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import comb, pi

import numpy as np

from beamsim.flow.basis import as_real, basis_derivatives
from beamsim.flow.equal_pieces import Segments, alike, amplitudes, blocks, output_map
from beamsim.flow.fourier_kernels import BERNOULLI, CONVERGENT, ORDERS
from beamsim.typing import Complexes, Floats, Ints


def folded_alike(
    motion: Segments, table: Complexes, dropped: Complexes, step: float, reach: float, out: Floats
) -> Ints:
    """Add the bound from the joints of whole pieces to ``out`` (k,); returns the numbers of the other joints.

    Joint g is where segment g begins; that after the last segment is its end.
    """
    count, k = motion.time.size, table.shape[2]
    groups, _ = alike(motion, np.arange(count), motion.length)
    grouped = np.zeros(count, dtype=bool)
    for group in groups:
        grouped[group.entries] = True
    smooth = np.zeros(count + 1, dtype=bool)
    smooth[1:count] = grouped[1:] & grouped[:-1] & (motion.state[1:] == motion.state[:-1])
    after, before = np.zeros((count, ORDERS * k)), np.zeros((count, ORDERS * k))
    for group in groups:
        tables = motion.flow.states[group.state]
        slow = (np.abs(tables.exponent) + reach) * step / (2.0 * pi) < CONVERGENT
        starts, ends = (
            np.hstack([
                output_map(motion, group.state, np.where(slow, of_order, 0.0), table[group.state])
                for of_order in basis_derivatives(tables.exponent, tables.power, tau, ORDERS)
            ])
            for tau in (0.0, group.tau)
        )  # fmt: skip
        size = np.abs(dropped[group.state, : tables.term_basis.size])
        lam = tables.exponent[tables.term_basis]
        fast = np.any(size > 0, axis=1)
        size[fast] *= ((1.0 + np.exp(lam.real * group.tau)) / (np.abs(lam) - reach))[fast, None]
        left_out = np.zeros((starts.shape[0] // 2, k))
        np.add.at(left_out, tables.term_source, size)
        for part in blocks(group):
            zeta = amplitudes(motion, group.state, part)
            after[part], before[part] = as_real(zeta) @ starts, as_real(zeta) @ ends
            out += np.abs(zeta[smooth[part]]).sum(axis=0) @ left_out
    jumps = np.abs(after[1:] - before[:-1])[smooth[1:count]].sum(axis=0).reshape(ORDERS, k)
    scale = [BERNOULLI[order] * step ** (order + 1) for order in range(ORDERS)]
    factor = [
        sum(scale[order] * comb(order, m) * reach ** (order - m) for order in range(m, ORDERS)) for m in range(ORDERS)
    ]
    out += np.array(factor) @ jumps
    return np.flatnonzero(~smooth)


def runs(numbers: Ints) -> Iterator[tuple[int, int]]:
    """First and last, this one left out, of the runs of consecutive numbers among increasing ones."""
    ends = np.flatnonzero(np.diff(numbers) != 1)
    for first, last in zip(np.append(0, ends + 1), np.append(ends, numbers.size - 1), strict=True):
        yield int(numbers[first]), int(numbers[last]) + 1
