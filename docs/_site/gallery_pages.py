"""How the gallery is shown: pictures with alternative text, tidy pages, cards on its index."""

from __future__ import annotations

import os
import re
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from docutils import nodes
from gallery_runs import DOCS, EXAMPLES, PAGES, RUN_IN, alternative_text, missing, tidy_up
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

# Dots for an inch of pictures that scripts draw with pyplot: sharp on screens of today.
DPI = 150

_OUTPUT = re.compile(r"^ *\.\. code-block:: none\n\n((?:(?:    .*)?\n)+)", re.MULTILINE)
_TOP = re.compile(r"\.\. only:: html\n\n    \.\. note::.*?(?=\.\. rst-class:: sphx-glr-example-title)", re.DOTALL)
_BOTTOM = re.compile(r"\n\.\. _sphx_glr_download_.*", re.DOTALL)


def start_afresh(gallery_conf: dict[str, Any], name: str | None) -> None:
    """An empty folder, and how finely pictures are drawn; called by sphinx-gallery before each script."""
    import matplotlib.pyplot as plt

    from stiffarm.pages.rendering import gl_available

    works, window = gl_available()
    if works:
        # VTK looks for a screen otherwise, and complains.
        os.environ["VTK_DEFAULT_OPENGL_WINDOW"] = window
    plt.rcParams["savefig.dpi"] = DPI
    tidy_up(RUN_IN)


def picture(block: object, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """The picture that a script has written, as reStructuredText; called by sphinx-gallery after each block."""
    import matplotlib.pyplot as plt

    plt.close("all")
    script = Path(block_vars["src_file"])
    drawn = RUN_IN / f"{script.stem}.png"
    if not drawn.exists():
        return ""
    place = Path(block_vars["image_path_iterator"].next())
    shutil.move(drawn, place)
    alt = alternative_text(script.read_text(encoding="utf-8"))
    return f"\n.. image:: /{place.relative_to(DOCS)}\n   :alt: {alt}\n   :class: gallery-picture\n\n"


@dataclass(frozen=True)
class Outcome:
    """What a script's page shows: its question, the last line that it printed, and of its picture the text."""

    name: str
    question: str
    answer: str
    alt: str


def outcome(name: str) -> Outcome:
    """Of a script, by its name without ending; the answer is empty where it was not run."""
    text = (EXAMPLES / f"{name}.py").read_text(encoding="utf-8")
    printed = _OUTPUT.findall((PAGES / f"{name}.rst").read_text(encoding="utf-8"))
    answer = printed[-1].strip().splitlines()[-1].strip() if printed else ""
    return Outcome(name, text.splitlines()[0].strip('"'), answer, alternative_text(text))


def tidy(app: Sphinx, docname: str, source: list[str]) -> None:
    """A script's page with how to run the script, and without sphinx-gallery's notes at top and bottom."""
    folder, _, name = docname.rpartition("/")
    if DOCS / folder != PAGES:
        return
    lacks = missing((EXAMPLES / f"{name}.py").read_text(encoding="utf-8"))
    why = f"Not run when this site was built: it needs {lacks}.\n\n" if lacks else ""
    run = f"In the checkout: `python examples/{name}.py`, or :download:`download the script <{name}.py>`."
    source[0] = _BOTTOM.sub(f"\n\n{why}{run}\n", _TOP.sub("", source[0]))


class Cards(SphinxDirective):
    """Scripts by name, one a line, as cards: the picture, the question, the answer of this build."""

    has_content = True

    def run(self) -> list[nodes.Node]:
        """The cards."""
        # Answers change with the code, which Sphinx does not watch.
        self.env.note_reread()
        cards = nodes.container(classes=["gallery-cards"])
        cards += [self._card(outcome(name)) for name in map(str.strip, self.content) if name]
        return [cards]

    def _card(self, one: Outcome) -> nodes.container:
        card = nodes.container(classes=["gallery-card"])
        if one.answer:
            small = PAGES / "images" / "thumb" / f"sphx_glr_{one.name}_thumb.png"
            card += nodes.image(uri=f"/{small.relative_to(DOCS)}", alt=one.alt)
        question, _ = self.parse_inline(f"[{one.question}](scripts/{one.name}.rst)")
        card += nodes.paragraph("", "", *question, classes=["gallery-question"])
        card += nodes.paragraph("", one.answer or "Not run when this site was built.")
        return card


def setup(app: Sphinx) -> None:
    """The directive ``cards`` and the tidying of pages."""
    app.add_directive("cards", Cards)
    app.connect("source-read", tidy)
