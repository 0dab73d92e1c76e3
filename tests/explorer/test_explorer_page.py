"""The explorer's page in a real browser: what a person does, and what the page asks for."""

import contextlib
import re
import subprocess
import sys
from urllib.parse import urlsplit

import pytest

playwright_api = pytest.importorskip("playwright.sync_api", reason="no playwright: install the extra [web-test]")
pytest.importorskip("tornado", reason="needs the extra [web]")
PATIENCE = 300_000  # ms: tells a page that hangs, not a loaded machine that compiles its kernels meanwhile
# Without the limits of time: what a page shows in the end must not depend on how busy this machine is.
SERVE = (
    "from vibroimpact.explorer import explore, session, work; "
    "work.PLANE_SECONDS = session.LINE_SECONDS = session.SEARCH_SECONDS = float('inf'); "
    "explore({store!r}, port={port}, browser=False, {more})"
)
QUICK = "m=1&c=0.01&k=1&f=1&w=2&r=0.8&g=0&x=w,1.8,2.2&y=m,0.9,1.1&index=std&n=200"


@contextlib.contextmanager
def serving(store=None, port=0, before="", more=""):
    code = before + SERVE.format(store=store, port=port, more=more)
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    try:
        line = process.stdout.readline()
        yield re.search(r"http://\S+", line).group()
    finally:
        process.terminate()
        process.communicate(timeout=PATIENCE / 1000)


@pytest.fixture(scope="module")
def address():
    with serving() as found:
        yield found


@contextlib.contextmanager
def open_model(browser, address):
    page = browser.new_page(viewport={"width": 1366, "height": 768}, accept_downloads=True)
    page.address = address
    yield page
    page.close()


