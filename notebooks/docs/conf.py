"""The site: prose, the notebooks as last run, every command and every public name.

``sphinx-build -W -c notebooks/docs notebooks site``, from the repository's root.  Pages about
commands, modules and scenes are first written into ``generated``, from the program itself.
"""

import dataclasses
import inspect
import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

import pages  # noqa: E402

import jaxpf  # noqa: E402

project, version, release = "jaxpf", jaxpf.__version__, jaxpf.__version__
author = "The jaxpf developers"
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx-mathjax-offline"]
root_doc = "index"
# Another page includes the counts.
exclude_patterns = ["**/.ipynb_checkpoints", "docs/generated/counts.md"]
myst_enable_extensions = ["deflist", "dollarmath"]
myst_heading_anchors = 3
nb_execution_mode = "off"
napoleon_use_ivar = True
autodoc_typehints = "none"  # docstrings give shapes and units
autoclass_content = "both"  # arguments are documented in __init__
html_theme = "sphinx_book_theme"
html_title = "jaxpf"
html_copy_source = html_show_copyright = False
html_theme_options = {"navbar_persistent": []}  # one search box, in the sidebar
html_static_path = ["static"]
html_css_files = ["style.css"]


def is_bare_field(app, what, name, value, skip, options):
    """Skip the fields of named tuples: the class's docstring describes them."""
    return True if (value.__doc__ or "").startswith("Alias for field number") else None


def arguments_of_fields(app, what, name, obj, options, signature, returns):
    """Show the fields of a dataclass, with their defaults, where ``__new__`` takes anything."""
    if what != "class" or not dataclasses.is_dataclass(obj):
        return None
    fields = inspect.signature(obj).parameters.values()
    plain = [field.replace(annotation=inspect.Parameter.empty) for field in fields]
    return str(inspect.Signature(plain)), returns


def setup(app):
    """Write the generated pages before the site is built."""
    app.connect("builder-inited", lambda app: pages.write(HERE / "generated"))
    app.connect("autodoc-skip-member", is_bare_field)
    app.connect("autodoc-process-signature", arguments_of_fields)
