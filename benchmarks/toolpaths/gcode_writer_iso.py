"""Blocks of random programs for Fanuc and LinuxCNC."""

from __future__ import annotations

import math
from collections.abc import Callable

from gcode_writer import Writer


class Iso(Writer):
    """What Fanuc and LinuxCNC share."""

    def parts(self) -> list[tuple[Callable[[], None], int]]:
        """Constructs, and how often each comes."""
        return [*super().parts(), (self.units, 1), (self.holes, 1), (self.call, 1), (self.frame, 2), (self.by_time, 1)]

    def units(self) -> None:
        """Another unit."""
        self.emit(self.chance.choice(["G20", "G21"]))

    def by_time(self) -> None:
        """Feed by the time of a block, which each has its own word for."""
        self.emit("G93")
        for _ in range(self.chance.randint(1, 3)):
            x, y = self.place()
            self.emit(f"{self.code('G1')}{self.to('X', x)} {self.to('Y', y)} F{self.chance.choice([2, 7.5, 30])}")
        self.emit(f"G94 F{self.chance.choice([200, 800])}")

    def holes(self) -> None:
        """A few holes from above."""
        if self.one.normal != 2:
            self.emit("G17")
        if not self.one.absolute:
            self.emit("G90")
        top = math.ceil(max(self.one.at[2], 0.0)) + self.chance.choice([2, 5])
        r = top - self.chance.choice([0, 1, 1.5])
        self.emit(f"G0 {self.to('Z', top)}")
        x, y = self.place()
        cycle = self.chance.choice(["G81", "G82", "G83"])
        words = f"{self.to('Z', r - self.chance.choice([3, 7.5]))} R{self.exact(r)}"
        words += {"G81": "", "G82": " P0.5", "G83": f" Q{self.exact(2)}"}[cycle]
        feed = f" F{self.chance.choice([80, 100.5])}" if math.isnan(self.one.feed) or self.chance.random() < 0.5 else ""
        back = self.chance.choice(["G98 ", "G99 "] + [""] * (self.one.initial_back is not None))
        self.emit(f"{back}{cycle} {self.to('X', x)} {self.to('Y', y)} {words}{feed}")
        for _ in range(self.chance.randint(0, 3)):
            x, y = self.place()
            self.emit(
                self.chance.choice([f"X{self.exact(x)}", f"Y{self.exact(y)}", f"X{self.exact(x)} Y{self.exact(y)}"])
            )
        self.emit("G80")

    def call(self) -> None:
        """Call a subprogram with small steps added."""
        if self.one.centre_absolute or self.one.normal != 2:
            return
        absolute = self.one.absolute
        number = self.chance.randint(1000, 8999)
        body = ["G91"]
        for _ in range(self.chance.randint(1, 3)):
            body.append(f"G1 X{self.chance.randint(-9, 9)} Y{self.chance.randint(-9, 9)}")
        if self.chance.random() < 0.4:
            body.append("G3 X2 Y0 I1 J0")
        body.append("G90" if absolute or self.chance.random() < 0.5 else "G91")
        body.append("M99")
        if self.subs and self.chance.random() < 0.3:
            # One within another; what it leaves in force is done before this one's own steps.
            body.insert(1, f"M98 P{self.subs[-1][0][1:]}\nG91")
        self.subs.append([f"O{number}", *"\n".join(body).split("\n")])
        self.one.subs[str(number)] = self.subs[-1][1:]
        times = self.chance.choice([1, 1, 2, 3])
        if math.isnan(self.one.feed):
            self.emit("F300")
        self.emit(self.calling(number, times))

    def calling(self, number: int, times: int) -> str:
        """The block that calls a subprogram."""
        return f"M98 P{number}" + (f" L{times}" if times > 1 else "")

    def around(self) -> str:
        """What stands around the blocks."""
        subs = ["\n".join(one) for one in self.subs]
        return "\n".join([*self.lines, *subs]) + "\n"

    def frame(self) -> None:
        """Another origin."""
        if self.one.family in ("", "G92") and not self.one.frame.angle and self.chance.random() < 0.5:
            x, y = self.place()
            self.emit(self.chance.choice([f"G92 X{self.exact(x)}", f"G92 X{self.exact(x)} Y{self.exact(y)}", "G92 Z0"]))
        elif self.one.family in ("", "G52"):
            x, y = self.place()
            self.emit(
                self.chance.choice([f"G52 X{self.exact(x)} Y{self.exact(y)}", f"G52 Y{self.exact(y)}", "G52 X0 Y0 Z0"])
            )


