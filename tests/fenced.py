"""The code blocks of a Markdown page."""

import re
from pathlib import Path

ROOT = Path(__file__).parent.parent


def blocks(page: Path, language: str) -> list[str]:
    """Return the bodies of a page's blocks in one language, in order."""
    return re.findall(rf"^```{language}\n(.*?)^```$", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def commands(page: Path) -> list[tuple[str, list[str]]]:
    """Return each command of a page's console blocks with the output shown under it."""
    found: list[tuple[str, list[str]]] = []
    for line in "".join(blocks(page, "console")).splitlines():
        if line.startswith("$ "):
            found.append((line[2:], []))
        else:
            found[-1][1].append(line)
    return found


def table(page: Path, head: str) -> list[list[str]]:
    """Return the rows of the table whose head line begins so, cells without backticks."""
    lines = page.read_text(encoding="utf-8").splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith(head)) + 2
    rows = []
    for line in lines[start:]:
        if not line.startswith("| "):
            break
        # A bar inside code, as in |g|, would be no cell border; no table here has one.
        rows.append([cell.strip().replace("`", "") for cell in line.strip("| ").split(" | ")])
    return rows
