"""``python -m cubestack``: the command."""

import sys

from cubestack.host.cli.main import main

sys.exit(main())
