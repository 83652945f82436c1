"""Why a peer is faster than ropeode, where it is: a reason for each part and peer.

The cases are measured; `tables.losses` demands a reason for each.
"""

from __future__ import annotations

_BETWEEN = (
    "An evaluation of two or four numbers costs almost nothing, so the work of the solver between "
    "evaluations counts. LSODA's loop is one compiled function, while XLA calls a kernel for each "
    "piece of a diffrax step. Where the problem is stiff, a multistep method also needs fewer "
    "evaluations (see the table)."
)

REASONS: dict[tuple[str, str], str] = {
    ("stepping", "C++"): (
        "Its time is that of its loop alone. ropeode's is that of a whole call of `simulate`, "
        "which takes about 0.2 ms besides the steps."
    ),
    ("stepping", "Numba"): (
        "It is written for one rope in two dimensions, as two plain loops over the nodes, which "
        "LLVM turns into vector instructions. XLA generates four or five loops, each of which "
        "stores what the next one reads."
    ),
    ("stepping", "lax.scan"): (
        "It is the same arithmetic in nearly the same loops, but stores no samples on the way."
    ),
    ("many ropes", "C++"): (
        "With so many ropes each takes few steps. ropeode spends most of its time on arranging "
        "their numbers side by side and on returning all states. The C++ program has only one "
        "rope, and returns its last node."
    ),
    ("many ropes", "Numba"): (
        "With so many ropes each takes few steps. ropeode spends most of its time on arranging "
        "their numbers side by side; this loop works on each rope in place."
    ),
    ("references", "heyoka Taylor, float64"): (
        "It compiles Taylor series of these particular equations. Their order grows with the "
        "digits, so it takes few long steps in one compiled loop. It compiles again for each "
        "equation and tolerance."
    ),
    ("references", "SciPy LSODA (odeint)"): _BETWEEN,
    ("references", "scikit-sundae CVODE BDF"): (
        "A multistep method solves one small system per step, with a Jacobian that it reuses. "
        "The primary solver solves several, for all its stages, with a new Jacobian in each step."
    ),
}
