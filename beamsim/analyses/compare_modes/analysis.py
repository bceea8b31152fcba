r"""``beamsim compare-modes``: which computed mode is which measured one.

Shapes m and p at the same places are compared by the modal assurance criterion
:math:`|m^H p|^2 / (m^H m\; p^T p)` (R. J. Allemang, D. L. Brown, A correlation coefficient for modal vector analysis,
IMAC 1982), which is 1 for shapes that differ by a factor alone. Modes are paired so that the sum of the criterion is
largest; of shapes that are alike at the places, the nearer frequency decides.
"""

from __future__ import annotations

from collections.abc import Iterator
from time import perf_counter
from typing import Any, Literal

import numpy as np

from beamsim.analyses.assurance import assurance
from beamsim.analyses.compare_modes.measured import ShapesAtPlaces
from beamsim.analyses.compare_modes.result import UNPAIRED, ModeComparison
from beamsim.errors import Problem, ScenarioError
from beamsim.outcomes import COMPLETE
from beamsim.scenario import Scenario
from beamsim.scenario.checks import place_problems
from beamsim.scenario.run import Reduction
from beamsim.structures.assembly import site_in
from beamsim.system.build import build_system
from beamsim.system.parts import reduced_parts
from beamsim.typing import Floats, Ints


def compare_modes(
    scenario: Scenario, measured: ShapesAtPlaces, *, contacts: Literal["open", "closed"] = "open"
) -> ModeComparison:
    """Compare measured mode shapes with those of the structure.

    Parameters
    ----------
    contacts : whether the snubbers are open or all closed in the computed modes.

    Raises
    ------
    ScenarioError
        If a place is not on the structure, there are less than two places, or a shape is zero.
    """
    begin = perf_counter()
    _check(measured)
    frequencies, shapes = _computed(scenario, measured, closed=contacts == "closed")
    mac, auto = (np.nan_to_num(assurance(shape, shapes)) for shape in (measured.shapes, shapes))
    paired = _paired(mac, measured.frequency_hz, frequencies)
    pairs = [
        {
            "number": k + 1,
            "measured_hz": float(f),
            "predicted": int(number),
            "predicted_hz": float(frequencies[number - 1]) if number else None,
            "difference": float(frequencies[number - 1] / f - 1.0) if number else None,
            "mac": float(mac[k, number - 1] if number else mac[k].max(initial=0.0)),
        }
        for k, (f, number) in enumerate(zip(measured.frequency_hz, paired, strict=True))
    ]
    fitting: list[dict[str, Any]] = [pair for pair in pairs if pair["predicted"]]
    return ModeComparison(
        scenario=scenario,
        outcome=COMPLETE,
        warnings=tuple(_warnings(scenario, paired, auto, measured)),
        contacts=contacts,
        source=measured.source,
        measured_hz=measured.frequency_hz,
        predicted_hz=frequencies,
        mac=mac,
        auto_mac=auto,
        paired=paired,
        wall_time_s=perf_counter() - begin,
    ).with_summary(
        pairs=pairs,
        lowest_mac=min(pair["mac"] for pair in fitting) if len(fitting) == len(pairs) else 0.0,
        largest_difference=max((abs(pair["difference"]) for pair in fitting), default=float("nan")),
    )


def _check(measured: ShapesAtPlaces) -> None:
    if len(measured.places) < 2:
        raise _wrong(measured, f"has {len(measured.places)} place", "shapes need two places at least")
    norms = np.linalg.norm(measured.shapes, axis=0)
    if not np.all(np.isfinite(norms)) or np.any(norms == 0.0):
        k = int(np.flatnonzero(~(norms > 0.0) | ~np.isfinite(norms))[0])
        raise _wrong(measured, f"has no motion in the mode at {measured.frequency_hz[k]:g} Hz", "leave the mode out")
    if np.any(measured.frequency_hz <= 0.0):
        raise _wrong(measured, "has a frequency that is not above zero", "give natural frequencies in Hz")


