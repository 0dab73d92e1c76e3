"""Other processes, and what they leave in a folder."""

import json
import subprocess
import sys
import time
from pathlib import Path

COMMAND = [sys.executable, "-m", "vibroimpact"]
DRIVER = [sys.executable, str(Path(__file__).with_name("store_driver.py"))]


def python(code, *arguments, **how):
    """Run a program in a Python of its own; return its exit code and what it printed."""
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=600, **how)


def told_by(command, folder, *arguments):
    """Run a command of the store's driver; return what it tells."""
    done = subprocess.run([*DRIVER, command, folder, *map(str, arguments)], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def names(folder):
    """Return the names in a folder."""
    return sorted(path.name for path in folder.iterdir())


def until(condition):
    """Wait for a condition, for as long as a busy machine may take."""
    deadline = time.monotonic() + 300.0
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.005)


def is_png(path):
    """Return whether a file is an image in PNG."""
    return path.read_bytes()[1:4] == b"PNG"
