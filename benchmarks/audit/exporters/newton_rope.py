"""Newton: python newton_rope.py SolverSemiImplicit|SolverXPBD[:ITERATIONS] STEPS_PER_FRAME ..."""

import sys
import time
import tomllib

import newton
import numpy as np
import warp

warp.config.quiet = True
spec = tomllib.load(open("spec.toml", "rb"))
rope, table = spec["rope"], np.loadtxt("initial.csv", delimiter=",", skiprows=1)
name, _, iterations = sys.argv[1].partition(":")
for steps in map(int, sys.argv[2:]):
    builder = newton.ModelBuilder(gravity=warp.vec3(*rope["gravity"], 0.0))
    for node, (x, y, vx, vy) in enumerate(table[:, 2:6].tolist()):
        mass = 0.0 if node in rope["pinned"] else rope["node_mass"]
        # Particles of radius 0 do not collide.
        builder.add_particle(warp.vec3(x, y, 0.0), warp.vec3(vx, vy, 0.0), mass, 0.0)
        builder.add_spring(node - 1, node, rope["stiffness"], 0.0, 0.0) if node else None
    builder.color()
    model = builder.finalize(device="cpu")
    model.particle_max_velocity = 1e9
    more = {"iterations": int(iterations)} if iterations else {}
    solver, seconds = getattr(newton.solvers, name)(model, **more), []
    one, two = model.state(), model.state()
    with open(f"rope-{steps}.csv", "w") as file:
        print("t,node,x,y,vx,vy", file=file)
        for frame in range(spec["frames"] + 1):
            start = time.process_time()
            for _ in range(steps if frame else 0):
                one.clear_forces()
                solver.step(one, two, None, None, 1 / steps)
                one, two = two, one
            seconds.append((time.process_time() - start) / steps)
            rows = np.hstack([one.particle_q.numpy()[:, :2], one.particle_qd.numpy()[:, :2]])
            for node, row in enumerate(rows.tolist()):
                print(frame, node, *row, sep=",", file=file)
    print(steps, np.median(seconds[1:]), sep=",")
