"""Results appear in a folder together: killed at any moment, the folder is as before or is made whole."""

from __future__ import annotations

import json
import logging
import os
import shutil
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from refusals import refuses

from robots.files import published
from robots.files.published import JOURNAL, Stage, heal
from robots.files.reading import read_text
from robots.files.written import is_draft, sha256_of

# Whatever changes what a folder holds, or has it reach the disk.
CALLS = ("replace", "rename", "link", "mkdir", "unlink", "rmdir", "fsync")
NAMES = ("a.txt", "model.toml", "sub/deep/c.txt", "z.txt")
MODEL = '[[link]]\n[link.surface]\nfile = "meshes/old.npz"\n# '

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="kills are tried in a forked process")


def publish(target: Path, text: str, *, fresh: bool = False) -> None:
    """What a run does with its folder."""
    if fresh:
        target.mkdir()
    stage = Stage(target, fresh=fresh)
    try:
        for name in NAMES:
            (stage.path / name).parent.mkdir(parents=True, exist_ok=True)
            (stage.path / name).write_text(MODEL + text if name.endswith("toml") else text, encoding="utf-8")
        stage.settle()
        stage.publish({name: sha256_of(stage.path / name) for name in NAMES})
    finally:
        stage.close()


def filled(target: Path) -> Path:
    """A folder of an earlier run, with files of its user's in it: a link that leads nowhere under a result's name."""
    target.mkdir()
    for name in NAMES[:2]:
        (target / name).write_text(MODEL + "old" if name.endswith("toml") else "old", encoding="utf-8")
    (target / "z.txt").symlink_to("nowhere")
    (target / "meshes").mkdir()
    (target / "meshes" / "old.npz").write_text("old mesh", encoding="utf-8")
    (target / "mine.txt").write_text("mine", encoding="utf-8")
    return target


def told(folder: Path) -> dict[str, str]:
    """What each file and link holds; the times in names of backups left out."""
    out = {}
    for path in folder.rglob("*"):
        name = path.relative_to(folder).as_posix().split("/")
        if name[0] == "previous" and len(name) > 1:
            name[1] = "T"
        if path.is_symlink():
            out["/".join(name)] = f"-> {os.readlink(path)}"
        elif path.is_file():
            out["/".join(name)] = path.read_text(encoding="utf-8").removeprefix(MODEL)
    return out


def killed(step: int, action: Callable[[], None]) -> bool:
    """Do something in a process that is killed before its call number ``step``; whether it was."""
    child = os.fork()
    if child == 0:
        left = [step]

        def counted(function: Callable[..., Any]) -> Callable[..., Any]:
            def call(*args: Any, **options: Any) -> Any:
                if left[0] == 0:
                    os._exit(9)
                left[0] -= 1
                return function(*args, **options)

            return call

        try:
            for name in CALLS:
                setattr(os, name, counted(getattr(os, name)))
            action()
        finally:
            os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 9


BEFORE = {
    **dict.fromkeys(NAMES[:2], "old"),
    "z.txt": "-> nowhere",
    "meshes/old.npz": "old mesh",
    "mine.txt": "mine",
}
AFTER = {
    **dict.fromkeys(NAMES, "new"),
    "meshes/old.npz": "old mesh",
    "mine.txt": "mine",
    **{f"previous/T/{name}": text for name, text in BEFORE.items() if name != "mine.txt"},
}


@pytest.fixture(autouse=True)
def _quiet() -> Iterator[None]:
    logging.getLogger("stiffarm").setLevel(logging.ERROR)
    yield
    logging.getLogger("stiffarm").setLevel(logging.NOTSET)


