"""Matrices in files of other programs: OP2, OP4, DMIG, Abaqus, MatrixMarket, Harwell-Boeing, MATLAB and NumPy.

Never here: what the matrices mean for a structure.
Begin with `formats`, which chooses the format; `matrix` is what every reader returns.
"""
