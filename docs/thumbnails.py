"""Thumbnails of the gallery: the largest axes of a program's first figure, drawn anew as a square, without words."""

from typing import Any

import matplotlib.pyplot as plt

PIXELS = 320  # two for each of the page's, for dense screens
INCHES = 2.2


def square(figure: Any, path: str) -> None:
    """Draw a figure's largest axes as a square of its own; the figure is spoiled by that."""
    figure.set_layout_engine("none")
    largest = max(figure.axes, key=lambda axes: round(axes.get_position().width * axes.get_position().height, 3))
    hidden = [axes for axes in figure.axes if axes is not largest]
    for artist in (*hidden, *figure.legends, *figure.texts, *largest.texts, largest.get_legend()):
        if artist is not None:
            artist.set_visible(False)
    largest.set(title="", xlabel="", ylabel="", position=(0.02, 0.02, 0.96, 0.96), aspect="auto")
    largest.tick_params(which="both", length=0, labelbottom=False, labelleft=False, labeltop=False, labelright=False)
    figure.set_size_inches(INCHES, INCHES)
    figure.savefig(path, dpi=PIXELS / INCHES, bbox_inches=None)


def scrape(block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Keep the figures of a block as Sphinx-Gallery does, after the first image of a program, its thumbnail."""
    from sphinx_gallery.scrapers import matplotlib_scraper  # tests of `square` run without it

    images, numbers = block_vars["image_path_iterator"], plt.get_fignums()
    if len(images) or not numbers:
        return str(matplotlib_scraper(block, block_vars, gallery_conf))
    path, first = next(images), plt.figure(numbers[0])
    shown = str(matplotlib_scraper(block, block_vars, gallery_conf))
    square(first, path)
    return shown
