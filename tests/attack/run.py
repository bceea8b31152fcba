"""The whole attack by one command: random systems, scenarios in other words, and seeded faults.

    python tests/attack/run.py --systems 10000 --jobs 1 --seed 20_000_000

Prints the counts for each feature and writes them to a file; exit code 1 where anything was found. What came of each
system is written as it comes (`attack.systems.jsonl` beside `attack.json`); the same command goes on from there.
"""

import argparse
import datetime
import json
import multiprocessing
import os
import statistics
import subprocess
import sys
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "helpers"), str(HERE.parents[1])]

PATIENCE = 20.0  # s of processor time for one system
HANG, FIRST = 60.0, 300.0  # s of processor time without an answer; the first systems of a process compile kernels
SILENCE = 3600.0  # s on the clock, for what waits without work


def system(seed):
    """One random system; a failure of our own counts as one that was not compared."""
    from comparison import Finding, compare

    warnings.simplefilter("ignore")
    with tempfile.TemporaryDirectory() as folder:
        try:
            finding = compare(seed, Path(folder))
        except Exception as error:
            finding = Finding(seed, [], f"our own failure: {type(error).__name__}", [str(error)[:200]])
    return finding


def systems(first, count, jobs, say, file):
    """Findings of ``count`` seeds from ``first`` on, also appended to a file; those in the file are not sought anew.

    Where a system does not end, its process is replaced.
    """
    from comparison import Finding

    wanted = range(first, first + count)
    lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    findings = [finding for finding in (Finding(**json.loads(line)) for line in lines) if finding.seed in wanted]
    seeds = iter(sorted(set(wanted) - {finding.seed for finding in findings}))
    context, fresh = multiprocessing.get_context("spawn"), 0
    pools = [context.Pool(1) for _ in range(jobs)]
    waiting = {}
    while True:
        for j, pool in enumerate(pools):
            if j not in waiting and (seed := next(seeds, None)) is not None:
                waiting[j] = seed, pool.apply_async(system, (seed,)), (time.monotonic(), _worked(pool))
        if not waiting:
            break
        for j, (seed, answer, (begun, worked)) in list(waiting.items()):
            answer.wait(0.2 if jobs > 1 else 5.0)
            spent = _worked(pools[j]) - worked
            if answer.ready():
                findings.append(answer.get())
            elif spent > (HANG if fresh > jobs else FIRST) or time.monotonic() - begun > SILENCE:
                findings.append(Finding(seed, [], "does not end", [f"no end within {spent:.0f} s of processor time"]))
                pools[j].terminate()
                pools[j], fresh = context.Pool(1), 0
            else:
                continue
            del waiting[j]
            fresh += 1
            with file.open("a", encoding="utf-8") as out:
                out.write(json.dumps(vars(findings[-1])) + "\n")
            say("systems", len(findings), count)
    for pool in pools:
        pool.terminate()
    return findings


def _worked(pool):
    """Processor time in s of a pool's only process: on a busy machine the clock says little about work."""
    stat = Path(f"/proc/{pool._pool[0].pid}/stat")
    if not stat.exists():  # neither Linux nor a living process
        return time.monotonic()
    return sum(int(ticks) for ticks in stat.read_text().rpartition(")")[2].split()[11:13]) / os.sysconf("SC_CLK_TCK")


def report_systems(findings):
    """Lines about the systems, and what is wrong with them."""
    from comparison import summarise

    outcomes, features, differing = summarise(findings)
    compared = [f for f in findings if f.outcome in ("agrees", "differs")]
    periods = sorted(f.periods for f in compared)
    lines = [f"random systems: {len(findings)}; " + ", ".join(f"{name}: {n}" for name, n in outcomes.most_common())]
    if compared:
        longest = [max(f.seconds[k] for f in compared) for k in range(2)]
        lines.append(
            f"  {sum(f.events for f in compared)} contact events; median {periods[len(periods) // 2]:.1f} periods "
            f"of the first mode; longest time of a system: ours {longest[0]:.1f} s, the package and ours with finer "
            f"steps {longest[1]:.1f} s"
        )
    for name, count in sorted(features.items()):
        lines.append(f"  {name:<44} {count:>6}" + (f"   differing {differing[name]}" if differing[name] else ""))
    faults = [f"system {f.seed}: {'; '.join(f.differences)}" for f in findings if f.differences]
    slow = [f"system {f.seed}: {f.seconds[1]:.1f} s" for f in compared if f.seconds[1] > PATIENCE]
    return lines, faults + slow


