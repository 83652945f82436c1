"""DART, translational joints and forces from Python: python dart_rope.py - STEPS_PER_FRAME ..."""

import sys
import time
import tomllib

import dartpy as dart
import numpy as np

spec = tomllib.load(open("spec.toml", "rb"))
rope, table = spec["rope"], np.loadtxt("initial.csv", delimiter=",", skiprows=1)
length = np.hypot(*(table[1, 2:4] - table[0, 2:4]))
for steps in map(int, sys.argv[2:]):
    world, joints, seconds = dart.simulation.World("rope"), [], []
    world.setGravity([*rope["gravity"], 0])
    world.setTimeStep(1 / steps)
    for node, (x, y, vx, vy) in enumerate(table[1:, 2:6].tolist(), 1):
        skeleton = dart.dynamics.Skeleton(f"node {node}")
        joint, body = skeleton.createTranslationalJoint2DAndBodyNodePair()
        body.setInertia(dart.dynamics.Inertia(rope["node_mass"], np.zeros(3), np.eye(3)))
        joint.setPositions([x, y])
        joint.setVelocities([vx, vy])
        for axis in range(2):
            joint.setDampingCoefficient(axis, rope["damping"])
        world.addSkeleton(skeleton)
        joints.append(joint)
    with open(f"rope-{steps}.csv", "w") as file:
        print("t,node,x,y,vx,vy", file=file)
        for frame in range(spec["frames"] + 1):
            start = time.process_time()
            for _ in range(steps if frame else 0):
                x = np.vstack([table[0, 2:4], *(joint.getPositions() for joint in joints)])
                along = np.diff(x, axis=0)
                stretch = 1 - length / np.linalg.norm(along, axis=1, keepdims=True)
                pull = np.pad(rope["stiffness"] * stretch * along, ((0, 1), (0, 0)))
                for joint, force in zip(joints, np.diff(pull, axis=0)):
                    joint.setForces(force)
                world.step()
            seconds.append((time.process_time() - start) / steps)
            print(f"{frame},0,0,0,0,0", file=file)
            for node, joint in enumerate(joints, 1):
                row = *joint.getPositions(), *joint.getVelocities()
                print(frame, node, *row, sep=",", file=file)
    print(steps, np.median(seconds[1:]), sep=",")
