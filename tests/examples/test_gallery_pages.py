"""What the gallery makes of sphinx-gallery's pages."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("sphinx")

import gallery_pages
from gallery_pages import outcome, picture, tidy

PAGE = """
.. DO NOT EDIT.

.. only:: html

    .. note::
        :class: sphx-glr-download-link-note

        :ref:`Go to the end <sphx_glr_download_x>`
        to download the full example code.

.. rst-class:: sphx-glr-example-title

Why?
====

.. rst-class:: sphx-glr-script-out

 .. code-block:: none

    a  b
    It is 3 mm



Below.

.. _sphx_glr_download_x:

.. only:: html

    :download:`Download zipped: a.zip <a.zip>`
"""


@pytest.fixture
def gallery(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """One script and its page."""
    for name in ("DOCS", "EXAMPLES", "RUN_IN"):
        monkeypatch.setattr(gallery_pages, name, tmp_path)
    monkeypatch.setattr(gallery_pages, "PAGES", tmp_path / "scripts")
    (tmp_path / "scripts").mkdir()
    (tmp_path / "a.py").write_text('"""Why?\n====\n"""\n# Picture: a bar.\n', encoding="utf-8")
    (tmp_path / "scripts" / "a.rst").write_text(PAGE, encoding="utf-8")
    return tmp_path


def test_a_page_loses_the_notes_and_says_how_to_run_its_script(gallery: Path) -> None:
    source = [PAGE]
    tidy(SimpleNamespace(), "scripts/a", source)  # type: ignore[arg-type]
    assert "sphx_glr_download" not in source[0]
    assert "zip" not in source[0]
    assert "Below.\n" in source[0]
    assert ":download:`download the script <a.py>`" in source[0]
    other = [PAGE]
    tidy(SimpleNamespace(), "a", other)  # type: ignore[arg-type]
    assert other == [PAGE]


def test_the_answer_is_the_last_line_printed(gallery: Path) -> None:
    assert (outcome("a").question, outcome("a").answer, outcome("a").alt) == ("Why?", "It is 3 mm", "A bar.")
    (gallery / "scripts" / "a.rst").write_text("Why?\n====\n", encoding="utf-8")
    assert outcome("a").answer == ""


def test_a_picture_moves_into_the_page_with_its_text(gallery: Path) -> None:
    block: dict[str, Any] = {
        "src_file": str(gallery / "a.py"),
        "image_path_iterator": SimpleNamespace(next=lambda: str(gallery / "scripts" / "a_001.png")),
    }
    assert picture(None, block, {}) == ""
    (gallery / "a.png").write_bytes(b"png")
    assert ".. image:: /scripts/a_001.png\n   :alt: A bar.\n" in picture(None, block, {})
    assert (gallery / "scripts" / "a_001.png").read_bytes() == b"png"
    assert not (gallery / "a.png").exists()
