"""Drake, planar joints and springs: python drake_rope.py SCHEME|discrete STEPS_PER_FRAME ..."""

import sys
import time
import tomllib

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import LinearSpringDamper, PlanarJoint, SpatialInertia
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator

spec = tomllib.load(open("spec.toml", "rb"))
rope, table = spec["rope"], np.loadtxt("initial.csv", delimiter=",", skiprows=1)
length, drag, zero = np.hypot(*(table[1, 2:4] - table[0, 2:4])), rope["damping"], np.zeros(3)
for steps in map(int, sys.argv[2:]):
    plant = MultibodyPlant(1 / steps if sys.argv[1] == "discrete" else 0.0)
    plant.mutable_gravity_field().set_gravity_vector([*rope["gravity"], 0])
    last, ball = plant.world_body(), SpatialInertia.SolidSphereWithMass(rope["node_mass"], 0.1)
    for node in range(1, len(table)):
        body = plant.AddRigidBody(f"node {node}", ball)
        ends = plant.world_frame(), body.body_frame()
        plant.AddJoint(PlanarJoint(f"joint {node}", *ends, damping=[drag, drag, 0]))
        spring = LinearSpringDamper(last, zero, body, zero, length, rope["stiffness"], 0.0)
        last, _ = body, plant.AddForceElement(spring)
    plant.Finalize()
    simulator, state = Simulator(plant), np.zeros((2, len(table) - 1, 3))
    if sys.argv[1] != "discrete":
        ResetIntegratorFromFlags(simulator, sys.argv[1], 1 / steps)
        simulator.get_mutable_integrator().set_fixed_step_mode(True)
    context = simulator.get_mutable_context()
    state[0, :, :2], state[1, :, :2] = table[1:, 2:4], table[1:, 4:6]
    plant.SetPositionsAndVelocities(context, state.ravel())
    seconds = []
    with open(f"rope-{steps}.csv", "w") as file:
        print("t,node,x,y,vx,vy", file=file)
        for frame in range(spec["frames"] + 1):
            start = time.process_time()
            simulator.AdvanceTo(frame) if frame else None
            seconds.append((time.process_time() - start) / steps)
            x, v = plant.GetPositionsAndVelocities(context).reshape(2, -1, 3)
            for node, row in enumerate(np.pad(np.hstack([x[:, :2], v[:, :2]]), ((1, 0), (0, 0)))):
                print(frame, node, *row, sep=",", file=file)
    print(steps, np.median(seconds[1:]), sep=",")
