"""Responses of a built system: histories; to a sine its loads, what is measured of periodic motions, contact changes.

Never here: commands, files and pictures.
Begin with `loads`; `parameters` follows motions in a frequency, a level or a number of a snubber.
"""
