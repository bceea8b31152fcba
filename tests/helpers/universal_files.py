"""Data sets of universal files as text, written apart from pyuff, which writes some function types alone."""

import numpy as np

TAG = "    -1\n"


def function(y, **given):
    """A data set 58 in ASCII, evenly spaced: by default the acceleration of node 1 in +Z over time.

    Parameters
    ----------
    y : (n,) values, real or complex.
    given : fields that differ from `DEFAULTS`; ``count`` is the stated number of samples.
    """
    of = {**DEFAULTS, "count": np.size(y), **given}
    y = np.asarray(y)
    numbers = y.view(float) if np.iscomplexobj(y) else y.astype(float)
    rows = ["".join(f"{v:13.5E}" for v in numbers[k : k + 6]) for k in range(0, numbers.size, 6)]

    def described(part):
        kind, label, unit, *exponents = of[part]
        length, force = exponents or (0, 0)
        return f"{kind:10d}{length:5d}{force:5d}{0:5d} {label:<20s} {unit:<20s}"

    header = [
        "    58",
        *(f"{text:<80s}" for text in (of["name"], "NONE", "28-Nov-24 10:00:00", "NONE", "NONE")),
        f"{of['kind']:5d}{0:10d}{0:5d}{0:10d} {'NONE':<10s}{of['node']:10d}{of['direction']:4d} {'NONE':<10s}"
        f"{of['over_node']:10d}{of['over_direction']:4d}",
        f"{5 if np.iscomplexobj(y) else 2:10d}{of['count']:10d}{1:10d}{of['begin']:13.5E}{of['step']:13.5E}{0:13.5E}",
        *(described(part) for part in ("axis", "values", "over", "z")),
    ]
    return TAG + "\n".join([*header, *rows]) + "\n" + TAG


DEFAULTS = {
    "name": "acc", "kind": 1, "node": 1, "direction": 3, "over_node": 0, "over_direction": 0, "begin": 0.0,
    "step": 1e-3, "axis": (17, "Time", "s"), "values": (12, "Acceleration", "m/s^2"), "over": (0, "NONE", "NONE"),
    "z": (0, "NONE", "NONE"),
}  # fmt: skip
OVER_FREQUENCY = {"axis": (18, "Frequency", "Hz"), "begin": 20.0, "step": 0.25}
NO_LABEL = "NONE"


def units(length=1.0, force=1.0):
    """A data set 164: how many units of the file are one SI unit."""
    numbers = f"{length:25.17E}{force:25.17E}{1.0:25.17E}\n{0.0:25.17E}\n".replace("E", "D")
    return f"{TAG}   164\n{9:10d}{'any':<20s}{2:10d}\n{numbers}{TAG}"


def amplitudes(number):
    """A data set 1858: 1 half-peak, 2 peak, 3 RMS."""
    record = "".join(f"{v:12d}" for v in (1, 0, 0, 0, 0, 0)) + "\n"
    record += "".join(f"{v:6d}" for v in (0, 0, number, *[0] * 9)) + "\n"
    record += 3 * ("".join(f"{0.0:15.7E}" for _ in range(5)) + "\n")
    return f"{TAG}  1858\n{record}{'NONE  NONE':<80s}\n{'NONE':<80s}\n{TAG}"


def shapes_55(frequency, *columns, kind=2, values=(8, 2), count=3, nodes=(1, 2, 3, 4, 5)):
    """A data set 55 as text: values of each node by component, real or complex."""
    complex_values = any(np.iscomplexobj(column) for column in columns)
    of_kind = "".join(f"{v:13.5E}" for v in ((frequency, 1, 0.01, 0) if kind == 2 else (
        -0.01 * 2 * np.pi * frequency, 2 * np.pi * frequency, 1, 0, 1, 0)))  # fmt: skip
    header = f"         1{kind:10d}{values[1]:10d}{values[0]:10d}{5 if complex_values else 2:10d}{count:10d}"
    rows = []
    for number, row in zip(nodes, np.column_stack(columns), strict=True):
        parts = row.astype(complex).view(float) if complex_values else row
        rows += [f"{number:10d}", "".join(f"{v:13.5E}" for v in parts)]
    names = "\n".join(5 * ["NONE"])
    return f"{TAG}    55\n{names}\n{header}\n{2:10d}{4 if kind == 2 else 6:10d}{1:10d}{1:10d}\n{of_kind}\n" + "\n".join(
        rows
    ) + f"\n{TAG}"  # fmt: skip


def nodes_2411(places):
    """A data set 2411: nodes 1, 2, ... at places along the x axis."""
    rows = (f"{k:10d}{1:10d}{1:10d}{11:10d}\n" + "".join(f"{v:25.16E}" for v in (x, 0.0, 0.0)).replace("E", "D")
            for k, x in enumerate(places, 1))  # fmt: skip
    return f"{TAG}  2411\n" + "\n".join(rows) + f"\n{TAG}"
