"""OpenMM, nm, ps and amu: python openmm_rope.py INTEGRATOR[:late] STEPS_PER_FRAME ..."""

import sys
import time
import tomllib

import numpy as np
import openmm

spec = tomllib.load(open("spec.toml", "rb"))
rope, table = spec["rope"], np.loadtxt("initial.csv", delimiter=",", skiprows=1)
length, rate = np.hypot(*(table[1, 2:4] - table[0, 2:4])), rope["damping"] / rope["node_mass"]
name, _, late = sys.argv[1].partition(":")
for steps in map(int, sys.argv[2:]):
    system, springs = openmm.System(), openmm.HarmonicBondForce()
    weight = openmm.CustomExternalForce("-m * (gx * x + gy * y)")
    for letter, value in zip(("m", "gx", "gy"), (rope["node_mass"], *rope["gravity"])):
        weight.addGlobalParameter(letter, value)
    for node in range(len(table)):
        system.addParticle(0 if node in rope["pinned"] else rope["node_mass"])
        weight.addParticle(node)
        if node:
            springs.addBond(node - 1, node, length, rope["stiffness"])
    system.addForce(springs), system.addForce(weight)
    integrator = getattr(openmm, name)(*(() if "Verlet" in name else (0, rate)), 1 / steps)
    context = openmm.Context(system, integrator, openmm.Platform.getPlatformByName("Reference"))
    context.setPositions(np.pad(table[:, 2:4], ((0, 0), (0, 1))))
    given = np.pad(table[:, 4:6], ((0, 0), (0, 1)))
    shift = np.where(table[:, 1:2] > 0, 0.5 / steps / rope["node_mass"], 0.0) if late else 0.0
    # The velocities of leapfrog are those of half a step earlier.
    context.setVelocities(given - shift * context.getState(forces=True).getForces(True)._value)
    seconds = []
    with open(f"rope-{steps}.csv", "w") as file:
        print("t,node,x,y,vx,vy", file=file)
        for frame in range(spec["frames"] + 1):
            start = time.process_time()
            integrator.step(steps if frame else 0)
            seconds.append((time.process_time() - start) / steps)
            state = context.getState(positions=True, velocities=True, forces=True)
            speeds = state.getVelocities(True)._value + shift * state.getForces(True)._value
            for node, place in enumerate(state.getPositions(True)._value):
                print(frame, node, *place[:2], *speeds[node, :2], sep=",", file=file)
    print(steps, np.median(seconds[1:]), sep=",")
