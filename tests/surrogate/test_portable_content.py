"""What goes into portable surrogates: parts that fit together, texts that stay where they belong, the reference."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np
import oracles
import pytest
from expansion_cases import expansion
from portable_cases import CASES, HOSTILE, check, portable, poses, reference
from refusals import refuses

from surrogate.expansion import Expansion, Family
from surrogate.model import Factor
from surrogate.portable import Link, Portable, c_header
from surrogate.portable.words import comment, identifier, number, string, with_unit
from surrogate.scope import Couplings


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("xr701", "xr701"),
        ("KR 60-3 / k_fs", "KR_60_3_k_fs"),
        ("7axis", "surrogate_7axis"),
        ("__x__", "x"),
        ("", "surrogate"),
        ("*/", "surrogate"),
        ("é", "e"),
        ("a" * 100, "a" * 40),
    ],
)
def test_identifiers(text: str, name: str) -> None:
    assert identifier(text) == name


def test_names_with_units() -> None:
    assert with_unit("compliance", "m/N") == "compliance_m_per_N"
    assert with_unit("k_fs", "N/mm") == "k_fs_N_per_mm"
    assert with_unit("share", "") == "share"
    assert with_unit("worst */ direction", "µm / N") == "worst_direction_um_per_N"


@pytest.mark.parametrize("text", HOSTILE)
def test_comments_and_strings_hold_no_way_out(text: str) -> None:
    for line in [*comment(text), string(text)[1:-1]]:
        assert re.fullmatch(r"[ -~]*", line)
        assert not re.search(r"\\|\?\?", line)
    assert not re.search(r"\*/|/\*", "".join(comment(text)))
    assert '"' not in string(text)[1:-1]


def law(k: int, m: int) -> Expansion:
    return expansion(("mixed",) * k, m, np.random.default_rng(1))


def factor(*group: int, laws: tuple[Expansion, ...] = ()) -> Factor:
    return Factor(np.array(group), laws)


def some(**changes: object) -> Portable:
    return portable("identity", ("mixed", "polynomial"), 2, np.random.default_rng(0), **changes)


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"link": "square"}, "link"),
        ({"link": "factor"}, "factor"),
        ({"inputs": ("a",)}, "inputs"),
        ({"inputs": ("a", "a")}, "coordinates"),
        ({"lower": [0.0]}, "domain"),
        ({"lower": [9.0, 9.0], "upper": [1.0, 1.0]}, "domain"),
        ({"upper": [np.nan, 1.0]}, "domain"),
        ({"couplings": Couplings.none(3)}, "couplings"),
        ({"errors": {"rms": np.nan}}, "errors"),
        ({"fixed_deg": {"q1_deg": np.inf}}, "fixed_deg"),
        ({"factor": factor(-1, -1)}, "factor"),
        ({"link": "squares"}, "factor"),
        ({"link": "squares", "factor": factor(-1)}, "numbers of a factor"),
        ({"link": "factor", "factor": factor(-1, -1)}, "numbers of a factor"),
        ({"link": "squares", "factor": factor(0, 0, laws=(law(1, 1),))}, "functions of the 2 inputs"),
    ],
)
def test_parts_that_do_not_fit(changes: dict[str, object], word: str) -> None:
    refuses("F007 S001", word, some, **changes)


def test_reference_itself() -> None:
    f = Family(0.0, 1.0, False, 0, (1,), np.eye(2))
    e = Expansion((f, f), np.array([[0, 1], [1, 0]]), np.array([[2.0], [3.0]]))
    sums = Couplings(("sum",), [[1.0, 1.0]], [-1.0], [1.0])
    p = some(expansion=e, lower=[-1.0, -1.0], upper=[1.0, 2.0], couplings=sums, link="exp")
    Q = np.array([[0.5, 0.25], [1.5, -1.0], [0.9, 1.9], [np.nan, 0.0], [1.0 + 5e-10, 0.0]])
    values, status = reference(p, Q)
    assert status.tolist() == [0, 1, 2, 3, 0]
    np.testing.assert_allclose(values[[0, 4], 0], np.exp([2.0, 3.0]), rtol=1e-8)
    assert np.isnan(values[[1, 2, 3]]).all()
    steep = Expansion((f, f), e.terms, 1e3 * e.coefficients)
    p = some(expansion=steep, lower=-np.ones(2), upper=np.ones(2), couplings=Couplings.none(2), link="exp")
    values, status = reference(p, np.array([[0.9, 0.9], [-0.9, -0.9]]))
    assert status.tolist() == [3, 0]  # exp(4500) is no number, exp(-4500) is 0
    assert np.isnan(values[0, 0])
    assert values[1, 0] == 0.0


def test_reference_of_weighted_rows() -> None:
    f = Family(0.0, 1.0, False, 0, (1,), np.eye(2))
    rows = np.arange(12.0).reshape(1, 12)
    e = Expansion((f,), np.array([[1]]), rows)
    law = Expansion((f,), np.array([[0], [1]]), np.array([[np.log(2.0)], [1.0]]))
    changes = {"inputs": ("q",), "lower": [-1.0], "upper": [1.0], "couplings": Couplings.none(1)}
    changes |= {"expansion": e}
    x, w = 0.5, 2.0 * np.exp(0.5)
    C, _ = reference(some(link="factor", factor=factor(-1, 0, laws=(law,)), **changes), np.array([[x]]))
    a, b = x * rows.reshape(2, 6)
    np.testing.assert_allclose(C[0], np.outer(a, a) + w * np.outer(b, b), rtol=1e-14)
    y, _ = reference(some(link="squares", factor=factor(0, *(-1,) * 11, laws=(law,)), **changes), np.array([[x]]))
    weights = np.r_[w, np.ones(11)]
    np.testing.assert_allclose(y, [[np.sum(weights * (x * rows[0]) ** 2)]], rtol=1e-14)


# ------------------------------------------------------------
# The C header, compiled by the system's compiler, against what every portable form must answer

STRICT = ["-Wall", "-Wextra", "-Werror", "-pedantic"]
# The least optimised, so that tests spend no time on it; and that no optimisation changes digits.
C99 = ["cc", "-std=c99", "-O0", *STRICT]
CPP = ["c++", "-std=c++11", "-O2", *STRICT]

# Reads poses as hexadecimal numbers, writes status and values likewise.
MAIN = """
#include <stdio.h>
#include <stdlib.h>
#include "surrogate.h"
#include "surrogate.h"

