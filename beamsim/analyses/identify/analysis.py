"""``beamsim identify-stiffness``: parameters of a snubber, and of the structure that carries it, from measurements."""

from __future__ import annotations

import time as clock
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from beamsim.analyses.identify.layouts import BEFORE, FREQUENCIES, PROFILES, SHAPES, WITHOUT
from beamsim.analyses.identify.result import ComparedModes, Findings, IdentificationResult, ProfileLikelihood
from beamsim.analyses.identify.stiffness import POOR_MODEL, permanent_contact, snubber_point
from beamsim.analyses.identify.update import too_few_modes, update_model
from beamsim.errors import ScenarioError
from beamsim.flow.compiled import processor_time
from beamsim.labelled import Dataset
from beamsim.measurements.signal import MeasuredSignal
from beamsim.outcomes import Progress, Stop, first_with_others, never, stop_requests
from beamsim.scenario import Scenario, Source, scenario_of
from beamsim.scenario.base import Path
from beamsim.scenario.identification import IdentifyStiffness, MeasuredShapes
from beamsim.scenario.parameters import unit_of, with_values
from beamsim.signals.mac import modal_assurance
from beamsim.structures.assembly import assemble, joined_to
from beamsim.structures.modes import natural_modes
from beamsim.structures.places import Place
from beamsim.typing import Floats

_HZ = 2 * np.pi
_MIN_MODES = 3  # at least, in the tables


def identify_stiffness(
    scenario: Source,
    measurements: Sequence[MeasuredSignal] = (),
    progress: Progress = None,
    stop: Stop = never,
) -> IdentificationResult:
    """Identify the parameters listed in the section ``identify_stiffness`` of a scenario.

    Parameters
    ----------
    scenario : scenario with that section, or anything that `beamsim.load_scenario` reads.
    measurements : one signal for each of ``identify_stiffness.nonlinear.tests`` that is used, read from their files.
    progress : called repeatedly with the completed fraction.
    stop : polled during fits to vibrations; when True, the best parameters so far are returned without intervals.

    Returns
    -------
    IdentificationResult

    Raises
    ------
    ScenarioError
        If the section is missing, or no parameters explain the measurements; with a reason and a remedy.

    Examples
    --------
    >>> import beamsim
    >>> result = beamsim.identify_stiffness("configs/identify_snubber.yaml")
    >>> print(f"{result['stiffness']['stiffness'].item():.4g} N/m")
    1.536e+05 N/m
    """
    scenario = scenario_of(scenario, "identify-stiffness")
    with scenario.locating(), stop_requests(stop):
        return _identify(scenario, measurements, progress)


def _identify(scenario: Scenario, measurements: Sequence[MeasuredSignal], progress: Progress) -> IdentificationResult:
    begin, processor = clock.perf_counter(), processor_time()
    section = scenario.identify_stiffness
    if section is None:
        raise ScenarioError.at(
            "identify_stiffness", "is missing", "add `identify_stiffness: {snubber: tip, measured_with: [...]}`"
        )
    parts, current = dict[str, Findings](), scenario  # by kind of fit
    if section.update:
        parts["update"], current = update_model(scenario, section)
    count = max(_MIN_MODES, len(section.measured_with), len(section.measured_without))
    point = snubber_point(current, section.snubber, count)
    rigid = int(np.sum(point.omega == 0))
    count += rigid
    for key in ("measured_without", "measured_with"):
        if (measured := len(getattr(section, key))) > point.omega.size - rigid:
            raise ScenarioError(too_few_modes(key, measured, point.omega.size - rigid))
    without = ComparedModes.of(point.omega[:count] / _HZ, section.measured_without, rigid)
    parts["structure"] = _structure(scenario, current, section, without, "update" in parts)
    found: dict[Path, object] = {}
    if section.measured_with:
        update = parts["update"].datasets[0] if "update" in parts else None
        parts["stiffness"], found = permanent_contact(current, section, point, count, update)
    if section.nonlinear is not None:
        from beamsim.analyses.identify.vibrations import fit_nonlinear

        parts["nonlinear"] = fit_nonlinear(with_values(current, found), section, measurements, progress)
    if section.pad is not None and section.pad.data is not None:
        from beamsim.analyses.identify.pad_fit import fit_pad

        parts["pad"] = fit_pad(scenario, section.pad, section.pad.data, section.coverage)
    datasets = [each for part in parts.values() for each in part.datasets]
    modes = {name: each for part in parts.values() for name, each in part.modes.items()}
    profiles = [(name, each) for name, part in parts.items() for each in part.profiles]
    datasets.append(_frequencies(modes))
    if profiles:
        datasets.append(_profiles(scenario, profiles, section.coverage))
    result = IdentificationResult(
        scenario=scenario,
        outcome=first_with_others([part.outcome for part in parts.values() if not part.outcome.complete]),
        datasets={each.name: each for each in datasets},
        warnings=tuple(text for part in parts.values() for text in part.warnings),
        wall_time_s=clock.perf_counter() - begin,
    )
    summary = {name: value for part in parts.values() for name, value in part.summary.items()}
    return result.with_summary(**summary, **_summary(modes), processor_time_s=processor_time() - processor)


