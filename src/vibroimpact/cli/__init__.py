"""The command line: one sub-command a public function, one line for every fault."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Sequence

__all__ = ["main"]

WRONG_REQUEST, FAILED, INTERRUPTED = 2, 1, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0, 1 (it failed), 2 (wrong request) or 130 (interrupted)."""
    code = _run(arguments)
    if code == INTERRUPTED and arguments is None:
        _leave_threads(code)
    return code


def _run(arguments: Sequence[str] | None) -> int:
    try:
        from typer import Abort
        from typer.main import get_command

        from vibroimpact.cli.app import app
        from vibroimpact.cli.finding import Nothing
        from vibroimpact.cli.request import Interrupted, WrongRequest

        try:
            given = None if arguments is None else list(arguments)
            code = get_command(app).main(args=given, prog_name="vibroimpact", standalone_mode=False)
            sys.stdout.flush()
            if code == INTERRUPTED:  # typer's word for a Ctrl-C that nobody caught
                return _tell("interrupted", INTERRUPTED)
            return code if isinstance(code, int) else 0
        except WrongRequest as error:
            return _tell(str(error), WRONG_REQUEST)
        except Interrupted as error:
            return _tell(str(error), INTERRUPTED)
        except Nothing as error:
            return _tell(str(error), FAILED)
        except Abort:
            return _tell("interrupted", INTERRUPTED)
        except Exception as error:
            if hasattr(error, "format_message"):  # typer's own refusals, whichever click it carries
                return _tell(f"{error.format_message()} Try --help.", WRONG_REQUEST)
            raise
    except KeyboardInterrupt:
        return _tell("interrupted", INTERRUPTED)
    except BrokenPipeError:  # the reader, such as `head`, has seen enough; keep the flush at exit silent
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    except OSError as error:
        return _tell(error.strerror or str(error), FAILED)
    except MemoryError:
        return _tell("it failed: out of memory; ask for fewer points or samples", FAILED)
    except Exception as error:
        return _tell(f"it failed: {type(error).__name__}: {error}", FAILED)


def _tell(message: str, code: int) -> int:
    """Say in one line what was wrong."""
    lines = [line.strip() for line in message.splitlines() if line.strip()]
    head = f"{lines[0]} " if lines and lines[0].endswith(":") else ""
    text = head + " | ".join(lines[1:] if head else lines)
    print(f"vibroimpact: {text}", file=sys.stderr)
    return code


def _leave_threads(code: int) -> None:
    """End at once where cells that were given up still compute: Python would wait for their threads."""
    sweeps = sys.modules.get("vibroimpact.execution.threads")
    if sweeps and any(thread.name.startswith(sweeps.THREADS) for thread in threading.enumerate()):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
