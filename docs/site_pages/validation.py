"""The page of comparisons with published numbers: most are computed while the page is made, slow ones are recorded."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

import beamsim
from beamsim.system.build import build_system

from . import finite_elements
from .configs import CONFIGS
from .published import CASES, NOT_COMPUTED, RECORDED, Published

DOCS = Path(__file__).parents[1]
QUICK = {"run.convergence": "off", "run.spectrum": None}
AGREES = 0.01  # largest relative difference of a value that agrees
PRINTED = "printed"


class Row(NamedTuple):
    """A published or right value, and the computed one."""

    source: str  # where the value is from: printed, measured, a closed form, an independent computation
    quantity: str
    published: float | str
    computed: float | str
    why: str = ""  # they differ
    scale: float = 0.0  # of the difference; 0: the published value

    @property
    def difference(self) -> float | None:
        """Relative difference; None of words."""
        if isinstance(self.published, str) or isinstance(self.computed, str):
            return None
        return (self.computed - self.published) / (self.scale or abs(self.published))

    @property
    def agrees(self) -> bool:
        """Whether the values are the same within `AGREES`, or the words are."""
        difference = self.difference
        return self.published == self.computed if difference is None else abs(difference) <= AGREES


class Section(NamedTuple):
    """A publication or a chapter of one, with its values."""

    title: str
    publication: str
    rows: list[Row]
    note: str = ""


def page() -> str:
    """Return the page as MyST Markdown."""
    thesis = [frequencies(), stiffness(), linear_or_not(), amplitudes(), nonlinear_modes(), weak_springs()]
    others = [published(one) for one in CASES]
    codes = [published(one) for one in finite_elements.published()]
    for section in thesis + others + codes:
        for row in section.rows:
            if not row.agrees and not row.why:
                raise ValueError(f"{section.title}, {row.quantity}: {row.published} and {row.computed} differ: say why")
    parts = [
        "# Validation\n",
        summary(thesis + others + codes),
        "## The thesis\n\nH. Hazim, *Vibrations of a beam with a unilateral spring. Periodic solutions – Nonlinear "
        "normal modes*, PhD thesis, Université Nice Sophia Antipolis, 2010 (HAL tel-00520999).\n",
        *map(rendered, thesis),
        open_choices(),
        "## Verification manuals, test suites and papers\n\nThe closed forms and independent computations are those of "
        "`tests/reference/test_published_cases.py`.\n",
        *map(rendered, others),
        OTHER_CODE,
        *map(rendered, codes),
        errors(),
        probabilities(),
        fronts(),
        attack(),
    ]
    return "\n".join(parts)


OTHER_CODE = """\
## Another finite-element code

The same structures computed by CalculiX, whose beams and plates are bricks. The motions are undamped, begin at rest and
were integrated without numerical damping (α = 0). Input decks and numbers are in `tests/reference/calculix`;
`benchmarks/calculix.py` writes them. Beams have Poisson's ratio 0 there, so that they do not bend across. A row of
single bricks has too large a torsional stiffness: 0.5 % in mode 4 of the frame.
"""


def summary(sections: Sequence[Section]) -> str:
    """How many values there are, how many agree, and which do not."""
    rows = [(section, row) for section in sections for row in section.rows]
    apart = [(section, row) for section, row in rows if not row.agrees]
    numbers = [abs(row.difference) for _, row in rows if row.difference is not None]
    within = {limit: sum(difference <= limit for difference in numbers) for limit in (1e-4, 1e-3, AGREES, 0.05)}
    counts = ", ".join(f"{count} agree within {100 * limit:g} %" for limit, count in within.items())
    right = [row for section, row in rows if row.source not in (PRINTED, "measured") and row.difference is not None]
    close = sum(abs(row.difference or 0.0) <= 1e-3 for row in right)
    reasons: dict[tuple[str, str], list[Row]] = {}
    for section, row in apart:
        reasons.setdefault((section.title, row.why), []).append(row)
    lines = [
        f"- [{title}](#{_anchor(title)}), {_range(found)} ({_names(found)}). {why}"
        for (title, why), found in reasons.items()
    ]
    recorded = yaml.safe_load(RECORDED.read_text(encoding="utf-8"))
    missing = [f"- {what}: {why}" for what, why in NOT_COMPUTED.items()]
    publications = len({section.publication for section in sections})
    return f"""\
