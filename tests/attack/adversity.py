"""Kills at random moments, full and read-only disks, damaged result files: what is left is whole, or nothing is."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import h5py
import numpy as np
from workers import Worker, invoke

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
LONG = 600.0  # s for a command; kernels may be compiled
PROGRAM = [sys.executable, "-c", "from beamsim.cli import main; main()"]
JOBS = {
    "run": ["run", str(CONFIGS / "one_sided_65hz.yaml")],
    "sweep": ["sweep", str(CONFIGS / "chain_two_dof.yaml")],
    "nnm": ["nnm", str(CONFIGS / "nnm_chain_mass_5.yaml")],
    "study": [
        "sweep",
        str(CONFIGS / "design_stiffness_gap.yaml"),
        "--set",
        "run.duration=0.1 s",
        "--set",
        "run.spectrum.last=0.1 s",
        "--workers",
        "1",
    ],
}


def _run(arguments, folder, **more):
    environment = {name: value for name, value in os.environ.items() if not name.startswith("COVERAGE_")}
    return subprocess.Popen(
        [*PROGRAM, *arguments], cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE, text=True, env=environment, **more,
    )  # fmt: skip


def _left(folder):
    """What is wrong with the files that a command left: result files that cannot be read."""
    import beamsim

    faults = []
    for path in sorted(Path(folder).iterdir()):
        if path.suffix == ".h5":
            try:
                beamsim.open_result(path)
            except Exception as error:
                faults.append(f"{path.name} cannot be read: {type(error).__name__}: {error}")
    return faults


def kills(count, seed):
    """Kill commands at random moments, with and without a chance to clean up."""
    rng = np.random.default_rng([seed, 3])
    codes, faults = Counter(), []
    usual = {}
    for k in range(count):
        name = list(JOBS)[k % len(JOBS)]
        number = [signal.SIGKILL, signal.SIGTERM, signal.SIGINT][int(rng.integers(3))]
        with tempfile.TemporaryDirectory() as folder:
            begin = time.monotonic()
            process = _run([*JOBS[name], "-o", "case.h5", "--no-plots", "-q"], folder)
            if name not in usual:  # how long it takes by itself
                process.communicate(timeout=LONG)
                usual[name] = time.monotonic() - begin
                faults += [f"{name}: {fault}" for fault in _left(folder)]
                codes[f"{name} ended with {process.returncode}"] += 1
                continue
            try:
                _, errors = process.communicate(timeout=float(rng.uniform(0.3, 1.0)) * usual[name])
                ended = True
            except subprocess.TimeoutExpired:
                ended = False
                process.send_signal(number)
                _, errors = process.communicate(timeout=LONG)
            codes["ended before" if ended else f"{number.name}: {process.returncode}"] += 1
            if not ended and number != signal.SIGKILL and process.returncode not in (0, 3, 128 + number, -number):
                faults.append(f"{name} after {number.name}: code {process.returncode}: {errors[-300:]}")
            if "Traceback" in errors and not ended and process.returncode != -number:
                faults.append(f"{name} after {number.name}: {errors[-300:]}")
            faults += [f"{name} after {number.name}: {fault}" for fault in _left(folder)]
    return codes, faults


def _limited(size):
    def limit():
        import resource

        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    return limit


def disks(count, seed):
    """Disks that fill up at a random size, and folders that cannot be written."""
    rng = np.random.default_rng([seed, 4])
    codes, faults = Counter(), []
    for k in range(count):
        name = list(JOBS)[k % (len(JOBS) - 1)]
        size = int(10 ** rng.uniform(0, 5.3))
        with tempfile.TemporaryDirectory() as folder:
            process = _run([*JOBS[name], "-o", "case.h5", "-q"], folder, preexec_fn=_limited(size))
            _, errors = process.communicate(timeout=LONG)
            codes[f"full: {process.returncode}"] += 1
            if process.returncode not in (0, 2) or "Traceback" in errors or "internal error" in errors:
                faults.append(f"{name} on a disk with {size} bytes: code {process.returncode}: {errors[-300:]}")
            faults += [f"{name} on a disk with {size} bytes: {fault}" for fault in _left(folder)]
            if process.returncode == 2 and [p for p in os.listdir(folder) if p.endswith((".tmp", ".part"))]:
                faults.append(f"{name} on a disk with {size} bytes left {os.listdir(folder)}")
    codes_of, faults_of = unwritable()
    return codes + codes_of, faults + faults_of


def unwritable():
    """Places where nobody can write a file, and a folder without permission, which does not stop the superuser."""
    codes, faults = Counter(), []
    targets = ["file/case.h5", "/proc/case.h5"]
    if os.geteuid() != 0:
        targets.append("locked/case.h5")
    for target in targets:
        with tempfile.TemporaryDirectory() as folder:
            Path(folder, "file").touch()
            Path(folder, "locked").mkdir(mode=0o500)
            _, errors = (process := _run([*JOBS["run"], "-o", target, "-q"], folder)).communicate(timeout=LONG)
            codes[f"not writable: {process.returncode}"] += 1
            if process.returncode != 2 or "Traceback" in errors or not errors.strip():
                faults.append(f"-o {target}: code {process.returncode}: {errors[-300:]}")
            faults += [f"-o {target}: {fault}" for fault in _left(folder)]
    return codes, faults


def damaged(count, seed):
    """Damaged result files in every command that reads them: code 0 or 2, with a sentence."""
    rng = np.random.default_rng([seed, 5])
    codes, faults = Counter(), []
    with tempfile.TemporaryDirectory() as folder:
        files = []
        for name in ("run", "sweep", "nnm"):
            path = Path(folder) / f"{name}.h5"
            process = _run([*JOBS[name], "-o", str(path), "--no-plots", "-q"], folder)
            process.communicate(timeout=LONG)
            files.append(path)
        with Worker(_read) as reader:
            for k in range(count):
                source = files[int(rng.integers(len(files)))]
                target = Path(folder) / "damaged.h5"
                what = _damage(source, target, rng)
                arguments = [["info"], ["plot"], ["export", "--format", "csv"], ["export", "--format", "mat"]][
                    int(rng.integers(4))
                ]
                output_folder = [] if arguments[0] == "info" else ["-o", str(Path(folder) / "out")]
                job = [arguments[0], str(target), *arguments[1:], *output_folder]
                code, output, crashed = reader.run(job, 60.0)
                codes[code] += 1
                if code not in (0, 2) or crashed:
                    faults.append(
                        f"file {k} (seed {seed}), {' '.join(arguments)} of {source.name} with {what}: "
                        f"code {code}: {output[-300:]}"
                    )
    return codes, faults


def _damage(source, target, rng):
    """Copy a file with damage: bytes changed, cut, or a dataset or attribute of another kind, shape or name."""
    data = bytearray(source.read_bytes())
    kind = int(rng.integers(4))
    if kind == 0:
        for at in rng.integers(len(data), size=int(rng.integers(1, 40))):
            data[at] = int(rng.integers(256))
        target.write_bytes(data)
        return "changed bytes"
    if kind == 1:
        target.write_bytes(data[: int(rng.integers(len(data)))])
        return "its end cut off"
    target.write_bytes(data)
    with h5py.File(target, "r+") as file:
        names = []
        file.visit(names.append)
        name = names[int(rng.integers(len(names)))]
        if kind == 2 and isinstance(file[name], h5py.Dataset):
            del file[name]
            new = [
                np.zeros((2, 3, 4)),
                np.array([]),
                "text",
                np.int8(3),
                np.array([b"a", b"b"]),
                np.full(7, np.nan),
                1j,
            ][int(rng.integers(7))]
            file[name] = new
            return f"{name} replaced by {str(new)[:20]!r}"
        holder = file[name] if rng.random() < 0.7 else file
        keys = list(holder.attrs)
        if keys:
            key = keys[int(rng.integers(len(keys)))]
            del holder.attrs[key]
            if rng.random() < 0.6:
                holder.attrs[key] = [3, "text", np.zeros(3), "{", "[1", -1.5][int(rng.integers(6))]
            return f"attribute {key} of {name} damaged"
        del file[name]
        return f"{name} deleted"


def _read(connection):
    """A worker that reads result files."""
    import matplotlib

    matplotlib.use("agg")
    while True:
        connection.send(invoke(connection.recv()))
