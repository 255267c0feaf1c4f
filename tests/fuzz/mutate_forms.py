"""Mutations of XML, of programs made of words, of meshes, and of archives of arrays."""

from __future__ import annotations

import io
import re
import struct
import zipfile
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from lxml import etree  # type: ignore[import-untyped]
from numpy.typing import NDArray

from .mutate_bytes import Mutation, members_of
from .samples import NUMBERS, TEXTS, Rng, below, chance, one, span

_ATTRIBUTES = (
    b"0 0 0",
    b"0 0 1",
    b"1e200 1e200 1e200",
    b"nan 0 0",
    b"0 0",
    b"0 0 0 0",
    b"1e-320 0 0",
    b"fixed",
    b"revolute",
    b"continuous",
    b"prismatic",
    b"mimic",
    b"base_link",
    b"package://x/y.stl",
    b"file:///etc/passwd",
    b"1e308 1e308 1e308",
    b"${x}",
    b"$(arg x)",
)


def xml(data: bytes, rng: Rng, _: Sequence[bytes]) -> bytes:
    """An attribute dropped, swapped or replaced, an element doubled, moved (cycles among them), renamed or dropped."""
    try:
        root = etree.fromstring(data, etree.XMLParser(resolve_entities=False, no_network=True))
    except (etree.XMLSyntaxError, ValueError):
        return data
    elements = [e for e in root.iter() if isinstance(e.tag, str)]
    a, b = one(rng, elements), one(rng, elements)
    how = below(rng, 9)
    if how < 5:
        owners = [e for e in elements if e.attrib]
        if owners:
            a, b = one(rng, owners), one(rng, owners)
            _attribute(a, b, rng, how)
    elif a is root:
        return bytes(etree.tostring(root))
    elif how == 5:
        a.getparent().remove(a)
    elif how == 6:
        a.addnext(etree.fromstring(etree.tostring(a)))
    elif how == 7:
        if a not in b.iterancestors() and a is not b:
            b.append(a)
    else:
        a.tag = one(rng, ("link", "joint", "origin", "axis", "mesh", "xacro:macro".replace(":", "_"), b.tag))
    return bytes(etree.tostring(root))


def _attribute(a: etree._Element, b: etree._Element, rng: Rng, how: int) -> None:
    key, other = one(rng, list(a.attrib)), one(rng, list(b.attrib))
    if how == 0:
        del a.attrib[key]
    elif how == 1:
        # The same attribute elsewhere: names used twice, parents that are their own children.
        same = [e for e in a.getroottree().iter() if isinstance(e.tag, str) and key in e.attrib]
        a.set(key, one(rng, same).get(key))
    elif how == 2:
        a.set(key, b.get(other))
    else:
        text = one(rng, (*_ATTRIBUTES, *NUMBERS, *TEXTS)).decode("utf-8", errors="ignore")
        a.set(key, re.sub(r"[\x00-\x08\x0b\x0c\x0e-\x1f\ufffe\uffff]", "?", text))


GCODE = (
    b"G0",
    b"G1 X1 Y2 Z3",
    b"G2 X10 Y0 I5 J0",
    b"G3 X0 Y0 R-5",
    b"G2 X0 Y0 I0 J0 K1",
    b"G17",
    b"G18",
    b"G20",
    b"G21",
    b"G28",
    b"G40",
    b"G41 D1",
    b"G43 H1",
    b"G43.4 H1",
    b"G54",
    b"G68 R90",
    b"G81 Z-5 R2 F100",
    b"G83 Z-50 Q1e-9 R2",
    b"G90",
    b"G91",
    b"G92 X0",
    b"G93",
    b"G94",
    b"G95",
    b"G98",
    b"M3 S1e9",
    b"M6 T1",
    b"M30",
    b"M98 P1000 L999999",
    b"F0",
    b"F1e308",
    b"(",
    b")",
    b"%",
    b"/",
    b"O1000",
    b"#1=5",
    b"X#1",
    b"G4 P1e300",
    b"G1 A1e9 B90 C-90",
    b"TRAORI",
    b"N" + b"9" * 400,
    b"G" + b"9" * 400,
    b"G1 X1e200 Y1e200",
    b"G90.1",
    b"G2 X1 I1e-200",
)
APT = (
    b"GOTO/1,2,3",
    b"GOTO/1,2,3,0,0,0",
    b"GOTO/1e200,0,0,0,0,1",
    b"GODLTA/1,1,1",
    b"FEDRAT/0,MMPM",
    b"FEDRAT/1e308,IPM",
    b"FEDRAT/0.1,MMPR",
    b"RAPID",
    b"SPINDL/RPM,1e308,CLW",
    b"UNITS/INCHES",
    b"UNITS/MM",
    b"MULTAX/ON",
    b"CIRCLE/0,0,0,0,0,1,5",
    b"CIRCLE/0,0,0,0,0,0,5",
    b"CYCLE/DRILL,DEPTH,10,MMPM,100,CLEAR,3",
    b"CYCLE/DEEP,10,STEP,1e-9",
    b"CYCLE/OFF",
    b"MSYS/0,0,0,1,0,0,0,1,0",
    b"MSYS/0,0,0,0,0,0,0,0,0",
    b"TRANS/1e308,0,0",
    b"ORIGIN/1,2,3",
    b"LOADTL/" + b"9" * 400,
    b"TLDATA/MILL,nan,0,0,0,0",
    b"CUTTER/1e308",
    b"PAINT/COLOR,1",
    b"FINI",
    b"INDIRV/0,0,1",
    b"TLON,GOFWD/ (CIRCLE/0,0,0,$",
    b"END-OF-PATH",
    b"$$",
    b"COPY/1,SAME,999999",
    b"ARCSLP/ON",
    b"MOVARC/0,0,0,0,0,1,5,ANGLE,1e9",
    b"GOTO/$",
    b"PPRINT/" + b"x" * 3000,
)
_PIECE = re.compile(rb"[A-Za-z_$%#]+|[-+]?[\d.]+(?:[eE][-+]?\d+)?|\s+|.", re.S)


