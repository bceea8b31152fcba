"""The gallery: one picture of each of some shipped configs, made by running them."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import beamsim
from beamsim.kinds import KINDS, named
from beamsim.plots.drawing import save_figures

CONFIGS = Path(__file__).parents[2] / "configs"


class Entry(NamedTuple):
    """A picture of the gallery."""

    kind: str
    config: str
    picture: str  # what the file's name ends with
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


def page(folder: Path) -> str:
    """Run the configs, save their pictures in ``folder`` and return the page as MyST Markdown."""
    folder.mkdir(parents=True, exist_ok=True)
    parts = ["# Gallery\n\nEvery picture is one of those that the command writes beside its result file.\n\n"]
    shown: dict[str, list[Path]] = {}
    for entry in ENTRIES:
        if entry.config not in shown:
            shown[entry.config] = _pictures(entry, folder)
        (picture,) = [path for path in shown[entry.config] if path.stem == f"{entry.config}_{entry.picture}"]
        parts.append(
            f"## {entry.text.rstrip('.')}\n\n```\nbeamsim {entry.kind} configs/{entry.config}.yaml\n```\n\n"
            f"![{entry.text}]({folder.name}/{picture.name})\n\n"
        )
    return "".join(parts)


def _pictures(entry: Entry, folder: Path) -> list[Path]:
    scenario = beamsim.load_scenario(CONFIGS / f"{entry.config}.yaml")
    kind = entry.kind
    if kind == "sweep":
        kind = "designs" if scenario.vary is not None else getattr(scenario.sweep, "kind", "sweep")
    if kind == "designs":
        result = beamsim.design_study(beamsim.plan_designs(scenario))
    else:
        result = named(KINDS[kind].analysis)(scenario)
    return save_figures(named(KINDS[kind].figures)(result), folder, entry.config)
