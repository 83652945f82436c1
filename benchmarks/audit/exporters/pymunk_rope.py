"""Chipmunk (pymunk): python pymunk_rope.py springs|links STEPS_PER_FRAME ..."""

import sys
import time
import tomllib

import numpy as np
import pymunk

spec = tomllib.load(open("spec.toml", "rb"))
rope, table = spec["rope"], np.loadtxt("initial.csv", delimiter=",", skiprows=1)
length = float(np.hypot(*(table[1, 2:4] - table[0, 2:4])))
for steps in map(int, sys.argv[2:]):
    space = pymunk.Space()
    space.gravity = tuple(rope["gravity"])
    # What part of a velocity is left after one unit of time.
    space.damping = float(np.exp(-rope["damping"] / rope["node_mass"]))
    bodies = []
    for _, node, x, y, vx, vy in table.tolist():
        kind = pymunk.Body.STATIC if node in rope["pinned"] else pymunk.Body.DYNAMIC
        body = pymunk.Body(rope["node_mass"], 1.0, body_type=kind)
        body.position, body.velocity = (x, y), (vx, vy)
        space.add(body)
        if bodies and sys.argv[1] == "springs":
            ends = bodies[-1], body, (0, 0), (0, 0)
            space.add(pymunk.DampedSpring(*ends, length, rope["stiffness"], 0.0))
        elif bodies:
            space.add(pymunk.PinJoint(bodies[-1], body))
        bodies.append(body)
    seconds = []
    with open(f"rope-{steps}.csv", "w") as file:
        print("t,node,x,y,vx,vy", file=file)
        for frame in range(spec["frames"] + 1):
            start = time.process_time()
            for _ in range(steps if frame else 0):
                space.step(1.0 / steps)
            seconds.append((time.process_time() - start) / steps)
            for node, body in enumerate(bodies):
                print(frame, node, *body.position, *body.velocity, sep=",", file=file)
    print(steps, np.median(seconds[1:]), sep=",")
