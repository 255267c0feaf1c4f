"""Pictures of a stiffness map with the robot in it, from two viewpoints, with or without OpenGL.

Matplotlib draws frame, labels and colour bar around a parallel projection; points and robot come from
:mod:`stiffarm.pages.scenes`: from pyvista or, without OpenGL or with ``STIFFARM_NO_GL=1``, from numpy.
"""

from __future__ import annotations

import functools
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Final, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robots import InputError
from stiffarm.pages import style
from stiffarm.pages.scenes import Image, Scene, Window, gl_image, z_buffer_image

Renderer = Literal["pyvista", "matplotlib"]

NO_GL_VARIABLE: Final = "STIFFARM_NO_GL"
# Pixels drawn for one of the picture, along each side: reducing them smooths the edges.
FINENESS = 2.0
_WINDOW_VARIABLE: Final = "VTK_DEFAULT_OPENGL_WINDOW"
_PROBE: Final = """
import pyvista
plotter = pyvista.Plotter(off_screen=True, window_size=(32, 32))
plotter.add_mesh(pyvista.Sphere())
image = plotter.screenshot(None, return_img=True)
print("drawn" if image.std() > 1 else "blank", type(plotter.render_window).__name__)
"""


@dataclass(frozen=True)
class Picture:
    """A picture that was written: where, by which renderer, and why not by pyvista if so."""

    path: Path
    renderer: Renderer
    message: str


VIEWS: Final = MappingProxyType(
    {"oblique": style.Camera(np.array([0.55, -1.0, 0.42])), "side": style.Camera(np.array([0.0, -1.0, 0.0]))}
)
"""``oblique``: from the front side; ``side``: along Y onto the XZ cross-section, X to the right."""


def gl_available() -> tuple[bool, str]:
    """Find out whether pyvista can draw without a screen here.

    Without an OpenGL library VTK dies with a segmentation fault, so a subprocess tries it, once in the
    life of this process. ``STIFFARM_NO_GL=1`` answers no without trying.

    Returns (yes, the render window's class) or (no, what is missing and how to get it).
    """
    if os.environ.get(NO_GL_VARIABLE, "") not in ("", "0"):
        return False, f"off-screen OpenGL is switched off by {NO_GL_VARIABLE}; pictures come from matplotlib"
    return _probe_gl()


@functools.cache
def _probe_gl() -> tuple[bool, str]:
    try:
        # The command is this interpreter and a constant text.
        run = subprocess.run(  # noqa: S603
            [sys.executable, "-c", _PROBE], capture_output=True, text=True, timeout=120, check=False
        )
        words = run.stdout.split()[-2:]
        if run.returncode == 0 and words[:1] == ["drawn"]:
            return True, words[1]
        reason = f"the trial ended with code {run.returncode}"
    except (OSError, subprocess.TimeoutExpired) as error:
        reason = str(error)
    return False, (
        f"no off-screen OpenGL ({reason}): install the package libosmesa6 (apt-get install libosmesa6; libegl1 where "
        "that is no longer packaged) for pyvista pictures; until then they come from matplotlib"
    )


def chosen(renderer: Renderer | None) -> tuple[bool, str]:
    """Whether pyvista shall draw, and if not, why; None takes it where OpenGL works.

    Raises
    ------
    InputError
        pyvista was asked for and cannot draw here.
    """
    works, message = (False, "matplotlib was asked for") if renderer == "matplotlib" else gl_available()
    if renderer == "pyvista" and not works:
        raise InputError("renderer", code="B002", value=renderer, allowed="matplotlib", remedy=message)
    return works, message


@contextmanager
def _known_window() -> Iterator[None]:
    """Ask VTK for the kind of window that the trial found, so that it does not complain about others."""
    before = os.environ.get(_WINDOW_VARIABLE)
    os.environ[_WINDOW_VARIABLE] = before or _probe_gl()[1]
    try:
        yield
    finally:
        del os.environ[_WINDOW_VARIABLE]
        if before is not None:
            os.environ[_WINDOW_VARIABLE] = before


def drawn(figure: Figure, axes: Axes, scene: Scene, works: bool, fineness: float = 1.0) -> tuple[Image, Window]:
    """Image (RGBA) of a scene in a figure's axes of the picture plane (see ``frame_axes``), and where it goes.

    ``fineness``: pixels of the image a pixel of the page.
    """
    size = fineness * style.DPI * figure.get_size_inches() * axes.get_position().size
    window = Window((*axes.get_xlim(), *axes.get_ylim()), round(size[0]), round(size[1]))
    if not works:
        return z_buffer_image(scene, window), window
    with _known_window():
        return gl_image(scene, window), window


def show(figure: Figure, axes: Axes, scene: Scene, works: bool) -> None:
    """Draw a scene into such axes."""
    image, window = drawn(figure, axes, scene, works, fineness=FINENESS)
    axes.imshow(image, extent=window.extent, aspect="auto", zorder=2, interpolation="antialiased")
