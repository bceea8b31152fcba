"""What the results of all analyses share: reported values and margins, branches of motions, doubts about the model.

Never here: how a number is computed, files and pictures.
Begin with `result`, the base of all results.
"""
