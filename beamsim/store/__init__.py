"""Result files: the HDF5 layout, writing, reading, export to other formats.

Never here: physics; a file holds what a result holds.
Begin with `results`; `flat` writes and reads what the fields of results declare (`beamsim.fields`).
"""
