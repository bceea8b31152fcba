"""Periodic motions: shooting, harmonic balance, continuation, bifurcations, expansions.

Never here: pydantic, files, units, or the names of scenario keys, in messages either. Begin with `branch`, what every
method finds, then `continuation` and `shooting`.
"""
