"""The shipped design studies, each with fewer cases and a shorter run."""

import numpy as np
import pytest
from scipy.stats import spearmanr
from shipped import config_path, shipped

import beamsim
from beamsim.analyses.studies.plan import design
from beamsim.trust.studies import design_study
from tests.helpers.solved import words_of


def shortened(path, count=3):
    vary = shipped(path).vary
    changes = {"run.duration": "0.1 s", "run.spectrum.last": "0.05 s"}
    if getattr(vary, "tolerances", None):
        changes |= {"vary.tolerances.samples": 3, "vary.tolerances.quantile": 0.5}
    if vary.kind == "latin_hypercube":
        changes["vary.samples"] = 4
    for index, parameter in enumerate(vary.parameters):
        if getattr(parameter, "points", 0) > count:
            changes[f"vary.parameters[{index}].points"] = count
    return beamsim.load_scenario(path, changes)


def solved_study(solve, name):
    """The result of a shipped study as it stands, whose screen a document quotes."""
    return beamsim.load(solve(*words_of("sweep", config_path(name))).file)


def test_a_spring_nearer_to_the_tip_raises_the_first_closed_frequency_up_to_a_maximum():
    """Proposition 1.3.1 of the thesis: the frequency moves with the square of the mode shape at the spring."""
    scenario = shortened(config_path("spring_position"), 7)
    result = design_study(scenario, workers=1)
    grid = {name: of.values.reshape(*result.shape, -1) for name, of in result.responses.items()}
    closed = grid["closed_frequencies_hz"][:, 0, :2]
    opened = grid["open_frequencies_hz"][:, 0, :2]
    assert np.all(closed[:, 0] > opened[:, 0])
    assert closed[:, 0].argmax() not in (0, 6)
    assert np.all(np.diff(closed[:4, 0]) > 0)
    node = 0.783 * 0.27  # of the second mode of a cantilever
    nearest = np.abs(np.unique(result.table["snubbers.tip.position"]) - node).argmin()
    assert (closed[:, 1] - opened[:, 1]).argmin() in (nearest - 1, nearest, nearest + 1)
    np.testing.assert_allclose(grid["closed_frequencies_hz"].std(axis=1)[..., 0], 0.0, atol=1e-9)


def test_homogeneity_in_the_tolerance_study_of_zero_gap():
    """With no gap doubling the level doubles every force exactly, in every case of a sample."""
    changes = {
        "run.duration": "0.1 s",
        "run.spectrum": {"last": "0.05 s"},
        "vary": {
            "kind": "latin_hypercube",
            "samples": 3,
            "parameters": [{"path": "snubbers.tip.stiffness", "tolerance": "20 %"}],
        },
    }
    path = config_path("design_tolerances")
    one = design_study(beamsim.load_scenario(path, changes), workers=1)
    two = design_study(beamsim.load_scenario(path, changes | {"excitation.level": "4 g"}), workers=1)
    force = "snubbers/tip/peak_force"
    np.testing.assert_allclose(two.responses[force].values, 2.0 * one.responses[force].values, rtol=1e-9)
    assert np.ptp(one.responses[force].values) > 0.0


def test_both_populations_of_the_sample_are_motions_of_one_part(solve):
    """The part with the largest force of the lower population has the higher motion, too, if released far away."""
    result = solved_study(solve, "design_two_motions")
    force = result.table["snubbers/tip/peak_force"]
    low, high = result.summary["responses"]["snubbers/tip/peak_force"]["populations"]
    assert low["cases"] + high["cases"] == 100
    assert low["largest"] < 40.0 < high["smallest"]
    assert result.summary["probability"]["share"] == low["cases"] / 100
    assert spearmanr(
        result.table["snubbers.tip.gap"], result.table["snubbers.tip.stiffness"]
    ).statistic == pytest.approx(0.6, abs=0.05)
    case = int(np.flatnonzero(force == low["largest"])[0])
    part = {p.path: float(p.values[case]) for p in result.parameters}
    late = {}
    for name, start in {"at rest": "static_equilibrium", "far away": {"mode": 1, "amplitude": "2.5 mm"}}.items():
        changes = {"vary": None, **part, "run.start": start, "run.duration": "2.5 s"}
        run = beamsim.run(beamsim.load_scenario(config_path("design_two_motions"), changes))
        late[name] = (
            run["histories"]["snubber_force"].sel(snubber="tip").values[run["histories"]["time"].values > 2.0].max()
        )
    assert late["at rest"] == 0.0  # it strikes only at the start
    assert high["smallest"] < late["far away"] < high["largest"]


def test_a_tolerance_alone_is_the_run_with_it(solve):
    result = solved_study(solve, "design_tornado")
    swing = result.summary["sensitivity"]["snubbers/tip/peak_force"]["snubbers.tip.gap"]
    for end in ("smallest", "largest"):
        changes = {"vary": None, "snubbers.tip.gap": swing[f"{end}_at"], "run.convergence": "off"}
        run = beamsim.run(beamsim.load_scenario(config_path("design_tornado"), changes))
        assert run.summary["peak_force_n"]["tip"] == pytest.approx(swing[end], rel=1e-12)
    assert abs(swing["smallest_at"]) == abs(swing["largest_at"]) == 5e-5


