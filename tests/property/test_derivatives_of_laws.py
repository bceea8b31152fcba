"""The transition matrix and the derivative by the frequency of every contact law, against differences of the motion."""

from typing import NamedTuple

import numpy as np
import pytest

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.pads import ForceCurve, MaxwellBranch, no_tension, recovering_law
from beamsim.contacts.sliders import (
    falling_friction_law,
    friction_law,
    hardening_law,
    pressed_friction_law,
    rigid_friction_law,
    unloading_law,
)
from beamsim.flow.periodic_flow import Frequency, PeriodicForcing
from beamsim.flow.variational import VariationalFlow
from beamsim.system.equations import PiecewiseLinearSystem

OMEGA, STATIC, SLIDING, STOP = 1.3, 0.4, 0.3, 50.0
CURVE = ForceCurve(np.array([0.0, 0.1, 0.25, 0.4]), np.array([0.0, 1.5, 6.0, 9.0]))
LEVEL = ForceCurve(np.array([0.0, 0.05, 0.3, 0.5]), np.array([0.0, 2.0, 2.0, 9.0]))
LOW = ForceCurve(np.array([0.0, 0.2, 0.4]), np.array([0.0, 1.0, 9.0]))
LINE = ForceCurve(np.array([0.0, 1.0]), np.array([0.0, 20.0]))
SOFT = ForceCurve(np.array([0.0, 0.1, 0.3]), np.array([0.0, 2.0, 9.0]))
TWO = (MaxwellBranch(20.0, 0.15), MaxwellBranch(5.0, 1.0))
START = (0.03, 0.0, 0.3, -0.1)
RUBS = pressed_friction_law(20.0, STATIC, SLIDING)


class Case(NamedTuple):
    """A structure with contacts, its start or how long it moves from rest before, and what it goes through then."""

    laws: tuple
    start: tuple | float
    duration: float
    events: int
    shape: tuple = ((1.0, 0.4),)
    sign: tuple = (-1.0,)
    gap: tuple = (0.05,)
    pressed_by: tuple | None = None
    stiffness: tuple = (1.0, 9.0)
    damping: tuple = (0.05, 0.1)
    load: tuple = (-2.0j, -1.2j)
    late: float = 0.0
    phases: int = 2  # of each contact

    def flow(self, omega=OMEGA):
        count = len(self.laws)
        contacts = Contacts(
            np.array(self.shape), np.array(self.sign), np.array(self.gap), np.zeros(count, dtype=bool), self.laws,
            pressed_by=None if self.pressed_by is None else np.array(self.pressed_by),
        )  # fmt: skip
        damping = np.diag(self.damping)
        system = PiecewiseLinearSystem(np.array(self.stiffness), damping, contacts, np.zeros(len(self.stiffness)))
        force = np.array([self.load])
        return VariationalFlow(system, PeriodicForcing(np.array([1]), force, *STILL, OMEGA), omega, 1.0)


STILL = np.zeros(1), np.zeros((1, 0), dtype=complex), np.zeros(1)  # the base
PERIOD = 2 * np.pi / OMEGA


def pad(curve, dashpot, branches):
    start = (*START, *([0.0] * (dashpot > 0)), *[0.02] * len(branches))
    return Case((recovering_law(curve, dashpot, branches),), start, 9.0, 3)


def rubbing(law, dashpot=0.0, late=1.0):
    return Case(
        (no_tension(STOP, dashpot), law), 5 * PERIOD + late + 1e-9, 3 * PERIOD, 9, ((-1.0, 0.2), (0.3, 1.0)),
        (1.0, -1.0), (-0.05, 0.0), (-1, 0) if law.needs_normal_contact else None, (1.0, 3.0),
        (0.02, 0.05), (0.6 - 0.1j, 0.5j), late,
    )  # fmt: skip


SLIDES = {
    "pressed": (pressed_friction_law(None, STATIC, SLIDING),),
    "pressed, beside a dashpot": (pressed_friction_law(None, STATIC, SLIDING), 0.5),
    "pressed, spring": (RUBS,),
    "constant force": (rigid_friction_law(0.3, 0.2),),
    "one coefficient": (rigid_friction_law(0.2, 0.2),),
    "falling with speed": (falling_friction_law(0.3, 0.2, 0.1),),
}
CASES = {
    "table and dashpot": pad(CURVE, 0.8, ()),
    "branch": pad(LINE, 0.0, TWO[:1]),
    "table and branches": pad(CURVE, 0.0, TWO),
    "table, dashpot, branches": pad(CURVE, 0.5, TWO),
    "level table": pad(LEVEL, 0.3, TWO[1:]),
    "hardening": Case((hardening_law(20.0, 0.6, 2.0, 0.3),), (*START, 0.01), 9.0, 5),
    "crushed": Case((unloading_law(CURVE, 60.0, None, 0.3),), (*START, 0.01), 20.0, 5),
    "recovering": Case((unloading_law(CURVE, 60.0, LOW),), (*START, 0.0), 20.0, 8),
    "friction behind springs": Case(
        (friction_law(40.0, 0.3, 0.2), friction_law(10.0, 0.2, 0.2)), (0.05, 0.0, 0.3, -0.1, 0.05, 0.015), 7.0, 8,
        ((1.0, 0.4), (0.3, -1.0)), (-1.0, -1.0), (0.0, 0.0), load=(-1.0j, -0.6j),
    ),
    **{name: rubbing(*given) for name, given in SLIDES.items()},
    # a pad with a table and a branch, a stop that yields, and friction under the force of each
    "together": Case(
        (recovering_law(SOFT, 0.0, [MaxwellBranch(8.0, 0.3)]), hardening_law(20.0, 2.5, 1.0), RUBS, RUBS),
        12.0 - 1e-9, 12.0, 9,
        ((-1.0, 0.2, 0.1), (0.1, -1.0, 0.3), (0.3, 0.4, 1.0), (0.5, -0.2, 0.8)), (1.0, 1.0, -1.0, -1.0),
        (-0.05, 0.02, 0.0, 0.0), (-1, -1, 0, 1), (1.0, 3.0, 6.0), (0.1, 0.15, 0.2), (1.2 - 0.2j, 1.0j, 0.8), 12.0, 3,
    ),
}  # fmt: skip
CASES |= {f"{name}, from another phase": rubbing(*given, late=0.0) for name, given in SLIDES.items()}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_derivatives_of_a_passage(case):
    flow, h, start = case.flow(), 1e-6, case.start
    if isinstance(start, float):  # whatever the contacts do then
        start = flow.flow_map(np.zeros(flow.size), start).end
    flow_map = flow.flow_map(np.array(start), case.duration, (Frequency(),), case.late)
    assert flow_map.event_time.size >= case.events
    assert min(len(set(column)) for column in flow_map.phases.T.tolist()) >= case.phases

    def end(moved=0.0, omega=0.0):
        other = case.flow(OMEGA + omega) if omega else flow
        return other.flow_map(np.array(start) + moved, case.duration, (), case.late).end

    by_difference = np.array([(end(h * row) - end(-h * row)) / (2 * h) for row in np.eye(flow.size)]).T
    by_frequency = (end(omega=h) - end(omega=-h)) / (2 * h)
    np.testing.assert_allclose(flow_map.transition, by_difference, atol=1e-7 * np.abs(by_difference).max())
    np.testing.assert_allclose(flow_map.parameters[:, 0], by_frequency, atol=1e-7 * np.abs(by_frequency).max())
