"""Second interpreters of Heidenhain's language and of APT, statement by statement, that share no code with the readers.

Each takes one statement of the grammar that :mod:`tool_path_random` writes, and keeps what it makes: steps in mm and
mm/min. Anything outside the grammar raises :class:`RefusedError`. Written from the manuals, with complex numbers for
the plane and plain lists for frames, to go wrong in other ways than the readers do.
"""

from __future__ import annotations

import cmath
import math
import re
import sys
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import arithmetic

Triple = tuple[float, float, float]
NUMBER = r"[-+]?\d*[.,]?\d+"


class RefusedError(Exception):
    """A statement that must be refused."""


@dataclass
class Step:
    """What one motion does: its end, an arc's centre, axis and sweep in rad (0: a line), feed (None: rapid)."""

    line: int
    end: Triple
    feed: float | None
    axis: Triple = (0.0, 0.0, 1.0)
    centre: Triple | None = None
    about: Triple = (0.0, 0.0, 1.0)
    sweep: float = 0.0
    dwell: float = 0.0


def times(rows: list[Triple], v: Triple) -> Triple:
    """A matrix of rows times a vector."""
    x, y, z = (sum(a * b for a, b in zip(row, v, strict=True)) for row in rows)
    return x, y, z


def about(axis: int, deg: float) -> list[Triple]:
    """Rotation about a coordinate axis, as rows."""
    c, s = math.cos(math.radians(deg)), math.sin(math.radians(deg))
    rows = (
        [(1.0, 0.0, 0.0), (0.0, c, -s), (0.0, s, c)],
        [(c, 0.0, s), (0.0, 1.0, 0.0), (-s, 0.0, c)],
        [(c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)],
    )
    return list(rows[axis])


def product(a: list[Triple], b: list[Triple]) -> list[Triple]:
    """Two matrices of rows, one after the other."""
    columns = [times(a, (b[0][k], b[1][k], b[2][k])) for k in range(3)]
    return [(columns[0][k], columns[1][k], columns[2][k]) for k in range(3)]


ONE: list[Triple] = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
PAIRS = {frozenset("XY"): (0, 1), frozenset("XZ"): (2, 0), frozenset("YZ"): (1, 2)}


