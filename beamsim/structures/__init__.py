"""Bodies as matrices: elements, supports, places, modes, recovery of moments, and reduction with an error bound.

Never here: contacts, time, or the kind of analysis.
Begin with `structure`, the interface of every structure, then `chain`, the simplest one; `assembly` selects them.
"""
