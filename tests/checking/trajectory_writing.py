"""Files of trajectories, as other programs write them; shares nothing with readers."""

from __future__ import annotations

import h5netcdf
import numpy as np

from ropeode.simulation import simulate


def node_values(problem, states, velocities=True):
    """``(times, nodes, columns)``."""
    parts = [problem.quantity(name, states) for name in problem.quantities]
    return np.concatenate(parts if velocities else parts[:1], axis=2)


def csv_lines(times, values, dt=None, digits="%.17g", names=None):
    """The lines of a CSV file, without their ends."""
    usual = {2: "x,y", 4: "x,y,vx,vy", 3: "x,y,z", 6: "x,y,z,vx,vy,vz"}
    names = names or usual[values.shape[2]]
    lines = [] if dt is None else [f"# dt = {dt!r}"]
    lines.append(f"t,node,{names}")
    for t, sample in zip(times, values, strict=True):
        for node, row in enumerate(sample):
            lines.append(",".join([digits % t, str(node), *(digits % number for number in row)]))
    return lines


def write_csv(path, times, values, dt=None, **how):
    path.write_text("".join(f"{line}\n" for line in csv_lines(times, values, dt, **how)))
    return path


def arrays_of(times, values, dim):
    """By their names."""
    arrays = {"t": times, "positions": values[:, :, :dim], "velocities": values[:, :, dim:]}
    return arrays if values.shape[2] > dim else {name: arrays[name] for name in ("t", "positions")}


def write_npz(path, times, values, dt=None, dim=2):
    arrays = arrays_of(times, values, dim)
    if dt is not None:
        arrays["dt"] = np.float64(dt)
    np.savez(path, **{name: np.ascontiguousarray(array) for name, array in arrays.items()})
    return path


def write_netcdf(path, times, values, dt=None, dim=2):
    with h5netcdf.File(path, "w") as file:
        file.dimensions = {"time": len(times), "node": values.shape[1], "axis": dim}
        for name, array in arrays_of(times, values, dim).items():
            file.create_variable(name, ("time", "node", "axis")[: array.ndim], data=array)
        if dt is not None:
            file.attrs["dt"] = dt
    return path


WRITERS = {".csv": write_csv, ".npz": write_npz, ".nc": write_netcdf}


def write_runs(folder, problem, stepper, steps, suffix=".npz", velocities=True, **how):
    """Files of a stepper, one for each number of steps per frame."""
    paths = []
    for n in steps:
        run = simulate(problem, stepper, n)
        values = node_values(problem, run.states, velocities)
        paths.append(WRITERS[suffix](folder / f"{n}{suffix}", run.times, values, run.dt, **how))
    return paths


def finding(report, check="order"):
    return next(each for each in report.findings if each.check == check)
