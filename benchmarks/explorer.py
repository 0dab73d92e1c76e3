"""How fast the explorer answers: a page load, clicks, sliders, twenty pages, and a soak, in headless Chromium.

With `--strangers` only: its memory, and how soon the next page comes, beside connections that never speak and after
pages that were dropped; no browser is needed.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import random
import re
import shutil
import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from typing import Any
from urllib.parse import urlsplit
from urllib.request import urlopen

import numpy as np

FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
         "--disable-component-update", "--disable-sync"]  # fmt: skip
SERVE = "import vibroimpact as vi; from vibroimpact.explorer import explore; explore(model={}, port=0, browser=False)"
THREE_MODES = "vi.family(vi.models.tube_in_supports)"
TARGETS = {  # ms, MB
    "first view": 300.0, "click, median": 60.0, "click, 95 %": 90.0, "slider to 64 x 64": 400.0,
    "slider to 256 x 256": 4000.0, "between updates while two sliders are dragged": 100.0, "soak, growth": 50.0,
    "twenty pages, click, median": 400.0, "the same, planes on their way": 400.0, "three modes, click, median": 130.0,
}  # fmt: skip
# from the moment the finger leaves the button until the frame after the one in which all four plots were painted
CLICK = """async ([x, y]) => { const e = window.explorer, before = e.drawn; window.up = 0;
  document.addEventListener("pointerup", () => { window.up = performance.now(); }, { capture: true, once: true }); }"""


@contextmanager
def serving(model: str = "None") -> Any:
    process = subprocess.Popen([sys.executable, "-c", SERVE.format(model)], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        found = re.search(r"http://\S+", process.stdout.readline())
        assert found is not None
        yield found.group(), process.pid
    finally:
        process.terminate()
        process.communicate(timeout=10)


def memory(pid: int) -> float:
    """Return the resident memory of a process in MB."""
    with open(f"/proc/{pid}/status") as file:
        return float(re.search(r"VmRSS:\s+(\d+)", file.read()).group(1)) / 1024.0  # type: ignore[union-attr]


def load(page: Any, address: str) -> float:
    begun = time.perf_counter()
    page.goto(address)
    page.wait_for_function("window.explorer && window.explorer.ready > 0 && window.explorer.drawn > 0", timeout=60_000)
    return 1e3 * (time.perf_counter() - begun)


def wait_until_settled(page: Any) -> None:
    page.wait_for_function("window.explorer.planes.some(p => p[0] === 256)", timeout=60_000)
    page.wait_for_timeout(2500)


def places(page: Any, rng: random.Random) -> Any:
    while True:
        box = page.locator("#plane-plot").bounding_box()  # a button above it may come and go
        yield box["x"] + 90 + rng.random() * (box["width"] - 220), box["y"] + 20 + rng.random() * (box["height"] - 90)


def click(page: Any, place: tuple[float, float]) -> float:
    before = page.evaluate("window.explorer.drawn")
    page.mouse.move(*place)
    page.evaluate(CLICK, list(place))
    page.mouse.click(*place)
    page.wait_for_function(f"window.explorer.drawn > {before}", timeout=20_000)
    return float(page.evaluate("window.explorer.drawn_at - window.up"))


def clicks(page: Any, number: int, pause: float = 300.0) -> list[float]:
    spots = places(page, random.Random(1))
    times = []
    for _ in range(number):
        page.wait_for_timeout(pause)
        times.append(click(page, next(spots)))
    return times


def slides(page: Any, number: int) -> tuple[list[float], list[float]]:
    coarse, fine = [], []
    for at in range(number):
        page.evaluate(
            "value => { const slider = document.getElementById('slider_damping');"
            " window.explorer.planes.length = 0; window.slid = performance.now();"
            " slider.value = value; slider.dispatchEvent(new Event('input')); }",
            10 + 5 * at,  # of 500 steps
        )
        page.wait_for_function("window.explorer.planes.some(p => p[0] === 256)", timeout=60_000)
        for side, times in ((64, coarse), (256, fine)):
            times.append(page.evaluate(f"window.explorer.planes.find(p => p[0] === {side})[1] - window.slid"))
    return coarse, fine


def drags(page: Any, seconds: float = 4.0) -> float:
    """Return the time between updates of the motion while two sliders are moved in turn, a step every 20 ms, in ms."""
    return float(page.evaluate(
        """async seconds => { const e = window.explorer, before = e.drawn, begun = performance.now();
          for (let k = 0; performance.now() - begun < 1000 * seconds; k += 1) {
            const slider = document.getElementById(k % 2 ? "slider_damping" : "slider_omega");
            slider.value = 150 + k % 100; slider.dispatchEvent(new Event("input"));
            await new Promise((next) => setTimeout(next, 20));
          }
          return (performance.now() - begun) / (e.drawn - before); }""",
        seconds,
    ))  # fmt: skip


def crowd(browser: Any, address: str, pages: int, rounds: int, settled: bool) -> list[float]:
    """Return the times of pages that click once a second each, in turns; their first planes may still be computed."""
    open_pages = []
    for _ in range(pages):
        page = browser.new_page(viewport={"width": 1366, "height": 768})
        load(page, address)
        open_pages.append((page, places(page, random.Random(len(open_pages)))))
    for page, _ in open_pages if settled else ():
        wait_until_settled(page)
    open_pages[-1][0].wait_for_timeout(3000)
    arm = """() => { window.times = window.times || []; const e = window.explorer, before = e.drawn;
      document.addEventListener("pointerup", () => { const up = performance.now(); const look = () => {
        if (e.drawn > before) window.times.push(e.drawn_at - up); else setTimeout(look, 5); }; look(); },
        { capture: true, once: true }); }"""
    for _ in range(rounds):
        begun = time.perf_counter()
        for number, (page, spots) in enumerate(open_pages):
            page.evaluate(arm)
            page.mouse.click(*next(spots))
            wait = begun + (number + 1) / pages - time.perf_counter()
            if wait > 0.0:
                time.sleep(wait)
    open_pages[-1][0].wait_for_timeout(3000)
    times = [value for page, _ in open_pages for value in page.evaluate("window.times")]
    for page, _ in open_pages:
        page.close()
    return times


def soak(page: Any, pid: int, seconds: float) -> float:
    """Return by how many MB the server grows under a scripted user, after a first tenth of the time."""
    spots, begun, first = places(page, random.Random(3)), time.perf_counter(), 0.0
    while (gone := time.perf_counter() - begun) < seconds:
        if not first and gone > 0.1 * seconds:
            first = memory(pid)
        page.mouse.click(*next(spots))
        page.wait_for_timeout(300)
        page.keyboard.press(random.choice(["+", "-", "h", "m", "g", "p", "u", "d", "ArrowLeft", "Control+z"]))
        page.wait_for_timeout(700)
    return memory(pid) - first


async def visit(address: str, stays: float = 0.0) -> float:
    """Open a page as its script does, drop it some s after it has its content, and return after how many ms it had."""
    from tornado.httpclient import HTTPRequest
    from tornado.websocket import websocket_connect

    begun, place = time.perf_counter(), urlsplit(address).netloc
    await asyncio.to_thread(lambda: urlopen(address, timeout=60).read())
    request = HTTPRequest(f"ws://{place}/ws", headers={"Origin": f"http://{place}"})
    tab = await websocket_connect(request, max_message_size=1 << 28)
    assert await tab.read_message() is not None  # the view
    taken = 1e3 * (time.perf_counter() - begun)
    await asyncio.sleep(stays)
    tab.close()
    return taken


async def strangers(address: str, pid: int, rounds: int) -> None:
    """Print memory and the time of the next page beside 300 silent connections, then after 200 dropped pages each."""
    first = await visit(address, stays=30.0)  # it computes: what any used server holds is there
    await asyncio.sleep(30.0)
    before = memory(pid)
    place = urlsplit(address)
    silent = [socket.create_connection((place.hostname, place.port)) for _ in range(300)]
    print(
        f"first page {first:.0f} ms, {before:.0f} MB; beside 300 silent connections {await visit(address):.0f} ms",
        flush=True,
    )
    for one in silent:
        one.close()
    for number in range(rounds):
        times = [await visit(address) for _ in range(200)]
        soon = await visit(address)
        await asyncio.sleep(30.0)
        grown = memory(pid) - before
        print(
            f"{200 * (number + 1)} pages dropped: next one {soon:.0f} ms (median {np.median(times):.0f}, longest "
            f"{max(times):.0f}), {grown:+.1f} MB", flush=True
        )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clicks", type=int, default=60)
    parser.add_argument("--pages", type=int, default=20)
    parser.add_argument("--soak", type=float, default=60.0, help="seconds")
    parser.add_argument("--strangers", type=int, metavar="ROUNDS", help="of 200 dropped pages each, and nothing else")
    arguments = parser.parse_args()
    if arguments.strangers is not None:
        with serving() as (address, pid):
            asyncio.run(strangers(address, pid, arguments.strangers))
        return
    from playwright.sync_api import sync_playwright

    measured: dict[str, float] = {}

    def note(name: str, value: float) -> None:
        measured[name] = float(value)
        verdict = "met" if value < TARGETS[name] else "MISSED"
        print(f"{name:46s} {value:8.0f}   must be below {TARGETS[name]:.0f}   {verdict}", flush=True)

    with serving() as (address, pid), sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        loads = []
        for _ in range(4):
            page = browser.new_page(viewport={"width": 1366, "height": 768})
            loads.append(load(page, address))
            page.close()
            time.sleep(5.0)
        note("first view", np.median(loads))
        page = browser.new_page(viewport={"width": 1366, "height": 768})
        load(page, address)
        wait_until_settled(page)
        times = clicks(page, arguments.clicks)
        note("click, median", np.median(times))
        note("click, 95 %", np.percentile(times, 95))
        wait_until_settled(page)
        coarse, fine = slides(page, 5)
        note("slider to 64 x 64", np.median(coarse))
        note("slider to 256 x 256", np.median(fine))
        note("between updates while two sliders are dragged", drags(page))
        if arguments.soak > 0.0:
            note("soak, growth", soak(page, pid, arguments.soak))
        page.close()
        if arguments.pages > 0:
            for name, settled in (("twenty pages, click, median", True), ("the same, planes on their way", False)):
                note(name, np.median(crowd(browser, address, arguments.pages, 5, settled)))
                time.sleep(5.0)
        with serving(THREE_MODES) as (other, _):
            page = browser.new_page(viewport={"width": 1366, "height": 768})
            load(page, other)
            page.wait_for_timeout(20_000.0)
            note("three modes, click, median", np.median(clicks(page, arguments.clicks)))
        browser.close()
    print(json.dumps(measured))


if __name__ == "__main__":
    main()
