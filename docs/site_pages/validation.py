"""The page of comparisons with published numbers, each computed while the page is made."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

import beamsim
from beamsim.system.build import build_system

from .configs import CONFIGS
from .published import CASES

CONVERGENCE = Path(__file__).parents[1] / "convergence.csv"
QUICK = {"run.convergence": "off"}

_INTRODUCTION = """\
# Validation

This page compares computed with published numbers. Every computed number comes from a run that was made when the
page was built. Printed numbers are those of H. Hazim, *Vibrations of a beam with a unilateral spring. Periodic
solutions – Nonlinear normal modes*, PhD thesis, Université Nice Sophia Antipolis, 2010 (HAL tel-00520999), unless a
line says otherwise. Printed numbers that could not be reproduced are reported; nothing was adjusted.

Tests check more than this page: closed forms (`tests/analytic`), independent integration of random cases
(`tests/property`, [the attack](../attack.md)), observed orders of convergence (`tests/convergence`).

"""


def page() -> str:
    """Return the page as MyST Markdown."""
    sections = (
        frequencies, stiffness, linear_or_not, amplitudes, open_choices, nonlinear_modes, weak_springs, other_sources,
        errors, probabilities, fronts,
    )  # fmt: skip
    return _INTRODUCTION + "\n".join(section() for section in sections)


def fronts() -> str:
    """Fronts of two objectives against grids, from the table of ``python -m benchmarks.fronts``."""
    kept = yaml.safe_load((Path(__file__).parents[1] / "fronts.yaml").read_text(encoding="utf-8"))
    rows = [
        (one["problem"], one["seed"], one["cases"], one["quantity"], f"{one['right value']:g}", f"{one['value']:g}",
         f"{100 * one['difference']:+.2f} %")
        for one in kept["rows"]
    ]  # fmt: skip
    heads = ["problem", "seed", "cases", "quantity", "right value", "value", "difference"]
    return (
        f"## Fronts of two objectives\n\n`python -m benchmarks.fronts`, {kept['date']}, commit {kept['commit']}. Right "
        "values are those of grids, in SI units. A negative difference is a front that reaches farther than the grid. "
        f"If a front has a gap, the grid has it, too.\n\n{table(heads, rows)}"
    )


def errors() -> str:
    """Stated errors of values, and those that they have: the table of `benchmarks/convergence_of_configs.py`."""
    with CONVERGENCE.open(encoding="utf-8") as file:
        made, result = (file.readline().removeprefix("# ").strip() for _ in range(2))
        rows = list(csv.DictReader(file))
    shown = [
        (f"`{row['config']}`", row["quantity"], row["value"], *(f"{100 * float(row[name]):.2g} %" for name in of))
        for of in [("stated_error", "true_error")]
        for row in rows
        if row["quantity"].startswith("peak_") and float(row["true_error"]) >= 1e-3
    ]
    heads = ["config", "value", "computed", "stated error", "true error"]
    return (
        "## Stated and true errors\n\nShipped runs, swept and stepped sines were solved with four and eight times "
        f"the modes and elements ({made}; long motions are shortened, see `benchmarks/convergence_of_configs.py`). "
        f"{result}. "
        "Left out are values that the program calls one of many motions or without a limit. The peaks that are off by "
        "0.1 % or more; all values are in `docs/convergence.csv`.\n\n" + table(heads, shown)
    )


def other_sources() -> str:
    """Cases of manuals, test suites and papers of the field."""
    parts = [
        "## Cases of other sources\n\nEach case is compared with its closed form, or with an independent solution, in "
        "`tests/reference/test_published_cases.py`. A note below each table explains why printed numbers differ.\n"
    ]
    for one in CASES:
        found = one.computed()
        rows = [
            (quantity, *(_compared(one.printed[quantity], value) if one.printed.get(quantity) else
                         (f"{one.printed.get(quantity, '')}", f"{value:.7g}", "")))
            for quantity, value in found.items()
        ]  # fmt: skip
        heads = ["quantity", "printed", "computed", "difference"]
        parts.append(f"### {one.title}\n\n{one.source}.\n\n{table(heads, rows)}\n{one.note}\n")
    return "\n".join(parts)


def probabilities() -> str:
    """How often intervals of probabilities hold the exact ones: the table that is kept of a benchmark."""
    kept = yaml.safe_load((Path(__file__).parents[1] / "probabilities.yaml").read_text(encoding="utf-8"))
    rows = [
        (of["problem"], of["samples"], f"{of['exact']:.3g}", f"{of['mean'] / of['exact']:.3f}",
         f"{of['held']} of {of['seeds']}", f"{of['check_agrees']} of {of['seeds']}", of["histories"],
         f"{of['doubles_held']} of {of['doubles']}", f"{of['importance_held']} of {of['importances']}")
        for of in kept["rows"]
    ]  # fmt: skip
    heads = [
        "problem", "samples", "exact", "mean / exact", "95 % interval contains it", "check agrees",
        "histories on average", "what doubles it: intervals that contain it", "importance: intervals that contain it",
    ]  # fmt: skip
    return (
        "## Probabilities\n\nProblems with an exact probability, each with many seeds; the target of the coefficient "
        f"of variation is 10 %. Computed on {kept['date']} at commit {kept['commit']} by "
        f"`python -m benchmarks.probabilities`.\n\n{table(heads, rows)}\n"
    )


def table(heads: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Return a Markdown table."""
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    return "\n".join(lines + ["| " + " | ".join(map(str, row)) + " |" for row in rows]) + "\n"


