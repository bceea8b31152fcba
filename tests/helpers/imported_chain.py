"""A chain of equal masses as imported matrices, pushed by a sine at its end."""

import numpy as np
from scipy.io import mmwrite
from scipy.sparse import coo_array


def imported_chain(folder, count):
    """Write mass, stiffness and nodes of so many masses of 1 kg between walls, and return a case with a probe."""
    stiffness = 4e5 * (2.0 * np.eye(count) - np.eye(count, k=1) - np.eye(count, k=-1))
    for name, matrix in (("k", stiffness), ("m", np.eye(count))):
        mmwrite(folder / f"{name}.mtx", coo_array(matrix))
    nodes = "".join(f"{k},z,{k},0,0\n" for k in range(1, count + 1))
    (folder / "dofs.csv").write_text(f"node,direction,x,y,z\n{nodes}")
    end = {"body": "panel", "node": count, "direction": "z"}
    return {
        "bodies": {"panel": {
            "kind": "matrices", "mass": {"file": "m.mtx"}, "stiffness": {"file": "k.mtx"}, "dofs": "dofs.csv",
            "base": "free", "damping": {"kind": "modal", "ratio": 0.02},
        }},
        "probes": [{"name": "end", "at": end}], "run": {"duration": 0.2},
        "excitation": {"kind": "harmonic", "applied_to": end, "level": "50 N", "frequency": "6 Hz"},
    }  # fmt: skip
