"""The sandbox that templates run in: what they may call, and bounds on steps, sizes and time.

Jinja2's own sandbox keeps a template away from Python's internals; it does not keep it from running for ever, from
filling the memory, or from calling the methods of the options (pydantic's ``parse_raw`` unpickles). So here a template
calls macros and what jinja2 itself offers, and every loop, call, operator and text is charged to a :class:`Budget`.
"""

from __future__ import annotations

import dataclasses
import functools
import re
import time
import types
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import jinja2
from jinja2 import nodes
from jinja2.compiler import CodeGenerator
from jinja2.exceptions import SecurityError
from jinja2.runtime import BlockReference, Context, LoopContext, Macro, Undefined
from jinja2.sandbox import ImmutableSandboxedEnvironment, safe_range
from jinja2.utils import Cycler, Joiner, Namespace
from jinja2.visitor import NodeTransformer

from machining.programs.job import Move
from machining.programs.source_text import SourceText
from robots import InputError

# The bundled templates take some ten steps a move; a template that takes more than this works on something else.
STEPS, STEPS_PER_MOVE = 500_000, 200
SECONDS, SECONDS_PER_MOVE = 60.0, 0.01
# Characters of a text and items of a list that a template makes: lines of a program are far shorter.
LARGEST = 100_000
# Whole numbers beyond are neither counts nor coordinates.
BITS = 256
# Characters of text that are charged as one step, and steps that a call takes (by its time).
A_STEP = 64
CALL = 8.0

_FIELDS = frozenset(field.name for field in dataclasses.fields(Move))
_SCALARS = (str, int, float, type(None), Undefined, SourceText)
# Filters that make nothing larger than what they are given, and those that are checked before (see _bounded).
_FILTERS = """abs attr capitalize d default dictsort first float format int items join last length count list lower map
max min reject rejectattr replace reverse round select selectattr sort sum title trim unique upper"""
_TEXT_FILTERS = ("capitalize", "lower", "title", "trim", "upper", "comment", "word", "replace", "format")
_METHODS = """capitalize count endswith find get index isalpha isdigit isnumeric items keys lower lstrip removeprefix
removesuffix rfind rstrip split startswith strip title upper values"""
# A width or precision of four digits, or one that comes as an argument.
_WIDE = re.compile(r"%[^a-zA-Z%]*(?:\d{4}|\*)")
_FIGURES = 15


@dataclasses.dataclass
class Budget:
    """What a template may still do: ``left`` steps, until ``deadline`` (of ``time.monotonic``), ``name`` for errors."""

    name: str
    left: float
    deadline: float

    @classmethod
    def of(cls, name: str, moves: int) -> Budget:
        """The budget of a template for a program of so many moves."""
        seconds = SECONDS + SECONDS_PER_MOVE * moves
        return cls(name, STEPS + STEPS_PER_MOVE * moves, time.monotonic() + seconds)

    def spend(self, steps: float) -> None:
        """Take steps. Raises InputError where none are left."""
        self.left -= steps
        if self.left < 0.0 or time.monotonic() > self.deadline:
            raise InputError(
                f"template {self.name} does not come to an end",
                code="Q010",
                allowed=f"{STEPS} steps in {SECONDS:g} s, and {STEPS_PER_MOVE} in {SECONDS_PER_MOVE:g} s a move more",
                remedy="look for loops in loops, and for macros that call themselves",
            )

    def sized(self, value: Any) -> Any:
        """The value, charged by its size. Raises InputError where it is too large."""
        size = _size(value, LARGEST)
        self.spend(1.0 + size / A_STEP)
        if size > LARGEST:
            raise self.too_large()
        return value

    def too_large(self) -> InputError:
        """The error for a value that is too large, or would be."""
        return InputError(
            f"template {self.name} makes a text, list or number that is too large",
            code="Q010",
            allowed=f"{LARGEST} characters or items, whole numbers of {BITS} bits",
            remedy="write in pieces what is long",
        )

    def too_long(self, most: int, per_move: int) -> InputError:
        """The error for a template that prints more characters than that."""
        return InputError(
            f"template {self.name} prints too much",
            code="Q010",
            allowed=f"{most:,} characters and {per_move:,} a move",
            remedy="look for loops in loops",
        )


