"""`python -m vibroimpact` is the command `vibroimpact`."""

import sys

from vibroimpact.cli import main

if __name__ == "__main__":
    sys.exit(main())
