"""Existence and uniqueness in words: what the rows of a run say about lambda, R and the motion."""

from __future__ import annotations

from lagcli.auditing.evidence.tolerances import Evidence

SHOWN = 6  # names of rows in a sentence


def sentences(e: Evidence) -> tuple[str, ...]:
    """Rank, condition, consistency, and which multipliers are determined."""
    laws, d = e.laws, e.displacements
    times = e.record.t[e.looked_at]
    n = laws.cast.n
    if not laws.C:
        return (f"there are no rows: all {n} coordinates are free, R = 0, and the motion is unique",)
    found = [_rank(laws.C, d.usual, n)]
    regular = ~d.is_singular
    if regular.any():
        worst = int((d.condition * regular).argmax())
        found.append(
            f"the condition of the rows, each divided by its length, is at most {d.condition[worst]:.2g}"
            f" (at t = {times[worst]:.6g})"
        )
    if d.is_singular.any():
        first = times[d.is_singular][0]
        found.append(
            f"{int(d.is_singular.sum())} of the {len(times)} rows of the table that were looked at are at or next to a"
            f" singular configuration, the first at t = {first:.6g}: multipliers may have poles there, R has none"
        )
    open_ = [
        row for row, unique in zip(laws.rows, d.is_unique[regular].all(axis=0), strict=True) if not unique
    ]
    if not regular.any():
        found.append(
            "which multipliers are determined is not known: no row of the table that was looked at is regular"
        )
    elif open_:
        shown = ", ".join(f"`{row}`" for row in open_[:SHOWN]) + (" ..." if len(open_) > SHOWN else "")
        found.append(
            f"{len(open_)} of {laws.C} multipliers are not determined ({shown}): their rows depend on each other;"
            " the others, R and the motion are unique"
        )
    else:
        found.append(
            "all multipliers are determined, lambda(0) too: they follow from (B M^-1 B^T) lambda = gamma - B M^-1 F"
            " at every instant"
        )
    return tuple(found)


def _rank(C: int, rank: int, n: int) -> str:
    if rank == C == 1:
        return f"the one row leaves {n - 1} of {n} directions free"
    if rank == C:
        rows = "the row is independent; it leaves" if C == 1 else f"the {C} rows are independent; they leave"
        return f"{rows} {n - rank} of {n} directions free"
    return f"the {C} rows have rank {rank}: {C - rank} too many; they leave {n - rank} of {n} directions free"
