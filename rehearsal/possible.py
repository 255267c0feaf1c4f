"""All that can be hidden in an arm. A code is ``kind`` or ``kind:where``."""

from __future__ import annotations

import numpy as np

from rehearsal.arm import Arm
from rehearsal.effects import DRAWS, wrist
from rehearsal.kinematics import frames
from robots.errors import InputError

# Nothing hidden: whether a diagnosis raises a false alarm.
NOTHING = "none"
# Axes are parallel up to this.
PARALLEL = 1e-9
# What needs a spring.
AT_SPRINGS = (
    "angle-dependent-stiffness",
    "hardening",
    "softening",
    "backlash",
    "friction",
    "gear-ripple",
)


def split(code: str) -> tuple[str, str]:
    """Kind and place of a code; the place is empty where there is but one."""
    kind, _, where = code.partition(":")
    return kind, where


def codes(arm: Arm, links: str = "rigid") -> list[str]:
    """Every code that an arm can have whose links are ``rigid`` or ``beam``, kind by kind.

    What works on a joint's spring needs one; in an arm whose springs nobody knows every joint has one. A joint that is
    rigid in the model gives way only where others have springs.
    """
    return [code for kind in DRAWS for code in _of_kind(kind, arm, links)]


def sprung(arm: Arm) -> list[int]:
    """Joints with a spring: those that the model gives one, all where it gives none."""
    own = [j for j in range(arm.dof) if arm.stiffness[j] is not None]
    return own or list(range(arm.dof))


def _of_kind(kind: str, arm: Arm, links: str) -> list[str]:
    springs = sprung(arm)
    if kind == "joint-compliance":
        places = [j for j in range(arm.dof) if j not in springs]
    elif kind in ("joint-tilt", "joint-zero-offset", "angle-sign", "angle-offset"):
        places = list(range(arm.dof))
    elif kind == "angle-coupling":
        axes = frames(arm, np.zeros((1, arm.dof))).axes[0]
        places = [j for j in range(1, arm.dof) if abs(axes[j] @ axes[j - 1]) > 1 - PARALLEL]
    elif kind in AT_SPRINGS:
        places = springs
    elif kind == "gravity-compensator":
        places = [j for j in (1,) if j in springs]
    elif kind == "link-flexibility":
        return [f"{kind}:{link.name}" for link in arm.links] if links != "rigid" else []
    else:
        return [kind] if _has(kind, arm, springs) else []
    return [f"{kind}:{arm.joints[j]}" for j in places]


def _has(kind: str, arm: Arm, springs: list[int]) -> bool:
    """Whether an arm can have what it has once at most."""
    if kind == "parallelogram-bar":
        return arm.bar_at_work is not None
    if kind == "load-path":
        return arm.bar is not None
    if kind == "wrist-coupling":
        return {wrist(arm.dof), wrist(arm.dof) + 1} <= {*springs}
    return True


def checked(code: str, arm: Arm, links: str) -> str:
    """The code, where an arm can have it.

    Raises
    ------
    InputError
        Another code; a close one is named.
    """
    known = [NOTHING, *codes(arm, links)]
    if code not in known:
        kind = code.partition(":")[0]
        places = [one for one in known if one.partition(":")[0] == kind]
        kinds = dict.fromkeys(one.partition(":")[0] + (":PLACE" if ":" in one else "") for one in known)
        raise InputError(
            "--hide",
            code="A001",
            value=code,
            allowed=", ".join(places or kinds),
            remedy="--hide any hides one in secret",
        )
    return code
