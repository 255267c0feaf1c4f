"""Output folders are written whole or not at all, whatever stops a command; and what a user then reads."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from cli_runs import Command, environment, heed_ctrl_c, run_here, start, tree
from small_robot import write_readings, write_urdf

from robots import InputError
from robots.files.reading import read_bytes, recording
from stiffarm.commands.calibrate import step
from stiffarm.session import console, interruption, outputs
from stiffarm.session.outputs import OutputFolder

# Long enough for a busy machine, short enough to notice a process that hangs.
PATIENCE_S = 240.0


def folder(target: Path) -> OutputFolder:
    return OutputFolder(target, ["stiffarm", "test"], {"text": "abc"}, 0)


# --- the folder by itself ----------------------------------------------------------------------------------


def test_nothing_is_in_place_before_everything_is(tmp_path: Path) -> None:
    target = tmp_path / "a" / "b"
    with folder(target) as out:
        out.write_text("one.txt", "1")
        out.write_text("sub/two.txt", "2")
        # On the same file system, so that moving is renaming; beside a new folder, which it then becomes.
        assert list(target.iterdir()) == []
        stage = next(p for p in target.parent.iterdir() if p != target)
        assert stage.name.startswith(".partial-b-")
        assert set(tree(stage)) == {"one.txt", "sub", "sub/two.txt"}
    assert set(tree(target)) == {"one.txt", "sub", "sub/two.txt", "run.json"}


def test_files_are_renamed_from_the_hidden_folder(tmp_path: Path) -> None:
    with folder(tmp_path) as out:
        out.write_text("one.txt", "1")
        written = out.path("one.txt").stat().st_ino
    assert (tmp_path / "one.txt").stat().st_ino == written, "copied, so a crash could leave half a file"


def test_run_json_says_what_was_run(tmp_path: Path) -> None:
    (tmp_path / "data").write_text("x", encoding="utf-8")
    inputs: dict[str, Path | str] = {"a": "0" * 64, "b": tmp_path / "data"}
    with OutputFolder(tmp_path / "out", ["stiffarm", "fit"], inputs, 7) as out, out.timed("nap"):
        time.sleep(0.01)
    run = json.loads((tmp_path / "out" / "run.json").read_text(encoding="utf-8"))
    # SHA-256 of the single letter x.
    assert run["inputs_sha256"]["b"] == "2d711642b726b04401627ca9fbac32f5c8530fb1903cc4db02258717921a4881"
    assert run["inputs_sha256"]["a"] == "0" * 64
    assert (run["command"], run["seed"]) == (["stiffarm", "fit"], 7)
    assert 0.01 <= run["timings_s"]["nap"] <= run["timings_s"]["total"]
    assert run["finished_utc"].endswith("+00:00")


@pytest.mark.parametrize("existed", [True, False])
def test_run_json_lists_the_results_with_their_hashes(tmp_path: Path, existed: bool) -> None:
    target = tmp_path / "out"
    if existed:
        with folder(target) as out:
            out.write_text("one.txt", "old")
    with folder(target) as out:
        out.write_text("one.txt", "1")
        out.write_text("sub/two.txt", "2")
    listed = json.loads((target / "run.json").read_text(encoding="utf-8"))["outputs_sha256"]
    lying = {name: sha256 for name, sha256 in tree(target).items() if not name.startswith("previous")}
    assert listed == {name: lying[name] for name in ("one.txt", "sub/two.txt")}


def test_a_link_that_leads_nowhere_is_kept(tmp_path: Path) -> None:
    (tmp_path / "one.txt").symlink_to("nowhere")
    with folder(tmp_path) as out:
        out.write_text("one.txt", "1")
    assert not (tmp_path / "one.txt").is_symlink()
    (kept,) = (tmp_path / "previous").iterdir()
    assert os.readlink(kept / "one.txt") == "nowhere"


def test_a_package_that_is_not_installed_does_not_spoil_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(outputs, "_PACKAGES", ("numpy", "no-such-package"))
    with folder(tmp_path):
        pass
    assert json.loads((tmp_path / "run.json").read_text(encoding="utf-8"))["versions"]["no-such-package"] == "unknown"


def test_each_earlier_run_is_kept(tmp_path: Path) -> None:
    for text in "abc":  # within one second, so the times alone would clash
        with folder(tmp_path) as out:
            out.write_text("one.txt", text)
    kept = [p.read_text(encoding="utf-8") for p in sorted((tmp_path / "previous").glob("*/one.txt"))]
    assert sorted(kept) == ["a", "b"]
    assert (tmp_path / "one.txt").read_text(encoding="utf-8") == "c"


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
@pytest.mark.parametrize("existed", [True, False])
def test_an_error_inside_leaves_everything_as_it_was(tmp_path: Path, error: type[BaseException], existed: bool) -> None:
    target = tmp_path / "a" / "b"
    if existed:
        target.mkdir(parents=True)
        (target / "one.txt").write_text("old", encoding="utf-8")
    before = tree(tmp_path)
    with pytest.raises(error), folder(target) as out:  # noqa: PT012 - the folder is what is tested
        out.write_text("one.txt", "new")
        raise error
    assert tree(tmp_path) == before


def earlier_results(target: Path) -> dict[str, str]:
    for name in ("a.txt", "b.txt", "z.txt"):
        (target / name).write_text(f"old {name}", encoding="utf-8")
    (target / "figures").write_text("a file where a folder belongs", encoding="utf-8")
    return tree(target)


def new_results(out: OutputFolder, *more: str) -> None:
    for name in ("a.txt", "b.txt", "fresh/c.txt", "z.txt", *more):
        out.write_text(name, f"new {name}")


def test_something_in_the_way_of_a_result_undoes_what_was_moved(tmp_path: Path) -> None:
    before = earlier_results(tmp_path)
    with pytest.raises(InputError, match="cannot take the results"), folder(tmp_path) as out:
        new_results(out, "figures/d.png")
    assert tree(tmp_path) == before


@pytest.mark.parametrize("moves_done", range(6))
@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(errno.ENOSPC, "No space left on device")])
def test_a_move_that_fails_undoes_the_ones_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, moves_done: int, error: BaseException
) -> None:
    earlier_results(tmp_path)
    (tmp_path / "run.json").write_text("old", encoding="utf-8")
    before = tree(tmp_path)
    left = [moves_done]
    replace = os.replace

    def failing(source: Path, place: Path) -> None:
        left[0] -= 1
        if left[0] == -1:  # once: putting things back works again
            raise error
        replace(source, place)

    monkeypatch.setattr(os, "replace", failing)
    with pytest.raises((KeyboardInterrupt, InputError)), folder(tmp_path) as out:
        new_results(out)
    assert left[0] < 0, "the failing move was never reached"
    assert tree(tmp_path) == before


@pytest.mark.parametrize("place", ["file", "file/below", "x" * 300])
def test_a_folder_that_cannot_be_made_is_bad_input(tmp_path: Path, place: str) -> None:
    (tmp_path / "file").write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match="cannot be written"), folder(tmp_path / place):
        pytest.fail("it was entered")
    assert set(tree(tmp_path)) == {"file"}


# --- what a user reads when things go wrong ----------------------------------------------------------------


def broken(*_: object, **__: object) -> None:
    raise ZeroDivisionError("by zero")


def test_an_internal_error_is_one_line_without_a_traceback(
    cli: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(step, "run_campaign", broken)
    outcome = cli("calibrate", "xr701", "--scheme", "staged", "--out", "deep/out")
    assert (outcome.code, outcome.out) == (1, "")
    assert "internal error: ZeroDivisionError: by zero" in outcome.err
    assert "--debug" in outcome.err
    assert "Traceback" not in outcome.err
    assert tree(tmp_path) == {}


def test_debug_lets_the_traceback_through(cli: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(step, "run_campaign", broken)
    with pytest.raises(ZeroDivisionError):
        cli("calibrate", "xr701", "--scheme", "staged", "--debug")


@pytest.mark.slow
def test_a_full_disk_is_no_internal_error(cli: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", "calibration.json")

    monkeypatch.setattr(OutputFolder, "write_text", full)
    outcome = cli("calibrate", "xr701", "--scheme", "staged", "--out", "out")
    assert outcome.code == 1
    assert "No space left on device" in outcome.err
    assert "check free space" in outcome.err
    assert "internal error" not in outcome.err
    assert tree(tmp_path) == {}


def test_nan_never_becomes_json() -> None:
    with pytest.raises(ValueError, match="no finite numbers: stiffness_N_per_mm"):
        console.emit_json({"stiffness_N_per_mm": float("nan")})


# --- Ctrl-C ------------------------------------------------------------------------------------------------


def wait_for(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end, "it never came"
        time.sleep(0.005)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "stage"),
    [
        (signal.SIGINT, "diagnosis"),
        pytest.param(signal.SIGTERM, "recommended", marks=pytest.mark.slow),
        pytest.param(signal.SIGINT, "pictures", marks=pytest.mark.slow),
    ],
)
def test_a_run_that_is_stopped_leaves_the_earlier_results(tmp_path: Path, number: signal.Signals, stage: str) -> None:
    """While VTK draws, a KeyboardInterrupt would be printed and forgotten, or crash it."""
    urdf = write_urdf(tmp_path / "small.urdf")
    given = urdf, write_readings(urdf, tmp_path / "readings.csv", poses=3)
    target = tmp_path / "out"
    target.mkdir()
    for name in ("model.toml", "report.html"):
        (target / name).write_text("of an earlier run", encoding="utf-8")
    before = tree(tmp_path)
    process = start(("run", *given, "--points", "2", "--out", target))
    assert process.stderr is not None
    if stage != "pictures":
        while stage not in process.stderr.readline():
            assert process.poll() is None
    else:
        wait_for(lambda: any(target.glob(".partial-*/stiffness_map.vtu")) or process.poll() is not None)
        assert process.poll() is None
        time.sleep(0.3)  # into the drawing, which takes a second or more
    assert any(target.glob(".partial-*"))
    process.send_signal(number)
    out, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 128 + number
    assert out == ""
    assert err.splitlines()[-1] == "stiffarm: stopped by the user; no half-written files are left"
    assert "Traceback" not in err
    assert "KeyboardInterrupt" not in err
    assert tree(tmp_path) == before


def test_ctrl_c_while_the_libraries_load(tmp_path: Path) -> None:
    """A stand-in for a library that takes long to load makes sure that this is where it stands."""
    (tmp_path / "typer.py").write_text("print('loading', flush=True)\nimport time\ntime.sleep(60)\n", encoding="utf-8")
    env = environment()
    process = start(("robots",), env=env | {"PYTHONPATH": os.pathsep.join([str(tmp_path), env["PYTHONPATH"]])})
    assert process.stdout is not None
    assert process.stdout.readline() == "loading\n"
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, err) == (130, "stiffarm: stopped by the user; no half-written files are left\n")


def test_ctrl_c_while_results_move_into_place_waits_until_they_have(tmp_path: Path) -> None:
    code = """
