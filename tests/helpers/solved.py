"""Commands on shipped configs that several tests read, executed once in a session by the worker that asks first."""

from __future__ import annotations

import contextlib
import hashlib
import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from durations import REUSED_S, spent
from shipped import config_path, shipped

from tests.helpers.commands import invoke

ROOT = Path(__file__).parents[2]
SHORTENED = {
    "chain_bumpers sweep": ("sweep.from=10 Hz", "sweep.to=11 Hz"),
    "continuation_60_120hz sweep": ("sweep.from=96 Hz", "sweep.to=120 Hz", "sweep.seek_at=0"),
    "continuation_friction sweep": ("sweep.from=4.95 Hz", "sweep.to=5.05 Hz", "sweep.levels=[6 N]"),
    "continuation_overlay sweep": ("sweep.from=80 Hz", "sweep.to=86 Hz"),
    "design_robust sweep": (
        "vary.tolerances.samples=3", "vary.tolerances.quantile=0.5", "vary.parameters[0].points=2",
    ),
    "design_tolerances sweep": ("vary.samples=10",),
    "identify_nonlinear identify-stiffness": (
        "identify_stiffness.nonlinear.starts=1", "identify_stiffness.nonlinear.profiles=false",
    ),
    "earthquake run": ("run.duration=4 s", "run.convergence=off"),
    "plate_panel run": ("run.duration=0.3 s",),
    "nnm_forced_backbone nnm": ("nnm.phase_resonance.levels=[1 g]",),
    "nnm_forced_mode_1 nnm": ("nnm.phase_resonance.levels=[1 g]", "nnm.phase_resonance.periods=5"),
    "sweep_backlash sweep": ("sweep.from=40 Hz", "sweep.to=100 Hz", "sweep.rate=16 oct/min", "sweep.levels=[2 g]"),
    "sweep_notched sweep": ("sweep.to=67 Hz",),
    "sweep_one_sided_2g sweep": ("sweep.from=50 Hz", "sweep.to=110 Hz", "sweep.rate=32 oct/min"),
    "sweep_up_down sweep": ("sweep.from=50 Hz", "sweep.to=110 Hz", "sweep.rate=32 oct/min", "sweep.levels=[1 g]"),
    "vibeams_backbone nnm": ("nnm.phase_resonance.levels=[0.028 m/s^2]", "nnm.phase_resonance.periods=5"),
    "vibeams sweep": ("sweep.from=28.5 Hz", "sweep.to=28.7 Hz", "sweep.levels=[0.028 m/s^2]"),
}  # fmt: skip
"""Config and command -> changes that make it short for those who read its screen, its file or its pictures."""
PATIENCE_S = 1800.0
"""How long a worker waits for another one that executes the same command."""


@dataclass(frozen=True)
class Solved:
    """What a command printed, how it ended, and the folder of the files that it wrote."""

    exit_code: int
    stdout: str
    output: str
    processor_time_s: float
    folder: Path

    @property
    def file(self) -> Path:
        """The result file."""
        (file,) = self.folder.glob("*.h5")
        return file


Solve = Callable[..., Solved]
"""Called with the words of a command, the config by its path from the root of the repository."""


@dataclass
class SharedCommands:
    """Executes commands in a folder that all workers of a session have, and each only once."""

    folder: Path

    def __call__(self, *words: str) -> Solved:
        """What came of a command; nothing may change its files."""
        name = f"{Path(words[1]).stem}-{hashlib.sha256(json.dumps(words).encode()).hexdigest()[:12]}"
        folder, record = self.folder / name, self.folder / f"{name}.json"
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            wait_for(record)
            done = Solved(**json.loads(record.read_text(encoding="utf-8")), folder=folder)
            REUSED_S.append(done.processor_time_s)
            return done
        done = execute(words, folder)
        written = {name: value for name, value in vars(done).items() if name != "folder"}
        record.with_suffix(".part").write_text(json.dumps(written), encoding="utf-8")
        record.with_suffix(".part").replace(record)
        return done


def wait_for(path: Path) -> None:
    """Return when a file is there.

    Raises
    ------
    TimeoutError
        If it does not appear, as the worker that was to write it has ended.
    """
    end = time.monotonic() + PATIENCE_S
    while not path.exists():
        if time.monotonic() > end:
            raise TimeoutError(f"{path} was not written in {PATIENCE_S:g} s")
        time.sleep(0.05)


def execute(words: tuple[str, ...], folder: Path) -> Solved:
    """Execute a command without plots, and studies without worker processes, which cost more than they save here."""
    before = spent()
    with contextlib.chdir(ROOT):
        several = ["--workers", "1"] if words[0] == "sweep" and has_cases(Path(words[1])) else []
        done = invoke(*words, *several, "--no-plots", "-o", f"{folder}/")
    return Solved(done.exit_code, done.stdout, done.output, spent() - before, folder)


def has_cases(path: Path) -> bool:
    """Whether the sweep of a shipped config has cases that several workers can solve."""
    scenario = shipped(config_path(path.stem))
    return scenario.study is not None or (scenario.sweep is not None and scenario.sweep.kind == "coexisting")


def words_of(command: str, path: Path) -> tuple[str, ...]:
    """The words of a command on a shipped config, which is shortened where it is long."""
    changes = (word for change in SHORTENED.get(f"{path.stem} {command}", ()) for word in ("--set", change))
    return command, path.relative_to(ROOT).as_posix(), *changes
