"""``beamsim compare``: comparison of computed and measured motions.

Never here: files and pictures.
Begin with `analysis`.
"""
