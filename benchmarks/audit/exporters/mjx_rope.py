"""MJX, point masses and tendons: python mjx_rope.py Euler|RK4[:f64] STEPS_PER_FRAME ..."""

import sys
import time
import tomllib

import jax
import mujoco
import numpy as np
from mujoco import mjx

name, _, precision = sys.argv[1].partition(":")
jax.config.update("jax_enable_x64", precision == "f64")
spec = tomllib.load(open("spec.toml", "rb"))
rope, table = spec["rope"], np.loadtxt("initial.csv", delimiter=",", skiprows=1)
length = np.hypot(*(table[1, 2:4] - table[0, 2:4]))
bodies = tendons = ""
for node, (x, y) in enumerate(table[:, 2:4]):
    slide = '<joint type="slide" axis="{}" damping="' + str(rope["damping"]) + '"/>'
    slides = "".join(map(slide.format, ("1 0 0", "0 1 0"))) if node not in rope["pinned"] else ""
    bodies += f'<body pos="{x!s} {y!s} 0">{slides}<geom size="0.01" mass="{rope["node_mass"]}" '
    bodies += f'contype="0" conaffinity="0"/><site name="{node}"/></body>'
    if node:
        tendons += f'<spatial springlength="{length!s}" stiffness="{rope["stiffness"]}">'
        tendons += f'<site site="{node - 1}"/><site site="{node}"/></spatial>'
frame_of = jax.jit(
    lambda device, y, steps: jax.lax.fori_loop(0, steps, lambda _, y: mjx.step(device, y), y)
)
for steps in map(int, sys.argv[2:]):
    rest = f'timestep="{1 / steps!r}" gravity="{" ".join(map(str, rope["gravity"]))} 0"/>'
    model = mujoco.MjModel.from_xml_string(f"""<mujoco><option integrator="{name}" {rest}
      <worldbody>{bodies}</worldbody><tendon>{tendons}</tendon></mujoco>""")
    device, seconds = mjx.put_model(model), []
    state = mjx.make_data(device).replace(qvel=jax.numpy.array(table[1:, 4:6].ravel()))
    # A step turns some int32 into int64, which a loop must not do.
    kinds = jax.eval_shape(mjx.step, device, state)
    state = jax.tree.map(lambda given, kind: given.astype(kind.dtype), state, kinds)
    with open(f"rope-{steps}.csv", "w") as file:
        print("t,node,x,y,vx,vy", file=file)
        for frame in range(spec["frames"] + 1):
            start = time.process_time()
            state = jax.block_until_ready(frame_of(device, state, steps)) if frame else state
            seconds.append((time.process_time() - start) / steps)
            moved, speed = (np.array(each).reshape(-1, 2) for each in (state.qpos, state.qvel))
            rows = np.hstack([moved + table[1:, 2:4], speed])
            for node, row in enumerate(np.pad(rows, ((1, 0), (0, 0))).tolist()):
                print(frame, node, *row, sep=",", file=file)
    # The first frame compiles.
    print(steps, seconds[-1], sep=",")
