"""A browser without a window, which prints a page as PDF."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from beamsim.errors import MethodError, ResultFileError
from beamsim.files import replacing

PROGRAMS = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome",
    "msedge",
    "microsoft-edge",
)
SECONDS = 120.0


def find_browser() -> str:
    """The program: that of the environment variable ``BEAMSIM_BROWSER``, or the first that is installed.

    Raises
    ------
    MethodError
        If there is none.
    """
    named = os.environ.get("BEAMSIM_BROWSER", "")
    found = next(filter(None, map(shutil.which, (named, *PROGRAMS) if named else PROGRAMS)), None)
    if found is None:
        remedy = "install Chromium or Chrome, name it in BEAMSIM_BROWSER, or print the HTML file from any browser"
        raise MethodError("--pdf", "needs a browser, and none was found", remedy)
    return found


def browser_command(browser: str, profile: Path, *arguments: str) -> list[str]:
    """A command that runs the browser without a window, network or traces in the user's profile."""
    root = hasattr(os, "geteuid") and os.geteuid() == 0  # as which the sandbox of Chromium does not start
    return [
        browser, "--headless=new", "--disable-gpu", "--no-first-run", "--disable-extensions", "--disable-dev-shm-usage",
        "--disable-background-networking", f"--user-data-dir={profile}", *(["--no-sandbox"] if root else []),
        *arguments,
    ]  # fmt: skip


def print_pdf(browser: str, page: Path, target: Path) -> Path:
    """Print a page; the file is replaced only by a complete one.

    Raises
    ------
    ResultFileError
        If the browser fails.
    """
    with replacing(target) as temporary, tempfile.TemporaryDirectory() as profile:
        printed = Path(profile) / "page.pdf"
        arguments = (
            "--no-pdf-header-footer", "--virtual-time-budget=5000", f"--print-to-pdf={printed}",
            page.resolve().as_uri(),
        )  # fmt: skip
        command = browser_command(browser, Path(profile) / "profile", *arguments)
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS, check=False)
        except (OSError, subprocess.TimeoutExpired) as error:
            raise ResultFileError(f"{target}: {browser} could not print the page: {error}") from None
        if done.returncode or not printed.is_file():
            reason = (done.stderr.strip().splitlines() or ["no reason given"])[-1]
            raise ResultFileError(f"{target}: {browser} could not print the page: {reason}")
        shutil.copyfile(printed, temporary)
    return target