int main(int argc, char **argv)
{
    double q[NAME_inputs], out[NAME_values];
    char word[64];
    int i, n = 0, status;
    (void)argv;
    while (scanf("%63s", word) == 1) {
        q[n++] = strtod(word, NULL);
        if (n < NAME_inputs)
            continue;
        n = 0;
        status = argc > 1 ? NAME_evaluate_deg(q, out) : NAME_evaluate(q, out);
        printf("%d", status);
        for (i = 0; i < NAME_values; ++i)
            printf(" %a", out[i]);
        printf("\\n");
    }
    return 0;
}
"""

needs_c = oracles.needs("cc")


def built(p: Portable, folder: Path, compiler: list[str]) -> Path:
    suffix = "cpp" if compiler is CPP else "c"
    (folder / "surrogate.h").write_text(c_header(p), encoding="ascii")
    (folder / f"main.{suffix}").write_text(MAIN.replace("NAME", identifier(p.name)), encoding="ascii")
    command = [*compiler, "-o", str(folder / "main"), str(folder / f"main.{suffix}"), "-lm"]
    done = subprocess.run(command, capture_output=True, encoding="utf-8", check=False)  # noqa: S603 - our own files
    assert done.returncode == 0, done.stderr
    return folder / "main"


def answers(program: Path, Q: np.ndarray, *options: str) -> tuple[np.ndarray, np.ndarray]:
    text = "\n".join(" ".join(float(v).hex() for v in row) for row in Q)
    done = subprocess.run(  # noqa: S603 - the program just compiled
        [str(program), *options], input=text, capture_output=True, encoding="ascii", check=True
    )
    rows = [line.split() for line in done.stdout.splitlines()]
    # strtod and %a write NaN as "nan" or "-nan".
    values = [[np.nan if "nan" in v else float.fromhex(v) for v in row[1:]] for row in rows]
    return np.array(values), np.array([int(row[0]) for row in rows])


@needs_c
@pytest.mark.parametrize("case", CASES, ids=lambda c: f"{c[0]}-{len(c[1])}-{c[2]}")
def test_compiled_header_answers_as_the_surrogate(
    case: tuple[Link, tuple[str, ...], int], rng: np.random.Generator, tmp_path: Path
) -> None:
    p = portable(*case, rng)
    Q = poses(p, 1000, rng)
    expected = reference(p, Q)
    assert {0, 1, 3} <= set(expected[1].tolist())
    assert p.expansion.n_inputs == 1 or 2 in expected[1]
    check(p, expected, *answers(built(p, tmp_path, C99), Q), rtol=1e-12)


@oracles.needs("c++")
def test_header_is_cpp_too(rng: np.random.Generator, tmp_path: Path) -> None:
    p = portable("factor", ("mixed", "periodic"), 6, rng)
    Q = poses(p, 200, rng)
    check(p, reference(p, Q), *answers(built(p, tmp_path, CPP), Q), rtol=1e-12)


@needs_c
def test_degrees(rng: np.random.Generator, tmp_path: Path) -> None:
    p = portable("identity", ("mixed", "polynomial"), 2, rng)
    Q = poses(p, 200, rng)
    # 1e-11: degrees that are turned into radians are rounded once more.
    check(p, reference(p, Q), *answers(built(p, tmp_path, C99), np.degrees(Q), "deg"), rtol=1e-11)


@needs_c
@pytest.mark.parametrize("text", HOSTILE)
def test_texts_stay_in_their_comments(text: str, rng: np.random.Generator, tmp_path: Path) -> None:
    p = portable("identity", ("mixed", "constant"), 1, rng)
    changes = {"name": text, "quantity": text, "unit": text, "robot": text, "model_hash": text}
    hostile = portable(
        "identity",
        ("mixed", "constant"),
        1,
        np.random.default_rng(0),
        inputs=(f"{text} a", f"{text} b"),
        couplings=Couplings((text,), [[1.0, 0.0]], [-1.0], [1.0]),
        notes=(text,) * 2,
        errors={text: 1.0},
        fixed_deg={text: 1.0},
        **changes,
    )
    source = c_header(hostile)
    head, body = source.split("*/", 1)
    assert head.startswith("/*")
    assert "/*" not in head[2:]
    # But for its name, the code is that of harmless texts.
    harmless = c_header(portable_like(hostile, p))
    name, other = identifier(hostile.name), identifier(p.name)
    body, expected = body.replace(name, "NAME").replace(name.upper(), "NAME"), harmless.split("*/", 1)[1]
    assert body == expected.replace(other, "NAME").replace(other.upper(), "NAME")
    built(hostile, tmp_path, C99)


def portable_like(hostile: Portable, p: Portable) -> Portable:
    c = hostile.couplings
    return Portable(
        expansion=hostile.expansion,
        link=hostile.link,
        name=p.name,
        quantity=p.quantity,
        unit=p.unit,
        inputs=p.inputs,
        lower=hostile.lower,
        upper=hostile.upper,
        couplings=Couplings(("sum",), c.matrix, c.lower, c.upper),
        robot=p.robot,
        model_hash=p.model_hash,
        load_direction=p.load_direction,
        factor=hostile.factor,
    )


def test_comment_says_what_a_reader_must_know(rng: np.random.Generator) -> None:
    text = c_header(portable("identity", ("mixed", "polynomial"), 1, rng)).split("*/")[0]
    for word in ("xr701", "ab12", "compliance in m/N", "q2_deg", "q3_deg", "q3 - q2: +1 q2_deg -1 q3_deg", "12.5 deg"):
        assert word in text
    for word in ("rms_relative: 0.00125", "95 % of errors", "xr701_compliance_evaluate(q_rad, out)", "Status 3"):
        assert word in text
    assert re.search(r"SHA-256 of the numbers: [0-9a-f]{64}", text)
    assert max(map(len, text.splitlines())) <= 120


def test_numbers_read_back_as_the_same_bits(rng: np.random.Generator) -> None:
    p = portable("identity", ("mixed",), 2, rng)
    text = c_header(p).split("_coefficients_0[")[1].split("};")[0]
    found = [float(v) for v in re.findall(r"-?\d[\d.e+-]*", text.split("= {")[1])]
    np.testing.assert_array_equal(found, p.expansion.coefficients.ravel())
    for value in (0.1, -0.0, 5e-324, 1.7976931348623157e308, 1e16, 3.0):
        assert float(number(value)).hex() == value.hex()
    with pytest.raises(ValueError, match="nan"):
        number(float("nan"))
