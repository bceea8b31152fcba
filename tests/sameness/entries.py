"""What is recorded: every shipped config with every command it has a section for, and variants of further kinds."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path
from typing import Any

import yaml

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
COMMANDS = {
    "run": "run",
    "sweep": "sweep",
    "vary": "sweep",
    "nnm": "nnm",
    "identify_stiffness": "identify-stiffness",
}
"""Section -> command."""

SHORTENED: dict[str, tuple[str, ...]] = {
    "continuation_friction sweep": ("sweep.from=4.95 Hz", "sweep.to=5.05 Hz", "sweep.levels=[6 N]"),
    "continuation_overlay sweep": ("sweep.from=80 Hz", "sweep.to=86 Hz"),
    "design_stiffness_gap sweep": (
        "run.duration=0.45 s",
        "vary.parameters[0].points=6",
        "vary.parameters[1].points=5",
    ),
    "design_robust sweep": (
        "run.duration=0.45 s",
        "vary.parameters[0].points=3",
        "vary.tolerances.samples=5",
        "vary.tolerances.quantile=60 %",
    ),
    "design_tolerances sweep": ("vary.samples=40",),
    "spring_position sweep": ("vary.parameters[0].points=6",),
    "sweep_one_sided_2g sweep": ("sweep.rate=8 oct/min",),
    "sweep_up_down sweep": ("sweep.rate=8 oct/min",),
}
"""Entry -> overrides that make it short."""

SHORT = ("run.duration=0.3 s", "run.spectrum.last=0.2 s")
VARIANTS: dict[str, tuple[str, ...]] = {
    "one_sided_65hz run reference": ("run.method=reference", "run.duration=0.015 s", "run.spectrum.last=0.01 s"),
    "one_sided_65hz run rest_gravity": ("run.start=rest", "gravity=9.81 m/s^2", *SHORT),
    "one_sided_65hz run mode": ("run.start={mode: 2, amplitude: 1 mm}", *SHORT),
    "one_sided_65hz run released": (
        "run.start={released_force: {position: 270 mm, force: 10 N}}",
        *SHORT,
    ),
    "one_sided_65hz run rayleigh_tube": (
        "beam.damping={kind: rayleigh, mass: 3 1/s, stiffness: 20 us}",
        "beam.section={kind: tube, outer_diameter: 12 mm, wall_thickness: 2 mm}",
        "beam.width=null",
        "beam.thickness=null",
        *SHORT,
    ),
    "one_sided_65hz run viscous": ("beam.damping={kind: viscous, coefficient: 3 N s/m^2}", *SHORT),
    "one_sided_65hz run step": ("excitation={kind: step, applied_to: base, level: 5 g}", *SHORT),
    "one_sided_65hz run half_sine": (
        "excitation={kind: half_sine, applied_to: base, level: 20 g, duration: 11 ms}",
        *SHORT,
    ),
    "one_sided_65hz run multi_tone": (
        "excitation={kind: multi_tone, applied_to: base, tones: "
        "[{level: 1 g, frequency: 65 Hz}, {level: 2 g, frequency: 91 Hz}]}",
        *SHORT,
    ),
    "one_sided_65hz run swept_sine": (
        "excitation={kind: swept_sine, applied_to: base, level: 2 g, from: 40 Hz, to: 120 Hz, rate: 200 Hz/s}",
        *SHORT,
    ),
    "prestressed_90hz_3g run both_sides": (
        "snubbers=[{name: below, position: 270 mm, side: below, stiffness: 151.1 kN/m, gap: -0.2 mm}, "
        "{name: above, position: 200 mm, side: above, mounted_on: ground, stiffness: 50 kN/m, gap: 0.1 mm}]",
        *SHORT,
    ),
    "one_sided_65hz sweep stepped": ("sweep={kind: stepped, from: 60 Hz, to: 70 Hz, points: 4, direction: both}",),
    "chain_two_dof sweep harmonic_balance": ("sweep.method={kind: harmonic_balance, harmonics: 21}",),
    "one_sided_65hz sweep zip": (
        *SHORT,
        "vary={kind: zip, parameters: [{path: snubbers.tip.gap, values: [0 mm, 0.1 mm]}, "
        "{path: excitation.frequency, values: [65 Hz, 78 Hz]}]}",
    ),
    "one_sided_65hz sweep varied": (
        "sweep={kind: continuation, from: 75 Hz, to: 85 Hz}",
        "vary={kind: grid, parameters: [{path: snubbers.tip.stiffness, values: [100 kN/m, 151.1 kN/m]}]}",
    ),
    "chain_cubic nnm frequency": ("nnm.energy=null", "nnm.continue_in={kind: frequency, from: 0.249 Hz, to: 0.26 Hz}"),
    "two_panels sweep continuation": ("sweep={kind: continuation, from: 36 Hz, to: 38 Hz}",),
    "nnm_chain_mass_5 nnm full_period": ("nnm.method=full_period",),
    "sweep_up_down sweep regular": ("sweep.from=70 Hz", "sweep.to=90 Hz"),
    "sweep_backlash sweep regular": ("sweep.from=40 Hz", "sweep.to=60 Hz"),
    "prestressed_160hz_5g run short": ("run.duration=0.1 s", "run.spectrum.last=0.05 s"),
    "prestressed_220hz_8g run short": ("run.duration=0.1 s", "run.spectrum.last=0.05 s"),
    "ms_forced_oscillator sweep compare": (),
    "nnm_first nnm compare": (),
    "nnm_chain_mass_5 nnm compare": (),
    "continuation_60_120hz sweep overlay": (),
    "one_sided_65hz compare": (),
    "one_sided_78hz compare": (),
    "sweep_test compare": (),
}
"""Further entries: ``config command name`` -> overrides."""

OPTIONS: dict[str, list[str]] = {
    "ms_forced_oscillator sweep compare": ["--compare", "multiple_scales"],
    "nnm_first nnm compare": ["--compare", "multiple_scales"],
    "nnm_chain_mass_5 nnm compare": ["--compare", "multiple_scales", "--compare", "thesis"],
    "continuation_60_120hz sweep overlay": ["--overlay", "{before}"],
    "one_sided_65hz compare": [str(CONFIGS / "measurements/tip_65hz_2g.csv"), "--unit", "g", "--probe", "tip"],
    "one_sided_78hz compare": [str(CONFIGS / "measurements/tip_78hz_2g.csv"), "--unit", "g", "--probe", "tip"],
    "sweep_test compare": [str(CONFIGS / "measurements/sweep_test.csv"), "--reference", "base", "--cycles", "3"],
}
"""Entry -> further options; ``{before}`` is the result file of the step before."""

BEFORE: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "continuation_60_120hz sweep overlay": (
        "sweep",
        "sweep_one_sided_2g",
        ("sweep.from=75 Hz", "sweep.to=90 Hz"),
    ),
    "one_sided_65hz compare": ("run", "one_sided_65hz", ()),
    "one_sided_78hz compare": ("run", "one_sided_78hz", ()),
    "sweep_test compare": ("sweep", "sweep_test", ()),
}
"""Entry -> command, config and overrides of a step before it."""


SLOW = (
    *("continuation_* run", "identify_snubber run", "nnm_first run", "nnm_forced_backbone run", "spring_position run"),
    *("sweep_* run", "backlash_* run", "random_vibration run", "* reference", "* sweep stepped", "* sweep overlay"),
    *("design_* sweep", "spring_position sweep", "* sweep zip", "* sweep varied", "sweep_* sweep", "* sweep regular"),
    *("continuation_60_120hz sweep", "continuation_overlay sweep", "continuation_friction sweep"),
    *("continuation_position sweep", "continuation_folds sweep", "continuation_stiffness sweep", "two_panels *"),
    *("continuation_level sweep", "chain_bumpers sweep", "nnm_energy nnm", "nnm_chain_mass_5 nnm compare", "ms_beam_*"),
    *("identify_nonlinear *", "nnm_forced_* nnm", "nnm_thesis_mode_* nnm", "nnm_first nnm*"),
    *("prestressed_160hz_5g run", "prestressed_220hz_8g run", "prestressed_90hz_3g run", "prestressed_465hz_15g run"),
    *("point_force_* run", "plate_panel run", "vibeams run", "vibeams sweep", "vibeams_backbone nnm"),
    *("two_panels_opening sweep", "one_sided_65hz run swept_sine", "shock_panel run", "pressure_on_plate run"),
    *("chain_two_dof sweep", "chain_two_dof sweep harmonic_balance", "continuation_harmonic_balance sweep"),
    *("yoke_reactions run", "hinged_yoke run"),
    *("design_* run", "one_sided_45hz run", "one_sided_160hz run", "prestressed_465hz_1g run", "nnm_energy run"),
    *("ms_chain_mode_4 nnm", "nnm_chain_mass_1 nnm", "identify_accelerometers run", "one_sided_65hz run viscous"),
    *("ms_forced_oscillator sweep compare", "continuation_gap sweep", "nnm_chain_thesis_method nnm"),
    *("nnm_never_at_rest nnm", "nnm_chain_mass_5 nnm full_period", "one_sided_78hz compare"),
    "chain_cubic nnm*",
)
"""Patterns of entries that take about a second or more, or repeat a config that other fast tests run."""


@dataclass(frozen=True)
class Entry:
    """One config with one command, perhaps a variant of it."""

    name: str
    """Config, command and, of a variant, its name."""

    @property
    def slow(self) -> bool:
        """Whether it is one of the slow ones."""
        return any(fnmatchcase(self.name, pattern) for pattern in SLOW)

    def commands(self, folder: Path, changes: Iterable[str] = ()) -> list[list[str]]:
        """Arguments of the command line, the recorded step last; step n writes into ``folder/n``."""
        config, command, *_ = self.name.split()
        steps = []
        before = BEFORE.get(self.name)
        if before:
            steps.append([before[0], str(CONFIGS / f"{before[1]}.yaml"), *overrides((*before[2], *changes))])
        options = list(OPTIONS.get(self.name, []))
        result = str(folder / "0" / f"{before[1]}.h5") if before else ""
        options = [result if option == "{before}" else option for option in options]
        if command == "compare":
            return [*steps, [command, result, *options]]
        own = SHORTENED.get(self.name, ()) + VARIANTS.get(self.name, ())
        if command == "sweep" and ("vary" in merged(config) or any(x.startswith("vary=") for x in own)):
            options += ["--workers", "1"]
        return [*steps, [command, str(CONFIGS / f"{config}.yaml"), *overrides((*own, *changes)), *options]]

    def perturbations(self) -> list[str]:
        """Overrides that change the level, or the structure, by no more than round-off."""
        scenario = merged(self.name.split()[0])
        changes = []
        replaced = any(change.startswith("excitation=") for change in VARIANTS.get(self.name, ()))
        excitation = scenario.get("excitation", {})
        level = excitation.get("level")
        if excitation.get("kind") == "harmonic" and not replaced:
            changes.append(f"excitation.level={nudged(level)}")
        if "beam" in scenario:
            first = scenario["beam"].get("segments", [scenario["beam"]])[0]
            where = "segments[0]." if "segments" in scenario["beam"] else ""
            key = "youngs_modulus" if "youngs_modulus" in first else "bending_stiffness"
            changes.append(f"beam.{where}{key}={nudged(first[key])}")
        elif "bodies" in scenario:
            name, body = next(iter(scenario["bodies"].items()))
            where, first = ("segments[0].", body["segments"][0]) if "segments" in body else ("", body)
            if "youngs_modulus" in first:
                changes.append(f"bodies.{name}.{where}youngs_modulus={nudged(first['youngs_modulus'])}")
            else:
                changes.append(f"snubbers[0].stiffness={nudged(scenario['snubbers'][0]['stiffness'])}")
        else:
            springs = scenario["chain"]["springs"]
            index = next((k for k in range(1, len(springs)) if float(str(springs[k]).split()[0])), 0)
            changes.append(f"chain.springs[{index}]={nudged(springs[index])}")
        return changes


def overrides(changes: Iterable[str]) -> list[str]:
    """``--set`` for every change."""
    return [word for change in changes for word in ("--set", change)]


def nudged(quantity: Any) -> str:
    """A quantity with its unit, larger by 1e-15 of itself."""
    number, *unit = str(quantity).split(maxsplit=1)
    return " ".join([repr(float(number) * (1.0 + 1e-15)), *unit])


@cache
def merged(config: str) -> dict[str, Any]:
    """A config with what it extends; sections merged one level deep, which is enough to see what it has."""
    own = yaml.safe_load((CONFIGS / f"{config}.yaml").read_text(encoding="utf-8"))
    base = merged(Path(own.pop("extends")).stem) if "extends" in own else {}
    result = dict(base)
    for name, section in own.items():
        both = isinstance(section, dict) and isinstance(base.get(name), dict)
        result[name] = base[name] | section if both else section
    return result


def all_entries() -> list[Entry]:
    """Every config with every command it has a section for, then the variants."""
    names = []
    for path in sorted(CONFIGS.glob("*.yaml")):
        names += [f"{path.stem} {command}" for section, command in COMMANDS.items() if merged(path.stem).get(section)]
    return [Entry(name) for name in dict.fromkeys([*names, *VARIANTS])]
