"""Equal seeds give equal records, on any number of threads."""

import os
import subprocess
import sys

import pytest

RECORDS = """
import hashlib
import beamsim

base = {
    "beam": {"length": "270 mm", "width": "50 mm", "thickness": "5 mm", "youngs_modulus": "69 GPa",
             "density": "2700 kg/m^3", "elements": 40, "damping": {"kind": "modal", "ratio": "1 %"}},
    "snubbers": [{"name": "tip", "position": "270 mm", "side": "below", "stiffness": "20 kN/m", "gap": "0 mm"}],
    "excitation": {"kind": "random", "applied_to": "base", "seed": 7,
                   "psd": [{"frequency": f, "density": "0.01 g^2/Hz"} for f in ("20 Hz", "400 Hz")]},
    "run": {"duration": "0.5 s", "convergence": "off"},
}
result = beamsim.run(beamsim.load_scenario(base))
digest = hashlib.sha256()
digest.update(result.base_acceleration.tobytes())  # of the response BLAS may round differently on other threads
print(digest.hexdigest(), result.snubbers["tip"].closed.sum())
"""


@pytest.mark.slow
def test_records_do_not_depend_on_the_number_of_threads():
    found = set()
    for threads in ("1", "2", "4"):
        names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
        done = subprocess.run(
            [sys.executable, "-c", RECORDS], env=os.environ | dict.fromkeys(names, threads), capture_output=True,
            text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        found.add(done.stdout)
    (only,) = found
    assert int(only.split()[1]) > 10  # the stop is met
