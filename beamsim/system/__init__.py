"""The piecewise-linear equations of a system, and the only way to create them from a scenario.

Never here: integration in time.
Begin with `equations` (the data that the flow needs) and `build`.
"""
