"""Numbers that a step rounds to float32."""

from __future__ import annotations

import numpy as np

from ropeode.checking.check_ropes import in_other_units
from ropeode.checking.diagnosis.probe_states import LONGEST, Probe
from ropeode.problems import Problem
from ropeode.theory import Diagnosis
from ropeode.validation import listed

# How near to a number of float32, and to the middle between two, a step is tried: as a part of it.
_NEAR = 2.0**-40
# A jump exceeds the change that is as near to a number of float32, which no rounding makes, by this
# factor, and is at least this part of the state.
_JUMP, _LEAST_JUMP = 30.0, 1e-11
_NUDGES = 8
# Changes of the initial state: as small as float32's rounding, so that some are rounded up and
# some down; and far larger.
_SMALL, _LARGE = 3e-8, 1e-3
# How far the response to small changes is off a straight line, as a part of the rope's size, if
# states are rounded to 24 bits, or only a small part of a step is.
_LEAST, _MOST = 1e-11, 1e-6
_SMOOTH = 0.05
# A power of two changes no digit of a binary number, whether it has 24 or 53 bits.
_UNITS = 1024.0
_STATE = ("positions", "velocities")
_REMEDY = "convert nothing to float32; where a type is named, write float64"


def diagnose_single_precision(probe: Probe) -> Diagnosis | None:
    """Find the numbers that a stepper rounds to float32: state, time, step size, parameters.

    If a number is rounded, the result jumps where it passes the middle between two neighbours in
    float32, and is smooth at the neighbours themselves. If only what is computed from the state is
    rounded, the result responds to tiny changes of the state in jumps, and yet is the same to the
    last bit in a unit of length 1024 times smaller.
    """
    t, y = probe.t, probe.y
    dt = LONGEST / 8.0 * np.linspace(0.6, 1.0, len(t))
    free = probe.after(t, y, dt)[:, :, probe.problem.args.free > 0.0]
    if np.array_equal(free, free.astype(np.float32)):
        line = "states are rounded to float32: each number that the step returns is one of float32"
        return Diagnosis("float32", line, {"states_are_float32": True}, _REMEDY)
    jumps = _jumps_at_midpoints(probe, dt)
    if not jumps:
        return _inside(probe, float(dt[0]))
    names = [name.replace("_", " ") for name in jumps]
    one = len(names) == 1 and names[0] not in _STATE
    line = (
        f"{listed(names)} {'is' if one else 'are'} rounded to float32: the result jumps, by up to "
        f"{max(jumps.values()):.1e} of the rope's size, where {'it passes' if one else 'they pass'}"
        " the middle between two neighbouring numbers of float32, and nowhere else"
    )
    return Diagnosis("float32", line, {"jumps": jumps, "states_are_float32": False}, _REMEDY)


def _jumps_at_midpoints(probe: Probe, dt: np.ndarray) -> dict[str, float]:
    """The jumps that rounding makes, by what is rounded, as parts of the state's size."""
    problem, size = probe.problem, float(np.max(np.abs(probe.y)))
    own = {"dt": dt, "t": probe.t, "positions": probe.y[:, 0], "velocities": probe.y[:, 1]}
    own |= {name: value for name, value in problem.args._asdict().items() if np.any(value)}
    found = {}
    for name in own.keys() - {"free"}:
        results = []
        for values in _around(own[name]):
            each = {**own, name: values}
            args = problem.args._replace(**{n: each[n] for n in problem.args._fields if n in own})
            y = np.stack([each[half] for half in _STATE], axis=1)
            results.append(probe.after(each["t"], y, each["dt"], problem.changed(args=args)))
        smooth, jumps = (
            np.max(np.abs(results[i + 1] - results[i]), axis=(1, 2, 3)) for i in (0, 2)
        )
        # It jumps at each state: a number that depends on it may happen to be rounded up at one.
        if np.min(jumps) > max(_JUMP * np.max(smooth), _LEAST_JUMP * size):
            found[name] = float(np.max(jumps)) / size
    return {name: found[name] for name in own if name in found}


def _around(values: np.ndarray) -> list[np.ndarray]:
    """On both sides of the nearest numbers of float32, and of the middle to the next ones."""
    own = values.astype(np.float32)
    following = np.nextafter(own, np.float32(np.inf)).astype(float)
    exact = own.astype(float)
    return [
        at * (1.0 + side * _NEAR) for at in (exact, (exact + following) / 2.0) for side in (-1, 1)
    ]


def _inside(probe: Probe, dt: float) -> Diagnosis | None:
    """Whether a number that a step computes from the state is rounded to float32."""
    problem, y = probe.problem, probe.y[0]
    direction = np.random.default_rng(5).normal(size=y.shape) * problem.args.free[:, None]
    factors = (np.arange(_NUDGES) / (_NUDGES - 1.0)).reshape(-1, 1, 1, 1)
    states = np.concatenate([y + factors * size * direction for size in (_SMALL, _LARGE)])

    def after(states: np.ndarray, problem: Problem) -> np.ndarray:
        every = np.ones(len(states))
        return probe.after(probe.t[0] * every, states, dt * every, problem)

    results = after(states, problem)
    scaled = after(_UNITS * states, in_other_units(problem, _UNITS))
    small, large = (
        float(np.max(np.abs(each - (each[0] + factors * (each[-1] - each[0]))))) / problem.scale
        for each in np.split(results, 2)
    )
    smooth = large <= _SMOOTH * _LARGE
    if not (_LEAST <= small <= _MOST and smooth and np.array_equal(scaled, _UNITS * results)):
        return None
    return Diagnosis(
        "float32",
        "a number inside the step is rounded to float32: the result responds to changes of "
        f"{_SMALL:.0e} in jumps of {small:.1e} of the rope's size (float64: 1e-16)",
        {"jumps": {"state": small}, "states_are_float32": False},
        _REMEDY,
    )
