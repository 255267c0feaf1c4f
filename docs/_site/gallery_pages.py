"""The gallery: sphinx-gallery runs ``examples/*.py``; here is what it runs, when again, and how it is shown.

Scripts run in ``build/gallery``, where ``docs`` is a link to this folder's parent: paths in them are those of the
checkout, and what they write stays out of it. A script runs again when it, a source of stiffarm, a file in
``docs/examples`` or a library that draws or computes changed.
"""

from __future__ import annotations

import hashlib
import re
import shutil
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

DOCS = Path(__file__).resolve().parents[1]
ROOT = DOCS.parent
EXAMPLES = ROOT / "examples"
PAGES = DOCS / "gallery" / "scripts"
RUN_IN = ROOT / "build" / "gallery"
SOURCES = ("robots", "meshes", "fem", "doe", "surrogate", "machining", "rehearsal", "stiffarm", "docs/examples")
LIBRARIES = ("numpy", "scipy", "pandas", "scikit-learn", "matplotlib", "pyvista", "vtk", "sphinx-gallery")
STAMP = "made_of.sha256"
# Dots for an inch of pictures that scripts draw with pyplot: sharp on screens of today.
DPI = 150

_PICTURE = re.compile(r"^# Picture: (.+(?:\n# .+)*)", re.MULTILINE)
_NEEDS = re.compile(r"^# Needs: (.+)$", re.MULTILINE)
_OUTPUT = re.compile(r"^ *\.\. code-block:: none\n\n((?:(?:    .*)?\n)+)", re.MULTILINE)
_TOP = re.compile(r"\.\. only:: html\n\n    \.\. note::.*?(?=\.\. rst-class:: sphx-glr-example-title)", re.DOTALL)
_BOTTOM = re.compile(r"\n\.\. _sphx_glr_download_.*", re.DOTALL)


def scripts() -> list[Path]:
    """All scripts."""
    return sorted(EXAMPLES.glob("*.py"))


def alternative_text(script: str) -> str:
    """What a script says of its picture for those who cannot see it."""
    found = _PICTURE.search(script)
    if found is None:
        raise ValueError("a script of the gallery lacks its line '# Picture: what is to be seen'")
    return " ".join(line.removeprefix("# ").strip() for line in found[1].splitlines())


def missing(script: str) -> str:
    """What a script needs and this machine lacks, in words; empty where it can run."""
    found = _NEEDS.search(script)
    tests = {"a C compiler": lambda: shutil.which("cc") is not None, "OpenGL": _can_draw}
    lacks = [] if found is None else [need for need in found[1].split(", ") if not tests[need]()]
    return " and ".join(lacks)


def _can_draw() -> bool:
    from stiffarm.pages.rendering import gl_available

    return gl_available()[0]


def prepare() -> dict[str, object]:
    """Lay out what is to be run; returns the settings of sphinx-gallery."""
    texts = {script.name: script.read_text(encoding="utf-8") for script in scripts()}
    for folder in (RUN_IN, PAGES):
        folder.mkdir(parents=True, exist_ok=True)
        for file in [*folder.glob("*.py"), *folder.glob("*.rst")]:
            if file.with_suffix(".py").name not in texts:
                file.unlink()
    for name, text in texts.items():
        (RUN_IN / name).write_text(text, encoding="utf-8")
    (RUN_IN / "GALLERY_HEADER.rst").write_text("Gallery\n=======\n", encoding="utf-8")
    if not (RUN_IN / "docs").exists():
        (RUN_IN / "docs").symlink_to(DOCS, target_is_directory=True)
    _forget_if_changed()
    idle = "|".join(re.escape(name) for name, text in texts.items() if missing(text))
    return {
        "examples_dirs": str(RUN_IN),
        "gallery_dirs": "gallery/scripts",
        "filename_pattern": rf"/(?!(?:{idle or '-'})$)[^/]*\.py$",
        "within_subsection_order": "FileNameSortKey",
        "image_scrapers": ("gallery_pages.picture",),
        "reset_modules": ("matplotlib", "gallery_pages.sharp"),
        "capture_repr": (),
        "css": (),
        "thumbnail_size": (720, 480),
        "min_reported_time": 1e9,
        "write_computation_times": False,
        "download_all_examples": False,
        "notebook_extensions": set(),
        "show_signature": False,
        "inspect_global_variables": False,
    }


