"""Sphinx builds the site: python -m sphinx -W -b html docs build/site (extra "docs")."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))
sys.path.insert(0, str(HERE))
os.environ |= {"TTY_INTERACTIVE": "0", "COLUMNS": "96"}  # shell cells: no bars, lines as wide as a page
os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])  # of shell cells

import references
from docutils import nodes
from sphinx.util.logging import getLogger

from screwkin import __version__

LOG = getLogger(__name__)

project = "screwkin"
author = "screwkin contributors"
copyright = author
release = version = __version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["images/README.md", "**/__pycache__"]
html_theme = "furo"
html_title = "screwkin"
smartquotes = False  # an option is no dash

myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence"]
suppress_warnings = ["myst.header", "misc.highlighting_failure"]

nb_execution_mode = "force"  # every code cell of the tutorials runs at every build
nb_execution_raise_on_error = True
nb_execution_in_temp = True
nb_execution_timeout = 600
nb_merge_streams = True

autodoc_typehints = "none"  # docstrings give shapes and units, which types do not
autodoc_member_order = "bysource"
nitpicky = True  # every name that a page refers to is on a page
nitpick_ignore_regex = [
    ("py:class", r"(numpy|screwkin)\..*")
]  # types of signatures: not every one has a page
napoleon_use_rtype = False  # what stands before a colon in Returns is a shape, no class


def absolute_values(app, what, name, obj, options, lines) -> None:
    """Bars of docstrings are absolute values, not substitutions."""
    lines[:] = [line.replace("|", r"\|") for line in lines]


def whole_sentences(app, what, name, obj, options, lines) -> None:
    """What stands before a colon in the first line of a property is no type."""
    if what in ("property", "attribute"):
        lines[:0] = ["..", ""]  # an empty comment


def links_out_of_the_site(app, name, source) -> None:
    """Links to results lead to their pages; those to other files of the checkout become their names."""
    if "/" not in name:
        source[0] = re.sub(r"\(\.\./benchmarks/results/([\w-]+\.md)\)", r"(reference/result-\1)", source[0])
        source[0] = re.sub(r"\[([^\]]*)\]\(\.\./([\w/.-]+)\)", r"\1 (`\2`)", source[0])


def pictures_have_words(app, doctree) -> None:
    """A picture without alternative text is a warning; cells give theirs by ``mystnb: image: alt``."""
    for picture in doctree.findall(nodes.image):
        if not picture.get("alt", "").strip():
            LOG.warning("picture without alternative text: %s", picture["uri"], location=picture)


def setup(app) -> None:
    """Write the pages of reference from the code before Sphinx reads the folder."""
    references.write_all(HERE / "reference")
    app.connect("source-read", links_out_of_the_site)
    app.connect("doctree-read", pictures_have_words)
    app.connect("autodoc-process-docstring", whole_sentences, priority=400)  # before napoleon reads it
    app.connect("autodoc-process-docstring", absolute_values)
