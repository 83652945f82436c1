"""PyBullet, forces of springs from Python: python bullet_rope.py multi|rigid STEPS_PER_FRAME ..."""

import sys
import time
import tomllib

import numpy as np
import pybullet as bullet

spec = tomllib.load(open("spec.toml", "rb"))
rope, table = spec["rope"], np.loadtxt("initial.csv", delimiter=",", skiprows=1)
length = np.hypot(*(table[1, 2:4] - table[0, 2:4]))
bullet.connect(bullet.DIRECT)
rate = rope["damping"] / rope["node_mass"]
for steps in map(int, sys.argv[2:]):
    bullet.resetSimulation()
    bullet.setGravity(*rope["gravity"], 0)
    bullet.setTimeStep(1 / steps)
    ball, bodies, seconds = bullet.createCollisionShape(bullet.GEOM_SPHERE, 0.01), [], []
    for node, (x, y, vx, vy) in enumerate(table[:, 2:6]):
        mass = 0 if node in rope["pinned"] else rope["node_mass"]
        place = {"basePosition": (x, y, 0), "useMaximalCoordinates": sys.argv[1] == "rigid"}
        bodies.append(bullet.createMultiBody(mass, ball, **place))
        bullet.resetBaseVelocity(bodies[-1], (vx, vy, 0))
        # A rigid body loses a part of its velocity in each unit of time.
        drag = 1 - np.exp(-rate) if sys.argv[1] == "rigid" else rate
        bullet.changeDynamics(bodies[-1], -1, linearDamping=drag, angularDamping=0)
        bullet.setCollisionFilterGroupMask(bodies[-1], -1, 0, 0)
    with open(f"rope-{steps}.csv", "w") as file:
        print("t,node,x,y,vx,vy", file=file)
        for frame in range(spec["frames"] + 1):
            start = time.process_time()
            for _ in range(steps if frame else 0):
                x = np.array([bullet.getBasePositionAndOrientation(body)[0] for body in bodies])
                along = np.diff(x, axis=0)
                stretch = 1 - length / np.linalg.norm(along, axis=1, keepdims=True)
                pull = np.pad(rope["stiffness"] * stretch * along, ((1, 1), (0, 0)))
                for body, force, at in zip(bodies[1:], np.diff(pull, axis=0)[1:], x[1:]):
                    bullet.applyExternalForce(body, -1, force, at, bullet.WORLD_FRAME)
                bullet.stepSimulation()
            seconds.append((time.process_time() - start) / steps)
            for node, body in enumerate(bodies):
                place = bullet.getBasePositionAndOrientation(body)[0][:2]
                print(frame, node, *place, *bullet.getBaseVelocity(body)[0][:2], sep=",", file=file)
    print(steps, np.median(seconds[1:]), sep=",")
