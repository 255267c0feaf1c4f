"""Models as commands take them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import get_args

from fem import FLANGES, LINK_KINDS, LinkKind
from fem.arm import Arm, with_flanges
from fem.effects import LOAD_PATH, Maker
from fem.effects import with_load_path as described_with_load_path
from robots import InputError, LoadPath, ModelDescription, content_hash
from stiffarm.session.console import progress, say
from stiffarm.session.parsing import parse_word
from stiffarm.session.softness import refuse_too_soft
from stiffarm.session.table_kinds import described

# Kinds of links with meshes, whose flanges can be chosen.
MESHED = ("shell", "solid")


def read_model(
    name: str,
    links: str | None,
    load_path: str | None,
    *,
    own: tuple[Maker, ...] = (),
    without: str | None = None,
    sets: Mapping[str, str | float] | None = None,
) -> Arm:
    """Load and build a model; links default to what it was calibrated with, else beams.

    ``shell:distributing`` and ``shell:rigid`` choose how the flanges of all shell links are coupled; the choice goes
    into the description, so that a calibrated model keeps it. ``without``: what the command makes from the linear arm
    alone ("the map"): effects that this leaves out are named. ``sets``: values of parameters in place of the model's
    (:func:`doe.model_file.changed.changed`). A model so soft that none of its results would hold is
    refused.
    """
    description = described(name)
    asked, _, flanges = (links or "").partition(":")
    if links is None:
        asked = description.calibration.links if description.calibration else "beam"
    if asked not in LINK_KINDS or (flanges and (asked not in MESHED or flanges not in FLANGES)):
        allowed = [*LINK_KINDS, *(f"{meshed}:{choice}" for meshed in MESHED for choice in FLANGES)]
        raise InputError("--links", code="M003", value=links, allowed=", ".join(allowed), remedy="choose one of them")
    kind: LinkKind = next(known for known in LINK_KINDS if known == asked)
    if flanges:
        description = with_flanges(description, "distributing" if flanges == "distributing" else "rigid")
    path: LoadPath | None = None
    if load_path is not None:
        path = as_load_path(load_path)
        if any(table.code == LOAD_PATH for table in description.effect):
            description = described_with_load_path(description, path)
    with _announced(kind, description):
        arm = Arm.of(description, kind, path, own)
        if sets:
            from doe.model_file.changed import changed

            arm = Arm.of(changed(arm, sets, "--set"), kind, path, own)
    refuse_too_soft(arm.description, arm.model)
    if arm.effects and without is not None:
        say(f"note: not in {without}: {', '.join(e.effect.code for e in arm.effects)}")
    return replace(arm, source=name)


def as_load_path(text: str) -> LoadPath:
    """A load path by its name."""
    known: tuple[LoadPath, ...] = get_args(LoadPath)
    return parse_word(text, known, "--load-path")


def refuse_effects(given: Arm, what: str, remedy: str) -> None:
    """Refuse a model with effects where their part in the springs would be counted twice."""
    if given.description.effect:
        codes = ", ".join(table.code for table in given.description.effect)
        raise InputError(
            f"{what} of a model with effects", code="M011", value=codes, allowed="no [[effect]]", remedy=remedy
        )


@contextmanager
def _announced(links: LinkKind, description: ModelDescription) -> Iterator[None]:
    """Shells take a while to build, so they are announced."""
    if links not in MESHED:
        yield
        return
    say(f"building {links} models of {len(description.link)} links")
    with progress(f"{links} models of links"):
        yield


def with_load_path(given: Arm, load_path: LoadPath) -> Arm:
    """The same arm with another load path; said where that takes a while."""
    with _announced(
        "beam" if load_path in ("serial", given.model.load_path) else given.model.link_kind, given.description
    ):
        return given.with_load_path(load_path)


def with_links(given: Arm, links: LinkKind) -> Arm:
    """The same arm with another kind of links; said where that takes a while."""
    with _announced(links, given.description):
        return given.with_links(links)


def model_hash(given: Arm) -> str:
    """Content hash of the model, for run.json."""
    return content_hash(given.description)
