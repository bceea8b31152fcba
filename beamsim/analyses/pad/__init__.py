"""``beamsim pad``: numbers of a pad from its measured force-deflection curves.

Never here: pictures.
Begin with `analysis`.
"""
