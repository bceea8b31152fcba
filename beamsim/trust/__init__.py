"""How sure a value is: a finer model, the reference integrator, round-off, around an analysis that does not know it.

Never here: what only one analysis does; files and pictures.
Begin with `runs.run`, which the command and the package call; `convergence` compares.
"""
