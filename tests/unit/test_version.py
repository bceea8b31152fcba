"""The code of the package is told from other code of the same version."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import beamsim.version

pytestmark = pytest.mark.quick
ASK = "import runpy, sys; print(runpy.run_path(sys.argv[1])['code_digest']())"


def digest(package):
    command = [sys.executable, "-I", "-S", "-c", ASK, str(package / "version.py")]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


def test_the_digest_of_the_code_follows_its_files(tmp_path):
    """Equal files give an equal digest, wherever they are and however their lines end; other code or names do not."""
    package = tmp_path / "package"
    (package / "inner").mkdir(parents=True)
    shutil.copy(Path(beamsim.version.__file__), package / "version.py")
    (package / "inner" / "one.py").write_bytes(b"x = 1\n")
    known = digest(package)
    assert len(known) == 12
    moved = shutil.copytree(package, tmp_path / "elsewhere")
    (moved / "inner" / "one.py").write_bytes(b"x = 1\r\n")
    (moved / "notes.txt").write_text("no code")
    assert digest(moved) == known
    (moved / "inner" / "one.py").write_bytes(b"x = 2\n")
    assert digest(moved) != known
    (package / "inner" / "one.py").rename(package / "inner" / "two.py")
    assert digest(package) != known
    assert beamsim.version.code_digest() not in (known, digest(package))
