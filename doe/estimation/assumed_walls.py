"""Links whose walls were assumed at their import: what a calibration knows of their compliance beforehand.

A surface shows a link's outside. Its wall comes from a mass, or from what is usual: log-normal, within 40 %. A link's
compliance goes as 1 / wall, so it is free within as much beside the springs, and the springs' intervals count it in.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from doe.estimation.campaign import Campaign, Freed, Prior
from fem.model import ArmModel
from robots.schema.description import ModelDescription

# Standard deviation of ln(wall), so of ln(compliance).
WALL_SD = 0.4


def assumed_walls(description: ModelDescription, model: ArmModel) -> tuple[str, ...]:
    """Names of the model's links that are elastic and whose walls nobody gave."""
    elastic = {link.name for link in model.links}
    return tuple(
        link.name
        for link in description.link
        if link.name in elastic
        and link.surface is not None
        and link.surface.wall.source == "assumed"
        and not (model.link_kind == "solid" and link.solid is not None)
    )


def with_assumed_walls(campaign: Campaign, description: ModelDescription, model: ArmModel) -> Campaign:
    """The campaign with the compliances of :func:`assumed_walls` free within what is known of them.

    Links whose modulus or wall is free already are left as they are, and so are campaigns in stages, each of which
    holds what it does not name.
    """
    if campaign.stage:
        return campaign
    taken = {name.partition(".")[0] for name in campaign.names if name.endswith((".modulus", ".wall"))}
    moduli = {link.name: link.mesh.youngs_modulus for link in model.links}
    further = tuple(
        Freed(
            name=f"{name}.modulus",
            prior=Prior(value=moduli[name], factor=math.exp(WALL_SD), source="the wall is assumed, within 40 %"),
        )
        for name in assumed_walls(description, model)
        if name not in taken
    )
    return campaign.model_copy(update={"parameter": (*campaign.parameter, *further)})


def remarks(campaign: Campaign, description: ModelDescription, model: ArmModel) -> tuple[str, ...]:
    """What is to be said of links that a calibration with assumed walls has set free."""
    free = [name for name in assumed_walls(description, model) if f"{name}.modulus" in campaign.names]
    if not free:
        return ()
    out = [
        f"walls of {', '.join(free)} are assumed: their compliances are free within 40 % (their moduli stand for "
        "them), and the springs' intervals count that in; STEP files of the links would bring it down to a few per cent"
    ]
    tilted = _tilted(campaign.names, model)
    pairs = [f"{link.name} and {link.body}" for link in description.link if link.name in free and link.body in tilted]
    if pairs:
        out.append(
            f"a wall and a tilt spring of the same joint can stand in for one another ({'; '.join(pairs)}): read them "
            "as one compliance"
        )
    return tuple(out)


def _tilted(names: Sequence[str], model: ArmModel) -> set[str]:
    """Joints that give way about other axes than their own, in the model or freely."""
    free = {name.partition(".")[0] for name in names if name.endswith((".rx", ".ry"))}
    return free | {joint.name for joint in model.joints if joint.bearing[3:5, 3:5].any()}
