#!/bin/sh
# Installs programs of others that the tests point at the emulator: clients.sh FOLDER
# Python packages go into FOLDER/venv, npm's into FOLDER/node_modules; Debian's need root.
set -eu
mkdir -p "$1"
cd "$1"
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1; then
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends gcc g++ make musl-tools \
        golang-go i2c-tools libdevice-i2c-perl ser2net gensio-bin socat picocom qemu-system-arm \
        gcc-arm-none-eabi libnewlib-arm-none-eabi >/dev/null
fi
[ -x venv/bin/python ] || python3 -m venv venv
venv/bin/python -m pip install --quiet --disable-pip-version-check \
    smbus2 smbus3 python-periphery adafruit-blinka pyserial serialx
# labgrid brings its own variant of pyserial.
[ -x labgrid/bin/python ] || python3 -m venv labgrid
labgrid/bin/python -m pip install --quiet --disable-pip-version-check labgrid
if command -v npm >/dev/null 2>&1; then
    npm install --silent --no-fund --no-audit i2c-bus serialport
    # Some versions of npm do not run what packages want to run when they are installed.
    headers=$(dirname "$(dirname "$(node -p process.execPath)")")
    [ -e "$headers/include/node/node.h" ] && export npm_config_nodedir="$headers"
    (cd node_modules/i2c-bus && node "$(npm root -g)/npm/node_modules/node-gyp/bin/node-gyp.js" rebuild >/dev/null 2>&1)
fi
