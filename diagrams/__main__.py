"""`python -m diagrams`: the command line."""

import sys

from diagrams.common.cli import main

sys.exit(main())
