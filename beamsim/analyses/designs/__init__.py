"""``beamsim sweep`` with ``vary``: many cases of one scenario.

Never here: files and pictures.
Begin with `analysis`; `result` is what it returns.
"""
