"""Typical hand-ins of each assignment, as changes of its solution's text."""

from __future__ import annotations

from pathlib import Path

TEACH = Path(__file__).parents[2] / "docs/teach"

_FORCES = "    return force - args.damping[:, None] * v\n"
# By assignment and by the words of docs/teach/index.md: old and new text.
WRONG: dict[str, dict[str, tuple[tuple[str, str], ...]]] = {
    "euler": {
        "explicit Euler": (("x_new = x + dt * v_new", "x_new = x + dt * v"),),
        "one end of each spring": (("            force[s + 1] -= pull\n", ""),),
        "no damping": ((_FORCES, "    return force\n"),),
        "forces without mass": ((" / args.mass[:, None]\n    v_new", "\n    v_new"),),
    },
    "verlet": {
        "the half missing": (("dt**2 / 2 * a", "dt**2 * a"),),
        "the old velocity in the damping": (("x_new, v + dt * a, args", "x_new, v, args"),),
        "Heun": (("x_new, v + dt * a, args", "x + dt * v, v + dt * a, args"),),
        "damping factor in each step": (
            ("    a = acc", "    args = args._replace(damping=0 * args.damping)\n    a = acc"),
            ("v_new = v + dt / 2", "v_new = (1 - 0.00005) * v + dt / 2"),
        ),
    },
    "constraint": {
        "springs that do not give": (
            ("softness = 1 / (args.stiffness[s] * dt**2)", "softness = 0"),
        ),
        "forgets what it has pulled": (("    impulse[s] += change\n", ""),),
        "velocities of the prediction": (("return x_new, (x_new - x) / dt", "return x_new, v"),),
        "assignment 1 again": (),
        "half of the way for each end": (
            ("x_new[s] += first *", "x_new[s] += (first + second) / 2 *"),
            ("x_new[s + 1] -= second *", "x_new[s + 1] -= (first + second) / 2 *"),
        ),
    },
}


# A solution of another assignment, handed in.
ANOTHER = {"assignment 1 again": "euler"}


def text_of(assignment: str, hand_in: str) -> str:
    """The text of a hand-in; `stub` and `solution` are files."""
    if hand_in in ("stub", "solution"):
        return (TEACH / assignment / f"{hand_in}.py").read_text()
    text = text_of(ANOTHER.get(hand_in, assignment), "solution")
    for old, new in WRONG[assignment][hand_in]:
        assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times"
        text = text.replace(old, new)
    return text
