"""Bodies as matrices: elements, supports, named places, modes, recovery, reduction with its error bound.

Never here: contacts, time, or which analysis asks.
Begin with `full`, which says what a body gives, then `beam`.
"""
