"""MuJoCo, hinges between massless links: python mujoco_chain.py INTEGRATOR STEPS_PER_FRAME ..."""

import sys
import time
import tomllib

import mujoco
import numpy as np

spec = tomllib.load(open("spec.toml", "rb"))
rope, table = spec["rope"], np.loadtxt("initial.csv", delimiter=",", skiprows=1)
links, speeds = np.diff(table[:, 2:4], axis=0), np.diff(table[:, 4:6], axis=0)
turning = (links[:, 0] * speeds[:, 1] - links[:, 1] * speeds[:, 0]) / np.sum(links**2, axis=1)
chain, at = "", np.zeros(2)
for x, y in links:
    chain += f'<body pos="{at[0]!s} {at[1]!s} 0"><joint axis="0 0 1"/><inertial '
    chain += f'pos="{x!s} {y!s} 0" mass="{rope["node_mass"]}" diaginertia="1e-12 1e-12 1e-12"/>'
    at = np.array([x, y])
chain += "</body>" * len(links)
for steps in map(int, sys.argv[2:]):
    option = f'<option integrator="{sys.argv[1]}" timestep="{1 / steps!r}" '
    option += f'gravity="{rope["gravity"][0]} {rope["gravity"][1]} 0"/>'
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco>{option}<worldbody>{chain}</worldbody></mujoco>"
    )
    data, seconds, speed = mujoco.MjData(model), [], np.zeros(6)
    data.qvel[:] = np.diff(turning, prepend=0.0)
    with open(f"rope-{steps}.csv", "w") as file:
        print("t,node,x,y,vx,vy", file=file)
        for frame in range(spec["frames"] + 1):
            start = time.process_time()
            mujoco.mj_step(model, data, steps if frame else 0)
            seconds.append((time.process_time() - start) / steps)
            mujoco.mj_forward(model, data)
            for node in range(len(table)):
                mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, node, speed, 0)
                print(frame, node, *data.xipos[node, :2], *speed[3:5], sep=",", file=file)
    print(steps, np.median(seconds[1:]), sep=",")
