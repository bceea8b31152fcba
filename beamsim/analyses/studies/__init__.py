"""``beamsim sweep`` with ``vary``: many cases of one scenario.

Never here: files and pictures.
Begin with `table`, the cases of a study as one table; `summary` makes the result of it.
"""
