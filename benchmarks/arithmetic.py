"""Sums, products, powers, brackets and named functions of numbers in a text, without running it."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from typing import Any

_TWO: Mapping[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
_ONE: Mapping[type[ast.unaryop], Callable[[Any], Any]] = {ast.UAdd: operator.pos, ast.USub: operator.neg}


def value(text: str, names: Mapping[str, Any]) -> Any:
    """What an expression comes to; ``names``: numbers, texts and functions of one number that it may name.

    Raises
    ------
    ValueError
        Anything else than such an expression, or a name that is not known.
    """
    try:
        return _of(ast.parse(text.strip(), mode="eval").body, names)
    except (SyntaxError, KeyError) as error:
        raise ValueError(f"no arithmetic: {text}") from error


def _of(node: ast.expr, names: Mapping[str, Any]) -> Any:
    match node:
        case ast.Constant(value=int() | float() as number):
            return number
        case ast.Name(id=name):
            return names[name]
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _TWO:
            return _TWO[type(op)](_of(left, names), _of(right, names))
        case ast.UnaryOp(op=op, operand=operand) if type(op) in _ONE:
            return _ONE[type(op)](_of(operand, names))
        case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]):
            return names[name](_of(argument, names))
    raise ValueError(f"no arithmetic: {ast.unparse(node)}")
