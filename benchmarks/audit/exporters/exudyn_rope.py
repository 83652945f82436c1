"""Exudyn: python exudyn_rope.py SOLVER STEPS_PER_FRAME ..."""

import sys
import time
import tomllib

import exudyn as exu
import exudyn.itemInterface as item
import numpy as np

spec = tomllib.load(open("spec.toml", "rb"))
rope, table = spec["rope"], np.loadtxt("initial.csv", delimiter=",", skiprows=1)
length = np.hypot(*(table[1, 2:4] - table[0, 2:4]))
spring = {"referenceLength": length, "stiffness": rope["stiffness"]}
drag = {"stiffness": [0.0] * 3, "damping": [rope["damping"]] * 3}
weight = [*(rope["node_mass"] * np.array(rope["gravity"])), 0]
settings, kinds = exu.SimulationSettings(), exu.OutputVariableType
shown = kinds.Position, kinds.Velocity
settings.solution.file.write, run = False, settings.timeIntegration
run.automaticStepSize, run.generalizedAlpha.spectralRadius = False, 1.0
for steps in map(int, sys.argv[2:]):
    container, seconds, run.numberOfSteps = exu.SystemContainer(), [], steps
    system = container.AddSystem()
    points = [system.AddNode(item.NodePointGround(referenceCoordinates=[0, 0, 0]))]
    markers = [system.AddMarker(item.MarkerNodePosition(nodeNumber=points[0]))]
    for x, y, *speed in table[1:, 2:6].tolist():
        points.append(
            system.AddNode(item.NodePoint2D(referenceCoordinates=[x, y], initialVelocities=speed))
        )
        system.AddObject(item.ObjectMassPoint2D(mass=rope["node_mass"], nodeNumber=points[-1]))
        markers.append(system.AddMarker(item.MarkerNodePosition(nodeNumber=points[-1])))
        system.AddLoad(item.LoadForceVector(markerNumber=markers[-1], loadVector=weight))
        ends, fixed = {"markerNumbers": markers[-2:]}, {"markerNumbers": markers[:1] + markers[-1:]}
        system.AddObject(item.ObjectConnectorSpringDamper(**ends, **spring))
        system.AddObject(item.ObjectConnectorCartesianSpringDamper(**fixed, **drag))
    system.Assemble()
    with open(f"rope-{steps}.csv", "w") as file:
        print("t,node,x,y,vx,vy", file=file)
        for frame in range(spec["frames"] + 1):
            run.startTime, run.endTime, begun = max(frame - 1, 0), frame, time.process_time()
            kind = getattr(exu.DynamicSolverType, sys.argv[1])
            system.SolveDynamic(settings, kind, updateInitialValues=True) if frame else None
            seconds.append((time.process_time() - begun) / steps)
            for node, point in enumerate(points):
                both = [system.GetNodeOutput(point, each)[:2] for each in shown]
                print(frame, node, *both[0], *both[1], sep=",", file=file)
    print(steps, np.median(seconds[1:]), sep=",")
