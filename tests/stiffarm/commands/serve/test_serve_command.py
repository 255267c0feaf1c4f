"""`stiffarm serve` as a process: what it prints where, how it ends, its documentation, and clients in Tcl and C++."""

from __future__ import annotations

import json
import math
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import oracles
import pytest
import serve_speed
from cli_runs import ROOT, environment, heed_ctrl_c, run_here

from stiffarm.commands.serve.command import open_session
from stiffarm.failures import catalogue
from stiffarm.path_request import FramesRequest
from stiffarm.session.inputs import read_model

EXAMPLES = ROOT / "docs" / "examples" / "serve"
CELL = EXAMPLES / "cell.toml"
# What a new version or a recalibrated model changes, and what no reader of an example needs to repeat.
CHANGING = ("version", "model_hash")


def start(*arguments: str | Path) -> subprocess.Popen[bytes]:
    return subprocess.Popen(  # noqa: S603 - our own interpreter
        [sys.executable, "-m", "stiffarm", "serve", *map(str, arguments)],
        env=environment(OMP_NUM_THREADS="1"),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        preexec_fn=heed_ctrl_c,
    )


@pytest.mark.slow
def test_a_conversation() -> None:
    """Answers go out at once, faults do not end it, the end of input does; stdout holds nothing but answers."""
    process = start("kr60-3", "--tool", "0,0,200", "--links", "rigid", "--line-limit", "1")
    assert process.stdin is not None
    assert process.stdout is not None
    for i in range(3):
        process.stdin.write(f'{{"id": {i}, "do": "ping"}}\n'.encode())
        process.stdin.flush()
        assert json.loads(process.stdout.readline()) == {"id": i, "ok": True}
    long = b'{"id": 1, "do": "ping", "x": "' + b"y" * (1 << 20) + b'"}\n'
    out, err = process.communicate(b'nonsense\n\xff\n{"do": "fk"}\n' + long + b'{"do": "set"}', timeout=300)
    answers = [json.loads(line) for line in out.splitlines()]
    assert [a["ok"] for a in answers] == [False, False, False, False, True]
    assert "too long" in answers[3]["error"]["value"]
    assert {a["error"]["code"] for a in answers[:4]} <= set(catalogue())
    assert answers[4]["tool_mm_deg"] == [0, 0, 200, 0, 0, 0]
    assert process.returncode == 0
    assert "is ready" in err.decode()
    assert "Traceback" not in err.decode()


@pytest.mark.slow
def test_ctrl_c_ends_it_quietly() -> None:
    process = start("kr60-3", "--links", "rigid")
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(b'{"id": 1, "do": "ping"}\n')
    process.stdin.flush()
    process.stdout.readline()
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert out == b""
    assert "Traceback" not in err.decode()
    assert "stopped by the user" in err.decode()


@pytest.mark.slow
def test_a_reader_that_goes_away_ends_it() -> None:
    process = start("kr60-3", "--links", "rigid")
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdout.close()
    process.stdin.write(b'{"do": "ping"}\n' * 10)
    process.stdin.close()
    assert process.wait(timeout=60) == 1
    assert process.stderr is not None
    assert b"Traceback" not in process.stderr.read()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("kr61",), "kr60-3"),
        (("kr60-3", "--tool", "1,2"), "--tool"),
        (("kr60-3", "--cell", str(CELL), "--part", "0,0,0"), "--part with --cell"),
    ],
)
def test_bad_options_end_it_before_it_answers(arguments: tuple[str, ...], words: str) -> None:
    outcome = run_here("serve", *arguments)
    assert outcome.code == 2
    assert outcome.out == ""
    assert words in outcome.err


def same(given: Any, wanted: Any) -> bool:
    """Equal, but for the last digits of numbers and what changes with every version."""
    if isinstance(wanted, dict):
        keys = set(wanted) - set(CHANGING)
        return (
            isinstance(given, dict)
            and set(given) - set(CHANGING) == keys
            and all(same(given[k], wanted[k]) for k in keys)
        )
    if isinstance(wanted, list):
        return isinstance(given, list) and len(given) == len(wanted) and all(map(same, given, wanted))
    if isinstance(wanted, float) and isinstance(given, float):
        # Angles that a search refined are found to 1e-5 rad.
        return math.isclose(given, wanted, rel_tol=1e-5, abs_tol=2e-3 if abs(wanted) > 1e-3 else 1e-6)
    return bool(given == wanted)


