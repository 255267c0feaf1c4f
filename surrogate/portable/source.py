"""A surrogate as source text that needs nothing else: one C99 header, or one Python file."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import jinja2
import numpy as np
from jinja2.sandbox import ImmutableSandboxedEnvironment

from surrogate.expansion import TURN, Expansion, Family
from surrogate.portable.content import Portable, Status, content_hash
from surrogate.portable.words import identifier, number, provenance, string

# Numbers in a line: up to 25 characters each.
_PER_LINE = 4


@dataclass(frozen=True)
class Brackets:
    """How a language writes rows of numbers, and infinity."""

    opening: str
    closing: str
    # Behind the only number of a row: Python takes (1.0) for a number.
    alone: str
    infinity: str

    def rows(self, rows: Iterable[Iterable[float]]) -> str:
        """Each row in brackets, a few numbers a line."""
        return "\n".join(f"    {self.row(row)}," for row in rows)

    def row(self, values: Iterable[float]) -> str:
        """Numbers in brackets."""
        texts = [self.number(v) for v in values]
        lines = [", ".join(texts[i : i + _PER_LINE]) for i in range(0, len(texts), _PER_LINE)]
        end = self.alone if len(texts) == 1 else ""
        return self.opening + ",\n        ".join(lines) + end + self.closing

    def number(self, value: float) -> str:
        """One number; integers as they are."""
        if isinstance(value, int):
            return str(value)
        if np.isinf(value):
            return self.infinity if value > 0.0 else f"-{self.infinity}"
        return number(value)


_C = Brackets("{ ", " }", "", "HUGE_VAL")
_PYTHON = Brackets("(", ")", ",", "_INF")


def c_header(portable: Portable) -> str:
    """Text of the header, ASCII; it compiles as C99 and as C++.

    With NAME the surrogate's name as an identifier (:func:`surrogate.portable.words.identifier`) it has

    - ``int NAME_evaluate(const double q_rad[k], double out[])`` and ``NAME_evaluate_deg``, which answer a
      :class:`~surrogate.portable.content.Status` and fill ``out`` with NaN unless it is 0;
    - ``NAME_inputs`` and ``NAME_values``, how many numbers go in and come out.

    A matrix 6 x 6 is written row by row. Numbers read back as the same bits. Where the compiler may not take NaN for
    what it is (``-ffast-math``), faults go unseen.
    """
    return _render("c_header.h.j2", portable, _C)


def python_snippet(portable: Portable) -> str:
    """Text of the file, ASCII, for Python 3.8 and newer.

    It has ``evaluate(q_rad)`` and ``evaluate_deg(q_deg)``, which give a list of values (six lists for a matrix 6 x 6)
    or raise ``NoValue`` with a ``status``, and ``check(q_rad)``, which gives that
    :class:`~surrogate.portable.content.Status` beforehand; ``INPUTS``, ``QUANTITY`` and ``UNIT``. Numbers read back as
    the same bits.
    """
    return _render("python_snippet.py.j2", portable, _PYTHON)


def _render(template: str, portable: Portable, brackets: Brackets) -> str:
    """Fill in a template."""
    p, e = portable, portable.expansion
    lower, upper = p.bounds
    coupled_lower, coupled_upper = p.coupled_bounds
    coupled = p.couplings.matrix
    return (
        _environment()
        .get_template(template)
        .render(
            name=identifier(portable.name),
            comment=[*provenance(p), f"SHA-256 of the numbers: {content_hash(p)}"],
            link=p.link,
            inputs=[string(i) for i in p.inputs],
            quantity=string(p.quantity),
            unit=string(p.unit),
            k=e.n_inputs,
            m=e.n_outputs,
            sums=[_sum(place, part, brackets) for place, part in enumerate(p.sums)],
            row_weights=p.row_weights.tolist(),
            by_rows=p.factor is not None,
            n_values=p.n_values,
            lower=brackets.row(lower),
            upper=brackets.row(upper),
            couplings=len(coupled),
            coupled=brackets.rows(coupled),
            coupled_lower=brackets.row(coupled_lower),
            coupled_upper=brackets.row(coupled_upper),
            coupled_rows=[
                f"{brackets.row(row)}, {brackets.number(low)}, {brackets.number(high)}"
                for row, low, high in zip(coupled, coupled_lower, coupled_upper, strict=True)
            ],
            turn=number(TURN),
            degree=number(np.pi / 180.0),
            ok=int(Status.OK),
            outside=int(Status.OUTSIDE_DOMAIN),
            broken=int(Status.COUPLINGS_BROKEN),
            not_finite=int(Status.NOT_FINITE),
        )
    )


def _sum(place: int, e: Expansion, brackets: Brackets) -> dict[str, Any]:
    return {
        "number": place,
        "t": e.n_terms,
        "m": e.n_outputs,
        "terms": brackets.rows(e.terms.tolist()),
        "coefficients": brackets.rows(e.coefficients),
        "families": [_family(i, f, brackets) for i, f in enumerate(e.families)],
    }


def _family(i: int, f: Family, brackets: Brackets) -> dict[str, Any]:
    return {
        "input": i,
        "centre": number(f.centre),
        "half_range": number(f.half_range),
        "periodic": bool(f.periodic),
        "harmonics": int(f.harmonics),
        "degrees": [int(d) for d in f.degrees],
        "highest": int(f.degrees[-1]) if f.degrees else 0,
        "size": f.size,
        "raw": f.matrix.shape[1],
        "matrix": brackets.rows(f.matrix),
    }


@functools.cache
def _environment() -> jinja2.Environment:
    return ImmutableSandboxedEnvironment(
        loader=jinja2.PackageLoader("surrogate.portable", "templates"),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        # No HTML. words.py sees to it that texts stay in their comments and strings.
        autoescape=False,
    )
