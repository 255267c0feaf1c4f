"""Templates that run for ever, grow without bound, call what is not theirs, or cannot be opened: one clear error."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest
from refusals import refuses

from machining.programs.rendering import environment, rendered
from machining.programs.sandbox import LARGEST, Budget
from machining.programs.write_options import WriteOptions
from robots import InputError

ENDLESS, LARGE, DEEP, BARRED = "come to an end", "too large", "nested too deep", "may not be called"


def render(folder: Path, text: str, **context: Any) -> str:
    (folder / "krl").mkdir(exist_ok=True)
    (folder / "krl" / "main.j2").write_text(text, encoding="utf-8")
    made = environment(folder)
    return "".join(rendered(made, "krl/main.j2", {"o": WriteOptions(), "count": 1, **context}))


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few steps: the tests need not wait for all."""
    monkeypatch.setattr("machining.programs.sandbox.STEPS", 20_000)
    monkeypatch.setattr("machining.programs.rendering.PRINTED", 200_000)


GROWN = (
    "{% set n = namespace(s='aaaaaaaa') %}{% for i in range(60) %}{% set n.s = GROW %}{% endfor %}{{ n.s | length }}"
)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{% for i in range(10 ** 9) %}x{% endfor %}", "Range too big"),
        ("{% for i in range(9999) %}{% for j in range(9999) %}x{% endfor %}{% endfor %}", ENDLESS),
        ("{% for i in range(9999) %}{% for j in range(9999) %}{% endfor %}{% endfor %}", ENDLESS),
        ("{% macro a(n) %}{% if n %}{{ a(n - 1) }}{{ a(n - 1) }}{% endif %}{% endmacro %}{{ a(60) }}", ENDLESS),
        ("{% set x = 'a' * 90000 %}{% for i in range(99) %}{{ x }}{% endfor %}", "prints too much"),
        ("{{ 'a' * 10 ** 11 }}", LARGE),
        ("{{ 10 ** 11 * 'a' }}", LARGE),
        ("{{ (range(99999) | list * 99) | length }}", LARGE),
        ("{{ 9 ** 9 ** 9 }}", LARGE),
        ("{% set n = namespace(s=9) %}{% for i in range(60) %}{% set n.s = n.s * n.s %}{% endfor %}", LARGE),
        (GROWN.replace("GROW", "n.s ~ n.s"), LARGE),
        (GROWN.replace("GROW", "n.s + n.s"), LARGE),
        (GROWN.replace("GROW", "n.s | replace('a', 'aaaaaaaa')"), LARGE),
        (GROWN.replace("GROW", "[n.s, n.s] | join"), LARGE),
        (GROWN.replace("GROW", "[n.s, n.s]"), LARGE),
        (GROWN.replace("GROW", "{1: n.s, 2: n.s}"), LARGE),
        (GROWN.replace("{% set n.s = GROW %}", "{% set n.s %}{{ n.s }}{{ n.s }}{% endset %}"), LARGE),
        ("{{ ['a', 'b'] | join('x' * 90000) }}", LARGE),
        ("{{ '%99999999d' | format(1) }}", LARGE),
        ("{{ '%*d' % (99999999, 1) }}", LARGE),
        ("{{ 15 | round(-10 ** 8) }}", LARGE),
        ("{% macro a(n) %}{{ a(n + 1) }}{% endmacro %}{{ a(0) }}", DEEP),
        ("{% include 'krl/main.j2' %}", DEEP),
        ("{% import 'krl/main.j2' as x %}", DEEP),
        ("{% extends 'krl/main.j2' %}", DEEP),
        ("{% for x in [[1]] recursive %}{{ loop([[1]]) }}{% endfor %}", DEEP),
        ("{{ " + "(" * 5000 + "1" + ")" * 5000 + " }}", DEEP),
        ("{% for i in [1] %}" * 60 + "x" + "{% endfor %}" * 60, "too many statically nested blocks"),
        ("{{ 'a'.ljust(10 ** 11) }}", BARRED),
        ("{{ '{:>99999999}'.format(1) }}", BARRED),
        ("{{ (5).to_bytes(10 ** 10, 'big') }}", BARRED),
        ("{{ o.model_dump() }}", BARRED),
        ("{{ lipsum(n=10 ** 9) }}", "'lipsum' is undefined"),
        ("{{ 'a' | center(10 ** 11) }}", "No filter named 'center'"),
        ("{{ [1] }}", "prints a list"),
        ("{{ (1e308 * 10) | int }}", "infinity"),
        ("{{ " + "9" * 5000 + " }}", "krl/main.j2"),
    ],
)
def test_what_does_not_end_is_one_error(tmp_path: Path, small: None, text: str, message: str) -> None:
    caught = refuses("Q010", message, render, tmp_path, text)
    assert len(str(caught)) < 1000


