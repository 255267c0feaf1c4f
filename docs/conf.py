"""The site: ``make docs`` builds it from the pages in this folder, from the commands and from the packages."""

from __future__ import annotations

import sys
from importlib.metadata import version as version_of
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE / "_site"), str(HERE.parent)]

import command_pages  # noqa: E402 - found beside this file
import docstrings  # noqa: E402
import failure_pages  # noqa: E402
import gallery_pages  # noqa: E402
import gallery_runs  # noqa: E402
import key_pages  # noqa: E402
import package_pages  # noqa: E402
import signatures  # noqa: E402

project = "stiffarm"
author = "The stiffarm maintainers"
project_copyright = author
release = version = version_of("stiffarm")

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx_gallery.gen_gallery"]
root_doc = "index"
# sphinx-gallery's own index: the gallery's is gallery/index.md.
exclude_patterns = ["_site", "gallery/scripts/index.rst"]
sphinx_gallery_conf = gallery_runs.prepare()

myst_enable_extensions = ["deflist", "colon_fence", "fieldlist"]
# Headings can be linked to as on GitHub.
myst_heading_anchors = 3
# Examples of code carry no language where they show what goes over a pipe or what is typed.
highlight_language = "none"
# A checkout may lie in a folder with a blank in its name, which no link of the gallery has.
suppress_warnings = ["misc.highlighting_failure", "sphinx_gallery.space_in_filename"]

# Docstrings are plain English with `code` in single backticks.
default_role = "code"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_member_order = "bysource"
autodoc_type_aliases = {name: name for name in ("Array", "Bools", "Integers", "Indices")}
autodoc_preserve_defaults = True
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 88
# Types in signatures come from everywhere; links between pages are all checked.
nitpick_ignore_regex = [(r"py:.*", r".*")]

html_theme = "furo"
html_title = f"stiffarm {version}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sourcelink = False
# The theme brings its own fonts and scripts; nothing comes from another host.
html_theme_options = {"navigation_with_keys": True}


def setup(app: object) -> None:
    """Write the generated pages, then let docstrings be read as they are meant."""
    command_pages.write(HERE / "reference" / "commands")
    failure_pages.write(HERE / "reference" / "failures")
    key_pages.write(HERE / "reference" / "keys")
    package_pages.write(HERE / "reference" / "python")
    gallery_pages.setup(app)  # type: ignore[arg-type]
    app.connect("autodoc-process-docstring", docstrings.readable, priority=400)  # type: ignore[attr-defined]
    app.connect("autodoc-process-signature", docstrings.short)  # type: ignore[attr-defined]
    app.connect("html-page-context", signatures.plain)  # type: ignore[attr-defined]
