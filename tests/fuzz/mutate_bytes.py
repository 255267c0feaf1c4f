"""Mutations that know nothing of a file but bytes, lines and numbers."""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Callable, Sequence

from .samples import NUMBERS, TEXTS, Rng, below, chance, one, span

Mutation = Callable[[bytes, Rng, Sequence[bytes]], bytes]

_NUMBER = re.compile(rb"(?<![A-Za-z_\d.])[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")
_WORD = re.compile(rb"[A-Za-z_][A-Za-z_0-9.-]*")
_LONG = (100, 3_000, 40_000)
# Beyond this a file tells nothing that a smaller one would not.
LARGEST = 400_000


def flip(data: bytes, rng: Rng, _: Sequence[bytes]) -> bytes:
    """Some bits flipped."""
    out = bytearray(data)
    for _i in range(1 + below(rng, 4)):
        if out:
            out[below(rng, len(out))] ^= 1 << below(rng, 8)
    return bytes(out)


def delete(data: bytes, rng: Rng, _: Sequence[bytes]) -> bytes:
    """A piece left out."""
    start, end = span(rng, len(data), 1 + len(data) // 8)
    return data[:start] + data[end:]


def duplicate(data: bytes, rng: Rng, _: Sequence[bytes]) -> bytes:
    """A piece twice or many times."""
    start, end = span(rng, len(data), 1 + len(data) // 8)
    times = 2 if chance(rng, 0.8) else 50
    return data[:start] + data[start:end] * times + data[end:]


def splice(data: bytes, rng: Rng, others: Sequence[bytes]) -> bytes:
    """The start of this and the end of another."""
    other = one(rng, others) if others else data
    return data[: below(rng, len(data) + 1)] + other[below(rng, len(other) + 1) :]


def truncate(data: bytes, rng: Rng, _: Sequence[bytes]) -> bytes:
    """Cut short."""
    return data[: below(rng, len(data) + 1)]


def insert(data: bytes, rng: Rng, _: Sequence[bytes]) -> bytes:
    """A text or number that does not belong there."""
    at = below(rng, len(data) + 1)
    return data[:at] + one(rng, TEXTS if chance(rng, 0.6) else NUMBERS) + data[at:]


def run_of_one(data: bytes, rng: Rng, _: Sequence[bytes]) -> bytes:
    """A very long run of one character or of an opening bracket."""
    at = below(rng, len(data) + 1)
    piece = one(rng, (b"[", b"{", b"(", b"9", b"A", b" ", b",", b"\n", b"<a>", b"-"))
    return data[:at] + piece * one(rng, _LONG) + data[at:]


def reencode(data: bytes, rng: Rng, _: Sequence[bytes]) -> bytes:
    """The same text with a BOM, in UTF-16 or Latin-1, with other ends of lines, or with a NUL at its end."""
    text = data.decode("utf-8", errors="replace")
    return one(
        rng,
        (
            b"\xef\xbb\xbf" + data,
            text.encode("utf-16"),
            text.encode("latin-1", errors="replace"),
            data.replace(b"\n", b"\r\n"),
            data.replace(b"\n", b"\r"),
            data + b"\0",
            data.rstrip(),
        ),
    )


def number(data: bytes, rng: Rng, _: Sequence[bytes]) -> bytes:
    """One number replaced, or all that read the same."""
    found = list(_NUMBER.finditer(data))
    if not found:
        return insert(data, rng, ())
    at, new = one(rng, found), one(rng, NUMBERS)
    if chance(rng, 0.1):
        return re.sub(rb"(?<![\w.])" + re.escape(at.group()) + rb"(?![\w.])", lambda _: new, data)
    return data[: at.start()] + new + data[at.end() :]


def scaled(data: bytes, rng: Rng, _: Sequence[bytes]) -> bytes:
    """One number times a factor such as a wrong unit brings."""
    found = list(_NUMBER.finditer(data))
    if not found:
        return data
    at = one(rng, found)
    factor = one(rng, (-1.0, 0.0, 1e-3, 1e3, 25.4, 180.0 / 3.141592653589793, 1e9, 1e-9, 2.0, 1.0 + 1e-12))
    return data[: at.start()] + repr(float(at.group()) * factor).encode() + data[at.end() :]


def word(data: bytes, rng: Rng, others: Sequence[bytes]) -> bytes:
    """One word replaced by a text or by another word of the files."""
    found = list(_WORD.finditer(data))
    if not found:
        return insert(data, rng, others)
    at = one(rng, found)
    new = one(rng, TEXTS) if chance(rng, 0.4) else one(rng, found).group()
    return data[: at.start()] + new + data[at.end() :]


def line(data: bytes, rng: Rng, others: Sequence[bytes]) -> bytes:
    """Lines dropped, doubled, swapped, shuffled, or taken from another file."""
    lines = data.split(b"\n")
    i, j = below(rng, len(lines)), below(rng, len(lines))
    how = below(rng, 6)
    if how == 0:
        del lines[i]
    elif how == 1:
        lines.insert(j, lines[i])
    elif how == 2:
        lines[i], lines[j] = lines[j], lines[i]
    elif how == 3:
        start, end = span(rng, len(lines), 20)
        piece = lines[start:end]
        lines[start:end] = [piece[k] for k in rng.permutation(len(piece))]
    elif how == 4 and others:
        lines.insert(i, one(rng, one(rng, others).split(b"\n")))
    else:
        lines[i] = lines[i] + lines[j]
    return b"\n".join(lines)


PLAIN: tuple[Mutation, ...] = (
    flip,
    delete,
    duplicate,
    splice,
    truncate,
    insert,
    run_of_one,
    reencode,
    number,
    number,
    number,
    scaled,
    word,
    line,
    line,
)


def mutated(data: bytes, rng: Rng, others: Sequence[bytes], own: Sequence[Mutation] = ()) -> bytes:
    """One to five mutations: ``own`` ones of the kind of file first, as bytes that are broken would hide them."""
    rounds = 1 + min(4, int(rng.geometric(0.5)) - 1)
    structured = sum(chance(rng, 0.6) for _ in range(rounds)) if own else 0
    for k in range(rounds):
        data = one(rng, own if k < structured else PLAIN)(data, rng, others)[:LARGEST]
    return data


def members_of(data: bytes) -> dict[str, bytes]:
    """The members of a ZIP archive (XLSX, .npz) by name; none where it is damaged."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            return {name: archive.read(name) for name in archive.namelist()}
    except (zipfile.BadZipFile, OSError, ValueError, EOFError, NotImplementedError, RuntimeError):
        return {}
