"""Base class of the results of all analyses."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from dataclasses import field, replace
from datetime import UTC, datetime
from functools import cache
from html import escape
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, ClassVar, Self

from beamsim.fields import (
    JSON,
    ByName,
    Entry,
    Flag,
    Number,
    Text,
    attribute,
    by_name,
    declared,
    ending,
    record,
    stored,
    summary_of,
)
from beamsim.kinds import named
from beamsim.labelled import Dataset, Layout
from beamsim.outcomes import Outcome, interruption
from beamsim.results.values import OUTPUT, judged, limit_unit
from beamsim.scenario import Scenario
from beamsim.scenario.quantities import amplitude_unit, level_unit
from beamsim.scenario.scenario import Record
from beamsim.version import __version__

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.figure import Figure


# entries that the summaries of several analyses share
STATUS = Entry("status", "", "complete, or why the computation stopped early", of="status")
MARGIN = record(
    {"limit": Number, "value": Number, "margin": Number, "at": Text, "verdict": Text},
    {"lowest": Number, "highest": Number, "margin_db": Number, "exceeded": Flag},
)
CONTACT_CHANGE = record(
    {"closed_at_rest": Flag},
    {"not_predicted": Text, "first_change_hz": ByName, **dict.fromkeys(
        ("level", "share_of_level", "sigmas", "frequency_hz", "time_s", "first_change_s", "largest_gap_m",
         "largest_gap_rad", "preload_n", "preload_alone_n", "preload_n_m", "preload_alone_n_m"), Number)},
)  # fmt: skip
FINER_MODEL = record(
    {"reason": Text},
    dict.fromkeys(("modes", "first_modes", "compared_s", "sequences_part_s", "disturbance_parts_s",
                   "round_off_parts_s"), Number),
)  # fmt: skip
MARGINS = Entry(
    "margins", "", "by limit: limit, value, lowest and highest (the value less and plus its change with a finer "
    "model), margin = limit / value - 1, at, verdict (ok or exceeded if both are, else not reliable), exceeded",
    form=by_name(MARGIN)
)  # fmt: skip
GAPPING = Entry(
    "gapping", "", "by snubber: whether it is closed at rest, level (SI) and frequency (of a shock or a record: time) "
    "at which the linear motion first opens or closes it, that level over the one here (of a random input instead: "
    "standard deviations of the linear motion), nan where another contact changes first, which not_predicted says; "
    "contact force at equilibrium that keeps contact (of a random input to 3 sigma) "
    "with all snubbers closed and alone; what the motion did", form=by_name(CONTACT_CHANGE)
)  # fmt: skip
MODES = (
    Entry("open_frequencies_hz", section="modes", of="modes.open_frequencies_hz", shown="kept_modes"),
    Entry("closed_frequencies_hz", section="modes", of="modes.closed_frequencies_hz", shown="kept_modes"),
    Entry("resting_frequencies_hz", section="modes", of="modes.resting_frequencies_hz", shown="kept_modes"),
    Entry("damping_ratios", section="modes", of="modes.damping_ratios", shown="kept_modes"),
    Entry("closed_damping_ratios", section="modes", of="modes.closed_damping_ratios", shown="kept_modes"),
    Entry("resting_damping_ratios", section="modes", of="modes.resting_damping_ratios", shown="kept_modes"),
    Entry("dashpots", of="modes.dashpots"),
    Entry("kept_modes", section="modes", of="modes.kept_modes"),
    Entry("static_vectors", section="modes", of="modes.static_vectors"),
    Entry("reduction_bound", section="modes", of="modes.reduction_bound"),
    Entry("probe_bound", section="modes", of="modes.probe_bound"),
    Entry("highest_frequency_hz", section="modes", of="modes.highest_frequency_hz"),
)
CONVERGENCE = (
    Entry("convergence", "1", "by value, and by its place where there are several, its relative change with 1.5 times "
             "the modes and twice the elements", form=dict[str, Number | ByName]),
    Entry("doubtful", "", "values that change by more than 2 %: value.place", form=list[str]),
    Entry("after_parting", "", "values that depend on the motion after its contact sequences diverge, which is one of "
             "many: value.place; their changes are those of means where the excitation goes on", form=list[str]),
    Entry("convergence_model", "", "the finer model: modes (0 where nothing is left out); times at which the contact "
             "sequences diverge from its own, and from those of a stiffness changed by 1e-9 and by 1e-15 (round-off); "
             "processor time, and why there is no comparison", "convergence", form=FINER_MODEL),
)  # fmt: skip
PROCESSOR_TIME = Entry("processor_time_s", "s", "processor time of the solver alone", "solver")
"""Last in the table; its row says what the solver did."""


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


@cache
def _versions() -> dict[str, str]:
    """Versions of Python and of the packages that the numbers depend on."""
    return {"python": platform.python_version()} | {name: version(name) for name in ("numpy", "scipy", "numba")}


@declared(kw_only=True, repr=False)  # that of a dataclass holds all arrays
class Result:
    """Base of the results of all commands: scenario, outcome, summary, warnings and provenance."""

    KIND: ClassVar[str]  # one of `beamsim.kinds.KINDS`
    DATASET: ClassVar[str] = "result"  # of the file, with the arrays of the result itself
    DATASETS: ClassVar[tuple[Layout, ...]] = ()  # the labelled ones
    SUMMARY: ClassVar[tuple[Entry, ...]] = ()  # possible entries of the summary, in the order of the printed table

    scenario: Scenario  # as it was written
    outcome: Outcome = ending("how the computation ended: complete, or why it stopped early and what to try")
    summary: dict[str, Any] = field(default_factory=dict)  # plain Python values
    datasets: dict[str, Dataset] = field(default_factory=dict)  # by name, those of `DATASETS`
    warnings: tuple[str, ...] = attribute("", "warnings, JSON list", codec=JSON, default=())
    wall_time_s: float = attribute("s", "wall time", default=0.0)
    beamsim_version: str = attribute("", "version of beamsim that computed the result", default=__version__)
    created: str = attribute("", "when the result was made, ISO 8601, UTC", default_factory=_now)
    provenance: dict[str, str] = attribute(
        "", "versions of Python and of the packages that the numbers depend on, JSON object", codec=JSON,
        default_factory=_versions,
    )  # fmt: skip

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
        return str(named("beamsim.cli.tables:text_table")(self.KIND, self))

    def with_summary(self, **computed: Any) -> Self:
        """The result with its summary: the values given, and those that repeat fields of the result.

        Raises
        ------
        KeyError
            If the summary does not declare a value.
        """
        return replace(self, summary=summary_of(self, **computed)).ended(self.outcome)

    def ended(self, outcome: Outcome) -> Self:
        """The result with another outcome, which its summary repeats as the status, and the verdicts on limits."""
        said = {"status": outcome.text, "margins": judged(self.summary.get("margins", {}), outcome)}
        summary = self.summary | {name: value for name, value in said.items() if name in self.summary}
        return replace(self, outcome=outcome, summary=summary)

    def interrupted(self, during: str) -> Self:
        """The result, marked as incomplete because something was given up on request."""
        return self.ended(interruption(f"during {during}", *self.outcome.unless_complete))

    @property
    def status(self) -> str:
        """How the computation ended, as text: "complete", or why it stopped early and what to try."""
        return self.outcome.text

    @property
    def complete(self) -> bool:
        """Whether everything requested was computed and is reliable."""
        return self.outcome.complete

    @property
    @stored(attribute("", "title of the scenario"))
    def title(self) -> str:
        """The scenario's title."""
        return self.scenario.title

    @property
    @stored(
        attribute(
            "", "JSON object: by key of the scenario the file that it names, the folder that this is relative to, size "
            "and SHA-256 of the content; none where no file is named", codec=JSON,
        )
    )  # fmt: skip
    def input_files(self) -> dict[str, Record] | None:
        """What the files of the scenario held; None where it names none."""
        return dict(self.scenario.file_records(as_read=True)) or None

    def unit_of(self, entry: Entry, place: tuple[str, ...], keys: tuple[str, ...], record: Mapping[str, Any]) -> str:
        """Unit of a value of the summary; empty where the name of the value ends with it.

        Parameters
        ----------
        entry : of the summary.
        place : names of the probe, limit, curve ... whose value it is; none where there is one value.
        keys : of a value of a record, that of the record in which it is nested before its own.
        record : with the value, where it is part of one.
        """
        if entry.name == "margins" and keys[0] in ("limit", "value", "lowest", "highest"):
            return limit_unit(self.scenario, place[0])
        if entry.section == OUTPUT.section and place:
            return str(self.summary["output_unit"][place[-1]])
        if entry.name == "gapping" and keys == ("level",):
            quantity = getattr(self.scenario.excitation, "quantity", None) or "acceleration"
            return amplitude_unit(quantity) if "frequency_hz" in record else level_unit(quantity)
        return "" if keys else entry.unit

    def plot(self) -> dict[str, Figure]:
        """Return the figures that the command saves, by name; a notebook shows each."""
        return named("beamsim.plots.notebook:figures_of")(self)  # type: ignore[no-any-return]

    def to_pandas(self) -> dict[str, pandas.DataFrame]:
        """Return the tables of the CSV export, by name.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        return named("beamsim.store.export:data_frames")(self)  # type: ignore[no-any-return]

    def to_xarray(self) -> xarray.DataTree:
        """Return the groups of the result file as a tree of datasets with their axes, units and meanings.

        Raises
        ------
        ImportError
            If xarray or h5netcdf is not installed.
        """
        return named("beamsim.store.export:data_tree")(self)  # type: ignore[no-any-return]

    def _repr_html_(self) -> str:
        """Return the printed table as HTML, for notebooks."""
        return f"<pre>{escape(str(self))}</pre>"
