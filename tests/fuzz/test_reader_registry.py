"""Every place that opens a file is fuzzed: its kind is in the registry, and nothing opens files behind its back."""

from __future__ import annotations

import ast
import contextlib
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from .readers_solids import NETGEN
from .registry import readers, turn
from .samples import Sample
from .trial import PACKAGES, ROOT, attempt

# Kinds that are not data: the user's own effects are Python code, and xacro files macros with expressions in Python;
# whoever gives one runs it on purpose.
CODE = {"effect file", "xacro file"}
# Read by a library that is not here: the extra `solid`.
ABSENT = set() if NETGEN else {"STEP file"}
# Hashing what another reader has read.
HASHED = {"input file"}
# Who may open files by other means than robots.files.reading: place -> why.
ELSEWHERE = {
    "robots/files/reading.py _ordinary": "the one place",
    "robots/library/models.py load_description": "bundled with the package",
    "robots/library/models.py library_table": "bundled with the package",
    "doe/estimation/campaign.py bundled_campaign": "bundled with the package",
    "doe/tables/notes.py bundled_notes": "bundled with the package",
    "machining/programs/convention.py _bundled": "bundled with the package",
    "stiffarm/failures/__init__.py catalogue": "bundled with the package",
    "stiffarm/pages/parts.py": "bundled with the package",
    "stiffarm/pages/report.py data": "a picture just drawn",
    "stiffarm/pages/report.py is_scene": "a picture just drawn",
    "stiffarm/commands/identify/command.py _simulated": "readings just simulated",
    "stiffarm/commands/rehearse/step.py rehearsals": "readings just simulated",
    "stiffarm/pages/report.py _size": "a picture just drawn",
    "surrogate/portable/javascript.py evaluator_script": "bundled with the package",
    "stiffarm/pages/style.py": "bundled with the package, or a picture just drawn",
    "meshes/array_cache.py get": "fuzzed as `array cache`: what cannot be read is built again",
    "surrogate/maps/store.py": "fuzzed as `map work`",
    "meshes/apart.py run_apart": "what a process of its own has just written",
    "robots/urdf/xml.py _yourdfpy_robot": "from memory",
    "stiffarm/session/console.py": "the null device",
    "stiffarm/session/streams.py": "the null device, in the place of a closed stream",
    "robots/files/published.py _heal": "fuzzed as `journal of results`",
    "robots/files/published.py _files_named_in": "a model that makes room for a result, and its files",
    "robots/files/published.py _digest": "whether a result is the one that moved",
    "robots/files/published.py _locked": "folders, to lock them",
    "robots/files/written.py settle": "to wait for the disk",
    "robots/files/written.py sha256_of": "hashes results",
    "doe/tables/workbook.py read": "members of a workbook in memory",
    "doe/tables/workbook.py _refuse_document_type": "members of a workbook in memory",
    "machining/programs/run.py _save": "programs that were just written; fuzzed as `controller program`",
}
OPENERS = {
    "read_text",
    "read_bytes",
    "open",
    "load",
    "fromfile",
    "loadtxt",
    "genfromtxt",
    "memmap",
    "read_csv",
    "read_excel",
}


@cache
def calls() -> list[tuple[str, str, ast.Call]]:
    """Calls in the files of the packages that open anything: file, function around it, and the call."""
    found = []
    word = re.compile(rf"\b({'|'.join(sorted(OPENERS))})\(")
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            text = path.read_text(encoding="utf-8")
            # Parsing all of them would take most of the test's time.
            if word.search(text):
                name = path.relative_to(ROOT).as_posix()
                found += [(name, function, call) for function, call in inside(ast.parse(text), "")]
    return found


def inside(node: ast.AST, function: str) -> Iterator[tuple[str, ast.Call]]:
    for child in ast.iter_child_nodes(node):
        around = child.name if isinstance(child, ast.FunctionDef) else function
        if isinstance(child, ast.Call):
            yield function, child
        yield from inside(child, around)


