"""Measures of measured and computed signals: likeness, resonances, harmonics, lines, filters, rainflow counts.

Never here: commands, scenarios, files.
Begin with `quality`, the peaks of a response.
"""
