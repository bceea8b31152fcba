"""Configuration of the documentation: `sphinx-build -W docs build/site`.

Pages of `generated` are made anew in every build, from the code and from runs of the shipped configs.
"""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

from site_pages import commands, gallery, tutorial, validation  # noqa: E402

from beamsim import __version__  # noqa: E402

GENERATED = HERE / "generated"
GENERATED.mkdir(exist_ok=True)
PAGES = {
    "commands": commands.page,
    "gallery": lambda: gallery.page(GENERATED / "pictures"),
    "tutorial": lambda: tutorial.page(GENERATED / "pictures"),
    "validation": validation.page,
}
for _name, _page in PAGES.items():
    (GENERATED / f"{_name}.md").write_text(_page(), encoding="utf-8")

project = "beamsim"
author = project_copyright = "the beamsim authors"
version = release = __version__
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "site_pages.docstrings",
    "sphinx.ext.mathjax",
    "sphinx_design",
]
default_role = "py:obj"  # names in single backticks of docstrings are links
myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence"]
myst_heading_anchors = 3
exclude_patterns = ["site_pages", "tutorial.md"]  # the tutorial is built with what its commands print
autodoc_typehints = "signature"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_type_aliases = {
    name: name for name in ("Source", "Overrides", "Progress", "Stop", "Floats", "Complexes", "Ints")
}
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 300
smartquotes_action = "D"  # dashes; quotes of commands are copied into shells
highlight_language = "none"  # of blocks that name no language: screens, commands
html_theme = "furo"
# without the commit, and without a number before the first release
html_title = f"beamsim {version.partition('+')[0]}".removesuffix(" 0.0")
html_show_sourcelink = False
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_extra_path = ["scenario.schema.json"]
