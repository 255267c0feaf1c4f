"""When the gallery's scripts run again, and where they leave what they write."""

from __future__ import annotations

from pathlib import Path

import gallery_runs
import pytest
from gallery_runs import STAMP, alternative_text, digest, forget_unless, lay_out, missing, tidy_up


def test_a_script_runs_again_only_where_what_it_is_made_of_changed(tmp_path: Path) -> None:
    done = tmp_path / "a.py.md5"
    forget_unless("one", tmp_path)
    done.touch()
    forget_unless("one", tmp_path)
    assert done.exists()
    forget_unless("two", tmp_path)
    assert not done.exists()
    assert (tmp_path / STAMP).read_text(encoding="utf-8") == "two"


def test_the_digest_follows_sources_and_libraries(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gallery_runs, "SOURCES", ("docs/examples/ur5",))
    before = digest()
    assert digest() == before
    monkeypatch.setattr(gallery_runs, "_version", lambda name: "0")
    assert digest() != before
    monkeypatch.undo()
    monkeypatch.setattr(gallery_runs, "SOURCES", ("docs/examples/ur10",))
    assert digest() != before


def test_what_scripts_wrote_goes_and_scripts_stay(tmp_path: Path) -> None:
    run_in, pages = tmp_path / "run", tmp_path / "pages"
    lay_out({"a.py": "a", "b.py": "b"}, run_in, pages)
    (pages / "b.rst").touch()
    (run_in / "programs").mkdir()
    (run_in / "map.vti").touch()
    tidy_up(run_in)
    lay_out({"a.py": "a"}, run_in, pages)
    assert sorted(file.name for file in run_in.iterdir()) == ["GALLERY_HEADER.rst", "a.py", "docs"]
    assert (run_in / "docs" / "conf.py").is_file()
    assert list(pages.iterdir()) == []


def test_alternative_text_is_one_line_and_must_be_there() -> None:
    assert alternative_text("x\n# Picture: two bars,\n# one red.\ny = 1  # not this\n") == "Two bars, one red."
    with pytest.raises(ValueError, match="Picture"):
        alternative_text("x = 1\n")


def test_what_a_script_needs_is_asked_of_the_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shutil.which", lambda name: None)
    assert missing("# Needs: a C compiler\n") == "a C compiler"
    assert missing("x = 1\n") == ""
