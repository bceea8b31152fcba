"""Mutated scenario files against the command line: exit code 0, 2 or 3, never a traceback, never a hang.

A mutant is a shipped config with one to three changes of its tree or its text. The commands run inside a worker
process, interrupted after `PATIENCE` seconds of processor time as by Ctrl-C, and again every second: Python drops an
exception that is raised while a callback of the compiler runs. What is ended with code 130 was long work that was
asked for. A mutant that takes more than `HANG` seconds of processor time is a hang; so is a worker that gives no answer
within `SILENCE` seconds on the clock, which on a busy machine are much less work. It is killed and another one goes on.
"""

import contextlib
import copy
import signal
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np
import yaml
from workers import Worker, invoke

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
COMMANDS = {"run": "run", "sweep": "sweep", "vary": "sweep", "nnm": "nnm", "identify_stiffness": "identify-stiffness"}
PATIENCE = 12.0
HANG, SILENCE = 20.0, 120.0
WARMING = (
    ("run", "one_sided_45hz"),
    ("sweep", "chain_two_dof"),
    ("nnm", "nnm_chain_cubic_energy"),
    ("sweep", "sweep_backlash"),
    ("nnm", "nnm_chain_mass_1"),
    ("sweep", "continuation_folds"),
    ("sweep", "continuation_harmonic_balance"),
)
WARM = 60.0  # s for each of these
ACCEPTED = {0, 2, 3, 4, 130}
NUMBERS = (
    0,
    -1,
    1,
    2,
    -0.0,
    1e-300,
    1e300,
    1e308,
    -1e308,
    5e-324,
    1e-12,
    1e12,
    float("nan"),
    float("inf"),
    2**63,
    10**40,
    0.5,
    1e-3,
    7,
)
TEXTS = (
    "",
    " ",
    "1 kg",
    "5 mm",
    "2 g",
    "65 Hz",
    "10 %",
    "-3 s",
    "1e400 m",
    "nan",
    "inf",
    "1,5 mm",
    "200 mil",
    "3 furlongs",
    "rest",
    "all",
    "base",
    "none",
    "clamped",
    "[0]",
    "../..",
    "/dev/null",
    "\u00b5m",
    "1 m/0",
    "9" * 400,
    "on",
    "off",
    "~",
    "tip",
    "{}",
)


def mutants(count, seed):
    """Texts of mutated configs, each with the command it is for and a line that says what was changed."""
    rng = np.random.default_rng([seed, 26])
    sources = sorted(CONFIGS.glob("*.yaml"))
    for number in range(count):
        path = sources[int(rng.integers(len(sources)))]
        tree = _shortened(_resolved(path))
        command = [name for section, name in COMMANDS.items() if section in tree] or ["run"]
        changes = [_mutate(tree, rng) for _ in range(int(rng.integers(1, 4)))]
        text = yaml.safe_dump(tree, sort_keys=False, allow_unicode=True)
        if rng.random() < 0.15:
            text, change = _mangle(text, rng)
            changes.append(change)
        yield number, command[int(rng.integers(len(command)))], text, f"{path.stem}: {'; '.join(changes)}"


def _resolved(path):
    """A config with what it extends, paths of other files made absolute."""
    tree = yaml.safe_load(path.read_text(encoding="utf-8"))
    parent = tree.pop("extends", None)
    if parent is not None:
        base = _resolved(path.parent / parent)
        for key, value in tree.items():
            both = (
                isinstance(value, dict)
                and isinstance(base.get(key), dict)
                and base[key].get("kind") == value.get("kind")
            )
            base[key] = {**base[key], **value} if both else value
        tree = base
    return _absolute(tree)


