"""Pictures of a result: functions from a result to matplotlib Axes, which draw and never compute."""
