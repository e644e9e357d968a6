#!/bin/sh
# Runs mypy on the four rooms under their installed names: the folders stand at the top level, so
# a tree of links shows mypy what package-dir in pyproject.toml says.
set -eu
cd "$(dirname "$0")"
tree=build/typecheck/cubestack
mkdir -p "$tree"
for room in hdl firmware_model emulator host; do ln -sfn "../../../$room" "$tree/$room"; done
MYPYPATH=build/typecheck .venv/bin/python -m mypy --namespace-packages \
    -p cubestack.hdl -p cubestack.firmware_model -p cubestack.emulator -p cubestack.host