@pytest.fixture
def tab(browser, address):
    """A tab that notes every request and every complaint; both are judged at the end of every test."""
    complaints, requests = [], []
    with open_model(browser, address) as page:
        page.on("console", lambda message: message.type in ("error", "warning") and complaints.append(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("request", lambda request: requests.append(request.url))
        yield page
    outside = [
        url for url in requests if not url.startswith((address, address.replace("http", "ws"), "blob:", "data:"))
    ]
    assert not outside
    assert not complaints


def load(page, query=QUICK, side=64):
    page.goto(f"{page.address}?{query}")
    until(page, "window.explorer && window.explorer.ready > 0 && window.explorer.drawn > 0")
    until(page, f"window.explorer.planes.some(p => p[0] >= {side})")


def drawn(page):
    return page.evaluate("window.explorer.drawn")


def click(page, right, down):
    """Click a place in the frame of the plane, given as shares, and wait until the motion is drawn."""
    before = drawn(page)
    box = page.locator("#plane-plot").bounding_box()
    page.mouse.click(box["x"] + 80 + right * (box["width"] - 180), box["y"] + 10 + down * (box["height"] - 60))
    until(page, f"window.explorer.drawn > {before}")


def until(page, condition):
    page.wait_for_function(condition, timeout=PATIENCE)


def enter(page, name, text):
    """Type a number into its field."""
    page.fill(f"#number_{name}", text)
    page.press(f"#number_{name}", "Enter")


def tip_at(page, x, y):
    """Return what the page says where the pointer is over the plane."""
    box = page.locator("#plane-canvas").bounding_box()
    page.mouse.move(box["x"] + x, box["y"] + y)
    page.locator("#tip").wait_for(state="visible")
    return page.inner_text("#tip")


def test_the_page_shows_plane_point_and_numbers(tab):
    load(tab)
    assert "From rest: period-1 impact-1, stable, largest impact velocity 6.23 m/s once per period" in tab.inner_text(
        "#sentence"
    )
    assert "6.2264" in tab.inner_text("#numbers")
    ends = tab.evaluate("""["time", "displacement", "velocity", "speeds", "phases"].map((name) => {
      const values = [...Motion.motions[0][name]];
      return [values.length, Math.min(...values), Math.max(...values)]; })""")
    (samples, _, _), (_, low, high), (_, slow, fast), speeds, phases = ends
    assert samples > 1000
    assert -6.0 < low < -5.0
    assert high == 0.0
    assert (slow, fast) == pytest.approx((-0.8 * 6.2264, 6.2264), rel=1e-4)
    assert speeds[1:] == pytest.approx([6.2264, 6.2264], rel=1e-4)
    assert 0.0 <= phases[1] <= phases[2] < 1.0


def test_a_click_shows_another_motion_and_the_address_tells_it(tab, browser):
    load(tab)
    click(tab, 0.2, 0.3)
    until(tab, "!location.search.includes('w=2&')")
    there = tab.inner_text("#numbers")
    with open_model(browser, tab.address) as other:
        load(other, urlsplit(tab.url).query)
        assert other.inner_text("#numbers") == there


@pytest.mark.long
def test_a_click_draws_every_plot_once_and_leaves_each_its_size(tab):
    load(tab, side=256)  # the finest, which is drawn no more
    until(tab, "document.getElementById('others').textContent !== ''")
    heights = "[...document.querySelectorAll('canvas')].map((one) => one.clientHeight)"
    before = tab.evaluate(heights)
    tab.evaluate("""() => { window.count = {};
      for (const [name, plot] of Object.entries({ ...Motion.plots, plane: Plane.plot, below: Motion.below })) {
        const draw = plot.draw;
        window.count[name] = 0;
        plot.draw = function () { window.count[name] += 1; draw.call(this); };
      } }""")
    click(tab, 0.2, 0.3)
    until(tab, "window.count.below === 2")  # where the point is, and then the diagram along another line
    until(tab, "document.getElementById('others').textContent !== ''")
    assert tab.evaluate("window.count") == {
        "history": 1, "portrait": 1, "poincare": 1, "impact_map": 1, "plane": 1, "below": 2,
    }  # fmt: skip
    assert tab.evaluate(heights) == before


def test_a_slider_renews_the_plane(tab):
    load(tab)
    tab.evaluate("window.explorer.planes.length = 0")
    tab.fill("#slider_damping", "50")  # of 500 steps from 0 to 1 N s/m
    until(tab, "window.explorer.planes.some(p => p[0] === 256)")
    until(tab, "location.search.includes('c=0.1&')")
    assert tab.input_value("#number_damping") == "0.1"
    tab.keyboard.press("Control+z")
    until(tab, "location.search.includes('c=0.01&')")


def test_a_typed_number_out_of_range_is_answered(tab):
    load(tab)
    for typed, words in (("3", "must be between 0 and 1, got 3"), ("bouncy", "must be a number, got 'bouncy'")):
        enter(tab, "restitution", typed)
        until(tab, f"document.getElementById('message').textContent.includes({words!r})")
        until(tab, "document.getElementById('number_restitution').value === '0.8'")


def test_a_number_is_typed_and_escape_leaves_what_was(tab):
    load(tab)
    tab.fill("#number_mass", "1.05")
    tab.press("#number_mass", "Escape")
    assert tab.input_value("#number_mass") == "1"
    enter(tab, "mass", "1.0512345678901234")
    until(tab, "location.search.includes('m=1.0512345678901234&')")
    assert tab.input_value("#slider_mass") == str(round(500 * (1.0512345678901234 - 0.1) / 4.9))
    assert tab.get_attribute("#slider_mass", "aria-valuetext") == "1.0512345678901234"
    tab.focus("#number_mass")
    for key in ("7", "Backspace", "Tab"):  # taken back: the field follows the slider again
        tab.keyboard.press(key)
    tab.focus("#slider_mass")
    tab.keyboard.press("End")
    until(tab, "document.getElementById('number_mass').value === '5'")
    enter(tab, "mass", "10")
    until(tab, "document.getElementById('slider_mass').getAttribute('aria-valuetext') === '10'")
    tab.focus("#slider_mass")
    tab.keyboard.press("ArrowLeft")
    until(tab, "document.getElementById('number_mass').value === '9.98'")


def test_a_slider_takes_arrows_and_leaves_other_keys_to_the_page(tab):
    load(tab)
    tab.focus("#slider_gap")
    places = []
    for _ in range(5):  # quicker than the server answers: no step is lost
        tab.keyboard.press("ArrowRight")
        places.append(int(tab.input_value("#slider_gap")))
    assert places == [251, 252, 253, 254, 255]
    until(tab, "new URLSearchParams(location.search).get('g') === '0.04'")
    tab.keyboard.press("m")
    until(tab, "location.search.includes('index=motion')")
    tab.keyboard.press("Control+z")
    tab.keyboard.press("Control+z")
    until(tab, "document.getElementById('slider_gap').value === '250'")


def shown_x(page):
    """Return the ends of the x axis, as the address has them."""
    return [*map(float, re.search(r"x=w,([^,&]+),([^,&]+)", page.url).groups())]


def test_scrolling_zooms_and_computes_what_is_seen(tab):
    load(tab)
    box = tab.locator("#plane-plot").bounding_box()
    tab.mouse.move(box["x"] + 200, box["y"] + 150)
    tab.evaluate("window.explorer.planes.length = 0")
    for _ in range(3):
        tab.mouse.wheel(0, -300)
    until(tab, "window.explorer.planes.some(p => p[0] === 256)")
    until(tab, "!location.search.includes('x=w,1.8,2.2')")
    low, high = shown_x(tab)
    assert high - low < 0.35
    tab.keyboard.press("h")
    until(tab, "location.search.includes('x=w,0.025,5')")


def test_a_box_drawn_with_shift_becomes_the_plane_and_a_drag_moves_it(tab):
    load(tab)

    def drag():
        tab.mouse.move(*(middle[axis] - 50 for axis in (0, 1)))
        tab.mouse.down()
        tab.mouse.move(middle[0], middle[1])
        tab.mouse.move(*(middle[axis] + 50 for axis in (0, 1)))
        tab.mouse.up()

    box = tab.locator("#plane-canvas").bounding_box()
    middle = box["x"] + 62 + 0.5 * (box["width"] - 128), box["y"] + 150
    tab.keyboard.down("Shift")
    drag()
    tab.keyboard.up("Shift")
    tab.wait_for_function("!location.search.includes('x=w,1.8,2.2')")
    low, high = shown_x(tab)
    boxed = high - low
    assert boxed == pytest.approx(0.4 * 100 / (box["width"] - 128), rel=0.02)
    before = tab.url
    drag()
    tab.wait_for_function(f"location.href !== {before!r}")
    low, high = shown_x(tab)
    assert high - low == pytest.approx(boxed, rel=1e-6)
    assert "w=2&" in tab.url  # neither was a click


def test_the_pointer_over_the_plane_tells_value_and_name_of_the_cell(tab):
    load(tab)
    width = tab.locator("#plane-canvas").bounding_box()["width"]
    tip = tip_at(tab, 62 + 0.5 * (width - 128), 150).split("\n")
    assert re.fullmatch(r"ω (2|2\.00\d*|1\.99\d*) rad/s", tip[0])
    assert re.fullmatch(r"m \d\S* kg", tip[1])
    assert re.fullmatch(r"Std of impact velocities \d\S* [fpnµm]?m/s", tip[2])
    assert tip[3] == "from rest: period-1 impact-1"
    tab.mouse.down()
    assert not tab.locator("#tip").is_visible()
    tab.mouse.up()
    tab.mouse.move(5, 5)
    assert not tab.locator("#tip").is_visible()


def test_zoom_ends_where_double_precision_does_and_says_so(tab):
    load(tab, "w=2&x=w,1.9999999999,2.0000000001&y=m,0.9999999999,1.0000000001&n=200&c=0.01&m=1&k=1&f=1&r=0.8&g=0")
    for _ in range(12):
        tab.keyboard.press("+")
        tab.wait_for_timeout(60)
    until(tab, "document.getElementById('message').textContent.includes('double precision')")
    until(tab, "(() => { const [, low, high] = location.search.match(/x=w,([^,&]+),([^,&]+)/);"
               "         return 0 < high - low && high - low < 1e-11; })()")  # fmt: skip


def test_presets_set_everything(tab):
    load(tab)
    tab.locator("#menu_case").select_option(label="Relief valve on its seat")
    until(tab, "location.search.includes('m=0.04&c=3.7&k=34590') && location.search.includes('case=valve')")
    until(tab, "document.getElementById('controls').innerText !== undefined")
    assert tab.get_by_text("Wu, Li and Deng").count() == 1
    assert tab.get_by_text("Idealised:").count() == 1


def test_a_system_is_chosen_shown_at_all_of_its_stops_and_at_one(tab):
    """Against impacts of the package itself, after as many others."""
    import numpy as np

    import vibroimpact as vi

    load(tab)
    assert not tab.locator("#menu_stop").is_visible()
    tab.select_option("#menu_case", label="Model: impact pair")
    until(tab, "Motion.motions[0]?.walls.length === 2 && document.getElementById('number_clearance')")
    section = vi.impact_section(vi.models.impact_pair(), transient_impacts=2000, sample_impacts=120)
    velocity, stop = section["velocity"].values, section["stop"].values
    assert tab.locator("#menu_stop option").all_inner_texts() == ["at all stops", "at left", "at right"]
    for number, name in enumerate(("", "left", "right")):
        tab.select_option("#menu_stop", index=number)
        struck = np.unique(np.round(velocity[(stop == name) | (name == "")], 8))
        ends = f"[{struck[0]}, {struck[-1]}]"
        extremes = "[Math.min, Math.max].map((end) => end(...Motion.motions[0].speeds))"
        until(tab, f"{extremes}.every((one, k) => Math.abs(one - {ends}[k]) < 1e-4)")
        speeds = tab.evaluate("[...Motion.motions[0].speeds]")  # the last of them have settled
        assert sorted(speeds[-len(struck) :]) == pytest.approx(struck, rel=1e-5)
    tab.select_option("#menu_coordinate", label="coordinate 1")
    until(tab, "Motion.plots.portrait.x === 'coordinate 1 [m]'")
    tab.get_by_role("button", name="Undo").click()
    until(tab, "Motion.plots.portrait.x === 'y at right [m]'")


def test_two_pins_are_compared(tab):
    load(tab)
    for right, down in ((0.2, 0.3), (0.7, 0.6)):
        click(tab, right, down)
        tab.keyboard.press("p")
    until(tab, "document.getElementById('numbers').innerText.includes('B')")
    tab.wait_for_function("() => location.href.split('pin=').length === 3")
    tab.keyboard.press("u")
    until(tab, "!location.search.includes('pin=')")


def test_a_click_below_the_plane_moves_the_point_along_the_line(tab):
    load(tab)
    box = tab.locator("#line").bounding_box()
    before = drawn(tab)
    tab.mouse.click(box["x"] + 62 + 0.25 * (box["width"] - 128), box["y"] + 40)
    until(tab, f"window.explorer.drawn > {before}")
    until(tab, "Math.abs(new URLSearchParams(location.search).get('w') - 1.9) < 0.005")


def test_a_plot_of_the_motion_zooms_pans_and_comes_back(tab):
    load(tab)
    picture = "document.getElementById('portrait').toDataURL()"
    home = tab.evaluate(picture)
    box = tab.locator("#portrait").bounding_box()
    middle = box["x"] + 0.5 * box["width"], box["y"] + 0.4 * box["height"]
    tab.mouse.move(*middle)
    assert re.fullmatch(r"−?[\d.]+ m, −?[\d.]+ m/s", tab.locator(".plot output").nth(1).inner_text())
    tab.mouse.wheel(0, -200)
    until(tab, f"{picture} !== {home!r}")
    zoomed = tab.evaluate(picture)
    tab.mouse.down()
    tab.mouse.move(middle[0] + 30, middle[1] + 10)
    tab.mouse.up()
    assert tab.evaluate(picture) not in (home, zoomed)
    tab.mouse.dblclick(*middle)
    until(tab, f"{picture} === {home!r}")


def test_the_link_holds_speed_and_zoom_too(tab, browser):
    load(tab)
    tab.select_option("#speed", "2")
    tab.evaluate("Motion.plots.portrait.zoom(0.25, { x: -2, y: 1 })")
    until(tab, "location.hash.includes('portrait')")
    part = tab.evaluate("Motion.plots.portrait.part")
    assert "#speed=2&portrait=" in tab.url
    with open_model(browser, tab.address) as other:
        other.goto(tab.url)
        until(other, "window.explorer && window.explorer.drawn > 0 && Motion.plots.portrait.part")
        assert other.evaluate("Motion.plots.portrait.part") == pytest.approx(part, rel=1e-8)
        assert other.input_value("#speed") == "2"
        assert other.evaluate("Motion.plots.history.part") is None
    click(tab, 0.2, 0.3)  # another motion is seen whole
    until(tab, "location.hash === '#speed=2'")


def test_what_cannot_be_read_behind_the_address_is_left_out_in_words(tab):
    tab.goto(f"{tab.address}?{QUICK}#portrait=1,0,nan,<b>")
    until(tab, "document.getElementById('message').textContent.includes('is invalid and was ignored')")
    assert tab.evaluate("location.hash") == ""
    assert tab.locator("#message b").count() == 0


def test_the_motion_plays(tab):
    load(tab)
    tab.click("#play")
    first = tab.evaluate("document.getElementById('play-canvas').toDataURL()")
    until(tab, f"document.getElementById('play-canvas').toDataURL() !== '{first}'")
    tab.click("#play")


SI = "m=2.1&c=4.75&k=26860&f=5&w=157&r=0.7&g=0.0005&x=w,60,220&y=g,0.0001,0.0015&index=max_velocity&n=200"
TINY = "m=1&c=0.05&k=1&f=1e-06&w=1.2&r=0.7&g=2e-06&x=g,-4e-06,4e-06&y=f,1e-07,3e-06&index=max_velocity&n=200"
LABELS = """() => {
  const found = {}, draw = CanvasRenderingContext2D.prototype.fillText, ratio = window.devicePixelRatio;
  CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
    const { width } = this.measureText(text), size = parseInt(this.font, 10), at = this.getTransform();
    const left = x - width * { left: 0, start: 0, center: 0.5, right: 1 }[this.textAlign];
    const top = y - size * { top: 0, middle: 0.5, alphabetic: 0.8 }[this.textBaseline];
    const corners = [[left, top], [left + width, top + size]].map(([a, b]) => at.transformPoint({ x: a, y: b }));
    const ends = (axis) => corners.map((one) => one[axis] / ratio).sort((a, b) => a - b);
    (found[this.canvas.id] ||= []).push([text, ...ends("x"), ...ends("y")]);
  };
  for (const plot of [...Object.values(Motion.plots), Motion.below, Plane.plot]) plot.draw();
  CanvasRenderingContext2D.prototype.fillText = draw;
  return Object.entries(found).map(([id, texts]) => [texts, byId(id).clientWidth, byId(id).clientHeight]);
  function byId(id) { return document.getElementById(id); } }"""


@pytest.mark.long(but=1)
@pytest.mark.parametrize("query", [QUICK, SI, TINY, TINY + "&log=1&b=1"])
def test_no_label_of_a_plot_covers_another_or_leaves_it(tab, query):
    load(tab, query)
    plots = tab.evaluate(LABELS)
    for width, height in ((1100, 640), (390, 844)):
        tab.set_viewport_size({"width": width, "height": height})
        plots += tab.evaluate(LABELS)
    assert len(plots) == 18
    for texts, width, height in plots:
        for at, (text, left, right, top, bottom) in enumerate(texts):
            assert left >= -1 and right <= width + 1 and top >= -1 and bottom <= height + 1, text  # noqa: PT018
            assert len(text) < 8 or not re.fullmatch(r"[−\d.e]+", text)
            for other, left_, right_, top_, bottom_ in texts[:at]:
                assert left >= right_ or left_ >= right or top >= bottom_ or top_ >= bottom, (text, other)


@pytest.mark.long
def test_cells_that_hit_from_other_initial_conditions_are_hatched(tab):
    load(tab, SI)
    tab.get_by_text("no impact from rest; impacts from other initial conditions (16 tried)").wait_for(timeout=PATIENCE)
    stripes = """([x, y]) => {
      const { plot } = Plane, [left, top] = [plot.px(x), plot.py(y)].map((at) => Math.round(at) - 24);
      const copy = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
      copy.drawImage(plot.canvas, left, top, 48, 48, 0, 0, 48, 48);
      const { data } = copy.getImageData(0, 0, 48, 48);
      const dark = Array.from({ length: data.length / 4 }, (_, k) => data[4 * k] < 0xa0);
      return dark.filter(Boolean).length / dark.length; }"""
    hatched, plain = [165, 0.0006], [200, 0.001]
    assert 0.05 < tab.evaluate(stripes, hatched) < 0.4
    assert tab.evaluate(stripes, plain) == 0.0
    tip = tip_at(tab, *tab.evaluate("[Plane.plot.px(165), Plane.plot.py(0.0006)]")).split("\n")
    assert tip[1].endswith(" mm")
    assert tip[2] == "from rest: no impact"
    assert re.fullmatch(r"from another initial condition: impacts of up to 0\.1\d* m/s", tip[3])
    tab.mouse.wheel(0, -100)  # the stripes stay as wide while the plane is zoomed
    assert 0.05 < tab.evaluate(stripes, hatched) < 0.4


# What is written, with its contrast against what lies behind it, through all shadow trees; menus are opened first.
CONTRASTS = """() => {
  const numbers = (color) => { const [r, g, b, a = 1] = color.match(/[\\d.]+/g).map(Number); return [r, g, b, a]; };
  const light = (color) => color.slice(0, 3).map((one) => one / 255)
    .map((one) => (one <= 0.04045 ? one / 12.92 : ((one + 0.055) / 1.055) ** 2.4))
    .reduce((sum, one, at) => sum + one * [0.2126, 0.7152, 0.0722][at], 0);
  const ratio = (one, other) => {
    const [low, high] = [light(one), light(other)].sort((a, b) => a - b);
    return (high + 0.05) / (low + 0.05);
  };
  const behind = (element) => {
    for (let one = element; one; one = one.assignedSlot || one.parentElement || one.getRootNode().host) {
      const color = numbers(getComputedStyle(one).backgroundColor);
      if (color[3] > 0) return color;
    }
    return [255, 255, 255, 1];
  };
  const found = [];
  const look = (root) => {
    for (const element of root.querySelectorAll("*")) {
      const own = [...element.childNodes].some((node) => node.nodeType === 3 && node.textContent.trim());
      const typed = element.matches("input:not([type=range]):not([type=checkbox])");
      const text = typed ? element.value : own ? element.textContent.trim() : "";
      const seen = element.checkVisibility() || element.matches("option");
      if (!text || element.matches("style, script") || !seen) continue;
      const style = getComputedStyle(element);
      found.push([text, ratio(numbers(style.color), behind(element)), Number(style.opacity)]);
    }
  };
  for (const menu of document.querySelectorAll("details")) menu.open = true;
  document.querySelector("#tip").hidden = false;
  const { ink, paper } = Plots.LOOK;
  document.querySelector("#tip").innerHTML = `tip <b style="color:${ink}; background:${paper}">of plots</b>`;
  document.querySelector("#message").textContent = "message";
  document.querySelector("#message").classList.add("shown");
  document.querySelector("#help").showModal();
  look(document);
  return found; }"""


@pytest.mark.long(but=1)
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_all_that_is_written_stands_out_in_light_and_dark(tab, scheme):
    from vibroimpact.explorer.controls import EXPORTS

    tab.emulate_media(color_scheme=scheme)
    load(tab, f"{SI}&pin=2.1,4.75,26860,5,120,0.7,0.0008")
    until(tab, "document.getElementById('others').textContent !== ''")
    found = tab.evaluate(CONTRASTS)
    assert {label for label, _ in EXPORTS} <= {text for text, _, _ in found}
    assert {"↶ Undo", "of plots", "message", "at rest", "here", "0.0005"} <= {text for text, _, _ in found}
    assert len(found) > 150
    assert [one for one in found if one[1] < 4.5 or one[2] < 1.0] == []  # WCAG 2.1, 1.4.3, level AA
    paper = tab.evaluate("[...Motion.plots.history.pen.getImageData(1, 1, 1, 1).data]")
    assert (paper[0] > 128) is (scheme == "light")


@pytest.mark.long
def test_the_page_says_that_it_connects_computes_and_is_ready(tab):
    tab.add_init_script("""document.addEventListener("DOMContentLoaded", () => {
      const box = document.getElementById("state");
      window.states = [box.textContent];
      new MutationObserver(() => window.states.push(box.textContent)).observe(box, { childList: true });
    })""")
    load(tab)
    until(tab, "window.states.at(-1) === 'ready'")
    assert tab.evaluate("window.states") == ["connecting …", "computing …", "ready"]
    enter(tab, "restitution", "3")  # refused: nothing to compute
    until(tab, "document.getElementById('number_restitution').value === '0.8'")
    enter(tab, "restitution", "0.7")
    until(tab, "window.states.length === 5")
    assert tab.evaluate("window.states.slice(3)") == ["computing …", "ready"]


@pytest.mark.long
def test_a_page_that_loses_its_server_says_so_and_comes_back_with_what_it_showed(browser, tmp_path):
    with contextlib.ExitStack() as ended:
        with serving(port=0) as found:
            page = ended.enter_context(open_model(browser, found))
            load(page)
            enter(page, "restitution", "0.75")
            until(page, "location.search.includes('r=0.75')")
        page.get_by_text("lost, reconnecting …").wait_for(timeout=PATIENCE)
        ended.enter_context(serving(port=urlsplit(found).port))
        page.get_by_text("ready", exact=True).wait_for(timeout=PATIENCE)
        assert page.input_value("#number_restitution") == "0.75"
        page.close()


def test_every_control_has_a_name_and_the_keyboard_reaches_it(tab):
    load(tab)
    for opened in ("#export summary", "#help-button"):
        tree = tab.locator("body").aria_snapshot()
        assert "slider" in tree
        assert (
            re.findall(r"- (?:button|combobox|textbox|slider|checkbox|img|application)(?: \[.*\])?:?$", tree, re.M)
            == []
        )
        tab.focus(opened)
        tab.keyboard.press("Enter")
    tab.keyboard.press("Escape")
    tab.focus("h1 >> xpath=ancestor::body")
    reached = set()
    for _ in range(60):
        tab.keyboard.press("Tab")
        reached.add(tab.evaluate("document.activeElement.id || document.activeElement.value"))
    canvases = {"plane-canvas", "line", "history", "portrait", "poincare", "impact_map"}
    assert reached >= {
        *canvases,
        "copy",
        "help-button",
        "play",
        "speed",
        "number_mass",
        "slider_gap",
        "menu_case",
        "menu_x",
        "undo",
    }


def test_numbers_of_machines_stand_in_hertz_turns_per_minute_and_millimetres_too(tab):
    load(tab, SI)
    also = "[...document.querySelectorAll('#parameters label')].map((one) => one.dataset.also).filter(Boolean)"
    assert tab.evaluate(also) == ["24.99 Hz, 1499 rpm", "0.5 mm"]
    assert tab.evaluate("Plots.also(2, 'rad/s') + Plots.also(0, 'm') + Plots.also(7, 'kg')") == ""
    assert re.match(r"ω \S+ rad/s \(\S+ Hz, \S+ rpm\)\ng \S+ mm\n", tip_at(tab, 200, 100))


def test_a_pinned_motion_with_another_gap_has_its_own_wall(tab):
    load(tab, f"{SI}&pin=2.1,4.75,26860,5,120,0.7,0.0003")
    until(tab, "Motion.motions[1]")
    tab.evaluate("""window.rules = []; {
      const { rule } = Motion.plots.history;
      for (const plot of Object.values(Motion.plots)) {
        plot.rule = function (...given) {
          window.rules.push([this.canvas.id, ...given.slice(0, 3)]);
          rule.call(this, ...given);
        };
        plot.draw();
      } }""")
    assert tab.evaluate("window.rules") == [
        [name, axis, pytest.approx(0.0003), "#d55e00"]
        for name, axis in (("history", "y"), ("portrait", "x"), ("poincare", "x"))
    ]
    ends = tab.evaluate("Motion.plots.history.range.y")
    assert ends[0] < 0.0003 < ends[1]


@pytest.mark.long
def test_an_exported_picture_is_the_view_at_twice_its_size(tab, tmp_path):
    """Boundaries, pins and what plots are zoomed to included; compared with a picture of the page."""
    image = pytest.importorskip("matplotlib.image")
    load(tab, f"{SI}&b=1&pin=2.1,4.75,26860,5,120,0.7,0.0003")
    tab.get_by_text("ready", exact=True).wait_for(timeout=PATIENCE)
    tab.evaluate("Motion.plots.portrait.zoom(0.5, { x: 0, y: 0 })")
    places = [tab.locator(name).bounding_box() for name in ("#plane", "#point")]
    tab.focus("#export summary")
    tab.keyboard.press("Enter")
    with tab.expect_download() as waiting:
        tab.get_by_role("button", name="Picture (.png)").press("Enter")
    waiting.value.save_as(tmp_path / "view.png")
    tab.screenshot(path=tmp_path / "page.png")
    left, top = places[0]["x"], places[0]["y"]
    right, bottom = places[1]["x"] + places[1]["width"], places[1]["y"] + places[1]["height"]
    drawn = image.imread(tmp_path / "view.png")[..., :3]
    picture = image.imread(tmp_path / "page.png")[int(top) : int(bottom), int(left) : int(right), :3]
    assert drawn.shape[:2] == (round(2 * (bottom - top)), round(2 * (right - left)))
    rows, columns = (min(a, b // 2) for a, b in zip(picture.shape[:2], drawn.shape[:2], strict=True))
    picture = picture[:rows, :columns]
    small = drawn[: 2 * rows, : 2 * columns].reshape(rows, 2, columns, 2, 3).mean((1, 3))
    assert (abs(small - picture).max(-1) < 0.25).mean() > 0.9


def test_ticks_show_what_the_view_has_and_change_it(tab):
    load(tab)
    tab.get_by_label("logarithmic colours").check()
    until(tab, "location.search.includes('log=1')")
    tab.keyboard.press("g")  # the same by its key, though a box has the focus
    until(tab, "!location.search.includes('log=1')")
    assert not tab.get_by_label("logarithmic colours").is_checked()
    assert tab.get_by_label("show the settled motion").is_checked()


def test_a_plot_takes_arrows_and_the_plane_moves_its_point_by_them(tab):
    load(tab)
    tab.focus("#portrait")
    tab.keyboard.press("+")
    tab.keyboard.press("ArrowRight")
    left, right, low, high = tab.evaluate("Motion.plots.portrait.part")
    home = tab.evaluate("[...Motion.plots.portrait.home.x, ...Motion.plots.portrait.home.y]")
    width = (home[1] - home[0]) / 1.2
    assert right - left == pytest.approx(width)
    assert left + right == pytest.approx(home[0] + home[1] + 0.2 * width)
    assert low + high == pytest.approx(home[2] + home[3])
    tab.keyboard.press("Home")
    assert tab.evaluate("Motion.plots.portrait.part") is None
    assert "w=2&" in tab.url
    tab.focus("#plane-canvas")
    tab.keyboard.press("ArrowRight")
    until(tab, "Math.abs(new URLSearchParams(location.search).get('w') - 2.00625) < 1e-4")


# A machine in the units of its drawing: Hz, rpm, mm, N/m2.
ROTOR = """
import math, vibroimpact as vi
@vi.family(units={"frequency_Hz": "Hz", "clearance_mm": "mm", "fan": "rpm", "youngs_modulus": "N/m2"})
def rotor(frequency_Hz=25.0, clearance_mm=0.5, fan=1500.0, youngs_modulus=200e9, restitution=0.7):
    return vi.ImpactOscillator(mass=2.1, damping=4.75, stiffness=1.343e-7 * youngs_modulus, restitution=restitution,
        amplitude=5.0 * (fan / 1500.0) ** 2, omega=2.0 * math.pi * frequency_Hz, gap=clearance_mm / 1e3)
"""
COMPARED = {
    "mass": f"{SI}&pin=2.1,4.75,26860,5,120,0.7,0.0008&pin=2.1,4.75,26860,5,180,0.6,0.0003",
    "system": "model=two_sided_oscillator&n=200",
    "family": "model=rotor&n=200&pin=22,0.4,1400,200000000000,0.7&pin=27,0.8,1600,150000000000,0.6",
}


@pytest.fixture(scope="module")
def rotor():
    with serving(before=ROTOR, more="model=rotor, name='rotor'") as found:
        yield found


# Labels, cells and controls whose text is wider than they are; what is chosen in a menu is measured as it is drawn.
CUT = """() => [...document.querySelectorAll("body *")].filter((one) => {
  if (!one.checkVisibility() || one.matches("script, style, canvas, option, input[type=range]")) return false;
  if (!one.matches("select")) return one.clientWidth > 0 && one.scrollWidth > one.clientWidth;
  const pen = document.createElement("canvas").getContext("2d"), { font } = getComputedStyle(one);
  pen.font = font;
  return pen.measureText(one.selectedOptions[0].text).width > one.clientWidth - 26;  // its arrow
}).map((one) => `${one.tagName} ${one.id} ${one.value ?? one.textContent}`.slice(0, 80))"""
SMALL_TARGETS = """() => [...document.querySelectorAll("button, select, summary, input")]
  .filter((one) => one.checkVisibility()).map((one) => one.matches("[type=checkbox]") ? one.closest("label") : one)
  .filter((one) => { const { width, height } = one.getBoundingClientRect(); return width < 24 || height < 24; })
  .map((one) => one.outerHTML.slice(0, 80))"""


@pytest.mark.long(but=1)
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("shown", COMPARED)
def test_two_pins_are_compared_and_no_text_is_cut_at_any_width(browser, rotor, shown, scheme):
    with open_model(browser, rotor) as page:
        page.emulate_media(color_scheme=scheme)
        load(page, COMPARED[shown], side=16)
        if shown == "system":
            for right in (0.2, 0.7):
                click(page, right, 0.3)
                page.keyboard.press("p")
        until(page, "document.querySelectorAll('#numbers tr:first-child td').length === 6")  # here, A, B, twice
        until(page, "document.getElementById('others').textContent !== ''")
        for width in (390, 768, 1024, 1366, 1600, 1920):
            page.set_viewport_size({"width": width, "height": 844 if width < 1366 else 768})
            assert page.evaluate("document.documentElement.scrollWidth") == width
            assert page.evaluate(CUT) == []
            assert page.evaluate(SMALL_TARGETS) == []
        named = page.locator("#numbers th").all_inner_texts()
        drawn_words = page.evaluate("""() => {
          const { fillText } = CanvasRenderingContext2D.prototype, words = [];
          CanvasRenderingContext2D.prototype.fillText = function (text, ...place) {
            words.push(text); fillText.call(this, text, ...place); };
          Picture.draw();
          CanvasRenderingContext2D.prototype.fillText = fillText;
          return words; }""")
        assert {word for name in named for word in name.split()} <= set(drawn_words)
        assert [one for one in page.evaluate(CONTRASTS) if one[1] < 4.5 or one[2] < 1.0] == []


def test_a_family_is_shown_in_its_own_units_from_the_axes_to_the_link(browser, rotor):
    with open_model(browser, rotor) as page:
        load(page, "model=rotor&n=200")
        labels = page.locator("#parameters label").all_inner_texts()
        assert labels == ["frequency [Hz]", "clearance [mm]", "fan [rpm]", "youngs modulus [N/m²]", "restitution"]
        assert page.locator("#menu_x option").all_inner_texts()[:2] == ["frequency", "clearance"]
        assert page.evaluate("[Plane.plot.x, Plane.plot.y, Motion.below.x]") == [labels[0], labels[1], labels[0]]
        assert page.locator("#parameters label").nth(3).get_attribute("data-also") == "200 GPa"
        assert page.input_value("#number_youngs_modulus") == "200000000000"
        for name, typed, value in (
            ("clearance_mm", "0.0004 m", 0.4),
            ("fan", "20Hz", 1200),
            ("youngs_modulus", "190GPa", 19e10),
        ):
            enter(page, name, typed)
            until(page, f"Number(new URLSearchParams(location.search).get('{name}')) === {value}")
        assert re.match(r"frequency \S+ Hz\nclearance \S+ mm\n", tip_at(page, 200, 100))
        assert not page.get_by_label("driving frequency in Hz").is_visible()  # it is


def test_a_typed_number_may_have_a_unit_and_a_message_leaves_when_the_value_is_right(tab):
    load(tab, SI)
    for typed, search in (("0.4mm", "g=0.0004&"), ("-2e-1 mm", "g=-0.0002&"), ("−0.0001", "g=-0.0001&")):
        enter(tab, "gap", typed)
        until(tab, f"location.search.includes('{search}')")
    assert tab.input_value("#number_gap") == "−0.0001"
    enter(tab, "gap", "3kg")
    until(tab, "document.getElementById('message').textContent.includes('a unit that can be turned into m')")
    enter(tab, "gap", "0.5mm")
    tab.locator("#message").wait_for(state="hidden")


def test_a_third_pin_says_what_it_replaces(tab):
    load(tab)
    for right in (0.2, 0.5, 0.8):
        assert not tab.locator("#message").is_visible()
        click(tab, right, 0.3)
        tab.keyboard.press("p")
    until(tab, "document.getElementById('message').textContent.startsWith('Two points are compared: pin A (ω = ')")


def test_the_text_at_the_pointer_covers_neither_pointer_nor_point_nor_pins(browser, rotor):
    with open_model(browser, rotor) as page:
        for width in (390, 1366):
            page.set_viewport_size({"width": width, "height": 768})
            load(page, COMPARED["family"])
            places = page.evaluate("""() => {
              const { plot } = Plane, tip = document.getElementById("tip"), found = [];
              const marked = [[25, 0.5], [22, 0.4], [27, 0.8]].map(([x, y]) => [plot.px(x), plot.py(y)]);
              for (let a = 0.02; a < 1; a += 0.08) for (let b = 0.02; b < 1; b += 0.08) {
                const at = { offsetX: plot.left + a * plot.width, offsetY: plot.top + b * plot.height };
                plot.describe(at);
                const { left, top } = plot.canvas.getBoundingClientRect(), box = tip.getBoundingClientRect();
                found.push([[box.left - left, box.right - left, box.top - top, box.bottom - top],
                            [[at.offsetX, at.offsetY], ...marked],
                            [plot.left, plot.left + plot.width, plot.top, plot.top + plot.height]]);
              }
              return found; }""")
            for (left, right, top, bottom), kept, frame in places:
                assert left >= frame[0] - 1 and right <= frame[1] + 1 and top >= frame[2] - 1 and bottom <= frame[3] + 1  # noqa: PT018
                for x, y in kept if width > 390 else kept[:1]:
                    assert not (left - 5 < x < right + 5 and top - 5 < y < bottom + 5)


def test_on_a_phone_the_plane_and_its_sliders_are_on_one_screen(tab):
    tab.set_viewport_size({"width": 390, "height": 844})
    load(tab, SI)
    plane, sliders = (tab.locator(name).bounding_box() for name in ("#plane-plot", "#parameters"))
    assert plane["y"] + plane["height"] < sliders["y"]
    assert sliders["y"] + sliders["height"] - plane["y"] <= 844


def test_a_number_has_one_minus_sign_everywhere(tab):
    load(tab, QUICK.replace("g=0", "g=-0.2") + "&pin=1,0.01,1,1,2,0.8,-0.1&pin=1,0.01,1,1,1.9,0.8,-0.1")
    until(tab, "document.getElementById('numbers').innerText.includes('B')")
    enter(tab, "mass", "-1")
    until(tab, "document.getElementById('message').textContent.includes('got −1')")
    until(tab, "document.getElementById('number_mass').value === '1'")
    fields = "[...document.querySelectorAll('#parameters input[type=text]')].map((one) => one.value)"
    texts = [
        tab.inner_text("body"),
        *tab.evaluate(fields),
        *(text for texts, _, _ in tab.evaluate(LABELS) for text, *_ in texts),
    ]
    assert [text for text in texts if re.search(r"(?<![\w])-(?=[.\d])", text)] == []
    assert "−0.2" in texts


def test_the_driving_frequency_is_shown_in_hertz_where_that_is_ticked(tab):
    load(tab, SI)
    tab.get_by_label("driving frequency in Hz").check()
    until(tab, "location.search.includes('x=frequency,9.54')")
    assert tab.evaluate("Plane.plot.x") == "driving frequency ω/2π [Hz]"
    assert tab.input_value("#number_frequency") == "24.98732606542757"
    enter(tab, "frequency", "1500rpm")
    until(tab, "location.search.includes('frequency=25&')")
    tab.get_by_label("driving frequency in Hz").uncheck()
    until(tab, "location.search.includes('w=157.07963267948966&') && location.search.includes('x=w,60,220&')")


def test_plots_follow_the_system_from_light_to_dark_at_once(tab):
    load(tab)
    picture = "document.getElementById('portrait').toDataURL()"
    light = tab.evaluate(picture)
    tab.emulate_media(color_scheme="dark")
    until(tab, f"{picture} !== {light!r}")
    assert tab.evaluate("Motion.plots.portrait.pen.getImageData(1, 1, 1, 1).data[0]") < 64
    tab.emulate_media(color_scheme="light")
    until(tab, f"{picture} === {light!r}")


@pytest.mark.long(but=1)
@pytest.mark.parametrize("width", [390, 768, 1024, 1600])
def test_the_page_fits_the_width_of_a_phone_a_tablet_and_a_screen(tab, width):
    tab.set_viewport_size({"width": width, "height": 844})
    load(tab, SI)
    assert tab.evaluate("document.documentElement.scrollWidth") == width
    boxes = [tab.locator(f"#{name}").bounding_box() for name in ("plane", "point", "parameters")]
    columns = len({box["x"] for box in boxes})
    assert columns == {390: 1, 768: 1, 1024: 2, 1600: 3}[width]
    for canvas in tab.locator("main canvas").all():
        box = canvas.bounding_box()
        assert box["width"] > 140
        assert box["height"] > 50
    beyond = """[...document.querySelectorAll("body *")].filter((one) => one.checkVisibility() && one.id !== "message")
      .map((one) => [one.tagName, one.id, one.getBoundingClientRect()])
      .filter(([, , { left, right, width }]) => width && (left < -1 || right > innerWidth + 1))
      .map(([tag, id]) => tag + id)"""
    assert tab.evaluate(beyond) == []
    header = tab.locator("header").bounding_box()
    assert header["height"] < (130 if width < 768 else 80)


@pytest.mark.long(but=1)
@pytest.mark.parametrize(("item", "name", "holds"), [("Python lines (.py)", "view.py", b"parameter_map"),
                                                     ("Study file (.toml)", "study.toml", b"[axes]"),
                                                     ("Picture (.png)", "view.png", b"PNG")])  # fmt: skip
def test_exports_are_files(tab, item, name, holds):
    load(tab)
    tab.focus("#export summary")
    tab.keyboard.press("Enter")
    with tab.expect_download() as waiting:
        tab.get_by_role("button", name=item).press("Enter")
    assert not tab.get_by_role("button", name=item).is_visible()
    assert waiting.value.suggested_filename == name
    with open(waiting.value.path(), "rb") as file:
        assert holds in file.read()


@pytest.mark.long(but=1)
@pytest.mark.parametrize(
    "query", ["w=<script>alert(1)</script>", "w=1e400", "x=w,5,1", "pin=a", "n=99999999", "a" * 3000]
)
def test_hostile_addresses_give_a_message_and_the_usual_view(tab, query):
    load(tab, query)
    assert "This link cannot be shown" in tab.inner_text("#message")
    assert tab.locator("#message script").count() == 0


def test_two_tabs_do_not_disturb_each_other(tab, browser):
    load(tab)
    with open_model(browser, tab.address) as other:
        load(other, QUICK.replace("w=2&", "w=2.1&"))
        click(tab, 0.3, 0.3)
        tab.wait_for_timeout(500)
        assert "w=2.1&" in other.url
        assert other.inner_text("#numbers") != tab.inner_text("#numbers")


@pytest.mark.long
def test_a_stored_study_opens(browser, tmp_path):
    import numpy as np

    import vibroimpact as vi

    path = tmp_path / "run.zarr"
    vi.parameter_map(
        vi.ImpactOscillator(), omega=np.linspace(1.9, 2.1, 6), mass=[0.9, 1.0, 1.1], sample_impacts=50, store=path
    )
    with serving(str(path)) as found, open_model(browser, found) as page:
        page.goto(found)
        until(page, "window.explorer && window.explorer.planes.length > 0")
        page.get_by_text("stored sweep run.zarr").wait_for(timeout=PATIENCE)


@pytest.mark.long
def test_a_page_for_which_there_is_no_room_says_so(browser):
    full = "from vibroimpact.explorer import server; server.MOST_PAGES = 0; "
    with serving(before=full) as found, open_model(browser, found) as page:
        page.goto(found)
        until(page, "document.getElementById('message').textContent.includes('Close one, then reload this page.')")
        assert page.locator("#message").is_visible()
