"""Test data: labelled channels with unit, axis and function type, from files of all formats that laboratories use.

Never here: what the channels are compared with.
Begin with `signal`, which every reader returns; `read` chooses the reader by the format: `tables` of text, `arrays` by
name, `universal`, `laboratory` (TDMS, LVM, netCDF-3) or `mdf`. `functions` has the function types.
"""
