"""Set up `.venv/` with the package and what some work needs; needs nothing but Python.

Run as `python3 tools/bootstrap.py [tests] [checks] [benchmarks]`: each adds to what is there. It uses uv if that is on
the PATH, else Python's own `venv` and pip, else (a Python shipped without `ensurepip`) an empty environment filled by
the pip outside it. Its syntax is that of Python 3.6, so that an older Python gets as far as being told.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
PYTHON = VENV / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
NEEDED = (3, 11)
EXTRAS = {  # that each kind of work needs; `cuda` wants an NVIDIA driver
    "tests": ["cluster", "test", "units", "web", "web-test"],
    "checks": ["docs", "lint"],
    "benchmarks": ["bench"],
}


def main(works: list) -> int:
    """Set up for some kinds of work, and say in one line what went wrong if it did."""
    if sys.version_info < NEEDED:
        found = ".".join(str(part) for part in sys.version_info[:3])
        wanted = ".".join(str(part) for part in NEEDED)
        print(f"bootstrap: this is Python {found} ({sys.executable}); vibroimpact needs {wanted} or newer.", end=" ")
        print(f"Install it, then name it: make PYTHON=python{wanted} ...")
        return 1
    try:
        _install(_environment(), works)
    except subprocess.CalledProcessError as error:
        print(f"bootstrap: `{' '.join(map(str, error.cmd))}` failed; its own message stands above", file=sys.stderr)
        return 1
    return 0


def _run(*command: object) -> None:
    subprocess.run([str(part) for part in command], check=True, cwd=ROOT)


def _works(*command: object) -> bool:
    try:
        return subprocess.run([str(part) for part in command], capture_output=True, check=False).returncode == 0
    except OSError:
        return False


def _environment() -> list:
    """Make the environment unless a usable one stands, and return the command that installs into it."""
    same = f"import sys; sys.exit(sys.version_info[:2] != {tuple(sys.version_info[:2])})"
    fresh = not _works(PYTHON, "-c", same)
    if fresh:
        shutil.rmtree(VENV, ignore_errors=True)
    uv = shutil.which("uv")
    if uv:
        if fresh:
            _run(uv, "venv", "--quiet", "--python", sys.executable, VENV)
        return [uv, "pip", "install", "--python", PYTHON, "--compile-bytecode"]
    own_pip = [PYTHON, "-m", "pip", "--disable-pip-version-check", "install", "--compile"]
    if fresh and not _works(sys.executable, "-m", "venv", VENV):
        shutil.rmtree(VENV, ignore_errors=True)
        _run(sys.executable, "-m", "venv", "--without-pip", VENV)
    if _works(PYTHON, "-m", "pip", "--version"):
        return own_pip
    return [sys.executable, "-m", "pip", "--python", PYTHON, "--disable-pip-version-check", "install", "--compile"]


def _install(installer: list, works: list) -> None:
    extras = sorted(extra for work in works for extra in EXTRAS[work])
    shown = f", {', '.join(extras)}" if extras else ""
    print(f"setting up {VENV.relative_to(ROOT)} with Python {sys.version.split()[0]}: the package{shown}", flush=True)
    _run(*installer, "--quiet", "--editable", f".[{','.join(extras)}]" if extras else ".")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
