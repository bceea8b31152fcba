"""The record of processor times, by which tests are slow."""

from types import SimpleNamespace

import durations
import pytest

pytestmark = pytest.mark.quick
RECORD = {"a.py::long": 4.0, "a.py::near": 0.9, 'b.py::quoted["x, y"]': 1.5}


def test_a_record_reads_as_it_was_written(tmp_path):
    durations.write(tmp_path / "made" / "record.csv", RECORD)
    assert durations.recorded(tmp_path / "made" / "record.csv") == RECORD
    assert durations.recorded(tmp_path / "missing.csv") == {}


def test_what_was_measured_replaces_what_was_recorded():
    new = durations.updated(RECORD, {"a.py::long": 0.1, "a.py::new": 2.0, "a.py::short": 0.2})
    assert new == {"a.py::near": 0.9, "a.py::new": 2.0, 'b.py::quoted["x, y"]': 1.5}


def test_a_test_far_above_the_limit_has_to_be_recorded():
    measured = {"a.py::long": 9.0, "a.py::near": 1.2, "a.py::new": 3.1, "a.py::newest": 5.0}
    assert durations.slow_and_unrecorded(RECORD, measured) == ["a.py::newest", "a.py::new"]


def test_tests_recorded_above_a_second_are_slow(monkeypatch, tmp_path):
    durations.write(tmp_path / "record.csv", RECORD)
    monkeypatch.setattr(durations, "RECORD", tmp_path / "record.csv")
    marks = {name: [] for name in (*RECORD, "a.py::new")}
    items = [SimpleNamespace(nodeid=name, add_marker=found.append) for name, found in marks.items()]
    durations.pytest_collection_modifyitems(items)
    slow = {name for name, found in marks.items() if [mark.name for mark in found] == ["slow"]}
    assert slow == {"a.py::long", 'b.py::quoted["x, y"]'}
