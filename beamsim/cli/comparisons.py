"""Commands ``compare`` and ``compare-modes``."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Literal

from pydantic import ValidationError

from beamsim.analyses.compare.analysis import ChannelChoice, compare, pair_channels
from beamsim.analyses.compare.result import Comparison
from beamsim.analyses.compare.sweeps import Tracking, compare_sweep
from beamsim.analyses.compare_modes.analysis import ModeComparison, compare_modes, read_shapes
from beamsim.cli.command import compute_and_save
from beamsim.cli.session import CommandOptions, load_case
from beamsim.errors import Problem, ScenarioError, VerdictError
from beamsim.files import output_file
from beamsim.measurements.channels import history_named
from beamsim.outcomes import Verdict, exit_code
from beamsim.scenario.base import path_text
from beamsim.scenario.files import DecimalMark, RecordPreparation
from beamsim.scenario.validation_errors import describe
from beamsim.store.results import kind_of, stored_result


def compare_signals(
    options: CommandOptions, measured: Path, pairing: Mapping[str, Any], preparation_options: Mapping[str, str | None],
    run_options: Mapping[str, Any], sweep_options: Mapping[str, Any],
) -> None:  # fmt: skip
    """Compare the result of a run or a sweep with measured signals.

    Parameters
    ----------
    options : shared options; the case is a result file.
    measured : file of the measurement.
    pairing : assignment of channels to signals of the result, as in `ChannelChoice`.
    preparation_options : options factor, remove and high_pass for measured histories.
    run_options, sweep_options : options for results of runs, and of sweeps.

    Raises
    ------
    ScenarioError
        If an option does not apply to the kind of result; also as `compute_and_save`.
    """
    path = options.case
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
            _refuse_sweep_options({name: value for name, value in sweep_options.items() if name != "cycles"})
            comparison = partial(compare, result, pairs, **run_options)
        compute_and_save("compare", target, options, lambda *_: comparison(), f"comparing with {measured.name}")


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


def _refuse_sweep_options(options: Mapping[str, object]) -> None:
    """Refuse options that do not apply to the comparison of a run.

    Raises
    ------
    ScenarioError
    """
    problems = [
        Problem(f"--{name}", "belongs to sweeps, and this is a run", "leave it out, or give the result of a sweep")
        for name, value in options.items()
        if value is not None
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
