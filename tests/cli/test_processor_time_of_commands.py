"""The processor time that a command prints is its own, whatever its process did before."""

import subprocess
import sys

import pytest

CHAIN = """
import os, subprocess, sys
subprocess.run([sys.executable, "-c", "import time\\nwhile time.process_time() < 0.5: pass"])
os.execv(sys.executable, [sys.executable, "-c", '''
import os
from beamsim.results.result import used_processor_time
print(used_processor_time(), sum(os.times()[:2]), sum(os.times()[2:4]))
'''])
"""


@pytest.mark.skipif(sys.platform == "win32", reason="a process cannot become another one there")
def test_programs_that_a_shell_ran_before_do_not_count():
    """A shell that becomes the last command of ``pip install . && beamsim run case.yaml`` has waited for the others."""
    done = subprocess.run([sys.executable, "-c", CHAIN], capture_output=True, text=True, check=True)
    used, own, before = map(float, done.stdout.split())
    assert before > 0.4
    assert used == pytest.approx(own, abs=0.05)