@dataclass
class Klartext:
    """State of a Heidenhain control that matters to the path; :meth:`take` runs one statement."""

    inch: bool = False
    here: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    steps: list[Step] = field(default_factory=list)
    feed: float = math.nan
    auto: float = math.nan
    pole: list[float] | None = None
    pair: tuple[int, int] = (0, 1)
    radius: float = math.nan
    angle: float = math.nan
    way: complex | None = None
    left: bool | None = None
    shift: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    turned: float = 0.0
    plane: list[Triple] = field(default_factory=lambda: list(ONE))
    q: dict[int, float] = field(default_factory=dict)
    drill: dict[int, float] = field(default_factory=dict)
    modal: bool = False
    tcp: bool = False
    tool: Triple | None = None
    # A swivel has moved the axes.
    lost: bool = False
    # A line that RND or CHF may cut: (line, from, to, feed), and the corner that is asked for.
    held: tuple[int, list[float], list[float], float] | None = None
    corner: tuple[str, float, float | None, int] | None = None

    @property
    def unit(self) -> float:
        """The program's unit in mm."""
        return 25.4 if self.inch else 1.0

    def rows(self) -> list[Triple]:
        """The frame's rotation."""
        return product(about(2, self.turned), self.plane)

    def part(self, at: list[float]) -> Triple:
        """A place of the frame in the part."""
        x, y, z = times(self.rows(), (at[0], at[1], at[2]))
        return x + self.shift[0], y + self.shift[1], z + self.shift[2]

    def axis(self) -> Triple:
        """Where the tool points."""
        return self.tool or times(self.plane, (0.0, 0.0, 1.0))

    def move(self, line: int, to: list[float], feed: float | None, **more: object) -> None:
        """One step."""
        self.steps.append(Step(line, self.part(to), feed, self.axis(), **more))  # type: ignore[arg-type]
        self.here = list(to)

    def settle(self) -> None:
        """The line that was held is run to its end."""
        if self.held is not None:
            line, _, end, feed = self.held
            self.held = None
            self.move(line, end, feed)

    def value(self, text: str) -> float:
        """A number or a parameter with a sign."""
        sign, text = (-1.0 if text[0] == "-" else 1.0), text.lstrip("+-").replace(",", ".")
        if text[0] == "Q":
            if int(text[1:]) not in self.q:
                raise RefusedError("no value")
            return sign * self.q[int(text[1:])]
        return sign * float(text)

    def take(self, line: int, text: str) -> None:
        """Run one statement without its number and comment."""
        head, _, rest = text.partition(" ")
        if head in ("RND", "CHF"):
            size, _, feed = rest.partition(" F")
            if self.held is None:
                raise RefusedError("no line")
            own = self.rate(feed) if feed else None
            self.corner = head, self.unit * self.value(size.lstrip("R")), own, line
            return
        if head in ("L", "LP", "LN", "C", "CP", "CR", "CT", "CTP", "CC"):
            self.motion(line, head, rest.split())
            return
        if self.corner:
            raise RefusedError("a corner without its second line")
        self.settle()
        if head == "Q" or re.match(r"Q\d+ =", text):
            name, formula = text.split(" = ")
            self.q[int(name[1:])] = self.formula(formula)
        elif text.startswith("FN "):
            self.function(text)
        elif text.startswith("CYCL DEF"):
            self.define(line, text.removeprefix("CYCL DEF "))
        elif text.startswith("TRANS DATUM"):
            self.datum(
                rest.removeprefix("DATUM ").removeprefix("AXIS ").split() if "RESET" not in text else ["X0", "Y0", "Z0"]
            )
        elif text.startswith("PLANE"):
            self.tilt(text)
        elif text.startswith("TOOL CALL"):
            for word in text.split()[3:]:
                if word[0] == "F":
                    self.feed = self.auto = self.rate(word[1:])
        elif text in ("M128", "M129"):
            self.tcp, self.tool = text == "M128", self.tool if text == "M128" else None
        elif text == "CYCL CALL":
            self.hole(line)
        elif re.fullmatch(r"M[3589]|\* .*|BLK FORM .*|LBL \d+|M12[67]|TOOL DEF \d+|STOP", text) is None:
            raise RefusedError(text)

    def rate(self, text: str) -> float:
        """A feed in mm/min; programs in inches have tenths of an inch."""
        return self.value(text) * (2.54 if self.inch else 1.0)

    def formula(self, text: str) -> float:
        """Sums, products, functions and brackets."""
        text = re.sub(r"Q(\d+)", lambda m: f"({self.q[int(m[1])]!r})", text.replace(",", "."))
        text = re.sub(r"\b(SIN|COS|SQRT|ABS|ATAN) (\(?[-+.\de]+\)?)", r"\1(\2)", text).replace("^", "**")
        names = {
            "SIN": lambda v: math.sin(math.radians(v)),
            "COS": lambda v: math.cos(math.radians(v)),
            "SQRT": math.sqrt,
            "ABS": abs,
            "ATAN": lambda v: math.degrees(math.atan(v)),
        }
        return float(arithmetic.value(text, names))

    def function(self, text: str) -> None:
        """FN 0 to FN 4."""
        match = re.fullmatch(r"FN (\d): Q(\d+) = (\S+)(?: (\+|-|\*|DIV) (\S+))?", text)
        if match is None:
            raise RefusedError(text)
        a, b = self.value(match[3]), self.value(match[5]) if match[5] else 0.0
        self.q[int(match[2])] = {"0": a, "1": a + b, "2": a - b, "3": a * b, "4": a / b if b else 0.0}[match[1]]

    # Motion

    def motion(self, line: int, head: str, words: list[str]) -> None:
        """L, LP, LN, CC and arcs."""
        v: dict[str, float] = {}
        misc: list[int] = []
        rapid, feed = False, None
        for word in words:
            if word in ("R0", "RL", "RR"):
                if word != "R0":
                    raise RefusedError(word)
            elif word in ("FMAX", "FAUTO"):
                rapid, feed = word == "FMAX", self.auto if word == "FAUTO" else feed
            elif word in ("DR+", "DR-"):
                v["DR"] = 1.0 if word == "DR+" else -1.0
            else:
                match = re.fullmatch(rf"(IPR|IPA|PR|PA|[NT][XYZ]|I?[XYZ]|R|M|F)({NUMBER}|[-+]?Q\d+)", word)
                if match is None or match[1] in v:
                    raise RefusedError(word)
                if match[1] == "M":
                    misc.append(int(match[2]))
                elif match[1] == "F":
                    feed = self.rate(match[2])
                else:
                    v[match[1]] = self.value(match[2])
        allowed = {
            "L": "X Y Z IX IY IZ",
            "LP": "PR PA IPR IPA X Y Z IX IY IZ",
            "LN": "X Y Z TX TY TZ NX NY NZ",
            "C": "X Y Z IX IY IZ DR",
            "CP": "PA IPA X Y Z IX IY IZ DR",
            "CR": "X Y Z IX IY IZ R DR",
            "CT": "X Y Z IX IY IZ",
            "CTP": "PR PA IPR IPA Z IZ",
            "CC": "X Y Z IX IY IZ",
        }[head]
        if (
            not v.keys() <= set(allowed.split())
            or set(misc) - {3, 5, 8, 9, 89, 99, 126, 127}
            or (rapid and head[0] == "C")
        ):
            raise RefusedError("a word without meaning")
        if any("I" + k in v and k in v for k in ("X", "Y", "Z", "PA", "PR")) or (
            head == "CC" and (misc or feed or rapid)
        ):
            raise RefusedError("twice")
        if self.corner and head not in ("L", "LP"):
            raise RefusedError("corner before an arc")
        if head not in ("L", "LP"):
            self.settle()
        # Where the tool will stand: the line that is held counts as run to its end.
        start = list(self.held[2]) if self.held else list(self.here)
        if head == "CC":
            self.centre(v, start)
            return
        turns = 0
        if head in ("LP", "CP", "CTP"):
            end, turns = self.polar(head, v, start)
        else:
            end = list(start)
        for k, letter in enumerate("XYZ"):
            if letter in v:
                end[k] = self.unit * v[letter]
            elif "I" + letter in v:
                end[k] = start[k] + self.unit * v["I" + letter]
        if "TX" in v:
            if not self.tcp:
                raise RefusedError("no TCP")
            size = math.hypot(v["TX"], v["TY"], v["TZ"])
            self.tool = times(self.rows(), (v["TX"] / size, v["TY"] / size, v["TZ"] / size))
        if feed is not None:
            self.feed = feed
        if head[0] == "L":
            self.straight(line, start, end, None if rapid else self.feed, misc, moved=bool(v))
        else:
            self.arc(line, head, v, start, end, turns)
        self.modal = self.modal or 89 in misc
        if 99 in misc or (self.modal and v):
            self.settle()
            self.hole(line)
        self.modal = self.modal and 99 not in misc

    def straight(
        self, line: int, start: list[float], end: list[float], feed: float | None, misc: list[int], *, moved: bool
    ) -> None:
        """A line; at feed and in X Y it may be cut short by the statement behind it."""
        if self.corner and self.held is not None:
            if feed is None or misc:
                raise RefusedError("corner before a rapid")
            self.cut(end)
        self.settle()
        if not moved:
            return
        here = list(self.here)
        if feed is not None and not misc:
            self.held = line, here, end, feed
        else:
            self.move(line, end, feed)
        if self.lost:
            self.lost, self.way = False, None
            return
        step = complex(end[0] - here[0], end[1] - here[1])
        if abs(step) > 1e-6 or abs(end[2] - here[2]) > 1e-6:
            self.way = step

    def cut(self, end: list[float]) -> None:
        """The corner between the line held and one to ``end``."""
        assert self.corner
        assert self.held
        (word, size, own, line), (first, start, mid, feed) = self.corner, self.held
        self.corner = self.held = None
        a, m, b = (complex(p[0], p[1]) for p in (start, mid, end))
        into, out = (m - a) / abs(m - a), (b - m) / abs(b - m)
        turn = cmath.phase(out / into)
        back = size if word == "CHF" else size * math.tan(abs(turn) / 2.0)
        p, q = m - back * into, m + back * out
        self.move(first, [p.real, p.imag, mid[2]], feed)
        to = [q.real, q.imag, mid[2]]
        if word == "CHF":
            self.move(line, to, own or feed)
            return
        c = p + into * 1j * math.copysign(size, turn)
        self.move(
            line,
            to,
            own or feed,
            centre=self.part([c.real, c.imag, mid[2]]),
            sweep=turn,
            about=times(self.rows(), (0.0, 0.0, 1.0)),
        )

    def centre(self, v: dict[str, float], start: list[float]) -> None:
        """CC."""
        if not v:
            self.pole = start
            return
        pole = list(self.pole or [math.nan] * 3)
        for name, value in v.items():
            k = "XYZ".index(name[-1])
            pole[k] = self.unit * value + (start[k] if name[0] == "I" else 0.0)
        axes = frozenset(name[-1] for name in v)
        if len(axes) > 2:
            raise RefusedError("three axes")
        self.pole, self.pair = pole, PAIRS.get(axes, self.pair)

    def polar(self, head: str, v: dict[str, float], start: list[float]) -> tuple[list[float], int]:
        """End of LP, CP and CTP, and turns of CP."""
        a, b = self.pair
        if self.pole is None or {"XYZ"[a], "XYZ"[b], "I" + "XYZ"[a], "I" + "XYZ"[b]} & v.keys():
            raise RefusedError("no pole, or its own plane")
        lever = complex(start[a] - self.pole[a], start[b] - self.pole[b])
        radius, angle = abs(lever), math.degrees(cmath.phase(lever))
        if head != "CP":
            if not (
                abs(radius - self.radius) < 1e-6 and abs(cmath.rect(1, math.radians(angle - self.angle)) - 1) < 1e-6
            ):
                if not ("PR" in v and "PA" in v):
                    raise RefusedError("a word left out")
            else:
                radius, angle = self.radius, self.angle
        if "PR" in v:
            radius = self.unit * v["PR"]
        radius += self.unit * v.get("IPR", 0.0)
        angle = v.get("PA", angle + v.get("IPA", 0.0))
        self.radius, self.angle = radius, angle
        end, to = list(start), cmath.rect(radius, math.radians(angle))
        end[a], end[b] = self.pole[a] + to.real, self.pole[b] + to.imag
        if head == "CP" and "IPA" in v:
            if "DR" in v and v["DR"] * v["IPA"] < 0.0:
                raise RefusedError("DR against IPA")
            v["DR"] = math.copysign(1.0, v["IPA"])
        return end, max(0, math.ceil(abs(v.get("IPA", 0.0)) / 360.0 - 1e-9) - 1) if head == "CP" else 0

    def arc(self, line: int, head: str, v: dict[str, float], start: list[float], end: list[float], turns: int) -> None:
        """An arc by its centre, its radius or its tangent."""
        if "DR" in v:
            self.left = v["DR"] > 0.0
        a, b = self.pair if head in ("C", "CP") else (0, 1)
        s, e = complex(start[a], start[b]), complex(end[a], end[b])
        if head in ("CT", "CTP"):
            if self.way is None or abs(self.way) < 1e-9:
                raise RefusedError("no direction")
            u = self.way / abs(self.way)
            side = ((e - s) / u).imag
            if abs(side) < 1e-9:
                raise RefusedError("straight ahead")
            c = s + u * 1j * abs(e - s) ** 2 / (2.0 * side)
            left = side > 0.0
        else:
            if self.left is None:
                raise RefusedError("no direction")
            left = self.left
            if head == "CR":
                r, half = self.unit * v["R"], abs(e - s) / 2.0
                if not 0.0 < half <= abs(r):
                    raise RefusedError("radius")
                # R above 0 is the shorter arc.
                sign = (1.0 if r > 0.0 else -1.0) * (1.0 if left else -1.0)
                c = (s + e) / 2.0 + (e - s) / abs(e - s) * 1j * sign * math.sqrt(max(r * r - half * half, 0.0))
            else:
                if self.pole is None:
                    raise RefusedError("no centre")
                c = complex(self.pole[a], self.pole[b])
        sweep = cmath.phase((e - c) / (s - c)) % (2.0 * math.pi)
        if abs(e - s) < 1e-7:
            sweep = 2.0 * math.pi
        if not left:
            sweep = sweep - 2.0 * math.pi if sweep < 2.0 * math.pi - 1e-12 else -2.0 * math.pi
            sweep = sweep or -2.0 * math.pi
        sweep += math.copysign(2.0 * math.pi * turns, sweep)
        middle, normal = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
        middle[a], middle[b], middle[3 - a - b] = c.real, c.imag, start[3 - a - b]
        normal[3 - a - b] = 1.0
        self.way = 1j * (e - c) * (1.0 if sweep > 0.0 else -1.0) if (a, b) == (0, 1) else self.flat((e - c), a, b)
        self.move(
            line,
            end,
            self.feed,
            centre=self.part(middle),
            sweep=sweep,
            about=times(self.rows(), (normal[0], normal[1], normal[2])),
        )

    def flat(self, lever: complex, a: int, b: int) -> complex | None:
        """Arcs of other planes end in no direction that CT of this grammar goes on from."""
        return None

    # Cycles and frames

    def define(self, line: int, text: str) -> None:
        """Cycles 7, 9, 10 and drill cycles."""
        cycle, _, rest = text.partition(" ")
        if cycle in ("7.1", "7.2", "7.3"):
            self.datum([rest])
        elif cycle == "10.1":
            turned = self.value(rest.removeprefix("ROT"))
            at = self.part(self.here)
            self.turned = turned
            self.back(at)
        elif cycle == "9.1":
            self.steps[-1].dwell += self.value(rest.split()[1])
        elif cycle in ("200", "201", "203", "240"):
            self.modal = False
            given = {int(k): self.value(w) if w != "FMAX" else math.inf for k, w in re.findall(r"Q(\d+)=(\S+)", rest)}
            if given.keys() - {200, 201, 202, 203, 204, 206, 208, 210, 211, 213, 256, 212, 205, 343}:
                raise RefusedError("a parameter")
            if given.get(212) or given.get(343):
                raise RefusedError("pecks that get smaller, a depth by its diameter")
            self.drill = given | {0: float(cycle)}
            self.q |= {k: w for k, w in given.items() if math.isfinite(w)}
        elif not re.fullmatch(r"(?:7|9|10)\.0|32\.\d|13\.\d", cycle):
            raise RefusedError(text)

    def hole(self, line: int) -> None:
        """A drill cycle where the tool stands."""
        if not self.drill:
            raise RefusedError("no cycle")
        q, u, kind = self.drill, self.unit, int(self.drill[0])
        start, deep = u * (q[203] + q[200]), u * (q[203] + q[201])
        rate = q[206] * (2.54 if self.inch else 1.0)
        away: float | None = None
        if kind == 201 or (kind == 203 and 208 in q):
            away = rate if not q.get(208) else None if q[208] >= 99_999 else q[208] * (2.54 if self.inch else 1.0)

        def go(z: float, feed: float | None, dwell: float = 0.0) -> None:
            self.move(line, [self.here[0], self.here[1], z], feed, dwell=dwell)

        if abs(self.here[2] - start) > 1e-6:
            go(start, None)
        peck = u * q.get(202, 0.0) if kind in (200, 203) else 0.0
        at, count = u * q[203], 0
        while peck > 0.0 and at - peck > deep + 1e-6:
            at, count = at - peck, count + 1
            go(at, rate)
            if kind == 203 and q.get(213) and count % (int(q[213]) + 1):
                go(min(at + u * q.get(256, 0.254 / u), start), None)
            else:
                go(start, away)
                go(min(at + u * q[200], start), None)
        go(deep, rate, q.get(211, 0.0))
        go(start, away)
        if q[204] > q[200]:
            go(u * (q[203] + q[204]), None)
        # What CT would go on from behind a hole, no manual says.
        self.way = None

    def datum(self, words: list[str]) -> None:
        """A datum shift by axes."""
        at = self.part(self.here)
        for word in words:
            name, value = re.match(r"I?[XYZ]", word)[0], self.unit * self.value(re.sub(r"^I?[XYZ]", "", word))  # type: ignore[index]
            k = "XYZ".index(name[-1])
            if self.plane != ONE and value:
                raise RefusedError("a shift inside a plane")
            new = value + (self.shift[k] if name[0] == "I" else 0.0)
            if self.turned and new != self.shift[k] and value:
                raise RefusedError("a shift in turned coordinates")
            self.shift[k] = new
        self.back(at)

    def tilt(self, text: str) -> None:
        """PLANE SPATIAL ... TURN and PLANE RESET TURN, behind which X, Y and Z are given."""
        if "SPATIAL" in text and self.turned:
            raise RefusedError("turned coordinates")
        a, b, c = (self.value(match[1]) if (match := re.search(rf"SP{k}({NUMBER})", text)) else 0.0 for k in "ABC")
        self.plane = product(about(2, c), product(about(1, b), about(0, a))) if "SPATIAL" in text else list(ONE)
        self.tool, self.lost = None, True
        self.forget()

    def forget(self) -> None:
        """Pole and direction belong to the coordinates of before."""
        self.pole, self.way, self.radius, self.angle = None, None, math.nan, math.nan

    def back(self, at: Triple) -> None:
        """The tool stays where it is in the part."""
        rows = self.rows()
        off = [at[k] - self.shift[k] for k in range(3)]
        self.here = [sum(rows[i][k] * off[i] for i in range(3)) for k in range(3)]
        self.forget()


