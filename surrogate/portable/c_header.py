"""A surrogate as one C99 header that needs nothing but <math.h>, for postprocessors and controllers."""

from __future__ import annotations

from surrogate.portable.content import Portable
from surrogate.portable.source import Brackets, render
from surrogate.portable.words import identifier

_C = Brackets("{ ", " }", "", "HUGE_VAL")


def c_header(portable: Portable) -> str:
    """Text of the header, ASCII; it compiles as C99 and as C++.

    With NAME the surrogate's name as an identifier (:func:`surrogate.portable.words.identifier`) it has

    - ``int NAME_evaluate(const double q_rad[k], double out[])`` and ``NAME_evaluate_deg``, which answer a
      :class:`~surrogate.portable.content.Status` and fill ``out`` with NaN unless it is 0;
    - ``NAME_inputs`` and ``NAME_values``, how many numbers go in and come out.

    A matrix 6 x 6 is written row by row. Numbers read back as the same bits. Where the compiler may not take NaN for
    what it is (``-ffast-math``), faults go unseen.
    """
    return render("c_header.h.j2", portable, identifier(portable.name), _C)
