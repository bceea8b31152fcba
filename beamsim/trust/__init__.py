"""How sure a value is: what stands around an analysis and calls it, and which no analysis knows.

A case is solved again with a finer model, compared with the reference integrator, or disturbed by round-off.
Begin with `checked`, the functions that the commands and the package call; `values` compares.
Never here: what an analysis computes, and how.
"""
