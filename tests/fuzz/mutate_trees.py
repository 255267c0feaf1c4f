"""Mutations of TOML and JSON as trees: keys dropped, doubled, retyped, swapped, nested deep, grown, renamed."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from typing import Any

from .mutate_bytes import Mutation
from .samples import NUMBERS, TEXTS, Rng, chance, one

Path = tuple[str | int, ...]
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_DEEP = 2000


class Raw(str):
    """Text that goes into the file as it stands."""

    __slots__ = ()


class Twice:
    """A value whose key stands there twice."""

    def __init__(self, value: Any) -> None:
        self.value = value


@lru_cache(maxsize=256)
def _parsed(data: bytes, style: str) -> Any:
    text = data.decode("utf-8")
    return tomllib.loads(text) if style == "toml" else json.loads(text)


def tree_mutation(style: str) -> Mutation:
    """A mutation of files of a style, "toml" or "json"; what is no such file stays."""
    return partial(_mutate, style=style)


def _mutate(data: bytes, rng: Rng, others: Sequence[bytes], style: str) -> bytes:
    try:
        tree = _parsed(data, style)
    except (ValueError, RecursionError):
        return data
    changed = one(rng, _CHANGES)(tree, rng)
    try:
        return emitted(changed, style)
    except (ValueError, RecursionError):
        return data


def emitted(tree: Any, style: str) -> bytes:
    """The tree as a file."""
    if style == "json":
        return _json(tree).encode("utf-8", errors="replace")
    if not isinstance(tree, dict):
        tree = {"schema": tree}
    lines = [f"{_key(k)} = {_toml(v)}" for key, value in tree.items() for k, v in _pairs(key, value)]
    return ("\n".join(lines) + "\n").encode("utf-8", errors="replace")


def _pairs(key: Any, value: Any) -> list[tuple[str, Any]]:
    return [(str(key), value.value)] * 2 if isinstance(value, Twice) else [(str(key), value)]


def _key(name: str) -> str:
    return name if _BARE.fullmatch(name) else _string(name)


def _string(text: str) -> str:
    # TOML and JSON strings share these escapes; lone surrogates do not come up.
    return json.dumps(text).replace("\x7f", "\\u007f")


def _toml(node: Any) -> str:
    if isinstance(node, dict):
        inner = ", ".join(f"{_key(k)} = {_toml(v)}" for key, value in node.items() for k, v in _pairs(key, value))
        return "{ " + inner + " }"
    if isinstance(node, list):
        return "[" + ", ".join(map(_toml, node)) + "]"
    if node is None:
        return '"none"'
    return _plain(node)


def _json(node: Any) -> str:
    if isinstance(node, dict):
        inner = ", ".join(f"{_string(k)}: {_json(v)}" for key, value in node.items() for k, v in _pairs(key, value))
        return "{" + inner + "}"
    if isinstance(node, list):
        return "[" + ", ".join(map(_json, node)) + "]"
    return "null" if node is None else _plain(node)


def _plain(node: Any) -> str:
    if isinstance(node, Raw):
        return str(node)
    if isinstance(node, Twice):
        return _plain(node.value)
    if isinstance(node, bool):
        return "true" if node else "false"
    if isinstance(node, str):
        return _string(node)
    return repr(node) if isinstance(node, int | float) else _string(str(node))


def _paths(tree: Any) -> list[Path]:
    """Paths to every node below the root."""
    out: list[Path] = []
    stack: list[tuple[Path, Any]] = [((), tree)]
    while stack:
        path, node = stack.pop()
        items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
        for step, child in items:
            out.append((*path, step))
            if isinstance(child, dict | list):
                stack.append(((*path, step), child))
    return out


def _get(tree: Any, path: Path) -> Any:
    for step in path:
        tree = tree[step]
    return tree


def _with(tree: Any, path: Path, change: Callable[[Any], Any]) -> Any:
    """The tree with another node at ``path``; what lies off the way is shared, for the parsed tree is kept."""
    if not path:
        return change(tree)
    copy: Any = dict(tree) if isinstance(tree, dict) else list(tree)
    copy[path[0]] = _with(tree[path[0]], path[1:], change)
    return copy


def _pick(tree: Any, rng: Rng) -> Path:
    paths = _paths(tree)
    return one(rng, paths) if paths else ()


def _drop(tree: Any, rng: Rng) -> Any:
    path = _pick(tree, rng)
    if not path:
        return {}

    def without(node: Any) -> Any:
        copy: Any = dict(node) if isinstance(node, dict) else list(node)
        del copy[path[-1]]
        return copy

    return _with(tree, path[:-1], without)


def _retype(tree: Any, rng: Rng) -> Any:
    return _with(tree, _pick(tree, rng), lambda node: one(rng, _VALUES)(node, rng))


def _figure(tree: Any, rng: Rng) -> Any:
    """A number becomes another one."""
    places = [path for path in _paths(tree) if isinstance(_get(tree, path), int | float)]
    if not places:
        return tree
    return _with(tree, one(rng, places), lambda node: _odd_number(node, rng))


def _odd_number(node: Any, rng: Rng) -> Any:
    if chance(rng, 0.4):
        # A number of hundreds of digits, made by an earlier mutation, is beyond floats.
        node = max(-1e300, min(node, 1e300))
        return node * one(rng, (-1, 0, 1e-3, 1e3, 1e9, 1e-9, 2, 57.29577951308232, 1e150, 1e-150))
    return Raw(one(rng, NUMBERS).decode("utf-8") or "0")


def _swap(tree: Any, rng: Rng) -> Any:
    a, b = _pick(tree, rng), _pick(tree, rng)
    if a[: len(b)] == b or b[: len(a)] == a:
        return tree
    first, second = _get(tree, a), _get(tree, b)
    return _with(_with(tree, a, lambda _: second), b, lambda _: first)


def _copy_over(tree: Any, rng: Rng) -> Any:
    """The value of one place at another: a name used twice, a wrong unit, a table where a number stood."""
    a = _pick(tree, rng)
    value = _get(tree, a)
    same = [path for path in _paths(tree) if type(_get(tree, path)) is type(value)]
    return _with(tree, one(rng, same) if same and chance(rng, 0.7) else _pick(tree, rng), lambda _: value)


def _twice(tree: Any, rng: Rng) -> Any:
    path = _pick(tree, rng)
    if path and isinstance(path[-1], str):
        return _with(tree, path, Twice)
    return tree


def _grow(tree: Any, rng: Rng) -> Any:
    lists = [path for path in _paths(tree) if isinstance(_get(tree, path), list)]
    if not lists:
        return tree
    times = one(rng, (0, 2, 2, 3, 500))
    return _with(tree, one(rng, lists), lambda node: [*node, *node[-1:]] if times == 2 else node * times)


def _reorder(tree: Any, rng: Rng) -> Any:
    lists = [path for path in _paths(tree) if isinstance(_get(tree, path), list)]
    if not lists:
        return tree
    return _with(tree, one(rng, lists), lambda node: [node[i] for i in rng.permutation(len(node))])


def _unknown(tree: Any, rng: Rng) -> Any:
    tables = [(), *(path for path in _paths(tree) if isinstance(_get(tree, path), dict))]
    name = one(rng, (*TEXTS, b"unit", b"value", b"schema", b"name", b"Value")).decode("utf-8", errors="replace")
    value = one(rng, (1, "x", [], {}, 1.5, True))
    return _with(tree, one(rng, tables), lambda node: {**node, name: value} if isinstance(node, dict) else node)


def _rename(tree: Any, rng: Rng) -> Any:
    path = _pick(tree, rng)
    if not path or not isinstance(path[-1], str):
        return tree
    old = path[-1]
    new = one(rng, (old.upper(), old + "_", old.replace("_mm", "_m"), old.replace("_deg", "_rad"), ""))
    return _with(tree, path[:-1], lambda node: {(new if key == old else key): value for key, value in node.items()})


def _nest(rng: Rng) -> Raw:
    opening, closing = one(rng, (("[", "]"), ('{"a":', "}"), ("{a=", "}")))
    return Raw(opening * _DEEP + "1" + closing * _DEEP)


_VALUES: tuple[Callable[[Any, Rng], Any], ...] = (
    lambda _, rng: Raw(one(rng, NUMBERS).decode("utf-8") or "0"),
    lambda _, rng: one(rng, TEXTS).decode("utf-8", errors="replace"),
    lambda _, rng: one(rng, (True, False, [], {}, [[]], [1, 2, 3], {"value": 1}, "0", 0, -1, None)),
    lambda node, _: [node],
    lambda node, _: {"value": node},
    lambda node, _: str(node)[:1000],
    lambda node, _: node[0] if isinstance(node, list) and node else node,
    lambda _, rng: _nest(rng),
    lambda _, rng: [1.0] * one(rng, (1, 2, 4, 7, 5000)),
    lambda _, rng: one(
        rng, ("deg", "rad", "mm", "m", "kg", "lb", "N", "inch", "1", "N m/rad", "j1", "j2", "base", "tool0")
    ),
    lambda _, rng: Raw(one(rng, ("1979-05-27", "07:32:00", "'''x'''", '"\\u0000"', '"\\ud800"', "+inf"))),
)
_CHANGES: tuple[Callable[[Any, Rng], Any], ...] = (
    _drop,
    _retype,
    _retype,
    _figure,
    _figure,
    _figure,
    _swap,
    _copy_over,
    _copy_over,
    _twice,
    _grow,
    _reorder,
    _unknown,
    _rename,
)
