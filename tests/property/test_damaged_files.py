"""Damaged files are read or refused: no other exception, no signal, no 5 GB and no 30 s a file."""

import pytest

from tests.helpers.damaged_files import FORMATS, outcome, outcomes, sound

pytestmark = pytest.mark.portable

IN_COMPILED_CODE = {"mat5", "mat5 packed", "mat5 records"}
"""Formats whose reader can end the process: they are read in another one, by the slow test alone."""

EXAMINED = {"hdf5", "mat7.3", "netcdf", "result", "mdf"}
"""Formats that a process of their own reads, or examines before they are read: the slow test alone reads them, and
fewer of them."""


@pytest.mark.parametrize("name", sorted(FORMATS.keys() - IN_COMPILED_CODE - EXAMINED))
def test_damaged_files_are_read_or_refused(name, tmp_path):
    raw = sound(name, tmp_path)
    found = [outcome(name, raw, number, tmp_path) for number in range(15)]
    assert set(found) <= {"read", "refused"}
    assert "refused" in found


def test_more_damaged_files_of_each_format():
    """With ``outcomes(dict.fromkeys(FORMATS, 2000))`` as well, which takes too long for every change."""
    pytest.importorskip("resource", reason="bounds of memory need Unix")
    counts = {name: 30 if name in EXAMINED else 100 for name in FORMATS}
    found, wrong = outcomes(counts)
    assert not wrong
    for name, of in found.items():
        assert of["refused"] > 0.3 * counts[name], (name, of)
