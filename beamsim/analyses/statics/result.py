"""Result of ``beamsim static``."""

from __future__ import annotations

from dataclasses import dataclass

from beamsim.labelled import Layout, Variable
from beamsim.results.result import CONVERGENCE, MARGINS, OF_MODES, PROCESSOR_TIME, STATUS, Result
from beamsim.results.values import BY_ENTRY, VALUES
from beamsim.summaries import ByName, Entry, Flag, Text, by_name
from beamsim.system.structural import MODES

NOTHING_ACTS = "nothing acts on the structure at rest: give gravity, constant_forces, or a preload or negative gap"
_SNUBBER, _SUPPORT, _MODE = ("snubber",), ("support",), ("mode",)
EQUILIBRIUM = Layout(
    "equilibrium",
    "Static equilibrium under weight and dead loads, and natural frequencies about it.",
    {
        "snubber": Variable(_SNUBBER, "1", "name of the snubber", str),
        "side": Variable(_SNUBBER, "", "below or above; between two places approach or separation", str),
        "snubber_position": Variable(
            _SNUBBER, "", "position along its body, m; number of the mass or node where a body has no length"
        ),
        "snubber_position_y": Variable(_SNUBBER, "m", "on a plate the y, from its bottom edge", optional=True),
        "gap": Variable(_SNUBBER, "{gap_unit}", "clearance of the undeformed structure; negative where it is pressed"),
        "touches": Variable(_SNUBBER, "", "whether it touches", bool, flags=("open", "touches")),
        "force": Variable(_SNUBBER, "{force_unit}", "contact force"),
        "gap_left": Variable(_SNUBBER, "{gap_unit}", "distance to its face; 0 where it touches"),
        "snubber_displacement": Variable(_SNUBBER, "{gap_unit}", "deflection of the structure at the snubber"),
        "probe": Variable(("probe",), "1", "name of the probe", str),
        "displacement": Variable(("probe",), "m", "deflection at the probe"),
        "support": Variable(_SUPPORT, "1", "name of the support, with its direction", str),
        "reaction": Variable(
            _SUPPORT, "{reaction_unit}", "force or moment of the support on the structure; NaN where statics alone "
            "does not determine it",
        ),
        "friction": Variable(("friction",), "1", "name of the friction contact", str),
        "friction_force": Variable(("friction",), "{friction_unit}", "friction force that is assumed at rest"),
        "mode": Variable(_MODE, "1", "mode number", int),
        "stuck_frequencies_hz": Variable(
            _MODE, "Hz", "natural frequencies with the contacts as they rest and all friction stuck; NaN where rigid "
            "friction leaves no further mode",
        ),
        "sliding_frequencies_hz": Variable(
            _MODE, "Hz", "natural frequencies with the contacts as they rest and all friction sliding"
        ),
        "station": Variable(("station",), "1", "number of the station, as in modes", int),
        "deflection": Variable(("station",), "m", "deflection at the station"),
        "direction": Variable(("direction",), "1", "axis of a displacement", str),
        "deflection_in_space": Variable(
            ("station", "direction"), "m", "displacement of the station along x, y and z; NaN on bodies that are not "
            "in space", optional=True,
        ),
    },
)  # fmt: skip


@dataclass(frozen=True, kw_only=True, repr=False)
class StaticResult(Result):
    """Result of `beamsim.static`: contacts, deflections, reactions, and natural frequencies at static equilibrium.

    Examples
    --------
    >>> import beamsim
    >>> case = {"chain": {"masses": ["2 kg"], "springs": ["1 kN/m"]}, "gravity": "9.81 m/s^2"}
    >>> stop = {"name": "floor", "at": {"mass": 1}, "side": "below", "gap": "5 mm", "stiffness": "4 kN/m"}
    >>> result = beamsim.static(case | {"snubbers": [stop]})
    >>> result["equilibrium"]["touches"].values.tolist(), round(result.summary["static_force_n"]["floor"], 3)
    ([True], 11.696)
    >>> {name: round(force, 3) for name, force in result.summary["reaction_n"].items()}
    {'left': 7.924}
    """

    KIND = "static"
    SUMMARY = (
        STATUS,
        Entry("touching", "", "by snubber, whether it touches at static equilibrium", "snubbers", form=by_name(Flag)),
        BY_ENTRY["static_force_n"].summary_entry(),
        BY_ENTRY["static_moment_n_m"].summary_entry(),
        Entry("gap_m", "m", "clearance of a snubber, resolved where a preload was given", "snubbers", form=ByName),
        Entry("gap_rad", "rad", "clearance of a stop of a hinge at the angle zero", "snubbers", form=ByName),
        *(value.summary_entry("of the structure at rest: ") for value in VALUES if value.from_extreme),
        Entry("output_unit", "", "units of the outputs", form=dict[str, Text]),
        BY_ENTRY["largest_bending_stress_position_m"].summary_entry(),
        Entry("largest_bending_stress_y_m", "m", "on a plate the y coordinate", "bodies"),
        Entry("largest_bending_stress_body", "", "body on which it is, if there are several", "bodies", form=Text),
        BY_ENTRY["reaction_n"].summary_entry(),
        BY_ENTRY["reaction_moment_n_m"].summary_entry(),
        Entry("stuck_frequencies_hz", section="at rest", variable="equilibrium/stuck_frequencies_hz",
              shown="kept_modes"),
        Entry("sliding_frequencies_hz", section="at rest", variable="equilibrium/sliding_frequencies_hz",
              shown="kept_modes"),
        MARGINS,
        *OF_MODES,
        *CONVERGENCE,
        PROCESSOR_TIME,
    )  # fmt: skip
    DATASETS = (EQUILIBRIUM, MODES)
