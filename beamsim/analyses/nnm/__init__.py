"""``beamsim nnm``: nonlinear normal modes.

Never here: files and pictures.
Begin with `analysis`; `result` is what it returns.
"""