@pytest.mark.slow
@pytest.mark.parametrize("stride", [4, pytest.param(1, marks=pytest.mark.slow)])
def test_a_kill_between_any_two_steps_leaves_the_old_or_what_heals_to_the_new(tmp_path: Path, stride: int) -> None:
    seen, step, more = set(), 0, True
    while more:
        target = filled(tmp_path / str(step))
        more = killed(step, lambda target=target: publish(target, "new"))  # type: ignore[misc]
        moving = (target / JOURNAL).exists()
        heal(target)
        Stage(target, fresh=False).close()  # removes what is left
        found = told(target)
        assert found in (BEFORE, AFTER), f"killed before call {step}"
        seen.add((found == AFTER, moving))
        assert found == AFTER or not moving
        shutil.rmtree(target)
        step += stride
    assert step > 25
    # Before the moves, in the middle of them, and after them.
    assert seen == {(False, False), (True, True), (True, False)}


@pytest.mark.slow
def test_a_kill_while_it_heals_is_healed_by_the_next(tmp_path: Path, halfway: Path) -> None:
    step, more = 0, True
    while more:
        target = tmp_path / str(step)
        shutil.copytree(halfway, target, symlinks=True)
        more = killed(step, lambda target=target: heal(target))  # type: ignore[misc]
        heal(target)
        Stage(target, fresh=False).close()
        assert told(target) == AFTER
        step += 1
    assert step > 10


@pytest.mark.slow
def test_a_new_folder_appears_in_one_rename(tmp_path: Path) -> None:
    step, more, seen = 0, True, set()
    while more:
        target = tmp_path / str(step)
        more = killed(step, lambda target=target: publish(target, "new", fresh=True))  # type: ignore[misc]
        found = told(target) if target.exists() else {}
        assert found in ({}, dict.fromkeys(NAMES, "new")), f"killed before call {step}"
        seen.add(bool(found))
        target.mkdir(exist_ok=True)
        Stage(target, fresh=False).close()
        assert [p.name for p in tmp_path.iterdir() if p.name.startswith(".")] == []
        step += 1
    assert seen == {False, True}


@cache
def _in_between(base: Path) -> int:
    """A step at which some results have moved and others have not."""
    for step in range(12, 40):
        target = filled(base / str(step))
        assert killed(step, lambda target=target: publish(target, "new"))  # type: ignore[misc]
        if (target / JOURNAL).exists() and (target / "a.txt").read_text(encoding="utf-8") == "new":
            return step
    pytest.fail("it was never in between")


