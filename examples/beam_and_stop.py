"""A cantilever that is shaken against a stop: peak force, impacts, and how sure the numbers are."""

import beamsim

case = beamsim.load_scenario(
    {
        "beam": {
            "length": "300 mm",
            "width": "40 mm",
            "thickness": "4 mm",
            "youngs_modulus": "70 GPa",
            "density": "2700 kg/m^3",
            "damping": {"kind": "modal", "ratio": "1 %"},
        },
        "snubbers": [{"name": "stop", "position": "300 mm", "side": "below", "stiffness": "100 kN/m", "gap": "0.2 mm"}],
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": "2 g", "frequency": "40 Hz"},
        "run": {"duration": "0.5 s"},
    }
)
result = beamsim.run(case)
summary = result.summary
print(f"peak force {summary['peak_force_n']['stop']:.4g} N in {summary['contacts']['stop']} contacts")
print(f"largest tip displacement {1e3 * summary['max_displacement_m']['stop']:.4g} mm upwards")
print(result.status)