def kinds() -> dict[str, str]:
    """Kinds that files are asked for by, and where; None is no literal."""
    out: dict[str, str] = {}
    for file, function, call in calls():
        name = call.func.id if isinstance(call.func, ast.Name) else ""
        if file == "robots/files/reading.py" or name not in ("read_bytes", "read_text"):
            continue
        given = [*call.args[1:2], *(k.value for k in call.keywords if k.arg == "kind")]
        kind = given[0].value if given and isinstance(given[0], ast.Constant) else None
        out[str(kind)] = f"{file} {function}"
    return out


def test_every_kind_of_file_that_is_read_is_attacked() -> None:
    known = {name.split(":")[0] for name in readers()}
    asked = kinds()
    assert len(asked) > 10
    missing = {kind: place for kind, place in asked.items() if kind not in known | CODE | HASHED | ABSENT}
    assert not missing, f"readers without a row in tests/fuzz/readers_*.py: {missing}"


def test_nothing_opens_files_behind_the_registry() -> None:
    found = set()
    for file, function, call in calls():
        f = call.func
        name = f.attr if isinstance(f, ast.Attribute) else f.id if isinstance(f, ast.Name) else ""
        if name not in OPENERS or (isinstance(f, ast.Name) and name != "open"):
            continue
        words = [a.value for a in [*call.args, *(k.value for k in call.keywords)] if isinstance(a, ast.Constant)]
        writes = any(isinstance(w, str) and w[:1] in ("w", "a", "x", "r+") for w in words) or "r+b" in words
        made = [getattr(a.func, "attr", "") for a in call.args if isinstance(a, ast.Call)]
        memory = bool({"BytesIO", "StringIO"} & set(made))
        if not writes and not memory and not ELSEWHERE.keys() & {file, f"{file} {function}"}:
            found.add(f"{file} {function}: {name}")
    assert not found


@pytest.mark.parametrize("name", sorted(readers()))
def test_every_reader_takes_its_seeds(name: str, tmp_path: Path) -> None:
    # Mutations of files that are refused anyway would try nothing.
    reader = readers()[name]
    assert reader.samples
    for sample in reader.samples:
        path = tmp_path / f"input{sample.suffix}"
        path.write_bytes(sample.data)
        reader.run(path)


def test_the_same_seed_draws_the_same_inputs() -> None:
    table = readers()
    first = [turn(table, 3, k) for k in range(60)]
    again = [turn(table, 3, k) for k in range(60)]
    assert first == again
    assert len({name for name, _ in first}) > 10
    assert first != [turn(table, 4, k) for k in range(60)]


def test_a_fault_of_each_kind_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import time
    import warnings

    from . import trial

    monkeypatch.setattr(trial, "SECONDS", 0.2)
    monkeypatch.setattr(trial, "WAITING_SECONDS", 0.4)

    def endless(_: Path) -> None:
        while True:
            with contextlib.suppress(Exception):  # as a reader that swallows whatever its parser raises
                sum(range(1000))

    def waiting(_: Path) -> None:
        while True:
            time.sleep(0.05)

    def warned(_: Path) -> None:
        np.array([1e308]) * 10.0

    def refused(_: Path) -> None:
        raise trial.InputError("x", code="X004")

    def deprecated(_: Path) -> None:
        warnings.warn("of a library", DeprecationWarning, stacklevel=1)

    def told(run: object) -> str:
        fault = attempt("r", run, Sample(".x", b""), tmp_path)  # type: ignore[arg-type]
        return "" if fault is None else fault.kind

    assert told(refused) == told(deprecated) == told(Path.read_bytes) == ""
    assert told(lambda _: {}["a"]) == "KeyError"
    assert told(lambda _: trial.require_finite({"a": [(1.0, np.array([np.nan]))]}, "result")) == "wrong answer"
    assert told(lambda _: trial.require_finite({"a": np.nan}, "result", frozenset({"a"}))) == ""
    assert told(warned) == "RuntimeWarning"
    assert told(endless) == told(waiting) == "too slow"
    assert told(lambda _: _refuse(trial, "a label \x1b[2J")) == "a message that steers the terminal"
    assert told(lambda _: _refuse(trial, "x" * 50_000)) == "endless message"


def _refuse(trial: Any, words: str) -> None:
    """An error whose words were not looked at when it was made."""
    error = trial.InputError("x", code="X004")
    error.args = (words,)
    raise error
