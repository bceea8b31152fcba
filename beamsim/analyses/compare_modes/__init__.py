"""``beamsim compare-modes``: computed mode shapes beside measured ones.

Never here: files and pictures.
Begin with `analysis`.
"""
