"""Responses of a built system to a sine: its loads, what is measured of periodic motions, when contact changes.

Never here: commands, files and pictures.
Begin with `loads`; `parameters` follows motions in a frequency, a level or a number of a snubber.
"""
