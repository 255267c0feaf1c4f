"""Standard streams that are closed or full, empty names, and words from files that would steer a terminal."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from cli_runs import ROOT, Command, environment, tree

from robots import InputError, InputErrors
from stiffarm.session import console
from stiffarm.session.json_text import json_text

SIMULATE = ("simulate", "xr701", "--pose", "q2_deg=5,q3real_deg=77.5", "--load", "fz_N=-100")
HOSTILE = "\x1b]0;owned\x07\x1b[2J\nfake: all is well\r"


def closed(*numbers: int) -> Callable[[], None]:
    return lambda: [os.close(number) for number in numbers] and None


def run(*arguments: str, closing: tuple[int, ...] = (), **streams: object) -> subprocess.CompletedProcess[str]:
    """A command in a process of its own, some of whose streams are closed before it begins."""
    return subprocess.run(  # type: ignore[call-overload, no-any-return] # noqa: S603 - our own interpreter
        [sys.executable, "-m", "stiffarm", *arguments],
        env=environment(),
        preexec_fn=closed(*closing),
        encoding="utf-8",
        timeout=120,
        check=False,
        **({"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | streams),
    )


pytestmark = pytest.mark.skipif(os.name != "posix", reason="streams are closed as POSIX has it")


@pytest.mark.slow
def test_an_answer_that_nobody_would_get_is_not_worked_out() -> None:
    outcome = run(*SIMULATE, "--json", closing=(1,))
    assert (outcome.returncode, outcome.stdout) == (2, "")
    assert outcome.stderr.startswith("stiffarm: stdout is closed")
    assert outcome.stderr.count("\n") == 1


@pytest.mark.slow
def test_serve_needs_both_its_streams() -> None:
    for number, name in ((0, "stdin"), (1, "stdout")):
        outcome = run("serve", "xr701", closing=(number,))
        assert outcome.returncode == 2
        assert f"{name} closed: requests come from stdin" in outcome.stderr


@pytest.mark.slow
def test_a_closed_stderr_takes_nothing_from_results(tmp_path: Path) -> None:
    """A result file would get its number, and what a library prints would end up in it."""
    whole = run(*SIMULATE, "--json", "--out", str(tmp_path / "a"))
    deaf = run(*SIMULATE, "--json", "--out", str(tmp_path / "b"), closing=(0, 2))
    assert (deaf.returncode, deaf.stdout) == (0, whole.stdout)
    files = [(tmp_path / folder / "simulation.json").read_bytes() for folder in "ab"]
    assert files[0] == files[1]
    assert run("simulate", "nonesuch", closing=(0, 1, 2)).returncode == 2


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
@pytest.mark.parametrize("arguments", [("--help",), ("--version",), (*SIMULATE, "--json")])
def test_a_full_stdout_is_one_line(arguments: tuple[str, ...]) -> None:
    with Path("/dev/full").open("w") as full:
        outcome = run(*arguments, stdout=full)
        assert outcome.returncode == 1
        assert outcome.stderr.startswith("stiffarm: the system refused: [Errno 28]")
        assert outcome.stderr.count("\n") == 1


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_full_stderr_costs_neither_results_nor_exit_code() -> None:
    with Path("/dev/full").open("w") as full:
        assert run("simulate", "nonesuch", stderr=full).returncode == 2
        outcome = run(*SIMULATE, "--json", stderr=full)
        assert outcome.returncode == 0
        assert outcome.stdout.startswith("{")


@pytest.mark.parametrize(("arguments", "place"), [(("--out", ""), "after --out"), (("--out=",), "--out="), (("",), "")])
def test_an_empty_name_is_not_the_folder_one_is_in(
    arguments: tuple[str, ...], place: str, cli: Command, tmp_path: Path
) -> None:
    outcome = cli(*SIMULATE, *arguments)
    assert outcome.code == 2
    assert place in outcome.err
    assert "is empty" in outcome.err
    assert tree(tmp_path) == {}


def test_wrong_options_are_repeated_as_text_only(cli: Command) -> None:
    for arguments in (
        (f"--{HOSTILE}",),
        (f"sim{HOSTILE}",),
        (*SIMULATE, "--seed", HOSTILE),
        (*SIMULATE, f"--x{HOSTILE}"),
    ):
        outcome = cli(*arguments)
        assert outcome.code == 2
        assert "\x1b]" not in outcome.err
        assert "\nfake" not in outcome.err
        assert "Error" in outcome.err


def test_titles_labels_and_notes_cannot_steer_the_terminal(cli: Command, tmp_path: Path) -> None:
    model = (ROOT / "robots" / "data" / "xr701.toml").read_text(encoding="utf-8")
    escaped = HOSTILE.encode("unicode_escape").decode().replace("\\x", "\\u00")
    model = model.replace('title = "', f'title = "{escaped}', 1).replace("notes = [", f'notes = ["{escaped}", ', 1)
    (tmp_path / "arm.toml").write_text(model, encoding="utf-8")
    table = f'pose,{HOSTILE[:5]},q2_deg,q3real_deg,fz_N,dz_mm\n"A{HOSTILE}",x,5,77.5,-650,-1.88\n'
    (tmp_path / "data.csv").write_text(table, encoding="utf-8", newline="")
    for arguments in (
        ("robots", "arm.toml"),
        ("simulate", "arm.toml", "data.csv"),
        ("simulate", "arm.toml", "da\x1b[2Jta.csv"),
    ):
        outcome = cli(*arguments)
        assert "\x1b" not in outcome.err, arguments
        assert "\nfake" not in outcome.err
        assert "\r" not in outcome.err
        assert r"\x1b" in outcome.err


def test_each_fault_has_a_line_of_its_own(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ValueError, match="two") as caught:
        raise InputErrors("two", [InputError("a\nb", code="X004"), InputError("c", code="X004")])
    console.say_error(caught.value)  # type: ignore[arg-type]
    assert capsys.readouterr().err == "stiffarm: two: 2 problem(s)\n  - a\\nb\n  - c\n"


def test_results_that_are_no_numbers_are_named() -> None:
    content = {"a": 1.0, "springs": [{"k": 1e6}, {"k": float("inf")}], "rms": float("nan")}
    with pytest.raises(InputError, match=r"no finite numbers: springs\[1\]\.k, rms\. To fix it"):
        json_text(content)
    assert json_text({"a": [1.5, None]}) == '{\n  "a": [\n    1.5,\n    null\n  ]\n}\n'
