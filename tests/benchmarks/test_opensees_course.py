"""The published shell problems solved by OpenSees on the same meshes: an independent code beside ours."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import oracles
import pytest
from opensees_shell import run_opensees
from shell_problems import COURSE

pytestmark = pytest.mark.oracle
oracles.load_apart("openseespy.opensees")

TABLE = Path(__file__).resolve().parents[2] / "docs" / "validation" / "shell_convergence_opensees.md"
OURS = {"quads here": "quad", "triangles here": "tri"}
SHAPES = {**OURS, "ASDShellQ4": "quad", "ShellMITC4": "quad", "ShellDKGT": "tri", "ASDShellT3": "tri"}


@cache
def ratio(problem: str, element: str, n: int) -> float:
    """Deflection over reference, by our elements or by one of OpenSees'."""
    p = COURSE[problem](n, SHAPES[element])
    if element in OURS:
        return p.ratio()
    run = run_opensees(p.mesh, element, p.fixed, p.load[None])
    return float(p.reading @ run.displacements.ravel()) / p.reference


def _table() -> dict[tuple[str, str], dict[int, float]]:
    """Ratios by n of each problem and element, as printed in docs/."""
    rows, sizes = {}, []
    for line in TABLE.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if cells[:2] == ["problem", "element"]:
            sizes = [int(cell) for cell in cells[2:]]
        elif cells[0] in COURSE:
            rows[cells[0], cells[1]] = dict(zip(sizes, map(float, cells[2:]), strict=True))
    return rows


PRINTED = _table()
FINE = 32


# The brief's 1 %: other formulations of the same theory leave 0.1 to 0.7 % on these meshes.
SAME_THEORY = 0.01


def _ours(element: str) -> str:
    return next(name for name, shape in OURS.items() if shape == SHAPES[element])


def _agree(problem: str, element: str, n: int) -> None:
    assert ratio(problem, element, n) == pytest.approx(ratio(problem, _ours(element), n), rel=SAME_THEORY)


# Quads of the same kind: enhanced membrane, MITC4 bending and a treatment of warp of its own.
@pytest.mark.parametrize(("problem", "n"), [(name, 12 if name.startswith("twisted") else 16) for name in COURSE])
def test_quads_agree_with_asdshellq4(problem: str, n: int) -> None:
    _agree(problem, "ASDShellQ4", n)


@pytest.mark.parametrize(("problem", "n"), [("Scordelis-Lo roof", 16), ("twisted beam 0.32 in-plane", 24)])
def test_triangles_agree_with_shelldkgt(problem: str, n: int) -> None:
    _agree(problem, "ShellDKGT", n)


@pytest.mark.parametrize(
    ("problem", "element"),
    # ShellMITC4 has no correction for warp and has not converged at n = 96.
    [k for k in PRINTED if k[1] not in OURS and not (k[0].startswith("twisted") and k[1] == "ShellMITC4")],
)
def test_all_agree_where_both_have_converged(problem: str, element: str) -> None:
    printed, ours = PRINTED[problem, element], PRINTED[problem, _ours(element)]
    assert printed[max(printed)] == pytest.approx(ours[max(printed)], rel=SAME_THEORY)


@pytest.mark.slow
@pytest.mark.parametrize(("problem", "element"), PRINTED)
def test_the_printed_table_is_what_comes_out(problem: str, element: str) -> None:
    # The finest meshes take most of the time: elements take turns, one a problem.
    turn = list(SHAPES)[list(COURSE).index(problem) % len(SHAPES)]
    printed = {n: value for n, value in PRINTED[problem, element].items() if n <= FINE or element == turn}
    found = [ratio(problem, element, n) for n in printed]
    # Three digits are printed: half of the last one, and a little for other solvers' round-off.
    np.testing.assert_allclose(found, list(printed.values()), rtol=0, atol=5.5e-4)
