"""Settings of the documentation: `make docs` builds all of it, `make check` without running gallery and notebooks."""

import hashlib
import re
import sys
from importlib.metadata import version as version_of
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.util.math import get_node_equation_number

project = "vibroimpact"
author = "The vibroimpact developers"
release = version = version_of("vibroimpact")

# Programs and notebooks run again where they, or the package, have changed.
_DOCS = Path(__file__).parent
sys.path.insert(0, str(_DOCS))
_SOURCES = sorted((_DOCS.parent / "src").rglob("*.py"))
_RAN = _DOCS / "_build" / "ran" / hashlib.sha256(b"".join(path.read_bytes() for path in _SOURCES)).hexdigest()[:12]

extensions = [
    "myst_nb",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "sphinxcontrib.bibtex",
]
exclude_patterns = ["_build", "gallery/**.ipynb"]
templates_path = ["_templates"]
myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 3
autodoc_typehints = "none"
bibtex_bibfiles = ["references.bib"]
bibtex_default_style = "unsrt"
nb_execution_mode = "cache"  # `make check` turns it off
nb_execution_cache_path = str(_RAN)
nb_execution_raise_on_error = True
nb_output_stderr = "remove"  # passing lines about what takes longer than a second
nb_execution_timeout = 300
numfig = True
numpydoc_show_class_members = False

# Images on pages of the API that no program of the gallery illustrates.
_PICTURES = {
    "explorer": (
        "the page: parameters, a plane through two of them, and the motion at the point that was clicked",
        "explore",
    ),
    "continuation": (
        "stable and unstable branches over the driving frequency; exact boundaries over a map",
        "switch_branch continuation.BifurcationPoint continuation.Boundary continuation.curves_through "
        "continuation.windows.Window continuation.windows.follow_all continuation.windows.stable_windows "
        "continuation.windows.swept_windows",
    ),
    "orbits": (
        "orbits in the phase plane: stable, unstable, sticking",
        "orbits.orbit_distance orbits.same_orbit orbits.sticking_end.StickingEnd orbits.sticking.find_sticking_orbit",
    ),
    "coexistence": ("basins of two attractors; sweeps up and down", "coexistence.Attractor"),
    "classes": ("names of motions over driving frequency and mass", "motion.Motion motion.MotionClass"),
    "verdict": ("two designs: time history, phase portrait, impact map", "describe verdict.Verdict impact_map"),
    "refinement": ("a refined map, and which of its cells were computed", "to_uniform"),
    "stability-map": (
        "a map of Std with its boundary, as it is drawn from a sweep that was saved",
        "save load plotting.save_figure plotting.default_kind",
    ),
    "model": ("the model of the paper: mass, spring, damper, sine force, clearance and stop", "studies.lee.run"),
    "machines/clamped_beam_with_stop": ("a clamped beam that hits a stop", "models.beam_modes.beam_modes"),
    "machines/pinned_beam_with_stop": ("a pinned beam that hits a stop", "models.beam_modes.BeamModes"),
}
autosummary_context = {
    "pictures": {
        image: {"alt": alt, "names": [f"vibroimpact.{name}" for name in names.split()]}
        for image, (alt, names) in _PICTURES.items()
    }
}

sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r"\.py$",
    "backreferences_dir": "gallery/used",
    "doc_module": ("vibroimpact",),
    "abort_on_example_error": True,
    "image_scrapers": ("thumbnails.scrape",),
    "thumbnail_size": (320, 320),
    "capture_repr": (),
    "run_stale_examples": not _RAN.exists(),
    "download_all_examples": False,
    "show_signature": False,
    "write_computation_times": False,
}

html_theme = "pydata_sphinx_theme"
html_math_renderer = "mathml"
html_title = "vibroimpact"
html_static_path = ["_static"]
html_css_files = ["pages.css"]
html_show_sphinx = False
html_show_sourcelink = False
html_theme_options = {
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "secondary_sidebar_items": ["page-toc"],
    "header_links_before_dropdown": 6,
}


_NAMED = r"(?:sin|cos|tan|arctan|sinh|cosh|ln|log|exp|Im|Re|det|max|min)(?![A-Za-z])"
_DOTTED = re.compile(r'<munderover>\s*(<mi>[^<]*</mi>)(.*?)(<mo stretchy="false">[˙¨]</mo>)\s*</munderover>', re.DOTALL)


def _formula(node: nodes.Element, as_block: bool) -> str:
    # docutils sets no space around the names of functions, and the index of a dotted letter below it.
    tex = re.sub(rf"(?<=[\w}})]) *(\\{_NAMED})", r"\\,\1", node.astext())
    tex = re.sub(rf"(\\{_NAMED}) *(?=[A-Za-z0-9]|\\(?!left|lvert|big|,))", r"\1\\,", tex)
    return _DOTTED.sub(r'<msub><mover accent="true">\1\3</mover>\2</msub>', str(tex2mathml(tex, as_block=as_block)))


def _inline(page: Any, node: nodes.math) -> None:
    page.body.append(_formula(node, as_block=False))
    raise nodes.SkipNode


def _block(page: Any, node: nodes.math_block) -> None:
    page.body.append(page.starttag(node, "div", CLASS="math"))
    if node["number"]:
        page.body.append(f'<span class="eqno">({get_node_equation_number(page, node)})</span>')
    page.body.append(f'<div class="formula" tabindex="0">{_formula(node, as_block=True)}</div></div>')
    raise nodes.SkipNode


def _keep_bars(*event: Any) -> None:
    # In a docstring |g| is the size of g, not a substitution.
    lines = event[-1]
    lines[:] = [line.replace("|g|", r"\|g\|") for line in lines]


def setup(app: Any) -> None:
    """Write formulas as MathML, which browsers render themselves: no script, no network."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    app.connect("autodoc-process-docstring", _keep_bars)
