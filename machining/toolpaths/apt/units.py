"""How an APT line starts, and the unit of length of an APT file."""

from __future__ import annotations

from pathlib import Path

from machining.toolpaths.apt import words
from machining.toolpaths.options import UNITS, ReadOptions
from machining.toolpaths.recorder import Recorder
from machining.toolpaths.source import lines


def split_word(text: str) -> tuple[str, str]:
    """Major word in upper case, and what stands behind it."""
    head, slash, rest = text.partition("/")
    first, _, behind = text.strip().partition(" ")
    if first.upper() in words.TEXT_WORDS or not slash:
        return first.upper(), behind
    return " ".join(head.upper().split()).replace(", ", ",").replace(" ,", ","), rest


def length_unit(path: Path, options: ReadOptions, recorder: Recorder) -> float:
    """Metres in the unit of length: that of ``UNITS/`` before motion, else the option, else that of the feeds."""
    fed = moved = False
    for number, raw in enumerate(lines(path, options.max_bytes), start=1):
        text = raw.lstrip()
        if text.startswith("GOTO"):
            moved = True
            if options.units is not None:
                break
            continue
        head = text[:6].upper()
        if head.startswith("UNIT") and not moved:
            parts = words.items(split_word(text.split("$")[0])[1])
            if len(parts) == 1 and parts[0] in words.LENGTHS:
                return words.LENGTHS[parts[0]]
        elif head.startswith(("FEDRAT", "CYCLE")) and options.units is None:
            found = [w for w in words.items(text.strip().replace("/", ",")) if words.FEED_UNITS.get(w, (None,))[0]]
            if found and not fed:
                fed = True
                length = words.FEED_UNITS[found[0]][0] or 0.0
                unit = "mm" if length == UNITS["mm"] else "inch"
                recorder.note(number, f"no UNITS in the file: taken as {unit} from the feed unit {found[0]}")
                scale = UNITS[unit]
                if moved:
                    return scale
                fallback = scale
        if moved and fed:
            return fallback
    if options.units is not None:
        return UNITS[options.units]
    if fed:
        return fallback
    recorder.error(0, "no unit of length", allowed="UNITS/MM or UNITS/INCHES", remedy="pass units='mm' or 'inch'")
    return 1e-3
