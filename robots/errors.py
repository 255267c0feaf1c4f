"""The one kind of error that reaches a user as a message instead of a traceback, and words from files in messages."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice, product

# Faults that a message spells out; the others are counted. A screen holds about as many.
FAULTS_SHOWN = 20
# Names that a message lists.
NAMES_SHOWN = 12
# Characters of one value, of one name or sentence, and of one of several faults that a message repeats: enough to find
# it in the file again.
_LONGEST_VALUE, _LONGEST_TEXT, _LONGEST_OF_SEVERAL = 500, 2000, 1000
# A name is taken as another mistyped where so much of the letters agree (difflib's ratio): one slip in four letters.
_CLOSE = 0.75
# Longer texts are no names, and more of them nobody has mistyped.
_LONGEST_NAME, _MOST_NAMES = 60, 200


def one_line(text: str) -> str:
    r"""The text as one line that a terminal only prints: what could move its cursor or end the line is spelled out.

    Names, titles and notes come from files, and these may hold anything: an escape character becomes ``\x1b``, a
    newline ``\n``, a mark that turns the direction of writing ``\u202e``. A blank that does not break, as pages have
    it between a figure and its unit, is a blank.
    """
    text = text.replace("\u00a0", " ")
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def shortened(text: str, longest: int = _LONGEST_TEXT) -> str:
    """The text as one line, or its beginning and how long it is."""
    line = one_line(text[: longest + 1])
    return line if len(line) <= longest else f"{line[:longest]}... ({len(text)} characters)"


def listed(names: Iterable[object], shown: int = NAMES_SHOWN) -> str:
    """The first of some names, each once, and how many more there are."""
    each = list(dict.fromkeys(map(str, names)))
    more = f" and {len(each) - shown} more" if len(each) > shown else ""
    return ", ".join(shortened(name, _LONGEST_VALUE) for name in each[:shown]) + more


def twice(names: Iterable[str]) -> list[str]:
    """The names that stand there more than once, sorted."""
    return sorted(name for name, times in Counter(names).items() if times > 1)


def line_ranges(lines: Iterable[int]) -> str:
    """Line numbers, ascending, with neighbours as one range: ``5-7, 14``; the first ranges, and how many more."""
    ranges: list[list[int]] = []
    for line in lines:
        if ranges and line == ranges[-1][1] + 1:
            ranges[-1][1] = line
        else:
            ranges.append([line, line])
    return listed(str(a) if a == b else f"{a}-{b}" for a, b in ranges)


class InputError(ValueError):
    """Bad input: what is wrong, which value, what is allowed, and what to do. The message is one printable line.

    Parameters
    ----------
    what : the thing at fault, with its place ("data.csv, row 3, column fz_N")
    code : the entry of the catalogue of failures (``stiffarm help CODE``); it never changes
    value : the offending value as the user wrote it, if there is one
    allowed : the allowed range or form
    remedy : what the user can do about it
    """

    def __init__(
        self,
        what: str,
        *,
        code: str,
        value: object = None,
        allowed: str | None = None,
        remedy: str | None = None,
    ) -> None:
        self.what, self.code, self.value, self.allowed, self.remedy = what, code, value, allowed, remedy
        text = shortened(what)
        if value is not None:
            text += f": got {_shown(value)}"
        if allowed is not None:
            text += f"; allowed: {shortened(allowed)}"
        close = meant(value, allowed)
        if close is not None:
            text += f". Did you mean {shortened(close)}?"
        if remedy is not None:
            text += f"{' ' if close else '. '}To fix it: {shortened(remedy)}"
        super().__init__(text)

    @property
    def prose(self) -> str:
        """The same for a page on which it is no refusal but a finding: what hindered, then what would help, no stop."""
        shown = shortened(self.value, _LONGEST_VALUE) if isinstance(self.value, str) else _shown(self.value)
        value = "" if self.value is None else f": {shown}"
        allowed = "" if self.allowed is None else f" (needed: {shortened(self.allowed)})"
        remedy = "" if self.remedy is None else f". {self.remedy[:1].upper()}{shortened(self.remedy)[1:]}"
        return f"{shortened(self.what)}{value}{allowed}{remedy}"


def require_one_of(
    what: str, value: object, allowed: Iterable[object], *, code: str, remedy: str | None = None
) -> None:
    """Raise InputError unless ``value``, which is ``what``, is one of those allowed."""
    known = tuple(allowed)
    if value not in known:
        raise InputError(what, code=code, value=value, allowed=", ".join(map(str, known)), remedy=remedy)


def require_positive(what: str, value: float | None, unit: str = "", remedy: str | None = None, *, code: str) -> None:
    """Raise InputError unless a number, in its ``unit``, is finite and greater than 0, or not given."""
    if value is not None and not 0.0 < value < math.inf:
        raise InputError(what, code=code, value=value, allowed=f"greater than 0 {unit}".rstrip(), remedy=remedy)


def require_at_least(
    what: str, value: float | None, least: float, unit: str = "", remedy: str | None = None, *, code: str
) -> None:
    """Raise InputError unless a number, in its ``unit``, is finite and not below ``least``, or not given."""
    if value is not None and not least <= value < math.inf:
        allowed = f"{least:g} or more{unit and f', {unit}'}"
        raise InputError(what, code=code, value=value, allowed=allowed, remedy=remedy)


def raise_any(what: str, faults: Sequence[InputError]) -> None:
    """Raise the fault, or all of them as one :class:`InputErrors` of ``what``; nothing where there are none."""
    if faults:
        raise faults[0] if len(faults) == 1 else InputErrors(what, faults)


class InputErrors(InputError):  # noqa: N818 - the plural of InputError
    """Several faults found in one reading of the input, reported together: the first ones, and how many there are.

    It has no code of its own: each of them has one. ``count``: of all faults, where ``errors`` holds the first of them
    only.
    """

    def __init__(self, what: str, errors: Sequence[InputError], count: int | None = None) -> None:
        super().__init__(what, code="")
        self.errors = tuple(errors)
        self.count = len(self.errors) if count is None else count
        lines = [f"  - {_among_several(error)}" for error in self.errors[:FAULTS_SHOWN]]
        if self.count > len(lines):
            lines.append(f"  ... and {self.count - len(lines)} more")
        self.args = ("\n".join([f"{self}: {self.count} problem(s)", *lines]),)

    @property
    def prose(self) -> str:
        """The first fault, and how many there are."""
        return f"{self.what} ({self.count} in all): {self.errors[0].prose}"


def meant(value: object, allowed: str | None) -> str | None:
    """The allowed name that comes closest to a mistyped one; None where none is close or ``allowed`` lists none."""
    if not isinstance(value, str) or allowed is None or len(value) > _LONGEST_NAME:
        return None
    from difflib import get_close_matches

    names = [name for part in re.split("[;,] ", allowed)[:_MOST_NAMES] for name in islice(_each(part), _MOST_NAMES)]
    close = get_close_matches(value, names, n=1, cutoff=_CLOSE)
    return close[0] if close and close[0] != value else None


def _each(pattern: str) -> Iterator[str]:
    """The names that a pattern such as ``{j1,j2}.{tx|ty}`` stands for; none where it is a sentence."""
    if " " not in pattern:
        parts = [re.split("[,|]", part) for part in re.split("[{}]", pattern)]
        yield from map("".join, product(*parts))


def _among_several(error: InputError) -> str:
    return str(error) if isinstance(error, InputErrors) else shortened(str(error), _LONGEST_OF_SEVERAL)


def _shown(value: object) -> str:
    try:
        # What is cut off is not written out first: a cell can have megabytes.
        text = repr(value[: _LONGEST_VALUE + 1]) if isinstance(value, str) else str(value)
    except ValueError:  # Python refuses to write whole numbers of thousands of digits out
        return "a whole number of thousands of digits"
    if len(text) <= _LONGEST_VALUE:
        return text
    return f"{one_line(text[:_LONGEST_VALUE])}... ({len(value if isinstance(value, str) else text)} characters)"
