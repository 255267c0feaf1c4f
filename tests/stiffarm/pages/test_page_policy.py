"""Every page carries a Content-Security-Policy that runs what the template holds, and nothing else."""

from __future__ import annotations

import base64
import hashlib
import re
from pathlib import Path
from typing import Any

import pytest

from stiffarm.pages.parts import render_page
from stiffarm.pages.report import KeyFigure, Note, Section, Table, Text, render

ROOT = Path(__file__).parents[3]
TEMPLATES = sorted((ROOT / "stiffarm" / "pages" / "templates").glob("*.html.j2"))
HOSTILE = "<script>alert('x')</script><img src=x onerror=alert(1)>"
WORDS: dict[str, Any] = dict.fromkeys(
    ("title", "verdict", "robot", "hash", "digits", "near", "load", "version", "thinned"), HOSTILE
)
WORDS |= {"about": [(HOSTILE, HOSTILE)], "notes": [HOSTILE], "quantities": [(HOSTILE,) * 5]}


def policy_of(page: str) -> dict[str, str]:
    head = page.partition("<title>")[0]
    found = re.findall(r'<meta http-equiv="Content-Security-Policy" content="([^"]*)">', head)
    assert len(found) == 1, head
    return {name: rest for name, _, rest in (part.partition(" ") for part in found[0].split("; "))}


def hashes(page: str, kind: str) -> list[str]:
    found = re.findall(rf"<{kind}>(.*?)</{kind}>", page, re.DOTALL)
    return [f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'" for text in found]


def check(page: str) -> None:
    policy = policy_of(page)
    assert policy["default-src"] == "'none'"
    assert "unsafe" not in str(policy)
    assert policy["style-src"].split() == hashes(page, "style")
    assert policy.get("script-src", "").split() == hashes(page, "script")
    assert HOSTILE not in page
    # A policy of hashes lets no attribute through that styles or runs.
    assert not re.search(r"<[^>]*\s(?:style|on[a-z]+)=", re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL))


def test_the_report() -> None:
    blocks = (Text(HOSTILE), Note(HOSTILE), Table("t", ("a",), ((HOSTILE,),)))
    check(render(HOSTILE, HOSTILE, [KeyFigure("1", HOSTILE)], [Section(HOSTILE, blocks)], HOSTILE))


@pytest.mark.parametrize(
    ("template", "scripts"),
    [
        ("replay.html.j2", ("page_matrices.js", "shop_scene.js")),
        ("axes_page.html.j2", ("page_matrices.js", "shop_scene.js", "axes_page.js")),
        ("map_viewer.html.j2", ("page_matrices.js", "map_viewer_data.js", "map_viewer_draw.js")),
    ],
)
def test_pages_with_scripts(template: str, scripts: tuple[str, ...]) -> None:
    check(render_page(template, {"text": HOSTILE}, scripts, **WORDS))


def test_what_slips_in_would_not_run() -> None:
    # As if a template had forgotten to escape: the policy is made without the content.
    page = render(HOSTILE, "", [], [], "").replace("&lt;script&gt;", "<script>").replace("&lt;/script&gt;", "</script>")
    assert hashes(page, "script")
    assert "script-src" not in policy_of(page)


@pytest.mark.parametrize("template", TEMPLATES, ids=lambda path: path.name)
def test_every_template_has_the_policy_before_all_else(template: Path) -> None:
    text = template.read_text(encoding="utf-8")
    assert text.index("{{ policy }}") < min(text.index(tag) for tag in ("<title", "<style"))
    assert not re.search(r"<(?:link|iframe|object|embed|base|form)\b|\bsrc=\"http|url\(", text)


def test_pages_are_made_in_one_place() -> None:
    assert len(TEMPLATES) == 6
    for package in ("stiffarm", "doe", "machining"):
        for file in (ROOT / package).rglob("*.py"):
            text = file.read_text(encoding="utf-8")
            if file.name != "page_parts.py":
                assert "<html" not in text
                assert 'PackageLoader("stiffarm"' not in text, file
                assert "export_html" not in text
