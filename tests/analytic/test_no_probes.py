"""Imported models of which only reactions and recovered outputs are wanted: nothing needs a probe."""

import numpy as np
import pytest
import yaml
from scipy.linalg import expm

import beamsim
from beamsim.plots.run import run_figures
from beamsim.plots.sweep import sweep_figures
from beamsim.scenario import load_scenario
from tests.helpers.commands import invoke

OMEGA, PARTICIPATION, MASS, RATIO = 2 * np.pi * np.array([40.0, 97.0]), np.array([1.2, 0.5]), 2.5, 0.01
SKIN, BRACKET = np.array([3e9, 1e9]), np.array([-1.0, 2.0])
LEVEL, DRIVEN = 20.0, 2 * np.pi * 20.0
OUTPUTS = [
    {"name": "foot", "kind": "reaction_force", "support": "base"},
    {"name": "skin", "kind": "recovered", "row": "skin", "unit": "Pa"},
    {"name": "bracket", "kind": "recovered", "row": "bracket", "motion": "acceleration", "unit": "m/s^2"},
]
SINE = {"kind": "harmonic", "applied_to": "base", "level": LEVEL, "frequency": 20.0}


def craig_bampton(folder, interface_alone=True, ratio=RATIO, **sections):
    """Two fixed-interface modes on a statically determinate interface, node 7, and a free node 8 on a spring if wanted.

    The stiffness of such an interface is zero.
    """
    size = 3 if interface_alone else 4
    mass, stiffness = np.zeros((size, size)), np.zeros((size, size))
    mass[0, 0], mass[0, 1:3], mass[1:3, 0] = MASS, PARTICIPATION, PARTICIPATION
    mass[1, 1] = mass[2, 2] = 1.0
    stiffness[1, 1], stiffness[2, 2] = OMEGA**2
    recovery = np.zeros((2, size))
    recovery[:, 1:3] = SKIN, BRACKET
    names = "node,direction,x,y,z\n7,z,0,0,0\n0,modal,,,\n0,modal,,,\n"
    if not interface_alone:
        mass[3, 3], names = 0.3, names + "8,z,0.1,0,0\n"
        stiffness[np.ix_([0, 3], [0, 3])] = 0.3 * (2 * np.pi * 61.0) ** 2 * np.array([[1, -1], [-1, 1]])
    np.savez(folder / "model.npz", m=mass, k=stiffness, r=recovery)
    (folder / "dofs.csv").write_text(names)
    body = {
        "kind": "matrices", "mass": {"file": "model.npz", "name": "m"}, "stiffness": {"file": "model.npz", "name": "k"},
        "recovery": {"file": "model.npz", "name": "r", "rows": ["skin", "bracket"]}, "dofs": "dofs.csv",
        "base": {"nodes": [7]}, "damping": {"kind": "modal", "ratio": ratio},
    }  # fmt: skip
    case = {
        "title": "No probes", "bodies": {"panel": body}, "outputs": OUTPUTS, "excitation": SINE,
        "run": {"duration": 0.3, "sample_rate": 4000, "start": "rest"}, **sections,
    }  # fmt: skip
    (folder / "case.yaml").write_text(yaml.safe_dump(case))
    return load_scenario(folder / "case.yaml")


def closed_form(times):
    """Foot, skin and bracket of the two modes at even times, by the exponential of the modes and the sine together."""
    step = np.zeros((6, 6))  # q, q', and the base's acceleration with its derivative over its frequency
    step[:2, 2:4] = np.eye(2)
    step[2:4, :2], step[2:4, 2:4], step[2:4, 4] = -np.diag(OMEGA**2), -np.diag(2 * RATIO * OMEGA), -PARTICIPATION
    step[4, 5], step[5, 4] = DRIVEN, -DRIVEN
    forward, states = expm(step * times[1]), [np.array([0, 0, 0, 0, 0, LEVEL])]
    for _ in times[1:]:
        states.append(forward @ states[-1])
    x = np.array(states)
    modes = (x @ step.T)[:, 2:4]  # accelerations
    return {"foot": MASS * x[:, 4] + modes @ PARTICIPATION, "skin": x[:, :2] @ SKIN, "bracket": modes @ BRACKET}


@pytest.mark.parametrize("settings", [{}, {"method": "reference"}, {"low_pass": 500.0}])
def test_outputs_of_the_modes_alone(tmp_path, settings):
    given = {"duration": 0.3, "sample_rate": 4000, "start": "rest", **settings}
    result = beamsim.run(craig_bampton(tmp_path, run=given))
    tolerance = 1e-5 if settings.get("method") else 1e-11
    for name, known in closed_form(result["histories"]["time"].values).items():
        assert (
            np.abs(result["histories"]["output_value"].sel(output=name).values - known).max()
            <= tolerance * np.abs(known).max()
        ), name
        assert result.summary["peak_output"][name] >= np.abs(known).max() * (1 - tolerance)
    assert not result["histories"].labels("probe")
    assert result.complete
    assert sorted(run_figures(result)) == ["outputs", "spectrum"]


