"""The commented scenarios that `beamsim new` writes."""

from __future__ import annotations

from importlib.resources import files


def template(kind: str = "beam") -> str:
    """Return a commented scenario that is valid as it stands.

    Parameters
    ----------
    kind : one of `beamsim.kinds.TemplateKind`.
    """
    return (files("beamsim.scenario") / "templates" / f"{kind}.yaml").read_text(encoding="utf-8")