import os, signal, sys
from pathlib import Path
from stiffarm.session.interruption import stoppable
from stiffarm.session.outputs import OutputFolder
replace = os.replace
def interrupted(source, place):
    os.kill(os.getpid(), signal.SIGINT)
    replace(source, place)
os.replace = interrupted
Path(sys.argv[1]).mkdir()
with stoppable(), OutputFolder(Path(sys.argv[1]), [], {}, None) as out:
    out.write_text("a.txt", "a")
    out.write_text("b.txt", "b")
print("not reached")
"""
    process = subprocess.run(  # noqa: S603 - our own interpreter with a constant argument
        [sys.executable, "-c", code, str(tmp_path / "out")],
        env=environment(),
        preexec_fn=heed_ctrl_c,
        capture_output=True,
        encoding="utf-8",
        timeout=PATIENCE_S,
        check=False,
    )
    assert (process.returncode, process.stdout) == (130, "")
    assert process.stderr == "stiffarm: stopped by the user; no half-written files are left\n"
    assert set(tree(tmp_path / "out")) == {"a.txt", "b.txt", "run.json"}


def test_ctrl_c_takes_drafts_of_files_away(tmp_path: Path) -> None:
    code = """
import os, signal, sys
from pathlib import Path
from stiffarm.session.interruption import heed_for_life
heed_for_life()
from robots.files.written import written_whole
with written_whole(Path(sys.argv[1])) as draft:
    draft.write_text("half")
    assert len(list(draft.parent.iterdir())) == 1
    os.kill(os.getpid(), signal.SIGINT)
