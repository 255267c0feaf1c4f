"""What every picture and page of a command must say of the model behind it: joints held rigid for want of a spring.

A command's results go through many hands before they are drawn, and none of them may forget it; so the frame of the
command says it once, for all that is drawn and written meanwhile.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING

from robots import Remark
from robots.arm_class import CLASS_PRIOR

if TYPE_CHECKING:
    from fem.arm import Arm

RIGID_AS_ASKED = "Joints held rigid, as asked: only the links deflect here."

_said: ContextVar[str] = ContextVar("caution", default="")


def caution() -> str:
    """What to write across pictures and pages now; empty where there is nothing to warn of."""
    return _said.get()


@contextmanager
def cautioned(text: str) -> Iterator[None]:
    """Within it, every picture and page carries ``text`` on a band."""
    before = _said.set(text)
    try:
        yield
    finally:
        _said.reset(before)


def caveats(arm: Arm) -> Remark:
    """What pictures and pages must say of an arm's stiffness: springs it lacks, its load, what is left out of it."""
    from stiffarm.session.stated import stated_words

    said = uncalibrated(arm)
    return Remark(" ".join(filter(None, (said, stated_words(arm.model)))), code=said.code)


def uncalibrated(arm: Arm) -> Remark:
    """The warning of a model with joints held rigid for want of a spring, or with springs that nobody measured.

    Empty where there is nothing to warn of.
    """
    rigid, joints = arm.joints_without_springs, len(arm.model.joints)
    prior = [j.name for j in arm.description.joint if getattr(j.stiffness, "source", None) == CLASS_PRIOR]
    if not rigid and prior:
        which = "the springs" if len(prior) == joints else f"springs of {', '.join(prior)}"
        return Remark(
            f"Not calibrated: {which} are a class prior, the middle of the range for arms of this size. The real "
            "ones may be several times softer or stiffer.",
            code="W002",
        )
    if not rigid:
        return Remark("")
    if len(rigid) == joints:
        return Remark(
            "Not calibrated: no joint of this model has a spring, so only the links deflect. The real arm is "
            "typically about ten times softer; stiffarm calibrate finds its springs from readings.",
            code="W001",
        )
    names = ", ".join(rigid[:-1]) + " and " * (len(rigid) > 1) + rigid[-1]
    return Remark(
        f"Not fully calibrated: {names} {'is' if len(rigid) == 1 else 'are'} held rigid for want of a spring. "
        "The real arm is softer wherever a load turns " + ("it." if len(rigid) == 1 else "them."),
        code="W001",
    )


def warned(arm: Arm) -> dict[str, str]:
    """The same as an entry ``warning`` of what a file says of itself; none where there is nothing to warn of."""
    text = caveats(arm)
    return {"warning": text} if text else {}
