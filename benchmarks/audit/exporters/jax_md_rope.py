"""JAX MD: python jax_md_rope.py nve|nvt_langevin STEPS_PER_FRAME ..."""

import sys
import time
import tomllib

import jax
import jax.numpy as jnp
import numpy as np
from jax_md import simulate

jax.config.update("jax_enable_x64", True)
spec = tomllib.load(open("spec.toml", "rb"))
rope, table = spec["rope"], np.loadtxt("initial.csv", delimiter=",", skiprows=1)
length, mass = np.hypot(*(table[1, 2:4] - table[0, 2:4])), rope["node_mass"]


def energy(free, **_):
    x = jnp.concatenate([table[:1, 2:4], free])
    stretched = jnp.linalg.norm(jnp.diff(x, axis=0), axis=1) - length
    springs = 0.5 * rope["stiffness"] * jnp.sum(stretched**2)
    return springs - mass * jnp.sum(x @ jnp.array(rope["gravity"]))


for steps in map(int, sys.argv[2:]):
    drag = {"kT": 0.0, "gamma": rope["damping"] / mass} if sys.argv[1] != "nve" else {}
    shift = lambda x, dx, **_: x + dx  # noqa: E731
    start, step = getattr(simulate, sys.argv[1])(energy, shift, 1 / steps, **drag)
    state = start(jax.random.key(0), jnp.array(table[1:, 2:4]), mass=mass, kT=0.0)
    state = state.set(momentum=mass * jnp.array(table[1:, 4:6]))
    frame_of = jax.jit(
        lambda state, step=step, n=steps: jax.lax.fori_loop(0, n, lambda _, s: step(s), state)
    )
    seconds = []
    with open(f"rope-{steps}.csv", "w") as file:
        print("t,node,x,y,vx,vy", file=file)
        for frame in range(spec["frames"] + 1):
            begun = time.process_time()
            state = jax.block_until_ready(frame_of(state)) if frame else state
            seconds.append((time.process_time() - begun) / steps)
            rows = np.pad(np.hstack([state.position, state.momentum / mass]), ((1, 0), (0, 0)))
            for node, row in enumerate(rows):
                print(frame, node, *row, sep=",", file=file)
    # The first frame compiles.
    print(steps, seconds[-1], sep=",")