@dataclass
class Apt:
    """State of an APT file that matters to the path; :meth:`take` runs one statement."""

    unit: float = 1.0
    here: Triple | None = None
    axis: Triple = (0.0, 0.0, 1.0)
    steps: list[Step] = field(default_factory=list)
    feed: float = math.nan
    per_turn: bool = False
    turns: float = 0.0
    rapid: bool = False
    circle: list[float] | None = None
    cycle: dict[str, float] | None = None
    pecks: bool = False

    def rate(self) -> float:
        """Feed in mm/min."""
        return self.feed * (abs(self.turns) if self.per_turn else 1.0)

    def go(self, line: int, end: Triple, feed: float | None, **more: object) -> None:
        """One step."""
        self.steps.append(Step(line, end, feed, self.axis, **more))  # type: ignore[arg-type]
        self.here = end

    def take(self, line: int, text: str) -> None:
        """Run one statement without its comment."""
        word, _, rest = text.replace(" ", "").partition("/")
        parts = rest.split(",") if rest else []
        numbers = [float(p) for p in parts if re.fullmatch(NUMBER, p)]
        minor = {p for p in parts if not re.fullmatch(NUMBER, p)}
        if word in ("GOTO", "FROM", "GODLTA"):
            if minor or len(numbers) not in ({1, 3} if word == "GODLTA" else {3, 6}):
                raise RefusedError(text)
            self.point(line, word, numbers)
        elif word == "CIRCLE":
            if minor or len(numbers) not in (6, 7):
                raise RefusedError(text)
            self.circle = [self.unit * n if k not in (3, 4, 5) else n for k, n in enumerate(numbers)]
        elif word == "FEDRAT":
            if len(numbers) != 1 or not minor <= {"MMPM", "MMPR", "IPM"} or len(minor) > 1:
                raise RefusedError(text)
            scale = {"MMPM": 1.0, "MMPR": 1.0, "IPM": 25.4}[minor.pop()] if (named := bool(minor)) else self.unit
            self.feed = numbers[0] * scale
            self.per_turn = "MMPR" in rest if named else self.per_turn
        elif word == "SPINDL":
            if minor - {"RPM", "CLW", "CCLW", "OFF", "ON", "LOW"} or len(numbers) > 1:
                raise RefusedError(text)
            self.turns = 0.0 if "OFF" in minor else numbers[0] if numbers else self.turns
        elif word == "RAPID":
            if parts:
                raise RefusedError(text)
            self.rapid = True
        elif word == "DELAY":
            self.steps[-1].dwell += numbers[0]
        elif word == "CYCLE":
            self.define(parts)
        elif word == "CUTCOM":
            if minor - {"LEFT", "RIGHT", "OFF", "XYPLAN"}:
                raise RefusedError(text)
        elif word == "LOADTL":
            if minor - {"ADJUST", "LENGTH", "MILL"}:
                raise RefusedError(text)
        elif word not in (
            "PPRINT",
            "PARTNO",
            "INTOL",
            "OUTTOL",
            "TPRINT",
            "SELECT",
            "COOLNT",
            "MULTAX",
            "PAINT",
            "FINI",
            "SEQNO",
        ):
            raise RefusedError(text)

    def point(self, line: int, word: str, n: list[float]) -> None:
        """GOTO, FROM and GODLTA."""
        u = self.unit
        if word == "GODLTA":
            if self.here is None:
                raise RefusedError("no place")
            step = [u * n[0] * a for a in self.axis] if len(n) == 1 else [u * a for a in n]
            end = tuple(a + b for a, b in zip(self.here, step, strict=True))
            self.go(line, end, None if self.rapid else self.rate())  # type: ignore[arg-type]
            self.rapid = False
            return
        if len(n) == 6:
            size = math.hypot(*n[3:])
            self.axis = n[3] / size, n[4] / size, n[5] / size
        end = u * n[0], u * n[1], u * n[2]
        if word == "FROM":
            self.rapid = True
        if self.cycle is not None and word == "GOTO":
            self.hole(line, end)
        elif self.circle is not None:
            self.arc(line, end)
        else:
            self.go(line, end, None if self.rapid else self.rate())
        self.rapid = False

    def arc(self, line: int, end: Triple) -> None:
        """Right-handed about the vector of CIRCLE, in the plane X Y."""
        assert self.circle
        assert self.here
        c, up = complex(*self.circle[:2]), self.circle[5]
        s, e = complex(*self.here[:2]) - c, complex(*end[:2]) - c
        sweep = (cmath.phase(e / s) * up) % (2.0 * math.pi) or 2.0 * math.pi
        if abs(e - s) < 1e-7:
            sweep = 2.0 * math.pi
        self.go(line, end, None if self.rapid else self.rate(), centre=(c.real, c.imag, self.here[2]), sweep=up * sweep)
        self.circle = None

    def define(self, parts: list[str]) -> None:
        """A drill cycle, or its end."""
        if parts == ["OFF"]:
            self.cycle = None
            return
        kind, rest = parts[0], parts[1:]
        if rest and rest[0] == "DEEP":
            kind, rest = "DEEP", rest[1:]
        words, values = rest[::2], rest[1::2]
        if kind not in ("DRILL", "DEEP") or len(set(words)) < len(words) or len(words) != len(values):
            raise RefusedError("cycle")
        self.cycle = {
            w: float(v) * (self.unit if w != "DWELL" and w != "MMPM" else 1.0)
            for w, v in zip(words, values, strict=True)
        }
        self.pecks = kind == "DEEP"
        if set(words) - {"FEDTO", "RAPTO", "RTRCTO", "STEP", "DWELL", "MMPM"} or ("STEP" in words and not self.pecks):
            raise RefusedError("cycle")

    def hole(self, line: int, p: Triple) -> None:
        """A hole along the tool's axis."""
        q = self.cycle
        assert q is not None
        a = self.axis
        begin, deep, back = q.get("RAPTO", 0.0), -abs(q["FEDTO"]), q.get("RTRCTO", -math.inf)
        rate = q.get("MMPM", self.rate())

        def go(h: float, feed: float | None, dwell: float = 0.0, at: Triple = p) -> None:
            self.go(line, (at[0] + h * a[0], at[1] + h * a[1], at[2] + h * a[2]), feed, dwell=dwell)

        above = begin
        if self.here is not None:
            above = sum((h - b) * k for h, b, k in zip(self.here, p, a, strict=True))
            if above < begin - 1e-6:
                go(begin - above, None, at=self.here)
        travel = max(above, begin)
        if self.here is None or math.dist(self.here, [b + travel * k for b, k in zip(p, a, strict=True)]) > 1e-6:
            go(travel, None)
        if travel > begin + 1e-6:
            go(begin, None)
        at = begin
        while self.pecks and "STEP" in q and at - q["STEP"] > deep + 1e-6:
            at -= q["STEP"]
            go(at, rate)
            go(begin, None)
            go(min(at + 0.254, begin), None)
        go(deep, rate, q.get("DWELL", 0.0))
        go(begin, None)
        if back > begin:
            go(back, None)
