"""The code blocks of a Markdown page."""

import re
from pathlib import Path

ROOT = Path(__file__).parent.parent


def blocks(page: Path, language: str) -> list[str]:
    """Return the bodies of a page's blocks in one language, in order."""
    return re.findall(rf"^```{language}\n(.*?)^```$", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


SHELL = ("console", "sh", "bat", "text", "")


def fences(page: Path) -> list[tuple[str, str]]:
    """Return the language and the body of every block of code and of printed text of a page, directives left out."""
    text = page.read_text(encoding="utf-8")
    found = re.findall(r"^```(\S*)[^\n]*\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    return [(language, body) for language, body in found if language == "{code-cell}" or not language.startswith("{")]


def commands(page: Path) -> list[tuple[str, list[str] | None]]:
    """Return each command of a page's blocks with the output shown under it; None where a block shows no output."""
    found: list[tuple[str, list[str] | None]] = []
    for body in (body for language, body in fences(page) if language in SHELL):
        prompt = body.startswith("$ ")
        for line in body.replace("\\\n", " ").splitlines():
            if line.startswith("$ "):
                found.append((line[2:], []))
            elif prompt:
                found[-1][1].append(line)  # type: ignore[union-attr]
            elif line.strip():
                found.append((line, None))
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
