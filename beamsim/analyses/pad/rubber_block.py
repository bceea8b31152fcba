r"""Stiffness of a rubber block between two plates.

A block of height h and loaded area A, bonded to both plates or held by friction, cannot spread at its faces. Its
apparent modulus in compression is (A. N. Gent, P. B. Lindley, The compression of bonded rubber blocks, Proc. Inst.
Mech. Eng. 173 (1959) 111–122)

.. math:: E_c = E\,(1 + 2 \kappa S^2), \qquad \frac{1}{E_c'} = \frac{1}{E_c} + \frac{1}{B}, \qquad k = E_c' A / h,

with the shape factor S, loaded area over the area that is free to bulge, a factor :math:`\kappa` (1 for soft unfilled
rubber, down to 0.5 for hard filled rubber), and the bulk modulus B where it is given. It holds for small strains, to
about 10 %, and compact blocks (circular or square). Lubricated faces: S = 0.
"""

from __future__ import annotations

LARGEST_STRAIN = 0.1  # for which the stiffness is taken as constant


def block_stiffness(
    modulus: float, area: float, height: float, shape_factor: float, factor: float = 1.0, bulk: float | None = None
) -> float:
    """Stiffness in N/m; modulus and bulk in Pa, area in m^2, height in m.

    >>> block_stiffness(2e6, 1e-4, 0.01, 0.5)
    30000.0
    """
    apparent = modulus * (1.0 + 2.0 * factor * shape_factor**2)
    if bulk is not None:
        apparent = 1.0 / (1.0 / apparent + 1.0 / bulk)
    return apparent * area / height


def block_modulus(
    stiffness: float, area: float, height: float, shape_factor: float, factor: float = 1.0, bulk: float | None = None
) -> float:
    """The modulus, Pa, of a block of this stiffness; infinite where the bulk modulus alone is too soft.

    >>> block_modulus(30000.0, 1e-4, 0.01, 0.5)
    2000000.0
    """
    apparent = stiffness * height / area
    if bulk is not None:
        apparent = 1.0 / (1.0 / apparent - 1.0 / bulk) if apparent < bulk else float("inf")
    return apparent / (1.0 + 2.0 * factor * shape_factor**2)
