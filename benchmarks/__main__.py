"""The table of speed: one row a task, each as a ratio to a reference that is measured in turns with it.

    python -m benchmarks [--only NAME ...] [--quick]

References are the march of the README's case (its contact states included), the import of the libraries that a run with
pictures needs, and for some rows another task. Absolute figures depend on the machine; `now`, `target` and the quotient
are multiples of the reference. Everything is processor time, the smallest of some repetitions. A target is a number of
references: a quotient of at most 1 meets it.
"""

from __future__ import annotations

import argparse
import os
from fnmatch import fnmatch

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # spinning idle threads would count as processor time

from benchmarks.measure import interleaved
from benchmarks.rows import ROWS, Row

SCALE = {"s": 1.0, "ms": 1e3, "us": 1e6, "MB": 1.0}


def line(row: Row, quick: bool) -> str:
    """One row of the table, measured."""
    once, target = row.prepare(quick)
    name, reference = row.reference
    value, unit = interleaved(once, reference, repeat=row.repeat and not quick)
    now = f"{SCALE[row.unit] * value:.4g} {row.unit}"
    aim = f"{SCALE[row.unit] * target * unit:.4g} {row.unit}"
    met = value / unit / target
    return f"{row.label:60s}{now:>12s}{aim:>12s}{value / unit:>10.3g}{target:>10.3g}{met:>8.2f}  {name}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    names = ", ".join(row.name for row in ROWS)
    parser.add_argument("--only", action="append", metavar="NAME", help=f"a row, or a pattern: {names}")
    parser.add_argument("--quick", action="store_true", help="one repetition of each; short studies")
    arguments = parser.parse_args()
    chosen = [row for row in ROWS if any(fnmatch(row.name, only) for only in arguments.only or ["*"])]
    if not chosen:
        parser.error(f"no such row; there are {names}")
    print(f"{'':60s}{'now':>12s}{'target':>12s}{'now':>10s}{'target':>10s}{'now /':>8s}  in units of")
    print(f"{'':104s}{'target':>8s}  (reference)")
    for row in chosen:
        try:
            print(line(row, arguments.quick), flush=True)
        except RuntimeError as error:
            print(f"{row.label:60s}not measured: {error}", flush=True)


if __name__ == "__main__":
    main()
