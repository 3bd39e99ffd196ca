# Copyright 2026 lmsco_ros contributors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Small changes of a module, each of which its tests should notice.

Left out are changes that mean nothing by rule: docstrings, texts, type hints, decorators, asserts,
`__all__`, the order of what may be swapped (`min`, `max`, `dist`, ...), and `strict=` of `zip`.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from dataclasses import dataclass

__all__ = ['Mutation', 'mutations']

_COMPARISONS: dict[type, tuple[type, ...]] = {
    ast.Lt: (ast.LtE, ast.GtE), ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE), ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,), ast.NotEq: (ast.Eq,), ast.Is: (ast.IsNot,), ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,), ast.NotIn: (ast.In,)}
_ARITHMETIC: dict[type, type] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Pow: ast.Mult,
    ast.FloorDiv: ast.Mult, ast.Mod: ast.Mult}
_SYMMETRIC = frozenset({'allclose', 'dist', 'hypot', 'max', 'maximum', 'min', 'minimum', 'vecdot'})
_MEANINGLESS_KEYWORDS = frozenset({'strict'})
_WITHOUT_MEANING = (ast.Assert, ast.Import, ast.ImportFrom, ast.JoinedStr)
_HINTS = frozenset({'annotation', 'decorator_list', 'returns'})


@dataclass(frozen=True)
class Mutation:
    """
    A module with one change.

    Attributes
    ----------
    line : int
        Where it was changed, in the module as it is.
    before, after : str
        What stood there, and what stands there now.
    source : str
        Text of the whole module.

    """

    line: int
    before: str
    after: str
    source: str


def mutations(source: str) -> list[Mutation]:
    """Return all small changes of a module, in the order of its text."""
    tree = ast.parse(source)
    found = []
    for node, put in _places(tree):
        before = ast.unparse(node)
        for other in _alternatives(node):
            put(other)
            found.append(Mutation(node.lineno, before, ast.unparse(other), ast.unparse(tree)))
        put(node)
    return sorted(found, key=lambda mutation: mutation.line)


_Node = ast.stmt | ast.expr


def _places(parent: ast.AST) -> Iterator[tuple[_Node, Callable[[ast.AST], None]]]:
    """Yield every statement and expression that means something, and how to replace it."""
    for name, value in ast.iter_fields(parent):
        if name in _HINTS:
            continue
        for index, child in enumerate(value if isinstance(value, list) else [value]):
            if not isinstance(child, ast.AST) or _means_nothing(child):
                continue
            if isinstance(child, (ast.stmt, ast.expr)):
                yield child, _setter(parent, name, index if isinstance(value, list) else None)
            yield from _places(child)


def _setter(parent: ast.AST, name: str, index: int | None) -> Callable[[ast.AST], None]:
    """Return the function that puts a node in a place."""
    if index is None:
        return lambda node: setattr(parent, name, node)
    return lambda node: getattr(parent, name).__setitem__(index, node)


def _means_nothing(node: ast.AST) -> bool:
    """Return whether no test can tell what is changed in a node, or none should."""
    if isinstance(node, ast.keyword):
        return node.arg in _MEANINGLESS_KEYWORDS
    if isinstance(node, ast.Assign):
        return any(isinstance(target, ast.Name) and target.id == '__all__'
                   for target in node.targets)
    if isinstance(node, ast.If):
        return isinstance(node.test, ast.Name) and node.test.id == 'TYPE_CHECKING'
    docstring = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    return docstring or isinstance(node, _WITHOUT_MEANING)


def _alternatives(node: _Node) -> Iterator[ast.AST]:
    """Yield what may stand in place of a statement or expression."""
    for kind, change in _OPERATORS:
        if isinstance(node, kind):
            yield from change(node)


def _compared_otherwise(node: ast.Compare) -> Iterator[ast.AST]:
    """Yield the comparison with its limit on the other side, and turned round."""
    for index, operator in enumerate(node.ops):
        for other in _COMPARISONS[type(operator)]:
            ops = [*node.ops[:index], other(), *node.ops[index + 1:]]
            yield ast.Compare(node.left, ops, node.comparators)


def _calculated_otherwise(node: ast.BinOp) -> Iterator[ast.AST]:
    """Yield the sum as a difference, the product as a quotient, and so on."""
    if type(node.op) in _ARITHMETIC:
        yield ast.BinOp(node.left, _ARITHMETIC[type(node.op)](), node.right)


def _joined_otherwise(node: ast.BoolOp) -> Iterator[ast.AST]:
    """Yield `and` for `or`, and `or` for `and`."""
    yield ast.BoolOp(ast.Or() if isinstance(node.op, ast.And) else ast.And(), node.values)


def _without_sign(node: ast.UnaryOp) -> Iterator[ast.AST]:
    """Yield the operand without `not` or minus."""
    if isinstance(node.op, (ast.Not, ast.USub)):
        yield node.operand


def _other_constant(node: ast.Constant) -> Iterator[ast.AST]:
    """Yield another number, or the other truth value."""
    if isinstance(node.value, bool):
        yield ast.Constant(not node.value)
    elif isinstance(node.value, int):
        yield ast.Constant(node.value + 1)
    elif isinstance(node.value, float):
        yield ast.Constant(1.5 * node.value or 1.0)


def _other_condition(node: ast.If | ast.IfExp | ast.While) -> Iterator[ast.AST]:
    """Yield the branches exchanged, where the condition is not one that is changed itself."""
    if not isinstance(node.test, (ast.BoolOp, ast.Compare, ast.UnaryOp)):
        others = {name: value for name, value in ast.iter_fields(node) if name != 'test'}
        yield type(node)(test=ast.UnaryOp(ast.Not(), node.test), **others)


def _left_out(node: ast.stmt) -> Iterator[ast.AST]:
    """Yield nothing in place of a call, or of a value that is kept in an attribute."""
    kept = isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Attribute)
    called = isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)
    if kept or called or isinstance(node, ast.AugAssign):
        yield ast.Pass()


def _returned_nothing(node: ast.Return) -> Iterator[ast.AST]:
    """Yield a return without the value; a constant is changed itself."""
    if not isinstance(node.value, (ast.Constant, type(None))):
        yield ast.Return(ast.Constant(None))


def _called_otherwise(node: ast.Call) -> Iterator[ast.AST]:
    """Yield the call with two neighboring arguments swapped, or without a named one."""
    name = ast.unparse(node.func).rsplit('.', 1)[-1]
    for index in range(0 if name in _SYMMETRIC else len(node.args) - 1):
        first, second = node.args[index:index + 2]
        if ast.dump(first) != ast.dump(second):
            yield ast.Call(node.func, [*node.args[:index], second, first, *node.args[index + 2:]],
                           node.keywords)
    for keyword in node.keywords:
        if not _means_nothing(keyword):
            yield ast.Call(node.func, node.args, [k for k in node.keywords if k is not keyword])


_OPERATORS: tuple[tuple[type | tuple[type, ...], Callable], ...] = (
    (ast.Compare, _compared_otherwise), (ast.BinOp, _calculated_otherwise),
    (ast.BoolOp, _joined_otherwise), (ast.UnaryOp, _without_sign),
    (ast.Constant, _other_constant), ((ast.If, ast.IfExp, ast.While), _other_condition),
    (ast.stmt, _left_out), (ast.Return, _returned_nothing), (ast.Call, _called_otherwise))
