"""Bodies as matrices: elements, supports, named places, modes, recovery, reduction with its error bound.

Never here: contacts, time, or which analysis asks.
Begin with `structure`, what every structure answers, then `chain`, the simplest one; `assembly` chooses.
"""
