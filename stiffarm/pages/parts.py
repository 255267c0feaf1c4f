"""What pages share: rendering with a Content-Security-Policy; packed arrays, the kinematic chain, scripts."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Callable, Collection
from importlib import resources
from typing import Any, Final

import jinja2
import numpy as np
from markupsafe import Markup, escape
from numpy.typing import NDArray

from robots import Robot
from robots.arrays import Array
from robots.frames import framed
from stiffarm.pages.files import linked
from stiffarm.pages.numbers import typeset, typeset_cell
from stiffarm.session.caution import caution

_CODE: Final = re.compile(r"`([^`]+)`")


def render_page(template: str, data: dict[str, Any], scripts: tuple[str, ...], shared: str = "", **words: Any) -> str:
    """A page as HTML text from a file in ``templates``; what comes from files is escaped.

    ``data`` becomes the JSON at ``{{ data }}``, the files ``scripts`` of ``templates`` the text at ``{{ script }}``,
    behind ``shared``, a script of another package.
    """
    # Inside a script element nothing but "<" can end it early.
    text = json.dumps(data, allow_nan=False).replace("<", "\\u003c").replace("&", "\\u0026")
    folder = resources.files("stiffarm.pages") / "templates"
    script = "\n".join([shared, *((folder / name).read_text(encoding="utf-8") for name in scripts)])
    return rendered(template, data=Markup(text), script=Markup(script), **words)  # noqa: S704 - escaped above; our own


def rendered(template: str, script: str = "", files: Collection[str] = (), **words: Any) -> str:
    """A page as HTML text from a file in ``templates``, all content escaped; no page is made in another way.

    ``files`` of the page's folder: where one is named it becomes a link.

    Its Content-Security-Policy, ``{{ policy }}`` in the template, lets nothing be loaded, runs no script and applies no
    style but those that stand in the template itself. They are known by their hashes, and these are taken without the
    content, so that what slipped in with it would not run. ``{{ caution }}`` is what the page must warn of.
    """
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("stiffarm.pages", "templates"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters |= _filters(files)
    source = (resources.files("stiffarm.pages") / "templates" / template).read_text(encoding="utf-8")
    allowed = {"default": "'none'", "img": "data:"}
    for kind in ("style", "script"):
        # With their tags, so that rendering strips no newline at their ends.
        elements = [found[0] for found in re.finditer(rf"<{kind}>.*?</{kind}>", source, re.DOTALL)]
        if elements:
            allowed[kind] = " ".join(_hash(environment.from_string(text).render(script=script)) for text in elements)
    policy = "; ".join(
        [*(f"{kind}-src {what}" for kind, what in allowed.items()), "base-uri 'none'", "form-action 'none'"]
    )
    # Hashes and words of our own.
    words = {"caution": caution(), "policy": Markup(policy), **words}  # noqa: S704
    return environment.get_template(template).render(script=script, **words)


def _filters(files: Collection[str]) -> dict[str, Callable[[object], Markup]]:
    """How templates write texts: numbers in one style, code between backticks, files as links."""

    def words(text: object, of: Callable[[str], str] = typeset) -> Markup:
        parts = _CODE.split(str(text))
        # Every second part stood between backticks: it is written as it must be typed.
        whole = [
            Markup("<code>{}</code>").format(linked(part, files)) if k % 2 else linked(of(part), files)
            for k, part in enumerate(parts)
        ]
        return Markup().join(whole)

    return {
        "words": words,
        "cell": lambda text: words(text, typeset_cell),
        "linked": lambda text: linked(str(text), files),
        "plain": lambda text: escape(typeset(str(text))),
    }


def _hash(element: str) -> str:
    """The hash of what an element without attributes holds, as policies have it."""
    content = element.partition(">")[2].rpartition("</")[0]
    return f"'sha256-{base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()}'"


def chain_data(robot: Robot) -> dict[str, Any]:
    """The kinematic chain for ``chainFrames`` of ``page_matrices.js``."""
    para = robot.parallelogram
    return {
        "pre": [column_matrix(T) for T in robot.T_pre],
        "post": [column_matrix(framed(R, np.zeros(3))) for R in robot.R_post],
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


def packed(values: NDArray[Any], kind: str) -> str:
    """An array as base64 of numbers of a kind ('<f4'), little end first."""
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")
