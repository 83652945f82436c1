"""What commands write: results, pictures and films; JSON as the published schemas say."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from PIL import Image

from ropeode import load, steppers
from ropeode.cli import cli
from ropeode.simulation import simulate
from tests.checking.trajectory_writing import node_values, write_npz, write_runs
from tests.sampled import sampled
from tests.schemas import FOLDER, assert_conforms
from tools import json_schemas

# The rope of `small_rope`: what it compiles serves many tests.
ROPE = "--num-nodes 4 --frames 3"
QUICK = f"{ROPE} --steppers rk4 --steps 4,8,16"
OSCILLATOR = "--problem oscillator --frames 4"
TYPES = next(each.type.choices for each in cli.commands["plot"].params if each.name == "name")


@pytest.fixture
def writes(run, tmp_path):
    """A function that runs a command, and returns what it says and the files that it writes.

    JSON keeps its schema, and the pictures are as wide as a page.
    """

    def call(line):
        before = {*tmp_path.rglob("*.*")}
        done = run(*line.split())
        assert done.returncode == 0, done.stderr
        files = {*tmp_path.rglob("*.*")} - before
        for file in files:
            if file.suffix == ".json":
                assert_conforms(file.read_text())
            if file.suffix == ".png":
                with Image.open(file) as image:
                    assert image.width == 1300
        return done.stdout + done.stderr, {str(file.relative_to(tmp_path)) for file in files}

    return call


def test_schemas_are_what_the_types_say():
    written = {file.name: file.read_text() for file in FOLDER.iterdir()}
    assert written == json_schemas.schemas(), "run: python -m tools.json_schemas"


@pytest.mark.parametrize("file", sorted(FOLDER.iterdir()), ids=lambda file: file.stem)
def test_a_schema_knows_all_keys(file):
    """Another one is refused, wherever it stands."""
    parts = []
    json.loads(file.read_text(), object_hook=lambda part: parts.append(part) or part)
    parts = [part for part in parts if "required" in part]
    assert parts
    for part in parts:
        assert part["additionalProperties"] is False
        assert {*part["required"]} <= part["properties"].keys()


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [
        # Runs that diverge, errors below the resolution, and orders that cannot be determined.
        f"table {ROPE} --damping 0 --steps 4,8,16,1000,30000",
        f"table {ROPE} --steppers diffrax:Heun --steps 16",
        "table --problem lorenz --steppers explicit-euler,rk4 --steps 2,9",
        f"table --kind inextensible-rope {ROPE} --steppers rattle --steps 8,16,32",
        "table --reference kepler --steppers rk4 --steps 64,128",
        # The order claimed is not that of the step, so that there is a diagnosis.
        "check explicit-euler --order 2 --quick",
        "grade 16.npz 32.npz 64.npz --reference linear-chain --order 2",
        "report --figures 1,8,28 --frames 40",
    ],
)
def test_every_command_keeps_its_schema(command, run, tmp_path):
    if command.startswith("grade"):
        problem = load("linear-chain").problem
        write_runs(tmp_path, problem, "velocity-verlet", (16, 32, 64), dim=1)
    done = run(*command.split(), "--format", "json")
    assert done.stdout, done.stderr
    assert_conforms(done.stdout)


def test_explain_writes_a_file_and_pictures(writes):
    settings = f"{OSCILLATOR} --steps 64,128,256 --norm position-max --method rk4"
    said, files = writes(f"explain explicit-euler {settings} --out a.json --plots new")
    assert said == "wrote 3 pictures to new\n"
    pictures = ("convergence-position", "error-position", "stability")
    assert files == {"a.json", *(f"new/{each}.png" for each in pictures)}
    assert json.loads(Path("a.json").read_text())["compared_with"]["name"] == "rk4"


def test_horizon_in_json(writes):
    pytest.importorskip("heyoka", reason="heyoka is an extra")
    # Of the lengths that tests/study/test_horizon.py has, whose programs are then there.
    assert writes(f"horizon {OSCILLATOR} --spans 4,100 --out a.json") == ("", {"a.json"})
    found = json.loads(Path("a.json").read_text())
    assert found["schema"] == "ropeode.horizon/2"
    assert [need["measured"] for need in found["needs"]] == [True, False]


@pytest.mark.slow
def test_work_precision_of_all_kinds_of_methods(writes):
    methods = "--methods rk4,scipy:RK23 --steps 7,30 --rtol 1e-4,1e-7"
    said, files = writes(
        f"work-precision {OSCILLATOR} --rounds 1 {methods} --out a.json --plots new"
    )
    assert said == "wrote 3 pictures to new\n"
    pictures = ("seconds", "rhs-evaluations", "steps")
    assert files == {"a.json", *(f"new/work-precision-{each}.png" for each in pictures)}
    rows = json.loads(Path("a.json").read_text())["rows"]
    found = [(row["method"], row["effort"]) for row in rows]
    assert found == [("rk4", 7), ("rk4", 30), ("scipy:RK23", 1e-4), ("scipy:RK23", 1e-7)]


@pytest.mark.parametrize("name", sampled(TYPES, ["convergence"]))
def test_plot(name, writes):
    """A norm of errors does not keep energies from being plotted."""
    found = writes(f"plot {QUICK} --type {name} --norm velocity-max")
    assert found == (f"wrote {name}.png\n", {f"{name}.png"})


def test_animate(writes, monkeypatch):
    """One run of all that is given: the first of the steps, which 4 samples per frame fit.

    A GIF needs no extra for films.
    """
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    assert writes(f"animate {QUICK}") == ("wrote rope.gif\n", {"rope.gif"})
    with Image.open("rope.gif") as image:
        assert image.n_frames == 3 * 4 + 1
        assert image.info["duration"] == 50


def test_pictures_of_trajectories(small_rope, writes, tmp_path):
    """Files of three step sizes and the spec of their problem."""
    (tmp_path / "spec.toml").write_text("frames = 3\n[rope]\nnum_nodes = 4\n")
    for steps in (16, 32, 64):
        found = simulate(small_rope, "velocity-verlet", steps)
        values = node_values(small_rope, found.states)
        write_npz(tmp_path / f"{steps}.npz", found.times, values)
    dts = "--problem spec.toml --dt 0.0625,0.03125,0.015625"
    found = writes(f"plot --trajectories 16.npz 32.npz 64.npz {dts} --out a.svg")
    assert found == ("wrote a.svg\n", {"a.svg"})
    assert "order 2.0" in Path("a.svg").read_text()
    found = writes(f"animate 64.npz --problem rope {ROPE} --dt 0.015625 --trajectories")
    assert found == ("wrote rope.gif\n", {"rope.gif"})
    with Image.open("rope.gif") as image:
        assert image.n_frames == 4


def test_templates(run):
    (option,) = (each for each in cli.commands["check"].params if each.name == "template")
    assert set(option.type.choices) == set(steppers.TEMPLATES)
    for name in steppers.TEMPLATES:
        done = run("check", "--template", name)
        assert (done.returncode, done.stdout) == (0, steppers.template(name))
