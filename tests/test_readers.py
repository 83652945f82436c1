"""Files that users hand in, damaged: one complaint, or what was there; in little memory and time.

Each mutation is drawn with a seed. The fast tests try a few of them, the slow ones some hundred.
"""

from __future__ import annotations

import copy
import functools
import hashlib
import json
import os
import random
import re
import resource
import time
import warnings

import h5netcdf
import h5py
import numpy as np
import pytest

from ropeode import (
    as_stepper,
    error_series,
    grade,
    load,
    load_reference,
    read_sweep,
    save_reference,
    simulate,
)
from ropeode.errors import InputError, InputWarning, UserCodeError

SEEDS = [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 16))]
EACH = 12
# Of one file: more than the largest problem that such a file may describe on purpose.
MOST_SECONDS, MOST_KILOBYTES, MOST_LINES, LONGEST = 30.0, 600_000, 11, 2000

ODD = [
    None, True, False, -1, 0, 0.5, -1e300, 1e308, 10**9, 10**12, 10**30, float("nan"), float("inf"),
    "", "x", "x" * 100_000, "rope", "extended", [], {}, [[]], [1, "a"], {"kind": []},
    {"self": 1, "cls": 1},
]  # fmt: skip


def complaint_or_value(read):
    """What is read, or the complaint; and nothing else, soon, in bounded memory."""
    before, started = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.monotonic()
    found = None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", InputWarning)
            found = read()
    except InputError as error:
        lines = str(error).splitlines()
        assert 1 <= len(lines) <= MOST_LINES
        assert max(map(len, lines)) <= LONGEST
        if not isinstance(error, UserCodeError):
            assert all("Fix: " in line for line in lines[:10])
    assert time.monotonic() - started < MOST_SECONDS
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < MOST_KILOBYTES
    return found


# References, with checksums that are right.


def contents(path):
    """The variables of a file, each as values and words; and its texts."""
    with h5netcdf.File(path) as file:
        texts = {name: file.attrs[name] for name in file.attrs if name != "sha256"}
        variables = {
            name: (v[...], {key: v.attrs[key] for key in ("long_name", "units")})
            for name, v in file.variables.items()
        }
    return variables, texts


def write(path, variables, texts):
    """A file whose two checksums are right, as docs/howto/files.md describes them."""
    digest = hashlib.sha256()
    with h5netcdf.File(path, "w") as file:
        for name in sorted(variables):
            values, words = variables[name]
            names = [f"{name}_{axis}" for axis in range(values.ndim)]
            file.dimensions.update(zip(names, values.shape, strict=True))
            variable = file.create_variable(name, tuple(names), values.dtype, data=values)
            variable.attrs.update(words)
            head = [name, names, values.shape, values.dtype.str, *words.values()]
            digest.update(json.dumps(head).encode() + np.ascontiguousarray(values).tobytes())
        digest.update(json.dumps(dict(sorted(texts.items()))).encode())
        file.attrs.update({**texts, "sha256": digest.hexdigest()})
    return sealed(path)


def sealed(path):
    """The checksum at the end of a file."""
    whole = path.read_bytes()
    path.write_bytes(whole + b"\nropeode sha256 %s\n" % hashlib.sha256(whole).hexdigest().encode())
    return path


def places(value, path=()):
    """The paths to all values in a JSON value."""
    yield path
    if isinstance(value, (dict, list)):
        for key in value if isinstance(value, dict) else range(len(value)):
            yield from places(value[key], (*path, key))


def with_value(value, path, new):
    """A copy of a JSON value with a value at a path."""
    value = copy.deepcopy(value)
    *path, last = path
    functools.reduce(lambda inside, key: inside[key], path, value)[last] = new
    return value


def changed_json(value, draw):
    """A JSON text in which one value is another, is missing, or is too much."""
    *path, last = draw.choice([path for path in places(value) if path])
    how = draw.randrange(4) if isinstance(last, str) else 3
    if how == 0:
        changed = with_value(value, (*path, last), draw.choice(ODD))
        del functools.reduce(lambda inside, key: inside[key], path, changed)[last]
        return json.dumps(changed)
    return json.dumps(with_value(value, (*path, "more" if how == 1 else last), draw.choice(ODD)))


