"""Stated errors of every shipped run and swept sine, compared with four and eight times the modes and elements.

    python -m benchmarks.convergence_of_configs [--resume | NAME ...]

writes `docs/convergence.csv` after each configuration, from where it ended with `--resume`, or prints the rows of
the named configurations alone. A row is a printed value: its
configuration, name, value, stated error, and its difference from the finest model, relative to the larger of both as
stated errors are. Left out are values that the program itself calls one of many motions, or without a limit. Long
motions are shortened, and the finest model is the one with four times the modes where that takes long.
"""

from __future__ import annotations

import csv
import math
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import beamsim
from beamsim.scenario import Scenario
from beamsim.trust.convergence import comparable_values, numbers_by_place, relative_changes

ROOT = Path(__file__).parents[1]
TABLE = ROOT / "docs/convergence.csv"
SHORTENED: dict[str, dict[str, Any]] = {
    "earthquake": {"run.duration": 1.0},
    "plate_panel": {"run.duration": 0.4},
    "random_vibration": {"run.duration": 1.0},
    "shock_matched": {"run.duration": 0.1},
    "sweep_one_sided_2g": {"sweep.rate": "32 oct/min", "sweep.levels": ["2 g"]},
    "sweep_up_down": {"sweep.rate": "32 oct/min"},
    "sweep_notched": {"sweep.rate": "16 oct/min"},
}
LONG_S = 12.0  # processor time of the model with four times the modes, above which there is none with eight
NOISE = 1e-6  # relative: the program states no smaller error


class Row(NamedTuple):
    """One printed value."""

    config: str
    quantity: str  # ``entry.place`` of the summary
    value: float
    stated: float  # relative error
    true: float  # relative difference from the finest model
    times: int  # the modes of the finest model, over those of the configuration

    @property
    def over(self) -> float:
        """True over stated error."""
        return self.true / max(self.stated, NOISE)


def cases(names: Sequence[str]) -> Iterator[tuple[str, str, Scenario]]:
    """Name, command and scenario of the configurations that are computed."""
    for path in sorted((ROOT / "configs").rglob("*.yaml"), key=lambda path: path.stem):
        if names and path.stem not in names:
            continue
        scenario = beamsim.load_scenario(path)
        kind = None if scenario.sweep is None else scenario.sweep.kind
        if scenario.run is not None and (scenario.sweep is None or scenario.study is not None):
            yield path.stem, "run", beamsim.load_scenario(path, SHORTENED.get(path.stem, {}))
        elif kind in ("swept_sine", "stepped") and scenario.study is None:
            yield path.stem, "sweep", beamsim.load_scenario(path, SHORTENED.get(path.stem, {}))


def solved(command: str, scenario: Scenario, **changes: Any) -> Any:
    """The result of a command."""
    return (beamsim.run if command == "run" else beamsim.sweep)(beamsim.load_scenario(scenario, changes or None))


def finer(scenario: Scenario, modes: int, doublings: int, command: str) -> Scenario:
    """The same case with so many modes and its elements doubled a few times, without a comparison of its own."""
    for _ in range(doublings):
        scenario = scenario.refine(modes)
    return beamsim.load_scenario(scenario, {f"{command}.convergence": "off"})


def rows_of(name: str, command: str, scenario: Scenario) -> list[Row]:
    """The printed values of one configuration."""
    result = solved(command, scenario)
    stated, summary = result.summary.get("convergence") or {}, result.summary
    if not stated or not (summary.get("convergence_model") or {}).get("modes"):
        return []  # all modes kept, or no comparison
    kept, truth, times = summary["kept_modes"], None, 0
    for factor, doublings in ((4, 2), (8, 3)):
        begin = time.process_time()
        truth, times = solved(command, finer(scenario, factor * kept, doublings, command)).summary, factor
        if time.process_time() - begin > LONG_S:
            break
    assert truth is not None
    entries = [entry for entry in stated if entry in summary and entry in truth and entry != "spectral_lines"]
    own, other = (
        comparable_values(
            {entry: values[entry][:kept] if entry.endswith("frequencies_hz") else values[entry] for entry in entries}
        )
        for values in (summary, truth)
    )
    differences, values = dict(numbers_by_place(relative_changes([own], [other]))), dict(numbers_by_place(own))
    apart = {*(summary.get("without_limit") or ()), *summary.get("after_divergence", ())}
    return [
        Row(name, key, values[key], error, differences[key], times)
        for key, error in numbers_by_place(stated)
        if key in differences and key not in apart and math.isfinite(values[key])
    ]


def judged(rows: Sequence[Row]) -> str:
    """How many of the values are further off than stated."""
    over = [row for row in rows if row.over > 1.0]
    twice = [row for row in rows if row.over > 2.0]
    worst = max(rows, key=lambda row: row.over)
    share = 100.0 * len(over) / len(rows)
    return (
        f"{len(rows)} values; true error above the stated one: {len(over)} ({share:.2g} %); above twice: {len(twice)}; "
        f"largest ratio {worst.over:.2f} ({worst.config} {worst.quantity})"
    )


def write(rows: Sequence[Row], path: Path = TABLE) -> None:
    """The table, with date and commit in its first lines."""
    commit = subprocess.run(
        ["git", "rev-parse", "--short=8", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(f"# {datetime.now(UTC).date()}, commit {commit.stdout.strip()}\n# {judged(rows)}\n")
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["config", "quantity", "value", "stated_error", "true_error", "times_the_modes"])
        for row in rows:
            table.writerow([*row[:2], f"{row.value:.6g}", f"{row.stated:.3g}", f"{row.true:.3g}", row.times])


def stored(path: Path = TABLE) -> list[Row]:
    """The rows of the table."""
    with path.open(encoding="utf-8") as file:
        table = csv.DictReader(line for line in file if not line.startswith("#"))
        numbers = ("value", "stated_error", "true_error")
        return [
            Row(row["config"], row["quantity"], *(float(row[name]) for name in numbers), int(row["times_the_modes"]))
            for row in table
        ]


def main(arguments: Sequence[str]) -> None:
    """Compute, write or print."""
    names = [name for name in arguments if name != "--resume"]
    rows = stored() if "--resume" in arguments else []
    known = {row.config for row in rows}
    for name, command, scenario in cases(names):
        if name in known:
            continue
        begin = time.process_time()
        found = rows_of(name, command, scenario)
        rows += found
        worst = max((row.over for row in found), default=0.0)
        used = time.process_time() - begin
        print(
            f"{name:24} {command:6} {len(found):4} values, true over stated at most {worst:.2f}, {used:.1f} s",
            flush=True,
        )
        for row in found if names else [row for row in found if row.over > 1.0]:
            print(
                f"    {row.quantity:45} {row.value:12.6g}  {row.stated:9.3g} {row.true:9.3g} {row.over:6.2f}",
                flush=True,
            )
        if rows and not names:
            write(rows)
    if rows:
        print(judged(rows))


if __name__ == "__main__":
    main(sys.argv[1:])
