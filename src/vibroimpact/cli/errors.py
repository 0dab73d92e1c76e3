"""How a command ends early: in one line, with its exit code."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


class Ended(Exception):
    """A command ended early; the message says why, in one line."""

    code = 1


class WrongRequest(Ended):
    """The request cannot be carried out; nothing has been touched."""

    code = 2


class Interrupted(Ended):
    """Ctrl-C stopped a computation; the message says what was kept."""

    code = 130


class NothingFound(Ended):
    """What was to be written does not exist."""


# how an input or a place is refused; a full disk, say, is another OSError
REFUSALS = (FileExistsError, FileNotFoundError, IsADirectoryError, NotADirectoryError, PermissionError)


@contextmanager
def refusing(*errors: type[OSError]) -> Iterator[None]:
    """Turn refused arguments, and these errors, into a `WrongRequest`; anything else is a failure."""
    try:
        yield
    except errors as error:
        raise WrongRequest(error.strerror or str(error)) from error
    except ValueError as error:
        # This package's refusals name an argument, in backticks, or choices; errors of libraries hardly ever do.
        if "`" not in str(error) and not str(error).startswith("unknown "):
            raise
        raise WrongRequest(str(error)) from error
