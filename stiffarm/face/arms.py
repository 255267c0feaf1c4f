"""Robot arms: loaded by name or from a file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from robots import bundled_names
from stiffarm.arm import Arm, as_face
from stiffarm.face.calls import called
from stiffarm.session import inputs

__all__ = ["Arm", "as_face", "load", "robots_bundled"]


def load(
    model: str | Path,
    *,
    links: str | None = None,
    load_path: str | None = None,
    values: Mapping[str, float | str] | None = None,
) -> Arm:
    """A robot arm by bundled name, from a model TOML or from a URDF.

    Parameters
    ----------
    model : a bundled name (:func:`stiffarm.robots_bundled`) or a path
    links : "beam", "shell" or "rigid"; default: as the model was calibrated, else beam
    load_path : "parallelogram" or "serial"; default: the model's
    values : parameter name -> value in place of the model's, SI or text with a unit, as in ``{"j2.stiffness": 1.4e6}``

    Raises
    ------
    InputError
        No such model, a file that does not fit the schema, a parameter that the arm does not have, or an arm too soft
        for linear statics.

    Examples
    --------
    >>> import stiffarm as sa
    >>> sa.load("xr701", values={"j2.stiffness": 1.4e6}).name
    'xr701'
    """
    with called():
        return as_face(inputs.read_model(str(model), links, load_path, sets=values))


def robots_bundled() -> tuple[str, ...]:
    """Names of the bundled robots."""
    return bundled_names()
