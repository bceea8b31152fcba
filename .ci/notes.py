"""Print the section of CHANGELOG.md about a release: its notes.

    python .ci/notes.py v0.1.0 [--links URL]

Fails if there is no section for this version, if it is empty, or if its heading has no date. `--links` is put before
the addresses of files of the repository, which work in the repository alone.
"""

import argparse
import re
import sys
from pathlib import Path

CHANGELOG = Path(__file__).resolve().parent.parent / "CHANGELOG.md"
HEADING = re.compile(r"^## \[(?P<version>[^\]]+)\](?: - (?P<date>\d{4}-\d{2}-\d{2}))?\s*$", re.MULTILINE)


def notes(text: str, version: str) -> str:
    """The body of the section of a version; SystemExit with what to do if it cannot be released."""
    headings = list(HEADING.finditer(text))
    ends = [heading.start() for heading in headings[1:]] + [len(text)]
    for heading, end in zip(headings, ends, strict=True):
        if heading["version"] != version:
            continue
        if heading["date"] is None:
            raise SystemExit(f"CHANGELOG.md: write the date of the release: '## [{version}] - 2026-01-31'")
        body = text[heading.end() : end].strip()
        if not body:
            raise SystemExit(f"CHANGELOG.md: the section [{version}] is empty; list what changes for users")
        return body
    known = ", ".join(heading["version"] for heading in headings) or "none"
    raise SystemExit(
        f"CHANGELOG.md has no section '## [{version}] - DATE' (it has: {known}). Rename [Unreleased] to it, "
        "and tag the commit that has it"
    )


def main() -> None:
    """Print the notes of the version that the command line names."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("tag", help="of the release, such as v0.1.0")
    parser.add_argument("--links", default="", metavar="URL", help="address of the repository's files at this tag")
    parser.add_argument("--changelog", type=Path, default=CHANGELOG, metavar="FILE")
    options = parser.parse_args()
    if not re.fullmatch(r"v\d\S*", options.tag):
        raise SystemExit(f"the tag of a release is v and its version, such as v0.1.0, not {options.tag}")
    body = notes(options.changelog.read_text(encoding="utf-8"), options.tag.removeprefix("v"))
    if options.links:
        body = re.sub(r"\]\((?!\w+:|#)", f"]({options.links.rstrip('/')}/", body)
    sys.stdout.reconfigure(encoding="utf-8")  # type: ignore[union-attr]
    print(body)


if __name__ == "__main__":
    main()
