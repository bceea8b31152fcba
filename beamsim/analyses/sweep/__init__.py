"""``beamsim sweep``: swept and stepped sines.

Never here: files and pictures.
Begin with `analysis`; `result` is what it returns.
"""