def _absolute(value):
    if isinstance(value, dict):
        return {key: _absolute(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_absolute(item) for item in value]
    return str(CONFIGS / value) if isinstance(value, str) and value.startswith("measurements/") else value


def _shortened(tree):
    """Less of the same work, so that thousands of mutants take minutes."""
    run, sweep, vary = (tree.get(key) if isinstance(tree.get(key), dict) else {} for key in ("run", "sweep", "vary"))
    if run:
        run["duration"] = 0.05 if "beam" in tree else 0.5
        run.pop("spectrum", None)
        if "chain" in tree and "sample_rate" in run:
            run["duration"] = f"{20 / float(str(run['sample_rate']).split()[0])!r} " + (
                "ms" if "kHz" in str(run["sample_rate"]) else "s"
            )
    if sweep.get("kind") == "continuation":
        sweep["most_points"] = 12
    if "rate" in sweep:
        number, _, unit = str(sweep["rate"]).partition(" ")
        sweep["rate"] = f"{30 * float(number)!r} {unit}"
    for parameter in vary.get("parameters", ()):
        if "points" in parameter:
            parameter["points"] = 2
    if "samples" in vary:
        vary["samples"] = 3
    return tree


def _places(tree, path=()):
    """Every (container, key) of a tree."""
    items = tree.items() if isinstance(tree, dict) else enumerate(tree)
    for key, value in items:
        yield tree, key
        if isinstance(value, (dict, list)):
            yield from _places(value, (*path, key))


def _mutate(tree, rng):
    places = list(_places(tree))
    if not places:
        tree["chain"] = {}
        return "emptied"
    holder, key = places[int(rng.integers(len(places)))]
    value = holder[key]
    kind = int(rng.integers(16))  # the last ones change a number a little, where there is one
    if kind == 0:
        del holder[key]
        return f"{key} deleted"
    if kind == 1:
        holder[key] = NUMBERS[int(rng.integers(len(NUMBERS)))]
    elif kind == 2:
        holder[key] = TEXTS[int(rng.integers(len(TEXTS)))]
    elif kind == 3:
        holder[key] = [None, True, [], {}, [value], {"kind": value} if isinstance(value, str) else {"x": 1}][
            int(rng.integers(6))
        ]
    elif kind == 4 and isinstance(holder, dict):
        holder[str(key) + "x"] = holder.pop(key)
        return f"{key} renamed"
    elif kind == 5:
        other, there = places[int(rng.integers(len(places)))]
        with contextlib.suppress(KeyError, IndexError):
            holder[key] = copy.deepcopy(other[there])
    elif kind == 6 and isinstance(holder, list):
        holder.append(copy.deepcopy(value))
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        holder[key] = value * [-1, 0, 10, 0.1, 1.3, 0.7][int(rng.integers(6))]
    elif isinstance(value, str) and value[:1].isdigit():
        number, _, unit = value.partition(" ")
        with contextlib.suppress(ValueError):
            holder[key] = f"{float(number) * [-1, 0, 3, 0.3, 1.3, 0.7][int(rng.integers(6))]!r} {unit}"
    else:
        holder[key] = None if kind == 8 else value
    return (
        f"{key} = {str(holder[key])[:40]!r}" if not isinstance(holder, list) or key < len(holder) else f"{key} changed"
    )


def _mangle(text, rng):
    """Damage to the text itself."""
    at = int(rng.integers(len(text)))
    piece = [
        "\t",
        ":",
        "- ",
        "{",
        "]",
        "\x00",
        "\ufeff",
        "'",
        "&a ",
        "*a ",
        "!!python/object:os.system ",
        "\n\n---\n",
        "<<: *b\n",
        "\x85",
        "%",
    ]
    if rng.random() < 0.3:
        return text[:at], f"cut after {at} characters"
    new = piece[int(rng.integers(len(piece)))]
    return text[:at] + new + text[at:], f"{new!r} inserted at {at}"


def execute(command, text, folder):
    """Exit code and what was printed of a command on a mutant, in this process."""
    case = Path(folder) / "case.yaml"
    case.write_text(text, encoding="utf-8", errors="surrogatepass")
    arguments = [command, str(case), "-o", str(Path(folder) / "case.h5"), "--no-plots"]
    arguments += ["--workers", "1"] if command == "sweep" and "vary:" in text else []
    return invoke(arguments)


def _work(connection):
    """A worker: executes what it is sent; after some processor time it is interrupted as by Ctrl-C."""

    def interrupt(*_):
        signal.raise_signal(signal.SIGINT)

    signal.signal(signal.SIGPROF, interrupt)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    while True:
        command, text, patience = connection.recv()
        with tempfile.TemporaryDirectory() as folder:
            begin = time.process_time()
            try:
                signal.setitimer(signal.ITIMER_PROF, patience, 1.0)
                try:
                    answer = execute(command, text, folder)
                finally:
                    signal.setitimer(signal.ITIMER_PROF, 0)
            except KeyboardInterrupt:
                answer = 130, "", False
        seconds = time.process_time() - begin
        if seconds > patience + HANG - PATIENCE:
            answer = -9, f"took {seconds:.1f} s of processor time", True
        connection.send(answer)


def attack(count, seed, report=None):
    """Run mutants; returns the counts of exit codes and a line for each fault."""
    codes, faults = Counter(), []
    begin = time.monotonic()
    warming = [
        (command, yaml.safe_dump(_shortened(_resolved(CONFIGS / f"{name}.yaml"))), WARM) for command, name in WARMING
    ]
    with Worker(_work, warming) as worker:  # the warming compiles kernels, or loads them
        for number, command, text, change in mutants(count, seed):
            code, output, crashed = worker.run((command, text, PATIENCE), SILENCE)
            codes[code] += 1
            if code not in ACCEPTED or crashed or "Traceback" in output or "internal error" in output:
                faults.append(
                    f"mutant {number} (seed {seed}), {command}: code {code}, {change}: {output.strip()[-300:]}"
                )
            if report is not None:
                report(number + 1, time.monotonic() - begin)
    return codes, faults
