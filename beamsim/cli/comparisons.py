"""Commands ``compare`` and ``compare-modes``."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Literal

from pydantic import ValidationError

from beamsim.analyses.compare.analysis import ChannelChoice, compare, pair_channels
from beamsim.analyses.compare.before_after import compare_tests as compare_before_after
from beamsim.analyses.compare.result import Comparison
from beamsim.analyses.compare.sweeps import Tracking, compare_sweep
from beamsim.analyses.compare_modes.analysis import ModeComparison, compare_modes, read_shapes
from beamsim.cli.command import compute_and_save
from beamsim.cli.session import CommandOptions, load_case, result_stem
from beamsim.errors import InputFileError, Problem, ScenarioError, VerdictError
from beamsim.files import output_file
from beamsim.hdf5 import open_hdf5
from beamsim.measurements.channels import history_named
from beamsim.measurements.read import ENDINGS_OF_RECORDS, HDF5
from beamsim.outcomes import Verdict, exit_code
from beamsim.scenario import Scenario, load_scenario
from beamsim.scenario.base import path_text
from beamsim.scenario.files import DecimalMark, RecordPreparation
from beamsim.scenario.validation_errors import describe
from beamsim.store.results import kind_of, stored_result


def is_result(path: Path) -> bool:
    """Whether a file is meant as a result file: not a scenario, and not test data."""
    ending = path.suffix.lower()
    if ending not in HDF5:
        return ending not in (".yaml", ".yml", *ENDINGS_OF_RECORDS)
    try:
        with open_hdf5(path) as file:
            return "schema_version" in file.attrs
    except InputFileError:
        return True


def compare_signals(
    options: CommandOptions, measured: Path, pairing: Mapping[str, Any],
    preparation_options: Mapping[str, str | None], run_options: Mapping[str, Any], sweep_options: Mapping[str, Any],
    *, refused: Mapping[str, object],
) -> None:  # fmt: skip
    """Compare the result of a run or a sweep with measured signals.

    Parameters
    ----------
    options : shared options; the case is a result file.
    measured : file of the measurement.
    pairing : assignment of channels to signals of the result, as in `ChannelChoice`.
    preparation_options : options factor, remove and high_pass for measured histories.
    run_options, sweep_options : options for results of runs, and of sweeps.
    refused : options of two tests.

    Raises
    ------
    ScenarioError
        If an option does not apply to the kind of result; also as `compute_and_save`.
    """
    path = options.case
    _refuse(refused, "belongs to two tests, and this is a result", "leave it out")
    names = pairing["channel"] or [None]
    if len(names) > 1 or options.overrides:
        message = "= several cannot be compared" if len(names) > 1 else "changes a case, and this is a result"
        raise ScenarioError.at("--channel" if len(names) > 1 else "--set", message, "give one channel, without --set")
    pairing = {**pairing, "channel": names[0]}
    target = output_file(options.output, f"{path.stem}_compare", ".h5", ".hdf5")
    preparation = _preparation({name: value for name, value in preparation_options.items() if value is not None})
    swept = kind_of(path) == "sweep"
    with stored_result(path, "sweep" if swept else "run") as result:
        pairs = pair_channels(result, measured, ChannelChoice(preparation=preparation, **pairing))
        comparison: Callable[[], Comparison]
        if swept:
            name = sweep_options["reference"]
            excitation = (
                None if name is None else history_named(measured, name, pairing["axis_unit"], pairing["decimal"])
            )
            tracking = Tracking(sweep_options["begin"], excitation, sweep_options["cycles"])
            chosen = {key: sweep_options[key] for key in ("curve", "detector")}
            comparison = partial(compare_sweep, result, pairs, tracking=tracking, **chosen)
        else:
            of_sweeps = {name: value for name, value in sweep_options.items() if name != "cycles"}
            remedy = "leave it out, or give the result of a sweep"
            _refuse(of_sweeps, "belongs to sweeps, and this is a run", remedy)
            comparison = partial(compare, result, pairs, **run_options)
        compute_and_save("compare", target, options, lambda *_: comparison(), f"comparing with {measured.name}")


def compare_tests(
    options: CommandOptions, measured: Path | None, record_options: Mapping[str, Any], *, refused: Mapping[str, object]
) -> None:
    """Compare test data before and after another test.

    Parameters
    ----------
    options : shared options; the case is a scenario with ``before_after``, or the file before.
    measured : the file after; None for a scenario.
    record_options : options for two files, None where they are missing: channels, and keys of both records.
    refused : options of results.

    Raises
    ------
    ScenarioError
        If an option is invalid, or belongs to the scenario.
    VerdictError
        If a checked limit is exceeded, or may be.
    """
    _refuse(refused, "belongs to the comparison with a result, and two tests are compared", "leave it out")
    if measured is None:
        if options.case.suffix.lower() in ENDINGS_OF_RECORDS:
            message = f"{options.case} is test data, and there is nothing to compare it with"
            remedy = f"give the data after the test, too: beamsim compare {options.case} after.csv"
            raise ScenarioError.at("", message, remedy)
        _refuse(record_options, "belongs to two files", "write it in before_after, or give the file after, too")
        scenario, stem = load_case(options, "compare"), result_stem(options)
    else:
        scenario, stem = _scenario_of_files(options, measured, record_options), f"{options.case.stem}_{measured.stem}"
    target = output_file(options.output, f"{stem}_compare" if measured else stem, ".h5", ".hdf5")

    def compared(*_: object) -> Comparison:
        with scenario.locating():
            return compare_before_after(scenario)

    compute_and_save("compare", target, options, compared, "comparing test data")


SWEEPS = ("sweep", "sweep_after")  # options of two tests; the second is of the test after alone


def _sweep(option: str, text: str, begin: float | None) -> dict[str, Any]:
    """Section of a sweep from an option: first and last frequency and rate; and its beginning in the record, s."""
    parts = [part.strip() for part in text.split(",")]
    if len(parts) != 3:
        remedy = f"give first and last frequency and rate: {option} '20 Hz, 200 Hz, 2 oct/min'"
        raise ScenarioError.at(option, f"= {text} is no sweep", remedy)
    return {**dict(zip(("from", "to", "rate"), parts, strict=True)), "begin": begin}


def _scenario_of_files(options: CommandOptions, measured: Path, record_options: Mapping[str, Any]) -> Scenario:
    """Scenario of two files and options."""
    keys = {name: value for name, value in record_options.items() if value is not None}
    channels = keys.pop("channel", ())
    begin = keys.pop("begin", None)
    sweeps = {name: _sweep(f"--{name.replace('_', '-')}", keys.pop(name), begin) for name in SWEEPS if name in keys}
    if begin is not None and not sweeps:
        raise ScenarioError.at("--begin", "belongs to a sine sweep", "give --sweep, or leave it out")
    before, after = ({"file": str(path.absolute()), **keys} for path in (options.case, measured))
    if sweeps:
        before["sweep"], after["sweep"] = sweeps.get("sweep"), sweeps.get("sweep_after", sweeps.get("sweep"))
    pairs = [dict(zip(("before", "after"), name.split("=", 1), strict=False)) for name in channels]
    title = f"{options.case.name} and {measured.name}"
    section = {"before": before, "after": after, "channels": pairs}
    return load_scenario({"title": title, "before_after": section}, options.overrides or ()).with_source(title)


def _preparation(options: Mapping[str, str]) -> RecordPreparation:
    """Preparation of measured histories from the options.

    Raises
    ------
    ScenarioError
        If an option is invalid; the message names it.
    """
    try:
        return RecordPreparation.model_validate(options)
    except ValidationError as error:
        raise ScenarioError(
            [
                Problem(f"--{path_text(path).replace('_', '-')}", message, remedy)
                for path, message, remedy in (describe(RecordPreparation, each) for each in error.errors())
            ]
        ) from None


def _refuse(options: Mapping[str, object], message: str, remedy: str) -> None:
    """Refuse options that do not apply to what is compared.

    Raises
    ------
    ScenarioError
    """
    problems = [
        Problem(f"--{name.replace('_', '-')}", message, remedy) for name, value in options.items() if value is not None
    ]
    if problems:
        raise ScenarioError(problems)


def compare_shapes(
    options: CommandOptions,
    measured: Path,
    contacts: Literal["open", "closed"],
    limits: Mapping[str, float | None],
    decimal: DecimalMark | None = None,
) -> None:
    """Pair measured and computed modes.

    Parameters
    ----------
    options : shared options.
    measured : file of the shapes.
    contacts : state of the contacts in the computed modes.
    limits : least_mac and most_difference (%), None for no limit.
    decimal : decimal mark of a text file; found from the file by default.

    Raises
    ------
    VerdictError
        If a pair exceeds a limit.
    BeamsimError
        As `compute_and_save`.
    """
    scenario = load_case(options)
    target = output_file(options.output, f"{options.case.stem}_modes", ".h5", ".hdf5")

    def compared(*_: object) -> ModeComparison:
        with scenario.locating():
            return compare_modes(scenario, read_shapes(measured, scenario, decimal), contacts=contacts)

    result = compute_and_save("compare-modes", target, options, compared, f"comparing with {measured.name}")
    beyond = list(_exceeded_limits(result.summary["pairs"], **limits))
    if beyond:
        raise VerdictError("; ".join(beyond), exit_code(result.outcome, [Verdict.EXCEEDED]))


def _exceeded_limits(
    pairs: Sequence[Mapping[str, Any]], least_mac: float | None, most_difference: float | None
) -> Iterator[str]:
    """Exceeded limits, mode by mode; a mode without partner exceeds both."""
    for pair in pairs:
        name = f"mode measured at {pair['measured_hz']:.4g} Hz"
        if not pair["predicted"]:
            if least_mac is not None or most_difference is not None:
                yield f"{name}: no computed mode fits"
            continue
        if least_mac is not None and pair["mac"] < least_mac:
            yield f"{name}: MAC {pair['mac']:.3f} is below {least_mac:g}"
        percent = 100 * pair["difference"]
        if most_difference is not None and abs(percent) > most_difference:
            yield f"{name}: computed {pair['predicted_hz']:.4g} Hz, {percent:+.2f} %, over {most_difference:g} %"
