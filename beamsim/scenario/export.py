"""A scenario back to YAML."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import yaml

if TYPE_CHECKING:
    from beamsim.scenario.base import Schema


class _Dumper(yaml.SafeDumper):
    """Quotes text that YAML 1.1 or YAML 1.2 would read as something else."""


_Dumper.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?"),
    list("-+.0123456789"),
)


def _represent_text(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    """Escape the line break U+0085, which PyYAML writes as it is and reads back as a space."""
    style = '"' if "\x85" in text else None
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=style)


_Dumper.add_representer(str, _represent_text)

_FIRST = ("name", "kind", "body", "at", "position", "mass", "between", "masses", "applied_to", "level")


def to_yaml(scenario: Schema) -> str:
    """Return the resolved scenario as YAML text; see `Scenario.to_yaml`."""
    data = _tidy(scenario.model_dump(mode="json", by_alias=True, exclude_none=True))
    return yaml.dump(data, Dumper=_Dumper, sort_keys=False, allow_unicode=True, default_flow_style=None, width=120)


def _tidy(value: Any) -> Any:
    """Put the keys that say what a mapping is first; leave out empty lists, which are defaults."""
    if isinstance(value, dict):
        first = [key for key in _FIRST if key in value]
        keys = first + [key for key in value if key not in first]
        return {
            key: {name: _tidy(body) for name, body in value[key].items()} if key == "bodies" else _tidy(value[key])
            for key in keys
            if value[key] != [] and (key != "bodies" or value[key])
        }
    if isinstance(value, list):
        return [_tidy(item) for item in value]
    return value
