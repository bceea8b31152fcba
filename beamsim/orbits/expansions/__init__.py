"""The methods of H. Hazim's thesis (2010), for comparison: multiple scales, free and forced, and relaxed minimisation.

Never here: what other methods need.
Begin with `free`.
"""
