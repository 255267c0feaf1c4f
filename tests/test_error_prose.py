"""The text of a refusal stands where a command refuses; a page or an answer that goes on has prose."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from robots import InputError
from robots.errors import InputErrors

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("robots", "meshes", "fem", "doe", "surrogate", "machining", "rehearsal", "stiffarm")
# Where a refusal is passed on as one: console, Python's face, the service, the workers of a map.
REFUSING = {
    "stiffarm/session/console.py",
    "stiffarm/capability.py",
    "machining/service/wire.py",
    "stiffarm/commands/maps/request.py",
}


def quoted(code: ast.AST) -> list[int]:
    """Lines on which an InputError's own text is put into another text or kept, and not raised again or looked at."""
    found: list[int] = []
    for handler in ast.walk(code):
        if not isinstance(handler, ast.ExceptHandler) or handler.type is None or handler.name is None:
            continue
        if "InputError" not in ast.dump(handler.type):
            continue
        waiting: list[ast.AST] = list(handler.body)
        while waiting:
            node = waiting.pop()
            if isinstance(node, ast.Raise | ast.Compare):
                continue
            waiting += ast.iter_child_nodes(node)
            text = node.value if isinstance(node, ast.FormattedValue) else None
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ("str", "repr"):
                text = node.args[0] if node.args else None
            if isinstance(text, ast.Name) and text.id == handler.name:
                found.append(node.lineno)
    return found


def test_no_error_message_stands_on_a_page_as_an_answer() -> None:
    texts = {
        path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
        for one in PACKAGES
        for path in (ROOT / one).rglob("*.py")
    }
    trees = {path: ast.parse(text) for path, text in texts.items() if "except" in text and "InputError" in text}
    assert {path: lines for path, tree in trees.items() if path not in REFUSING and (lines := quoted(tree))} == {}


@pytest.mark.parametrize(
    ("body", "lines"),
    [
        ("text = f'none: {e}'", [4]),
        ("kept = str(e)", [4]),
        ("raise InputError(f'none: {e}')", []),
        ("if 'shape' in str(e): pass", []),
        ("text = f'none: {e.prose}'", []),
    ],
)
def test_the_check_tells_a_quoted_message(body: str, lines: list[int]) -> None:
    assert quoted(ast.parse(f"try:\n    pass\nexcept InputError as e:\n    {body}")) == lines


def test_prose_has_no_form_of_a_refusal() -> None:
    one = InputError(
        "set-ups that would tell a from b", code="X004", value="none of 300 tried", allowed="one", remedy="turn it"
    )
    assert one.prose == "set-ups that would tell a from b: none of 300 tried (needed: one). Turn it"
    assert InputError("nothing moves", code="X004").prose == "nothing moves"
    both = InputErrors("link 3", [one, InputError("nothing moves", code="X004")])
    assert both.prose == f"link 3 (2 in all): {one.prose}"
    assert "\n" not in both.prose
