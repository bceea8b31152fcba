"""``beamsim pad``: stiffness and damping of a pad from its material or measured force-deflection curves.

Never here: pictures.
Begin with `analysis`.
"""
