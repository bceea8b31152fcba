"""The version of this copy of the package, and a digest of its code.

An installed copy has the version of its metadata, which the build takes from the tag of the release. A checkout asks
git, also after ``pip install -e``, whose metadata are as old as the installation. Importing `beamsim` does not ask.
"""

import hashlib
import re
import subprocess
from contextlib import suppress
from functools import cache
from importlib.metadata import distributions
from pathlib import Path

__version__ = "0.0+unknown"  # a copy of the folder, without metadata and git
_HOME = Path(__file__).parent.parent
_installed = next(iter(distributions(name="beamsim", path=[str(_HOME)])), None)  # next to the package, nowhere else
if _installed is not None:
    __version__ = _installed.version
elif (_HOME / ".git").exists():  # not a repository into which somebody copied the package
    _command = ["git", "describe", "--tags", "--match=v[0-9]*", "--long", "--abbrev=9", "--always", "--dirty=.dirty"]
    with suppress(OSError, subprocess.SubprocessError):
        _text = subprocess.run(_command, cwd=_HOME, capture_output=True, text=True, timeout=10, check=True).stdout
        # v0.1.0-7-g9c9e804e9.dirty: seven commits after the release 0.1.0, and changes that are in no commit
        if _found := re.fullmatch(r"(?:v(\S+)-(\d+)-g)?([0-9a-f]+)(\.dirty)?\s*", _text):
            _release, _commits, _commit, _dirty = _found.groups("")
            _later = f".post1.dev{_commits}" if _release else ""
            __version__ = f"{_release or '0.0'}{_later}+g{_commit}{_dirty}"
            if _commits == "0" and not _dirty:
                __version__ = _release


@cache
def code_digest() -> str:
    """Twelve hexadecimal digits for the source code of the package, as it was when this process first asked."""
    digest, folder = hashlib.sha256(), Path(__file__).parent
    for file in sorted(folder.rglob("*.py"), key=lambda each: each.relative_to(folder).as_posix()):
        source = file.read_bytes().replace(b"\r\n", b"\n")
        digest.update(f"{file.relative_to(folder).as_posix()} {len(source)}\n".encode() + source)
    return digest.hexdigest()[:12]
