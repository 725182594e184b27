#!/usr/bin/env bash
# Installs the system packages that Transom needs and that are missing (Debian, Ubuntu and their kin).
#
#   tools/setup.sh            install what is missing: as root, through sudo, or else say what to install and stop
#   tools/setup.sh --print    print the missing packages, one a line, and install nothing
#   tools/setup.sh --python   print the Python (3.11 or newer) that the virtual environment will be made with
#
# TRANSOM_SKIP_SYSTEM=1 skips the packages: for other systems, or libraries that you built yourself.
# PYTHON=/path/to/python chooses the Python.
set -euo pipefail

# The first of the given packages that this system offers, or nothing.
first_available() {
    local package policy
    for package in "$@"; do
        # Read whole before it is searched: a pipe that grep leaves early would count as a failure under pipefail.
        policy=$(LC_ALL=C apt-cache policy "$package" 2>/dev/null) || continue
        if grep -q '^  Candidate: [0-9]' <<<"$policy"; then
            echo "$package"
            return
        fi
    done
}

is_installed() {
    [ "$(dpkg-query -W -f='${db:Status-Status}' "$1" 2>/dev/null)" = installed ]
}

# Path of the first Python that is new enough, or nothing.
find_python() {
    local candidate
    for candidate in ${PYTHON:-python3 python3.11 python3.12 python3.13 /usr/bin/python3}; do
        if "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
            "$candidate" -c 'import sys; print(sys.executable)'
            return
        fi
    done
}

# Whether that Python can make an environment with pip, and has the headers that the compiled module needs.
is_complete() {
    "$1" - 2>/dev/null <<'PYTHON_END'
import ensurepip, pathlib, sysconfig, venv
assert (pathlib.Path(sysconfig.get_paths()["include"]) / "Python.h").exists()
PYTHON_END
}

python_packages() {
    local python version
    python=$(find_python)
    if [ -n "$python" ] && is_complete "$python"; then
        return
    fi
    if [ -n "$python" ] && [ "$(dirname "$(readlink -f "$python")")" = /usr/bin ]; then
        version=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
        echo "python$version-venv" "python$version-dev"
    else
        echo python3 python3-venv python3-dev
    fi
}

wanted_packages() {
    echo g++ make cmake ninja-build git clang-format
    echo libembree-dev libtbb-dev libglm-dev libeigen3-dev libgtest-dev libbenchmark-dev
    python_packages
    # OpenGL without a screen, opened at run time. Mesa 25.1 dropped OSMesa: newer systems have EGL alone.
    first_available libosmesa6
    echo libegl1 libgl1-mesa-dri
    # Dr.Jit compiles with LLVM at run time. 19 is tested; 16 and older abort with Mitsuba 3.9 on AVX-512 processors.
    first_available libllvm19 libllvm20 libllvm21 libllvm18 libllvm17t64 libllvm17
}

missing_packages() {
    local package
    for package in $(wanted_packages); do
        is_installed "$package" || echo "$package"
    done
}

as_root() {
    if [ "$(id -u)" = 0 ]; then
        "$@"
    else
        sudo "$@"
    fi
}

can_become_root() {
    [ "$(id -u)" = 0 ] || { command -v sudo >/dev/null && { sudo -n true 2>/dev/null || [ -t 0 ]; }; }
}

if [ "${1:-}" = --python ]; then
    python=$(find_python)
    if [ -z "$python" ]; then
        echo "tools/setup.sh: no Python 3.11 or newer was found. Install python3 and python3-venv, or set PYTHON=/path/to/python." >&2
        exit 2
    fi
    echo "$python"
    exit
fi

if [ "${TRANSOM_SKIP_SYSTEM:-0}" = 1 ]; then
    exit
fi
if ! command -v apt-get >/dev/null; then
    cat >&2 <<'MESSAGE'
tools/setup.sh: this system has no apt-get, so the packages have to be installed by hand: a C++20 compiler, CMake 3.25 or
newer, Ninja, Embree 3 or 4, oneTBB, GLM, Eigen 3, GoogleTest, Google Benchmark (all with headers), Python 3.11 or newer with
headers, OSMesa or EGL with Mesa's software driver, and the LLVM 19 library. Then run TRANSOM_SKIP_SYSTEM=1 make setup.
MESSAGE
    exit 2
fi

missing=$(missing_packages)
if [ "${1:-}" = --print ]; then
    [ -z "$missing" ] || echo "$missing"
    exit
fi
if [ -z "$missing" ]; then
    exit
fi
if ! can_become_root; then
    echo "tools/setup.sh: system packages are missing. Install them, then run make again:" >&2
    echo "    sudo apt-get update && sudo apt-get install --no-install-recommends -y" $missing >&2
    exit 2
fi
export DEBIAN_FRONTEND=noninteractive
as_root apt-get update -qq
missing=$(missing_packages) # a fresh list may offer more
echo "Installing system packages:" $missing
as_root env DEBIAN_FRONTEND=noninteractive apt-get install --no-install-recommends -y -qq \
    -o DPkg::Lock::Timeout=300 $missing >/dev/null
