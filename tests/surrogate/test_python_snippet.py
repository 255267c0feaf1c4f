"""The Python file, run by an interpreter of its own without any packages, against what every form must answer."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from portable_cases import CASES, HOSTILE, check, portable, poses, reference

from surrogate.portable import Link, Portable, python_snippet
from surrogate.scope import Couplings

# Reads poses as hexadecimal numbers; -I -S: no site packages, no folder of ours on the path.
MAIN = """
import json, sys
sys.path.insert(0, sys.argv[1])
import surrogate_file as s
evaluate = s.evaluate_deg if len(sys.argv) > 2 else s.evaluate
out = []
for row in json.load(sys.stdin):
    q = [float.fromhex(v) for v in row]
    try:
        values = evaluate(q)
        flat = [v for line in values for v in line] if isinstance(values[0], list) else values
        out.append([s.OK, [v.hex() for v in flat]])
    except s.NoValue as error:
        out.append([error.status, []])
        if len(sys.argv) < 3 and s.check(q) != s.OK:
            assert s.check(q) == error.status
json.dump(out, sys.stdout)
"""


def answers(p: Portable, Q: np.ndarray, folder: Path, *options: str) -> tuple[np.ndarray, np.ndarray]:
    (folder / "surrogate_file.py").write_text(python_snippet(p), encoding="ascii")
    done = subprocess.run(  # noqa: S603 - our own interpreter and file
        [sys.executable, "-I", "-S", "-c", MAIN, str(folder), *options],
        input=json.dumps([[float(v).hex() for v in row] for row in Q]),
        capture_output=True,
        encoding="ascii",
        check=False,
    )
    assert done.returncode == 0, done.stderr
    rows = json.loads(done.stdout)
    values = [[float.fromhex(v) for v in row] or [np.nan] * p.n_values for _, row in rows]
    return np.array(values), np.array([status for status, _ in rows])


@pytest.mark.parametrize("case", CASES, ids=lambda c: f"{c[0]}-{len(c[1])}-{c[2]}")
def test_file_answers_as_the_surrogate(
    case: tuple[Link, tuple[str, ...], int], rng: np.random.Generator, tmp_path: Path
) -> None:
    p = portable(*case, rng)
    Q = poses(p, 200, rng)
    expected = reference(p, Q)
    assert {0, 1, 3} <= set(expected[1].tolist())
    check(p, expected, *answers(p, Q, tmp_path), rtol=1e-12)


def test_degrees(rng: np.random.Generator, tmp_path: Path) -> None:
    p = portable("identity", ("mixed", "polynomial"), 2, rng)
    Q = poses(p, 100, rng)
    # 1e-11: degrees that are turned into radians are rounded once more.
    check(p, reference(p, Q), *answers(p, np.degrees(Q), tmp_path, "deg"), rtol=1e-11)


def test_overflow_is_told(tmp_path: Path, rng: np.random.Generator) -> None:
    p = portable("exp", ("polynomial", "polynomial"), 1, rng, couplings=Couplings.none(2))
    e = p.expansion
    steep = type(e)(e.families, e.terms, 1e6 * e.coefficients)
    p = portable("exp", ("polynomial", "polynomial"), 1, rng, couplings=Couplings.none(2), expansion=steep)
    Q = np.random.default_rng(1).uniform(p.lower, p.upper, (50, 2))
    _, status = answers(p, Q, tmp_path)
    assert set(status) <= {0, 3}
    assert 3 in status
    np.testing.assert_array_equal(status, reference(p, Q)[1])


def test_syntax_is_that_of_python_3_8(rng: np.random.Generator) -> None:
    source = python_snippet(portable("factor", ("mixed", "periodic"), 6, rng))
    tree = ast.parse(source, feature_version=(3, 8))
    imported = [node for node in ast.walk(tree) if isinstance(node, (ast.Import, ast.ImportFrom))]
    assert [ast.unparse(node) for node in imported] == ["import math"]
    # Nothing younger by its library: no annotations, no removeprefix, no math.prod with start, no match.
    assert not any(isinstance(node, ast.AnnAssign) for node in ast.walk(tree))
    assert max(map(len, source.splitlines())) <= 130


@pytest.mark.parametrize("text", HOSTILE)
def test_texts_stay_in_comments_and_strings(text: str, rng: np.random.Generator) -> None:
    changes = {"name": text, "quantity": text, "unit": text, "robot": text, "model_hash": text}
    changes |= {"notes": (text,), "errors": {text: 1.0}, "fixed_deg": {text: 1.0}}
    hostile = portable("identity", ("mixed", "constant"), 1, rng, inputs=(f"{text} a", f"{text} b"), **changes)
    harmless = portable("identity", ("mixed", "constant"), 1, np.random.default_rng(0))
    source = python_snippet(hostile)
    assert source.isascii()
    trees = [ast.parse(s) for s in (source, python_snippet(harmless))]
    for tree in trees:
        for node in ast.walk(tree):
            if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") in ("INPUTS", "QUANTITY", "UNIT"):
                ast.literal_eval(node.value)
                node.value = ast.Constant(None)
    assert ast.dump(trees[0]) == ast.dump(trees[1])


def test_what_it_is_about(rng: np.random.Generator, tmp_path: Path) -> None:
    source = python_snippet(portable("identity", ("mixed", "polynomial"), 1, rng))
    for word in ("# xr701 compliance: compliance in m/N", 'UNIT = "m/N"', "rms_relative: 0.00125", "Status 2:"):
        assert word in source
    (tmp_path / "s.py").write_text(source, encoding="ascii")
    code = "import sys; sys.path.insert(0, sys.argv[1]); import s; print(s.INPUTS, s.UNIT); s.evaluate([0.0])"
    done = subprocess.run(  # noqa: S603 - our own interpreter and file
        [sys.executable, "-I", "-S", "-c", code, str(tmp_path)], capture_output=True, encoding="ascii", check=False
    )
    assert done.stdout.strip() == "('q2_deg', 'q3_deg') m/N"
    assert "1 angles given, 2 wanted: q2_deg, q3_deg" in done.stderr
