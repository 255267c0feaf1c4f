"""What a written program, read back, differs by from the tool path that it was written from."""

from __future__ import annotations

from dataclasses import dataclass

from robots import InputError

# Share by which a speed may differ: it is written to seven digits, and single precision on some controllers.
SAME_PACE = 1e-4


@dataclass(frozen=True, eq=False)
class RoundTrip:
    """What a written program, read back, differs by from the tool path, the largest of all moves.

    ``tip`` m and ``turned`` rad of the tool frames (joint programs by forward kinematics); ``travel`` m of linear
    axes, ``table`` rad; ``pace``: speed or time of a move as a share of it; ``same_moves``: joint moves are where
    they were asked for; ``same_sides``: the arm's configuration is that of the joint angles, where it decides.
    """

    tip: float
    turned: float
    travel: float
    table: float
    pace: float
    same_moves: bool
    same_sides: bool = True

    def within(self, tolerance: float = 1e-6) -> bool:
        """Whether nothing differs, and tool frames and axes by less than so many m and rad."""
        return self.difference(tolerance) is None

    def difference(self, tolerance: float = 1e-6) -> InputError | None:
        """What differs first, as the error that it is; None where nothing does."""
        off = max(self.tip, self.turned, self.travel, self.table)
        template = "write it as the bundled template does"
        if not self.same_moves:
            return InputError("joint moves and straight ones", value="exchanged", allowed="as asked", remedy=template)
        if not off < tolerance:
            return InputError(
                "off the tool path",
                value=f"{max(self.tip, self.travel) * 1e6:.3g} um, {max(self.turned, self.table) * 1e6:.3g} urad",
                allowed=f"{tolerance * 1e6:g} um, {tolerance * 1e6:g} urad",
                remedy="give more decimals in the options; in your own templates write coordinates as bundled ones do",
            )
        if not self.same_sides:
            return InputError("configuration of the arm", value="another", allowed="the path's", remedy=template)
        if not self.pace < SAME_PACE:
            value, allowed = f"by {100.0 * self.pace:.3g} %", f"{100.0 * SAME_PACE:g} %"
            return InputError("speeds differ from the tool path's", value=value, allowed=allowed, remedy=template)
        return None
