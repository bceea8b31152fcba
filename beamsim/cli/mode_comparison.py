"""Texts of the table of ``beamsim compare-modes``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from beamsim.analyses.compare_modes.result import ModeComparison


def _pairs(result: ModeComparison, pairs: Sequence[Mapping[str, Any]]) -> Iterator[tuple[str, str]]:
    yield "", f"of {result.source}, with those of the structure, contacts {result.contacts}"
    for pair in pairs:
        measured = f"  measured {pair['number']}"
        if not pair["predicted"]:
            yield (
                measured,
                f"{pair['measured_hz']:9.4g} Hz   no computed mode fits, the largest MAC is {pair['mac']:.3f}",
            )
            continue
        yield (
            measured,
            (
                f"{pair['measured_hz']:9.4g} Hz   computed {pair['predicted']:<3d}{pair['predicted_hz']:9.4g} Hz   "
                f"{100 * pair['difference']:+7.2f} %   MAC {pair['mac']:.3f}"
            ),
        )


TEXTS = {"pairs": _pairs, "lowest_mac": lambda _, mac: f"{mac:.3f}"}
