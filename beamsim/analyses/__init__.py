"""A folder for each command; each returns a frozen result that is defined beside it.

Never here: reading YAML, writing files, drawing.
Begin with `run.analysis`; modules shared by several commands are in this folder.
"""
