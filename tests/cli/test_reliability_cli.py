"""`beamsim sweep` with `vary: {kind: reliability}`: files, exit codes, the design point, going on where it was."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from sampling import needs
from scipy.integrate import quad
from scipy.stats import norm

import beamsim
from beamsim.store.studies import journal_path
from beamsim.trust.studies import CaseSolver
from tests.helpers.commands import invoke

pytestmark = needs("openturns")

CASE = """\
title: Stop of a mass
chain: {masses: [2 kg], springs: [10 N/m]}
snubbers: [{name: stop, mass: 1, side: above, gap: 0 mm, stiffness: 20 kN/m}]
run: {duration: 50 ms, start: {displacement: [0], velocity: [0.5 m/s]}}
limits: {peak_force: 130 N}
vary:
  kind: reliability
  samples: 100
  parameters:
    - {path: 'run.start.velocity[0]', deviation: 10 %}
    - {path: snubbers.stop.stiffness, deviation: 20 %, distribution: lognormal}
"""
NOISE = """\
title: Mass under noise
chain: {masses: [1 kg], springs: [10 kN/m], damping: {kind: modal, ratio: 5 %}}
snubbers: [{name: stop, mass: 1, side: above, stiffness: 50 kN/m, gap: 2 mm}]
excitation:
  kind: random
  applied_to: base
  psd: [{frequency: 5 Hz, density: 0.01 g^2/Hz}, {frequency: 40 Hz, density: 0.01 g^2/Hz}]
run: {duration: 0.2 s, sample_rate: 1 kHz, start: rest}
limits: {peak_force: 50 N}
vary: {kind: reliability, samples: 100, coefficient_of_variation: 80 %}
"""


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("case.yaml").write_text(CASE)
    Path("noise.yaml").write_text(NOISE)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The folder of a study that was not interrupted, and the command."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "case.yaml").write_text(CASE)
    return folder, invoke("sweep", folder / "case.yaml", "--workers", 1, "--json", "-o", folder)


def in_closed_form(limit):
    """The energy of the mass is that of spring and stop at the peak: F = k_s v sqrt(m / (k + k_s))."""
    width = math.sqrt(math.log1p(0.2**2))

    def beyond(z):
        stop = 20e3 * math.exp(width * z - 0.5 * width**2)
        return norm.pdf(z) * norm.sf((limit / stop * math.sqrt((10.0 + stop) / 2.0) - 0.5) / 0.05)

    return quad(beyond, -8.0, 8.0)[0]


def test_the_probability_the_picture_and_the_design_point_as_a_case(whole, monkeypatch):
    folder, done = whole
    monkeypatch.chdir(folder)
    summary = json.loads(done.stdout)
    of = summary["reliability"]
    assert done.exit_code == 0, done.output
    assert [Path(name).name for name in summary["files"]] == [
        "case.h5", "case_design_point.yaml", "case_probability.png"
    ]  # fmt: skip
    assert all(Path(name).stat().st_size > 0 for name in summary["files"])
    exact = in_closed_form(130.0)
    assert abs(math.log(of["probability"] / exact)) < 3.5 * of["coefficient_of_variation"] <= 0.35
    assert of["low"] < of["probability"] < of["high"]
    assert of["reliability_index"] == pytest.approx(-norm.ppf(of["probability"]))
    alone = json.loads(invoke("run", "case_design_point.yaml", "--json", "--no-plots").stdout)
    assert alone["peak_force_n"]["stop"] == pytest.approx(130.0, rel=1e-3)
    stored = beamsim.load("case.h5")
    assert stored.summary["reliability"] == of
    assert stored["random_numbers"]["design"].values.tolist() == list(of["design_point"].values())
    assert stored["rounds"]["probability"].values[-1] == of["probability"]
    assert stored.table["snubbers/stop/peak_force"].size == of["histories"]
    for shown in (invoke("info", "case.h5").stdout, invoke("sweep", "case.yaml", "--resume", "--no-plots").stdout):
        for text in ("probability of exceeding a limit", "one in", "95 % interval", "stop stiffness"):
            assert text in shown


def test_the_first_order_has_no_interval_and_says_so():
    done = invoke("sweep", "case.yaml", "--workers", 1, "--no-plots", "--set", "vary.method=form")
    assert done.exit_code == 0, done.output
    assert "irst-order approximation, which has no interval" in done.stdout
    of = beamsim.load("case.h5").summary["reliability"]
    assert of["probability"] == pytest.approx(in_closed_form(130.0), rel=0.15)
    assert of["histories"] < 60


def test_too_few_histories_are_not_reliable():
    changes = ("--set", "vary.method=monte_carlo", "--set", "vary.most_cases=200")
    done = invoke("sweep", "case.yaml", "--workers", 1, "--no-plots", *changes)
    assert done.exit_code == 3
    assert "not reliable" in done.output
    assert "after 200 histories" in done.output.replace("\n", " ")


def test_a_history_just_beyond_the_limit_under_noise_is_a_case():
    done = invoke("sweep", "noise.yaml", "--workers", 1, "--json", "--no-plots")
    of = json.loads(done.stdout)["reliability"]
    assert done.exit_code == 0, done.output
    assert of["method"] == "subset"
    assert "*" in of["design_point"]["excitation.seed"]
    alone = json.loads(invoke("run", "noise_design_point.yaml", "--json", "--no-plots").stdout)
    values = beamsim.load("noise.h5").table["snubbers/stop/peak_force"]
    assert alone["peak_force_n"]["stop"] == pytest.approx(values[values >= 50.0].min(), rel=1e-6)


def test_an_interrupted_study_goes_on_where_it_was(whole, monkeypatch):
    solved, real = [], CaseSolver.__call__

    def solve(self, case):
        if len(solved) == 100:
            raise KeyboardInterrupt
        solved.append(case.number)
        return real(self, case)

    monkeypatch.setattr(CaseSolver, "__call__", solve)
    assert invoke("sweep", "case.yaml", "--workers", 1, "--no-plots").exit_code == 130
    assert journal_path(Path("case.h5")).exists()
    monkeypatch.setattr(CaseSolver, "__call__", real)
    assert invoke("sweep", "case.yaml", "--workers", 1, "--no-plots", "--resume").exit_code == 0
    one, other = (beamsim.load(path) for path in (whole[0] / "case.h5", "case.h5"))
    assert one.summary["reliability"] == other.summary["reliability"]
    for name, column in one.table.items():
        np.testing.assert_array_equal(column, other.table[name], err_msg=name)
