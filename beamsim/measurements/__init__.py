"""Test data: labelled channels with unit, axis and function type, from CSV, HDF5, netCDF-4, MATLAB and universal files.

Never here: what the channels are compared with.
Begin with `signal`, which every reader returns; `read` chooses the reader by the format: `tables` of text, `arrays` by
name, or `universal`. `functions` has the function types.
"""