def _structure(
    scenario: Scenario, updated: Scenario, section: IdentifyStiffness, modes: ComparedModes, fitted: bool
) -> Findings:
    """Compare frequencies and shapes measured without the snubber with those of the model.

    Parameters
    ----------
    scenario, updated : the scenario as written, and with the fitted parameters.
    section : section with the measured frequencies and shapes.
    modes : modes of the model, every contact open.
    fitted : True if parameters of the structure were fitted.

    Returns
    -------
    Findings.
    """
    warnings, datasets = list[str](), list[Dataset]()
    if section.shapes_without is not None:
        datasets.append(_shapes(updated, section, section.shapes_without, warnings))
    warnings += () if fitted else _structure_warnings(modes)
    if section.measured_with or section.measured_without or section.shapes_without is not None:
        warnings += _omission_notes(scenario, section.snubber)
    return Findings(datasets, {}, warnings, modes={WITHOUT: modes})


def _frequencies(modes: Mapping[str, ComparedModes]) -> Dataset:
    """Build the labelled dataset of natural frequencies by model."""
    columns = {name: np.concatenate([getattr(each, name) for each in modes.values()]) for name in ComparedModes._fields}
    owners = np.repeat(np.arange(len(modes)), [each.mode.size for each in modes.values()])
    numbers = 1 + np.arange(owners.size)
    return FREQUENCIES.dataset({"model": list(modes), "frequency": numbers, "frequency_model": owners, **columns})


def _profiles(scenario: Scenario, profiles: Sequence[tuple[str, ProfileLikelihood]], coverage: float) -> Dataset:
    """Build the labelled dataset of profile likelihoods, each with the name of its fit."""
    sizes = [each.value.size for _, each in profiles]
    units = ["N/m" if fit == "stiffness" else unit_of(scenario, each.parameter) for fit, each in profiles]
    values = {
        "profile": 1 + np.arange(len(profiles)),
        "fit": [fit for fit, _ in profiles],
        "parameter": [each.parameter for _, each in profiles],
        "unit": units,
        "coverage": coverage,
        "point": 1 + np.arange(sum(sizes)),
        "point_profile": np.repeat(np.arange(len(profiles)), sizes),
        "value": np.concatenate([each.value for _, each in profiles]),
        "misfit": np.concatenate([each.misfit for _, each in profiles]),
    }
    return PROFILES.dataset(values)


def _summary(modes: Mapping[str, ComparedModes]) -> dict[str, list[float]]:
    """Summary entries about natural frequencies."""
    summary = {}
    for name, each in modes.items():
        word = name.partition("_")[0]
        summary[f"frequencies_{word}_hz"] = each.predicted_hz.tolist()
        if name != BEFORE:
            summary[f"measured_{word}_hz"] = each.measured_hz.tolist()
            summary[f"difference_{word}_percent"] = each.difference_percent.tolist()
    return summary


def _omission_notes(scenario: Scenario, snubber: str) -> Iterator[str]:
    """Notes on snubbers and bodies that the natural frequencies do not include."""
    others = [s.name for s in scenario.all_snubbers if s.name != snubber]
    if others:
        yield f"the natural frequencies are those with the other snubbers ({', '.join(others)}) open"
    bodies = joined_to(scenario, scenario.located_snubber(snubber).bodies)
    if len(bodies) < len(scenario.all_bodies):
        yield (
            f"the natural frequencies are those of {' and '.join(bodies)}: the bodies that the snubber acts on, with "
            "those they are joined to"
        )


def mode_shapes(scenario: Scenario, snubber: str, count: int, positions: tuple[float, ...]) -> Floats:
    """Mode shapes of the body that a snubber acts on, with every contact open, without rigid-body modes.

    Parameters
    ----------
    scenario : scenario with the snubber.
    snubber : name of the snubber, which acts on one body.
    count : number of modes.
    positions : p positions, m along a beam, or numbers of masses or nodes.

    Returns
    -------
    (p, count) array
        Mass-normalised.
    """
    bodies = scenario.located_snubber(snubber).bodies
    model = assemble(scenario, bodies)
    rigid = model.rigid.shape[1]
    modes = natural_modes(model, count=count + rigid)
    return np.asarray(model.rows([Place(bodies[0], x) for x in positions]) @ modes.vectors[:, rigid : rigid + count])


def _shapes(scenario: Scenario, section: IdentifyStiffness, measured: MeasuredShapes, warnings: list[str]) -> Dataset:
    """Modal assurance of measured and predicted shapes; warns about shapes that resemble another mode more."""
    body = scenario.all_bodies[scenario.located_snubber(section.snubber).bodies[0]]
    positions = tuple(map(body.metres, measured.positions))
    predicted = mode_shapes(scenario, section.snubber, max(len(measured.shapes), _MIN_MODES), positions)
    mac = modal_assurance(np.array(measured.shapes).T, predicted)
    for i, row in enumerate(mac):
        best = int(np.argmax(row))
        if best != i:
            warnings.append(
                f"the measured shape {i + 1} resembles mode {best + 1} of the model (MAC {row[best]:.2f}) more than "
                f"mode {i + 1} (MAC {row[i]:.2f}): check the order of the modes"
            )
    measured_numbers, computed_numbers = (1 + np.arange(size) for size in mac.shape)
    return SHAPES.dataset({"measured_shape": measured_numbers, "predicted_shape": computed_numbers, "mac": mac})


def _structure_warnings(modes: ComparedModes) -> list[str]:
    off = modes.difference_percent
    known = np.isfinite(off)
    if not known.any() or np.max(np.abs(off[known])) <= POOR_MODEL:
        return []
    worst = int(np.nanargmax(np.abs(off)))
    return [
        f"without the snubber the model's mode {worst + 1} differs by {off[worst]:+.1f} % from the measured frequency: "
        "correct the parameters of the structure first (identify_stiffness.update fits them)"
    ]
