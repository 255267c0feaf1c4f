"""Work on arrays shared out to threads: compiled loops, which let others run beside them."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from types import ModuleType
from typing import TypeVar

import numpy as np

from robots.arrays import Array, in_blocks

Found = TypeVar("Found")


@cache
def compiled_loops(module: str) -> ModuleType | None:
    """A module that numba compiles; None where numba is missing, too old for the numpy there is, or cannot start."""
    try:
        return importlib.import_module(module)
    except (ImportError, RuntimeError):
        return None


def plain(a: Array) -> Array:
    """The array contiguous and writable: numba compiles anew for arrays that are not."""
    return np.require(a, np.float64, ["C", "W"])


def default_threads() -> int:
    """Threads that numba is set to use: the processors that this process may use, or ``NUMBA_NUM_THREADS``."""
    from numba import config

    return int(config.NUMBA_NUM_THREADS)


def in_shares(n: int, size: int, threads: int | None, share: Callable[[slice], Found]) -> list[Found]:
    """What ``share`` gives for the rows of each share of n, in their order; None: :func:`default_threads`."""
    shares = list(in_blocks(n, size))
    workers = min(default_threads() if threads is None else threads, len(shares))
    if workers < 2:
        return [share(rows) for rows in shares]
    with ThreadPoolExecutor(workers) as pool:
        return list(pool.map(share, shares))