def test_templates_unpickle_nothing(tmp_path: Path) -> None:
    # The options are a pydantic model; its parse_raw takes proto="pickle", and a pickle runs what it likes.
    bomb = "cbuiltins\\neval\\n(S'1 / 0'\\ntR."
    refuses(
        "Q010",
        "parse_raw may not be called",
        render,
        tmp_path,
        "{{ o.parse_raw(" + f'"{bomb}"' + ", proto='pickle', allow_pickle=True) }}",
    )


def test_what_a_shop_needs_still_works(tmp_path: Path, small: None) -> None:
    text = """{% for a, b in zip(x, y) %}{{ loop.index }}:{{ a }}={{ "%.2f" % b }}{{ "," if not loop.last }}{% endfor %}
{{ x | join("-") }} {{ "N" ~ 10 }} {{ "a b".split() | last | upper }} {{ y | sum | round(1) }}
{% set n = namespace(k=0) %}{% for v in range(0, 100, 10) %}{% set n.k = n.k + 10 %}{% endfor %}N{{ n.k }}
{{ {"M8": "on"}.get("M8") }} {{ cycler("u", "v").next() }} {{ y | map("int") | list | join }}
"""
    found = render(tmp_path, text, x=("X", "Y"), y=(1.0, 2.5))
    assert found == "1:X=1.00,2:Y=2.50X-Y N10 B 3.5\nN100\non u 12\n"


def test_a_budget_ends_by_the_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("machining.programs.sandbox.SECONDS", -1.0)
    refuses("Q010", "template t does not come to an end", Budget.of("t", 1).spend, 1.0)


def test_lists_are_counted_within_lists() -> None:
    budget = Budget.of("t", 1)
    assert budget.sized([[1] * 10] * 10) == [[1] * 10] * 10
    refuses("Q010", "too large", budget.sized, [["a" * 100] * 100] * (LARGEST // 10_000))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda file: file.mkdir(), "it is a folder"),
        (os.mkfifo, "a pipe, socket or device"),
        (lambda file: file.symlink_to("/dev/zero"), "a pipe, socket or device"),
        (lambda file: file.symlink_to(file.parent / "nowhere"), "main.j2 cannot be read"),
        (lambda file: file.symlink_to(file), "main.j2 cannot be read"),
        (lambda file: file.write_bytes(b"; \xff\xfe"), "no UTF-8 text"),
        (lambda file: file.write_bytes(b"x" * 2**21), "size"),
    ],
)
def test_a_template_that_cannot_be_opened_is_not_passed_over(tmp_path: Path, make: Any, message: str) -> None:
    (tmp_path / "krl").mkdir()
    make(tmp_path / "krl" / "main.j2")
    made = environment(tmp_path)
    caught = refuses("F001 F002 F004", message, list, rendered(made, "krl/main.j2", {"count": 1}))
    assert "main.j2" in str(caught)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_a_template_without_the_right_to_read_it_is_named(tmp_path: Path) -> None:
    (tmp_path / "krl").mkdir()
    (tmp_path / "krl" / "main.j2").write_text("x")
    (tmp_path / "krl" / "main.j2").chmod(0)
    with pytest.raises(InputError, match=r"main\.j2"):
        list(rendered(environment(tmp_path), "krl/main.j2", {"count": 1}))


def test_a_folder_of_templates_that_nothing_is_taken_from_is_refused(tmp_path: Path) -> None:
    (tmp_path / "KRL").mkdir()
    (tmp_path / "KRL" / "Main.j2").write_text("x")
    refuses("Q010", "holds no template that is used", environment, tmp_path)
    (tmp_path / "krl").write_text("a file where a folder is meant")
    refuses("F001", "krl", environment, tmp_path)


def test_a_byte_order_mark_is_no_text(tmp_path: Path) -> None:
    (tmp_path / "krl").mkdir()
    (tmp_path / "krl" / "main.j2").write_bytes(b"\xef\xbb\xbfDEF x")
    assert "".join(rendered(environment(tmp_path), "krl/main.j2", {"count": 1})) == "DEF x"
