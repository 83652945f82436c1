"""Taichi, the step of its cloth example: python taichi_rope.py f32|f64 STEPS_PER_FRAME ..."""

import sys
import time
import tomllib

import numpy as np
import taichi as ti

real = getattr(ti, sys.argv[1])
ti.init(arch=ti.cpu, default_fp=real, log_level=ti.ERROR, cpu_max_num_threads=1)
spec = tomllib.load(open("spec.toml", "rb"))
rope, table = spec["rope"], np.loadtxt("initial.csv", delimiter=",", skiprows=1)
nodes, stiffness = len(table), rope["stiffness"]
length, mass = float(np.hypot(*(table[1, 2:4] - table[0, 2:4]))), rope["node_mass"]
rate, gravity = rope["damping"] / mass, ti.Vector(rope["gravity"])
x, v = (ti.Vector.field(2, real, nodes) for _ in range(2))


@ti.kernel
def frame_of(steps: int, dt: real):
    ti.loop_config(serialize=True)
    for _ in range(steps):
        for i in range(1, nodes):
            pull = gravity * mass
            for j in ti.static((-1, 1)):
                if i + j < nodes:
                    apart = x[i + j] - x[i]
                    pull += stiffness * (apart.norm() - length) * apart.normalized()
            v[i] += dt * pull / mass
        for i in range(1, nodes):
            v[i] *= ti.exp(-rate * dt)
            x[i] += dt * v[i]


for steps in map(int, sys.argv[2:]):
    x.from_numpy(table[:, 2:4]), v.from_numpy(table[:, 4:6])
    seconds = []
    with open(f"rope-{steps}.csv", "w") as file:
        print("t,node,x,y,vx,vy", file=file)
        for frame in range(spec["frames"] + 1):
            start = time.process_time()
            frame_of(steps if frame else 0, 1 / steps)
            seconds.append((time.process_time() - start) / steps)
            for node, row in enumerate(np.hstack([x.to_numpy(), v.to_numpy()]).tolist()):
                print(frame, node, *row, sep=",", file=file)
    print(steps, np.median(seconds[1:]), sep=",")
