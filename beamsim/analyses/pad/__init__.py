"""Stiffness and damping of a pad from what is known of it.

Never here: structures, time.
Begin with `analysis`.
"""
