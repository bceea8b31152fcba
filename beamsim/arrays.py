"""Systems from arrays: matrices, load vectors and contacts, without a scenario file.

A `System` becomes a scenario with imported matrices that are written in the case, so that every analysis, its checks,
its files and its plots are those of scenarios. `System.scenario` gives that scenario.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from beamsim.analyses.coexisting.result import CoexistingResult
from beamsim.analyses.continuation.result import ContinuationResult
from beamsim.analyses.nnm.result import NormalModeResult
from beamsim.analyses.run.result import RunResult
from beamsim.labelled import Dataset
from beamsim.scenario import Scenario, load_scenario
from beamsim.trust.runs import run
from beamsim.trust.with_finer_model import coexisting, continuation, nnm

NAME = "system"
"""Name of the body in the scenario."""
MOST_DEFAULT_OUTPUTS = 20
"""Up to so many degrees of freedom are recorded by default."""
NARROW = 1e-3
"""Relative width of the range in which periodic motions at one frequency are sought."""

SAME = 1e-12
"""Relative difference of frequencies that are the same."""

Signals = Mapping[str, Mapping[str, Any]]
"""For each load its signal: the keys of an excitation, such as kind, level and frequency."""


@dataclass(frozen=True, eq=False)
class Contact:
    """A one-sided contact: it acts where row @ u exceeds the gap.

    Parameters
    ----------
    row : (n,) motion of the contact for a unit of each degree of freedom.
    law : stiffness, N/m; or (k, 2) table of penetration, m, and force, N, which starts at zero; or the keys of a
        snubber, such as ``{"stiffness": 1e5, "damping": {"kind": "viscous", "coefficient": 20.0}}``.
    gap : m; a negative gap is a prestress. None where the law has a ``preload``.
    name : name; by default contact_1, contact_2, ...

    Examples
    --------
    >>> import beamsim
    >>> beamsim.Contact(row=[0, 1], law=[[0, 0], [1e-3, 50], [2e-3, 200]], gap=5e-4).snubber("pad")["gap"]
    0.0005
    """

    row: Any
    law: Any
    gap: float | None = 0.0
    name: str = ""

    def snubber(self, name: str) -> dict[str, Any]:
        """The snubber of a scenario at the row of this name."""
        kind = "force_deflection" if np.ndim(self.law) else "stiffness"
        keys = self.law if isinstance(self.law, Mapping) else {kind: self.law}
        gap = {} if self.gap is None else {"gap": self.gap}
        return {"name": name, "at": {"row": name}, "side": "above", **gap, **keys}


@dataclass(frozen=True, eq=False)
class System:
    """A structure given by arrays, M u'' + C u' + K u = loads - contact forces, in SI units.

    Parameters
    ----------
    mass, stiffness : (n, n) symmetric M and K.
    damping : (n, n) symmetric C; or a modal damping ratio; or the keys of ``damping`` of a scenario; none by default.
    contacts : the contacts.
    loads : (n,) load vector of each load, by name: forces on the degrees of freedom for a unit of its signal.
    outputs : (n,) row of each recorded motion, by name; by default each degree of freedom of at most 20, q1, q2, ...

    Raises
    ------
    ScenarioError
        In all functions, where an array does not fit, with the place in the scenario.

    Examples
    --------
    >>> import beamsim
    >>> stop = beamsim.Contact(row=[0, 1], law=10.0, gap=0.1, name="stop")
    >>> pair = beamsim.System([[1, 0], [0, 1]], [[2, -1], [-1, 1]], 0.02, [stop], {"f": [1, 0]})
    >>> beamsim.run(pair.scenario(run={"duration": 1.0}))["modes"]["open_frequencies_hz"].values.round(4).tolist()
    [0.0984, 0.2575]
    """

    mass: Any
    stiffness: Any
    damping: Any = None
    contacts: Sequence[Contact] = ()
    loads: Mapping[str, Any] = field(default_factory=dict)
    outputs: Mapping[str, Any] = field(default_factory=dict)

    @property
    def names_of_contacts(self) -> list[str]:
        """Name of each contact."""
        return [contact.name or f"contact_{number}" for number, contact in enumerate(self.contacts, start=1)]

    def scenario(self, signals: Signals | None = None, **sections: Any) -> Scenario:
        """The scenario of this system.

        Parameters
        ----------
        signals : the signal of each load that acts.
        sections : sections of the scenario, such as ``run={"duration": 10.0}``.

        Returns
        -------
        Scenario
            For `beamsim.run` and all other functions.

        Raises
        ------
        ScenarioError
            If a section or an array is not valid.
        """
        contacts = list(zip(self.names_of_contacts, self.contacts, strict=True))
        rows = {name: contact.row for name, contact in contacts}
        rows |= {f"load_{name}": vector for name, vector in self.loads.items()}
        rows |= {f"output_{name}": row for name, row in self.outputs.items()}
        body = {
            "kind": "matrices", "mass": _rows(self.mass), "stiffness": _rows(self.stiffness), "base": "free",
            "rows": rows, **self._damping(),
        }  # fmt: skip
        probes: dict[str, Any] = {name: {"row": f"output_{name}"} for name in self.outputs}
        if not probes and len(body["mass"]) <= MOST_DEFAULT_OUTPUTS:
            probes = {f"q{node}": {"node": node} for node in range(1, len(body["mass"]) + 1)}
        case = {
            "bodies": {NAME: body},
            "snubbers": [contact.snubber(name) for name, contact in contacts],
            "probes": [{"name": name, "at": place} for name, place in probes.items()],
            "excitation": _excitation(signals or {}),
            **sections,
        }
        return load_scenario(case)

    def _damping(self) -> dict[str, Any]:
        if self.damping is None:
            return {}
        if isinstance(self.damping, Mapping):
            return {"damping": self.damping}
        if np.ndim(self.damping):
            return {"viscous": _rows(self.damping)}
        return {"damping": {"kind": "modal", "ratio": self.damping}}


def _rows(matrix: Any) -> Any:
    """The rows of a matrix, dense or sparse."""
    return np.asarray(matrix.toarray() if hasattr(matrix, "toarray") else matrix).tolist()


def _excitation(signals: Signals) -> dict[str, Any]:
    """The excitation of a scenario by loads with these signals."""
    forces = [{**signal, "applied_to": {"row": f"load_{name}"}} for name, signal in signals.items()]
    if not forces:
        return {"kind": "none"}
    return forces[0] if len(forces) == 1 else {"kind": "forces", "forces": forces}


def _sines(signals: Signals, frequency: float) -> Signals:
    """Harmonic signals, of this frequency, Hz, if they state none."""
    return {name: {"kind": "harmonic", "frequency": frequency, **signal} for name, signal in signals.items()}


def simulate(
    system: System, duration: float, signals: Signals | None = None, *, start: tuple[Any, Any] | None = None,
    **settings: Any,
) -> RunResult:  # fmt: skip
    """The motion from an initial state.

    Parameters
    ----------
    system : the structure with its contacts.
    duration : s.
    signals : signal of each load that acts; none by default.
    start : (n,) displacements, m, and (n,) velocities, m/s; by default static equilibrium.
    settings : further keys of ``run``, such as sample_rate in Hz.

    Returns
    -------
    RunResult
        With the datasets histories, events, spectra, ...

    Raises
    ------
    ScenarioError
        If an array or a setting is not valid.

    Examples
    --------
    >>> import beamsim
    >>> stop = beamsim.Contact(row=[0, 1], law=10.0, gap=0.1, name="stop")
    >>> pair = beamsim.System([[1, 0], [0, 1]], [[2, -1], [-1, 1]], 0.02, [stop], {"f": [1, 0]})
    >>> motion = beamsim.simulate(pair, 10.0, start=([0, 0], [0, 1]), sample_rate=10.0)
    >>> motion["events"]["time"].values.round(3)[:2].tolist()
    [0.1, 1.036]
    """
    state = {} if start is None else {"start": dict(zip(("displacement", "velocity"), start, strict=True))}
    return run(system.scenario(signals, run={"duration": duration, **state, **settings}))


def sensitivities(
    system: System, parameters: Sequence[str], duration: float, signals: Signals | None = None, **settings: Any
) -> RunResult:
    """A motion and the derivatives of its values, exact also where contacts open and close.

    Parameters
    ----------
    system, duration, signals, settings : as of `simulate`.
    parameters : paths of numbers in the scenario, such as ``snubbers.contact_1.gap``.

    Returns
    -------
    RunResult
        With the dataset sensitivities.

    Raises
    ------
    ScenarioError
        If a path leads to no number.

    Examples
    --------
    >>> import beamsim
    >>> stop = beamsim.Contact(row=[0, 1], law=10.0, gap=0.1, name="stop")
    >>> pair = beamsim.System([[1, 0], [0, 1]], [[2, -1], [-1, 1]], 0.02, [stop], {"f": [1, 0]})
    >>> start = ([0, 0], [0, 1])
    >>> motion = beamsim.sensitivities(pair, ["snubbers.stop.gap"], 3.0, start=start)
    >>> table = motion["sensitivities"]
    >>> print(table["response"].values[0], table["derivative"].values[0].round(4))
    snubbers/stop/peak_force -1.2392
    """
    return simulate(system, duration, signals, sensitivities=list(parameters), **settings)


def continue_motion(
    system: System, frequencies: tuple[float, float], signals: Signals, **settings: Any
) -> ContinuationResult:
    """All periodic motions in a range of the frequency, stable and unstable, with their bifurcations.

    Parameters
    ----------
    system : the structure with its contacts.
    frequencies : Hz, lowest and highest.
    signals : a harmonic signal of each load that acts; its frequency may be left out.
    settings : further keys of ``sweep`` with ``kind: continuation``.

    Returns
    -------
    ContinuationResult
        With the datasets points and special points.

    Raises
    ------
    ScenarioError
        If an array or a setting is not valid.

    Examples
    --------
    >>> import beamsim
    >>> stop = beamsim.Contact(row=[0, 1], law=10.0, gap=0.1, name="stop")
    >>> pair = beamsim.System([[1, 0], [0, 1]], [[2, -1], [-1, 1]], 0.02, [stop], {"f": [1, 0]})
    >>> curve = beamsim.continue_motion(pair, (0.05, 0.06), {"f": {"level": 0.05}}, side_branches="none")
    >>> bool(curve["points"]["stable"].values.all())
    True
    """
    lowest, highest = frequencies
    sweep = {"kind": "continuation", "from": lowest, "to": highest, **settings}
    return continuation(system.scenario(_sines(signals, lowest), sweep=sweep))


def periodic_motion(system: System, frequency: float, signals: Signals, **settings: Any) -> Dataset:
    """The periodic motions at one frequency that belong to the branches of all periodic motions around it.

    Parameters
    ----------
    system : the structure with its contacts.
    frequency : Hz.
    signals, settings : as of `continue_motion`.

    Returns
    -------
    Dataset
        One point for each motion: peaks, stability, Floquet multipliers.

    Raises
    ------
    ScenarioError
        If an array or a setting is not valid.

    Examples
    --------
    >>> import beamsim
    >>> stop = beamsim.Contact(row=[0, 1], law=10.0, gap=0.1, name="stop")
    >>> pair = beamsim.System([[1, 0], [0, 1]], [[2, -1], [-1, 1]], 0.02, [stop], {"f": [1, 0]})
    >>> motion = beamsim.periodic_motion(pair, 0.05, {"f": {"level": 0.05}})
    >>> motion["peak_displacement"].sel(probe="q1").values.round(4).tolist()
    [0.0631]
    """
    band = (frequency * (1.0 - NARROW), frequency * (1.0 + NARROW))
    points = continue_motion(system, band, signals, points_at=[frequency], **settings)["points"]
    return points.isel(point=np.isclose(points["frequency_hz"].values, frequency, rtol=SAME, atol=0.0))


def backbone(system: System, mode: int, energies: tuple[float, float], **settings: Any) -> NormalModeResult:
    """Free periodic motions of the undamped system from a natural mode on: the nonlinear normal mode.

    Parameters
    ----------
    system : the structure with its contacts; its damping is left out.
    mode : number of the mode, from 1.
    energies : J, lowest and highest.
    settings : further keys of ``nnm``.

    Returns
    -------
    NormalModeResult
        With frequency and shape over energy.

    Raises
    ------
    ScenarioError
        If an array or a setting is not valid.

    Examples
    --------
    >>> import beamsim
    >>> stop = beamsim.Contact(row=[0, 1], law=10.0, gap=0.1, name="stop")
    >>> pair = beamsim.System([[1, 0], [0, 1]], [[2, -1], [-1, 1]], 0.02, [stop], {"f": [1, 0]})
    >>> mode = beamsim.backbone(pair, 1, (1e-3, 1e-2))
    >>> mode.branches[0]["frequency_hz"].values[[0, -1]].round(4).tolist()
    [0.0984, 0.1173]
    """
    lowest, highest = energies
    path = {"kind": "energy", "from": lowest, "to": highest}
    return nnm(system.scenario(nnm={"mode": mode, "continue_in": path, **settings}))


def basins(
    system: System, frequency: float, signals: Signals, box: Sequence[Mapping[str, Any]], number: int = 100,
    **settings: Any,
) -> CoexistingResult:  # fmt: skip
    """Which of several steady motions occurs, from random initial states.

    Parameters
    ----------
    system : the structure with its contacts.
    frequency : Hz.
    signals : a harmonic signal of each load that acts.
    box : ranges of the initial states, such as ``[{"probe": "q1", "displacement": [-1, 1], "velocity": [-1, 1]}]``.
    number : number of initial states.
    settings : further keys of ``sweep`` with ``kind: coexisting``.

    Returns
    -------
    CoexistingResult
        With the motions, and the share of initial states that leads to each.

    Raises
    ------
    ScenarioError
        If an array or a setting is not valid.

    Examples
    --------
    >>> import beamsim
    >>> stop = beamsim.Contact(row=[0, 1], law=10.0, gap=0.1, name="stop")
    >>> pair = beamsim.System([[1, 0], [0, 1]], [[2, -1], [-1, 1]], 0.02, [stop], {"f": [1, 0]})
    >>> box = [{"probe": "q1", "displacement": [-0.1, 0.1]}]
    >>> shares = beamsim.basins(pair, 0.05, {"f": {"level": 0.05}}, box, number=4)
    >>> [motion["share"] for motion in shares.summary["motions"] if motion["stable"]]
    [1.0]
    """
    starts = {"kind": "states", "number": number, "box": box}
    return coexisting(
        system.scenario(
            _sines(signals, frequency), sweep={"kind": "coexisting", "at": [frequency], "starts": starts, **settings}
        )
    )