def _wrong(measured: ShapesAtPlaces, message: str, remedy: str) -> ScenarioError:
    return ScenarioError(Problem("", f"{measured.source or 'the measurement'} {message}", remedy))


def _computed(scenario: Scenario, measured: ShapesAtPlaces, *, closed: bool) -> tuple[Floats, Floats]:
    """(n,) Hz and (p, n) shapes of computed modes at the places."""
    # 1.5: times the highest measured frequency, up to which computed modes are compared
    # 4: more than were measured
    highest, least = 1.5 * float(measured.frequency_hz.max()), measured.frequency_hz.size + 4
    sites = []
    for label, place in zip(measured.labels or [""] * len(measured.places), measured.places, strict=True):
        for problem in place_problems(scenario, ("probes",), place):
            raise _wrong(measured, f"{label}: {problem.message}".strip(": "), problem.remedy)
        sites.append(site_in(scenario, place))
    if scenario.reduction is None:
        scenario = scenario.model_copy(update={"reduction": Reduction(highest_frequency=highest)})
        if reduced_parts(scenario).basis.modes < least:
            scenario = scenario.model_copy(update={"reduction": Reduction(modes=least)})
    parts = reduced_parts(scenario)
    try:
        shapes = parts.shapes(sites)
    except ValueError as error:
        raise _wrong(measured, f"names a place that the structure does not have: {error}", "") from None
    omega = parts.omega[: parts.basis.modes]
    if closed:
        contacts, count = build_system(scenario, assessed=False).dynamics.contacts, len(parts.snubber_sites)
        stops, stiffness = contacts.shape[:count], contacts.slow[0][:count]
        squared, vectors = np.linalg.eigh(np.diag(parts.stiffness) + (stops.T * stiffness) @ stops)
        omega, shapes = np.sqrt(np.maximum(squared, 0.0)), shapes @ vectors
    frequencies = omega / (2 * np.pi)
    order = np.argsort(frequencies, kind="stable")
    most = max(int(np.sum(frequencies <= highest)), min(least, frequencies.size))
    return frequencies[order][:most], shapes[:, order[:most]]


def _paired(mac: Floats, measured: Floats, computed: Floats) -> Ints:
    """(m,) number from 1 of the computed mode of each measured one; 0 where none fits."""
    from scipy.optimize import linear_sum_assignment

    apart = np.abs(np.log(np.maximum(computed, 1e-3 * measured.min())[None, :] / measured[:, None]))
    # 0.01: weight of a frequency's logarithm beside the MAC
    rows, columns = linear_sum_assignment(mac - 0.01 * apart, maximize=True)
    paired = np.zeros(measured.size, dtype=np.int64)
    fits = mac[rows, columns] > UNPAIRED
    paired[rows[fits]] = columns[fits] + 1
    return paired


def _warnings(scenario: Scenario, paired: Ints, auto: Floats, measured: ShapesAtPlaces) -> Iterator[str]:
    for k in np.flatnonzero(paired == 0):
        yield f"no computed mode fits the one measured at {measured.frequency_hz[k]:g} Hz"
    count = auto.shape[0]
    groups: dict[tuple[int, ...], list[int]] = {}  # by what looks like a mode, itself included, the paired ones
    for number in paired[paired > 0] - 1:
        # 0.9: MAC of two computed shapes that the places cannot tell apart
        alike = tuple(j + 1 for j in range(count) if j == number or auto[number, j] > 0.9)
        if len(alike) > 1:
            groups.setdefault(alike, []).append(number + 1)
    # 4: warnings about that; more become one
    if len(groups) > 4:
        doubtful = sum(map(len, groups.values()))
        yield (
            f"{len(measured.places)} measured places do not tell {doubtful} of {np.count_nonzero(paired)} paired modes "
            "from others: measure at more places"
        )
        return
    for alike, numbers in groups.items():
        listed = ", ".join(str(number) for number in alike if number not in numbers or len(numbers) > 1)
        called = f"modes {listed} look alike" if len(numbers) > 1 else f"mode {numbers[0]} looks like mode {listed}"
        yield f"at the measured places {called}: measure at more places"
