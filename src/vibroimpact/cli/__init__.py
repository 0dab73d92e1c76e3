"""The command line: one command per public function, one line for every error."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Sequence

__all__ = ["main"]

WRONG_REQUEST, FAILED, INTERRUPTED = 2, 1, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0, 1 (failed), 2 (wrong request) or 130 (interrupted)."""
    code = _run(arguments)
    if code == INTERRUPTED and arguments is None:
        _exit_without_threads(code)
    return code


def _run(arguments: Sequence[str] | None) -> int:
    try:
        from typer import Abort
        from typer.main import get_command

        from vibroimpact.cli.app import app
        from vibroimpact.cli.errors import Ended

        try:
            given = None if arguments is None else list(arguments)
            code = get_command(app).main(args=given, prog_name="vibroimpact", standalone_mode=False)
            sys.stdout.flush()
            if code == INTERRUPTED:  # what typer returns for a Ctrl-C that nobody caught
                return _report("interrupted", INTERRUPTED)
            return code if isinstance(code, int) else 0
        except Ended as error:
            return _report(str(error), error.code)
        except Abort:
            return _report("interrupted", INTERRUPTED)
        except Exception as error:
            if hasattr(error, "format_message"):  # typer's own refusals, whichever click it carries
                return _report(f"{error.format_message()} Try --help.", WRONG_REQUEST)
            raise
    except KeyboardInterrupt:
        return _report("interrupted", INTERRUPTED)
    except BrokenPipeError:  # the reader, such as `head`, has seen enough; keep the flush at exit silent
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    except OSError as error:
        return _report(error.strerror or str(error), FAILED)
    except MemoryError:
        return _report("out of memory; reduce the number of points or samples", FAILED)
    except Exception as error:
        return _report(f"{type(error).__name__}: {error}", FAILED)


def _report(message: str, code: int) -> int:
    """Print in one line what was wrong."""
    lines = [line.strip() for line in message.splitlines() if line.strip()]
    head = f"{lines[0]} " if lines and lines[0].endswith(":") else ""
    text = head + " | ".join(lines[1:] if head else lines)
    print(f"vibroimpact: {text}", file=sys.stderr)
    return code


def _exit_without_threads(code: int) -> None:
    """Exit at once where abandoned cells are still being computed: Python would wait for their threads."""
    sweeps = sys.modules.get("vibroimpact.execution.threads")
    if sweeps and any(thread.name.startswith(sweeps.THREADS) for thread in threading.enumerate()):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