def test_the_design_point_of_a_probability_is_at_the_limit_and_the_first_order_agrees(solve):
    pytest.importorskip("openturns")
    result = solved_study(solve, "exceedance")
    of = result.summary["reliability"]
    assert result.complete
    assert 3e-5 < of["low"] < of["probability"] < of["high"] < 3e-4
    assert beamsim.run(design(result.scenario, {"parameters": of["design_point"]})).summary["peak_force_n"][
        "tip"
    ] == pytest.approx(28.0, rel=1e-3)
    changes = {"vary.method": "form"}
    first = beamsim.design_study(beamsim.load_scenario(config_path("exceedance"), changes)).summary["reliability"]
    assert first["distance"] == pytest.approx(of["distance"], abs=1e-3)
    assert of["low"] / 1.3 < first["probability"] < 1.3 * of["high"]


# --- searches ---------------------------------------------------------------------------------------------------------


def test_the_chosen_snubber_hits_less_hard_and_keeps_the_limits(solve):
    """The best design alone gives what the search says of it."""
    result = solved_study(solve, "optimise_snubber")
    best, first = result.summary["best"][0], result.summary["as_it_is"]
    assert best["value"] < 0.75 * first["value"]
    assert best["parameters"]["pad"] == "damping rubber"
    alone = beamsim.run(design(result.scenario, result.summary["best"][0])).summary
    assert alone["peak_force_n"]["tip"] == pytest.approx(best["value"], rel=1e-9)
    assert alone["peak_displacement_m"]["tip"] < 0.8e-3
    assert [item["verdict"] for item in result.summary["margins"].values()] == ["ok", "ok"]


def integrated(gap, stiffness, steps=800, duration=0.4):
    """Largest forces and displacements of shaken masses with a stop, all at once, by the method of Runge and Kutta."""

    def rates(t, x, v):
        contact = stiffness * np.maximum(-x - gap, 0.0)
        return v, -8.0 * np.sin(2 * np.pi * 9.0 * t) - 4e3 * x - 6.0 * v + contact

    step, x, v, lowest, highest = duration / steps, *np.zeros((4, gap.size))
    for t in np.arange(steps) * step:
        v1, a1 = rates(t, x, v)
        v2, a2 = rates(t + step / 2, x + step / 2 * v1, v + step / 2 * a1)
        v3, a3 = rates(t + step / 2, x + step / 2 * v2, v + step / 2 * a2)
        v4, a4 = rates(t + step, x + step * v3, v + step * a3)
        x, v = x + step / 6 * (v1 + 2 * v2 + 2 * v3 + v4), v + step / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
        lowest, highest = np.minimum(lowest, x), np.maximum(highest, x)
    return stiffness * np.maximum(-lowest - gap, 0.0), np.maximum(highest, -lowest)


def test_a_search_finds_in_600_cases_what_a_grid_of_10000_finds():
    """Gap and stiffness at which force and displacement, each over its size, are least together: a rugged valley.

    The grid is integrated apart from the program, which solves the best hundred of it.
    """
    case = {
        "chain": {
            "masses": [1.0], "springs": [4e3], "dashpots": [6.0],
            "snubbers": [{"name": "stop", "mass": 1, "side": "below", "stiffness": 2e4, "gap": 1e-4}],
        },
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": 8.0, "frequency": 9.0},
        "probes": [{"name": "mass", "mass": 1}],
        "run": {"duration": 0.4, "sample_rate": 1e3, "start": "rest", "convergence": "off"},
    }  # fmt: skip
    limits = {"chain.snubbers.stop.gap": (0.0, 1e-3), "chain.snubbers.stop.stiffness": (4e3, 60e3)}
    gaps, stiffnesses = np.linspace(0.0, 1e-3, 100), np.geomspace(4e3, 60e3, 100)
    asked, sizes = ["peak_force", "probes/mass/peak_displacement"], (36.0, 0.46e-3)

    def total(*figures):
        return sum(of / size for of, size in zip(figures, sizes, strict=True))

    grid = np.stack([axis.ravel() for axis in np.meshgrid(gaps, stiffnesses, indexing="ij")])
    rough = total(*integrated(*grid))
    table, around = rough.reshape(100, 100), [(i, j) for i in (0, 1, 2) for j in (0, 1, 2) if (i, j) != (1, 1)]
    lower = [table[1:-1, 1:-1] < table[i : 98 + i, j : 98 + j] for i, j in around]
    assert np.count_nonzero(np.all(lower, axis=0)) > 1  # valleys of their own
    grid, rough = grid[:, best := np.argsort(rough)[:100]], rough[best]
    solved = beamsim.ensemble(beamsim.load_scenario(case), dict(zip(limits, grid, strict=True)), asked).table
    sums = total(solved["snubbers/stop/peak_force"], solved["probes/mass/peak_displacement"])
    assert sums == pytest.approx(rough, rel=5e-3)
    among = sums.argmin()
    parameters = [{"path": path, "from": low, "to": high} for path, (low, high) in limits.items()]
    parameters[1]["spacing"] = "logarithmic"
    optimise = {
        "minimise": dict(zip(asked, ("36 N", "0.46 mm"), strict=True)), "most_cases": 600, "parameters": parameters
    }  # fmt: skip
    result = beamsim.design_study(beamsim.load_scenario({**case, "optimise": optimise}))
    best = result.summary["best"][0]
    gap, stiffness = best["parameters"].values()
    assert result.complete
    assert result.count <= 600
    assert best["value"] <= sums[among]
    assert best["value"] == pytest.approx(sums[among], rel=0.02)
    assert abs(gap - grid[0][among]) <= 2.0 * (gaps[1] - gaps[0])
    assert abs(np.log(stiffness / grid[1][among])) <= 2.0 * np.log(stiffnesses[1] / stiffnesses[0])
