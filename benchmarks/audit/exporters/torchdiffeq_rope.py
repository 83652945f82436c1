"""torchdiffeq: python torchdiffeq_rope.py METHOD[:MAX_ORDER] STEPS_PER_FRAME ..."""

import sys
import time
import tomllib

import numpy as np
import torch
from torchdiffeq import odeint

torch.set_num_threads(1)
spec = tomllib.load(open("spec.toml", "rb"))
rope, table = spec["rope"], np.loadtxt("initial.csv", delimiter=",", skiprows=1)
length, mass = np.hypot(*(table[1, 2:4] - table[0, 2:4])), rope["node_mass"]
gravity, free = torch.tensor(rope["gravity"], dtype=torch.float64), torch.ones(len(table), 1)
free[rope["pinned"]] = 0.0
start = torch.tensor(np.stack([table[:, 2:4], table[:, 4:6]]))


def rhs(t, y):
    x, v = y
    along = torch.diff(x, dim=0)
    stretch = 1 - length / torch.linalg.norm(along, dim=1, keepdim=True)
    pull = torch.nn.functional.pad(rope["stiffness"] * stretch * along, (0, 0, 1, 1))
    force = torch.diff(pull, dim=0) - rope["damping"] * v
    return torch.stack([v, free * (force / mass + gravity)])


name, _, order = sys.argv[1].partition(":")
more = {"max_order": int(order)} if order else {}
for steps in map(int, sys.argv[2:]):
    y, seconds = start, []
    with open(f"rope-{steps}.csv", "w") as file, torch.no_grad():
        print("t,node,x,y,vx,vy", file=file)
        times = torch.arange(spec["frames"] + 1, dtype=torch.float64)
        begun = time.process_time()
        states = odeint(rhs, start, times, method=name, options={"step_size": 1 / steps, **more})
        seconds = (time.process_time() - begun) / steps / spec["frames"]
        for frame, (x, v) in enumerate(states.tolist()):
            for node in range(len(table)):
                print(frame, node, *x[node], *v[node], sep=",", file=file)
    print(steps, seconds, sep=",")
