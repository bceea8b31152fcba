"""Base class of the results of all analyses, and what may be wrong with any result.

That is a reduced model that is not accurate, deflections that are too large for the theory, stops that are pressed
further than their tables of force and deflection go, and random inputs whose sines are too far apart.
"""

from __future__ import annotations

import math
import os
import platform
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from beamsim.contacts.pads import ForceCurve
from beamsim.inputs.statements import InputStatement
from beamsim.labelled import Dataset, Layout
from beamsim.outcomes import Outcome, OutcomeKind, interruption
from beamsim.results.values import OUTPUT, limit_unit, with_verdicts
from beamsim.scenario import Scenario
from beamsim.scenario.base import path_text
from beamsim.scenario.quantities import amplitude_unit, level_unit
from beamsim.scenario.scenario import Record
from beamsim.summaries import (
    ByName,
    Entry,
    Flag,
    Number,
    Text,
    by_name,
    record,
    summary_of,
)
from beamsim.system.force_tables import curves_of
from beamsim.typing import Floats
from beamsim.version import __version__

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.figure import Figure


# entries that the summaries of several analyses share
STATUS = Entry("status", "", "complete, or why the computation stopped early", form=Text)
MARGIN = record(
    {"limit": Number, "value": Number, "margin": Number, "at": Text, "verdict": Text},
    {
        "exceeded": Flag,
        "statistic": Text,
        **dict.fromkeys(
            ("lowest", "highest", "margin_db", "interval_low", "interval_high", "decided_after_s", "reached"), Number
        ),
    },
)
CONTACT_CHANGE = record(
    {"closed_at_rest": Flag},
    {"not_predicted": Text, "first_change_hz": ByName, **dict.fromkeys(
        ("level", "share_of_level", "sigmas", "frequency_hz", "time_s", "first_change_s", "largest_gap_m",
         "largest_gap_rad", "preload_n", "preload_alone_n", "preload_n_m", "preload_alone_n_m"), Number)},
)  # fmt: skip
FINER_MODEL = record(
    {"reason": Text},
    dict.fromkeys(("modes", "first_modes", "compared_s", "contact_divergence_s", "disturbance_divergence_s",
                   "round_off_divergence_s"), Number),
)  # fmt: skip
MARGINS = Entry(
    "margins", "", "by limit: limit, value, lowest and highest (the value less and plus its error, from a "
    "finer model), margin = limit / value - 1, at, verdict (ok or exceeded if both are, else not reliable), exceeded; "
    "of a random motion which statistic the value is, the 95 % interval of the largest in the test, and where that "
    "spans the limit (undecided) how long a run is about to decide, nan if none does",
    form=by_name(MARGIN)
)  # fmt: skip
GAPPING = Entry(
    "gapping", "", "by snubber: whether it is closed at rest, level (SI) and frequency (of a shock or a record: time) "
    "at which the linear motion first opens or closes it (of a sweep the lowest at any frequency), that level over the "
    "one here (of a random input instead: standard deviations of the linear motion), "
    "nan where another contact changes first, which not_predicted says; "
    "contact force at equilibrium that keeps contact (of a random input to 3 sigma) "
    "with all snubbers closed and alone; what the motion did", form=by_name(CONTACT_CHANGE)
)  # fmt: skip
CLOSEST_TO_TEST = Entry(
    "closest_to_test", "", "by snubber, where the level differs between frequencies: the level (SI) and frequency at "
    "which the linear motion first opens or closes it if the test is raised as a whole, and that level over the one of "
    "the test there; nan where another contact changes first, which not_predicted says", form=by_name(CONTACT_CHANGE)
)  # fmt: skip
OF_MODES = (
    Entry("open_frequencies_hz", section="modes", variable="modes/open_frequencies_hz", shown="kept_modes"),
    Entry("closed_frequencies_hz", section="modes", variable="modes/closed_frequencies_hz", shown="kept_modes"),
    Entry("resting_frequencies_hz", section="modes", variable="modes/resting_frequencies_hz", shown="kept_modes"),
    Entry("damping_ratios", section="modes", variable="modes/damping_ratios", shown="kept_modes"),
    Entry("closed_damping_ratios", section="modes", variable="modes/closed_damping_ratios", shown="kept_modes"),
    Entry("resting_damping_ratios", section="modes", variable="modes/resting_damping_ratios", shown="kept_modes"),
    Entry(
        "dashpots",
        "",
        "by snubber its dashpot, and what that follows from",
        form=by_name(record({"from": Text}, dict.fromkeys(("dashpot_n_s_per_m", "dashpot_n_m_s_per_rad"), Number))),
    ),
    Entry("kept_modes", section="modes", variable="modes/kept_modes"),
    Entry("static_vectors", section="modes", variable="modes/static_vectors"),
    Entry("reduction_bound", section="modes", variable="modes/reduction_bound"),
    Entry("probe_bound", section="modes", variable="modes/probe_bound"),
    Entry("highest_frequency_hz", section="modes", variable="modes/highest_frequency_hz"),
)
CONVERGENCE = (
    Entry("convergence", "1", "by value, and by its place where there are several, its relative error: 9/8 of its "
             "change (4/3 of it with plates, 1.55 of reactions at edges) with three times the modes and twice the "
             "elements",
             form=dict[str, Number | ByName]),
    Entry("doubtful", "", "values with an error of more than 2 %: value.place", form=list[str]),
    Entry("after_divergence", "", "values that depend on the motion after its contact sequences diverge, which is one "
             "of many: value.place; if the excitation goes on, their errors are those of means", form=list[str]),
    Entry("without_limit", "", "values that have no limit as the number of modes grows, since a force jumps at a point "
             "with little mass: value.place", form=list[str]),
    Entry("convergence_model", "", "the finer model: modes (0 where nothing is left out); times at which the contact "
             "sequences diverge from its own, and from those of a stiffness changed by 1e-9 and by 1e-15 (round-off); "
             "processor time, and why there is no comparison", "convergence", form=FINER_MODEL),
)  # fmt: skip
ALLOWED_ERROR = 0.02  # relative error of a value, from a finer model, that is not doubtful
PROCESSOR_TIME = Entry("processor_time_s", "s", "processor time of the solver alone", "solver")
"""Last in the table; its row says what the solver did."""