This page compares computed values with published ones, and with closed forms and independent computations where a
publication is wrong or inexact. Nothing was adjusted. Most values are computed when the page is built. Those of long
computations were recorded by `python -m benchmarks.published_cases` on {recorded["date"]} at commit
{recorded["commit"]}.

**Summary.** {len(rows)} values of {publications} sources are compared: {len(numbers)} numbers and
{len(rows) - len(numbers)} statements. Of the numbers {counts}.
{len(right)} of the numbers are closed forms or independent computations; {close} of these agree within 0.1 %. Values
agree on this page if they differ by at most {100 * AGREES:g} %. These {len(apart)} do not:

{chr(10).join(lines)}

Not computed, and counted nowhere above:

{chr(10).join(missing)}
"""


def _names(rows: Sequence[Row]) -> str:
    names = list(dict.fromkeys(row.quantity for row in rows))
    return names[0] if len(names) == 1 else f"{len(names)} values: {names[0]} … {names[-1]}"


def _range(rows: Sequence[Row]) -> str:
    found = [row.difference for row in rows if row.difference is not None]
    if not found:
        return "other statement"
    low, high = min(found), max(found)
    return _percent(low) if len(found) == 1 else f"{_percent(low)} to {_percent(high)}"


def _percent(difference: float) -> str:
    digits = f"{100 * difference:+.0f}" if abs(difference) >= 0.1 else f"{100 * difference:+.2g}"
    return f"{digits} %" if abs(difference) > 1e-9 else "0"


def _anchor(title: str) -> str:
    kept = "".join(letter for letter in title.lower() if letter.isalnum() or letter in " -")
    return kept.replace(" ", "-")


def rendered(section: Section) -> str:
    """A section with the table of its values and a comment on those that do not agree."""
    comments = list(dict.fromkeys(row.why for row in section.rows if not row.agrees))
    marks = {why: f" ({chr(ord('a') + k)})" for k, why in enumerate(comments)}
    rows = [
        (row.source, row.quantity, _shown(row.published), _shown(row.computed),
         ("same" if row.agrees else "other") + marks.get(row.why if not row.agrees else "", "")
         if row.difference is None else _percent(row.difference) + ("" if row.agrees else marks[row.why]))
        for row in section.rows
    ]  # fmt: skip
    lines = [f"### {section.title}\n"]
    lines += [f"{section.publication}.\n"] if section.publication != THESIS else []
    lines.append(table(["source", "quantity", "published", "computed", "difference"], rows))
    lines += [f"{mark.strip()} {why}\n" for why, mark in marks.items()]
    return "\n".join([*lines, f"{section.note}\n"] if section.note else lines)


def _shown(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.7g}"


def published(one: Published) -> Section:
    """The values of a case of another source."""
    found = one.computed()
    rows = []
    for quantity, value in found.items():
        for source, values, why in ((PRINTED, one.printed, one.why), (one.right_by, one.right, one.why_right)):
            if quantity in values:
                rows.append(Row(source, quantity, values[quantity], value, why, one.scale))
    return Section(one.title, one.source, rows, one.note)


THESIS = "H. Hazim (2010)"


def errors() -> str:
    """Stated errors of values, and those that they have: the table of `benchmarks/convergence_of_configs.py`."""
    with (DOCS / "convergence.csv").open(encoding="utf-8") as file:
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


def probabilities() -> str:
    """How often intervals of probabilities hold the exact ones: the table that is kept of a benchmark."""
    kept = yaml.safe_load((DOCS / "probabilities.yaml").read_text(encoding="utf-8"))
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


def fronts() -> str:
    """Fronts of two objectives against grids, from the table of ``python -m benchmarks.fronts``."""
    kept = yaml.safe_load((DOCS / "fronts.yaml").read_text(encoding="utf-8"))
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


def table(heads: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Return a Markdown table."""
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    return "\n".join(lines + ["| " + " | ".join(map(str, row)) + " |" for row in rows]) + "\n"


