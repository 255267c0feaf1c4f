"""How the face calls a step: nothing is printed, remarks are kept, and errors speak of arguments, not of options."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

from robots import InputError, InputErrors, require_one_of
from robots.files.reading import recording
from stiffarm.session.console import kept_messages

_OPTION = re.compile(r"--([a-z][a-z0-9]*(?:-[a-z0-9]+)*)")


@contextmanager
def called() -> Iterator[list[str]]:
    """Run a step: its messages become the list that is handed out.

    Raises
    ------
    InputError
        As the step raises it, with the names of options as those of arguments: ``--load-path`` is ``load_path``.
    """
    with kept_messages() as messages, recording():
        try:
            yield messages
        except InputErrors as error:
            raise InputErrors(_words(error.what), [_of_arguments(e) for e in error.errors], error.count) from error
        except InputError as error:
            raise _of_arguments(error) from error


def in_order(values: Mapping[str, float], names: Sequence[str], argument: str, unit: str = "number") -> list[float]:
    """The values of ``names``, one after the other, 0 where one is not given.

    Raises
    ------
    InputError
        A name that is not one of them, or a value that is not finite.
    """
    for name, value in values.items():
        require_one_of(f"{argument}: name", name, names, remedy="use these names")
        if not math.isfinite(value):
            raise InputError(f"{argument}: {name}", value=value, allowed=f"a finite {unit}")
    return [float(values.get(name, 0.0)) for name in names]


def _of_arguments(error: InputError) -> InputError:
    allowed, remedy = (None if text is None else _words(text) for text in (error.allowed, error.remedy))
    return InputError(_words(error.what), value=error.value, allowed=allowed, remedy=remedy, site=error.site)


def _words(text: str) -> str:
    return _OPTION.sub(lambda found: found[1].replace("-", "_"), text)
