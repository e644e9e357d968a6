#!/bin/sh
# Build sdcc's compiler for the PIC18 from Debian's source and install gpsim and gputils. Takes at most
# 152 s of processor time, as root on Debian 12 with its source packages enabled (`deb-src`):
#
#   tests/compiled_costs/build_pic18.sh FOLDER
#
# FOLDER/sdcc has the compiler and the sources of its library that pic18.py compiles and counts.
set -eu
mkdir -p "$1"
cd "$1"

apt-get update
apt-get install -y --no-install-recommends build-essential dpkg-dev bison flex libboost-dev \
    zlib1g-dev texinfo gpsim gputils
[ -d sdcc ] || { apt-get source --download-only sdcc && dpkg-source --extract sdcc_*.dsc sdcc; }

cd sdcc
ports="mcs51 z80 z180 r2k r2ka r3ka sm83 tlcs90 ez80_z80 z80n ds390 ds400 pic14 hc08 s08 stm8
    pdk13 pdk14 pdk15 mos6502"
./configure --enable-pic16-port --disable-non-free --disable-ucsim --disable-device-lib \
    --disable-packihx --disable-sdcdb $(for port in $ports; do echo "--disable-$port-port"; done)
# The compiler is used for seconds, so a quick build beats quick code.
sed -i 's/-pipe -ggdb -g -O2/-O0 -w/' Makefile.common src/Makefile
make -j"${JOBS:-$(nproc)}"
ls bin/sdcc
times # of this shell, then of all that it ran: user and system