def _size(value: Any, most: int) -> int:
    """Characters of a text, bytes of a number, items of lists in lists; counting stops beyond ``most``."""
    if isinstance(value, str):
        return len(value)
    if isinstance(value, int):
        return most + 1 if value.bit_length() > BITS else 1
    total, open_ = 1, [value]
    while open_ and total <= most:
        node = open_.pop()
        if isinstance(node, dict):
            node = [*node.keys(), *node.values()]
        if isinstance(node, list | tuple | set | frozenset):
            total += len(node)
            open_ += [one for one in node if isinstance(one, list | tuple | set | frozenset | dict)]
            total += sum(len(one) for one in node if isinstance(one, str))
    return total


class _Charged(NodeTransformer):
    """Loops, joined texts and lists written out go through filters that charge them."""

    def visit_For(self, node: nodes.For) -> nodes.Node:  # noqa: N802 - jinja2's name
        node = self.generic_visit(node)  # type: ignore[assignment]
        node.iter = _through("_steps", node.iter)
        return node

    def visit_Concat(self, node: nodes.Concat) -> nodes.Node:  # noqa: N802
        node = self.generic_visit(node)  # type: ignore[assignment]
        return _through("_joined", nodes.List(node.nodes, lineno=node.lineno))

    def visit_List(self, node: nodes.List | nodes.Dict) -> nodes.Node:  # noqa: N802
        return _through("_sized", self.generic_visit(node))

    visit_Dict = visit_List  # noqa: N815

    def visit_Tuple(self, node: nodes.Tuple) -> nodes.Node:  # noqa: N802
        node = self.generic_visit(node)  # type: ignore[assignment]
        return node if node.ctx != "load" else _through("_sized", node)


def _through(name: str, node: Any) -> nodes.Filter:
    return nodes.Filter(node, name, [], [], None, None, lineno=node.lineno)


class _Generator(CodeGenerator):
    def visit_Template(self, node: nodes.Template, frame: Any = None) -> None:  # noqa: N802
        _Charged().visit(node)
        node.set_environment(self.environment)
        super().visit_Template(node, frame)


