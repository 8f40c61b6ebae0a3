"""`python -m facewright` is the command `facewright`."""

import sys

from facewright.cli.__main__ import main

sys.exit(main())
