"""Input signals in time: harmonic, swept, sampled, random, pulses, and where they act.

Never here: the response of a structure.
Begin with `signal`, the closed form of every input.
"""
