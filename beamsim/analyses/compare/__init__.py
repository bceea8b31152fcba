"""``beamsim compare``: computed motions beside measured ones.

Never here: files and pictures.
Begin with `analysis`.
"""
