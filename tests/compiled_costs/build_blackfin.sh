#!/bin/sh
# Build gcc, binutils and newlib's mathematics for the Blackfin, and gdb's simulator, from Debian's
# sources. Takes 1.4 GB and 12.8 minutes of processor time, as root on Debian 12:
#
#   tests/compiled_costs/build_blackfin.sh FOLDER
#
# FOLDER/bin has the programs that blackfin.py runs.
set -eu
mkdir -p "$1"
cd "$1"
folder=$PWD

apt-get update
apt-get install -y --no-install-recommends build-essential bison flex \
    libgmp-dev libmpfr-dev libmpc-dev binutils-source gcc-12-source gdb-source newlib-source

unpack() { # archive, folder
    [ -d "$2" ] && return
    rm -rf "$2.part" && mkdir "$2.part"
    # Most of gcc's files are tests (its build runs only selftests), other languages and libraries.
    tar -xf "/usr/src/$1" -C "$2.part" --strip-components=1 --exclude='gcc/testsuite/[!s]*' \
        --exclude=gcc/ada --exclude=libstdc++-v3 --exclude=libgo --exclude=libphobos
    mv "$2.part" "$2"
}
unpack binutils/binutils-2.40.tar.xz binutils
unpack gcc-12/gcc-12.2.0-dfsg.tar.xz gcc
# Debian's source has no manual, which the build would compare with the code.
[ -f gcc.patched ] || { patch -d gcc -p2 < /usr/src/gcc-12/patches/gcc-gfdl-build.diff && touch gcc.patched; }
unpack gdb.tar.xz gdb
unpack newlib/newlib-3.3.0.tar.xz newlib

# The programs are used for seconds, so a quick build beats quick code; nobody reads the manuals.
export CFLAGS="-O0 -w" CXXFLAGS="-O0 -w" MAKEINFO=true PATH="$folder/bin:$PATH"
usual="--target=bfin-elf --prefix=$folder --disable-nls --disable-werror --disable-shared"

build() { # name, options, goals
    echo "$1: $(date)"
    mkdir -p "$1.build"
    (cd "$1.build" && [ -f Makefile ] || ../"$1"/configure $usual $2 >configure.out 2>&1)
    for goal in $3; do
        make -C "$1.build" -j"${JOBS:-$(nproc)}" "$goal" >>"$1.build/make.out" 2>&1 ||
            { tail -n 20 "$1.build/make.out"; exit 1; }
    done
}
build binutils "--disable-gdb --disable-sim --disable-gprofng --disable-ld-plugin" \
    "all-binutils all-gas all-ld install-binutils install-gas install-ld"
build gcc "--enable-languages=c --without-headers --with-newlib --disable-multilib --disable-lto
    --disable-libssp --disable-libquadmath --disable-libgomp --disable-threads --disable-plugin
    --disable-gcov --enable-checking=no" \
    "all-gcc install-gcc all-target-libgcc install-target-libgcc"
build gdb "--enable-sim --disable-gdb --disable-gdbserver --disable-binutils --disable-gas
    --disable-ld --disable-gprof" "all-sim install-sim"
build newlib "--disable-multilib" \
    "all-target-newlib all-target-libgloss install-target-newlib install-target-libgloss"
ls bin/bfin-elf-gcc bin/bfin-elf-run
times # of this shell, then of all that it ran: user and system