def case(name: str, changes: Mapping[str, Any] | None = None) -> Any:
    """Return a shipped scenario with changes."""
    return beamsim.load_scenario(CONFIGS[name], {**(changes or {})})


def _compared(printed: float, computed: float) -> tuple[str, str, str]:
    return f"{printed:g}", f"{computed:.5g}", f"{100 * (computed / printed - 1):+.2f} %"


def frequencies() -> str:
    """Tables 1.2 and 1.3 of the thesis."""
    modes = build_system(case("one_sided_65hz")).modes
    opened, closed = modes["open_frequencies_hz"].values, modes["closed_frequencies_hz"].values
    printed = {
        "without spring, predicted (table 1.2)": ([52.7, 328.5, 931.3], opened),
        "without spring, measured": ([51.9, 329.4, 934.4], opened),
        "spring always in contact, predicted (table 1.3)": (
            [196.0, 447.1, 966.0],
            modes["closed_frequencies_hz"].values,
        ),
        "spring always in contact, measured": ([196.5, 448.0, 969.5], closed),
    }
    rows = [
        (what, mode, *_compared(value, computed[mode - 1]))
        for what, (values, computed) in printed.items()
        for mode, value in enumerate(values, 1)
    ]
    heavy = {"beam.point_masses": [{"position": x, "mass": 0.045} for x in (0.135, 0.2025, 0.27)]}
    with_printed_masses = build_system(case("one_sided_65hz", heavy)).modes["open_frequencies_hz"].values[0]
    printed_stiffness = {"snubbers[0].stiffness": 559.625e3}
    with_printed_stiffness = (
        build_system(case("one_sided_65hz", printed_stiffness)).modes["closed_frequencies_hz"].values
    )
    return (
        "## Natural frequencies of the test rig\n\n"
        + table(["quantity, Hz", "mode", "printed", "computed", "difference"], rows)
        + f"""
Two printed inputs do not fit these frequencies. Accelerometers of 45 g would give a first frequency of
{with_printed_masses:.1f} Hz; 4.2 g reproduces table 1.2. A spring of 559.625 kN/m would give
{", ".join(f"{value:.0f}" for value in with_printed_stiffness[:3])} Hz in table 1.3; 559.625 × 0.27 = 151.1 kN/m gives
the printed values, so a factor of the length is probably missing. The configs use 4.2 g and 151.1 kN/m.
"""
    )


def stiffness() -> str:
    """Section 1.3.3 of the thesis."""
    rows = []
    for measured in (196.0, 196.5):
        result = beamsim.identify_stiffness(case("identify_snubber", {"identify_stiffness.measured_with": [measured]}))
        value = result.summary["stiffness_n_per_m"] / 1e3
        rows.append((f"{measured:g} Hz", f"{value:.2f}", f"{100 * (value / 151.1 - 1):+.2f} %"))
    heads = ["first frequency in contact", "identified, kN/m", "difference from 559.625 × 0.27 = 151.1 kN/m"]
    return "## Stiffness of the snubber from its frequency\n\n" + table(heads, rows)


