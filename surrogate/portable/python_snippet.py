"""A surrogate as one Python file without imports but ``math``, for scripts inside other programs."""

from __future__ import annotations

from surrogate.portable.content import Portable
from surrogate.portable.source import Brackets, render
from surrogate.portable.words import identifier

_PYTHON = Brackets("(", ")", ",", "_INF")


def python_snippet(portable: Portable) -> str:
    """Text of the file, ASCII, for Python 3.8 and newer.

    It has ``evaluate(q_rad)`` and ``evaluate_deg(q_deg)``, which give a list of values (six lists for a matrix 6 x 6)
    or raise ``NoValue`` with a ``status``, and ``check(q_rad)``, which gives that
    :class:`~surrogate.portable.content.Status` beforehand; ``INPUTS``, ``QUANTITY`` and ``UNIT``. Numbers read back as
    the same bits.
    """
    return render("python_snippet.py.j2", portable, identifier(portable.name), _PYTHON)
