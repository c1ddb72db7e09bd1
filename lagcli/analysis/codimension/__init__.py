"""The codimension of the constraint surface f = 0 where the rank of its rows B alone does not prove it.

Dependent rows (`examine` asks in this order)

- are redundant where some of them cut out a smooth surface on which the others vanish (`manifold`): the rank is the
  codimension, motion and R are unique, single multipliers are not;
- have a rank below the codimension where the surface is rigid by second derivatives (`second_order`), as of three
  particles on a line with all three distances: no finite multipliers give the true motion (D.13-D.22);
- or meet at a singular point: nearby on the surface the rank is higher, as where a linkage lies flat.
"""

from lagcli.analysis.codimension.examine import Codimension, examine

__all__ = ["Codimension", "examine"]
