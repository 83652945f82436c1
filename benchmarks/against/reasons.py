"""Why a peer is faster than ropeode, where it is: one sentence by part and peer.

Which cases these are is measured; `tables.losses` asks for a sentence for each.
"""

from __future__ import annotations

_BETWEEN = (
    "An evaluation of two or four numbers costs next to nothing, so that what counts is what the "
    "solver does between them: LSODA's loop is one compiled function, while XLA calls a kernel "
    "for each piece of a diffrax step; and where the problem is stiff, a multistep method needs "
    "fewer evaluations (see the table)."
)

REASONS: dict[tuple[str, str], str] = {
    ("stepping", "C++"): (
        "Its time is that of its loop alone, ropeode's that of a whole call of `simulate`, of "
        "which some 0.2 ms are not stepping."
    ),
    ("stepping", "Numba"): (
        "It is written for one rope in two dimensions, as two plain loops over the nodes, which "
        "LLVM turns into vector instructions; XLA makes four or five, each of which stores what "
        "the next one reads."
    ),
    ("stepping", "lax.scan"): (
        "It is the same arithmetic in nearly the same loops, without samples on the way."
    ),
    ("many ropes", "C++"): (
        "With so many ropes each makes few steps, and ropeode's time is for the most part that of "
        "laying their numbers side by side and handing back all states; the C++ program has but "
        "one rope, and hands back its last node."
    ),
    ("many ropes", "Numba"): (
        "With so many ropes each makes few steps, and ropeode's time is for the most part that of "
        "laying their numbers side by side; this loop runs each rope where it lies."
    ),
    ("references", "heyoka Taylor, float64"): (
        "It compiles Taylor series of these very equations, whose order grows with the digits, so "
        "that it makes few long steps in one compiled loop; it compiles anew for each equation "
        "and tolerance."
    ),
    ("references", "SciPy LSODA (odeint)"): _BETWEEN,
    ("references", "scikit-sundae CVODE BDF"): (
        "A multistep method solves one small system a step with a Jacobian that it keeps; "
        "Kvaerno5 solves one for each of its stages, here with a new Jacobian in each iteration."
    ),
}