def digest() -> str:
    """Of all that a script's outcome depends on beside itself."""
    found = hashlib.sha256(sys.version.encode())
    for name in LIBRARIES:
        found.update(f"{name} {version(name)}\n".encode())
    for file in [Path(__file__), *_sources()]:
        found.update(str(file.relative_to(ROOT)).encode() + b"\0" + hashlib.sha256(file.read_bytes()).digest())
    return found.hexdigest()


def _sources() -> Iterator[Path]:
    for folder in SOURCES:
        yield from sorted(f for f in (ROOT / folder).rglob("*") if f.is_file() and "__pycache__" not in f.parts)


def _forget_if_changed() -> None:
    stamp, now = PAGES / STAMP, digest()
    if not stamp.exists() or stamp.read_text(encoding="utf-8") != now:
        for file in PAGES.glob("*.md5"):
            file.unlink()
    stamp.write_text(now, encoding="utf-8")


def sharp(gallery_conf: dict[str, object], name: str | None) -> None:
    """How finely pictures are drawn, and an empty folder; called by sphinx-gallery before each script."""
    import matplotlib.pyplot as plt

    plt.rcParams["savefig.dpi"] = DPI
    for left in RUN_IN.iterdir():
        if left.is_dir() and not left.is_symlink():
            shutil.rmtree(left)
        elif left.suffix not in (".py", ".rst") and left.name != "docs":
            left.unlink()


def picture(block: object, block_vars: dict[str, object], gallery_conf: dict[str, object]) -> str:
    """The picture that a script has written, as reStructuredText; called by sphinx-gallery after each block."""
    import matplotlib.pyplot as plt

    plt.close("all")
    script = Path(str(block_vars["src_file"]))
    drawn = RUN_IN / f"{script.stem}.png"
    if not drawn.exists():
        return ""
    place = Path(next(block_vars["image_path_iterator"]))  # type: ignore[call-overload]
    shutil.move(drawn, place)
    alt = alternative_text(script.read_text(encoding="utf-8"))
    return f"\n.. image:: /{place.relative_to(DOCS)}\n   :alt: {alt}\n   :class: gallery-picture\n\n"


@dataclass(frozen=True)
class Outcome:
    """What a script's page shows: its question, the last line it printed, whether there is a picture, its text."""

    name: str
    question: str
    answer: str
    alt: str

    @property
    def thumbnail(self) -> Path:
        """Where sphinx-gallery put the small picture."""
        return PAGES / "images" / "thumb" / f"sphx_glr_{self.name}_thumb.png"


def outcome(name: str) -> Outcome:
    """Of a script, by its name without ending; the answer is empty where it was not run."""
    text = (EXAMPLES / f"{name}.py").read_text(encoding="utf-8")
    page = (PAGES / f"{name}.rst").read_text(encoding="utf-8")
    printed = _OUTPUT.findall(page)
    answer = printed[-1].strip().splitlines()[-1].strip() if printed else ""
    return Outcome(name, text.splitlines()[0].strip('"'), answer, alternative_text(text))


def tidy(app: Sphinx, docname: str, source: list[str]) -> None:
    """A page without sphinx-gallery's notes at top and bottom, with how to run the script instead."""
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
        self.env.note_reread()
        cards = nodes.container(classes=["gallery-cards"])
        for name in filter(None, map(str.strip, self.content)):
            cards += self._card(outcome(name))
        return [cards]

    def _card(self, one: Outcome) -> nodes.container:
        card = nodes.container(classes=["gallery-card"])
        if one.answer:
            card += nodes.image(uri=f"/{one.thumbnail.relative_to(DOCS)}", alt=one.alt)
        question, _ = self.parse_inline(f"[{one.question}](scripts/{one.name}.rst)")
        card += nodes.paragraph("", "", *question, classes=["gallery-question"])
        card += nodes.paragraph("", one.answer or "Not run when this site was built.")
        return card


def setup(app: Sphinx) -> None:
    """The directive ``cards`` and the tidying of pages."""
    app.add_directive("cards", Cards)
    app.connect("source-read", tidy)
