"""``beamsim animate``: the deflected shapes of a motion, slow around contact.

Never here: pictures and pages.
Begin with `beamsim.analyses.animate.frames`.
"""
