"""A spectrum with its table of lines as a group of a result file."""

from __future__ import annotations

import h5py

from beamsim.analyses.run.result import Spectrum
from beamsim.store.declared import read, write


def write_spectrum(group: h5py.Group, spectrum: Spectrum) -> None:
    """Write a spectrum into ``group``, and its lines into ``group/lines``."""
    write(group, spectrum)


def read_spectrum(group: h5py.Group) -> Spectrum:
    """Inverse of `write_spectrum`."""
    return Spectrum(**read(Spectrum, group))
