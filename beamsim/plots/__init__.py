"""Plots: functions from a result to matplotlib Axes.

Never here: computation; a plot shows only what the result contains.
Begin with `run`, the simplest result; `style` and `drawing` are shared.
"""
