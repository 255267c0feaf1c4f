"""Refusals told by their code and by the name of what is wrong; how their sentences run is no matter of a test here."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from robots import InputError
from robots.errors import InputErrors


def refuses(codes: str, named: str, call: Callable[..., object], /, *given: object, **options: object) -> InputError:
    """The refusal of a call: every fault has one of these codes, and the message names this (a regular expression)."""
    with pytest.raises(InputError, match=named or None) as caught:
        call(*given, **options)
    error = caught.value
    found = {each.code for each in (error.errors if isinstance(error, InputErrors) else [error])}
    assert found <= set(codes.split()), found
    return error


def refuses_each(
    codes: str, named: str, call: Callable[..., object], /, *given: object, **options: object
) -> InputErrors:
    """As :func:`refuses`, of several faults that are told together."""
    error = refuses(codes, named, call, *given, **options)
    assert isinstance(error, InputErrors)
    return error
