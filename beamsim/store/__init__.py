"""Result files: the HDF5 layout, writing, reading, export to other formats.

Never here: physics; a file holds what a result holds.
Begin with `results`, which writes and reads the labelled datasets of a result; `export` makes other formats of them.
"""
