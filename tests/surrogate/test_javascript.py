"""The surrogate as JavaScript, run by Node, against what every portable form must answer: the cases of the C header."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import oracles
import pytest
from portable_cases import CASES, HOSTILE, check, portable, poses, reference

from surrogate.portable import Link, Portable, javascript, surrogate_data
from surrogate.portable.words import identifier

needs_node = oracles.needs("node")
# Reads poses as JSON (null: NaN, words for what has no end), writes status and values likewise.
MAIN = """
const name = require("./surrogate.js"), words = { inf: Infinity, "-inf": -Infinity };
const Q = JSON.parse(require("fs").readFileSync(0, "utf8"));
const said = Q.map(q => name.evaluate(q.map(v => v === null ? NaN : words[v] ?? v)));
console.log(JSON.stringify(said.map(a => [a.status, [...a.values].map(v => Number.isFinite(v) ? v : null)])));
"""


def answers(p: Portable, folder: Path, Q: np.ndarray[Any, Any]) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    node = oracles.program("node")
    assert node is not None
    (folder / "surrogate.js").write_text(javascript(p), encoding="utf-8")
    (folder / "main.js").write_text(MAIN, encoding="utf-8")
    sent = [[None if np.isnan(v) else v if np.isfinite(v) else str(v) for v in row] for row in Q.tolist()]
    done = subprocess.run(  # noqa: S603 - our own script
        [node, str(folder / "main.js")], input=json.dumps(sent), capture_output=True, encoding="utf-8", check=False
    )
    assert done.returncode == 0, done.stderr
    rows = json.loads(done.stdout)
    values = [[np.nan if v is None else v for v in row[1]] for row in rows]
    return np.array(values), np.array([row[0] for row in rows])


@needs_node
@pytest.mark.parametrize(("link", "kinds", "m"), CASES)
def test_it_answers_what_the_surrogate_answers(
    link: Link, kinds: tuple[str, ...], m: int, rng: np.random.Generator, tmp_path: Path
) -> None:
    p = portable(link, kinds, m, rng)
    Q = poses(p, 60, rng)
    expected = reference(p, Q)
    assert len(set(expected[1].tolist())) >= 3
    check(p, expected, *answers(p, tmp_path, Q), rtol=1e-12)


@needs_node
@pytest.mark.parametrize("text", HOSTILE)
def test_no_text_gets_out_of_its_comment(text: str, rng: np.random.Generator, tmp_path: Path) -> None:
    p = portable("identity", ("polynomial",), 1, rng, name=f"n{text}", notes=(text,), robot=text, quantity=text)
    Q = poses(p, 5, rng)
    values, status = answers(p, tmp_path, Q)
    np.testing.assert_array_equal(status, reference(p, Q)[1])
    code = javascript(p).split("\n")
    comment = [line for line in code if line.startswith("//")]
    assert f"const {identifier(p.name)} = " in "\n".join(code)
    assert len(comment) > 5
    assert np.isnan(values[status != 0]).all()


def test_numbers_read_back_as_the_same_bits(rng: np.random.Generator) -> None:
    p = portable("identity", ("mixed",), 2, rng)
    data = json.loads(json.dumps(surrogate_data(p)))
    np.testing.assert_array_equal(np.array(data["sums"][0]["coefficients"]), p.expansion.coefficients)
