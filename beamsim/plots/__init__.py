"""Pictures of a result: functions from a result to matplotlib Axes.

Never here: physics; a plot draws what a result holds.
Begin with `run`, the simplest result; `style` and `labels` are shared, `save` writes the files.
"""
