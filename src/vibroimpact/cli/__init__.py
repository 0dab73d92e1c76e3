"""The command line: one command per public function, one line for every error."""

# Annotations are evaluated here: typer reads those of a function that only `commands` sees.
import logging
import os
import re
import sys
import threading
from collections.abc import Sequence
from contextlib import nullcontext
from typing import Annotated, Any

from vibroimpact.cli.endings import FAILED, INTERRUPTED, WRONG_REQUEST, Ended
from vibroimpact.parameters import OF_ONE_MASS, printable
from vibroimpact.progress import Pulse, interruptible

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0, 1 (failed), 2 (wrong request) or 130 (interrupted)."""
    logging.getLogger("asyncio").setLevel(logging.CRITICAL)  # a refused chunk leaves tasks of Zarr's loop behind
    main_thread = threading.current_thread() is threading.main_thread()
    with interruptible() if main_thread else nullcontext(), Pulse() if sys.stderr.isatty() else nullcontext():
        code = _run(arguments)
    if code == INTERRUPTED and arguments is None:
        _exit_without_threads(code)
    return code


def _run(arguments: Sequence[str] | None) -> int:
    try:
        from typer import Abort

        try:
            argv = None if arguments is None else list(arguments)
            code = commands().main(args=argv, prog_name="vibroimpact", standalone_mode=False)
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
                return _report(_refusal(error), WRONG_REQUEST)
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


def _refusal(error: Any) -> str:
    """Return typer's error, and what to type instead."""
    name = str(getattr(error, "option_name", "")).lstrip("-").replace("-", "_")
    parameter = next((each.name for each in OF_ONE_MASS.values() if name and name in (each.name, each.symbol)), "")
    if parameter:
        return f"no option {error.option_name!r}: parameters are given as -p {parameter}=VALUE"
    context, text = getattr(error, "ctx", None), error.format_message()
    path = context.command_path if context else "vibroimpact"
    flags = {flag for each in context.command.params for flag in each.opts} if context else set()
    if f"--{name.lower()}" in flags:
        text = f"{text.rstrip('.')}; did you mean --{name.lower()}?"
    elif "-p" in flags and (text.startswith("Got unexpected") or len(name) == 1):
        text = re.sub(r"\.$| \(Possible.*", "", text) + "; parameters are given as -p NAME=VALUE, without spaces."
    option = "--version" if text.startswith("No such command 'version'") else "--help"
    return f"{text} Try `{path} {option}`."


def _report(message: str, code: int) -> int:
    """Print in one line what was wrong."""
    lines = [line.strip() for line in message.splitlines() if line.strip()]
    head = f"{lines[0]} " if lines and lines[0].endswith(":") else ""
    text = head + " | ".join(lines[1:] if head else lines)
    print(f"vibroimpact: {printable(text)}", file=sys.stderr)
    return code


def _exit_without_threads(code: int) -> None:
    """Exit at once where abandoned cells are still being computed: Python would wait for their threads."""
    sweeps = sys.modules.get("vibroimpact.execution.threads")
    if sweeps and any(thread.name.startswith(sweeps.THREADS) for thread in threading.enumerate()):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def commands() -> Any:
    """Return the command, with its sub-commands and their help."""
    import typer
    from typer.main import get_command

    from vibroimpact.cli.attractors import attractors
    from vibroimpact.cli.compute import basins, compare, describe, diagram, parameter_map, section, simulate
    from vibroimpact.cli.files import explore, info, plot, reproduce, warm_up
    from vibroimpact.cli.models import models
    from vibroimpact.cli.orbits import boundary, follow, orbit, response

    app = typer.Typer(
        name="vibroimpact",
        rich_markup_mode="rich",
        pretty_exceptions_enable=False,
        add_completion=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )

    # A --help of our own: typer's, when absent, is coerced by way of pydantic, whose import takes 0.1 s.
    @app.callback(invoke_without_command=True, add_help_option=False)
    def root(
        context: typer.Context,
        version: Annotated[bool, typer.Option("--version", help="Show the version.")] = False,
        wanted: Annotated[bool, typer.Option("-h", "--help", help="Show this page.")] = False,
    ) -> None:
        """Whether an oscillator settles, sticks or goes chaotic, and how hard it hits.

        Seven numbers describe it, in SI units: mass m, damping c, stiffness k,
        driving amplitude f and frequency w, restitution r and gap g. Commands
        take them as -p NAME=VALUE or from a study file, and print a summary of
        the result or write it to --out.

        For example:

          vibroimpact section -p omega=0.9
          vibroimpact diagram --x omega=0.01:5:1000 --out diagram.png
          vibroimpact map --x omega=0.025:5:200 --y m=0.1:5:200 --out map.zarr
          vibroimpact plot map.zarr --out map.png
          vibroimpact describe -p omega=2.8
        """
        if version:
            import vibroimpact

            typer.echo(f"vibroimpact {vibroimpact.__version__}")
        elif wanted or context.invoked_subcommand is None:
            typer.echo(context.get_help())
        if version or wanted:
            raise typer.Exit

    panels: dict[str, dict[str, Any]] = {
        "Motions and sweeps": {"simulate": simulate, "section": section, "diagram": diagram, "map": parameter_map},
        "Orbits and boundaries": {
            "orbit": orbit,
            "continue": follow,
            "response": response,
            "boundary": boundary,
            "attractors": attractors,
            "basins": basins,
        },
        "Verdicts": {"describe": describe, "compare": compare},
        "Machines": {"models": models},
        "Explorer": {"explore": explore},
        "Files": {"plot": plot, "info": info, "reproduce": reproduce, "warm-up": warm_up},
    }
    for panel, entries in panels.items():
        for name, command in entries.items():
            app.command(name=name, rich_help_panel=panel)(command)
    return get_command(app)
