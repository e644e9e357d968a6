#!/bin/sh
# Installs the test suites of newlib and of the compiler, and DejaGnu, where Debian's packages can be had.
set -eu
packages="dejagnu gcc-arm-none-eabi libnewlib-arm-none-eabi newlib-source gcc-arm-none-eabi-source"
dpkg -s $packages >/dev/null 2>&1 && exit 0
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1; then
    apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $packages \
        >/dev/null && exit 0
fi
echo "not installed, so their tests are skipped: $packages" >&2
