"""Print the conda recipe of a release: recipe/recipe.yaml with the version and the checksum of its sdist.

python .ci/recipe.py build/dist/beamsim-0.1.0.tar.gz > recipe.yaml
"""

import hashlib
import re
import sys
from pathlib import Path

RECIPE = Path(__file__).resolve().parent.parent / "recipe" / "recipe.yaml"


def main() -> None:
    """Print the recipe for the sdist that the command line names."""
    if len(sys.argv) != 2 or not (name := re.fullmatch(r"beamsim-(\S+)\.tar\.gz", Path(sys.argv[1]).name)):
        raise SystemExit(f"{sys.argv[0]} needs the path of a sdist, beamsim-VERSION.tar.gz")
    values = {"version": name[1], "sha256": hashlib.sha256(Path(sys.argv[1]).read_bytes()).hexdigest()}
    text = RECIPE.read_text(encoding="utf-8")
    for key, value in values.items():
        text, changes = re.subn(rf'^  {key}: ".*"$', f'  {key}: "{value}"', text, flags=re.MULTILINE)
        if changes != 1:
            raise SystemExit(f"{RECIPE} needs one line '  {key}: \"...\"' in its context")
    sys.stdout.reconfigure(encoding="utf-8", newline="\n")  # type: ignore[union-attr]
    print(text, end="")


if __name__ == "__main__":
    main()
