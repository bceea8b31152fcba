"""``beamsim run``: one structure under one excitation, from its start to the end of the run.

Never here: files and pictures.
Begin with `analysis`; `result` is what it returns.
"""