WORTHLESS_REDUCTION = 0.1
"""Bound of the receptance's error over the static compliance above which a result is not to be trusted."""
LINES_OF_BANDWIDTH = 0.25  # largest distance of the sines of a random input, over the half-power bandwidth of a mode
LARGEST_MARGIN = 100.0  # a limit over the value that it limits, above which one of them is probably another one
_REST = "; the last slope continues beyond it, which may be too soft: measure further, or add points"


@cache
def _versions() -> dict[str, str]:
    """Versions of Python and of the packages that the numbers depend on."""
    return {"python": platform.python_version()} | {name: version(name) for name in ("numpy", "scipy", "numba")}


# Of processes that had ended before: a shell that becomes the last command of a line has waited for the others.
_EARLIER_PROCESSES_S = sum(os.times()[2:4])


def used_processor_time() -> float:
    """s, that this process and those that it started here and that have ended have used up to now, for whatever."""
    return sum(os.times()[:4]) - _EARLIER_PROCESSES_S


def demand_result(value: object) -> None:
    """Refuse what is no result where one is needed.

    Raises
    ------
    TypeError
        With how the result of a file is read.
    """
    if not isinstance(value, Result):
        raise TypeError(f"a result is needed, not a {type(value).__name__}; beamsim.load reads that of a file")


