"""The commented scenario that `beamsim new` writes."""

from __future__ import annotations

from typing import Literal

_BEAM = """\
# A scenario for beamsim. Check it with `beamsim validate`, run it with `beamsim run`.
# A bare number is in SI units; a string may carry any unit: 5 mm, 69 GPa, 2 g, 60 rpm.
title: Cantilever against a one-sided spring

beam:
  length: 270 mm
  width: 50 mm                       # or section: {kind: tube, outer_diameter: 20 mm, wall_thickness: 2 mm}
  thickness: 5 mm                    # in the direction of the motion
  youngs_modulus: 69 GPa
  density: 2700 kg/m^3
  elements: 20
  supports: {left: clamped, right: free}         # clamped, pinned, free, guided
  damping: {kind: modal, ratio: 1 %}             # or rayleigh (mass, stiffness), viscous (coefficient)
  point_masses:                      # anywhere on the beam, such as accelerometers
    - {position: 135 mm, mass: 4.2 g}

snubbers:                            # one-sided springs, any number of them
  - name: tip
    position: 270 mm                 # from the left end
    side: below                      # below resists w < 0, above resists w > 0
    mounted_on: base                 # base moves with the excitation, ground is fixed
    stiffness: 150 kN/m
    damping: {kind: ratio, ratio: 2 %}           # or {kind: viscous, coefficient: 12 N s/m}
    gap: 0 mm                        # > 0 backlash, < 0 prestress; or preload: 1 N instead

gravity: 0 m/s^2                     # 1 g acts downwards, towards w < 0

excitation:
  kind: harmonic                     # or multi_tone, step, half_sine, trapezoid, sawtooth, forces, none
  applied_to: base                   # or {position: 270 mm} for a force
  level: 2 g                         # zero to peak; for the base also 0.2 m/s or 0.1 mm
  frequency: 65 Hz

probes:                              # points whose motion is recorded
  - {name: tip, position: 270 mm}
  - {name: middle, position: 135 mm}

run:
  duration: 0.8 s
  sample_rate: 20 kHz                # of the output only; contact is found exactly
  start: static_equilibrium          # or rest, {mode: 1, amplitude: 1 mm}, ...
  spectrum: {last: 0.4 s, window: hann}

# limits: {peak_force: 50 N, bending_stress: 80 MPa}         # margins in the summary; --check gives exit code 4
# vary:                              # `beamsim sweep` computes every combination (or kind: zip, latin_hypercube)
#   kind: grid
#   parameters:
#     - {path: snubbers.tip.stiffness, values: [100 kN/m, 150 kN/m, 200 kN/m]}
#     - {path: snubbers.tip.gap, from: 0 mm, to: 0.5 mm, points: 6}
"""

_CHAIN = """\
# A scenario for beamsim. Check it with `beamsim validate`, run it with `beamsim run`.
# A bare number is in SI units; a string may carry any unit: 5 g, 2 kN/m, 0.8 rad/s, 60 rpm.
title: Chain of masses with a one-sided stop

chain:
  masses: [1 kg, 1 kg]               # numbered from 1
  springs: [0, 1 N/m, 1 N/m]         # wall to 1, 1 to 2, 2 to wall (one fewer: the last mass is free)
  dashpots: [0, 0.03, 0.03]          # N s/m, parallel to the springs; optional
  # damping: {kind: modal, ratio: 1 %}           # or rayleigh (mass, stiffness), added to the dashpots
  snubbers:                          # one-sided springs, any number of them
    - name: stop
      mass: 1
      side: above                    # above resists displacements > 0, below those < 0
      mounted_on: base               # base moves with the excitation, ground is fixed
      stiffness: 100 N/m
      gap: 1 m                       # > 0 backlash, < 0 prestress; or preload: 1 N instead
      # damping: {kind: viscous, coefficient: 0.1 N s/m}     # or {kind: ratio, ratio: 2 %}
  #   - {name: bumper, between: [1, 2], resists: approach, stiffness: 100 N/m, gap: 0.5 m}     # or separation: a cable
  # springs_to_ground:               # from a mass to the ground: linear, cubic, piecewise_linear
  #   - {mass: 2, kind: cubic, stiffness: 0.5 N/m^3}
  # springs_between:                 # between any two masses; slopes below, between and above the breakpoints
  #   - {masses: [1, 2], kind: piecewise_linear, breakpoints: [-1 m, 1 m], stiffnesses: [2, 1, 0.5]}

gravity: 0 m/s^2                     # 1 g acts towards negative displacement

excitation:
  kind: harmonic                     # or multi_tone, step, half_sine, forces, none
  applied_to: {mass: 2}              # a force; or base, which moves the walls
  level: 0.1 N                       # zero to peak; for the base 2 g, 0.2 m/s or 0.1 mm
  frequency: 0.8 rad/s               # or Hz, rpm

probes:                              # masses whose motion is recorded
  - {name: first, mass: 1}
  - {name: second, mass: 2}

run:
  duration: 200 s
  sample_rate: 10 Hz                 # of the output only; contact is found exactly
  start: rest                        # or static_equilibrium, {displacement: [0, 0.1], velocity: [0, 0]}, ...
  spectrum: {last: 100 s, window: hann}
"""


def template(kind: Literal["beam", "chain"] = "beam") -> str:
    """Return a commented scenario that is valid as it stands."""
    return {"beam": _BEAM, "chain": _CHAIN}[kind]
