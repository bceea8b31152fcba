"""``beamsim animate``: the frames of a motion; read `beamsim.analyses.animate.frames`."""
