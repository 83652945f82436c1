"""References in files: what comes back, what is refused, and what no fault leaves behind."""

from __future__ import annotations

import dataclasses
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import jax.numpy as jnp
import numpy as np
import pytest
import xarray

from ropeode import accuracy_table, reference
from ropeode.analysis import error_series
from ropeode.errors import InputError
from ropeode.problems import PROBLEMS, Problem, Rope
from ropeode.references import (
    SCIPY_RADAU,
    Reference,
    ReferenceOptions,
    Sampling,
    Solver,
    Witness,
    load_reference,
    reference_for,
    save_reference,
    stored_facts,
    taylor,
    verify_reference,
    with_checksum,
)
from ropeode.simulation import simulate
from tests.exact_reference import exact_reference
from tests.references.scalar_problems import scalar
from tests.sampled import sampled


def riccati(t, y, args):
    return -y * y + jnp.sin(t) * args["drive"]


def own_problem(drive: float = 0.5) -> Problem:
    ts = [0.0, 0.3, 1.0, 1.1]
    return Problem(riccati, [[0.5, 0.25]], ts, {"drive": np.float64(drive)}, name="own")


def rope_problem(node_mass=(1, 2, 1, 0.3), frames=3) -> Problem:
    return Rope(num_nodes=4, node_mass=node_mass, damping=0.1).problem(frames)


@pytest.fixture(scope="module")
def rope():
    return reference(rope_problem())


@pytest.fixture(scope="module")
def saved(rope, tmp_path_factory):
    return save_reference(rope, tmp_path_factory.mktemp("stored") / "rope.nc")


def same(one, other) -> None:
    """All that a reference holds is the same, to the last bit."""
    assert one.states.dtype == other.states.dtype == np.float64
    np.testing.assert_array_equal(one.states, other.states)
    assert one.certificate == other.certificate
    assert seconds(one.certificate) == seconds(other.certificate)


def seconds(certificate) -> list[float]:
    return [certificate.seconds, *(each.seconds for each in certificate.witnesses)]


def anything(problem: Problem, reached: int) -> Reference:
    """A reference of a problem with random numbers: a file does not mind what they are."""
    random = np.random.default_rng(2)

    def series():
        return {name: random.exponential(size=len(problem.ts)) for name in problem.quantities}

    known = exact_reference(problem, random.normal(size=(reached, *problem.y0.shape)))
    drift = problem.drift(np.stack([problem.y0] * reached))
    certificate = dataclasses.replace(
        known.certificate,
        solver=Solver("diffrax", "Kvaerno5"),
        rtol=1e-11,
        atol=random.exponential(),
        steps=1234,
        accuracy=random.exponential(),
        bounds=series(),
        drift={name: random.exponential(size=reached) for name in drift},
        trusted=reached - 1,
        horizon=float(problem.ts[reached - 1]),
        horizon_reason="so it is",
        witnesses=(
            Witness(SCIPY_RADAU, 1e-12, "independent", 77, 0.3, series(), np.inf),
            Witness(taylor(113), 2.0**-112, "fewer digits", 5, 0.1, series(), 0.2),
        ),
        stiff=True,
        seconds=1.5,
        compile_seconds=0.25,
        versions={"ropeode": "0"},
        sampling=Sampling(times=2**20, spacing=1e-6) if reached == 4 else None,
    )
    return dataclasses.replace(known, certificate=certificate)


# Ropes, and what is of first order; the others are kept by name and parameters as well.
@pytest.mark.parametrize("name", sampled(PROBLEMS, fast=("rope", "inextensible-rope", "lorenz")))
def test_every_problem_of_the_library_comes_back(name, tmp_path):
    """All of it, and a reference that ends before its problem does."""
    problem = PROBLEMS[name](frames=3)
    for reached in (4, 3):
        known = anything(problem, reached)
        found = load_reference(save_reference(known, tmp_path / "x.nc"))
        same(found, known)
        assert found.problem.parameters == problem.parameters


def a_tree(t, y, args):
    return {"x": y["v"], "v": -y["x"]}


def a_force(t, x, v, args):
    return -x


OLDER = Path(__file__).parent / "older"
START = np.arange(4.0).reshape(2, 2)
OTHERS = {
    "first-order": own_problem,
    "a-tree": lambda: Problem(a_tree, {"x": [1.0, 2.0], "v": [0.0, 0.0]}, range(4)),
    # Square, so that only the numbers tell which axis counts the nodes.
    "nodes-first": lambda: Problem.second_order(a_force, START, 2 * START, range(4)),
    "nodes-last": lambda: Problem.second_order(a_force, START, 2 * START, range(4), node_axis=1),
    "numbers": lambda: Problem.second_order(a_force, 1.0, 0.5, range(4)),
}