def case(name: str, changes: Mapping[str, Any] | None = None) -> Any:
    """Return a shipped scenario with changes."""
    return beamsim.load_scenario(CONFIGS[name], {**(changes or {})})


def frequencies() -> Section:
    """Tables 1.2 and 1.3 of the thesis."""
    modes = build_system(case("one_sided_65hz")).modes
    opened, closed = modes["open_frequencies_hz"].values, modes["closed_frequencies_hz"].values
    given = (
        (PRINTED, "without spring (table 1.2)", [52.7, 328.5, 931.3], opened),
        ("measured", "without spring", [51.9, 329.4, 934.4], opened),
        (PRINTED, "spring always in contact (table 1.3)", [196.0, 447.1, 966.0], closed),
        ("measured", "spring always in contact", [196.5, 448.0, 969.5], closed),
    )
    rows = [
        Row(source, f"{what}, mode {mode}, Hz", value, float(computed[mode - 1]))
        for source, what, values, computed in given
        for mode, value in enumerate(values, 1)
    ]
    heavy = {"beam.point_masses": [{"position": x, "mass": 0.045} for x in (0.135, 0.2025, 0.27)]}
    as_printed = build_system(case("one_sided_65hz", heavy)).modes["open_frequencies_hz"].values
    stiff = build_system(case("one_sided_65hz", {"snubbers[0].stiffness": 559.625e3}))
    stiff_frequencies = stiff.modes["closed_frequencies_hz"].values
    mass = "Misprint: accelerometers of 45 g do not fit table 1.2; 4.2 g, which the other rows use, reproduce it."
    spring = (
        "Misprint: 559.625 kN/m does not fit table 1.3. 559.625 × 0.27 = 151.1 kN/m, which the other rows use, "
        "reproduces it; a factor of the length is probably missing."
    )
    rows.append(Row(PRINTED, "with accelerometers of 45 g as printed, mode 1, Hz", 52.7, float(as_printed[0]), mass))
    rows += [
        Row(PRINTED, f"with a spring of 559.625 kN/m as printed, mode {mode}, Hz", value, float(computed), spring)
        for mode, (value, computed) in enumerate(zip((196.0, 447.1, 966.0), stiff_frequencies, strict=False), 1)
    ]
    return Section("Natural frequencies of the test rig", THESIS, rows)


def stiffness() -> Section:
    """Section 1.3.3 of the thesis."""
    why = (
        "Measurement: 196.5 Hz is 0.26 % above the predicted 196.0 Hz, and the stiffness changes by six times as "
        "much as the frequency."
    )
    rows = []
    for measured in (196.0, 196.5):
        result = beamsim.identify_stiffness(case("identify_snubber", {"identify_stiffness.measured_with": [measured]}))
        value = result.summary["stiffness_n_per_m"] / 1e3
        rows.append(Row(PRINTED, f"from {measured:g} Hz in contact, kN/m", 151.1, value, why))
    note = "The printed stiffness is 559.625 kN/m × 0.27, see the comment on table 1.3."
    return Section("Stiffness of the snubber from its frequency", THESIS, rows, note)


def linear_or_not() -> Section:
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
        linear = beamsim.run(case(name, QUICK)).summary["linear"]
        rows.append(Row(PRINTED, f"`{name}`", expected, "linear" if linear else "nonlinear"))
    note = (
        "The amount of prestress is not printed: 0.2 mm was chosen, between the 0.086 and 0.43 mm that the printed "
        "cases imply. The printed backlash of 5 mm never closes; 0.5 mm does in all three cases."
    )
    return Section("Linear or nonlinear", THESIS, rows, note)