def changed_array(values, draw):
    values = np.array(values)
    if values.size == 0 or values.ndim == 0:
        return values
    odd = draw.choice([np.nan, np.inf, -np.inf, -1.0, 0.0, 1e308])
    one = values.copy()
    one.flat[draw.randrange(values.size)] = odd if values.dtype.kind == "f" else 7
    others = [
        values.ravel(),
        np.moveaxis(values, 0, -1).copy(),
        values[: draw.randrange(len(values))],
        np.concatenate([values, values]),
        (values > 0).astype(np.int8),
        np.full_like(values, np.nan if values.dtype.kind == "f" else 1),
    ]
    return draw.choice([one, one, *others])


def changed_reference(variables, texts, draw):
    variables, texts = dict(variables), dict(texts)
    how, name = draw.randrange(10), draw.choice([*variables])
    text = draw.choice(["problem", "certificate"])
    if how < 4:
        texts[text] = changed_json(json.loads(texts[text]), draw)
    elif how == 4:
        at = draw.randrange(len(texts[text]))
        texts[text] = texts[text][:at] + draw.choice(["", "[" * 5000, "9" * 5000, "\x01", '"'])
    elif how == 5:
        del texts[draw.choice([*texts])]
    elif how == 6:
        del variables[name]
    else:
        values, words = variables[name]
        variables[name] = changed_array(values, draw), words
    return variables, texts


STORED = ("rope-at-rest", "inextensible-rope", "lorenz", "kepler")


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """The contents of files of the library."""
    path = tmp_path_factory.mktemp("stored") / "x.nc"
    return {name: contents(save_reference(load(name), path)) for name in STORED}


def use(known):
    """What a table does with a reference: its claims mean something."""
    trusted = known.trusted
    assert np.isfinite(known.states[:trusted]).all()
    assert (known.bound() >= 0.0).all()
    assert repr(known)
    errors = error_series(known.states[:trusted], known)
    assert (errors.values[:trusted] == 0.0).all()


@pytest.mark.parametrize("seed", SEEDS)
def test_references_with_the_wrong_contents(seed, stored, tmp_path):
    draw = random.Random(seed)
    for i in range(EACH):
        variables, texts = stored[STORED[i % len(STORED)]]
        path = write(tmp_path / "x.nc", *changed_reference(variables, texts, draw))
        found = complaint_or_value(lambda path=path: load_reference(path))
        if found is not None:
            use(found)


def test_a_reference_written_again_is_the_same(stored, tmp_path):
    for name, (variables, texts) in stored.items():
        found, known = load_reference(write(tmp_path / "x.nc", variables, texts)), load(name)
        np.testing.assert_array_equal(found.states, known.states)
        np.testing.assert_array_equal(found.bound(), known.bound())
        assert found.trusted == known.trusted


@pytest.mark.parametrize(
    ("text", "place", "value"),
    [
        ("problem", ("parameters", "frames"), 10**9),
        ("problem", ("samples",), -2),
        ("certificate", ("trusted",), 10**12),
        ("certificate", ("level",), "proved"),
    ],
)
def test_a_text_that_claims_too_much(text, place, value, stored, tmp_path):
    variables, texts = stored["rope-at-rest"]
    changed = json.dumps(with_value(json.loads(texts[text]), place, value))
    path = write(tmp_path / "x.nc", variables, {**texts, text: changed})
    with pytest.raises(InputError, match=rf"reference: .*x\.nc.*{place[-1]}.*Fix: "):
        load_reference(path)


@pytest.mark.parametrize("name", ["position", "velocity", "bound", "probe_rate", "time"])
def test_numbers_that_are_none(name, stored, tmp_path):
    variables, texts = stored["rope-at-rest"]
    values, words = variables[name]
    values = values.copy()
    values[-1] = np.nan
    path = write(tmp_path / "x.nc", {**variables, name: (values, words)}, texts)
    with pytest.raises(InputError, match=f"{name}|right-hand side"):
        load_reference(path)


@pytest.mark.parametrize("seed", SEEDS)
def test_references_with_other_bytes(seed, stored, tmp_path):
    """The checksum at their end is right: what HDF5 finds before it is not."""
    draw = random.Random(seed)
    variables, texts = stored["lorenz"]
    whole = write(tmp_path / "x.nc", variables, texts).read_bytes()[:-80]
    known = load("lorenz")
    for _ in range(EACH):
        path = tmp_path / "x.nc"
        path.write_bytes(other_bytes(whole, draw))
        sealed(path)
        found = complaint_or_value(lambda path=path: load_reference(path))
        if found is not None:
            np.testing.assert_array_equal(found.states, known.states)


