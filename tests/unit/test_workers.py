"""Studies called from a plain Python script: by default in its own process, or by workers that need a guard."""

import subprocess
import sys

SCRIPT = """
import beamsim

case = {
    "chain": {"masses": [1], "springs": [100, 0]},
    "excitation": {"kind": "harmonic", "applied_to": {"mass": 1}, "level": "1 N", "frequency": "1 Hz"},
    "vary": {"kind": "grid", "parameters": [{"path": "chain.masses[0]", "values": [1, 2]}]},
}
"""
STUDY = """
result = beamsim.design_study(beamsim.load_scenario(case | {{{analysis}}}){workers})
print(result.summary["solved"])
"""


RUN = '"run": {"duration": "1 s"}'
STEPPED = '"sweep": {"kind": "stepped", "from": "0.5 Hz", "to": "0.6 Hz", "points": 2}'


def script(folder, *studies):
    """Runs a script with studies, each with what it gives for the workers and an analysis."""
    path = folder / "study.py"
    path.write_text(SCRIPT + "".join(STUDY.format(workers=workers, analysis=of) for workers, of in studies))
    return subprocess.run([sys.executable, path], capture_output=True, text=True, timeout=300, check=False)


def test_one_worker_is_the_process_itself(tmp_path):
    done = script(tmp_path, ("", RUN), (", workers=1", STEPPED))
    assert (done.returncode, done.stdout.split()) == (0, ["2", "2"]), done.stderr


def test_workers_of_a_script_without_a_guard_are_refused_with_the_remedy(tmp_path):
    """They import the script, which would start workers again; that is not a lack of memory."""
    done = script(tmp_path, (", workers=2", RUN))
    assert done.returncode != 0
    assert 'put the call under `if __name__ == "__main__":`, or use workers=1' in done.stderr
    assert "out of memory" not in done.stderr
    assert "bootstrapping" not in done.stderr  # no traceback of a worker
