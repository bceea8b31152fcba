"""A rod of 40 finite elements, assembled with NumPy, that meets a stop at its tip: contact time against theory."""

import numpy as np

import beamsim

N, LENGTH, MODULUS, DENSITY, AREA = 40, 1.0, 2.1e11, 7800.0, 4e-4  # elements, m, Pa, kg/m^3, m^2
h = LENGTH / N
mass, stiffness = np.zeros((N + 1, N + 1)), np.zeros((N + 1, N + 1))
for element in range(N):
    ends = np.ix_([element, element + 1], [element, element + 1])
    mass[ends] += DENSITY * AREA * h / 6 * np.array([[2, 1], [1, 2]])
    stiffness[ends] += MODULUS * AREA / h * np.array([[1, -1], [-1, 1]])

tip = np.eye(N + 1)[N]
wall = beamsim.Contact(row=tip, law=1e11, gap=0.0, name="wall")
rod = beamsim.System(mass, stiffness, contacts=[wall], outputs={"tip": tip, "end": np.eye(N + 1)[0]})
motion = beamsim.simulate(rod, 6e-4, start=(np.zeros(N + 1), np.ones(N + 1)), sample_rate=1e6)
events = motion["events"]["time"].values
wave = np.sqrt(MODULUS / DENSITY)  # m/s
print(f"contact lasts {1e3 * (events[-1] - events[0]):.4f} ms; the wave needs {1e3 * 2 * LENGTH / wave:.4f} ms")
