"""The look at a model before it is used: mass, rigid motions, symmetry, frequencies.

Never here: contacts and time.
Begin with `analysis`.
"""
