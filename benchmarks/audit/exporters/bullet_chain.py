"""PyBullet, a multi-body of revolute joints: python bullet_chain.py - STEPS_PER_FRAME ..."""

import sys
import time
import tomllib

import numpy as np
import pybullet as bullet

spec = tomllib.load(open("spec.toml", "rb"))
rope, table = spec["rope"], np.loadtxt("initial.csv", delimiter=",", skiprows=1)
links, speeds = np.diff(table[:, 2:4], axis=0), np.diff(table[:, 4:6], axis=0)
turning = (links[:, 0] * speeds[:, 1] - links[:, 1] * speeds[:, 0]) / np.sum(links**2, axis=1)
count, ends = len(links), np.pad(links, ((0, 0), (0, 1)))
NAMES = """linkMasses linkCollisionShapeIndices linkVisualShapeIndices linkPositions
    linkOrientations linkInertialFramePositions linkInertialFrameOrientations
    linkParentIndices linkJointTypes linkJointAxis""".split()
bullet.connect(bullet.DIRECT)
for steps in map(int, sys.argv[2:]):
    bullet.resetSimulation()
    bullet.setGravity(*rope["gravity"], 0)
    bullet.setTimeStep(1 / steps)
    shapes, turns = [[-1] * count] * 2, [[(0, 0, 0, 1)] * count] * 2
    joints = range(count), [bullet.JOINT_REVOLUTE] * count, [(0, 0, 1)] * count
    starts = np.vstack([np.zeros(3), ends[:-1]])
    links = [[rope["node_mass"]] * count, *shapes, starts, turns[0], ends, turns[1], *joints]
    chain = bullet.createMultiBody(0, **dict(zip(NAMES, links)))
    for link, speed in enumerate(np.diff(turning, prepend=0.0)):
        free = {"linearDamping": 0, "angularDamping": 0, "jointDamping": 0}
        bullet.changeDynamics(chain, link, **free, localInertiaDiagonal=(1e-9, 1e-9, 1e-9))
        bullet.setJointMotorControl2(chain, link, bullet.VELOCITY_CONTROL, force=0)
        bullet.resetJointState(chain, link, 0.0, speed)
    seconds = []
    with open(f"rope-{steps}.csv", "w") as file:
        print("t,node,x,y,vx,vy", file=file)
        for frame in range(spec["frames"] + 1):
            start = time.process_time()
            for _ in range(steps if frame else 0):
                bullet.stepSimulation()
            seconds.append((time.process_time() - start) / steps)
            print(f"{frame},0,0,0,0,0", file=file)
            for node, state in enumerate(bullet.getLinkStates(chain, range(count), 1, 1), 1):
                print(frame, node, *state[0][:2], *state[6][:2], sep=",", file=file)
    print(steps, np.median(seconds[1:]), sep=",")
