"""Rapier: python rapier_rope.py spring|spherical[:ITERATIONS] STEPS_PER_FRAME ..."""

import sys
import time
import tomllib

import numpy as np
import rapier3d as rapier

spec = tomllib.load(open("spec.toml", "rb"))
rope, table = spec["rope"], np.loadtxt("initial.csv", delimiter=",", skiprows=1)
kind, iterations = sys.argv[1].split(":")
for steps in map(int, sys.argv[2:]):
    world, handles = rapier.PhysicsWorld(gravity=(*rope["gravity"], 0.0)), []
    world.integration_parameters.dt = 1 / steps
    world.integration_parameters.num_solver_iterations = int(iterations)
    for node, (x, y, vx, vy) in enumerate(table[:, 2:6].tolist()):
        if node in rope["pinned"]:
            builder = rapier.RigidBody.fixed().translation((x, y, 0.0))
        else:
            builder = rapier.RigidBody.dynamic().translation((x, y, 0.0)).linvel((vx, vy, 0.0))
            builder = builder.additional_mass(rope["node_mass"]).can_sleep(False)
            builder = builder.linear_damping(rope["damping"] / rope["node_mass"])
        handles.append(world.add_body(builder.build()))
        if node:
            length = float(np.hypot(*(table[node, 2:4] - table[node - 1, 2:4])))
            joint = rapier.SpringJointBuilder(length, rope["stiffness"], 0.0)
            world.impulse_joints.insert(*handles[-2:], joint.build(), True)
    seconds = []
    with open(f"rope-{steps}.csv", "w") as file:
        print("t,node,x,y,vx,vy", file=file)
        for frame in range(spec["frames"] + 1):
            start = time.process_time()
            for _ in range(steps if frame else 0):
                world.step()
            seconds.append((time.process_time() - start) / steps)
            for node, handle in enumerate(handles):
                body = world.rigid_bodies[handle]
                place, speed = body.translation, body.linvel
                print(frame, node, place.x, place.y, speed.x, speed.y, sep=",", file=file)
    print(steps, np.median(seconds[1:]), sep=",")
