"""The cache folder: what takes long to make, kept where the next command finds it.

Three things are kept: references, programs that ropeode compiles, and what JAX compiles for itself.
What is read is what would be made anew. It is found by a description of what it is, and of the
software that made it; each file carries its checksum.

JAX keeps programs too, but finds them by what they were lowered to; and to trace and lower a
stepper takes several times as long as to load it. Programs that call functions outside of
themselves (LAPACK, say) are left to JAX: when it lowers a program it makes these functions ready,
and without that a call of one crashes the process.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import hashlib
import json
import os
import platform
import sys
import time
import types
import uuid
import warnings
from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import jax
import numpy as np
import platformdirs
from jax.experimental import serialize_executable
from jax.interpreters.mlir import ir

from ropeode.errors import InputError
from ropeode.files import write_whole

Made = TypeVar("Made")

_folder: Path | None = None
# A call of a function that is not part of the program, in the text that it is lowered to.
_CALLS_OUT = "custom_call"
_OWN = Path(__file__).parent
_IMPORTED = time.time()
_PACKAGES = (
    *("diffrax", "equinox", "heyoka", "jax", "jaxlib", "lineax", "numpy", "optimistix", "scipy"),
)
# Of variables that JAX, XLA and Equinox read.
_VARIABLES = ("JAX_", "XLA_", "LIBTPU_", "EQX_")
# The lines of Linux's list of processors that say for which instructions to compile.
_PROCESSOR = ("model name", "flags", "Features", "CPU implementer", "CPU part")
_PLAIN = (type(None), bool, int, float, str, Fraction)


def set_up_jax() -> None:
    """Use 64-bit types, the processor, and the user's cache folder: for a process of ropeode's own.

    To be called before anything is solved. JAX_PLATFORMS may name another device: `on_processor`
    says why it is not the first that JAX finds.
    """
    jax.config.update("jax_enable_x64", True)
    if not jax.config.jax_platforms:  # type: ignore[attr-defined]
        jax.config.update("jax_platforms", "cpu")
    use_cache_folder()


def use_cache_folder(folder: Path | None = None) -> None:
    """Keep what is traced, compiled and solved from now on, and find it there.

    Arguments:
        folder: created when the first file is written; by default the user's own.
    """
    global _folder
    _folder = platformdirs.user_cache_path("ropeode") if folder is None else folder
    # Equinox's checks at run time call back into Python, and a program that does so cannot be
    # kept. Of diffrax's there are two, that sample times increase and lie in the span; both
    # are checked where a problem is built. Equinox reads this when it is imported.
    os.environ.setdefault("EQX_ON_ERROR", "off")
    jax.config.update("jax_compilation_cache_dir", str(_folder / "compiled"))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
    # On a full disk, which the result does not need.
    warnings.filterwarnings("ignore", "Error (reading|writing) persistent compilation cache")


def is_used() -> bool:
    """Whether there is such a folder; a call from Python has none."""
    return _folder is not None


def kept(
    kind: str,
    description: str | None,
    make: Callable[[], Made],
    dump: Callable[[Made], bytes | None],
    load: Callable[[bytes], Made],
) -> Made:
    """What an earlier command made with the same software, or what is made now, and kept.

    Arguments:
        kind: of what is made, which names its folder and the ending of its files.
        description: tells it from all others of its kind; None where it is not to be kept.
        make: makes it.
        dump: it as bytes; None if it is not to be kept. What it raises keeps nothing.
        load: the opposite of `dump`. If it raises, it is made anew.
    """
    if description is None or _folder is None or software() is None:
        return make()
    digest = hashlib.sha256(f"{description}\0{software()}".encode()).hexdigest()
    path = _folder / f"{kind}s" / f"{digest}.{kind}"
    contents = _read(path)
    with contextlib.suppress(Exception):
        if contents is not None:
            return load(contents)
    made = make()
    with contextlib.suppress(Exception):
        contents = dump(made)
        if contents is not None and _is_as_imported():
            _write(path, contents)
    return made


def _read(path: Path) -> bytes | None:
    """The contents of a file; None if there is no file, or its checksum is wrong."""
    try:
        digest, contents = path.read_bytes().split(b"\n", 1)
    except (OSError, ValueError):
        return None
    return contents if hashlib.sha256(contents).hexdigest().encode() == digest else None


def _write(path: Path, contents: bytes) -> None:
    """Keep a file; if the folder is not writable, the next process makes it again."""
    with contextlib.suppress(OSError, InputError):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, hashlib.sha256(contents).hexdigest().encode() + b"\n" + contents)


class Source(NamedTuple):
    """What a program is compiled from.

    Fields:
        function: in JAX.
        inputs: its arguments, pytrees of shapes.
        facts: what its caller wants to know of it, as plain JSON values.
    """

    function: Callable
    inputs: tuple
    facts: Any = None


class _Compiled(NamedTuple):
    """A compiled program, the facts of its source, and whether it can be kept."""

    call: Any
    facts: Any
    alone: bool


def program(description: str | None, source: Callable[[], Source]) -> tuple[Callable, Any]:
    """A compiled program, and the facts of its source.

    Arguments:
        description: tells it from all others that the same software makes; None where it is not
            to be kept.
        source: called where the program is not in the cache folder.

    Returns:
        The program takes what the function takes, and returns the leaves of what that returns.
    """
    # Of JAX's settings those that hold in this thread, and those that hold everywhere.
    settings = [jax.config.jax_enable_x64, sorted(jax.config.values.items())]  # type: ignore[attr-defined]
    own = description is not None and is_used() and software() is not None
    words = f"{description}\0{settings}" if own else None
    made = kept("program", words, lambda: _compiled(source(), own), _contents, _loaded)
    return lambda *inputs: made.call(*jax.tree.leaves(inputs)), made.facts


def _compiled(source: Source, own: bool) -> _Compiled:
    """Compile; a program of ropeode's own cache under a name that JAX's does not know."""
    leaves, tree = jax.tree.flatten(source.inputs)

    # Files have no pytrees, whose classes only a pickle knows.
    def flat(*leaves: Any) -> tuple:
        return tuple(jax.tree.leaves(source.function(*jax.tree.unflatten(tree, leaves))))

    lowered = jax.jit(flat).lower(*leaves)
    alone = own and _CALLS_OUT not in lowered.as_text()
    if alone:
        # Another each time: what JAX loads from its own cache lacks functions when it is written
        # again.
        module: Any = lowered.compiler_ir()
        with module.context:
            name = ir.StringAttr.get(f"program_{uuid.uuid4().hex}")
            module.operation.attributes["sym_name"] = name
    return _Compiled(lowered.compile(), source.facts, alone)


def _contents(made: _Compiled) -> bytes | None:
    if not made.alone:
        return None
    executable, inputs, outputs = serialize_executable.serialize(made.call)
    counts = {"inputs": inputs.num_leaves, "outputs": outputs.num_leaves}
    return json.dumps({**counts, "facts": made.facts}).encode() + b"\n" + executable


def _loaded(contents: bytes) -> _Compiled:
    """Raises where XLA refuses a program that is for another machine."""
    head, executable = contents.split(b"\n", 1)
    known = json.loads(head)
    inputs = jax.tree.structure(((0,) * known["inputs"], {}))
    outputs = jax.tree.structure((0,) * known["outputs"])
    call = serialize_executable.deserialize_and_load(
        executable, inputs, outputs, execution_devices=jax.devices()[:1]
    )
    return _Compiled(call, known["facts"], alone=True)


def described(value: Any) -> str | None:
    """What a value is; two of the same description compute the same, if the software is the same.

    None where there is something else in it than is named here, such as a function of the user's:
    what that reads, ropeode cannot know.

    Functions and classes are described by their names, and these are ropeode's own, whose text is
    part of the software.

    Arguments:
        value: numbers, texts, arrays and functions of ropeode, in tuples, mappings and dataclasses
            of ropeode. Of dataclasses those fields count by which they are compared.
    """
    try:
        return _words(value)
    except TypeError:
        return None


def _words(value: Any) -> str:
    if type(value) in _PLAIN:
        return repr(value)
    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        return f"{value.dtype}{value.shape}{hashlib.sha256(value.tobytes()).hexdigest()}"
    if isinstance(value, jax.ShapeDtypeStruct):
        return f"{value.dtype}{value.shape}"
    if isinstance(value, type | types.FunctionType):
        return _name_of(value)
    if isinstance(value, Mapping):
        return f"{{{_listed((key, value[key]) for key in sorted(value))}}}"
    if type(value) in (tuple, list):
        return f"({_listed(value)})"
    if dataclasses.is_dataclass(value):
        fields = [each.name for each in dataclasses.fields(value) if each.compare]
        return f"{_name_of(type(value))}({_listed(getattr(value, name) for name in fields)})"
    if isinstance(value, tuple):
        return f"{_name_of(type(value))}({_listed(value)})"
    raise TypeError(f"what a {type(value).__name__} computes is unknown")


def _listed(values: Iterable[Any]) -> str:
    return ", ".join(map(_words, values))


def _name_of(own: Any) -> str:
    """The name under which the package has a function or a class.

    Raises:
        TypeError: it has none.
    """
    found: Any = sys.modules.get(own.__module__ or "")
    for name in own.__qualname__.split("."):
        found = getattr(found, name, None)
    if found is not own or not own.__module__.startswith("ropeode."):
        raise TypeError(f"{own.__qualname__} is none of ropeode's own")
    return f"{own.__module__}.{own.__qualname__}"


@functools.cache
def software() -> str | None:
    """All that decides what a program computes, beside the program: packages, sources, machine.

    None where the sources are no longer what was imported.
    """
    digest = source_digest(_OWN)
    if not _is_as_imported():
        return None
    return json.dumps(
        [
            {name: _version(name) for name in _PACKAGES},
            digest,
            platform.python_version(),
            [f"{each} {each.device_kind} {each.client.platform_version}" for each in jax.devices()],
            platform.machine(),
            _processor(),
            sorted(each for each in os.environ.items() if each[0].startswith(_VARIABLES)),
        ]
    )


def _is_as_imported() -> bool:
    """Whether no source file was written since the first ones were imported."""
    return all(path.stat().st_mtime < _IMPORTED for path in _OWN.rglob("*.py"))


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _processor() -> list[str]:
    try:
        with open("/proc/cpuinfo") as file:
            first = file.read(2**14).split("\n\n")[0]
    except OSError:
        return [platform.processor()]
    return [line for line in first.splitlines() if line.startswith(_PROCESSOR)]


def source_digest(package: Path, parts: Iterable[str] = ("",)) -> str:
    """The sha256 of source files, which may change between releases.

    Arguments:
        package: the folder that contains them.
        parts: the files and folders that count; by default all.
    """
    total = hashlib.sha256()
    for part in parts:
        path = package / part
        files = [path] if path.is_file() else sorted(path.rglob("*.py"))
        for file in files:
            contents = file.read_bytes()
            total.update(f"{file.relative_to(package).as_posix()}\0{len(contents)}\0".encode())
            total.update(contents)
    return total.hexdigest()
