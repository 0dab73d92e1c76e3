"""What a verdict tells."""

import re

import vibroimpact as vi


def text_of(verdict):
    """Return a verdict in words, without breaks."""
    return " ".join(str(verdict).split())


def line(verdict, title):
    """Return what stands under a title, without breaks."""
    found, here = [], False
    for row in str(verdict).splitlines():
        here = row.startswith(title) or (here and row.startswith(" " * 12))
        found += [row[12:].strip()] * here
    return " ".join(found)


def numbers(text, before, after=""):
    """Return the numbers that follow some words and precede others."""
    return [float(found) for found in re.findall(rf"{before}([-\d.e]+){after}", text)]


def edge(verdict, parameter, direction):
    """Return the nearest boundary of a motion below (-1) or above (1) a parameter."""
    return next(e for e in verdict.boundaries if (e.parameter, e.direction) == (parameter, direction))


def hardest_hit(model, start=None):
    """Return the hardest of 4000 impacts in m/s; 0 without impacts."""
    section = vi.impact_section(model, start=start, transient_impacts=3000, sample_impacts=4000)
    return float(section["velocity"].max()) if section.sizes["impact"] else 0.0