class Fanuc(Iso):
    """G68, corners, counts before a subprogram's number."""

    def parts(self) -> list[tuple[Callable[[], None], int]]:
        """Constructs, and how often each comes."""
        return [*super().parts(), (self.turned, 2), (self.cornered, 3)]

    def around(self) -> str:
        """What stands around the blocks."""
        text = super().around()
        return f"%\nO1\n{text}%\n" if self.chance.random() < 0.5 or self.subs else text

    def calling(self, number: int, times: int) -> str:
        """The block that calls a subprogram."""
        return f"M98 P{times}{number}" if times > 1 and self.chance.random() < 0.5 else super().calling(number, times)

    def frame(self) -> None:
        """Another origin."""
        if not self.one.frame.angle:
            super().frame()

    def turned(self) -> None:
        """Turn the coordinates, or turn them back; both coordinates are given next."""
        if self.one.frame.angle:
            self.emit("G69")
        elif self.one.frame.shift == (0.0, 0.0, 0.0):
            if self.one.normal != 2:
                self.emit("G17")
            if not self.one.absolute:
                self.emit("G90")
            x, y = self.place()
            self.emit(f"G68 X{self.exact(x)} Y{self.exact(y)} R{self.chance.choice([90, -30, 45, 12.5])}")
        x, y = self.place()
        if self.one.absolute:
            self.emit(self.code("G1") + f"{self.to('X', x)} {self.to('Y', y)}{self.feed()}")

    def corner(self) -> str:
        """The word of a corner."""
        return self.chance.choice([",R", ",R", ",C"]) + self.exact(self.chance.choice([0.5, 1, 2.5]))

    def rounding(self) -> str:
        """The word of a round corner."""
        return self.corner().replace(",C", ",R").replace("CHR", "RND").replace("CHF", "RND")

    def cornered(self) -> None:
        """Long sides with corners between them, and at times an arc behind the last."""
        if self.one.normal != 2:
            self.emit("G17")
        for _ in range(self.chance.randint(1, 3)):
            self.side(self.corner())
        if self.one.absolute and self.chance.random() < 0.3:
            # Beside an arc a corner is round.
            self.side(self.rounding())
            for _ in range(self.chance.randint(0, 2)):
                self._arc(False, self.rounding())
            if self.chance.random() < 0.5:
                self._arc(False)
            else:
                self.side("")
        else:
            self.side("")

    def side(self, word: str) -> None:
        """A side of 15 to 60 mm."""
        here, a, size = self.one.at, self.chance.uniform(-math.pi, math.pi), self.chance.uniform(15, 60)
        x, y = here[0] + round(size * math.cos(a), 3), here[1] + round(size * math.sin(a), 3)
        self.emit(" ".join(f"{self.code('G1')}{self.to('X', x)} {self.to('Y', y)} {word}{self.feed()}".split()))


class LinuxCnc(Iso):
    """The variants of G92, absolute centres, and turns of an arc."""

    def parts(self) -> list[tuple[Callable[[], None], int]]:
        """Constructs, and how often each comes."""
        return [*super().parts(), (self.centres, 1)]

    def centres(self) -> None:
        """How centres are written."""
        self.emit(self.chance.choice(["G90.1", "G91.1"]))

    def frame(self) -> None:
        """Another origin."""
        if self.one.family == "G92" and self.chance.random() < 0.6:
            self.emit(self.chance.choice(["G92.1", "G92.2", "G92.3", "G92.2", "G92.3"]))
        else:
            super().frame()

    def offsets(self, u: int, v: int, offset: list[float], centre: list[float]) -> list[str]:
        """The words of a centre."""
        words = super().offsets(u, v, offset, centre)
        return [*words, "P2"] if self.chance.random() < 0.1 else words
