"""Checks of an imported model, each with a verdict."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from beamsim.dofs import DIRECTIONS, MODAL
from beamsim.errors import MethodError
from beamsim.scenario import Scenario
from beamsim.structures.assembly import bodies_of
from beamsim.structures.imported import rigid_rows
from beamsim.structures.matrices import NOT_HELD_REMARK, MatricesStructure, structure_of
from beamsim.structures.modes import Modes, natural_modes
from beamsim.structures.named_matrices import NamedMatrices, size_and_mass
from beamsim.structures.places import UPWARDS, BaseDirection
from beamsim.structures.symmetric_lu import symmetric_lu
from beamsim.typing import Floats

OK, NOTE, FAILS = "ok", "note", "fails"

GROUNDED_FORCE = 1e-6
"""Force under a rigid motion, relative to the sum of absolute contributions, above which a model is restrained."""
_MODES = 10


@dataclass(frozen=True)
class CheckRow:
    """One line of the table."""

    name: str
    value: Any  # for JSON, SI units
    text: str
    verdict: str = ""


def check(scenario: Scenario) -> dict[str, tuple[CheckRow, ...]]:
    """The checks of every body separately, without joints and snubbers."""
    return {body.name: tuple(check_body(body.named_matrices)) for body in bodies_of(scenario)}


def check_body(matrices: NamedMatrices) -> Iterator[CheckRow]:
    """All checks of one body."""
    table = matrices.table
    modal = sum(direction == MODAL for _, direction in table.dofs)
    nodes = len({node for node, direction in table.dofs if direction != MODAL})
    yield CheckRow(
        "degrees_of_freedom", len(table.dofs), f"{len(table.dofs)}: {nodes} nodes, {modal} modal coordinates"
    )
    if matrices.units:
        yield CheckRow(
            "units",
            matrices.units,
            f"{matrices.units} in the files" + ("; SI in this table" if matrices.units != "SI" else ""),
        )
    if (extent := size_and_mass(matrices).extent) is not None:
        text = " x ".join(f"{each:.4g}" for each in extent)
        yield CheckRow("size", extent.tolist(), f"{text} m along x, y, z")
    yield CheckRow(
        "symmetry", list(matrices.remarks), "; ".join(matrices.remarks) or "symmetric", NOTE if matrices.remarks else OK
    )
    motions = _rigid_motions(matrices)
    yield from _mass_properties(matrices, motions)
    yield from _grounding_rows(matrices, motions)
    yield from _frequencies(matrices, motions)


def _rigid_motions(matrices: NamedMatrices) -> dict[str, Floats]:
    """(N,) motion of every row under translations, and, if all coordinates are known, rotations about the origin."""
    table, none = matrices.table, np.zeros(0, dtype=np.int64)
    placed = np.array([direction != MODAL for _, direction in table.dofs])
    unknown = table.coordinates is None or np.any(np.isnan(table.coordinates[placed]))
    known = DIRECTIONS[:3] if unknown else DIRECTIONS
    motions = {direction: rigid_rows(table, BaseDirection(direction), none) for direction in known}
    return {name: motion for name, motion in motions.items() if np.any(motion)}


def _mass_properties(matrices: NamedMatrices, motions: dict[str, Floats]) -> Iterator[CheckRow]:
    momentum = {a: {b: float(x @ (matrices.mass @ y)) for b, y in motions.items()} for a, x in motions.items()}
    mass = {d: momentum[d][d] for d in DIRECTIONS[:3] if d in motions}
    if not mass:
        yield CheckRow("mass", None, "unknown: modal coordinates alone", NOTE)
        return
    spread = max(mass.values()) - min(mass.values())
    text = ", ".join(f"{d} {m:.6g}" for d, m in mass.items())
    same = spread <= 1e-6 * max(mass.values())
    verdict = FAILS if min(mass.values()) <= 0 else OK if same else NOTE
    yield CheckRow("mass", mass, f"{text} kg" + ("" if same else ", not the same in all directions"), verdict)
    if not any(each.startswith("r") for each in motions):
        yield CheckRow("centre_of_mass", None, "unknown: the table has no coordinates", NOTE)
        return
    pairs = {"x": (("z", "ry", -1), ("y", "rz", 1)), "y": (("z", "rx", 1), ("x", "rz", -1)),
             "z": (("x", "ry", 1), ("y", "rx", -1))}  # fmt: skip
    centre = {}
    for direction, choices in pairs.items():
        for along, about, sign in choices:
            if along in motions and about in motions:
                centre[direction] = sign * momentum[along][about] / mass[along]
                break
    held = [
        name for name in motions if name.startswith("r") and _relative_force(matrices, motions[name]) > GROUNDED_FORCE
    ]
    about_held = f"; about: supports hold {', '.join(held)}, and elements next to them bend" if held else ""
    text = ", ".join(f"{d} {1e3 * x:.5g}" for d, x in centre.items())
    yield CheckRow("centre_of_mass", centre, f"{text} mm{about_held}", NOTE if held else OK)
    inertia = {}
    for k, about in enumerate(DIRECTIONS[3:]):
        if about in motions:
            others = [d for d in DIRECTIONS[:3] if d != DIRECTIONS[k]]
            # parallel axis theorem: a distance counts with the mass in the direction in which it moves points
            shift = sum(mass[other] * centre.get(d, 0.0) ** 2 for d, other in (others, others[::-1]) if other in mass)
            inertia[about] = momentum[about][about] - shift
    largest = max(inertia.values())
    text = ", ".join(f"{d} {x:.5g}" for d, x in inertia.items())
    verdict = FAILS if min(inertia.values()) < -1e-9 * abs(largest) else NOTE if held else OK
    yield CheckRow("inertia", inertia, f"{text} kg m^2 about the centre{about_held}", verdict)


def _grounding_rows(matrices: NamedMatrices, motions: dict[str, Floats]) -> Iterator[CheckRow]:
    # A base without rotation restrains rotations, which is correct; in its own direction it would be an error.
    values = {name: _relative_force(matrices, motion) for name, motion in motions.items()}
    if not values:
        yield CheckRow("grounding", None, "not checked: no node has a direction", NOTE)
        return
    held = [name for name, value in values.items() if value > GROUNDED_FORCE]
    text = f"largest force under a rigid motion {max(values.values()):.1g} of that of single entries"
    if held:
        worst = max(held, key=values.__getitem__)
        at = matrices.table.dofs[int(np.argmax(np.abs(matrices.stiffness @ motions[worst])))]
        text += f"; held in {', '.join(held)}, most at node {at[0]} {at[1]}"
    wrong = bool(held) if not matrices.base else matrices.direction in held
    yield CheckRow("grounding", values, text, FAILS if wrong else NOTE if held else OK)


def _relative_force(matrices: NamedMatrices, motion: Floats) -> float:
    size = float((abs(matrices.stiffness) @ np.abs(motion)).max())
    return float(np.abs(matrices.stiffness @ motion).max()) / size if size > 0 else 0.0


def _frequencies(matrices: NamedMatrices, motions: dict[str, Floats]) -> Iterator[CheckRow]:
    loose = [motion for motion in motions.values() if _relative_force(matrices, motion) <= GROUNDED_FORCE]
    expected = int(np.linalg.matrix_rank(np.array(loose))) if loose else 0
    try:
        free, modes = _modes(replace(matrices, base=(), damping=None))
        count = free.rigid.shape[1]
        text = f"{_frequencies_text(modes.omega[count:] * free.frequency_scale)}; {count} rigid-body modes"
        beyond = count != expected
        text += f" where the nodes have {expected}" if beyond else ""
        yield CheckRow("free_frequencies_hz", _hertz(modes.omega * free.frequency_scale), text, NOTE if beyond else OK)
        yield from _remarks(free)
        if not matrices.base:
            yield _worst_rows(free)
            return
        del free, modes  # frees memory of a large model
        fixed, modes = _modes(replace(matrices, damping=None))
        omega = modes.omega * fixed.frequency_scale
        unheld = [note for note in fixed.notes if note.startswith(NOT_HELD_REMARK)]
        text = "; ".join([f"{_frequencies_text(omega)}; with the base held", *unheld])
        yield CheckRow("fixed_frequencies_hz", _hertz(omega), text, NOTE if unheld else OK)
        yield _effective_masses(matrices, fixed, modes)
        yield _worst_rows(fixed)
    except MethodError as error:
        yield CheckRow("frequencies", None, f"{error.about} {error.message}; {error.remedy}", FAILS)


def _modes(matrices: NamedMatrices) -> tuple[MatricesStructure, Modes]:
    structure = structure_of(matrices)
    return structure, natural_modes(structure, min(structure.size, _MODES + structure.rigid.shape[1]))


def _remarks(structure: MatricesStructure) -> Iterator[CheckRow]:
    massless = [note for note in structure.notes if "without mass" in note]
    yield CheckRow("massless_motions", massless, "; ".join(massless) or "none", NOTE if massless else OK)


def _effective_masses(matrices: NamedMatrices, structure: MatricesStructure, modes: Modes) -> CheckRow:
    """Share of the mass that each mode moves with the base; the mass of the base's own rows is not counted."""
    participation = modes.vectors.T @ structure.base_load(UPWARDS)[0]
    effective = participation**2 * structure.mass_scale
    whole = matrices.table.of_direction(matrices.direction)
    total = float(whole @ (matrices.mass @ whole))
    shares = effective[:_MODES] / total if total > 0 else np.zeros(0)
    text = ", ".join(f"{100 * share:.1f}" for share in shares[:6])
    reached = f"{100 * float(shares.sum()):.1f} % in {shares.size} modes"
    return CheckRow("effective_masses", shares.tolist(), f"{text}, … % in {matrices.direction}; {reached}", OK)


def _worst_rows(structure: MatricesStructure) -> CheckRow:
    """Rows with the smallest pivot relative to their diagonal entry, where most digits cancel."""
    factors = structure.factorised_stiffness
    if structure.rigid.shape[1]:
        factors = symmetric_lu(structure.stiffness + 1e-3 * structure.mass, structure.order)
    ratio = np.abs(factors.pivots)
    worst = np.argsort(ratio)[:3]
    rows = np.argmax(np.abs(structure.expansion[:, worst].toarray()), axis=0)
    named = [f"node {structure.table.dofs[i][0]} {structure.table.dofs[i][1]}" for i in rows]
    text = ", ".join(f"{name} ({value:.1g})" for name, value in zip(named, ratio[worst], strict=True))
    values = {name: float(value) for name, value in zip(named, ratio[worst], strict=True)}
    return CheckRow("worst_conditioned_rows", values, text, NOTE if ratio[worst[0]] < 1e-12 else OK)


def _hertz(omega: Floats) -> list[float]:
    return [float(f) for f in omega / (2 * np.pi)]


def _frequencies_text(omega: Floats) -> str:
    return ", ".join(f"{f:.4g}" for f in _hertz(omega)[:8]) + " Hz"