def linear_or_not() -> str:
    """The cases that the thesis calls linear or nonlinear."""
    printed = {
        "prestressed_90hz_0_5g": "linear", "prestressed_465hz_1g": "linear", "prestressed_45hz_3g": "nonlinear",
        "prestressed_90hz_3g": "nonlinear", "prestressed_160hz_5g": "nonlinear", "prestressed_220hz_8g": "nonlinear",
        "prestressed_465hz_15g": "nonlinear", "backlash_45hz_2g": "nonlinear", "backlash_65hz_3g": "nonlinear",
        "backlash_110hz_13g": "nonlinear", "point_force_32hz": "nonlinear", "point_force_100hz": "nonlinear",
        "point_force_124hz": "nonlinear",
    }  # fmt: skip
    rows = []
    for name, expected in printed.items():
        summary = beamsim.run(case(name, QUICK)).summary
        computed = "linear" if summary["linear"] else "nonlinear"
        rows.append((f"`{name}`", expected, computed, f"{100 * summary['contact_share']['tip']:.1f} %"))
    return (
        "## Linear or nonlinear\n\nThe amount of prestress is not printed: 0.2 mm was chosen, between the 0.086 and "
        "0.43 mm that the printed cases imply. The printed backlash of 5 mm never closes; 0.5 mm does in all three "
        "cases.\n\n" + table(["config", "printed", "computed", "time in contact"], rows)
    )


# largest tip displacement, m, and acceleration, g, from 0.7 to 0.8 s: ends of the printed axes, or what the text says
PRINTED = {45: (1.5e-4, 10.0), 65: (4.0e-4, 20.0), 78: (1.4e-3, 60.0), 160: (3.0e-4, 10.0)}


def _largest(frequency: float, changes: Mapping[str, Any] | None = None, frame: str = "base") -> tuple[float, float]:
    """Return the largest displacement, m, and acceleration, g, of the tip from 0.7 to 0.8 s."""
    result = beamsim.run(case(f"one_sided_{frequency}hz", {**QUICK, **(changes or {})}))
    last = result["histories"]["time"].values >= 0.7
    displacement = result["histories"]["displacement"].sel(probe="tip").values[last]
    if frame == "inertial":
        omega = 2 * np.pi * frequency
        displacement = displacement - 2 * 9.80665 / omega**2 * np.sin(omega * result["histories"]["time"].values[last])
    return float(displacement.max()), float(
        np.abs(result["histories"]["absolute_acceleration"].sel(probe="tip").values[last]).max()
    ) / 9.80665


def amplitudes() -> str:
    """The forced amplitudes of chapter 1."""
    rows = []
    for hz, (displacement, acceleration) in PRINTED.items():
        ours = _largest(hz)
        rows.append((f"{hz} Hz", *_compared(displacement * 1e3, ours[0] * 1e3), *_compared(acceleration, ours[1])))
    heads = ["frequency", "printed displacement, mm", "computed", "difference",
             "printed acceleration, g", "computed", "difference"]  # fmt: skip
    return (
        "## Forced amplitudes, 2 g, zero gap\n\nThe printed numbers are the ends of axes, which only bound the curves, "
        "or numbers in the text. Computed with 1 % modal damping and a dashpot of 2 % in the snubber.\n\n"
        + table(heads, rows)
    )