print("not reached")
"""
    process = subprocess.run(  # noqa: S603 - our own interpreter with a constant argument
        [sys.executable, "-c", code, str(tmp_path / "a.txt")],
        env=environment(),
        preexec_fn=heed_ctrl_c,
        capture_output=True,
        encoding="utf-8",
        timeout=PATIENCE_S,
        check=False,
    )
    assert (process.returncode, process.stdout) == (130, "")
    assert process.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("module", ["typer", "numpy", "stiffarm.commands.calibrate.command"])
def test_ctrl_c_in_an_import_is_not_swallowed(tmp_path: Path, module: str) -> None:
    """Modules that catch whatever their own imports raise once swallowed it, and typer made it a silent exit."""
    code = f"""
import importlib.abc, os, signal, sys
class Finder(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == {module!r}:
            try:
                os.kill(os.getpid(), signal.SIGINT)
                for _ in range(1000):
                    pass
            except BaseException:
                pass
        return None
sys.meta_path.insert(0, Finder())
sys.argv = ["stiffarm", "calibrate", "xr701"]
from stiffarm.__main__ import main
main()
"""
    process = subprocess.run(  # noqa: S603 - our own interpreter with a constant argument
        [sys.executable, "-c", code],
        env=environment(),
        preexec_fn=heed_ctrl_c,
        capture_output=True,
        encoding="utf-8",
        timeout=PATIENCE_S,
        check=False,
    )
    assert (process.returncode, process.stdout) == (130, "")
    assert process.stderr == "stiffarm: stopped by the user; no half-written files are left\n"


def test_the_package_itself_imports_nothing_before_ctrl_c_is_heeded() -> None:
    code = "import sys; before = set(sys.modules); import stiffarm; print(sorted(set(sys.modules) - before))"
    process = subprocess.run(  # noqa: S603 - our own interpreter with a constant argument
        [sys.executable, "-c", code], env=environment(), capture_output=True, encoding="utf-8", check=True
    )
    assert process.stdout == "['stiffarm']\n"


def test_who_ignores_ctrl_c_keeps_ignoring_it() -> None:
    """As `nohup` and shells do for commands in the background."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with interruption.stoppable():
            assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


def test_the_handlers_are_gone_afterwards() -> None:
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    with interruption.stoppable():
        assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] != before
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before


