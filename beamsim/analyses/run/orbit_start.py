"""A run from a periodic motion that a continuation has stored: its state, and the scenario at that point."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NoReturn

import h5py
import numpy as np

from beamsim.errors import Problem, ScenarioError
from beamsim.scenario import Scenario
from beamsim.scenario.excitation import Harmonic
from beamsim.scenario.run import OrbitStart, Reduction
from beamsim.system.build import build_system
from beamsim.system.parts import SharedBuilds
from beamsim.system.structural import StructuralSystem
from beamsim.typing import Floats, not_none, of_kind

SAME_MODES = 1e-9  # relative difference of frequencies and shapes of one model, made twice
AT = "run.start.orbit"


@dataclass(frozen=True)
class StoredOrbit:
    """One point of a branch or of a curve of folds in a result file."""

    parameter: str  # frequency, level, gap or stiffness; of a curve of folds the second parameter
    snubber: str
    value: float  # of the parameter, SI
    frequency_hz: float
    level: float
    state: Floats  # (N,) coordinates, their velocities, internal states of the contacts; in the file's modes
    open_frequencies_hz: Floats  # (n,)
    shapes: Floats  # (n, nx) of the open modes at the stations
    kept_modes: int


def read_orbit(start: OrbitStart, folder: Path | None) -> StoredOrbit:
    """The point of the file that a start names.

    Raises
    ------
    ScenarioError
        If there is none, or the file is none of a continuation.
    """
    path = (folder or Path()) / start.orbit
    if not path.is_file():
        _reject(f"= {start.orbit} does not exist", "give its path, relative to the folder of the scenario")
    try:
        with h5py.File(path, "r") as file:
            if file.attrs.get("command") != "sweep" or file.attrs.get("kind") != "continuation":
                _reject(f"= {start.orbit} holds no continuation", "give the file of a sweep with kind: continuation")
            prefix, branch = "", None
            if start.fold_curve is None:
                branch = file["branches"].get(str(start.branch))
                if branch is None:
                    last = len(file["branches"]) - 1
                    _reject(f"= {start.branch} is not in the file", f"its branches are 0 to {last}", "run.start.branch")
            else:
                prefix = "second_"
                curves = file.get("fold_curves", {})
                branch = curves.get(str(start.fold_curve))
                if branch is None:
                    has = f"its curves of folds are 0 to {len(curves) - 1}" if len(curves) else "it has none"
                    _reject(f"= {start.fold_curve} is not in the file", has, "run.start.fold_curve")
            size = branch["parameter"].size
            if start.point > size:
                _reject(f"= {start.point} is beyond the branch", f"it has the points 1 to {size}", "run.start.point")
            if "coordinates" not in branch:
                _reject(f"= {start.orbit} has no states", "run the continuation again: it was made by an older version")
            k = start.point - 1
            states = [branch[name][k] for name in ("coordinates", "coordinate_velocities", "internal_states")
                      if name in branch]  # fmt: skip
            parameter, value = str(file.attrs[f"{prefix}parameter"]), float(branch["parameter"][k])
            return StoredOrbit(
                parameter,
                str(file.attrs.get(f"{prefix}snubber", "")),
                value,
                float(branch["frequency_hz"][k]),
                value if parameter == "level" else float(branch.attrs["level"]),
                np.concatenate(states),
                file["modes/open_frequencies_hz"][()],
                file["modes/shapes"][()],
                int(file["modes"].attrs["kept_modes"]),
            )
    except (OSError, KeyError, ValueError, TypeError) as error:
        _reject(f"= {start.orbit} cannot be read ({error})", "run the continuation again")


def _at_orbit(scenario: Scenario, orbit: StoredOrbit, *, keep_excitation: bool = False) -> Scenario:
    """The scenario with the excitation of the point and what was followed, unless kept, and as many modes.

    Raises
    ------
    ScenarioError
        If the scenario has no harmonic excitation or lacks what was followed.
    """
    excitation = scenario.excitation
    if not isinstance(excitation, Harmonic):
        _reject("needs the excitation of the continuation", "give a harmonic excitation", "excitation.kind")
    changed: dict[str, Any] = {}
    if scenario.reduction is None:
        changed["reduction"] = Reduction(modes=orbit.kept_modes)
    if keep_excitation:
        return scenario.model_copy(update=changed)
    changed["excitation"] = excitation.at(orbit.frequency_hz, orbit.level)
    if orbit.parameter in ("gap", "stiffness"):
        stops = [stop for snubber in scenario.snubbers for stop in snubber.stops]
        names = [stop.name for stop in stops]
        if orbit.snubber not in names:
            _reject(f"follows the {orbit.parameter} of {orbit.snubber}, which is not in snubbers", "list it there")
        k = names.index(orbit.snubber)
        stops[k] = stops[k].model_copy(update={orbit.parameter: orbit.value})
        changed["snubbers"] = tuple(stops)
    elif orbit.parameter == "position":
        _reject(
            "follows a position, in coordinates that change with it", "start from a continuation in another parameter"
        )
    return scenario.model_copy(update=changed)


def built_at_orbit(scenario: Scenario, shared: SharedBuilds) -> tuple[Scenario, StructuralSystem]:
    """The scenario at the point that its run starts from, and its system with the state there.

    Raises
    ------
    ScenarioError
        If there is no such point, or the scenario is another model than that of the file.
    """
    settings = not_none(scenario.run)
    start = of_kind(OrbitStart, settings.start)
    orbit = read_orbit(start, scenario.folder_of("run", "start", "orbit"))
    scenario = _at_orbit(scenario, orbit, keep_excitation=start.keep_excitation)
    at_rest = scenario.model_copy(update={"run": settings.model_copy(update={"start": "rest"})})
    return scenario, _started(build_system(at_rest, shared), orbit, start.factor)


def _started(system: StructuralSystem, orbit: StoredOrbit, factor: float = 1.0) -> StructuralSystem:
    """The system with the state of the point times a factor; modes may have the other sign.

    Raises
    ------
    ScenarioError
        If it is another model than that of the file.
    """
    n, frequencies, shapes = system.dynamics.size, system.open_frequencies_hz, system.deflection.T
    alike = frequencies.shape == orbit.open_frequencies_hz.shape and shapes.shape == orbit.shapes.shape
    if alike:
        sign = np.where(np.sum(shapes * orbit.shapes, axis=1) < 0, -1.0, 1.0)
        largest = np.abs(orbit.shapes).max()
        alike = bool(
            np.allclose(frequencies, orbit.open_frequencies_hz, rtol=SAME_MODES, atol=0.0)
            and np.abs(sign[:, None] * shapes - orbit.shapes).max() < np.sqrt(SAME_MODES) * largest
        )
    if not alike:
        _reject("is a motion of another structure", "keep structure, places and reduction of the continuation")
    state = factor * orbit.state
    state[:n] *= sign
    state[n : 2 * n] *= sign
    return replace(system, initial_state=state)


def _reject(message: str, remedy: str, at: str = AT) -> NoReturn:
    raise ScenarioError(Problem(at, message, remedy))
