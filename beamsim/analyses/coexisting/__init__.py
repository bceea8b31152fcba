"""``beamsim sweep``, kind coexisting: which of several motions will occur.

Never here: files and pictures.
Begin with `analysis`; `result` is what it returns.
"""
