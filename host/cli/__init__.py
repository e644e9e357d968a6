"""The ``cubestack`` command: one module for each subcommand."""
