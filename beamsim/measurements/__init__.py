"""Test data: labelled channels with units on an axis of time or frequency, from CSV, HDF5 and universal files.

Never here: what the channels are compared with.
Begin with `read`, which chooses the format; `tables` reads text, and `signal` is what every reader returns.
"""
