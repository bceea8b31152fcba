"""Periodic motions: shooting, harmonic balance, continuation, bifurcations, expansions.

Never here: pydantic, files, units, or the names of scenario keys, in messages either. Begin with `branch`, the result
of every method, then `continuation` and `shooting`.
"""
