"""What figures show."""

from matplotlib.collections import QuadMesh


def legend_texts(ax):
    """Return the lines of the legend, without the spaces that align numbers."""
    return [text.get_text().replace("\u2007", "") for text in ax.get_legend().get_texts()]


def meshes(ax):
    """Return the coloured planes in the axes."""
    return [artist for artist in ax.collections if isinstance(artist, QuadMesh)]
