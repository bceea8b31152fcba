"""A folder for each command; each returns a frozen result, defined in the same folder.

Never here: reading YAML, writing files, drawing.
Begin with `run.analysis`; modules shared by several commands are in this folder.
"""
