"""``beamsim sweep``, kind coexisting: which of several motions will occur.

Never here: files and pictures.
Begin with `analysis`; `starts` has the motions from many states, `result` is what is returned.
"""
