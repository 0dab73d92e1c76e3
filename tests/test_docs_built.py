"""The built documentation: links lead somewhere, nothing comes from the network; `make check` builds it first."""

from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from fenced import ROOT

BUILT = next((path for name in ("check", "html") if (path := ROOT / "docs" / "_build" / name).is_dir()), Path())
PAGES = sorted(page for page in BUILT.rglob("*.html") if page.parent.name != "_static") if BUILT.name else []
pytestmark = pytest.mark.skipif(not PAGES, reason="the documentation is not built")


class Page(HTMLParser):
    """What a page links to, what it loads, and the anchors that it has."""

    def __init__(self, path):
        super().__init__()
        self.links, self.loaded, self.anchors = [], [], set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        self.anchors |= {given[name] for name in ("id", "name") if given.get(name)}
        if tag == "a" and given.get("href"):
            self.links.append(given["href"])
        if tag == "link" and set(given.get("rel", "").split()) & {"stylesheet", "preload", "icon", "modulepreload"}:
            self.loaded.append(given["href"])
        if given.get("src"):
            self.loaded.append(given["src"])


page_at = cache(Page)


@pytest.mark.long
def test_every_link_inside_leads_to_a_page_and_an_anchor_that_are_there():
    broken = []
    for path in PAGES:
        for link in page_at(path).links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            anchor = unquote(parts.fragment)
            found = target.is_file() and (not anchor or target.suffix != ".html" or anchor in page_at(target).anchors)
            if not found:
                broken.append(f"{path.relative_to(BUILT)}: {link}")
    assert broken == []


def test_no_page_loads_a_script_a_style_a_font_or_a_picture_from_another_host():
    loaded = {f"{path.relative_to(BUILT)}: {each}" for path in PAGES for each in page_at(path).loaded}
    assert [each for each in loaded if urlsplit(each.split(": ", 1)[1]).netloc] == []
    styles = {path: path.read_text(encoding="utf-8") for path in BUILT.rglob("*.css")}
    assert [path.name for path, text in styles.items() if "url(http" in text or "url(//" in text] == []


def test_everything_a_page_loads_is_there():
    missing = []
    for path in PAGES:
        for each in page_at(path).loaded:
            parts = urlsplit(each)
            if not parts.scheme and not (path.parent / unquote(parts.path)).resolve().is_file():
                missing.append(f"{path.relative_to(BUILT)}: {each}")
    assert missing == []