@pytest.mark.slow
def test_the_documentation_says_what_is_answered() -> None:
    """Every example of docs/reference/serve.md, word for word (`serve_speed.py --docs` writes them anew)."""
    examples = serve_speed.documented((ROOT / "docs" / "reference" / "serve.md").read_text(encoding="utf-8"))
    requests = [json.loads(request) for request, _ in examples]
    given = read_model("kr60-3", None, None)
    setup = FramesRequest(cell=CELL).setup(given)
    session = open_session(given, setup)
    answers = [json.loads(session.answer(request.encode())) for request, _ in examples]
    assert len(answers) > 15
    assert session.stopped
    for answer, (request, wanted) in zip(answers, examples, strict=True):
        assert wanted is not None, request
        assert same(answer, json.loads(wanted)), request
    said = {command for answer in answers for command in answer.get("commands", ())}
    assert said == {request["do"] for request in requests}


@pytest.fixture(scope="module")
def service_command(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """The command that clients start, in a folder with a space in its name."""
    folder = tmp_path_factory.mktemp("a folder")
    cell = folder / "my cell.toml"
    shutil.copy(CELL, cell)
    return [sys.executable, "-m", "stiffarm", "serve", "kr60-3", "--cell", str(cell)]


def run_client(command: list[str]) -> str:
    result = subprocess.run(  # noqa: S603 - the client of the documentation
        command, env=environment(OMP_NUM_THREADS="1"), capture_output=True, encoding="utf-8", timeout=300, check=False
    )
    assert result.returncode == 0, result.stderr
    return result.stdout


def check_printed(out: str) -> None:
    """What the README shows, and the refusal at the end."""
    readme = (EXAMPLES / "README.md").read_text(encoding="utf-8")
    wanted = readme.split("same figures:\n\n```\n")[1].split("```")[0].split()
    given = [line for line in out.splitlines() if line.startswith(("gamma", "x "))]
    words = "\n".join(given).split()
    assert len(words) == len(wanted)
    for a, b in zip(words, wanted, strict=True):
        try:
            number = float(b)
        except ValueError:
            assert a == b
        else:
            assert float(a) == pytest.approx(number, rel=1e-3, abs=2e-3)
    assert out.splitlines()[-1].startswith("refused: ")


@pytest.mark.slow
@oracles.needs("tclsh")
def test_the_client_in_tcl(service_command: list[str]) -> None:
    check_printed(run_client(["tclsh", str(EXAMPLES / "client.tcl"), *service_command]))


@pytest.mark.slow
@oracles.needs("g++")
def test_the_client_in_cpp(service_command: list[str], tmp_path: Path) -> None:
    program = tmp_path / "client"
    options = ["-std=c++17", "-Wall", "-Wextra", "-Werror", "-O1", "-o", str(program)]
    subprocess.run(["g++", *options, str(EXAMPLES / "client.cpp")], check=True, timeout=300)  # noqa: S603, S607
    check_printed(run_client([str(program), *service_command]))


@pytest.mark.slow
def test_answers_are_fast() -> None:
    """Ratios, not times, so that a busy machine is no failure."""
    with serve_speed.service() as client:
        found = {name: float(np.median(seconds)) for name, seconds in serve_speed.latencies(client, 200).items()}
    alone = serve_speed.process_a_point(runs=1)
    # A process a point is what a postprocessor would do without this: some 1000 times as long, measured.
    assert alone > 50.0 * found["stiffness, all indices"]
    # Parsing and the pipe are a small part of an answer.
    assert found["ping"] < 0.5 * found["ik, nearest"]


@pytest.mark.slow
@pytest.mark.oracle
def test_inverse_kinematics_beside_pinocchio() -> None:
    """A compiled loop in the asking process, one branch and no limits, is faster; by how much has a bound."""
    oracles.load("pinocchio")
    loop = serve_speed.pinocchio_loop(*serve_speed.flange_targets(200))
    assert loop is not None
    seconds, solved = loop
    assert solved == 1.0
    with serve_speed.service() as client:
        asked = serve_speed.latencies(client, 200)["ik, nearest"]
    # Measured: 33 times, most of it some 300 small numpy operations; a pipe and JSON alone are 2.
    assert np.median(asked) < 100.0 * np.median(seconds)
