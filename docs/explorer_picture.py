"""Take the picture of the explorer's page, in a headless Chromium: needs the extras [web] and [web-test]."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

from vibroimpact.explorer.address import BY_NAME, to_query
from vibroimpact.explorer.state import View

SERVE = "from vibroimpact.explorer import explore; explore(port=0, browser=False)"


def view() -> View:
    """Return what is seen: the tube in its support, how hard it hits over frequency and gap, two tubes compared."""
    tube = BY_NAME["tube"].view
    return tube.__class__(
        **{name: getattr(tube, name) for name in ("x", "y", "x_range", "y_range", "samples")},
        osc=tube.osc.replace(omega=57.0),
        pins=(tube.osc,),
        index="max_velocity",
        log=True,
    )


def draw(path: Path) -> None:
    """Write the picture once everything on the page is there."""
    server = subprocess.Popen([sys.executable, "-c", SERVE], stdout=subprocess.PIPE, text=True)
    try:
        address = re.search(r"http://\S+", server.stdout.readline()).group()
        with sync_playwright() as driver:
            browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
            page = browser.new_page(viewport={"width": 1366, "height": 768})
            page.goto(f"{address}?{to_query(view())}")
            page.wait_for_function("window.explorer && window.explorer.planes.some(p => p[0] === 256)", timeout=60_000)
            page.wait_for_function("document.getElementById('others').innerText", timeout=60_000)
            page.wait_for_function("document.getElementById('hatch').innerText.includes('tried)')", timeout=60_000)
            page.wait_for_timeout(2000)
            page.screenshot(path=path)
            browser.close()
    finally:
        server.terminate()
        server.wait(10)


if __name__ == "__main__":
    draw(Path(__file__).parent / "images" / "explorer.png")
