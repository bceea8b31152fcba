"""The gallery: one picture of each of some shipped configs, made by running them.

``python -m docs.site_pages.gallery FOLDER`` draws all pictures of these configs and of some more, with the sketches of
their models, and puts them on one sheet: every kind of picture at a glance, and next to it at its own size.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from pkgutil import resolve_name
from typing import NamedTuple

from PIL import Image

import beamsim
from beamsim.cli.html_report import draw_model
from beamsim.kinds import KINDS
from beamsim.plots.drawing import Picture, save_figures

from .configs import CONFIGS, ROOT


class Entry(NamedTuple):
    """A picture of the gallery."""

    kind: str
    config: str
    picture: str  # its name among those of the result
    text: str


ENTRIES = [
    Entry("run", "one_sided_65hz", "displacement", "The tip of a cantilever against a snubber, shaken at 65 Hz."),
    Entry("run", "one_sided_65hz", "spectrum", "Its spectrum: the stop makes odd and even harmonics."),
    Entry("run", "shock_panel", "srs", "A half-sine shock on a panel with snubbers: response spectra."),
    Entry("run", "random_vibration", "random", "Random vibration of a panel with a stop: densities and levels."),
    Entry("run", "two_panels", "assembly_contact", "Two folded panels with a snubber between them, at a contact."),
    Entry("run", "two_panels", "contact_force", "The contact force between the two panels."),
    Entry("run", "plate_panel", "plate_modes", "Modes of a plate that is clamped along its left edge."),
    Entry("run", "snubber_rubber", "force_deflection", "A rubber snubber: measured curve and loops of its impacts."),
    Entry("run", "crushed_stop", "force_deflection", "A stop that yields: each hard impact moves its face back."),
    Entry("sweep", "chain_two_dof", "response_first", "Response curve of two masses with a stop, by continuation."),
    Entry("sweep", "continuation_60_120hz", "response_tip", "First resonance of the beam, with its unstable part."),
    Entry("sweep", "design_stiffness_gap", "maps", "A study over stiffness and gap of the snubber."),
    Entry("nnm", "nnm_first", "backbone", "Backbone of the first nonlinear mode."),
    Entry("identify-stiffness", "identify_snubber", "residuals", "Stiffness of a snubber from measured frequencies."),
]  # fmt: skip


MORE = [
    Entry("run", "moved_supports", "", "supports that move"),
    Entry("run", "imported_panel", "", "imported matrices"),
    Entry("run", "dry_friction", "", "friction"),
    Entry("run", "hinged_yoke", "", "a hinge with a rotational spring"),
    Entry("run", "deployed_boom", "", "a hinge with a stop, friction and a latch"),
    Entry("run", "earthquake", "", "a base and supports that follow records"),
    Entry("run", "shock_matched", "", "a record made for a spectrum"),
    Entry("sweep", "sweep_notched", "", "notches"),
    Entry("sweep", "design_tornado", "", "a tornado"),
    Entry("sweep", "design_two_motions", "", "a study of samples"),
    Entry("sweep", "sweep_test", "", "a swept sine"),
    Entry("identify-stiffness", "identify_pad", "", "a pad"),
]
"""Whose pictures are on the sheet alone."""
WIDTH, COLUMNS = 600, 4  # of the sheet, pixels of a picture


def sheet(folder: Path) -> Path:
    """Draw all pictures of all configs in ``folder``, and the sheet, whose path is returned."""
    folder.mkdir(parents=True, exist_ok=True)
    of_configs = {entry.config: entry for entry in (*ENTRIES, *MORE)}
    drawn = [
        path
        for entry in of_configs.values()
        for path in (*_sketch(entry, folder), *save_figures(_pictures(entry), folder, entry.config))
    ]
    rows = [_resized(drawn[first : first + COLUMNS]) for first in range(0, len(drawn), COLUMNS)]
    heights = [max(image.height for image in row) for row in rows]
    whole = Image.new("RGB", (COLUMNS * WIDTH, sum(heights)), "white")
    for number, row in enumerate(rows):
        for column, image in enumerate(row):
            whole.paste(image, (column * WIDTH, sum(heights[:number])))
    path = folder / "sheet.png"
    whole.save(path)
    return path


def _resized(paths: Sequence[Path]) -> list[Image.Image]:
    images = [Image.open(path).convert("RGB") for path in paths]
    return [image.resize((WIDTH, image.height * WIDTH // image.width)) for image in images]


def _sketch(entry: Entry, folder: Path) -> list[Path]:
    return draw_model(beamsim.load_scenario(CONFIGS[entry.config]), None, folder, entry.config)


def page(folder: Path) -> str:
    """Run the configs, save their pictures in ``folder`` and return the page as MyST Markdown."""
    folder.mkdir(parents=True, exist_ok=True)
    parts = [
        "# Gallery\n\nThis page is for readers who look for a kind of result. Every picture is one of those that the "
        "command above it writes.\n\n"
    ]
    solved: dict[str, dict[str, Picture]] = {}
    for entry in ENTRIES:
        if entry.config not in solved:
            solved[entry.config] = _pictures(entry)
        chosen = {entry.picture: solved[entry.config][entry.picture]}  # the others are not drawn
        (picture,) = save_figures(chosen, folder, entry.config)
        path = CONFIGS[entry.config].relative_to(ROOT).as_posix()
        parts.append(
            f"## {entry.text.rstrip('.')}\n\n```\nbeamsim {entry.kind} {path}\n```\n\n"
            f"![{entry.text}]({folder.name}/{picture.name})\n\n"
        )
    return "".join(parts)


def _pictures(entry: Entry) -> dict[str, Picture]:
    scenario = beamsim.load_scenario(CONFIGS[entry.config])
    kind = entry.kind
    if kind == "sweep":
        kind = "designs" if scenario.study is not None else getattr(scenario.sweep, "kind", "sweep")
        kind = kind if kind in KINDS else "sweep"
    if kind == "designs":
        result = beamsim.design_study(beamsim.plan_designs(scenario))
    else:
        result = resolve_name(KINDS[kind].analysis)(scenario)
    pictures: dict[str, Picture] = resolve_name(KINDS[kind].figures)(result)
    return pictures


if __name__ == "__main__":
    print(sheet(Path(sys.argv[1])))
