"""What the attack throws: a file's bytes with its ending, and draws from a generator in a few words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

T = TypeVar("T")
Rng = np.random.Generator


@dataclass(frozen=True)
class Sample:
    """A file: its ending (".csv"), which readers heed, and its bytes."""

    suffix: str
    data: bytes


def below(rng: Rng, n: int) -> int:
    """A whole number from 0 to n - 1; 0 where there is none."""
    return int(rng.integers(n)) if n > 1 else 0


def one(rng: Rng, items: Sequence[T]) -> T:
    """One of the items."""
    return items[below(rng, len(items))]


def chance(rng: Rng, share: float) -> bool:
    """True in that share of the draws."""
    return bool(rng.random() < share)


def span(rng: Rng, n: int, most: int) -> tuple[int, int]:
    """Start and end of a piece of n items, not empty where n is not 0, of ``most`` items at most."""
    start = below(rng, n)
    return start, min(n, start + 1 + below(rng, most))


# Numbers that readers stumble over: too large, too small, none at all, other ways to write one.
NUMBERS: tuple[bytes, ...] = (
    b"0",
    b"-0.0",
    b"1",
    b"-1",
    b"0.5",
    b"1e308",
    b"-1e308",
    b"1e999",
    b"-1e999",
    b"1e154",
    b"1e-154",
    b"1e-320",
    b"5e-324",
    b"1e16",
    b"1e9",
    b"1e-9",
    b"nan",
    b"NaN",
    b"inf",
    b"-inf",
    b"Infinity",
    b"-Infinity",
    b"9" * 400,
    b"-" + b"9" * 400,
    b"0." + b"3" * 400,
    b"9223372036854775808",
    b"-9223372036854775809",
    b"4294967296",
    b"2147483648",
    b"0x10",
    b"0o17",
    b"0b1",
    b"1_000",
    b"1,5",
    b"1.5.2",
    b"1e",
    b"e5",
    b"--1",
    b"+1",
    b".5",
    b"5.",
    b"007",
    b"",
    b"12mm",
    b"1/2",
    "\u22121".encode(),
    "\u0661".encode(),
    b"true",
    b"null",
    b"1" * 5000,
    b"1e-400",
    b"360",
    b"89.999999999",
    b"1e5",
    b"1e6",
    b"255",
    b"-128",
    b"3.4028236e38",
)
# Texts that files, terminals, spreadsheets, pages and parsers take for something else.
TEXTS: tuple[bytes, ...] = (
    b"",
    b" ",
    b"\x00",
    b"\x1b[2J\x1b]0;x\x07",
    b"\n",
    b"\r",
    b"\t",
    b"../../etc/passwd",
    b"/dev/zero",
    b"=1+1",
    b"@SUM(A1)",
    b"<script>alert(1)</script>",
    b"{{ 7 * 7 }}",
    b"{% for i in range(10**9) %}",
    b"%s%n",
    b"\xff\xfe",
    b"\xc3\x28",
    "\u202e\u0000".encode(),
    "\U0001f9be".encode(),
    b"a" * 5000,
    b"None",
    b"nan",
    b"true",
    b"'",
    b'"',
    b"\\",
    b"$(id)",
    b"__class__",
    b"\xef\xbb\xbf",
    "e\u0301".encode(),
    b";" * 50,
    b"[",
    b"]",
    b"{",
    b"}",
    b"#",
)