# largest tip displacement, m, and acceleration, g, from 0.7 to 0.8 s: ends of the printed axes, or what the text says
AMPLITUDES = {45: (1.5e-4, 10.0), 65: (4.0e-4, 20.0), 78: (1.4e-3, 60.0), 160: (3.0e-4, 10.0)}


def amplitudes() -> Section:
    """The forced amplitudes of chapter 1."""
    why = (
        "Not documented: damping model, frame of the displacements, dashpot and level; and the printed numbers are "
        "ends of axes, which only bound the curves. See what the thesis leaves open."
    )
    rows = []
    for frequency, (displacement, acceleration) in AMPLITUDES.items():
        histories = beamsim.run(case(f"one_sided_{frequency}hz", QUICK))["histories"]
        last = histories["time"].values >= 0.7
        moved = 1e3 * float(histories["displacement"].sel(probe="tip").values[last].max())
        felt = float(np.abs(histories["absolute_acceleration"].sel(probe="tip").values[last]).max()) / 9.80665
        rows.append(Row(PRINTED, f"displacement at {frequency} Hz, mm", 1e3 * displacement, moved, why))
        rows.append(Row(PRINTED, f"acceleration at {frequency} Hz, g", acceleration, felt, why))
    note = "Computed with 1 % modal damping and a dashpot of 2 % in the snubber."
    return Section("Forced amplitudes at 2 g and zero gap", THESIS, rows, note)


def open_choices() -> str:
    """What the thesis leaves open, and with which of its amplitudes each choice agrees."""
    kept = yaml.safe_load(RECORDED.read_text(encoding="utf-8"))
    rows, most = [], 0
    for what, ratios in kept["thesis_choices"].items():
        fits = [[0.9 <= ratio <= 1.1 for ratio in pair] for pair in ratios]
        cells = [
            " / ".join(f"**{ratio:.2f}**" if ok else f"{ratio:.2f}" for ratio, ok in zip(pair, good, strict=True))
            for pair, good in zip(ratios, fits, strict=True)
        ]
        met = sum(map(sum, fits))
        rows.append((what, *cells, f"{met} of 8"))
        most = max(most, met)
    heads = ["choice", *(f"{frequency} Hz" for frequency in AMPLITUDES), "within 10 %"]
    return (
        "### What the thesis leaves open\n\nEach line changes one choice of the configs; damping in contact is that of "
        "the first mode with the spring always in contact. The cells are computed over printed amplitudes, for "
        f"displacement / acceleration; those within 10 % are bold: at most {most} of the eight with any one choice. "
        f"Computed on {kept['date']} at commit {kept['commit']}.\n\n{table(heads, rows)}"
    )


def nonlinear_modes() -> Section:
    """Resonances and nonlinear modes of chapters 1, 3 and 4."""
    kept = yaml.safe_load(RECORDED.read_text(encoding="utf-8"))["values"]
    spring = (
        "Misprint: 57.62 Hz does not belong to 107 kN/m. The bare beam alone has 56.0 Hz; 57.62 Hz belongs to 689 N/m."
    )
    factor = (
        "Not documented: stiffness and energy of the printed motion. A spring cannot lower a frequency of the free "
        "beam (351 Hz in mode 2), so that 340 Hz is no nonlinear mode of this beam."
    )
    rows = [
        Row(PRINTED, f"{name} resonance in the sweep at 2 g, Hz", printed, kept["resonances"][f"{name} resonance, Hz"])
        for name, printed in (("first", 82.0), ("second", 352.0))
    ]
    for name, what, printed, why in (
        ("nnm_chain_mass_5", "six masses, spring of 0.5 on mass 5, mode 4, period, s", 4.011, ""),
        ("nnm_chain_mass_1", "six masses, spring of 0.5 on mass 1, mode 4, period, s", 3.97, ""),
        ("nnm_thesis_mode_1", "cantilever, 107 kN/m, mode 1, factor 1, Hz", 57.62, spring),
        ("nnm_thesis_mode_2", "cantilever, 107 kN/m, mode 2, factor 0.1, Hz", 354.91, ""),
    ):
        last = float(beamsim.nnm(case(name)).branches[0]["frequency_hz"].values[-1])
        rows.append(Row(PRINTED, what, printed, 1.0 / last if "period" in what else last, why))
    rows += [
        Row(PRINTED, f"cantilever, mode {mode}, factor 5, Hz", printed, kept["backbones"][f"mode {mode}, factor 5, Hz"],
            factor)
        for mode, printed in ((1, 77.58), (2, 340.0))
    ]  # fmt: skip
    note = (
        "The mode that the thesis calls the second with the spring on mass 1 is the fourth; the second linear period "
        "is 7.24 s. The resonances and the modes of factor 5 are recorded values."
    )
    return Section("Resonances and nonlinear normal modes", THESIS, rows, note)


