"""Early ends of commands: the exit code, and one line that gives the reason."""

from collections.abc import Iterator
from contextlib import contextmanager

from vibroimpact.parameters import MissingExtra

FAILED, WRONG_REQUEST, INTERRUPTED = 1, 2, 130  # codes, as shells have them


class Ended(Exception):
    """A command ended early; the message gives the reason in one line."""

    code = FAILED


class WrongRequest(Ended):
    """The request cannot be carried out; no file has been changed."""

    code = WRONG_REQUEST


class Interrupted(Ended):
    """Ctrl-C stopped a computation; the message says what was kept."""

    code = INTERRUPTED


# how an input or a place is refused; a full disk, say, is another OSError
REFUSALS = (FileExistsError, FileNotFoundError, IsADirectoryError, NotADirectoryError, PermissionError)


@contextmanager
def refusing(*errors: type[OSError]) -> Iterator[None]:
    """Convert refused arguments, missing extras and these errors into a `WrongRequest`; other errors are failures."""
    try:
        yield
    except MissingExtra as error:  # others are of a user's model, say
        raise WrongRequest(str(error)) from error
    except errors as error:
        raise WrongRequest(error.strerror or str(error)) from error
    except ValueError as error:
        # This package's refusals name an argument, in backticks, or choices; errors of libraries hardly ever do.
        if "`" not in str(error) and not str(error).startswith("unknown "):
            raise
        raise WrongRequest(str(error)) from error