def add_to_table(path, first, findings):
    """Append counts and largest deviation of the systems of one call to a table, with date and commit."""
    import yaml
    from comparison import summarise

    table = yaml.safe_load(path.read_text(encoding="utf-8")) if path.exists() else []
    outcomes, _, _ = summarise(findings)
    compared = [finding for finding in findings if finding.outcome == "agrees"]
    commit = ["git", "rev-parse", "--short=8", "HEAD"]
    table.append({
        "date": datetime.date.today().isoformat(),
        "commit": subprocess.run(commit, cwd=HERE, capture_output=True, text=True, check=True).stdout.strip(),
        "first_seed": first,
        "systems": len(findings),
        "contact_events": sum(finding.events for finding in compared),
        "outcomes": dict(outcomes.most_common()),
        "median_deviation": float(f"{statistics.median(f.deviation for f in compared):.2g}"),
        "largest_deviation": float(f"{max(f.deviation for f in compared):.2g}"),
        "largest_part_of_the_allowed": float(f"{max(f.used for f in compared):.2g}"),
        "differing": {f.seed: f"{'; '.join(f.differences)} (deviation {f.deviation:.1g})"
                      for f in findings if f.differences},
    })  # fmt: skip
    path.write_text(yaml.safe_dump(table, sort_keys=False, width=200), encoding="utf-8")


def rewritten(first, count, say):
    """Lines about scenarios that are written in other words, and what differs."""
    from rewritten import rewrite

    outcomes, found, values = Counter(), [], 0
    for seed in range(first, first + count):
        with tempfile.TemporaryDirectory() as folder:
            for finding in rewrite(seed, folder):
                outcomes[finding.words, finding.outcome] += 1
                values += finding.compared
                for difference in finding.differences:
                    found.append(f"scenario {seed} ({finding.source}), {finding.words}: {difference}")
                    print(found[-1], file=sys.stderr, flush=True)
        say("scenarios in other words", seed - first + 1, count)
    lines = [f"scenarios in other words: {count}; {values} histories and values compared"]
    return lines + [f"  {' '.join(key):<60} {number:>6}" for key, number in sorted(outcomes.items())], found


def main():
    from random_systems import ASSEMBLIES, LARGE, MORE

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--systems", type=int, default=10_000)
    parser.add_argument("--large", type=int, default=300, help="systems of many modes")
    parser.add_argument("--rewritten", type=int, default=1000, help="scenarios that are written in other words")
    parser.add_argument("--faults", type=int, default=12, help="seeded faults of the event search, and of places")
    parser.add_argument("--jobs", type=int, default=1)
    kinds = f"from {MORE} on with all laws and inputs, from {ASSEMBLIES} on of assemblies"
    parser.add_argument("--seed", type=int, default=1, help=f"the first one; systems are {kinds}")
    parser.add_argument("--output", type=Path, default=Path("attack.json"))
    parser.add_argument("--table", type=Path, help="YAML file to which counts of the systems are appended")
    options = parser.parse_args()
    if not 0 <= options.seed <= LARGE - options.systems:
        parser.error(f"--seed: seeds of systems are from 0 to {LARGE - 1}; those of many modes are added by --large")

    begin, last = time.monotonic(), [0.0]

    def say(what, done, total):
        now = time.monotonic()
        if now - last[0] > 20 or done == total:
            last[0] = now
            print(f"{what} {done}/{total}, {now - begin:.0f} s", file=sys.stderr, flush=True)

    record, faults = {"seed": options.seed}, []

    def keep(name, lines, found):
        print("\n".join(lines), flush=True)
        print("\n".join(f"  FOUND {line}" for line in found), flush=True) if found else None
        faults.extend(found)
        record[name] = {"lines": lines, "found": found}
        options.output.write_text(json.dumps(record, indent=1), encoding="utf-8")

    file = options.output.with_suffix(".systems.jsonl")
    for name, first, count in (("systems", 0, options.systems), ("large systems", LARGE, options.large)):
        if count:
            findings = systems(first + options.seed, count, options.jobs, say, file)
            keep(name, *report_systems(findings))
            if options.table:
                add_to_table(options.table, first + options.seed, findings)
    if options.rewritten:
        keep("scenarios in other words", *rewritten(options.seed, options.rewritten, say))
    if options.faults:
        import seeded_faults

        lines, found = [], []
        for name in ["nothing", *list(seeded_faults.SEEDED)[: options.faults]]:
            difference = seeded_faults.catch(name, 0, 200)
            lines.append(f"  seeded fault: {name}: {difference or 'not caught'}")
            if bool(difference) == (name == "nothing"):
                found.append(lines[-1].strip())
            say("seeded faults", len(lines), options.faults + 1)
        for name in ["nothing", *list(seeded_faults.OF_PLACES)[: options.faults]]:
            failed = seeded_faults.caught_by_tests(name)
            lines.append(f"  seeded fault of places: {name}: {failed or 'not caught'}")
            if bool(failed) == (name == "nothing"):
                found.append(lines[-1].strip())
        keep("seeded faults", lines, found)
    print(f"{len(faults)} found in {time.monotonic() - begin:.0f} s; see {options.output}")
    return 1 if faults else 0


if __name__ == "__main__":
    raise SystemExit(main())