@dataclass(frozen=True, kw_only=True, repr=False)  # that of a dataclass holds all arrays
class Result:
    """Base of the results of all analyses: scenario, outcome, summary, datasets, warnings and provenance.

    Results are frozen. Printing one shows the table that ``-v`` prints; a notebook shows it, too.

    Examples
    --------
    >>> import beamsim
    >>> result = beamsim.run("configs/stops/chain_bumpers.yaml")
    >>> result
    <RunResult 'Three masses with a bumper and a cable, base excitation': complete>
    >>> result.complete, result.warnings[1]
    (True, 'chain.snubbers.bumper: its dashpot pulls with up to 3.56 N before the contact opens; with law: no_tension it
    opens before that')
    >>> {name: round(force, 2) for name, force in result.summary["peak_force_n"].items()}
    {'bumper': 37.91, 'cable': 36.14}
    >>> list(result.datasets)
    ['histories', 'spectra', 'events', 'modes']
    >>> result["histories"]["displacement"].sel(probe="third").values.shape
    (6001,)
    >>> print(str(result).splitlines()[0])
    Three masses with a bumper and a cable, base excitation
    >>> list(result.plot())
    ['displacement', 'acceleration', 'contact_force', 'force_deflection', 'spectrum', 'phase_portrait']
    >>> result.to_pandas()["events_by_event"]["time (s)"].size
    118
    >>> result.to_xarray()["histories/displacement"].sel(probe="third").attrs["units"]
    'm'
    """

    KIND: ClassVar[str]  # one of `beamsim.kinds.KINDS`
    DATASET: ClassVar[str] = "result"  # of the file, with the arrays of the result itself
    DATASETS: ClassVar[tuple[Layout, ...]] = ()  # the labelled ones
    SUMMARY: ClassVar[tuple[Entry, ...]] = ()  # possible entries of the summary, in the order of the printed table

    scenario: Scenario  #: as it was written
    outcome: Outcome  #: how the computation ended
    summary: dict[str, Any] = field(default_factory=dict)  #: values of the printed table, of ``--json`` and of files
    datasets: dict[str, Dataset] = field(default_factory=dict)  #: by name; ``result["histories"]`` is one of them
    warnings: tuple[str, ...] = ()  #: one sentence each
    wall_time_s: float = 0.0  #: duration of the analysis, s
    command_processor_time_s: float | None = None  #: of a command with its workers, s
    beamsim_version: str = __version__  #: version that computed the result
    created: str = field(default_factory=lambda: datetime.now(UTC).isoformat(timespec="seconds"))  #: time, ISO 8601
    provenance: dict[str, str] = field(default_factory=_versions)  #: versions of Python and of numerical packages

    def __getitem__(self, name: str) -> Dataset:
        """One of the labelled datasets, ``result["histories"]``.

        Raises
        ------
        KeyError
            If the result does not have it.
        """
        if name not in self.datasets:
            raise KeyError(f"no dataset {name!r}; there are {', '.join(self.datasets) or 'none'}")
        return self.datasets[name]

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.title!r}: {self.status}>"

    def __str__(self) -> str:
        """The printed table."""
        return str(resolve_name("beamsim.cli.tables:text_table")(self.KIND, self))

    def with_summary(self, **values: Any) -> Self:
        """The result with its summary: the values given, the status, and those that repeat variables.

        Raises
        ------
        KeyError
            If the summary does not declare a value.
        """
        status = {"status": self.status} if STATUS in self.SUMMARY else {}
        result = replace(self, summary=summary_of(self, **status | values)).with_outcome(self.outcome)
        if not result.summary.get("margins"):
            return result
        return replace(result, warnings=tuple(dict.fromkeys((*self.warnings, *_far_limits(result)))))

    def with_outcome(self, outcome: Outcome) -> Self:
        """The result with another outcome, which its summary repeats as the status, and the verdicts on limits."""
        repeated = {"status": outcome.text, "margins": with_verdicts(self.summary.get("margins", {}), outcome)}
        summary = self.summary | {name: value for name, value in repeated.items() if name in self.summary}
        return replace(self, outcome=outcome, summary=summary)

    def interrupted(self, activity: str) -> Self:
        """The result, marked as incomplete because something was given up on request."""
        return self.with_outcome(interruption(f"during {activity}", *self.outcome.unless_complete))

    @property
    def status(self) -> str:
        """How the computation ended, as text: "complete", or why it stopped early and what to try."""
        return self.outcome.text

    @property
    def complete(self) -> bool:
        """Whether everything requested was computed and is reliable."""
        return self.outcome.complete

    @property
    def title(self) -> str:
        """The scenario's title."""
        return self.scenario.title

    @property
    def input_files(self) -> dict[str, Record] | None:
        """Name, size and hash of every file that the scenario names, by place; None if it names none."""
        return dict(self.scenario.file_records(unchanged_only=True)) or None

    def unit_of(self, entry: Entry, place: tuple[str, ...], keys: tuple[str, ...], record: Mapping[str, Any]) -> str:
        """Unit of a value of the summary; empty where the name of the value ends with it.

        Parameters
        ----------
        entry : of the summary.
        place : names of the probe, limit, curve ... whose value it is; none where there is one value.
        keys : of a value of a record, that of the record in which it is nested before its own.
        record : with the value, where it is part of one.
        """
        if entry.name == "margins" and keys[0] in (
            "limit",
            "value",
            "lowest",
            "highest",
            "interval_low",
            "interval_high",
            "reached",
        ):
            return limit_unit(self.scenario, place[0])
        if entry.section == OUTPUT.section and place:
            return str(self.summary["output_unit"][place[-1]])
        if entry.name in ("gapping", "closest_to_test") and keys == ("level",):
            quantity = getattr(self.scenario.excitation, "quantity", None) or "acceleration"
            return amplitude_unit(quantity) if "frequency_hz" in record else level_unit(quantity)
        return "" if keys else entry.unit

    def plot(self) -> dict[str, Figure]:
        """Return the figures that the command saves, by name: figures of matplotlib, which a notebook shows."""
        return resolve_name("beamsim.plots.notebook:figures_of")(self)  # type: ignore[no-any-return]

    def to_pandas(self) -> dict[str, pandas.DataFrame]:
        """Return the tables of the CSV export, by name.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        return resolve_name("beamsim.store.export:data_frames")(self)  # type: ignore[no-any-return]

    def to_xarray(self) -> xarray.DataTree:
        """Return the groups of the result file as a tree of datasets with their axes, units and meanings.

        Raises
        ------
        ImportError
            If xarray or h5netcdf is not installed.
        """
        return resolve_name("beamsim.store.export:data_tree")(self)  # type: ignore[no-any-return]

    def _repr_html_(self) -> str:
        """Return the printed table as HTML, for notebooks: the first screen, and all values to unfold."""
        return str(resolve_name("beamsim.cli.tables:html_table")(self.KIND, self))


def _far_limits(result: Result) -> Iterator[str]:
    """A question for each limit so far above what it limits that one of the two may be in another unit."""
    for name, of in result.summary["margins"].items():
        value, limit = of["value"], of["limit"]
        if 0.0 < LARGEST_MARGIN * value < limit and (unit := limit_unit(result.scenario, name)) != "1":
            yield (
                f"limits.{name} = {limit:.4g} {unit} is {limit / value:.3g} times the largest value, {value:.3g} "
                f"{unit}; was another unit meant?"
            )


def dashpots_of(modes: Dataset) -> dict[str, dict[str, Any]]:
    """By snubber its dashpot and what that follows from, for the summary."""
    entry = {"N s/m": "dashpot_n_s_per_m", "N m s/rad": "dashpot_n_m_s_per_rad"}
    sources = modes.by_label("dashpot_from")
    return {
        name: {entry[dashpot.unit]: dashpot.item(), "from": sources[name].item()}
        for name, dashpot in modes.by_label("dashpot").items()
    }


def check_reduction(outcome: Outcome, scenario: Scenario, modes: Dataset) -> Outcome:
    """The outcome, which is not to be trusted where the reduced receptance has no useful bound.

    Parameters
    ----------
    outcome : of the computation.
    scenario, modes : of its structure.

    Returns
    -------
    Outcome
    """
    worthless = modes["reduction_bound"].item() > WORTHLESS_REDUCTION
    return _untrusted_reduction(outcome, scenario, modes) if worthless else outcome


def _untrusted_reduction(outcome: Outcome, scenario: Scenario, modes: Dataset) -> Outcome:
    """The outcome of a reduced model whose receptance has no useful bound of its error."""
    bound = modes["reduction_bound"].item()
    return Outcome.of(
        OutcomeKind.UNTRUSTED, "reduction_not_accurate",
        "the error of the reduced model's receptance at contacts and loads up to "
        f"{modes['highest_frequency_hz'].item():.6g} Hz is bounded only by {bound:.2g} of its size, more than "
        f"{WORTHLESS_REDUCTION:g}",
        *outcome.unless_complete,
        remedy=scenario.more_modes(math.ceil(1.5 * modes["kept_modes"].item())), bound=bound,
    )  # fmt: skip


def deflection_warnings(scenario: Scenario, modes: Dataset, motions: Iterable[Mapping[str, Floats]]) -> list[str]:
    """A warning for each body whose deflection is not small; none where rigid-body modes carry it as far as they like.

    Parameters
    ----------
    scenario : of the motions.
    modes : of its structure.
    motions : m, largest displacements by probe, of each curve or branch.

    Returns
    -------
    One sentence a body.
    """
    if np.isnan(modes["damping_ratios"].values).any():
        return []
    body_of = {probe.name: probe.place.body for probe in scenario.probes}
    largest: dict[str, tuple[float, str]] = {}  # by body, with the probe
    for motion in motions:
        for probe, values in motion.items():
            body, peak = body_of.get(probe) or scenario.default_body, float(np.nanmax(values, initial=0.0))
            largest[body] = max(largest.get(body, (0.0, "")), (peak, probe))
    allowed = {name: body.largest_deflection for name, body in scenario.all_bodies.items()}
    beyond = {name: of for name, of in largest.items() if of[0] > allowed.get(name, math.inf)}
    return [_large_deflection(scenario, name, *of) for name, of in beyond.items()]


def _large_deflection(scenario: Scenario, name: str, peak: float, probe: str) -> str:
    """A warning of a body, of which the largest displacement (m) at a probe is not small."""
    where, allowed = path_text(scenario.body_path(name)), scenario.all_bodies[name].largest_deflection
    return (
        f"the largest displacement at {probe} = {peak:.3g} m is not small for {where} (more than {allowed:.3g} m), and "
        "the theory does not hold: a unit such as mm or g may be wrong"
    )


def line_warnings(inputs: Iterable[InputStatement], modes: Dataset) -> list[str]:
    """A warning for each random input whose sines are too far apart for the resonances in its band.

    Parameters
    ----------
    inputs : of the run.
    modes : of its structure; as it rests, where that is known, else with open contacts.

    Returns
    -------
    One sentence an input, about the mode with the smallest bandwidth.
    """
    at_rest = "resting_frequencies_hz" in modes
    frequency = modes["resting_frequencies_hz" if at_rest else "open_frequencies_hz"].values
    width = 2.0 * modes["resting_damping_ratios" if at_rest else "damping_ratios"].values * frequency
    warnings = []
    for each in inputs:
        within = np.flatnonzero((frequency >= each.from_hz) & (frequency <= each.to_hz) & (width > 0.0))
        if within.size == 0:
            continue
        k = within[np.argmin(width[within])]
        if each.line_spacing_hz > LINES_OF_BANDWIDTH * width[k]:
            warnings.append(
                f"{each.path}: the sines of the random input are {each.line_spacing_hz:.4g} Hz apart, which is "
                f"{each.line_spacing_hz / width[k]:.2g} of the half-power bandwidth of mode {k + 1}, {width[k]:.3g} Hz "
                f"at {frequency[k]:.4g} Hz (at most {LINES_OF_BANDWIDTH:g}): the response depends on where they lie; "
                f"give a run.duration or excitation.period of {1.0 / (LINES_OF_BANDWIDTH * width[k]):.3g} s"
            )
    return warnings


def warnings_along(scenario: Scenario, modes: Dataset, points: Dataset) -> list[str]:
    """Warnings about large deflections, forces and penetrations in the cycles of sweeps, or the points of branches.

    Parameters
    ----------
    scenario, modes : as of these.
    points : table with the peaks of probes and snubbers.
    """
    displacement, force = (
        {name: peak.values for name, peak in points.by_label(f"peak_{quantity}").items()}
        for quantity in ("displacement", "force")
    )
    depths = points.by_label("ring_penetration").items()
    of_rings = beyond_fitted_range(scenario, {name: float(np.nanmax(of.values, initial=0.0)) for name, of in depths})
    return [*deflection_warnings(scenario, modes, [displacement]), *forces_beyond_tables(scenario, [force]), *of_rings]


def beyond_fitted_range(scenario: Scenario, penetrations: Mapping[str, float]) -> list[str]:
    """A warning for each ring whose force is not fitted as far as the motion goes.

    Parameters
    ----------
    scenario : with the rings.
    penetrations : m, the largest of each ring by name.
    """
    return [
        f"snubbers.{ring.name}: the penetration reaches {1e3 * penetrations[ring.name]:.4g} mm, and the force is "
        f"accurate up to largest_penetration = {1e3 * ring.largest_penetration:.4g} mm; raise it to "
        f"{1.2e3 * penetrations[ring.name]:.2g} mm"
        for ring in scenario.rings
        if penetrations.get(ring.name, 0.0) > ring.largest_penetration
    ]


def forces_beyond_tables(scenario: Scenario, forces: Iterable[Mapping[str, Floats]]) -> list[str]:
    """A warning for each stop whose force exceeds the last one of its table.

    Parameters
    ----------
    forces : N, largest contact forces by snubber, of each curve, branch or study.
    """
    largest: dict[str, float] = {}
    for curve in forces:
        for name, values in curve.items():
            largest[name] = max(largest.get(name, 0.0), float(np.nanmax(values, initial=0.0)))
    return [
        f"{scenario.located_snubber(name).label}: its force reaches {largest[name]:.4g} "
        f"{scenario.located_snubber(name).item.units[1]}, its table ends at {_end(scenario, name, curve)}{_REST}"
        for name, curve in _tables(scenario).items()
        if largest.get(name, 0.0) > curve.force.max()
    ]


def compressed_beyond_tables(scenario: Scenario, compression: Mapping[str, float]) -> list[str]:
    """A warning for each stop that is compressed further than its table goes.

    Parameters
    ----------
    compression : m, the largest of each snubber.
    """
    return [
        f"{scenario.located_snubber(name).label}: it is compressed by up to {_way(scenario, name, compression[name])}, "
        f"its table ends at {_end(scenario, name, curve)}{_REST}"
        for name, curve in _tables(scenario).items()
        if compression[name] > curve.deflection[-1]
    ]


def _way(scenario: Scenario, name: str, penetration: float) -> str:
    return f"{1e3 * penetration:.4g} m{scenario.located_snubber(name).item.units[0]}"


def _end(scenario: Scenario, name: str, curve: ForceCurve) -> str:
    unit = scenario.located_snubber(name).item.units[1]
    return f"{_way(scenario, name, curve.deflection[-1])}, {curve.force[-1]:.4g} {unit}"


def _tables(scenario: Scenario) -> dict[str, ForceCurve]:
    if not scenario.has_force_tables:
        return {}
    named = zip(scenario.located_snubbers, curves_of(scenario), strict=True)
    return {snubber.name: curve for (_, _, snubber, _), curve in named if curve is not None}
