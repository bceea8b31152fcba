"""A stop with a law of one's own: Hertz's contact of a ball, as a table of points that the solver follows exactly."""

import numpy as np

import beamsim

STIFFNESS = 2e9  # N/m^1.5


def hertz(penetration):
    """Force of a ball that is pressed on a plate, in N."""
    return STIFFNESS * penetration**1.5


def peak_force(points):
    """Peak force of a mass of 0.1 kg that meets the stop at 1 m/s, with the law in so many points."""
    penetration = np.linspace(0.0, 1.0, points) ** 1.5 * 3e-4  # m; denser where the slope changes most
    stop = beamsim.Contact(row=[1.0], law=np.column_stack([penetration, hertz(penetration)]), name="stop")
    ball = beamsim.System(mass=[[0.1]], stiffness=[[0.0]], contacts=[stop])
    result = beamsim.simulate(ball, 2e-3, start=([0.0], [1.0]), sample_rate=1e5)
    return result.summary["peak_force_n"]["stop"]


# all kinetic energy is in the spring where the mass turns: m v^2 / 2 = 2/5 K d^(5/2)
exact = hertz((1.25 * 0.1 / STIFFNESS) ** 0.4)
peaks = {points: peak_force(points) for points in (10, 20, 40)}
for points, peak in peaks.items():
    print(f"{points} points: {peak:.6g} N, {peak / exact - 1:+.2%} of Hertz's {exact:.6g} N")
