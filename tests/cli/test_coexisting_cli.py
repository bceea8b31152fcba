"""`beamsim sweep` of kind coexisting: going on after being interrupted or killed."""

import os
import signal
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

import beamsim
from beamsim.analyses.coexisting.analysis import Marches
from beamsim.store.studies import journal_path
from tests.helpers.commands import invoke

CASE = """\
chain:
  masses: [1]
  springs: [4 kN/m]
  dashpots: [4]
  snubbers: [{name: stop, mass: 1, side: below, stiffness: 40 kN/m, gap: 2 mm}]
probes: [{name: mass, mass: 1}]
excitation: {kind: harmonic, applied_to: {mass: 1}, level: 4 N, frequency: 14 Hz}
sweep:
  kind: coexisting
  at: [14 Hz]
  unstable: false
  starts: {kind: states, number: 8, box: [{probe: mass, displacement: [-10 mm, 10 mm], velocity: [-1 m/s, 1 m/s]}]}
  disturbances: [{kind: impulse, probe: mass, to: 0.5 N s}]
"""
JOURNAL = journal_path(Path("case.h5"))


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    (folder / "case.yaml").write_text(CASE)
    assert invoke("sweep", folder / "case.yaml", "--workers", 1, "--no-plots", "-o", folder).exit_code == 0
    return folder / "case.h5"


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("case.yaml").write_text(CASE)


def same_results(whole):
    found = []
    for path in (whole, "case.h5"):
        with h5py.File(path) as file:
            datasets = {}
            file.visititems(lambda name, item, kept=datasets: kept.update({name: item[()]} if item.shape != () else {})
                            if isinstance(item, h5py.Dataset) else None)  # fmt: skip
        found.append((datasets, beamsim.load(path).summary))
    (one, summary), (other, resumed) = found
    assert one.keys() == other.keys()
    for name, values in one.items():
        np.testing.assert_array_equal(values, other[name], err_msg=name)
    for entry in ("motions", "disturbances", "not_settled"):
        assert resumed[entry] == summary[entry]
    assert summary["disturbances"]


@pytest.mark.parametrize(("last", "killed"), [(5, False), (9, True)])  # amid the starts, and amid the disturbances
def test_an_interrupted_or_killed_one_goes_on_where_it_was(last, killed, whole, monkeypatch, heeded):
    """Killed, it leaves the journal as it is on the disk at that time, perhaps with half of a line."""
    begun, journals = [], []

    def solve(self, case, real=Marches.__call__):
        begun.append(case.number)
        if len(begun) == last:
            journals.append(JOURNAL.read_bytes())
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.3)
        return real(self, case)

    monkeypatch.setattr(Marches, "__call__", solve)
    done = invoke("sweep", "case.yaml", "--workers", 1, "--no-plots")
    assert done.exit_code == 130, done.output
    assert f"{last - 1} starts and disturbances are kept; --resume computes the others" in done.output
    part = beamsim.load("case.h5")
    assert part.outcome.interrupted
    assert np.count_nonzero(part["starts"]["cycles"].values) == min(last - 1, 8)
    if killed:
        line = journals[0].splitlines()[-1]
        JOURNAL.write_bytes(journals[0] + line[: len(line) // 2])
        Path("case.h5").unlink()
        refused = invoke("sweep", "case.yaml", "--resume", "--set", "excitation.level=3.9 N")
        assert refused.exit_code == 2
        assert "belongs to another study" in refused.output
    again = invoke("sweep", "case.yaml", "--workers", 1, "--no-plots", "--resume")
    assert again.exit_code == 0, again.output
    assert f"{last - 1} starts and disturbances are already computed" in again.output
    assert sorted(begun) == sorted([last - 1, *range(len(begun) - 1)])  # only what was under way is computed twice
    same_results(whole)
    assert not JOURNAL.exists()
    assert "nothing to compute" in invoke("sweep", "case.yaml", "--resume").output
