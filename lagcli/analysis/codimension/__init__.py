"""The codimension of the constraint surface f = 0 where the rank of its rows B alone does not prove it.

Rows that are independent at a point cut out a surface whose codimension is their rank there. Of dependent rows
three things can be so, and each is looked for:

- They are redundant: some of them cut out a smooth surface, and on that the others vanish (`manifold`). The rank is
  the codimension, motion and R are unique, single multipliers are not.
- The rank is below the codimension (`second_order`): the surface is smooth, but of smaller dimension than the
  kernel of B, and is rigid there by second derivatives. Three particles on a line with all three distances are
  such a set. The multiplier rule (D.13-D.22) fails: no finite multipliers give the true motion.
- The point is singular (`manifold` too): nearby on the surface the rank is higher, as where a linkage lies flat.

`scaled_equations` are a part of f in scaled coordinates, `manifold` follows what they cut out to finite distances,
`examine` asks them in their order, and says why no run can be stepped with such rows.
"""

from lagcli.analysis.codimension.examine import Codimension, examine

__all__ = ["Codimension", "examine"]