@pytest.mark.slow
def test_two_runs_at_once_into_one_folder(tmp_path: Path) -> None:
    """Each is whole; the later one has moved the earlier one to previous/."""
    target = tmp_path / "out"
    command = ("calibrate", "xr701", "--scheme", "global", "--out", target)
    processes = [start(command) for _ in range(2)]
    assert [p.communicate(timeout=PATIENCE_S) and p.returncode for p in processes] == [0, 0]
    assert run_here(*command).code == 0
    folders = [target, *(target / "previous").iterdir()]
    assert not list(target.glob(".partial-*"))
    # Two that finish in the same instant may leave one of the two in previous/, never half of one.
    kept = [f for f in folders if (f / "model.toml").is_file()]
    assert len(kept) >= 2
    assert len({(f / "model.toml").read_bytes() for f in kept}) == 1


def test_a_backed_up_model_keeps_the_meshes_it_refers_to(tmp_path: Path) -> None:
    model = '[[link]]\nname = "arm"\n[link.surface]\nfile = "meshes/{0}.npz"\n[[link]]\nname = "beam"\n'
    for text in ("first", "second", "third"):
        with folder(tmp_path) as out:
            out.write_text("model.toml", model.format(text))
            out.write_text(f"meshes/{text}.npz", text)
    kept = sorted((tmp_path / "previous").iterdir())
    assert len(kept) == 2
    found = set()
    for backup in kept:
        (mesh,) = (backup / "meshes").iterdir()
        assert f"meshes/{mesh.name}" in (backup / "model.toml").read_text(encoding="utf-8")
        found.add(mesh.read_text(encoding="utf-8"))
    assert found == {"first", "second"}
    # A mesh of the same name that the new run writes anew: the backup has the old one.
    with folder(tmp_path) as out:
        out.write_text("model.toml", model.format("third"))
        out.write_text("meshes/third.npz", "third again")
    (latest,) = set((tmp_path / "previous").iterdir()) - set(kept)
    assert (latest / "meshes" / "third.npz").read_text(encoding="utf-8") == "third"


