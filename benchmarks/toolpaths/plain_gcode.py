"""A plain interpreter of three-axis G-code that shares no code with the project's reader; written from the manuals.

:func:`moves` gives the moves (:class:`moves_compared.Move`, mm and mm/min) of a program in one of three dialects:
"fanuc", "linuxcnc", "siemens". What is not in its grammar is a ValueError: G0 to G3 in three planes, G90 and G91 with
the centres' own (G90.1, G91.1), inches, one work offset, G52, G92 with its variants, G68, drill cycles, corners (,R ,C;
RND RNDM CHF CHR), polar words and ANG, AC() and IC(), programmable frames, diameters, calls of subprograms in the file.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field

from moves_compared import Corner, Move, cornered, direction

DIALECTS = ("fanuc", "linuxcnc", "siemens")
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)"
ISO_WORD = re.compile(rf"\s*(,?[A-Z])\s*({NUMBER})")
SIEMENS_WORD = re.compile(
    rf"\s*(?:([A-Z]+\d*)\s*=\s*(?:(AC|IC)\(\s*({NUMBER})\s*\)|({NUMBER}))|([A-Z])\s*({NUMBER})|([A-Z]{{3,}}|CT\b))"
)
AXES = "XYZ"
# Words that change nothing about the path; G54 is the only work offset.
NOTHING = {"G40", "G49", "G54", "G64", "G61", "G43", "G80", "G69", "G71", "G642", "G601", "G9", "G17.0"}
NO_MOTION = {"M0", "M1", "M6", "M7", "M8", "M9"}


@dataclass(frozen=True)
class Turned:
    """Coordinates of a block in the work offset: turned by ``angle`` rad about z, then shifted."""

    angle: float = 0.0
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def out(self, p: list[float]) -> list[float]:
        """A point of the frame in the work offset."""
        c, s = math.cos(self.angle), math.sin(self.angle)
        return [c * p[0] - s * p[1] + self.shift[0], s * p[0] + c * p[1] + self.shift[1], p[2] + self.shift[2]]

    def into(self, p: list[float]) -> list[float]:
        """A point of the work offset in the frame."""
        x, y, z = (a - b for a, b in zip(p, self.shift, strict=True))
        c, s = math.cos(self.angle), math.sin(self.angle)
        return [c * x + s * y, -s * x + c * y, z]


@dataclass
class Words:
    """One block: codes as written (G1, M3), the other words in mm as yet unscaled, which of them are AC or IC."""

    codes: list[str] = field(default_factory=list)
    values: dict[str, float] = field(default_factory=dict)
    own: dict[str, str] = field(default_factory=dict)
    names: list[str] = field(default_factory=list)


def split(line: str, dialect: str) -> Words:
    """Words of a line."""
    text = re.sub(r"\([^()]*\)", " ", line) if dialect != "siemens" else line
    text = text.partition(";")[0].strip().upper()
    out, at = Words(), 0
    pattern = SIEMENS_WORD if dialect == "siemens" else ISO_WORD
    while at < len(text):
        match = pattern.match(text, at)
        if match is None:
            raise ValueError(f"no word: {text[at:]}")
        at = match.end()
        if dialect == "siemens":
            long, way, own, number, letter, short, name = match.groups()
            if name:
                out.names.append(name)
                continue
            letter, value = (long, own or number) if long else (letter, short)
            if way:
                out.own[letter] = way
        else:
            letter, value = match.groups()
        if letter in ("G", "M"):
            out.codes.append(f"{letter}{float(value):g}")
        elif letter in out.values:
            raise ValueError(f"{letter} twice")
        else:
            out.values[letter] = float(value)
    out.values.pop("N", None)
    return out


def sections(text: str, dialect: str) -> tuple[list[str], dict[str, list[str]]]:
    """Lines of the program and of its subprograms by number or name."""
    main, subs, here = [], {}, None
    for line in text.splitlines():
        if found := re.match(r"%_N_(\w+)_SPF", line) if dialect == "siemens" else re.match(r"O0*(\d+)\s*$", line):
            # The first O of a file is its own.
            here = subs.setdefault(found[1], []) if main or dialect == "siemens" else None
        elif not line.startswith("%"):
            (main if here is None else here).append(line)
    return main, subs


def moves(text: str, dialect: str, start: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> list[Move]:
    """Moves of a program that begins at ``start`` mm."""
    if dialect not in DIALECTS:
        raise ValueError(dialect)
    main, subs = sections(text, dialect)
    one = Interpreter(dialect, subs, list(start))
    one.run(main)
    return cornered(one.made, one.corners, start)


class Interpreter:
    """State of the control and what it has moved."""

    def __init__(self, dialect: str, subs: dict[str, list[str]], start: list[float]) -> None:
        self.dialect, self.subs, self.base = dialect, subs, start
        self.frame = Turned()
        self.made: list[Move] = []
        # Corner behind the move of this index.
        self.corners: dict[int, Corner] = {}
        self.next_corner: Corner | None = None
        self.modal_corner = 0.0
        self.motion, self.normal, self.unit, self.feed = "", 2, 1.0, math.nan
        self.absolute, self.centre_absolute, self.diameter = True, False, False
        # LinuxCNC begins with what its configuration says.
        self.initial_back: bool | None = None if dialect == "linuxcnc" else True
        self.initial, self.cycle = math.nan, dict[str, float]()
        self.kept: tuple[float, float, float] = (0.0, 0.0, 0.0)
        self.family = ""
        self.feed_mode, self.speed, self.turning = "G94", math.nan, False
        # Feed of corners: of one, of all to come.
        self.corner_feed = math.nan
        # MCALL: heights that each place to come is drilled between.
        self.holes: list[float] = []
        self.pole, self.polar = [0.0, 0.0], [0.0, 0.0]
        self.depth, self.over = 0, False

    @property
    def at(self) -> list[float]:
        """Where the tool is, in the frame in force, mm."""
        return self.frame.into(self.base)

    def run(self, lines: list[str]) -> None:
        """Do blocks up to the end of the program or subprogram."""
        if self.depth > 8:
            raise ValueError("calls within calls")
        for line in lines:
            if self.over:
                return
            if self.do(line):
                return

    def do(self, line: str) -> bool:
        """Do a line; whether it ends the program or subprogram."""
        if self.dialect == "siemens" and self._cycle81(line):
            return False
        return self.block(split(line, self.dialect))

    def block(self, w: Words) -> bool:
        """Do one block; whether it ends the program or subprogram."""
        for group in GROUPS:
            if len([c for c in w.codes if c in group]) > 1:
                raise ValueError(f"two of {group}")
        called = self._called(w)
        if "S" in w.values:
            self.speed = w.values.pop("S")
        for code in w.codes:
            self._mode(code, w)
        if "F" in w.values and "G4" not in w.codes:
            self.feed = w.values.pop("F") * (1.0 if self.feed_mode == "G93" else self.unit)
            if self.feed <= 0:
                raise ValueError("feed")
        for letter in ("T", "D", "H"):
            w.values.pop(letter, None)
        if "G4" in w.codes:
            if w.values.keys() - {"P", "F"} or len(w.values) != 1:
                raise ValueError("a dwell with other words")
            w.values.clear()
        self._frames(w)
        self._modal_corners(w)
        if w.values:
            self._moved(w)
        if self.feed_mode == "G93":
            # It holds in its own block alone.
            self.feed = math.nan
        if called:
            name, times = called
            self.depth += 1
            for _ in range(times):
                self.run(self.subs[name])
            self.depth -= 1
        if set(w.codes) & {"M30", "M2"}:
            self.over = True
        return bool(set(w.codes) & {"M30", "M2", "M99", "M17"}) or "RET" in w.names

    def _called(self, w: Words) -> tuple[str, int] | None:
        """A subprogram that the block calls, and how often."""
        if self.dialect == "siemens":
            name = f"L{w.values.pop('L'):.0f}" if "L" in w.values else next((n for n in w.names if n in self.subs), "")
            if not name:
                return None
            w.names = [n for n in w.names if n != name]
            times = int(w.values.pop("P", 1))
        elif "M98" in w.codes:
            if "P" not in w.values:
                raise ValueError("M98 without P")
            number = f"{w.values.pop('P'):.0f}"
            times = int(w.values.pop("L", 1))
            if self.dialect == "fanuc" and len(number) > 4:
                number, times = str(int(number[-4:])), int(number[:-4])
            name = number
        else:
            return None
        if name not in self.subs:
            raise ValueError(f"no subprogram {name}")
        return name, times

    def _mode(self, code: str, w: Words) -> None:
        siemens = self.dialect == "siemens"
        if code in ("G0", "G1", "G2", "G3"):
            self.motion = code
        elif code in ("G17", "G18", "G19"):
            if self.frame.angle and code != "G17":
                raise ValueError("another plane in turned coordinates")
            self.normal = {"G17": 2, "G18": 1, "G19": 0}[code]
        elif code in ("G90", "G91"):
            self.absolute = code == "G90"
        elif code in ("G90.1", "G91.1") and not siemens:
            self.centre_absolute = code == "G90.1"
        elif code in ("G20", "G21") and not siemens:
            unit = 25.4 if code == "G20" else 1.0
            # What a feed means behind another unit is not asked.
            self.feed = self.feed if unit == self.unit else math.nan
            self.unit = unit
        elif code in ("G98", "G99") and not siemens:
            self.initial_back = code == "G98"
        elif code in ("G81", "G82", "G83") and not siemens:
            if self.motion not in ("G81", "G82", "G83"):
                self.initial, self.cycle = self.at[2], {}
            self.motion = code
        elif code in ("G93", "G94", "G95") and not (siemens and code == "G93"):
            self.feed = self.feed if code == self.feed_mode else math.nan
            self.feed_mode = code
        elif code in ("M3", "M4", "M5"):
            self.turning = code != "M5"
        elif code == "G80":
            self.motion = ""
        elif code not in NOTHING | NO_MOTION | {"G4", "M30", "M2", "M99", "M17"} | FRAMES[siemens]:
            if code == "M98" and not siemens:
                return
            raise ValueError(f"{code} is not in the grammar")

    def _frames(self, w: Words) -> None:
        """G52, G68, G92, TRANS, ROT and poles: what they take is no motion."""
        v, here = w.values, self.at
        point = {k: v[a] * self.unit for k, a in enumerate(AXES) if a in v}
        shift = list(self.frame.shift)
        for name in [*(c for c in w.codes if c in FRAMES[0] | FRAMES[1]), *w.names]:
            if name == "RET":
                continue
            if name in ("G52", "G92", "G92.1", "G92.2", "G92.3", "G68", "G69"):
                self._family("G68" if name in ("G68", "G69") else name[:3])
            if name == "G52":
                self.frame = Turned(0.0, tuple(point.get(k, s) for k, s in enumerate(shift)))
            elif name == "G92":
                moved = tuple(s + here[k] - point.get(k, here[k]) for k, s in enumerate(shift))
                self.frame, self.kept = Turned(0.0, moved), moved
            elif name in ("G92.1", "G92.2"):
                # G92.2 keeps for G92.3 what the last G92 has set.
                self.kept = self.kept if name == "G92.2" else (0.0, 0.0, 0.0)
                self.frame = Turned()
            elif name == "G92.3":
                self.frame = Turned(0.0, self.kept)
            elif name == "G68":
                if self.normal != 2 or not self.absolute or self.frame != Turned():
                    raise ValueError("G68 as this grammar has it not")
                c = [point.get(k, here[k]) for k in (0, 1)]
                turn = Turned(math.radians(v["R"]))
                back = turn.out([*c, 0.0])
                self.frame = Turned(turn.angle, (c[0] - back[0], c[1] - back[1], 0.0))
            elif name == "G69":
                self.frame = Turned() if self.frame.angle else self.frame
            elif name in ("TRANS", "ATRANS", "ROT", "AROT"):
                old = self.frame if name[0] == "A" else Turned()
                move = [point.get(k, 0.0) for k in range(3)]
                angle = math.radians(v.get("RPL", 0.0)) if "ROT" in name else 0.0
                if (
                    self.normal != 2
                    or self.diameter
                    or ("ROT" in name and (point or ("RPL" not in v and name[0] == "A")))
                ):
                    raise ValueError(f"{name} as this grammar has it not")
                self.frame = Turned(old.angle + angle, tuple(old.out(move)))
            elif name in ("G110", "G111", "G112"):
                origin = {"G110": here[:2], "G111": [0.0, 0.0], "G112": self.pole}[name]
                self.pole = [origin[k] + point.get(k, 0.0 if name != "G111" else self.pole[k]) for k in (0, 1)]
            elif name in ("CIP", "CT"):
                self.motion = name
                continue
            elif name in ("DIAMON", "DIAMOF"):
                self.diameter = name == "DIAMON"
                continue
            else:
                raise ValueError(f"{name} is not in the grammar")
            v.clear()

    def _family(self, name: str) -> None:
        """How offsets of two kinds add differs from control to control: one kind a program."""
        if self.family not in ("", name) and name != "G68":
            raise ValueError(f"{name} beside {self.family}")
        self.family = name

    def _modal_corners(self, w: Words) -> None:
        v = w.values
        if "RNDM" in v:
            self.modal_corner = v.pop("RNDM")
        v.pop("ADIS", None)
        if "FRCM" in v:
            self.corner_feed = v.pop("FRCM") or math.nan
        feed = v.pop("FRC", self.corner_feed)
        given = [k for k in (",R", ",C", "RND", "CHF", "CHR") if k in v]
        if len(given) > 1 or (given and (not self.motion or len(v) < 2)):
            raise ValueError("corners")
        self.next_corner = Corner(given[0].strip(","), v.pop(given[0]) * self.unit, feed) if given else None
        if self.next_corner is None and self.modal_corner:
            self.next_corner = Corner("RNDM", self.modal_corner, feed)

    # Motion

    def _moved(self, w: Words) -> None:
        if self.motion in ("G81", "G82", "G83"):
            self._hole(w)
            return
        if self.motion in ("CIP", "CT"):
            self._through(w)
            return
        if self.motion not in ("G0", "G1", "G2", "G3"):
            raise ValueError(f"words without motion: {w.values}")
        v, here = w.values, self.at
        end, radius_words = self._end(w, here), {"R", "CR"} & v.keys()
        arc = self.motion in ("G2", "G3")
        polar = bool({"AP", "RP"} & v.keys())
        turns_word = "TURN" if self.dialect == "siemens" else "P"
        used = {*AXES, "AP", "RP", "ANG"} | ({"I", "J", "K", "R", "CR", "AR", turns_word} if arc else set())
        if v.keys() - used or (arc and "ANG" in v) or (polar and set("XYIJKR") & v.keys()):
            raise ValueError(f"words without a meaning here: {v}")
        if not arc:
            self._put(Move(tuple(self.frame.out(end)), self.motion == "G0", self._speed(math.dist(here, end))))
            if self.holes:
                self._drill(end[:2])
            return
        sense = -1 if self.motion == "G2" else 1
        if polar:
            centre = [*self.pole, here[2]]
        elif radius_words:
            if set("IJK") & v.keys():
                raise ValueError("R and I J K")
            centre = self._from_radius(here, end, v[radius_words.pop()] * self.unit, sense)
        else:
            if "AR" in v and set("XYZ") & v.keys():
                centre = self._from_angle(here, end, math.radians(v["AR"]), sense)
            else:
                centre = self._from_offsets(here, w)
                if "AR" in v:
                    end = self._turned(here, centre, sense * math.radians(v["AR"]))
        u, q = self._flat
        middle = centre[u], centre[q]
        if abs(math.dist((here[u], here[q]), middle) - math.dist((end[u], end[q]), middle)) > 5e-3:
            raise ValueError("radii of an arc differ")
        turns = int(v.get("TURN", 0)) if turns_word == "TURN" else int(v.get("P", 1)) - 1
        ends = tuple(self.frame.out(end)), tuple(self.frame.out(centre))
        if self.feed_mode == "G93" or self.holes:
            raise ValueError("an arc here")
        self._put(Move(ends[0], False, self._speed(0.0), ends[1], self.normal, sense, turns))

    def _speed(self, length: float) -> float:
        """Feed of a move, mm/min."""
        if self.feed_mode == "G94" or self.motion == "G0":
            return self.feed
        if math.isnan(self.feed):
            raise ValueError("a feed of another kind")
        if self.feed_mode == "G93":
            return self.feed * length
        if not self.turning or math.isnan(self.speed):
            raise ValueError("a feed per turn without a turn")
        return self.feed * self.speed

    def _turned(self, here: list[float], centre: list[float], angle: float) -> list[float]:
        u, q = self._flat
        x, y, end = here[u] - centre[u], here[q] - centre[q], list(here)
        end[u] = centre[u] + math.cos(angle) * x - math.sin(angle) * y
        end[q] = centre[q] + math.sin(angle) * x + math.cos(angle) * y
        return end

    def _from_angle(self, here: list[float], end: list[float], angle: float, sense: int) -> list[float]:
        """Centre of an arc with a given opening angle between two points."""
        u, q = self._flat
        chord = math.dist((here[u], here[q]), (end[u], end[q]))
        radius = chord / (2 * math.sin(angle / 2))
        return self._from_radius(here, end, radius if angle <= math.pi else -radius, sense)

    def _through(self, w: Words) -> None:
        """CIP by way of a point, CT on from the move before; both in XY."""
        v, here = w.values, self.at
        end = self._end(w, here)
        flat = abs(end[2] - here[2]) < 1e-9 and self.normal == 2 and self.absolute and not self.diameter
        if not flat or v.keys() - {"X", "Y", "I1", "J1"} or ("I1" in v) != (self.motion == "CIP"):
            raise ValueError(f"{self.motion} as this grammar has it not")
        a, c = self.frame.out(here)[:2], self.frame.out(end)[:2]
        if self.motion == "CIP":
            b = self.frame.out([v["I1"], v["J1"], 0.0])[:2]
            bend = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
            sense = 1 if bend > 0 else -1
            # The centre is as far from all three.
            rows = [
                (2 * (p[0] - a[0]), 2 * (p[1] - a[1]), p[0] ** 2 + p[1] ** 2 - a[0] ** 2 - a[1] ** 2) for p in (b, c)
            ]
            det = rows[0][0] * rows[1][1] - rows[0][1] * rows[1][0]
            centre = (
                (rows[0][2] * rows[1][1] - rows[1][2] * rows[0][1]) / det,
                (rows[0][0] * rows[1][2] - rows[1][0] * rows[0][2]) / det,
            )
        else:
            before = self.made[-2].end
            if self.made[-1].rapid or abs(before[2] - self.made[-1].end[2]) > 1e-9:
                raise ValueError("CT behind no contour")
            d = direction(before, self.made[-1], a)
            x, y = c[0] - a[0], c[1] - a[1]
            # Left of the direction by r: as far from the end.
            left = -d[1] * x + d[0] * y
            if abs(left) < 1e-3:
                raise ValueError("CT straight on")
            r = (x * x + y * y) / (2 * left)
            centre, sense = (a[0] - r * d[1], a[1] + r * d[0]), 1 if r > 0 else -1
        z = self.base[2]
        self._put(Move((*c, z), False, self._speed(0.0), (*centre, z), 2, sense))

    def _drill(self, place: list[float]) -> None:
        """A Siemens cycle at a place."""
        back, start, bottom = self.holes
        self._put(Move(tuple(self.frame.out([*place, start])), True))
        self._put(Move(tuple(self.frame.out([*place, bottom])), False, self.feed))
        self._put(Move(tuple(self.frame.out([*place, back])), True))

    def _cycle81(self, line: str) -> bool:
        """CYCLE81 and CYCLE82, once or at each place to come; whether the block is one of these."""
        text = re.sub(r"^N\d+\s*", "", line.partition(";")[0].strip().upper())
        found = re.fullmatch(r"(MCALL\s+)?CYCLE8[12]\(([^()]*)\)|(MCALL)", text)
        if found is None:
            return False
        self.holes = []
        if found[3] is None:
            back, reference, safe, depth, *rest = [float(x) if x.strip() else math.nan for x in found[2].split(",")]
            bottom = reference - rest[0] if rest and not math.isnan(rest[0]) else depth
            if self.normal != 2 or self.diameter or not back >= reference + safe > bottom or back < self.at[2] - 1e-9:
                raise ValueError("a cycle as this grammar has it not")
            self.holes = [back, reference + safe, bottom]
            if not found[1]:
                self._drill(self.at[:2])
                self.holes = []
        return True

    @property
    def _flat(self) -> tuple[int, int]:
        """Axes of the plane, in the order that turns about its normal go."""
        return {2: (0, 1), 1: (2, 0), 0: (1, 2)}[self.normal]

    def _put(self, move: Move) -> None:
        if self.next_corner is not None and not move.rapid:
            self.corners[len(self.made)] = self.next_corner
        self.made.append(move)
        self.base = list(move.end)
        if len(self.made) > 100_000:
            raise ValueError("too many moves")

    def _end(self, w: Words, here: list[float]) -> list[float]:
        v, end = w.values, list(here)
        for k, letter in enumerate(AXES):
            if letter in v:
                value = v[letter] * self.unit * (0.5 if k == 0 and self.diameter else 1.0)
                way = w.own.get(letter, "AC" if self.absolute else "IC")
                end[k] = value if way == "AC" else here[k] + value
        if {"AP", "RP"} & v.keys():
            if "AP" in v:
                # Added to the angle at which the tool stands.
                old = math.degrees(math.atan2(here[1] - self.pole[1], here[0] - self.pole[0]))
                self.polar[1] = v["AP"] + (old if w.own.get("AP") == "IC" else 0.0)
            if "RP" in v:
                self.polar[0] = v["RP"]
            elif self.motion in ("G2", "G3"):
                self.polar[0] = math.dist(here[:2], self.pole)
            end[:2] = self._polar(self.pole, *self.polar)
        if "ANG" in v:
            t = math.tan(math.radians(v["ANG"]))
            if len(set("XY") & v.keys()) != 1:
                raise ValueError("ANG with one coordinate")
            if "X" in v:
                end[1] = here[1] + t * (end[0] - here[0])
            else:
                end[0] = here[0] + (end[1] - here[1]) / t
        return end

    @staticmethod
    def _polar(pole: list[float], radius: float, angle: float) -> list[float]:
        a = math.radians(angle)
        return [pole[0] + radius * math.cos(a), pole[1] + radius * math.sin(a)]

    def _from_offsets(self, here: list[float], w: Words) -> list[float]:
        centre, wrong = list(here), "IJK"[self.normal]
        if wrong in w.values or not set("IJK") & w.values.keys():
            raise ValueError("a centre")
        for k, letter in enumerate("IJK"):
            if letter in w.values:
                absolute = w.own.get(letter, "AC" if self.centre_absolute else "IC") == "AC"
                centre[k] = w.values[letter] * self.unit + (0.0 if absolute else here[k])
            elif self.centre_absolute and k != self.normal:
                raise ValueError("an absolute centre in part")
        return centre

    def _from_radius(self, here: list[float], end: list[float], radius: float, sense: int) -> list[float]:
        u, q = self._flat
        du, dq = end[u] - here[u], end[q] - here[q]
        chord = math.hypot(du, dq)
        if chord < 1e-6 or chord > 2 * abs(radius) + 1e-3:
            raise ValueError("a radius")
        height = math.sqrt(max(radius * radius - chord * chord / 4, 0.0))
        # Left of the chord for less than half a turn against the clock.
        side = sense * (1 if radius > 0 else -1)
        centre = list(here)
        centre[u] = here[u] + du / 2 - side * height * dq / chord
        centre[q] = here[q] + dq / 2 + side * height * du / chord
        return centre

    def _hole(self, w: Words) -> None:
        """A hole at each place: across, to R, to Z, back; R and Z stay in force."""
        v = w.values
        if v.keys() - set("XYZRQP") or self.initial_back is None or self.normal != 2 or not self.absolute:
            raise ValueError("a cycle as this grammar has it not")
        self.cycle |= {k: v[k] * (1.0 if k == "P" else self.unit) for k in "ZRQP" if k in v}
        x, y = (v[a] * self.unit if a in v else self.at[k] for k, a in enumerate("XY"))
        r, z = self.cycle["R"], self.cycle["Z"]
        back = max(self.initial, r) if self.initial_back else r
        if self.at[2] < r or z >= r:
            raise ValueError("a cycle from below R")
        top = self.frame.out([x, y, r])[2] if self.motion == "G83" else None
        for place in ([x, y, self.at[2]], [x, y, r]):
            self._put(Move(tuple(self.frame.out(place)), True))
        if self.feed_mode != "G94":
            raise ValueError("a cycle at another feed")
        self._put(Move(tuple(self.frame.out([x, y, z])), False, self.feed, top=top, peck=self.cycle.get("Q", 0.0)))
        self._put(Move(tuple(self.frame.out([x, y, back])), True))


# Codes of frames: of ISO dialects, of Siemens.
FRAMES = ({"G52", "G68", "G69", "G92", "G92.1", "G92.2", "G92.3"}, {"G110", "G111", "G112"})
GROUPS = (
    {"G0", "G1", "G2", "G3", "G80", "G81", "G82", "G83"},
    {"G17", "G18", "G19"},
    {"G90", "G91"},
    {"G90.1", "G91.1"},
    {"G20", "G21"},
    {"G93", "G94", "G95"},
    {"G98", "G99"},
)