def weak_springs() -> Section:
    """One mass with a one-sided spring of factor e, against its closed form."""
    rows = []
    for factor in (0.02, 0.1, 0.5, 2.0):
        stop = {"mass": 1, "side": "below", "stiffness": 1.0, "gap": 0.0}
        chain = {"masses": [1.0], "springs": [1.0], "snubbers": [stop]}
        section = {"mode": 1, "continue_in": {"kind": "stiffness_factor", "to": factor}}
        backbone = beamsim.nnm(beamsim.load_scenario({"chain": chain, "nnm": section})).branches[0]
        computed = 2 * np.pi * float(backbone["frequency_hz"].values[-1])
        exact = 2 * np.sqrt(1 + factor) / (1 + np.sqrt(1 + factor))
        rows.append(Row("closed form", f"frequency at ε = {factor:g}", float(exact), computed))
    note = "u'' + u + ε u₊ = 0 has the frequency ω = 2√(1+ε) / (1 + √(1+ε)) = 1 + ε/4 − ε²/8 + …"
    return Section("One mass with a one-sided spring", THESIS, rows, note)


def attack() -> str:
    """Random systems against an independent integration: the table that ``python -m tests.attack`` adds to."""
    kept = yaml.safe_load((DOCS / "attack.yaml").read_text(encoding="utf-8"))
    rows = []
    for one in kept:
        last = one["first_seed"] + one["systems"] - 1
        outcomes = dict(one["outcomes"])
        agree, differ = outcomes.pop("agrees", 0), outcomes.pop("differs", 0)
        rows.append((
            one["date"], one["commit"], f"{one['first_seed']:,} to {last:,}", f"{one['systems']:,}",
            f"{one['contact_events']:,}", agree, differ, sum(outcomes.values()), f"{one['median_deviation']:.1g}",
            f"{one['largest_deviation']:.1g}", f"{100 * one['largest_part_of_the_allowed']:.2g} %",
        ))  # fmt: skip
    heads = ["date", "commit", "seeds", "systems", "contact events", "agree", "differ", "not comparable by contacts",
             "median deviation", "largest deviation", "largest share of what is allowed"]  # fmt: skip
    differing = [
        f"- {seed}: {what}. {one.get('comments', {}).get(seed, 'Not explained.')}"
        for one in kept
        for seed, what in one["differing"].items()
    ]
    total = [sum(one[name] for one in kept) for name in ("systems", "contact_events")]
    return (
        f"## Random systems\n\n{total[0]:,} random systems with {total[1]:,} contact events, each computed by "
        "beamsim and by an independent integration ([the attack](../attack.md), which lists earlier runs of more than "
        "48,000 systems). Deviations are those of a displacement, over its largest value. A motion may deviate by five "
        "times what a change of all numbers by 1e-10 changes, plus 1e-9; the last column is how much of this "
        "the worst agreeing system takes. Systems are not comparable if such a change alters their contacts.\n\n"
        f"{table(heads, rows)}\n" + ("Systems that differ:\n\n" + "\n".join(differing) + "\n" if differing else "")
    )