@pytest.mark.parametrize("file", ["../secret.npz", "/etc/hostname", "lost.npz"])
def test_a_backup_takes_no_files_from_elsewhere(file: str, tmp_path: Path) -> None:
    target = tmp_path / "out"
    target.mkdir()
    (tmp_path / "secret.npz").touch()
    (target / "model.toml").write_text(f'[[link]]\n[link.surface]\nfile = "{file}"\n', encoding="utf-8")
    (target / "plan.toml").write_text("link = 3", encoding="utf-8")
    with folder(target) as out:
        out.write_text("model.toml", "")
        out.write_text("plan.toml", "not toml [")
    (backup,) = (target / "previous").iterdir()
    assert set(tree(backup)) == {"model.toml", "plan.toml"}


def test_a_failure_takes_the_copies_for_the_backup_away_again(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "old.npz").touch()
    (tmp_path / "model.toml").write_text('[[link]]\n[link.surface]\nfile = "meshes/old.npz"\n', encoding="utf-8")
    (tmp_path / "z").write_text("a file where a folder belongs", encoding="utf-8")
    before = tree(tmp_path)
    with pytest.raises(InputError, match="cannot take the results"), folder(tmp_path) as out:  # noqa: PT012
        out.write_text("model.toml", "")
        out.write_text("z/picture.png", "")
    assert tree(tmp_path) == before


def test_inputs_are_recorded_as_they_were_read(tmp_path: Path) -> None:
    """A file that changes during the run is recorded as read; one that is gone at the end takes no results with it."""
    changed, gone = tmp_path / "changed.toml", tmp_path / "gone.csv"
    for file in (changed, gone):
        file.write_bytes(b"as read")
    expected = hashlib.sha256(b"as read").hexdigest()
    with recording(), OutputFolder(tmp_path / "out", ["stiffarm"], {"model": changed, "data": gone}, None) as folder:
        for file in (changed, gone):
            read_bytes(file, "input")
        changed.write_bytes(b"changed")
        gone.unlink()
        folder.write_text("result.txt", "kept")
    run = json.loads((tmp_path / "out" / "run.json").read_text(encoding="utf-8"))
    assert run["inputs_sha256"] == {"model": expected, "data": expected}
    assert run["files_read_sha256"] == {str(changed): expected, str(gone): expected}
    assert (tmp_path / "out" / "result.txt").read_text(encoding="utf-8") == "kept"
