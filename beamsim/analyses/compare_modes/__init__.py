"""``beamsim compare-modes``: computed natural modes compared with measured ones.

Never here: pictures.
Begin with `analysis`.
"""
