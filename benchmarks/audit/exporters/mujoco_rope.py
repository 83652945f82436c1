"""MuJoCo, point masses and tendons: python mujoco_rope.py Euler|implicit|... STEPS_PER_FRAME ..."""

import sys
import time
import tomllib

import mujoco
import numpy as np

spec = tomllib.load(open("spec.toml", "rb"))
rope, table = spec["rope"], np.loadtxt("initial.csv", delimiter=",", skiprows=1)
length = np.hypot(*(table[1, 2:4] - table[0, 2:4]))
bodies = tendons = ""
for node, (x, y) in enumerate(table[:, 2:4]):
    slides = "".join(
        f'<joint type="slide" axis="{axis}" damping="{rope["damping"]}"/>'
        for axis in ("1 0 0", "0 1 0")
        if node not in rope["pinned"]
    )
    bodies += f'<body pos="{x!s} {y!s} 0">{slides}<geom size="0.01" mass="{rope["node_mass"]}" '
    bodies += f'contype="0" conaffinity="0"/><site name="{node}"/></body>'
    if node:
        tendons += f'<spatial springlength="{length!s}" stiffness="{rope["stiffness"]}">'
        tendons += f'<site site="{node - 1}"/><site site="{node}"/></spatial>'
for steps in map(int, sys.argv[2:]):
    option = f'<option integrator="{sys.argv[1]}" timestep="{1 / steps!r}" '
    option += f'gravity="{rope["gravity"][0]} {rope["gravity"][1]} 0"/>'
    model = mujoco.MjModel.from_xml_string(f"""<mujoco>{option}
      <worldbody>{bodies}</worldbody><tendon>{tendons}</tendon></mujoco>""")
    data, seconds, speed = mujoco.MjData(model), [], np.zeros(6)
    data.qvel[:] = table[1:, 4:6].ravel()
    with open(f"rope-{steps}.csv", "w") as file:
        print("t,node,x,y,vx,vy", file=file)
        for frame in range(spec["frames"] + 1):
            start = time.process_time()
            mujoco.mj_step(model, data, steps if frame else 0)
            seconds.append((time.process_time() - start) / steps)
            mujoco.mj_forward(model, data)
            for node in range(len(table)):
                mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, node + 1, speed, 0)
                print(frame, node, *data.xipos[node + 1, :2], *speed[3:5], sep=",", file=file)
    print(steps, np.median(seconds[1:]), sep=",")
