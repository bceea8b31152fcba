"""Which of two motions occurs: an oscillator with a stop, started from random states."""

import beamsim

case = beamsim.load_scenario(
    {
        "chain": {
            "masses": [1.0],
            "springs": [1.0, 0.0],
            "dashpots": [0.05, 0.0],
            "snubbers": [{"name": "stop", "mass": 1, "side": "above", "stiffness": 5.0, "gap": 1.0}],
        },
        "excitation": {"kind": "harmonic", "applied_to": {"mass": 1}, "level": 0.15, "frequency": "1.15 rad/s"},
        "probes": [{"name": "mass", "mass": 1}],
        "run": {"duration": 100.0, "sample_rate": 10.0},
        "sweep": {
            "kind": "coexisting",
            "at": ["1.15 rad/s"],
            "starts": {
                "kind": "states",
                "number": 100,
                "seed": 1,
                "box": [{"probe": "mass", "mode": 1, "displacement": [-3.0, 3.0], "velocity": [-3.0, 3.0]}],
            },
        },
    }
)
result = beamsim.coexisting(case)
for motion in result.summary["motions"]:
    peak = motion["peak_displacement_m"]["mass"]
    if motion["stable"]:
        low, high = motion["share_low"], motion["share_high"]
        print(f"peak {peak:.4f} m: {motion['share']:.0%} of the starts ({low:.0%} to {high:.0%} of all)")
    else:
        print(f"peak {peak:.4f} m: unstable, largest multiplier {motion['largest_multiplier']:.3f}")