def other_bytes(whole, draw):
    """A file with some other bytes, or without its end."""
    if draw.random() < 0.1:
        return whole[: draw.randrange(len(whole))]
    changed = bytearray(whole)
    for _ in range(draw.choice([1, 1, 4, 32])):
        place = draw.randrange(len(changed))
        changed[place] = draw.choice([changed[place] ^ (1 << draw.randrange(8)), 0, 255])
    return bytes(changed)


def other_text(whole, words, lines, draw):
    """A text in which some lines or a word are others, are missing, or come again."""
    there = whole.decode().split("\n")
    at, how = draw.randrange(len(there)), draw.randrange(7)
    if how == 0:
        there.insert(at, draw.choice(lines))
    elif how == 1:
        del there[at : at + draw.choice([1, 1, 8, 200])]
    elif how == 2:
        there.insert(at, draw.choice(there))
    elif how == 3:
        return other_bytes(whole, draw)
    else:
        parts = re.split(r"([,=])", there[at])
        parts[2 * draw.randrange((len(parts) + 1) // 2)] = draw.choice(words)
        there[at] = "".join(parts)
    return "\n".join(there).encode("utf-8", "surrogatepass")


# Trajectories.


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Files of three runs in each format, and the reference of their problem."""
    known, folder = load("linear-chain"), tmp_path_factory.mktemp("runs")
    for steps in (4, 8, 16):
        run = simulate(known.problem, "rk4", steps)
        arrays = {"t": run.times, "positions": run.positions, "velocities": run.velocities}
        np.savez(folder / f"{steps}.npz", dt=run.dt, **arrays)
        with h5py.File(folder / f"{steps}.nc", "w") as file:
            file.attrs["dt"] = run.dt
            for name, values in arrays.items():
                file[name] = values
        lines = [f"# dt = {run.dt!r}", "t,node,x,vx"]
        for t, *both in zip(*arrays.values(), strict=True):
            for node, (x, v) in enumerate(zip(*both, strict=True)):
                lines.append(f"{float(t)!r},{node},{float(x[0])!r},{float(v[0])!r}")
        (folder / f"{steps}.csv").write_text("\n".join(lines) + "\n")
    return folder, known


CSV = ["", "nan", "-inf", "1e999", "9" * 5000, "x" * 5000, ",", "\n", "\0", "#", "-0", "0x1", "é"]
DT = ["1e-308", "1e308", "-1", "0", "nan", "inf", "1e-400", "9" * 5000, "", "x"]


def changed_arrays(path, draw):
    """A file of arrays in which one is another, in either format."""
    if draw.random() < 0.3:
        path.write_bytes(other_bytes(path.read_bytes(), draw))
        return
    name = draw.choice(["dt", "t", "positions", "velocities"])
    odd = [np.float64(x) for x in ("1e-308", "1e308", "-1", "0", "nan", "inf")]
    odd += [np.array(["a"]), np.zeros((0, 3)), np.complex128(1), np.zeros((2,) * 10, np.int8)]
    if path.suffix == ".npz":
        with np.load(path) as file:
            arrays = dict(file)
        arrays[name] = draw.choice([changed_array(arrays[name], draw), draw.choice(odd)])
        if draw.random() < 0.2:
            del arrays[name]
        np.savez(path, **arrays)
        return
    with h5py.File(path, "a") as file:
        group = file.attrs if name == "dt" else file
        values = changed_array(group[name] if name == "dt" else group[name][...], draw)
        del group[name]
        how = draw.randrange(6)
        if how < 3 and name != "dt":
            huge = {"shape": (2**20, 2**20, 2**10), "chunks": (64, 64, 64), "dtype": "f8"}
            if how == 0:
                file.create_dataset(name, **huge)
            elif how == 1:
                file[name] = h5py.ExternalLink("/etc/hostname", "x")
            else:
                file.create_group(name)
        elif how < 5:
            value = draw.choice([values, draw.choice(odd)])
            group[name] = value.astype("S") if value.dtype.kind == "U" else value


@pytest.mark.parametrize("suffix", [".csv", ".npz", ".nc"])
@pytest.mark.parametrize("seed", SEEDS)
def test_damaged_trajectories(seed, suffix, runs, tmp_path):
    (folder, known), draw = runs, random.Random(seed)
    files = [folder / f"4{suffix}", folder / f"8{suffix}", tmp_path / f"16{suffix}"]
    for _ in range(EACH):
        files[2].write_bytes(whole := (folder / f"16{suffix}").read_bytes())
        if suffix == ".csv":
            files[2].write_bytes(other_text(whole, CSV, [f"# dt = {dt}" for dt in DT], draw))
        else:
            changed_arrays(files[2], draw)
        report = complaint_or_value(lambda: grade(files, known, diagnose=False))
        assert report is None or report.verdict


# TOML.

SPECS = {
    "sweep.toml": """\
problem = "linear-chain"
frames = 3
steppers = ["rk4", "leapfrog:form=kick-drift-kick"]
steps_per_frame = [4, 8, 16]
order_factors = []
accuracy = 1e-6
[parameters]
stiffness = 2.0
[grid]
num_masses = [4, 8]
[random]
count = 2
seeds = [0, 1]
stiffness = { uniform = [1.0, 2.0] }
""",
    "rope.toml": """\
frames = 2
steppers = ["rk4"]
rope = { num_nodes = 4, gravity = [0.0, -1.0], pinned = [0] }
[grid]
damping = [0.0, 0.1]
""",
    "own.toml": """\
name = "own"
order = 2
A = [[], ["1/2"]]
b = [0, 1.0]
c = [0.0, "1/2"]
""",
    "rubric.toml": """\
[[item]]
name = "runs"
points = 2
[[item]]
name = "order"
points = 4.5
checks = ["order-*", "pins"]
partial = true
""",
}
TOML = [
    "true", "-1", "0", "1e308", "nan", "inf", "9" * 30, "9" * 5000, "0x" + "f" * 4000, "1_000_000",
    '""', '"x"', '"1/0"', '"1e-999999999"', '"' + "x" * 9000 + '"', "[]", "{}", "[" * 3000,
    "[" * 15 + "]" * 15, "{a=" * 500, "{a=" * 12 + "1" + "}" * 12, "1979-05-27", "[1, [2]]",
    "[" + "1, " * 3000 + "]", '"""' + "y" * 9000, "'", '"\\u0000"', "{self = 1, cls = 2}",
]  # fmt: skip
LINES = [
    "a" + ".a" * 20000 + " = 1", '"="' + '."="' * 9000 + " = 1", "[" + "a.a." * 5000 + "a]",
    "\n".join(f"k{i} = 1" for i in range(5000)), "\n".join("[[item]]" for _ in range(5000)),
    "k" * 100_000 + " = 1", '"' + "k" * 100_000 + '" = 1', "self = 1", "cls = 1", "[rope]",
    "rope = 3", "b = [" + "0," * 20000 + "]", "\ud800",
]  # fmt: skip


@pytest.mark.parametrize("name", SPECS)
@pytest.mark.parametrize("seed", SEEDS)
def test_damaged_toml(seed, name, run, tmp_path):
    draw = random.Random(seed)
    path = tmp_path / name
    for _ in range(EACH):
        path.write_bytes(other_text(SPECS[name].encode(), TOML, LINES, draw))
        if name == "rubric.toml":
            done = run("check", ".", "--rubric", name)
            assert done.returncode == 2
            assert len(done.stderr.splitlines()) <= MOST_LINES
        elif name == "own.toml":
            complaint_or_value(lambda: as_stepper("runge-kutta:own.toml", folder=tmp_path))
        else:
            complaint_or_value(lambda: read_sweep(path))


# Whatever the format.


READING = [
    ("table", ".toml"),
    ("table --steppers runge-kutta:", ".toml"),
    ("reference show", ".nc"),
    *(("grade --reference linear-chain", suffix) for suffix in (".nc", ".csv", ".npz")),
]


@pytest.mark.parametrize("kind", ["pipe", "folder", "device", "missing"])
def test_what_is_no_file(kind, run, tmp_path):
    """A pipe that nobody writes to, and a device without an end, end at once in a complaint."""
    for command, suffix in READING:
        path = tmp_path / f"{kind}{suffix}"
        if kind == "pipe" and not path.exists():
            os.mkfifo(path)
        elif kind == "folder":
            path.mkdir(exist_ok=True)
        elif kind == "device" and not path.exists():
            path.symlink_to("/dev/zero")
        words = f"{command}{'' if command.endswith(':') else ' '}{path.name}".split()
        done = run(*words, *([path.name] * 2 if command.startswith("grade") else []))
        assert done.returncode == 2, (words, done.stderr)
        (line,) = set(done.stderr.splitlines())
        assert "can be read" in line
        assert "Fix: " in line
