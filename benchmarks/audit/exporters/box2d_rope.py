"""Box2D, distance joints: python box2d_rope.py soft|stiff[:ITERATIONS] STEPS_PER_FRAME ..."""

import sys
import time
import tomllib

import Box2D
import numpy as np

spec = tomllib.load(open("spec.toml", "rb"))
rope, table = spec["rope"], np.loadtxt("initial.csv", delimiter=",", skiprows=1)
kind, iterations = sys.argv[1].split(":")
for steps in map(int, sys.argv[2:]):
    world, bodies = Box2D.b2World(gravity=rope["gravity"], doSleep=False), []
    for node, (x, y, vx, vy) in enumerate(table[:, 2:6].tolist()):
        place = {"position": (x, y), "linearVelocity": (vx, vy)}
        if node in rope["pinned"]:
            body = world.CreateStaticBody(position=(x, y))
        else:
            body = world.CreateDynamicBody(**place, fixedRotation=True)
            body.massData = Box2D.b2MassData(mass=rope["node_mass"], center=(0, 0), I=0)
            body.linearDamping = rope["damping"] / rope["node_mass"]
        if bodies:
            joint = {"localAnchorA": (0, 0), "localAnchorB": (0, 0), "dampingRatio": 0}
            if kind == "soft":
                # The stiffness is given as a frequency of the two bodies' reduced mass.
                reduced = rope["node_mass"] / (1 if node - 1 in rope["pinned"] else 2)
                joint["frequencyHz"] = np.sqrt(rope["stiffness"] / reduced) / (2 * np.pi)
            length = float(np.hypot(*(table[node, 2:4] - table[node - 1, 2:4])))
            world.CreateDistanceJoint(bodyA=bodies[-1], bodyB=body, length=length, **joint)
        bodies.append(body)
    seconds = []
    with open(f"rope-{steps}.csv", "w") as file:
        print("t,node,x,y,vx,vy", file=file)
        for frame in range(spec["frames"] + 1):
            start = time.process_time()
            for _ in range(steps if frame else 0):
                world.Step(1 / steps, int(iterations), int(iterations))
            seconds.append((time.process_time() - start) / steps)
            for node, body in enumerate(bodies):
                print(frame, node, *body.position, *body.linearVelocity, sep=",", file=file)
    print(steps, np.median(seconds[1:]), sep=",")
