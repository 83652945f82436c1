"""ASE: python ase_rope.py VelocityVerlet|Langevin STEPS_PER_FRAME ..."""

import sys
import time
import tomllib

import numpy as np
from ase import Atoms
from ase.calculators.calculator import Calculator
from ase.constraints import FixAtoms
from ase.md import Langevin, VelocityVerlet

spec = tomllib.load(open("spec.toml", "rb"))
rope, table = spec["rope"], np.loadtxt("initial.csv", delimiter=",", skiprows=1)
length, mass = np.hypot(*(table[1, 2:4] - table[0, 2:4])), rope["node_mass"]


class Springs(Calculator):
    implemented_properties = ("energy", "forces")

    def calculate(self, atoms=None, properties=(), system_changes=()):
        along = np.diff(atoms.positions, axis=0)
        stretch = 1 - length / np.linalg.norm(along, axis=1, keepdims=True)
        pull = np.pad(rope["stiffness"] * stretch * along, ((1, 1), (0, 0)))
        weight = mass * np.array([*rope["gravity"], 0.0])
        self.results = {"forces": np.diff(pull, axis=0) + weight, "energy": 0.0}


for steps in map(int, sys.argv[2:]):
    atoms = Atoms(f"H{len(table)}", np.pad(table[:, 2:4], ((0, 0), (0, 1))), calculator=Springs())
    atoms.set_masses([mass] * len(table))
    atoms.set_velocities(np.pad(table[:, 4:6], ((0, 0), (0, 1))))
    atoms.set_constraint(FixAtoms(rope["pinned"]))
    drag = {"temperature_K": 0.0, "friction": rope["damping"] / mass, "fixcm": False}
    method, more = (Langevin, drag) if sys.argv[1] == "Langevin" else (VelocityVerlet, {})
    run, seconds = method(atoms, 1 / steps, **more), []
    with open(f"rope-{steps}.csv", "w") as file:
        print("t,node,x,y,vx,vy", file=file)
        for frame in range(spec["frames"] + 1):
            start = time.process_time()
            run.run(steps) if frame else None
            seconds.append((time.process_time() - start) / steps)
            rows = np.hstack([atoms.positions[:, :2], atoms.get_velocities()[:, :2]])
            for node, row in enumerate(rows):
                print(frame, node, *row, sep=",", file=file)
    print(steps, np.median(seconds[1:]), sep=",")
