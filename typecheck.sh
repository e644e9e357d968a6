#!/bin/sh
# Runs mypy on the packages under their installed names: the folders stand at the top level, so
# a tree of links shows mypy what package-dir in pyproject.toml says.
set -eu
cd "$(dirname "$0")"
tree=build/typecheck/cubestack
mkdir -p "$tree"
for package in hdl firmware_model emulator host; do ln -sfn "../../../$package" "$tree/$package"; done
for file in host/api/*; do ln -sfn "../../../$file" "$tree/${file##*/}"; done
ln -sfn ../../examples/cubesense_fpga_i2c build/typecheck/cubesense_fpga_i2c
ln -sfn ../../examples/linear_sun_sensor/linear_sun_sensor build/typecheck/linear_sun_sensor
MYPYPATH=build/typecheck .venv/bin/python -m mypy \
    --exclude '(cubestack/host/api|cubesense_fpga_i2c/tests)/' \
    -p cubestack -p cubesense_fpga_i2c -p linear_sun_sensor
