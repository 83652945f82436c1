"""REBOUND, Kepler or Pleiades: python rebound_stars.py INTEGRATOR[:SETTING=VALUE] STEPS ..."""

import sys
import time
import tomllib

import numpy as np
import rebound

spec = tomllib.load(open("spec.toml", "rb"))
table = np.atleast_2d(np.loadtxt("initial.csv", delimiter=",", skiprows=1))
kepler = len(table) == 1
# A long run has a frame for each unit of time.
length = {"kepler": 2 * np.pi / 20, "pleiades": 3.0 / 20}.get(spec["problem"], 1.0)
name, *settings = sys.argv[1].split(":")
for steps in map(int, sys.argv[2:]):
    simulation = rebound.Simulation()
    # The sun, whose planet weighs nothing; seven stars of masses 1 to 7.
    if kepler:
        simulation.add(m=1.0)
    for node, (x, y, vx, vy) in enumerate(table[:, 2:6].tolist()):
        simulation.add(m=0.0 if kepler else node + 1.0, x=x, y=y, vx=vx, vy=vy)
    simulation.integrator = name
    for key, value in (setting.split("=") for setting in settings):
        setattr(simulation.integrator, key, float(value) if "." in value else int(value))
    simulation.dt = length / steps
    seconds = []
    with open(f"rope-{steps}.csv", "w") as file:
        print("t,node,x,y,vx,vy", file=file)
        for frame in range(spec["frames"] + 1):
            begun = time.process_time()
            simulation.steps(steps if frame else 0)
            simulation.synchronize()
            seconds.append((time.process_time() - begun) / steps)
            for node, star in enumerate(simulation.particles[kepler:]):
                print(frame * length, node, star.x, star.y, star.vx, star.vy, sep=",", file=file)
    print(steps, np.median(seconds[1:]), sep=",")
