"""``beamsim compare``: computed motions compared with measured ones.

Never here: files and pictures.
Begin with `analysis`.
"""
