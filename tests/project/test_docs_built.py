"""The built documentation: links lead somewhere, nothing comes from the network; `make check` builds it first."""

from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from fenced import ROOT

BUILT = next((path for name in ("check", "html") if (path := ROOT / "docs" / "_build" / name).is_dir()), Path())
PAGES = sorted(page for page in BUILT.rglob("*.html") if page.parent.name != "_static") if BUILT.name else []
# What is wider than its own box, though nothing scrolls there on purpose.
CUT = """narrow => {
  const article = document.querySelector('.bd-article') || document.body;
  const scrolls = narrow ? '' : 'pre, ';
  const boxes = [document.documentElement, ...article.querySelectorAll(
    scrolls + 'td, th, dt, p, li, figcaption, h1, h2, h3, .sd-card-body')];
  return boxes.filter(box => box.clientWidth && box.scrollWidth > box.clientWidth + 1)
    .map(box => box.tagName + ': ' + box.textContent.trim().slice(0, 60));
}"""
# The contrast of text with what is behind it, by WCAG 2; AA asks for 4.5, and for 3 of large text.
FAINT = """() => {
  const parse = text => {
    const numbers = text.match(/[\\d.]+/g).map(Number);
    return [...numbers.slice(0, 3), numbers.length > 3 ? numbers[3] : 1];
  };
  const over = (top, below) => [0, 1, 2].map(i => top[i] * top[3] + below[i] * (1 - top[3]));
  const light = colour => colour.map(part => part / 255)
    .map(part => part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4)
    .reduce((sum, part, i) => sum + part * [0.2126, 0.7152, 0.0722][i], 0);
  const behind = element => {
    const layers = [];
    for (let each = element; each; each = each.parentElement)
      layers.push(parse(getComputedStyle(each).backgroundColor));
    return layers.reverse().reduce((below, top) => over(top, below), [255, 255, 255]);
  };
  const faint = new Set();
  for (const element of document.querySelectorAll('.bd-main *, .bd-header *')) {
    const own = [...element.childNodes].some(node => node.nodeType === 3 && node.textContent.trim());
    if (!own || !element.checkVisibility({visibilityProperty: true, opacityProperty: true})) continue;
    const style = getComputedStyle(element), back = behind(element);
    const [a, b] = [light(over(parse(style.color), back)), light(back)].sort((x, y) => y - x);
    const size = parseFloat(style.fontSize), large = size >= 24 || (size >= 18.66 && style.fontWeight >= 700);
    const contrast = (a + 0.05) / (b + 0.05);
    if (contrast < (large ? 3 : 4.5))
      faint.add(element.tagName + '.' + element.className + ' ' + style.color + ' ' + contrast.toFixed(2));
  }
  return [...faint];
}"""
ANSWERS = {
    "35 Hz: how hard, and how to reduce it": ("guide/one_speed.html", "How to reduce it"),
    "two stops with different r": ("guide/several_stops.html", "Two stops with different restitution"),
    "an uncertain gap": ("guide/uncertain.html", "Uncertain parameters"),
    "what closed means": ("reference/glossary.html", "Statuses"),
    "is there a GPU": ("about/gpu.html", "GPU"),
}
pytestmark = pytest.mark.skipif(not PAGES, reason="the documentation is not built")


class Page(HTMLParser):
    """What a page links to, what it loads, and the anchors that it has."""

    def __init__(self, path):
        super().__init__()
        self.links, self.loaded, self.anchors, self.headings = [], [], set(), []
        self._in_heading = False
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        if tag in ("h1", "h2", "h3"):
            self._in_heading = True
            self.headings.append("")
        self.anchors |= {given[name] for name in ("id", "name") if given.get(name)}
        if tag == "a" and given.get("href"):
            self.links.append(given["href"])
        if tag == "link" and set(given.get("rel", "").split()) & {"stylesheet", "preload", "icon", "modulepreload"}:
            self.loaded.append(given["href"])
        if given.get("src"):
            self.loaded.append(given["src"])

    def handle_endtag(self, tag):
        self._in_heading &= tag not in ("h1", "h2", "h3")

    def handle_data(self, data):
        if self._in_heading:
            self.headings[-1] += data


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


@pytest.mark.long
@pytest.mark.parametrize("width", [390, 768, 1024, 1366, 1600, 1920])
def test_nothing_is_cut_at_any_width_of_a_window(browser, width):
    """Code and wide tables may scroll in their own boxes; code beside a sidebar need not."""
    page, cut = browser.new_page(viewport={"width": width, "height": 900}), {}
    for path in PAGES:
        page.goto(path.as_uri())
        cut[str(path.relative_to(BUILT))] = page.evaluate(CUT, width < 1024)
    page.close()
    assert {name: boxes for name, boxes in cut.items() if boxes} == {}


def test_formulas_have_their_own_font_and_stretching_roots_and_open_at_their_beginning(browser):
    page = browser.new_page(viewport={"width": 390, "height": 900})
    page.goto((BUILT / "theory" / "equations.html").as_uri())
    assert page.evaluate("document.fonts.load('1em \"STIX Two Math\"').then(found => found.length)") == 1
    heights = page.evaluate("""() => ['<mi>x</mi>', '<mfrac><mi>x</mi><mfrac><mi>x</mi><mi>x</mi></mfrac></mfrac>'].map(
        inner => {
          const formula = document.createElement('div');
          formula.innerHTML = `<math display="block"><msqrt>${inner}</msqrt></math>`;
          document.body.append(formula);
          return formula.querySelector('msqrt').getBoundingClientRect().height;
        })""")
    assert heights[1] > 2 * heights[0]
    boxes = page.evaluate("""() => [...document.querySelectorAll('div.math .formula')].map(box => [
        box.scrollLeft, box.firstElementChild.getBoundingClientRect().left - box.getBoundingClientRect().left])""")
    page.close()
    assert boxes
    assert all(scrolled == 0 and left > -1 for scrolled, left in boxes)


@pytest.mark.long
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_text_stands_out_from_what_is_behind_it(browser, theme):
    page, faint = browser.new_page(viewport={"width": 1366, "height": 900}, color_scheme=theme), {}
    for path in PAGES:
        if "generated" not in path.parts:
            page.goto(path.as_uri())
            page.evaluate(f"document.documentElement.dataset.theme = '{theme}'")
            faint[str(path.relative_to(BUILT))] = page.evaluate(FAINT)
    page.close()
    assert {name: found for name, found in faint.items() if found} == {}


@pytest.mark.parametrize("question", ANSWERS)
def test_a_newcomers_question_is_answered_within_two_clicks_of_the_home_page(question):
    place, heading = ANSWERS[question]
    reached = {BUILT / "index.html"}
    for _ in range(2):
        reached |= {
            (path.parent / unquote(urlsplit(link).path)).resolve()
            for path in reached
            if path.suffix == ".html" and path.is_file()
            for link in page_at(path).links
            if not urlsplit(link).scheme and urlsplit(link).path
        }
    assert (BUILT / place).resolve() in reached
    assert heading in [found.rstrip("#¶").strip() for found in page_at(BUILT / place).headings]