@pytest.fixture
def halfway(tmp_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder whose run was killed when the first of its results had moved."""
    target = filled(tmp_path / "out")
    step = _in_between(tmp_path_factory.getbasetemp())
    assert killed(step, lambda: publish(target, "new"))
    assert (target / JOURNAL).exists()
    return target


def test_what_cannot_move_on_is_put_back(halfway: Path, caplog: pytest.LogCaptureFixture) -> None:
    target = halfway
    (target / "sub").write_text("in the way", encoding="utf-8")
    caplog.set_level(logging.WARNING, "stiffarm")
    heal(target)
    assert "back where they were" in caplog.text
    (target / "sub").unlink()
    Stage(target, fresh=False).close()
    assert told(target) == BEFORE


def test_who_reads_a_file_there_reads_one_run(halfway: Path) -> None:
    target = halfway
    assert (target / "a.txt").read_text(encoding="utf-8") == "new"
    assert (target / "model.toml").read_text(encoding="utf-8") == MODEL + "old"
    assert not (target / "sub").exists()
    # Results in folders below it are healed too.
    assert read_text(target / "sub/deep/c.txt", "file") == "new"
    assert read_text(target / "model.toml", "file") == MODEL + "new"
    assert not (target / JOURNAL).exists()


def test_results_lost_or_changed_before_healing_are_named(halfway: Path, caplog: pytest.LogCaptureFixture) -> None:
    target = halfway
    (stage,) = target.glob(".partial-*")
    (stage / "model.toml").unlink()
    (target / "a.txt").write_text("mine now", encoding="utf-8")
    caplog.set_level(logging.WARNING, "stiffarm")
    heal(target)
    assert "changed or lost since then: a.txt, model.toml" in caplog.text
    assert (target / "a.txt").read_text(encoding="utf-8") == "mine now"


GOOD = {"schema": published.FORM, "stage": ".partial-0", "backup": "previous/20260101-000000", "made": [], "sha256": {}}


@pytest.mark.parametrize(
    "journal",
    [
        "",
        "[]",
        "{}",
        "null",
        "[" * 100_000,
        "\udcff",
        GOOD | {"schema": "other"},
        GOOD | {"stage": ".partial-0/../.."},
        GOOD | {"stage": "precious"},
        GOOD | {"backup": "../elsewhere"},
        GOOD | {"backup": "previous/20260101-000000/../.."},
        GOOD | {"sha256": {"../precious.txt": "0"}},
        GOOD | {"sha256": {"/etc/passwd": "0"}},
        GOOD | {"sha256": {"a\0b": "0"}},
        GOOD | {"sha256": 3},
        GOOD | {"made": ["../precious"]},
    ],
)
def test_a_journal_of_somebody_else_moves_nothing(journal: object, tmp_path: Path) -> None:
    target = filled(tmp_path / "out")
    (tmp_path / "precious.txt").write_text("precious", encoding="utf-8")
    (tmp_path / "precious").mkdir()
    text = journal if isinstance(journal, str) else json.dumps(journal)
    (target / JOURNAL).write_text(text, encoding="utf-8", errors="surrogateescape")
    before = {str(p): p.is_file() for p in tmp_path.rglob("*")}
    refuses("F010", "cannot be followed", heal, target)
    assert {str(p): p.is_file() for p in tmp_path.rglob("*")} == before


@pytest.mark.parametrize("fresh", [True, False])
def test_leftovers_are_named_and_removed_and_living_runs_are_not(
    fresh: bool, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.WARNING, "stiffarm")
    target = tmp_path / "out"
    if not fresh:
        target.mkdir()

    def begin() -> None:
        target.mkdir(exist_ok=True)
        (Stage(target, fresh=fresh).path / "large").write_bytes(bytes(3_000_000))
        os._exit(9)

    assert killed(999, begin)
    (left,) = (p for p in tmp_path.rglob(".partial-*") if p.is_dir())
    (tmp_path / ".partial-other-0123456789ab").mkdir()  # of a run into another folder
    target.mkdir(exist_ok=True)
    living = Stage(target, fresh=False)
    assert not left.exists()
    assert f"removed what a killed run had left: {left} (3 MB)" in caplog.text
    caplog.clear()
    second = Stage(target, fresh=False)
    assert living.path.is_dir()
    assert caplog.text == ""
    for stage in (living, second):
        stage.close()
    assert not list(target.iterdir())
    assert {p.name for p in tmp_path.iterdir()} == {".partial-other-0123456789ab", "out"}


def test_a_new_folder_that_somebody_has_filled_meanwhile_keeps_both(tmp_path: Path) -> None:
    target = tmp_path / "out"
    target.mkdir()
    stage = Stage(target, fresh=True)
    (stage.path / "a.txt").write_text("new", encoding="utf-8")
    (target / "a.txt").write_text("old", encoding="utf-8")
    stage.publish({"a.txt": sha256_of(stage.path / "a.txt")})
    stage.close()
    assert told(target) == {"a.txt": "new", "previous/T/a.txt": "old"}
    assert not list(tmp_path.glob(".partial*"))


def test_a_folder_in_a_results_place_goes_to_the_backup(tmp_path: Path) -> None:
    target = tmp_path / "out"
    (target / "a.txt").mkdir(parents=True)
    (target / "a.txt" / "mine").write_text("mine", encoding="utf-8")
    publish(target, "new")
    assert told(target)["previous/T/a.txt/mine"] == "mine"
    assert told(target)["a.txt"] == "new"


def test_drafts_have_names_that_nothing_else_has() -> None:
    assert is_draft(".0123456789ab.tmp.arrays")
    assert is_draft(".0123456789ab.tmp")
    assert not is_draft("0123456789ab.tmp")
    assert not is_draft(".hidden.tmp")
