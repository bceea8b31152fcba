"""One set of piecewise-linear equations, and the only bridge to it from a scenario.

Never here: integration in time.
Begin with `equations` (what the flow needs to know) and `build`.
"""
