"""The shipped configs by name, which is unique in all of their folders."""

from pathlib import Path

ROOT = Path(__file__).parents[2]
CONFIGS = {path.stem: path for path in (ROOT / "configs").rglob("*.yaml")}
