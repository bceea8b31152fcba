"""The version of installed copies and of checkouts, and the digest that differs for other code of the same version."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import beamsim.version

pytestmark = pytest.mark.quick
ASK = "import runpy, sys; module = runpy.run_path(sys.argv[1]); print(module['__version__'], module['code_digest']())"


def asked(package):
    """The version and the digest of a copy, which a process without other packages finds."""
    command = [sys.executable, "-I", "-S", "-c", ASK, str(package / "version.py")]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()


def digest(package):
    return asked(package)[1]


def version(package):
    return asked(package)[0]


def copy(folder):
    (folder / "beamsim").mkdir(parents=True)
    return Path(shutil.copy(Path(beamsim.version.__file__), folder / "beamsim")).parent


def git(folder, *arguments):
    named = ["-c", "user.name=somebody", "-c", "user.email=somebody@example.org", "-c", "init.defaultBranch=main"]
    command = ["git", *named, "-c", "commit.gpgSign=false", "-c", "tag.gpgSign=false", *arguments]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)


def test_an_installed_copy_has_the_version_of_its_metadata(tmp_path):
    package = copy(tmp_path)
    metadata = tmp_path / "beamsim-1.2.3.dist-info" / "METADATA"
    metadata.parent.mkdir()
    metadata.write_text("Metadata-Version: 2.4\nName: beamsim\nVersion: 1.2.3\n")
    git(tmp_path, "init")  # a site folder may lie in a repository
    assert version(package) == "1.2.3"


def test_a_checkout_has_the_version_of_its_commit(tmp_path):
    """As the build writes it: the last release, the commits after it and the commit."""
    package = copy(tmp_path)
    git(tmp_path, "init")
    assert version(package) == "0.0+unknown"
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-m", "one")
    git(tmp_path, "tag", "notes-2")
    assert re.fullmatch(r"0\.0\+g[0-9a-f]{9}", version(package))
    git(tmp_path, "tag", "v0.3.0")
    assert version(package) == "0.3.0"
    with (package / "version.py").open("a") as file:
        file.write("# changed\n")
    assert re.fullmatch(r"0\.3\.0\.post1\.dev0\+g[0-9a-f]{9}\.dirty", version(package))
    git(tmp_path, "commit", "-a", "-m", "two")
    assert re.fullmatch(r"0\.3\.0\.post1\.dev1\+g[0-9a-f]{9}", version(package))
    git(tmp_path, "tag", "v0.4.0rc1")
    assert version(package) == "0.4.0rc1"


def test_a_copied_folder_does_not_take_the_version_of_another_repository(tmp_path):
    git(tmp_path, "init")
    (tmp_path / "file").write_text("")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-m", "one")
    git(tmp_path, "tag", "v9.9.9")
    assert version(copy(tmp_path / "vendor")) == "0.0+unknown"


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
