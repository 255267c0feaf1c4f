"""What the pages that draw a robot share: packed arrays, the kinematic chain, scripts, rendering."""

from __future__ import annotations

import base64
import json
from importlib import resources
from typing import Any

import jinja2
import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from robots import Robot

Array = NDArray[np.float64]


def render_page(template: str, data: dict[str, Any], scripts: tuple[str, ...], **words: Any) -> str:
    """A page as HTML text from a file in ``templates``; what comes from files is escaped.

    ``data`` becomes the JSON at ``{{ data }}``, the files ``scripts`` of ``templates`` the text at ``{{ script }}``.
    """
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("stiffarm", "templates"),
        autoescape=True,
        trim_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    # Inside a script element nothing but "<" can end it early.
    text = json.dumps(data, allow_nan=False).replace("<", "\\u003c").replace("&", "\\u0026")
    folder = resources.files("stiffarm") / "templates"
    script = "\n".join((folder / name).read_text(encoding="utf-8") for name in scripts)
    page = environment.get_template(template)
    return page.render(data=Markup(text), script=Markup(script), **words)  # noqa: S704 - escaped above; our own


def chain_data(robot: Robot) -> dict[str, Any]:
    """The kinematic chain for ``chainFrames`` of ``page_matrices.js``."""
    para = robot.parallelogram
    return {
        "pre": [column_matrix(T) for T in robot.T_pre],
        "post": [column_matrix(rigid(R)) for R in robot.R_post],
        "sign": robot.sign.tolist(),
        "offset": robot.offset.tolist(),
        "flange": column_matrix(robot.T_last_flange),
        "crank": None
        if para is None
        else {"own": para.crank_about + 1, "driven": para.driven + 1, "pin": para.pin.tolist()},
    }


def column_matrix(T: Array) -> list[float]:
    """A transform column by column, as WebGL has them."""
    return [float(v) for v in T.T.ravel()]


def rigid(R: Array) -> Array:
    """A rotation (3, 3) as a transform (4, 4)."""
    T = np.eye(4)
    T[:3, :3] = R
    return T


def packed(values: NDArray[Any], kind: str) -> str:
    """An array as base64 of numbers of a kind ('<f4'), little end first."""
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")
