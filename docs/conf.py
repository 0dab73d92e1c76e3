"""Settings of the documentation; `make docs` builds it, with warnings as errors and without the network."""

from importlib.metadata import version as version_of
from typing import Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml

project = "vibroimpact"
author = "The vibroimpact developers"
release = version = version_of("vibroimpact")

extensions = ["myst_parser", "sphinx.ext.autodoc", "numpydoc"]
exclude_patterns = ["_build"]
myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 3
autodoc_typehints = "none"
numpydoc_show_class_members = False

html_theme = "pydata_sphinx_theme"
html_math_renderer = "mathml"
html_title = "vibroimpact"
html_sidebars = {"**": []}
html_show_sphinx = False
html_theme_options = {"show_toc_level": 2, "navigation_with_keys": False, "secondary_sidebar_items": ["page-toc"]}


def _formula(node: nodes.Element, as_block: bool) -> str:
    # Without a mathematical font, browsers set dots invisibly close to their letter; primes stand clear.
    tex = node.astext().replace(r"\ddot y", "y''").replace(r"\dot y", "y'")
    mathml: str = tex2mathml(tex, as_block=as_block)
    return f"<p>{mathml}</p>" if as_block else mathml


def _inline(page: Any, node: nodes.math) -> None:
    page.body.append(_formula(node, as_block=False))
    raise nodes.SkipNode


def _block(page: Any, node: nodes.math_block) -> None:
    page.body.append(_formula(node, as_block=True))
    raise nodes.SkipNode


def _keep_bars(*event: Any) -> None:
    # In a docstring |g| is the size of g, not a substitution.
    lines = event[-1]
    lines[:] = [line.replace("|g|", r"\|g\|") for line in lines]


def setup(app: Any) -> None:
    """Write formulas as MathML, which browsers render themselves: no script, no font, no network."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    app.connect("autodoc-process-docstring", _keep_bars)
