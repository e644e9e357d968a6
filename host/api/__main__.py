"""``python -m cubestack``: the command."""

import sys

from cubestack.host.cli.start import main

sys.exit(main())