class Sandbox(ImmutableSandboxedEnvironment):
    """The sandbox; :attr:`budget` is that of the template being rendered."""

    code_generator_class = _Generator
    intercepted_binops = frozenset(["+", "*", "**", "%"])

    def __init__(self, **options: Any) -> None:
        # Constants are not worked out beforehand: nothing would bound that.
        super().__init__(optimized=False, finalize=_printed, **options)
        self.budget = Budget.of("", 0)
        self.globals = {
            "range": safe_range,
            "zip": zip,
            "dict": dict,
            "namespace": Namespace,
            "cycler": Cycler,
            "joiner": Joiner,
        }
        self.filters = {name: self._charged(name, self.filters[name]) for name in _FILTERS.split()}
        self.filters |= {"_steps": self._steps, "_joined": self._joined, "_sized": self._sized}

    def add_filter(self, name: str, function: Callable[..., Any]) -> None:
        """A filter of our own, charged as jinja2's are."""
        self.filters[name] = self._charged(name, function)

    def getattr(self, obj: Any, attribute: str) -> Any:
        """A short way to the plain data of moves: the sandbox's own checks take most of a long program's time."""
        if type(obj) is Move and attribute in _FIELDS:
            return getattr(obj, attribute)
        return super().getattr(obj, attribute)

    def is_safe_callable(self, obj: Any) -> bool:
        """Macros, what jinja2 offers, and methods of texts and lists that make nothing large."""
        if isinstance(obj, types.BuiltinMethodType):
            return type(obj.__self__) in (str, list, tuple, dict) and obj.__name__ in _METHODS.split()
        if isinstance(obj, types.MethodType):
            return isinstance(obj.__self__, LoopContext | Cycler)
        offered = obj is safe_range or obj in (zip, dict, Namespace, Cycler, Joiner)
        return offered or isinstance(obj, Macro | LoopContext | BlockReference | Joiner)

    def call(__self, __context: Context, __obj: Any, *args: Any, **kwargs: Any) -> Any:  # noqa: N805 - as jinja2
        """Call something, charged."""
        if not __self.is_safe_callable(__obj):
            name = getattr(__obj, "__name__", type(__obj).__name__)
            raise SecurityError(f"{name} may not be called in a template; allowed: macros, filters, methods of texts")
        __self.budget.spend(CALL)
        return __self.budget.sized(super().call(__context, __obj, *args, **kwargs))

    def call_binop(self, context: Context, operator: str, left: Any, right: Any) -> Any:
        """``+``, ``*``, ``**`` and ``%``, refused before they make something large."""
        sizes = _size(left, LARGEST), _size(right, LARGEST)
        whole = isinstance(left, int) and isinstance(right, int)
        if operator == "*" and not whole:
            times = max((v for v in (left, right) if isinstance(v, int)), default=1)
            if max(sizes) * times > LARGEST:
                raise self.budget.too_large()
        if operator == "**" and whole and (right > BITS or abs(left).bit_length() * right > BITS):
            raise self.budget.too_large()
        if operator == "%" and isinstance(left, str):
            self._check_format(left, right)
        if operator == "+" and sum(sizes) > LARGEST + 1:
            raise self.budget.too_large()
        return self.budget.sized(super().call_binop(context, operator, left, right))

    def concat(self, pieces: Iterable[str]) -> str:
        """Texts of a macro or of a block as one."""
        parts = list(pieces)
        if sum(map(len, parts)) > LARGEST:
            raise self.budget.too_large()
        return str(self.budget.sized("".join(parts)))

    def _charged(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        first = 1 if hasattr(function, "jinja_pass_arg") else 0

        @functools.wraps(function)
        def charged(*args: Any, **kwargs: Any) -> Any:
            self._check_filter(name, list(args[first:]), kwargs)
            return self.budget.sized(function(*args, **kwargs))

        return charged

    def _check_filter(self, name: str, args: list[Any], kwargs: dict[str, Any]) -> None:
        if name in _TEXT_FILTERS:
            _scalars([*args, *kwargs.values()])
        if name == "format" and args:
            self._check_format(args[0], [*args[1:], *kwargs.values()])
        elif name == "replace" and len(args) > 2:
            text, old, new = (str(v) for v in args[:3])
            if (len(text) + 1) / max(len(old), 1) * len(new) > LARGEST:
                raise self.budget.too_large()
        elif name == "round" and any(isinstance(v, int) and abs(v) > _FIGURES for v in args[1:2]):
            raise self.budget.too_large()
        elif name == "join" and args and isinstance(args[0], list | tuple):
            _scalars(args[0])
            between = args[1] if len(args) > 1 else kwargs.get("d", "")
            if len(args[0]) * _size(between, LARGEST) > LARGEST:
                raise self.budget.too_large()

    def _check_format(self, text: str, values: Any) -> None:
        _scalars(
            values if isinstance(values, list | tuple) else values.values() if isinstance(values, dict) else [values]
        )
        if _WIDE.search(text):
            raise self.budget.too_large()

    def _steps(self, items: Iterable[Any]) -> Iterator[Any]:
        budget = self.budget
        for item in items:
            budget.spend(1.0)
            yield item

    def _joined(self, items: list[Any]) -> str:
        _scalars(items)
        return str(self.budget.sized("".join(map(str, items))))

    def _sized(self, value: Any) -> Any:
        return self.budget.sized(value)


def _scalars(values: Iterable[Any]) -> None:
    for value in values:
        _printed(value)


def _printed(value: Any) -> Any:
    """What a template may print: texts and numbers."""
    if not isinstance(value, _SCALARS):
        raise jinja2.TemplateError(f"prints a {type(value).__name__}; allowed: texts and numbers, lists with | join")
    return value
