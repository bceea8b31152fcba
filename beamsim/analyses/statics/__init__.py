"""``beamsim static``: static equilibrium under weight and dead loads, and the natural frequencies about it.

Never here: files and pictures.
Begin with `analysis`; `result` is what it returns.
"""
