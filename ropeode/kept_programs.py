"""Compiled programs that a command finds in its cache folder.

JAX keeps programs too, but finds them by what they were lowered to; and to trace and lower a
stepper takes several times as long as to load it. Programs that call functions outside of
themselves (LAPACK, say) are left to JAX: when it lowers a program it makes these functions ready,
and without that a call of one crashes the process.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import uuid
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
from jax.experimental import serialize_executable
from jax.interpreters.mlir import ir

from ropeode import cache_folder
from ropeode.identity import is_as_imported, software

# A call of a function that is not part of the program, in the text that it is lowered to.
_CALLS_OUT = "custom_call"


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


def program(description: str | None, source: Callable[[], Source]) -> tuple[Callable, Any]:
    """A compiled program, and the facts of its source.

    Arguments:
        description: tells it from all others that the same software makes; None where it is not
            to be kept.
        source: called where the program is not in the cache folder.

    Returns:
        The program takes what the function takes, and returns the leaves of what that returns.
    """
    if description is None or not cache_folder.is_used() or software() is None:
        made = source()
        return _on_leaves(_lowered(made).compile()), made.facts
    # Of JAX's settings those that hold in this thread, and those that hold everywhere.
    settings = [jax.config.jax_enable_x64, sorted(jax.config.values.items())]  # type: ignore[attr-defined]
    words = f"{description}\0{software()}\0{settings}"
    name = f"programs/{hashlib.sha256(words.encode()).hexdigest()}.program"
    contents = cache_folder.read(name)
    # XLA refuses a program that is for another machine.
    with contextlib.suppress(Exception):
        if contents is not None:
            return _loaded(contents)
    made = source()
    lowered = _lowered(made)
    if _CALLS_OUT in lowered.as_text():
        return _on_leaves(lowered.compile()), made.facts
    module: Any = lowered.compiler_ir()
    # Under another name each time, so that JAX does not find it in its own cache: what it loads
    # from there lacks functions when it is written again.
    with module.context:
        module.operation.attributes["sym_name"] = ir.StringAttr.get(f"program_{uuid.uuid4().hex}")
    compiled = lowered.compile()
    if is_as_imported():
        with contextlib.suppress(Exception):
            cache_folder.write(name, _contents(compiled, made.facts))
    return _on_leaves(compiled), made.facts


def _lowered(source: Source) -> jax.stages.Lowered:
    leaves, tree = jax.tree.flatten(source.inputs)

    # Files have no pytrees, whose classes only a pickle knows.
    def flat(*leaves: Any) -> tuple:
        return tuple(jax.tree.leaves(source.function(*jax.tree.unflatten(tree, leaves))))

    return jax.jit(flat).lower(*leaves)


def _on_leaves(compiled: Callable) -> Callable:
    return lambda *inputs: compiled(*jax.tree.leaves(inputs))


def _contents(compiled: jax.stages.Compiled, facts: Any) -> bytes:
    executable, inputs, outputs = serialize_executable.serialize(compiled)
    counts = {"inputs": inputs.num_leaves, "outputs": outputs.num_leaves}
    return json.dumps({**counts, "facts": facts}).encode() + b"\n" + executable


def _loaded(contents: bytes) -> tuple[Callable, Any]:
    head, executable = contents.split(b"\n", 1)
    known = json.loads(head)
    inputs = jax.tree.structure(((0,) * known["inputs"], {}))
    outputs = jax.tree.structure((0,) * known["outputs"])
    compiled = serialize_executable.deserialize_and_load(
        executable, inputs, outputs, execution_devices=jax.devices()[:1]
    )
    return _on_leaves(compiled), known["facts"]