def test_swept_response_of_the_modes_alone(tmp_path):
    """A slow sweep far from the resonances reaches the steady amplitude."""
    sweep = {"kind": "swept_sine", "from": 18.0, "to": 22.0, "rate": "0.05 Hz/s", "levels": [LEVEL]}
    result = beamsim.sweep(craig_bampton(tmp_path, sweep=sweep))
    curve = next(iter(result.curves.values()))
    omega = 2 * np.pi * curve.frequency_hz[:, None]
    modes = PARTICIPATION**2 * omega**2 / (OMEGA**2 - omega**2 + 2j * RATIO * OMEGA * omega)
    foot = LEVEL * np.abs(MASS + modes.sum(axis=1))
    settled = curve.frequency_hz > 20.0  # 30 time constants of the first mode after the start
    assert np.abs(curve.channel("output", "foot").peak / foot - 1)[settled].max() < 2e-3
    assert sorted(sweep_figures(result)) == ["outputs"]


@pytest.mark.parametrize(
    "excitation",
    [
        {"kind": "half_sine", "applied_to": "base", "level": 200.0, "duration": 0.011},
        {"kind": "random", "applied_to": "base", "seed": 3, "psd": [
            {"frequency": 10.0, "density": 1.0}, {"frequency": 200.0, "density": 1.0}]},
    ],
)  # fmt: skip
def test_a_probe_changes_no_output(tmp_path, excitation):
    """Outputs of a run with a probe at a free node and without; response spectra of the input and outputs stay."""
    place = {"at": {"node": 8, "direction": "z"}}
    run = {"duration": 0.5, "sample_rate": 4000, "convergence": "off", "srs": {"from": 10.0, "to": 200.0}}
    results = []
    for number, sections in enumerate(({"probes": [{"name": "free", **place}]}, {})):
        folder = tmp_path / str(number)
        folder.mkdir()
        results.append(beamsim.run(craig_bampton(folder, False, excitation=excitation, run=run, **sections)))
    with_probe, without = results
    assert with_probe["histories"].labels("probe") == ["free"]
    assert not without["histories"].labels("probe")
    for name in with_probe["histories"].labels("output"):
        assert (
            np.abs(
                without["histories"]["output_value"].sel(output=name).values
                - with_probe["histories"]["output_value"].sel(output=name).values
            ).max()
            <= 1e-12 * np.abs(with_probe["histories"]["output_value"].sel(output=name).values).max()
        )
    assert without.summary["peak_output"] == pytest.approx(with_probe.summary["peak_output"], rel=1e-12)
    assert set(without["srs"].labels("signal")) < set(with_probe["srs"].labels("signal"))


def test_every_command(tmp_path):
    """Run, print, plot, store, export, report and vary; an animation of a model without free nodes says why not."""
    craig_bampton(tmp_path, limits={"outputs": {"foot": 70.0}})
    case, file = str(tmp_path / "case.yaml"), str(tmp_path / "case.h5")
    shown = invoke("run", case, "-o", file).output
    assert "peaks of outputs: foot" in shown
    assert {"case_outputs.png", "case_spectrum.png"} <= {each.name for each in tmp_path.glob("*.png")}
    assert "68.65 N" in invoke("info", file).output
    invoke("export", file, "-o", str(tmp_path / "case.csv"))
    invoke("report", file, "-o", str(tmp_path / "case.html"))
    assert "foot reaction force" in invoke("compare", file, file, "-o", str(tmp_path)).output
    refused = invoke("animate", file, "--open-files").output
    assert "holds no motion of places" in refused
    craig_bampton(tmp_path, vary={"kind": "grid", "parameters": [
        {"path": "excitation.frequency", "from": 18.0, "to": 22.0, "points": 2}]})  # fmt: skip
    assert "foot peak output" in invoke("sweep", case, "-o", file, "--no-plots").output


def test_a_cubic_spring_without_probes(tmp_path):
    """A continued motion where nothing names a probe has the peak of the motion that time stepping settles to."""
    spring = {"name": "s", "at": {"node": 8, "direction": "z"}, "kind": "cubic", "stiffness": 1e9}
    sections = {"springs_to_ground": [spring], "excitation": {**SINE, "level": 5.0}, "run": None}
    sweep = {"kind": "continuation", "from": 20.0, "to": 20.1}
    result = beamsim.continuation(craig_bampton(tmp_path, False, 0.1, **sections, sweep=sweep))
    assert result.complete
    peak = np.max([np.abs(result["points"][f"output_{of}imum"].sel(output="foot").values) for of in ("max", "min")], 0)
    begin = {"duration": 0.35, "sample_rate": 2000, "convergence": "off"}  # eight time constants
    run = beamsim.run(craig_bampton(tmp_path, False, 0.1, **(sections | {"run": begin})))
    assert np.abs(run["histories"]["output_value"].sel(output="foot").values[-200:]).max() == pytest.approx(
        peak[0], rel=1e-3
    )
