"""``beamsim identify-stiffness``: parameters from measurements.

Never here: files and pictures.
Begin with `analysis`; `result` is what it returns.
"""
