"""What the gallery runs, where, and when again: ``examples/*.py``, by sphinx-gallery.

Scripts run in ``build/gallery``, where ``docs`` is a link to the documentation: paths in them are those of the
checkout, and what they write stays out of it. A script runs again when it, a source of stiffarm, a file in
``docs/examples`` or a library that computes or draws changed.
"""

from __future__ import annotations

import hashlib
import re
import shutil
import sys
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

DOCS = Path(__file__).resolve().parents[1]
ROOT = DOCS.parent
EXAMPLES = ROOT / "examples"
PAGES = DOCS / "gallery" / "scripts"
RUN_IN = ROOT / "build" / "gallery"
SOURCES = ("robots", "meshes", "fem", "doe", "surrogate", "machining", "rehearsal", "stiffarm", "docs/examples")
LIBRARIES = ("numpy", "scipy", "pandas", "scikit-learn", "matplotlib", "pyvista", "vtk", "sphinx-gallery")
STAMP = "made_of.sha256"

_PICTURE = re.compile(r"^# Picture: (.+(?:\n# .+)*)", re.MULTILINE)
_NEEDS = re.compile(r"^# Needs: (.+)$", re.MULTILINE)


def alternative_text(script: str) -> str:
    """What a script says of its picture for those who cannot see it.

    Raises
    ------
    ValueError
        It says nothing.
    """
    found = _PICTURE.search(script)
    if found is None:
        raise ValueError("a script of the gallery lacks its line '# Picture: what is to be seen'")
    text = " ".join(line.removeprefix("# ").strip() for line in found[1].splitlines())
    return text[0].upper() + text[1:]


def missing(script: str) -> str:
    """What a script needs and this machine lacks, in words; empty where it can run."""
    found = _NEEDS.search(script)
    tests = {"a C compiler": lambda: shutil.which("cc") is not None, "OpenGL": _can_draw}
    return "" if found is None or tests[found[1]]() else found[1]


def _can_draw() -> bool:
    from stiffarm.pages.rendering import gl_available

    return gl_available()[0]


def lay_out(texts: dict[str, str], run_in: Path, pages: Path) -> None:
    """Write the scripts (name -> text) to where they run; what was made of scripts that are no more goes."""
    for folder in (run_in, pages):
        folder.mkdir(parents=True, exist_ok=True)
        for file in [*folder.glob("*.py"), *folder.glob("*.rst")]:
            if file.with_suffix(".py").name not in texts:
                file.unlink()
    for name, text in texts.items():
        (run_in / name).write_text(text, encoding="utf-8")
    (run_in / "GALLERY_HEADER.rst").write_text("Gallery\n=======\n", encoding="utf-8")
    if not (run_in / "docs").is_symlink():
        (run_in / "docs").symlink_to(DOCS, target_is_directory=True)


def tidy_up(run_in: Path) -> None:
    """Remove what scripts have written."""
    for left in run_in.iterdir():
        if left.is_dir() and not left.is_symlink():
            shutil.rmtree(left)
        elif left.suffix not in (".py", ".rst") and left.name != "docs":
            left.unlink()


def digest() -> str:
    """Of all that a script's outcome depends on beside itself."""
    found = hashlib.sha256(sys.version.encode())
    for name in LIBRARIES:
        found.update(f"{name} {_version(name)}\n".encode())
    for file in [*sorted(Path(__file__).parent.glob("gallery_*.py")), *_sources()]:
        found.update(str(file.relative_to(ROOT)).encode() + b"\0" + hashlib.sha256(file.read_bytes()).digest())
    return found.hexdigest()


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "none"


def _sources() -> Iterator[Path]:
    for folder in SOURCES:
        yield from sorted(f for f in (ROOT / folder).rglob("*") if f.is_file() and "__pycache__" not in f.parts)


def forget_unless(now: str, pages: Path) -> None:
    """Let every script run again unless the last build was made of the same; ``now``: :func:`digest`."""
    stamp = pages / STAMP
    if not stamp.exists() or stamp.read_text(encoding="utf-8") != now:
        for file in pages.glob("*.md5"):
            file.unlink()
    stamp.write_text(now, encoding="utf-8")


def prepare() -> dict[str, object]:
    """Lay out what is to be run; returns the settings of sphinx-gallery."""
    texts = {script.name: script.read_text(encoding="utf-8") for script in sorted(EXAMPLES.glob("*.py"))}
    lay_out(texts, RUN_IN, PAGES)
    forget_unless(digest(), PAGES)
    idle = "|".join(re.escape(name) for name, text in texts.items() if missing(text)) or "-"
    return {
        "examples_dirs": str(RUN_IN),
        "gallery_dirs": str(PAGES.relative_to(DOCS)),
        "filename_pattern": rf"/(?!(?:{idle})$)[^/]*\.py$",
        "within_subsection_order": "FileNameSortKey",
        "image_scrapers": ("gallery_pages.picture",),
        "reset_modules": ("matplotlib", "gallery_pages.start_afresh"),
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
