"""Equal seeds give equal records, on any number of threads."""

import os
import subprocess
import sys

import pytest

STUDIES = """
import hashlib
import sys
import beamsim
from beamsim.store.results import items_of

CASE = {
    "chain": {"masses": ["1 kg", "1 kg"], "springs": ["1 kN/m", "1 kN/m"]},
    "snubbers": [{"name": "stop", "mass": 2, "side": "below", "gap": "1 mm", "stiffness": 1e5}],
    "run": {"duration": "2 s", "convergence": "off"},
    "limits": {"peak_force": "60 N"},
}
SINE = {"kind": "harmonic", "applied_to": "base", "frequency": "5 Hz", "level": 2}
NOISE = {"kind": "random", "applied_to": "base", "seed": 7,
         "psd": [{"frequency": f, "density": "0.001 g^2/Hz"} for f in ("2 Hz", "40 Hz")]}
GAP = {"path": "snubbers.stop.gap", "deviation": "0.5 mm"}
STUDIES = {
    "ensemble": {"excitation": NOISE, "vary": {"kind": "latin_hypercube", "samples": 6, "seed": 3,
                 "responses": ["peak_force"], "parameters": [{"path": "snubbers.stop.gap", "from": 0, "to": "3 mm"}]}},
    "reliability": {"excitation": SINE, "vary": {"kind": "reliability", "seed": 3, "samples": 100, "most_cases": 100,
                    "parameters": [GAP]}},
    "optimise": {"excitation": SINE, "optimise": {"minimise": "peak_force", "seed": 3, "most_cases": 25,
                 "parameters": [{"path": "snubbers.stop.gap", "from": 0, "to": "3 mm"}]}},
}

BEAM = {
    "beam": {"length": "270 mm", "width": "50 mm", "thickness": "5 mm", "youngs_modulus": "69 GPa",
             "density": "2700 kg/m^3", "elements": 40, "damping": {"kind": "modal", "ratio": "1 %"}},
    "snubbers": [{"name": "tip", "position": "270 mm", "side": "below", "stiffness": "20 kN/m", "gap": "0 mm"}],
    "excitation": {"kind": "random", "applied_to": "base", "seed": 7,
                   "psd": [{"frequency": f, "density": "0.01 g^2/Hz"} for f in ("20 Hz", "400 Hz")]},
    "run": {"duration": "0.5 s", "convergence": "off"},
}

if __name__ == "__main__":
    histories = beamsim.run(beamsim.load_scenario(BEAM))["histories"]
    # of the response BLAS may round differently on other threads
    digest = hashlib.sha256(histories["base_acceleration"].values[0].tobytes())
    print("run complete", histories["snubber_closed"].sel(snubber="tip").values.sum(), digest.hexdigest())
    for name, study in STUDIES.items():
        if name not in sys.argv[2:]:
            continue
        result = beamsim.design_study(beamsim.load_scenario(CASE | study), workers=int(sys.argv[1]))
        digest, values = hashlib.sha256(), 0
        for path, item in sorted(items_of(result).items()):
            if item.array is not None and "time" not in path:
                digest.update(path.encode() + (item.values.tobytes() if item.array.dtype != object else b""))
                values += item.array.size
        print(name, result.outcome.code, values, digest.hexdigest())
"""


def test_studies_do_not_depend_on_the_number_of_workers_and_threads(tmp_path):
    """A random record, and every number of an ensemble, a reliability study and an optimisation have the same bits."""
    pytest.importorskip("openturns")
    script = tmp_path / "studies.py"
    script.write_text(STUDIES)
    found = []
    several = ("reliability", "optimise")  # whose cases depend on those before
    for workers, threads, studies in (("1", "2", ("ensemble", *several)), ("2", "1", several)):
        names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
        done = subprocess.run(
            [sys.executable, script, workers, *studies], env=os.environ | dict.fromkeys(names, threads),
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        found.append(done.stdout.splitlines())
    one, other = found
    assert (len(one), len(other)) == (4, 3)
    assert set(other) < set(one)
    assert all(int(line.split()[2]) > 10 for line in one), one
