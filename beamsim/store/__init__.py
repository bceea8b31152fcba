"""Result files: the HDF5 layout, writing, reading, export to other formats.

Never here: physics; a file holds what a result holds.
Begin with `results`; `datasets` makes variables of the declared fields of results (`beamsim.summaries`), and fields of
variables; `layout` says where each is.
"""