def words(vocabulary: Sequence[bytes]) -> Mutation:
    """A mutation of programs: words and lines of the language in wrong places, huge numbers, blocks in other orders."""
    return partial(_words, vocabulary=tuple(vocabulary))


def _words(data: bytes, rng: Rng, others: Sequence[bytes], vocabulary: tuple[bytes, ...]) -> bytes:
    lines = data.split(b"\n")
    i = below(rng, len(lines))
    how = below(rng, 6)
    if how == 0 and vocabulary:
        lines.insert(i, one(rng, vocabulary))
    elif how == 1 and vocabulary:
        lines[i] = lines[i] + one(rng, (b" ", b"", b",")) + one(rng, vocabulary)
    elif how == 2:
        start, end = span(rng, len(lines), 8)
        block = lines[start:end]
        del lines[start:end]
        at = below(rng, len(lines) + 1)
        lines[at:at] = block
    elif how == 3:
        del lines[len(lines) - 1 - below(rng, min(4, len(lines))) :]
    else:
        pieces = _PIECE.findall(lines[i])
        if pieces:
            k = below(rng, len(pieces))
            pieces[k : k + 1] = one(
                rng, ([], [pieces[k]] * 2, [one(rng, NUMBERS)], [one(rng, pieces)], [b"-" + pieces[k]])
            )
            lines[i] = b"".join(pieces)
    return b"\n".join(lines)


_FLOATS = (np.nan, np.inf, -np.inf, 1e38, -1e38, 1e-45, 0.0, -0.0, 1e20, 1e-20)


def binary_stl(data: bytes, rng: Rng, _: Sequence[bytes]) -> bytes:
    """A binary STL with a wrong count, odd corners, flat, swapped or doubled triangles."""
    if len(data) < 84 or data[:5] == b"solid":
        return data
    out = bytearray(data)
    count = (len(out) - 84) // 50
    how = below(rng, 4)
    if how == 0 or not count:
        out[80:84] = struct.pack("<I", one(rng, (0, 1, count - 1 if count else 0, count + 1, 2**31, 2**32 - 1)))
    elif how == 1:
        at = 84 + 50 * below(rng, count) + 12 + 4 * below(rng, 9)
        out[at : at + 4] = struct.pack("<f", one(rng, _FLOATS))
    elif how == 2:
        at = 84 + 50 * below(rng, count) + 12
        out[at + 12 : at + 24] = out[at : at + 12]
    else:
        a, b = 84 + 50 * below(rng, count), 84 + 50 * below(rng, count)
        out[a : a + 50], out[b : b + 50] = out[b : b + 50], out[a : a + 50]
    return bytes(out)


def arrays(data: bytes, rng: Rng, _: Sequence[bytes]) -> bytes:
    """One array of an .npz dropped, of another type or shape, with odd numbers, or with a false head."""
    members = members_of(data)
    if not members:
        return data
    name = one(rng, list(members))
    how = below(rng, 6)
    if how == 0:
        del members[name]
    elif how == 1:
        members[name] = re.sub(rb"'shape': \([^)]*\)", one(rng, _SHAPES), members[name])
    else:
        try:
            array = np.load(io.BytesIO(members[name]), allow_pickle=False)
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, one(rng, _ARRAYS)(array, rng), allow_pickle=False)
            members[name] = buffer.getvalue()
        except Exception:  # a head that an earlier mutation spoilt: NumPy raises whatever its parser does
            return data
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for key, content in members.items():
            archive.writestr(zipfile.ZipInfo(key), content)
    return buffer.getvalue()


_SHAPES = (b"'shape': (99999999999,)", b"'shape': (-1,)", b"'shape': ()", b"'shape': (0,)", b"'shape': (3, 3)")


def _odd_entry(array: NDArray[np.generic], rng: Rng) -> NDArray[np.generic]:
    out = array.copy()
    if out.size and out.dtype.kind in "fiu":
        with np.errstate(all="ignore"):
            value = one(rng, _FLOATS) if out.dtype.kind == "f" else one(rng, (0, 1, 99999))
            out.reshape(-1)[below(rng, out.size)] = value
    return out


def _retyped(array: NDArray[np.generic], rng: Rng) -> NDArray[np.generic]:
    with np.errstate(all="ignore"):
        return np.asarray(array).astype(one(rng, ("f4", "i8", "U10", "c16", "?", "S5", "u1")))


_ARRAYS: tuple[Callable[[NDArray[np.generic], Rng], NDArray[np.generic]], ...] = (
    _odd_entry,
    _odd_entry,
    _retyped,
    lambda a, _: a.reshape(-1),
    lambda a, _: a[None],
    lambda a, rng: a[: below(rng, len(a))] if a.ndim else a,
    lambda a, rng: np.concatenate([a, a[-1:]]) if a.ndim and len(a) and chance(rng, 0.9) else np.zeros(0),
)
