"""Signals in time: harmonic, swept, sampled, random, pulses, and where they act.

Never here: how a structure responds.
Begin with `signal`, the closed form that every input is brought into.
"""
