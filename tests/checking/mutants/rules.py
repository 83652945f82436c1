"""Mutants by rule: every number, every sign, every term, every name of a right stepper."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator

from tests.checking.mutants.mutant import Mutant, from_source, source_of
from tests.checking.mutants.originals import (
    StormerVerlet,
    explicit_euler,
    heun,
    leapfrog,
    midpoint,
    own_euler,
    position_verlet,
    rk4,
    rk4_coefficients,
    semi_implicit_euler,
    velocity_verlet,
)

# Names of one kind, in the order in which a step computes them; one is taken for another.
KINDS = (
    ("x", "x_half", "x_new"),
    ("v", "v_half", "v_guess", "v_new"),
    ("a", "a_new"),
    ("k1", "k2", "k3", "k4"),
    ("x1", "x2", "x3", "x4"),
    ("v1", "v2", "v3", "v4"),
    ("a1", "a2", "a3", "a4"),
    ("now", "before"),
)


def numbers(original: Callable) -> Iterator[Mutant]:
    """Every number a hundredth larger, and 0.01 in place of zero."""
    for node in _places(original, ast.Constant):
        value = node.value
        if isinstance(value, bool) or not isinstance(value, int | float):
            continue
        yield _changed(original, node, repr(1.01 * value if value else 0.01), "number")


def _sums(original: Callable) -> Iterator[tuple[ast.BinOp, bool, str, str]]:
    """Sums and differences: whether it is a sum, and its terms."""
    for node in _places(original, ast.BinOp):
        if isinstance(node.op, ast.Add | ast.Sub):
            yield (
                node,
                isinstance(node.op, ast.Add),
                ast.unparse(node.left),
                ast.unparse(node.right),
            )


def signs(original: Callable) -> Iterator[Mutant]:
    """Every plus as a minus, and the other way round."""
    for node, is_sum, left, right in _sums(original):
        yield _changed(original, node, f"({left} {'-' if is_sum else '+'} ({right}))", "sign")


def terms(original: Callable) -> Iterator[Mutant]:
    """Every term of a sum left out."""
    for node, is_sum, left, right in _sums(original):
        for kept in (left, right) if is_sum else (left,):
            yield _changed(original, node, f"({kept})", "term")


def names(original: Callable) -> Iterator[Mutant]:
    """Every name taken for another one of its kind that is there already."""
    for node in _places(original, ast.Name):
        kind = next((kind for kind in KINDS if node.id in kind), ())
        for other in kind:
            if other != node.id and other in _set_before(original, node):
                yield _changed(original, node, other, "name")


# Which rules for which original: all where each line matters in its own way.
_ALL = (numbers, signs, terms, names)
RULES: dict[Callable, tuple[Callable[[Callable], Iterator[Mutant]], ...]] = {
    explicit_euler: _ALL,
    semi_implicit_euler: _ALL,
    velocity_verlet: _ALL,
    leapfrog: (numbers,),
    position_verlet: (numbers,),
    StormerVerlet: (numbers, signs),
    heun: _ALL,
    midpoint: _ALL,
    rk4: (names,),
    rk4_coefficients: (numbers,),
    own_euler: (signs, terms),
}


def _places(original: Callable, kind: type) -> list:
    """Where it computes: not in indices and loops, nor in what a class says of itself."""
    tree = ast.parse(source_of(original))
    aside = {inner for node in ast.walk(tree) for each in _aside(node) for inner in ast.walk(each)}
    return [
        node
        for node in ast.walk(tree)
        if isinstance(node, kind)
        and node not in aside
        and not isinstance(getattr(node, "ctx", None), ast.Store)
    ]


def _aside(node: ast.AST) -> list:
    match node:
        case ast.Subscript():
            return [node.slice]
        case ast.For():
            return [node.target, node.iter]
        case ast.arguments():
            return [node]
        case ast.ClassDef():
            functions = [each for each in node.body if isinstance(each, ast.FunctionDef)]
            kept = [each for each in functions if each.name != "order"]
            return [*node.bases, *(each for each in node.body if each not in kept)]
    return []


def _set_before(original: Callable, node: ast.Name) -> set[str]:
    """Names that have a value where a name stands: parameters, and what lines above set."""
    functions = ast.walk(ast.parse(source_of(original)))
    (function,) = (
        each
        for each in functions
        if isinstance(each, ast.FunctionDef) and each.lineno <= node.lineno <= each.end_lineno
    )
    stored = (each for each in ast.walk(function) if isinstance(each, ast.Name))
    return {argument.arg for argument in function.args.args} | {
        each.id for each in stored if isinstance(each.ctx, ast.Store) and each.lineno < node.lineno
    }


def _changed(original: Callable, node: ast.expr, new: str, rule: str) -> Mutant:
    """With other text in place of a node, and named by what the line is then."""
    lines = source_of(original).splitlines()
    assert node.end_col_offset is not None
    assert node.lineno == node.end_lineno
    line = lines[node.lineno - 1]
    old = line[node.col_offset : node.end_col_offset]
    lines[node.lineno - 1] = line[: node.col_offset] + new + line[node.end_col_offset :]
    # A column tells apart what reads the same: the second 2 of a line.
    where = f"{node.lineno}.{node.col_offset}"
    name = f"{original.__name__}: {rule} {where}, {old} -> {new}"
    return from_source(original, name, lines[node.lineno - 1].strip(), "\n".join(lines))


def _by_rule() -> Iterator[Mutant]:
    for original, rules in RULES.items():
        # Two rules may come to the same.
        yield from {mutant.name: mutant for rule in rules for mutant in rule(original)}.values()


BY_RULE: tuple[Mutant, ...] = tuple(_by_rule())