@pytest.mark.parametrize("older", [False, True], ids=["now", "older file"])
@pytest.mark.parametrize("name", OTHERS)
def test_a_reference_is_read_without_its_problem(name, older, tmp_path):
    problem = OTHERS[name]()
    known = anything(problem, 4)
    known.states[0] = problem.y0
    # Without the node axis, and whether the state is a tree.
    path = OLDER / f"{name}.nc" if older else save_reference(known, tmp_path / "own.nc")
    found = load_reference(path)
    same(found, known)
    again = load_reference(path, problem)
    same(again, known)
    if problem.structure is not None and not older:
        assert set(again.tree) == {"x", "v"}
        with pytest.raises(InputError, match="load_reference"):
            _ = found.tree
    for name in problem.quantities:
        stored = found.problem.quantity(name, found.states)
        np.testing.assert_array_equal(stored, problem.quantity(name, known.states))
    assert found.to_dataframe().equals(known.to_dataframe())
    assert found.to_xarray().equals(known.to_xarray())
    assert "equations" in found.problem._repr_html_()
    one, other = (error_series(known.states + 1.0, each).values for each in (found, known))
    np.testing.assert_array_equal(one, other)


def test_what_needs_the_equations_says_so(tmp_path):
    problem = own_problem()
    found = load_reference(save_reference(anything(problem, 4), tmp_path / "own.nc"))
    needed = r"problem: 'own' given.*own\.nc.*load_reference\(path, problem\)"
    for use in (
        lambda: simulate(found.problem, "rk4", 4),
        lambda: reference(found.problem),
        lambda: accuracy_table(found, ["velocity-verlet"], [4]),
        lambda: found.at(0.123),
        lambda: error_series(simulate(problem, "rk4", 4), found),
        lambda: found.problem.energies(found.states),
        lambda: save_reference(found, tmp_path / "again.nc"),
        lambda: dataclasses.replace(found.problem, name="other"),
        lambda: verify_reference(tmp_path / "own.nc"),
    ):
        with pytest.raises(InputError, match=needed):
            use()
    assert not (tmp_path / "again.nc").exists()
    with pytest.raises(InputError, match="right-hand side"):
        load_reference(tmp_path / "own.nc", own_problem(drive=0.5000001))


def test_xarray_reads_it_with_names(saved, rope):
    """So that another program can solve the same problem."""
    args = rope.problem.args
    with xarray.open_dataset(saved) as data:
        assert data.position.dims == data.velocity.dims == ("time", "node", "component")
        assert (data.bound.dims, data.mass.dims) == (("time",), ("node",))
        assert data.stiffness.dims == data.rest_length.dims == ("spring",)
        assert data.attrs["Conventions"].startswith("CF-")
        assert all("long_name" in data[name].attrs for name in data.variables)
        np.testing.assert_array_equal(data.velocity, rope.velocities)
        np.testing.assert_array_equal(data.pinned, 1 - args.free)
        for name in ("mass", "stiffness", "rest_length", "damping", "gravity"):
            np.testing.assert_array_equal(np.ravel(data[name]), np.ravel(getattr(args, name)))


@pytest.mark.parametrize(
    ("other", "words"),
    [
        (lambda rope: rope_problem(node_mass=(1, 2, 1, 0.31)), "node_mass: "),
        (lambda rope: rope_problem(frames=4), "frames: 4 given"),
        (lambda rope: PROBLEMS["kepler"](frames=3), "kind: 'kepler' given; allowed: 'rope'"),
        (lambda rope: rope.changed(rhs=lambda t, y, a: 1.000001 * rope.rhs(t, y, a)), "right-hand"),
    ],
)
def test_another_problem_is_refused_by_name(saved, rope, other, words):
    with pytest.raises(InputError, match=words) as fault:
        load_reference(saved, other(rope.problem))
    assert len(fault.value.problems) == 1


