"""The numbers that users read are those that were recorded; see record.py."""

import re
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest
from shipped import unfit

import beamsim
from beamsim.scenario import load_scenario

# Tests are not a package (importmode=importlib), so the script is loaded by its place.
_spec = spec_from_file_location("sameness_record", Path(__file__).with_name("record.py"))
record = module_from_spec(_spec)
sys.modules[_spec.name] = record
_spec.loader.exec_module(record)

CASES = record.load()
SOME = "beam that touches one stop"


pytestmark = pytest.mark.recorded


def answer_of(case, solve):
    """The numbers that a case can record; of a single command those of its file, which other tests read as well."""
    if len(case.get("run", ())) != 1:
        return record.answer(case)
    command, config, *options = case["run"][0].replace("--workers 1", "").split()
    changes = [word for change in case.get("set", ()) for word in ("--set", change)]
    done = solve(command, f"configs/{config}", *options, *changes)
    assert done.exit_code == 0, done.output
    result = beamsim.load(done.file)
    return dict(record.leaves({"status": result.status, "warnings": list(result.warnings), **result.summary}))


@pytest.mark.parametrize("name", CASES)
def test_numbers_are_those_recorded(name, solve):
    answer = answer_of(CASES[name], solve)
    differences = record.compare(CASES[name], record.chosen(CASES[name], answer))
    assert not differences, "\n".join(differences)
    assert answer.get("energy_error", 0.0) < 1e-8
    if "run" in CASES[name]:
        texts = [text for key, text in answer.items() if key == "status" or re.fullmatch(r"warnings/\d+", key)]
        config = record.CONFIGS / CASES[name]["run"][0].split()[1]
        assert not list(unfit(load_scenario(config, CASES[name].get("set", ())), texts))


def test_a_slightly_stiffer_beam_is_reported():
    case = CASES[SOME]
    found = record.chosen(case, record.answer(case, ["beam.youngs_modulus=69.00001 GPa"]))
    differences = record.compare(case, found)
    changed = {line.partition(":")[0] for line in differences}
    assert {"peak_force_n/tip", "max_displacement_m/tip", "open_frequencies_hz/0"} <= changed
    assert "contacts/tip" not in changed  # a change of 1.5e-7 leaves the counts


@pytest.mark.parametrize("name", CASES)
def test_every_number_of_every_case_is_compared(name):
    case = CASES[name]
    tolerance = record.TOLERANCES[case["agrees"]]
    assert record.compare(case, dict(case["numbers"])) == []
    for number, value in case["numbers"].items():
        if isinstance(value, float):
            wrong, right = value * (1.0 + 2.0 * tolerance) or tolerance, value * (1.0 + 0.5 * tolerance)
        else:
            wrong, right = "other" if isinstance(value, str) else value + 1, value
        for bad in (wrong, float("nan"), "missing"):
            (line,) = record.compare(case, case["numbers"] | {number: bad})
            assert number in line
        assert record.compare(case, case["numbers"] | {number: right}) == []


def test_a_number_that_is_no_more_is_missing():
    found = record.chosen(CASES[SOME], {"contacts/tip": 54})
    assert found["contacts/tip"] == 54
    assert found["peak_force_n/tip"] == "missing"


def test_the_table_is_one_that_a_person_can_read():
    assert record.NUMBERS.stat().st_size < 50_000
    assert all(1 <= len(case["numbers"]) <= 20 for case in CASES.values())
    assert max(len(line) for line in record.NUMBERS.read_text(encoding="utf-8").splitlines()) <= 120


def test_writing_the_table_changes_nothing(monkeypatch, tmp_path):
    copy = tmp_path / "numbers.yaml"
    copy.write_bytes(record.NUMBERS.read_bytes())
    monkeypatch.setattr(record, "NUMBERS", copy)
    record.write(record.load())
    assert copy.read_bytes() == Path(record.__file__).with_name("numbers.yaml").read_bytes()


@pytest.mark.parametrize("option", [["--check"], ["--list"], []])
def test_a_name_of_no_case_is_refused(monkeypatch, capsys, option):
    monkeypatch.setattr(sys, "argv", ["record.py", *option, "swept sin"])
    with pytest.raises(SystemExit) as ended:
        record.main()
    assert ended.value.code == 2
    assert "no case is called swept sin; near it are swept sine" in capsys.readouterr().err
