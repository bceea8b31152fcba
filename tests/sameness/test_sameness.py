"""The numbers of the shipped configs are those that were recorded; see record.py."""

import copy
import math
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

# Tests are not a package (importmode=importlib), so the script is loaded by its place.
_spec = spec_from_file_location("sameness_record", Path(__file__).with_name("record.py"))
record = module_from_spec(_spec)
sys.modules[_spec.name] = record
_spec.loader.exec_module(record)

TABLE = record.load()
ENTRIES = {entry.name: entry for entry in record.all_entries()}
SOME = "one_sided_65hz run"


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * entry.slow) for name, entry in ENTRIES.items()]
)
def test_numbers_are_those_recorded(name):
    found = record.compare(name, TABLE[name], record.record(ENTRIES[name]))
    assert not found, "\n".join(found)


def test_every_entry_is_recorded_and_succeeded():
    assert TABLE.keys() == ENTRIES.keys()
    assert {name: entry["exit"] for name, entry in TABLE.items() if entry["exit"]} == {}
    assert 20 < sum(not entry.slow for entry in ENTRIES.values()) < len(ENTRIES)
    assert all(entry["reason"] for entry in TABLE.values() if entry.get("loose"))
    balances = [entry["values"]["json/energy_error"] for name, entry in TABLE.items() if name.split()[1] == "run"]
    assert max(balances) < record.ROUND_OFF_BOUND  # and therefore that of each run that is compared


def changed(path, value):
    other = copy.deepcopy(TABLE[SOME])
    other["values"][path] = value
    return record.compare(SOME, TABLE[SOME], other)


@pytest.mark.parametrize("place", range(3))
def test_a_changed_checksum_is_reported(place):
    path = "file/probes/tip/displacement"
    kind, shape, bad, *sums = TABLE[SOME]["values"][path]
    assert changed(path, [kind, shape, bad, *sums]) == []
    sums[place] += 1e-8 * sums[min(place, 1)]
    (line,) = changed(path, [kind, shape, bad, *sums])
    assert path in line
    assert "1e-10 allowed" in line


def test_tolerances_are_widened_to_what_another_processor_gives():
    path = "file/probes/tip/displacement"
    entry, other = copy.deepcopy(TABLE[SOME]), copy.deepcopy(TABLE[SOME])
    assert record.widen(entry, other) == 0
    other["values"][path][3] *= 1.0 + 3e-9
    (_,) = record.compare(SOME, entry, other)
    assert record.widen(entry, other) == 1
    assert record.compare(SOME, entry, other) == []
    assert entry["loose"][path] == 1e-7
    other["values"][path][3] *= 1.0 + 1e-6
    (_,) = record.compare(SOME, entry, other)


def test_a_slightly_stiffer_beam_is_reported():
    found = record.compare(SOME, TABLE[SOME], record.record(ENTRIES[SOME], ["beam.youngs_modulus=69.000001 GPa"]))
    assert any("file/probes/tip/displacement" in line for line in found)
    assert any("json/open_frequencies_hz" in line for line in found)


@pytest.mark.parametrize("factor", [1.0 + 1e-8, 1.0 - 1e-9, math.nan])
def test_a_changed_number_is_reported(factor):
    path = "json/peak_displacement_m/tip"
    (line,) = changed(path, record.digest(TABLE[SOME]["values"][path] * factor))
    assert path in line


def test_changed_integers_shapes_and_exit_codes_are_reported():
    entry = TABLE[SOME]
    assert len(changed("json/events", entry["values"]["json/events"] + 1)) == 1
    kind, shape, size, check = entry["values"]["file/events/closing"]
    assert len(changed("file/events/closing", [kind, shape, size, check ^ 1])) == 1
    assert len(changed("file/events/closing", [kind, [*shape, 1], size, check])) == 1
    assert len(record.compare(SOME, entry, entry | {"exit": 3})) == 1


def test_missing_and_new_values_are_reported():
    entry = TABLE[SOME]
    less = {path: value for path, value in entry["values"].items() if path != "json/events"}
    assert "is missing" in record.compare(SOME, entry, entry | {"values": less})[0]
    assert "is new" in record.compare(SOME, entry | {"values": less}, entry)[0]


def test_texts_are_compared_apart():
    entry = TABLE[SOME]
    other = entry | {"texts": entry["texts"] | {"json/status": "broken off"}}
    assert record.compare(SOME, entry, other) == []
    assert "broken off" in record.text_changes(SOME, entry, other)[0]


def test_round_off_is_bounded_and_not_compared():
    assert changed("json/energy_error", 3e-12) == []
    assert len(changed("json/energy_error", 2e-8)) == 1


def test_deliberate_changes_can_be_declared(monkeypatch):
    entry = TABLE[SOME]
    moved = {path.replace("file/probes/", "file/points/"): value for path, value in entry["values"].items()}
    assert record.compare(SOME, entry, entry | {"values": moved})
    monkeypatch.setitem(record.RENAMED, "file/probes/*", ("file/points/*", "a better name"))
    assert record.compare(SOME, entry, entry | {"values": moved}) == []
    moved["json/events"] += 1
    assert len(record.compare(SOME, entry, entry | {"values": moved})) == 1
    monkeypatch.setitem(record.MENDED, f"{SOME} json/events", "one was counted twice")
    assert record.compare(SOME, entry, entry | {"values": moved}) == []