def open_choices() -> str:
    """What the thesis leaves open, and with which of its amplitudes each choice agrees."""
    closed = build_system(case("one_sided_65hz")).modes["closed_frequencies_hz"].values[0]
    proportional = {"kind": "rayleigh", "mass": 0.0, "stiffness": 2 * 0.01 / (2 * np.pi * closed)}
    others = [{"position": x, "mass": 4.0e-3} for x in (0.135, 0.189, 0.27)]
    printed_masses = [{"position": x, "mass": 0.045} for x in (0.135, 0.2025, 0.27)]
    choices: dict[str, tuple[dict[str, Any], str, float]] = {
        "as in the configs": ({}, "base", 1.0),
        "damping proportional to stiffness, 1 % in contact": ({"beam.damping": proportional}, "base", 1.0),
        "modal damping of 2 %": ({"beam.damping.ratio": 0.02}, "base", 1.0),
        "modal damping of 5 %": ({"beam.damping.ratio": 0.05}, "base", 1.0),
        "no dashpot in the snubber": ({"snubbers[0].damping": None}, "base", 1.0),
        "a snubber that cannot pull": ({"snubbers[0].law": "no_tension"}, "base", 1.0),
        "dashpot of 10 %": ({"snubbers[0].damping.ratio": 0.1}, "base", 1.0),
        "displacement in space instead of relative to the base": ({}, "inertial", 1.0),
        "level of 1.1 g": ({}, "base", 1.1 / 2),
        "accelerometers of 4.0 g at 0.5, 0.7 and 1.0 of the length": ({"beam.point_masses": others}, "base", 1.0),
        "accelerometers of 45 g as printed": ({"beam.point_masses": printed_masses}, "base", 1.0),
        "spring of 559.625 kN/m as printed": ({"snubbers[0].stiffness": 559.625e3}, "base", 1.0),
    }  # fmt: skip
    rows, most = [], 0
    for what, (changes, frame, scale) in choices.items():
        cells, met = [], 0
        for frequency, printed in PRINTED.items():
            computed = _largest(frequency, changes, frame)
            ratios = [scale * ours / value for ours, value in zip(computed, printed, strict=True)]
            fits = [0.9 <= ratio <= 1.1 for ratio in ratios]
            met += sum(fits)
            cells.append(" / ".join(f"**{r:.2f}**" if ok else f"{r:.2f}" for r, ok in zip(ratios, fits, strict=True)))
        rows.append((what, *cells, f"{met} of 8"))
        most = max(most, met)
    heads = ["choice", *(f"{frequency} Hz" for frequency in PRINTED), "within 10 %"]
    return (
        "## What the thesis leaves open\n\nDamping model, frame of the displacements, dashpot, accelerometers and "
        "level are not documented, or are printed with values that contradict its tables. Each line changes one choice "
        "of the configs; damping in contact is that of the first mode with the spring always in contact. The figures "
        "are computed over printed, for displacement / acceleration; those within 10 % are bold: at most "
        f"{most} of the eight with any one choice.\n\n" + table(heads, rows)
    )


def nonlinear_modes() -> str:
    """Chapter 3 of the thesis."""
    rows = []
    for name, what, quantity, printed in (
        ("nnm_chain_mass_5", "six masses, one-sided spring of 0.5 on mass 5, mode 4", "period, s", 4.011),
        ("nnm_chain_mass_1", "six masses, one-sided spring of 0.5 on mass 1, mode 4", "period, s", 3.97),
        ("nnm_thesis_mode_1", "cantilever, 107 kN/m, mode 1, factor 1", "frequency, Hz", 57.62),
        ("nnm_thesis_mode_2", "cantilever, 107 kN/m, mode 2, factor 0.1", "frequency, Hz", 354.91),
    ):
        backbone = beamsim.nnm(case(name)).branches[0]
        last = float(backbone["frequency_hz"].values[-1])
        rows.append((what, quantity, *_compared(printed, 1 / last if "period" in quantity else last)))
    return (
        "## Nonlinear normal modes\n\n"
        + table(["case", "quantity", "printed", "computed", "difference"], rows)
        + """
The printed 57.62 Hz does not belong to 107 kN/m: the bare beam alone has 56.0 Hz, and 57.62 Hz belongs to 689 N/m. The
mode that the thesis calls the second with the spring on mass 1 is the fourth; the second linear period is 7.24 s.
"""
    )


def weak_springs() -> str:
    """The expansion for weak springs against its closed form: one mass with a one-sided spring of factor e."""
    rows = []
    for factor in (0.02, 0.1, 0.5, 2.0):
        stop = {"mass": 1, "side": "below", "stiffness": 1.0, "gap": 0.0}
        chain = {"masses": [1.0], "springs": [1.0], "snubbers": [stop]}
        section = {"mode": 1, "continue_in": {"kind": "stiffness_factor", "to": factor}}
        backbone = beamsim.nnm(beamsim.load_scenario({"chain": chain, "nnm": section})).branches[0]
        computed = 2 * np.pi * float(backbone["frequency_hz"].values[-1])
        exact = 2 * np.sqrt(1 + factor) / (1 + np.sqrt(1 + factor))
        series = 1 + factor / 4 - factor**2 / 8
        rows.append((f"{factor:g}", f"{exact:.12f}", f"{abs(computed / exact - 1):.1e}", f"{series / exact - 1:+.1e}"))
    heads = ["factor", "exact frequency", "difference of the backbone", "difference of the expansion to second order"]
    return (
        "## One mass with a one-sided spring\n\nWith u'' + u + ε u₊ = 0 the frequency is known: "
        "ω = 2√(1+ε) / (1 + √(1+ε)).\n\n" + table(heads, rows)
    )
