"""Every public function has one example in its docstring, and it gives what it says."""

from __future__ import annotations

import doctest
import importlib
import inspect

import pytest

import stiffarm as sa

pytestmark = pytest.mark.slow

FUNCTIONS = [name for name in sa.__all__ if inspect.isfunction(getattr(sa, name))]
# Shown by scripts in examples/ and on pages: they need files, as of a cell and a part, or take a minute.
WITHOUT = {
    "load_surrogate",
    "map_index",
    "place",
    "post",
    "posture",
    "query",
    "run",
    "verify",
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_example_of_a_function_holds(name: str) -> None:
    function = getattr(sa, name)
    module = importlib.import_module(function.__module__)
    (found,) = doctest.DocTestFinder(recurse=False).find(function, name, module, vars(module).copy())
    assert name in WITHOUT or found.examples
    assert doctest.DocTestRunner().run(found).failed == 0
