"""The site: `make site` builds it from these pages with Sphinx."""

from __future__ import annotations

import os
import sys
from importlib.metadata import version as installed
from pathlib import Path

import ropeode

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

project = "ropeode"
author = "The ropeode developers"
copyright = "The ropeode developers. Text: CC BY 4.0; code: MIT"
release = version = installed("ropeode")

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx_click",
    "sphinx_copybutton",
    "site_pages",
]
exclude_patterns = ["examples", "studies", "data"]

# Markdown
myst_enable_extensions = ["attrs_block", "dollarmath", "html_image"]
myst_heading_anchors = 4
myst_dmath_double_inline = True

# Tutorials are run, and a cell that fails fails the site.
nb_execution_mode = "cache"
nb_execution_cache_path = str(HERE.parent / "build/site-cells")
# The notebook there takes a minute, and tests/test_notebook.py runs it.
nb_execution_excludepatterns = ["howto/*"]
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_merge_streams = True
nb_render_markdown_format = "myst"

# In the kernels compiling takes most of the time: they compile quickly, share what they have
# compiled, and make no program with Equinox's checks, which could not be shared.
_PROGRAMS = {
    "JAX_DISABLE_MOST_OPTIMIZATIONS": "true",
    "JAX_COMPILATION_CACHE_DIR": str(HERE.parent / "build/site-programs"),
    "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
    "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": "-1",
    "EQX_ON_ERROR": "off",
    # JAX writes its cache in place. A kernel that reads half an entry compiles, and a page need not
    # show that.
    "PYTHONWARNINGS": "ignore:Error reading persistent compilation cache entry",
}
for _name, _value in _PROGRAMS.items():
    os.environ.setdefault(_name, _value)

# The interface
autosummary_generate = True
# Some file systems do not tell Horizon from horizon.
_lower = [name.lower() for name in ropeode.__all__]
autosummary_filename_map = {
    f"ropeode.{name}": f"ropeode.{name}-class"
    for name in ropeode.__all__
    if name != name.lower() and _lower.count(name.lower()) > 1
}
autodoc_member_order = "bysource"
autodoc_typehints = "none"
autodoc_default_options = {"members": True, "inherited-members": False}
napoleon_numpy_docstring = False
napoleon_custom_sections = [("Fields", "params_style"), ("Class attributes", "params_style")]
toc_object_entries_show_parents = "hide"
add_module_names = False
napoleon_use_rtype = False
# A name between backticks leads to its page where there is one.
default_role = "py:obj"
copybutton_exclude = ".linenos, .gp, .go"

html_theme = "pydata_sphinx_theme"
html_title = "ropeode"
# Nothing is loaded from elsewhere. MathJax comes with what checks the lab's page.
html_static_path = ["_static", "../tools/node_modules/mathjax/es5/tex-svg.js"]
mathjax_path = "tex-svg.js"
html_css_files = ["site.css"]
html_js_files = [("site.js", {"defer": "defer"})]
html_favicon = html_logo = "_static/logo.svg"
html_show_sourcelink = False
html_theme_options = {
    "logo": {"text": "ropeode", "alt_text": ""},
    "collapse_navigation": True,
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    # The one with words has a name for screen readers that its words do not say.
    "navbar_persistent": ["search-button"],
    "header_links_before_dropdown": 7,
    "search_as_you_type": True,
}
html_context = {"default_mode": "auto"}
templates_path = ["_templates"]
