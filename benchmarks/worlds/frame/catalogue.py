"""All laws by their families: those that a diagnosis could know, and strange ones."""

from __future__ import annotations

from . import body_laws, history_laws, joint_laws, setup_laws, strange_laws
from .laws import Law

KNOWN: dict[str, Law] = {
    law.family: law() for law in (*joint_laws.LAWS, *history_laws.LAWS, *body_laws.LAWS, *setup_laws.LAWS)
}
STRANGE: dict[str, Law] = {law.family: law() for law in strange_laws.LAWS}
EVERY = KNOWN | STRANGE
# A whole table in another convention, or all springs at once, leaves nothing to tell two effects apart by.
ALONE = {"gauge-scale", "angle-sign", "angle-offset", "angle-coupling", "load-path"}
PAIRED = tuple(family for family in KNOWN if family not in ALONE)