def test_a_flipped_bit_anywhere_and_a_cut_are_refused(saved, tmp_path):
    whole = saved.read_bytes()
    victim = tmp_path / "flipped.nc"
    random = np.random.default_rng(0)
    places = {0, len(whole) - 1, len(whole) - 70, *random.integers(0, len(whole), 400).tolist()}
    for place in places:
        changed = bytearray(whole)
        changed[place] ^= 1 << int(random.integers(8))
        victim.write_bytes(bytes(changed))
        with pytest.raises(InputError, match="reference: "):
            stored_facts(victim)
    for cut in (0, 1, 100, len(whole) // 2, -1):
        victim.write_bytes(whole[:cut])
        with pytest.raises(InputError, match="checksum at its end is missing"):
            load_reference(victim)


def resealed(path: Path, change) -> Path:
    """A file that was changed by someone who knows how to write a checksum."""
    path.write_bytes(path.read_bytes()[: -(len(b"\nropeode sha256 ") + 65)])
    with h5py.File(path, "r+") as file:
        change(file)
    path.write_bytes(with_checksum(path.read_bytes()))
    return path


def test_what_is_changed_does_not_pass_for_what_was(saved, tmp_path):
    """All numbers, the words that say how a file is to be read, and all that its hash covers."""
    with h5py.File(saved) as file:
        numbers = [name for name, values in file.items() if values.dtype == np.float64]
        words = [name for name, value in file.attrs.items() if isinstance(value, str)]
    assert len(numbers) > 9
    changes = [
        *(lambda file, n=n: file[n].write_direct(np.array(file[n][...] + 1e-9)) for n in numbers),
        *(lambda file, n=n: file.attrs.update({n: "ropeode.reference/99"}) for n in words),
    ]
    for change in changes:
        copy = Path(shutil.copy(saved, tmp_path / "x.nc"))
        with pytest.raises(InputError, match="reference: "):
            load_reference(resealed(copy, change))


TRICKS = {
    "huge": lambda file: file.create_dataset("x", (2**20, 2**20), dtype="<f8", chunks=(64, 64)),
    "object": lambda file: file.create_dataset("x", data=["a", "b"]),
    "external": lambda file: file.create_dataset(
        "x", (4,), dtype="<f8", external=[("/etc/hostname", 0, 32)]
    ),
    "chunked": lambda file: file.create_dataset("x", data=np.zeros(4), chunks=(2,)),
    "link": lambda file: file.update(x=h5py.ExternalLink("/etc/hostname", "position")),
}


@pytest.mark.parametrize("trick", TRICKS)
def test_what_is_declared_is_not_believed(saved, tmp_path, trick):
    """Nothing is read that is not in the file, and no memory taken for what is only claimed."""
    victim = resealed(Path(shutil.copy(saved, tmp_path / "x.nc")), TRICKS[trick])
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(InputError, match="reference: "):
        load_reference(victim)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200_000


SAVE = """
import sys
from ropeode import load_reference, save_reference
known = load_reference(sys.argv[1])
print("ready", flush=True)
for _ in range(10000):
    save_reference(known, sys.argv[2])
"""


def test_kill_at_any_moment_leaves_a_whole_file(saved, tmp_path):
    target = tmp_path / "target.nc"
    shutil.copy(saved, target)
    process = subprocess.Popen(
        [sys.executable, "-c", SAVE, str(saved), str(target)], stdout=subprocess.PIPE
    )
    process.stdout.readline()
    time.sleep(float(np.random.default_rng(1).uniform(0.0, 0.15)))
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()
    same(load_reference(target), load_reference(saved))


@pytest.mark.parametrize("room", [0, 100, 4096, 20_000])
def test_a_full_disk_leaves_the_old_file(rope, tmp_path, room_for, room):
    """HDF5 would end the process with it."""
    target = tmp_path / "target.nc"
    target.write_bytes(b"old")
    with room_for(room), pytest.raises(InputError, match="^out: "):
        save_reference(rope, target)
    assert target.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["target.nc"]


def test_a_right_reference_comes_back_and_verifies_itself_and_a_wrong_one_does_not(
    saved, rope, tmp_path
):
    same(load_reference(saved), rope)
    found = verify_reference(saved)
    assert found.agrees
    assert found.samples == rope.trusted
    assert set(found.distances) == {"position", "velocity"}
    states = rope.states.copy()
    states[2:, 0, 1, 2] += 1e-6
    path = save_reference(dataclasses.replace(rope, states=states), tmp_path / "wrong.nc")
    found = verify_reference(path)
    assert not found.agrees
    assert found.outside == {"position": 2.0}
    assert found.distances["position"] == pytest.approx(1e-6, rel=1e-3)


# In the cache folder: found again where all is the same, and nowhere else.


def swing(**parameters):
    return PROBLEMS["oscillator"](frames=4, **parameters)


def runs_for(problem, options=ReferenceOptions()):  # noqa: B008
    """The reference, and how many runs of solvers it took."""
    said = []
    known = reference_for(problem, options, lambda text, fraction: said.append(text))
    return known, len(said)


def test_a_kept_reference_is_the_one_that_was_computed_and_what_differs_has_another(
    cache_folder, tmp_path, monkeypatch
):
    computed, runs = runs_for(swing())
    assert runs > 9
    again, runs = runs_for(swing())
    assert runs == 0
    first, second = (
        save_reference(each, tmp_path / f"{name}.nc").read_bytes()
        for name, each in (("a", computed), ("b", again))
    )
    assert first == second
    changed = swing()
    right = changed.rhs
    for problem, options in (
        (swing(), ReferenceOptions(rtol=1e-6)),
        (swing(x0=1.1), ReferenceOptions()),
        # Parameters of the library are no evidence of the equation.
        (changed.changed(rhs=lambda t, y, args: 1.001 * right(t, y, args)), ReferenceOptions()),
    ):
        assert runs_for(problem, options)[1] > 9
    monkeypatch.setattr("ropeode.cache._folder", None)
    assert runs_for(swing())[1] > 9


@pytest.mark.slow
def test_what_ended_early_is_not_kept_and_neither_are_problems_of_the_users(cache_folder):
    """With more time a run may get further; here all of them end at a pole."""
    pole = swing(x0=0.4).changed(rhs=lambda t, y, args: y * y)
    assert runs_for(pole)[0].horizon == 3.0
    runs_for(scalar("decay", 1.0, range(6)))
    assert not (cache_folder / "references").exists()
