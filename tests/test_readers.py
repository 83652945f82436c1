"""Files that users hand in, damaged: one complaint, or what was there; in little memory and time.

Each mutation is drawn with a seed. The fast tests try a few of them, the slow ones some hundred.
"""

from __future__ import annotations

import hashlib
import json
import os
import random
import re
import resource
import time
import warnings
from pathlib import Path

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
)
from ropeode.errors import InputError, InputWarning, UserCodeError
from ropeode.sweep import commented_sweep
from tests.checking.trajectory_writing import write_runs

SEEDS = [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 16))]
EACH = 12
# Of one file: more than the largest problem that such a file may describe on purpose.
MOST_SECONDS, MOST_KILOBYTES, MOST_LINES, LONGEST = 30.0, 600_000, 11, 2000


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
        parts = re.split(r"([,=:])", there[at])
        parts[2 * draw.randrange((len(parts) + 1) // 2)] = draw.choice(words)
        there[at] = "".join(parts)
    return "\n".join(there).encode("utf-8", "surrogatepass")


def other_array(values, draw):
    """An array with another number, shape or type."""
    values = np.array(values, ndmin=1)
    one, numbers = values.copy(), values.dtype.kind == "f"
    odd = [np.nan, np.inf, -np.inf, -1.0, 0.0, 1e-308, 1e308] if numbers else [7]
    one.flat[draw.randrange(values.size)] = draw.choice(odd)
    others = [
        values.ravel(),
        np.moveaxis(values, 0, -1).copy(),
        values[: draw.randrange(len(values))],
        np.concatenate([values, values]),
        (values > 0).astype(np.int8),
        np.full_like(values, odd[0]),
        np.array([b"a"]),
        np.zeros((2,) * 10, np.int8),
    ]
    return draw.choice([one, one, one, *others])


# Values for texts of TOML and of JSON.
WORDS = [
    "null", "NaN", "1e999", "\x01", '"rope"', '"extended"', '{"kind": []}', '{"self": 1, "cls": 1}',
    "true", "-1", "0", "1e308", "nan", "inf", "9" * 30, "9" * 5000, "0x" + "f" * 4000, "1_000_000",
    '""', '"x"', '"1/0"', '"1e-999999999"', '"' + "x" * 9000 + '"', "[]", "{}", "[" * 3000,
    "[" * 15 + "]" * 15, "{a=" * 500, "{a=" * 12 + "1" + "}" * 12, "1979-05-27", "[1, [2]]",
    "[" + "1, " * 3000 + "]", '"""' + "y" * 9000, "'", '"\\u0000"', "{self = 1, cls = 2}",
]  # fmt: skip


def other_reference(variables, texts, draw):
    variables, texts = dict(variables), dict(texts)
    part = draw.choice([variables, texts, texts])
    if draw.random() < 0.2:
        del part[draw.choice([*part])]
    elif part is texts:
        name = draw.choice(["problem", "certificate"])
        lines = json.dumps(json.loads(texts[name]), indent=0).encode()
        changed = other_text(lines, WORDS, [f'"more": {each},' for each in WORDS], draw)
        texts[name] = changed.decode(errors="replace").replace("\0", "")
    else:
        name = draw.choice([*variables])
        values, words = variables[name]
        variables[name] = other_array(values, draw), words
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
        path = write(tmp_path / "x.nc", *other_reference(variables, texts, draw))
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
    ("name", "value"),
    [
        ("frames", "1000000000"),
        ("samples", "-2"),
        ("trusted", "1000000000000"),
        ("level", '"proved"'),
        *((name, np.nan) for name in ("position", "velocity", "bound", "probe_rate", "time")),
    ],
)
def test_a_whole_file_that_claims_what_cannot_be(name, value, stored, tmp_path):
    """In one of its texts, or as the last number of an array."""
    variables, texts = map(dict, stored["rope-at-rest"])
    if name in variables:
        values, words = variables[name]
        variables[name] = np.append(np.ravel(values)[:-1], value).reshape(values.shape), words
    for text in ("problem", "certificate"):
        texts[text] = re.sub(rf'("{name}": )[^,}}]+', rf"\g<1>{value}", texts[text])
    path = write(tmp_path / "x.nc", variables, texts)
    words = rf"({name}|right-hand side)" if name in variables else rf"reference: .*x\.nc.*{name}"
    with pytest.raises(InputError, match=rf"{words}.*Fix: "):
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


# Trajectories.


COLUMNS = {".csv": {"names": "x,vx"}, ".npz": {"dim": 1}, ".nc": {"dim": 1}}


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Files of three runs in each format, and the reference of their problem."""
    known, folder = load("linear-chain"), tmp_path_factory.mktemp("runs")
    for suffix, how in COLUMNS.items():
        write_runs(folder, known.problem, "rk4", (4, 8, 16), suffix, **how)
    return folder, known


CSV = ["", "nan", "-inf", "1e999", "9" * 5000, "x" * 5000, ",", "\n", "\0", "#", "-0", "0x1", "é"]
DT = ["1e-308", "1e308", "-1", "0", "nan", "inf", "1e-400", "9" * 5000, "", "x"]


# What a name in an HDF5 file may stand for.
NO_ARRAY = [
    lambda file, name: file.create_dataset(name, (2**20,) * 3, "f8", chunks=(64, 64, 64)),
    lambda file, name: file.update({name: h5py.ExternalLink("/etc/hostname", "x")}),
    lambda file, name: file.create_group(name),
    lambda file, name: None,
]


def damage(path, draw):
    """A file in which one array is another or is missing, or something of the file is."""
    name = draw.choice(["dt", "t", "positions", "velocities"])
    if draw.random() < 0.3:
        path.write_bytes(other_bytes(path.read_bytes(), draw))
    elif path.suffix == ".csv":
        lines = [f"# dt = {dt}" for dt in DT]
        path.write_bytes(other_text(path.read_bytes(), CSV, lines, draw))
    elif path.suffix == ".npz":
        with np.load(path) as file:
            arrays = dict(file)
        changed = other_array(arrays.pop(name), draw)
        if draw.random() < 0.8:
            arrays[name] = draw.choice([changed, changed, changed, np.complex128(1)])
        np.savez(path, **arrays)
    else:
        with h5py.File(path, "a") as file:
            group = file.attrs if name == "dt" else file
            changed = other_array(group[name][()] if group is file else group[name], draw)
            del group[name]
            if group is file and draw.random() < 0.5:
                draw.choice(NO_ARRAY)(file, name)
            else:
                group[name] = changed


@pytest.mark.parametrize("suffix", COLUMNS)
@pytest.mark.parametrize("seed", SEEDS)
def test_damaged_trajectories(seed, suffix, runs, tmp_path):
    (folder, known), draw = runs, random.Random(seed)
    files = [folder / f"4{suffix}", folder / f"8{suffix}", tmp_path / f"16{suffix}"]
    for _ in range(EACH):
        files[2].write_bytes((folder / f"16{suffix}").read_bytes())
        damage(files[2], draw)
        report = complaint_or_value(lambda: grade(files, known, diagnose=False))
        assert report is None or report.verdict


# TOML.

DOCS = Path(__file__).parents[1] / "docs"
RANDOM = "[random]\ncount = 2\nseeds = [0, 1]\nstiffness = { uniform = [1.0, 2.0] }\n"
SPECS = {
    "sweep.toml": commented_sweep() + RANDOM,
    "own.toml": (DOCS / "examples/heun3.toml").read_text(),
    "rubric.toml": (DOCS / "teach/verlet/rubric.toml").read_text(),
}
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
    path, text = tmp_path / name, re.sub(r"^(#.*)?\n", "", SPECS[name], flags=re.M).encode()
    for _ in range(EACH):
        path.write_bytes(other_text(text, WORDS, LINES, draw))
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
    "table x.toml",
    "table --steppers runge-kutta:x.toml",
    "reference show x.nc",
    *(f"grade --reference linear-chain x{each} x{each} x{each}" for each in COLUMNS),
]
NO_FILE = {
    "pipe": os.mkfifo,
    "folder": Path.mkdir,
    "device": lambda path: path.symlink_to("/dev/zero"),
    "missing": lambda path: None,
}


@pytest.mark.parametrize("make", NO_FILE.values(), ids=NO_FILE)
def test_what_is_no_file(make, run, tmp_path):
    """A pipe that nobody writes to, and a device without an end, end at once in a complaint."""
    for suffix in (".toml", *COLUMNS):
        make(tmp_path / f"x{suffix}")
    for words in READING:
        done = run(*words.split())
        assert done.returncode == 2, (words, done.stderr)
        (line,) = set(done.stderr.splitlines())
        assert "can be read" in line
        assert "Fix: " in line
