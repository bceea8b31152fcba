"""Every command on a beam cut in two and joined, in segments, and imported: the same figures as on the beam itself."""

import json
from functools import cache
from itertools import product

import pytest
import yaml

from tests.helpers.commands import invoke

BEAM = {"width": "50 mm", "thickness": "10 mm", "youngs_modulus": "70 GPa", "density": "2700 kg/m^3"}
DAMPING = {"damping": {"kind": "modal", "ratio": "5 %"}}
FREE = {"supports": {"left": "free", "right": "free"}}
STOP = {"name": "tip", "side": "both", "stiffness": "1 kN/m", "gap": "0.5 mm"}
COMMON = {
    "excitation": {"kind": "harmonic", "applied_to": "base", "level": "1 g", "frequency": "12 Hz"},
    "run": {"duration": "0.2 s", "sample_rate": "2 kHz"},
    "reduction": {"modes": 3},
}
ONE = {
    **COMMON,
    "beam": {**BEAM, **DAMPING, "length": "800 mm", "elements": 8},
    "snubbers": [{**STOP, "position": "100 %"}],
    "probes": [{"name": "end", "position": "800 mm"}],
}
TWO = {
    **COMMON,
    "bodies": {
        "root": {"kind": "beam", **BEAM, **DAMPING, "length": "400 mm", "elements": 4},
        "outer": {"kind": "beam", **BEAM, **DAMPING, **FREE, "length": "400 mm", "elements": 4},
    },
    "joints": [
        {"kind": "rigid", "between": [{"body": "root", "position": "100 %"}, {"body": "outer", "position": "0 %"}]}
    ],
    "snubbers": [{**STOP, "at": {"body": "outer", "position": "100 %"}}],
    "probes": [{"name": "end", "at": {"body": "outer", "position": "400 mm"}}],
}
SEGMENTED = {
    **ONE,
    "beam": {
        **DAMPING,
        "length": "800 mm",
        "elements": 8,
        "segments": [{"from": "0 mm", "to": "400 mm", **BEAM}, {"from": "400 mm", "to": "800 mm", **BEAM}],
    },
}
TIP = {"node": 9, "direction": "z"}
IMPORTED = {
    **COMMON,
    "snubbers": [{**STOP, "at": TIP}],
    "probes": [{"name": "end", "at": TIP}],
}
ALONE = {"convergence": "off"}  # the run of each beam is compared with a finer model
COMMANDS = {
    "run": ("run", {}),
    "swept sine": (
        "sweep",
        {"sweep": {**ALONE, "kind": "swept_sine", "from": "10 Hz", "to": "14 Hz", "rate": "20 Hz/s"}},
    ),
    "stepped sine": (
        "sweep",
        {"sweep": {**ALONE, "kind": "stepped", "from": "10 Hz", "to": "11 Hz", "points": 2, "direction": "up"}},
    ),
    "continuation": (
        "sweep",
        {"sweep": {**ALONE, "kind": "continuation", "from": "10 Hz", "to": "10.3 Hz", "side_branches": "none"}},
    ),
    "harmonic balance": (
        "sweep",
        {
            "sweep": {
                **ALONE, "kind": "continuation", "from": "10 Hz", "to": "10.2 Hz", "side_branches": "none",
                "method": {"kind": "harmonic_balance", "harmonics": 7},
            }
        },
    ),
    "vary": (
        "sweep",
        {"vary": {"kind": "grid", "parameters": [{"path": "snubbers.tip.gap", "values": ["0.5 mm", "1 mm"]}]}},
    ),
    "nnm": (
        "nnm",
        {
            "excitation": {"kind": "none"}, "run": None,
            "nnm": {**ALONE, "mode": 1, "continue_in": {"kind": "energy", "from": "1 mJ", "to": "1.2 mJ"}},
        },
    ),
    "identify-stiffness": (
        "identify-stiffness",
        {"identify_stiffness": {"snubber": "tip.above", "measured_with": ["40 Hz"]}},
    ),
}  # fmt: skip
CHANGING = ("time", "wall", "version", "file", "memory", "error")  # of computing, and round-off


def numbers(value, path=()):
    """Every number of a summary with its path, but those of the computation itself."""
    if isinstance(value, dict):
        for key, item in value.items():
            if not any(word in key for word in CHANGING):
                yield from numbers(item, (*path, key))
    elif isinstance(value, list):
        for index, item in enumerate(value):
            yield from numbers(item, (*path, index))
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        yield path, value


def summary(folder, name, case, command):
    file = folder / f"{name}.yaml"
    file.write_text(yaml.safe_dump({key: value for key, value in case.items() if value is not None}))
    result = invoke(command, file, "-o", folder / f"{name}.h5", "--no-plots", "--json")
    assert result.exit_code == 0, result.output
    return dict(numbers(json.loads(result.stdout)))


def imported(folder):
    """The beam by its matrices, written by export-structure."""
    file = folder / "exported.yaml"
    file.write_text(yaml.safe_dump(ONE))
    result = invoke("export-structure", file, "-o", folder / "beam.op4", "--json")
    assert result.exit_code == 0, result.output
    bodies = yaml.safe_load(json.loads(result.stdout)["body"])["bodies"]
    (section,) = bodies.values()
    return {**IMPORTED, "bodies": {"beam": {**section, **DAMPING}}}


OTHERS = {"cut in two": lambda _: TWO, "in segments": lambda _: SEGMENTED, "imported": imported}


@pytest.fixture(scope="module")
def summaries(tmp_path_factory):
    """Makes the summary of a command on a beam; that of the beam itself is computed once for all the others."""
    folder = tmp_path_factory.mktemp("beams")
    case_of = cache(lambda beam: ONE if beam == "itself" else OTHERS[beam](folder))

    @cache
    def of(name, beam):
        command, more = COMMANDS[name]
        return summary(folder, f"{name} of the beam {beam}", case_of(beam) | more, command)

    return of


PAIRS = [
    *product(("run", "vary"), OTHERS),
    ("swept sine", "imported"), ("stepped sine", "in segments"), ("continuation", "cut in two"),
    ("harmonic balance", "in segments"), ("nnm", "imported"),
    ("identify-stiffness", "in segments"), ("identify-stiffness", "imported"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "other"), [pytest.param(*pair, id=", ".join(pair)) for pair in PAIRS])
def test_the_same_beam_otherwise_gives_the_same_figures(summaries, name, other):
    one, two = summaries(name, "itself"), summaries(name, other)
    skipped = {"sensitivities"}
    if other == "imported":  # which has no finer mesh to compare with, and few coordinates, all of which it is
        skipped |= {"convergence", "error", "convergence_model"}
    common = {path for path in one if path in two and not skipped & set(path)}
    assert len(common) >= 6
    different = {
        path: (one[path], two[path])
        for path in common
        if two[path] != pytest.approx(one[path], rel=1e-6, abs=1e-9)
        and not any(key in ("position", "stiffness_ratio") for key in path)
    }
    assert not different
