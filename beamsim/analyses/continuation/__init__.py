"""``beamsim sweep`` of kind continuation: curves of periodic motions.

Never here: files and pictures.
Begin with `analysis`; `result` is what it returns.
"""
