"""Build the package as a release does, and try the wheel where nothing of the checkout is.

    python .ci/wheel.py build [--tag v0.1.0]     sdist and wheel of this commit in build/dist, with checks
    python .ci/wheel.py try [--quick-tests]      the wheel in an empty environment of this Python: its version, the
                                                 README's example, and the tests that need no kernel

Both need the standard library, git, and a network or a folder with packages. `try` leaves nothing behind.
"""

import argparse
import os
import re
import runpy
import shutil
import subprocess
import sys
import tarfile
import tempfile
import tomllib
import venv
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
DIST = ROOT / "build" / "dist"


def run(*command: object, cwd: Path = ROOT, **environment: str) -> str:
    """What a command prints; its output is shown if it fails. It does not see another copy of the package."""
    settings = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "PYTEST_ADDOPTS")}
    texts = [str(part) for part in command]
    done = subprocess.run(
        texts, cwd=cwd, env=settings | environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        encoding="utf-8", errors="replace", check=False,
    )  # fmt: skip
    if done.returncode:
        raise SystemExit(f"{done.stdout}\n{' '.join(texts)}\nended with exit code {done.returncode}")
    return done.stdout


def empty_environment(folder: Path) -> Path:
    """The folder of the programs of a new environment."""
    venv.create(folder, with_pip=True, clear=True)
    return folder / ("Scripts" if os.name == "nt" else "bin")


def demand(condition: object, message: str) -> None:
    """End with a message unless the condition holds."""
    if not condition:
        raise SystemExit(message)


def same_files(found: set[str], expected: set[str], what: str) -> None:
    """End unless a file of the release has just the files that are expected."""
    lines = [*(f"missing: {name}" for name in sorted(expected - found))]
    lines += [*(f"not expected: {name}" for name in sorted(found - expected))]
    demand(not lines, "\n".join([what, *lines]))


def tracked(*folders: str) -> set[str]:
    """Files of the repository."""
    return {name for name in run("git", "ls-files", "-z", *folders).split("\0") if name}


def release_and_commit(version: str) -> tuple[str, str]:
    """The last release before a version and the commit, without the number of commits and what is in no commit."""
    public, _, commit = version.partition("+")
    return public.partition(".post1.dev")[0], re.split(r"\.?(?:dirty|d\d{8})$", commit)[0]


def build(tag: str | None) -> None:
    """Make sdist and wheel of the commit that is checked out, and check both."""
    shutil.rmtree(DIST, ignore_errors=True)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        programs, source = empty_environment(Path(folder) / "tools"), Path(folder) / "source"
        run("git", "clone", "-q", ROOT, source)  # without what tests write into the checkout meanwhile
        needed = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["build-system"]["requires"]
        run(programs / "pip", "install", "-q", "build", "twine", *needed)
        make = (programs / "python", "-m", "build", "--no-isolation", "--outdir")
        run(*make, DIST, source)  # the wheel is built from the sdist, as users without a wheel do
        run(*make, folder, "--wheel", source)
        run(programs / "twine", "check", "--strict", *DIST.iterdir())
        (wheel,), (sdist,), (direct,) = DIST.glob("*.whl"), DIST.glob("*.tar.gz"), Path(folder).glob("*.whl")
        own = runpy.run_path(str(source / "beamsim" / "version.py"))["__version__"]
        names = {path: set(zipfile.ZipFile(path).namelist()) for path in (wheel, direct)}
    version = wheel.name.split("-")[1]
    same_files(names[wheel], names[direct], "the wheel from the sdist has other files than that from the checkout")
    about = f"beamsim-{version}.dist-info/"
    package = {name for name in names[wheel] if not name.startswith(about)}
    same_files(package, tracked("beamsim"), "the wheel has other files than the package in the repository")
    for name in ("beamsim/py.typed", f"{about}licenses/LICENSE", f"{about}entry_points.txt"):
        demand(name in names[wheel], f"the wheel has no {name}")
    description = zipfile.ZipFile(wheel).read(f"{about}METADATA").decode().partition("\n\n")[2]
    relative = re.findall(r"\]\((?!\w+:|#)[^)]*\)", description)
    demand("# beamsim" in description and not relative, f"links of the README lead nowhere on PyPI: {relative}")
    with tarfile.open(sdist) as file:
        files = {entry.name.partition("/")[2] for entry in file if entry.isfile()}
    same_files(files, tracked() | {"PKG-INFO"}, "the sdist has other files than the repository")
    demand(release_and_commit(own) == release_and_commit(version), f"the checkout is {own}, but the wheel is {version}")
    demand(
        tag in (None, f"v{version}"), f"the tag is {tag}, but the version is {version}: build a clean clone with tags"
    )
    print(f"built and checked: {sdist.name}, {wheel.name}, {len(package)} files of the package")


def try_wheel(*, quick_tests: bool) -> None:
    """Install the wheel into an empty environment, and run the README's example from an empty folder, then tests."""
    wheels = list(DIST.glob("*.whl"))
    demand(len(wheels) == 1, f"there must be one wheel in {DIST}; build it first")
    version = wheels[0].name.split("-")[1]
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    example = re.search(r"\bbeamsim run (configs/\S+\.yaml)", readme)
    demand(example, "README.md has no example 'beamsim run configs/...'")
    assert example is not None
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        programs, empty = empty_environment(Path(folder) / "environment"), Path(folder).resolve() / "empty"
        case = empty / example[1]
        case.parent.mkdir(parents=True)
        shutil.copy(ROOT / example[1], case)
        run(programs / "pip", "install", "-q", f"{wheels[0]}[dev]" if quick_tests else wheels[0])
        run(programs / "pip", "check")

        def in_empty_folder(*command: object) -> str:
            return run(
                *command, cwd=empty, NUMBA_CACHE_DIR=str(Path(folder) / "kernels"), PYTHONUTF8="1", MPLBACKEND="Agg"
            )

        place = in_empty_folder(programs / "python", "-c", "import beamsim; print(beamsim.__file__)").strip()
        demand(Path(place).resolve().is_relative_to(Path(folder).resolve()), f"the package was imported from {place}")
        known = in_empty_folder(programs / "beamsim", "--version").strip()
        demand(known == f"beamsim {version}", f"'beamsim --version' prints {known}, but the wheel is {version}")
        printed = in_empty_folder(programs / "beamsim", *example[0].split()[1:])
        demand("converged within" in printed, f"the README's example does not converge:\n{printed}")
        contents = in_empty_folder(programs / "beamsim", "info", case.with_suffix(".h5").name)
        demand(f"by beamsim {version} run" in contents, f"the result does not state the version {version}:\n{contents}")
        print(f"Python {sys.version.split()[0]}: {wheels[0].name} installed, {example[0]}")
        if quick_tests:
            for name in (name for name in tracked() if not name.startswith("beamsim/")):
                (empty / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(ROOT / name, empty / name)
            shown = in_empty_folder(programs / "python", "-m", "pytest", "-q", "-m", "quick")
            print(f"quick tests of the installed package: {shown.splitlines()[-1]}")


def main() -> None:
    """Do what the command line asks for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parts = parser.add_subparsers(required=True, dest="part")
    parts.add_parser("build").add_argument("--tag", help="that the version must have")
    parts.add_parser("try").add_argument("--quick-tests", action="store_true")
    options = parser.parse_args()
    if options.part == "build":
        build(options.tag)
    else:
        try_wheel(quick_tests=options.quick_tests)


if __name__ == "__main__":
    main()
