"""``beamsim compare-modes``: computed natural modes beside measured ones.

Never here: pictures.
Begin with `analysis`.
"""
