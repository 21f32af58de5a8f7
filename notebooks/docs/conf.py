"""The site: prose, the notebooks as last run, every command and every public name.

``sphinx-build -W -c notebooks/docs notebooks site``, from the repository's root.  Pages about
commands, modules and scenes are first written into ``generated``, from the program itself.
"""

import dataclasses
import inspect
import re
import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

import figures  # noqa: E402
import pages  # noqa: E402

import jaxpf  # noqa: E402
from jaxpf.contract.options import options_of  # noqa: E402

project, version, release = "jaxpf", jaxpf.__version__, jaxpf.__version__
author = "The jaxpf developers"
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",  # a link from each name to its source
    "sphinx-mathjax-offline",
]
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
html_title = f"jaxpf {version}"
html_copy_source = html_show_copyright = False
html_theme_options = {"navbar_persistent": []}  # one search box, in the sidebar
html_static_path = ["static"]
html_css_files = ["style.css"]


def is_bare_field(app, what, name, value, skip, options):
    """Skip the fields of named tuples: the class's docstring describes them."""
    return True if (value.__doc__ or "").startswith("Alias for field number") else None


def readable_arguments(app, what, name, obj, options, signature, returns):
    """Show a dataclass's fields with their defaults, and functions by their names."""
    if what == "class" and dataclasses.is_dataclass(obj):
        fields = inspect.signature(obj).parameters.values()
        plain = [field.replace(annotation=inspect.Parameter.empty) for field in fields]
        signature = str(inspect.Signature(plain))
    signature = (signature or "").replace("<lambda>", "lambda")
    return re.sub(r"<(?:function )?([\w.]+)(?: at \w+)?>", r"\1", signature) or None, returns


#: How Sphinx writes ``jax.Array`` and ``jax.typing.ArrayLike``.
ARRAY = re.compile(r"jax\.jaxlib\._jax\.Array( \| numpy\.ndarray( \| [\w.]+)*)?")


def readable_text(app, what, name, obj, options, lines):
    """Name the type of arrays, describe options, and leave out Python's word on named tuples."""
    kept = [line for line in lines if not line.startswith("Create new instance of ")]
    lines[:] = [ARRAY.sub(_array, line) for line in kept]
    if inspect.isfunction(obj) or (what == "class" and dataclasses.is_dataclass(obj)):
        field = "param" if what == "function" else "ivar"
        lines += [f":{field} {each.name}: {each.help}" for each in options_of(obj).values()]


def _array(found):
    return "array | None" if "None" in found[0] else "array"


def setup(app):
    """Write the generated pages, and stored figures, before the site is built."""
    app.connect("builder-inited", lambda app: pages.write(HERE / "generated"))
    app.connect("builder-inited", lambda app: figures.write())
    app.connect("autodoc-skip-member", is_bare_field)
    app.connect("autodoc-process-signature", readable_arguments)
    app.connect("autodoc-process-docstring", readable_text, priority=900)  # after Napoleon
