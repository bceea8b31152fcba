"""The commented scenarios that `beamsim new` writes."""

from __future__ import annotations

from importlib.resources import files

COMMANDS = {
    "beam": "run",
    "chain": "run",
    "sweep": "sweep",
    "shock": "run",
    "random": "run",
    "panel-pair": "run",
    "nnm": "nnm",
    "identify": "identify-stiffness",
}
"""The kinds of templates, and the command that each is for."""


def template(kind: str = "beam") -> str:
    """Return a commented scenario that is valid as it stands.

    Parameters
    ----------
    kind : one of `COMMANDS`.
    """
    return (files("beamsim.scenario") / "templates" / f"{kind}.yaml").read_text(encoding="utf-8")
