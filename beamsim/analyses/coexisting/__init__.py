"""``beamsim sweep``, kind coexisting: which of several steady motions occurs.

Never here: files and pictures.
Begin with `analysis`; `result` is what it returns.
"""
