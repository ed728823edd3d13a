"""How the documentation is built: ``make docs``."""

import re
import sys
from pathlib import Path

import latex2mathml.converter
from docutils import nodes

import stablepush
from stablepush.core import Word

sys.path.insert(0, str(Path(__file__).parent))

project = "stablepush"
author = "the stablepush developers"
version = release = stablepush.__version__
html_title = f"stablepush {release}"

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_gallery.gen_gallery"]
myst_enable_extensions = ["dollarmath", "amsmath", "deflist"]
myst_heading_anchors = 3
# notebooks are kept without outputs and run when the pages are built
nb_execution_mode = "force"
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_execution_in_temp = True
# commands are no Python
highlight_language = "none"
# formulas are MathML, which browsers draw themselves: pages need no network
html_math_renderer = "mathml"
html_theme = "furo"
templates_path = ["_templates"]
html_static_path = ["_static"]
html_css_files = ["pages.css"]
# options are copied from the pages: two hyphens stay two
smartquotes = False
html_show_sourcelink = False
html_show_copyright = False
nitpicky = False

autodoc_typehints = "none"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "show-inheritance": True}
napoleon_numpy_docstring = True

sphinx_gallery_conf = {
    "examples_dirs": "../examples/gallery",
    "gallery_dirs": "gallery",
    "filename_pattern": r".*\.py$",
    "within_subsection_order": "FileNameSortKey",
    "download_all_examples": False,
    "show_signature": False,
    "abort_on_example_error": True,
    "image_scrapers": ("figures.collect",),
    "show_memory": False,
}
exclude_patterns = [
    *("_build", "jupyter_execute", "sg_execution_times.rst", "gallery/sg_execution_times.rst", "gallery/*.ipynb"),
    *("benchmarks/table.md", "benchmarks/before.md"),
]


def _keep_together(app, name, source):
    """A number stays on one line with its sign of per cent, and with its tolerance."""
    parts = source[0].split("```")
    # what stands between fences is code
    parts[::2] = [re.sub(r"(?<=\d) (?=%)|(?<=±) (?=\d)| (?=±)", "\u00a0", part) for part in parts[::2]]
    source[0] = "```".join(parts)


def _link_names(app, name, source):
    """A public name in a page leads to the reference. The page itself has no markup for it, so that it reads well anywhere."""
    if Path(app.env.doc2path(name)).suffix != ".md":
        return
    parts = source[0].split("```")
    parts[::2] = [re.sub(r"(?<!`)`(?:sp\.)?(\w+)`(?!`)", _reference, part) for part in parts[::2]]
    source[0] = "```".join(parts)


def _reference(found):
    return f"{{py:obj}}`{found[1]} <stablepush.{found[1]}>`" if found[1] in stablepush.__all__ else found[0]


def _list_words(app, what, name, thing, options, lines):
    """A vocabulary lists its words and what they mean."""
    if what == "class" and issubclass(thing, Word):
        lines += ["", *(f"* ``{word.value}``: {word.advice}" for word in thing), ""]


def _formula(display):
    """What Sphinx calls for a formula, in a line or in a block of its own."""

    def visit(writer, node):
        writer.body.append(latex2mathml.converter.convert(node.astext(), display=display))
        raise nodes.SkipNode

    return visit, None


def setup(app):
    """Called by Sphinx."""
    app.add_html_math_renderer("mathml", _formula("inline"), _formula("block"))
    app.connect("autodoc-process-docstring", _list_words)
    app.connect("source-read", _keep_together)
    app.connect("source-read", _link_names)
