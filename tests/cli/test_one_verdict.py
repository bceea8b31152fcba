"""One verdict everywhere: screen, JSON, result file, exported tables, report page and study of a case agree."""

import csv
import json
import re
from html import unescape
from pkgutil import resolve_name

import pytest
from shipped import config_path

import beamsim
from beamsim.kinds import KINDS
from beamsim.summaries import as_builtin
from tests.helpers.commands import invoke

SHORT = ("run.duration=0.5 s", "run.sample_rate=4 kHz", "run.spectrum.last=0.2 s")
CASES = {  # config, what is changed, the limit, its verdict and the exit code of --check
    "exceeded": ("one_sided_65hz", (*SHORT, "limits.peak_force=1 N"), "peak_force", "exceeded", 4),
    "met": ("one_sided_65hz", (*SHORT, "limits.peak_force=10 kN"), "peak_force", "ok", 0),
    "not reliable": ("hinged_yoke", ("limits.peak_acceleration=1 g",), "peak_acceleration", "not reliable", 3),
    "not converged": (
        "one_sided_65hz", (*SHORT, "reduction.modes=1", "limits.peak_force={0}"), "peak_force", "not reliable", 3,
    ),
    "undecided": (
        "random_vibration", ("run.duration=1 s", "run.test_duration=60 s", "limits.peak_force={0}"), "peak_force",
        "undecided", 3,
    ),
}  # fmt: skip


def run(case, folder):
    """File, JSON and exit code of a case; a limit that is left open is the middle of what is known of the value."""
    config, changes, limit, *_ = CASES[case]
    given = [each.format("1 N") for each in changes]
    for _ in range(2):
        sets = [word for change in given for word in ("--set", change)]
        options = ("--no-plots", "--json", "--check", "-o", folder / "case.h5")
        done = invoke("run", config_path(config), *sets, *options)
        said = json.loads(done.stdout)
        margin = said["margins"][limit]
        if "{0}" not in changes[-1] or given[-1] != changes[-1].format("1 N"):
            break
        ends = ("interval_low", "interval_high") if "interval_low" in margin else ("lowest", "highest")
        given = [*given[:-1], changes[-1].format(f"{0.5 * (margin[ends[0]] + margin[ends[1]])} N")]
    return given, said, done.exit_code


def exported(file, folder):
    """Name and item of each number of the exported summary, and its text."""
    assert invoke("export", file, "--format", "csv", "-o", folder / "csv").exit_code == 0
    (path,) = (folder / "csv").rglob("*summary.csv")
    return {(name, item): value for name, item, value in csv.reader(path.read_text().splitlines())}


def words(page):
    """The texts of a page between its tags."""
    return [unescape(text).strip() for text in re.findall(r">([^<>]+)<", page) if text.strip()]


@pytest.mark.parametrize("case", CASES)
def test_one_verdict_everywhere(case, tmp_path):
    limit, verdict, code = CASES[case][2:]
    changes, said, ended = run(case, tmp_path)
    assert (said["margins"][limit]["verdict"], ended) == (verdict, code)
    file = tmp_path / "case.h5"
    result, informed = beamsim.load(file), json.loads(invoke("info", file, "--json").stdout)
    for of in (as_builtin(result.summary), informed):
        for entry in ("margins", "doubtful", "convergence", "without_limit", CASES[case][2]):
            assert of.get(entry) == said.get(entry)
    assert result.status == said["status"] == informed["status"]
    table = exported(file, tmp_path)
    assert table["margins", f"{limit}/verdict"] == verdict
    for key, value in said["margins"][limit].items():
        if isinstance(value, float):
            assert float(table["margins", f"{limit}/{key}"]) == pytest.approx(value, rel=1e-12)
    screen = resolve_name(KINDS["run"].screen)(result).text(result, ["case.h5"])
    shown = verdict if verdict == "ok" else verdict.upper()
    assert re.search(rf"\b{shown}\b", screen)
    assert not any(re.search(rf"\b{other}\b", screen) for other in ("EXCEEDED", "UNDECIDED") if other != shown)
    assert invoke("report", file, "-o", tmp_path / "page.html").exit_code == 0
    texts = words((tmp_path / "page.html").read_text())
    assert any(re.search(rf"\b{shown}\b", text) for text in texts)
    assert screen.splitlines()[0] in "\n".join(texts)
    assert said["status"] in "\n".join(texts)
    stop = result.scenario.all_snubbers[0]
    parameter = f"{{path: 'snubbers[0].stiffness', values: [{stop.stiffness!r}]}}"
    study = [*changes, f"vary={{kind: grid, parameters: [{parameter}]}}"]
    sets = [word for change in study for word in ("--set", change)]
    done = invoke("sweep", config_path(CASES[case][0]), *sets, "--no-plots", "--json", "--check", "--workers", 1,
                  "-o", tmp_path / "study.h5")  # fmt: skip
    assert done.stdout, done.stderr
    of_study = json.loads(done.stdout)["margins"][limit]
    assert (of_study["verdict"], done.exit_code) == (verdict, code)
    assert of_study["value"] == pytest.approx(said["margins"][limit]["value"], rel=1e-9)
