"""Build the wheel and the source archive, and try the wheel alone: in clean environments, away from the repository.

Run as `make dist`. With every Python from 3.11 to 3.14 that is found the wheel draws a map; with the one that runs
this it also writes the report, serves the page, and types a user's script.
"""

from __future__ import annotations

import glob
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import urllib.request
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
UV = Path(sys.executable).with_name("uv")
NEWEST = 14
SCRIPT = """import numpy as np
import vibroimpact as vi

osc: vi.ImpactOscillator = vi.ImpactOscillator(omega=2.8)
sweep = vi.parameter_map(osc, omega=np.linspace(2, 3, 8), restitution=[0.7, 0.8], sample_impacts=200)
assert sweep["std"].shape == (8, 2) and bool((sweep["status"] == 0).any())
system: vi.ImpactSystem = vi.models.tube_in_supports()
print(vi.__version__, system.stop_names)
"""


def run(*command: object, **options: object) -> str:
    """Return what a command prints; stop with its complaint if it fails."""
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False, **options)
    if done.returncode:
        sys.exit(f"dist: `{' '.join(map(str, command))}` failed:\n{done.stdout}{done.stderr}")
    return done.stdout


def pythons() -> list[str]:
    """Return one Python of each version that the wheel is for, as far as they are found."""
    found = []
    for minor in range(11, NEWEST + 1):
        places = [shutil.which(f"python3.{minor}"), *glob.glob(f"{Path.home()}/.pyenv/versions/3.{minor}.*/bin/python")]
        found += [place for place in places if place and works(place)][:1]
    return found


def works(python: str) -> bool:
    """Return whether a Python runs at all."""
    return subprocess.call([python, "-c", ""], stderr=subprocess.DEVNULL) == 0


def try_page(command: Path, folder: Path, environment: dict[str, str]) -> None:
    """Serve the page, read it, and end it as Ctrl-C does."""
    served = subprocess.Popen(
        [command, "explore", "--no-browser", "--port", "0"], cwd=folder, env=environment, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    told = ""
    for line in served.stdout or ():
        told += line
        address = re.search(r"http://[\w.:]+\S*", line)
        if address:
            page = urllib.request.urlopen(address.group(), timeout=60).read().decode()
            assert "<title>" in page
            served.send_signal(signal.SIGINT)
            served.wait(60)
            return
    sys.exit(f"dist: the page gave no address:\n{told}")


def main() -> None:
    """Build, and try what was built."""
    shutil.rmtree(ROOT / "dist", ignore_errors=True)
    run(UV, "build", "--quiet", cwd=ROOT)
    (wheel,), (archive,) = (ROOT / "dist").glob("*.whl"), (ROOT / "dist").glob("*.tar.gz")
    print(f"dist: built {wheel.name}, {archive.name}", flush=True)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        script = folder / "script.py"
        script.write_text(SCRIPT)
        environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
        environment |= {"NUMBA_CACHE_DIR": str(folder / "kernels"), "MPLBACKEND": "agg"}
        where = {"cwd": folder, "env": environment}
        for python in pythons():
            own = run(python, "-c", "import sys; print(sys.version_info[:2])") == f"{sys.version_info[:2]}\n"
            fresh = folder / f"venv-{Path(python).name}-{len(list(folder.iterdir()))}"
            run(UV, "venv", "--quiet", "--no-python-downloads", "--python", python, fresh)
            run(UV, "pip", "install", "--quiet", "--python", fresh, f"{wheel}[web]" if own else wheel)
            told = run(fresh / "bin/python", script, **where).split()
            print(f"dist: {python}: version {told[0]}, a map", flush=True)
            if own:
                run(fresh / "bin/vibroimpact", "reproduce", "--quick", "--out", folder / "report", **where)
                assert (folder / "report/report.html").stat().st_size > 1e5
                try_page(fresh / "bin/vibroimpact", folder, environment)
                run(UV.with_name("mypy"), "--strict", "--python-executable", fresh / "bin/python", script, **where)
                print("dist: the report, the page, and a user's script under mypy --strict", flush=True)


if __name__ == "__main__":
    main()
