#!/bin/sh
# Prepare what pip cannot: an interpreter that makes virtual environments, and a shared LLVM library for Dr.Jit.
#
#   scripts/bootstrap.sh venv .venv    create .venv, with $PYTHON or the first Python >= 3.10 found
#   scripts/bootstrap.sh llvm .venv    make sure that Dr.Jit, installed in .venv, finds LLVM
#
# Both do nothing when nothing is missing. On Debian and its kin, what is missing is installed with apt-get, as root or
# through a sudo that asks no password; otherwise the command to type is printed and the exit status is 2.
set -eu

say() { printf 'stratalux: %s\n' "$*" >&2; }

need() { # need WHAT COMMAND: say what is missing and what to type, then give up
    say "$1"
    say "type:  $2"
    say "then run make again."
    exit 2
}

# ---------------------------------------------------------------------------------------------------------- apt

has_apt() { command -v apt-get >/dev/null 2>&1 && command -v apt-cache >/dev/null 2>&1; }

can_install() { [ "$(id -u)" -eq 0 ] || { command -v sudo >/dev/null 2>&1 && sudo -n true 2>/dev/null; }; }

as_root() { if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo -n "$@"; fi; }

apt_update() { as_root apt-get -qq update; }

apt_offers() { LC_ALL=C apt-cache policy "$1" 2>/dev/null | grep -q 'Candidate: [^(]'; }

first_offered() { # the first of the given packages that apt offers; status 1 when there is none
    for package in "$@"; do
        if apt_offers "$package"; then
            echo "$package"
            return
        fi
    done
    return 1
}

apt_install() { # a stale package list makes the first try fail: update, then try once more
    say "installing $* with apt-get"
    for attempt in first second; do
        if as_root env DEBIAN_FRONTEND=noninteractive \
            apt-get install -qq -y --no-install-recommends "$@" >/dev/null; then return; fi
        [ "$attempt" = second ] || apt_update
    done
    say "apt-get could not install $*"
    exit 2
}

# provide WHAT FALLBACK PACKAGE...: install the first PACKAGE that apt offers, or say what to type;
# FALLBACK is the package to name when apt's lists are not there to choose from
provide() {
    what=$1 fallback=$2
    shift 2
    package=$(first_offered "$@") || package=
    if ! can_install; then
        need "$what" "sudo apt-get update && sudo apt-get install -y ${package:-$fallback}"
    fi
    if [ -z "$package" ]; then
        apt_update
        package=$(first_offered "$@") || package=$fallback
    fi
    apt_install "$package"
}

# ------------------------------------------------------------------------------------------------------- Python

recent() { "$1" -c 'import sys; sys.exit(sys.version_info < (3, 10))' 2>/dev/null; }

find_python() {
    if [ -n "${PYTHON:-}" ]; then
        if recent "$PYTHON"; then
            echo "$PYTHON"
            return
        fi
        say "PYTHON=$PYTHON is not a Python >= 3.10."
        exit 2
    fi
    for candidate in python3 python3.13 python3.12 python3.11 python3.10; do
        if recent "$candidate"; then
            echo "$candidate"
            return
        fi
    done
    say "no Python >= 3.10 found: install one, or name it with  make install PYTHON=/path/to/python3"
    exit 2
}

make_venv() {
    venv=$1
    if "$venv/bin/python" -m pip --version >/dev/null 2>&1; then return; fi
    python=$(find_python)
    if ! "$python" -c 'import ensurepip, venv' 2>/dev/null; then
        # Debian ships Python without ensurepip, in a package of its own.
        version=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
        what="$python cannot create virtual environments: its module ensurepip is missing."
        if ! has_apt; then
            say "$what"
            say "install it, or name another Python with  make install PYTHON=/path/to/python3"
            exit 2
        fi
        provide "$what" "python3-venv" "python$version-venv" "python3-venv"
    fi
    say "creating $venv with $("$python" --version)"
    "$python" -m venv --clear "$venv"
}

# --------------------------------------------------------------------------------------------------------- LLVM

# Let Mitsuba and Dr.Jit themselves say what they lack: status 0 for nothing, 4 for LLVM, 128 and more if LLVM aborts on a
# kernel; any other status for something else, which the last line of the output names. LLVM 14 and 15 know no maximum of
# two numbers that respects NaN on processors without AVX-512, and end the process.
probe() {
    "$python" - <<'PROBE' 2>&1
import sys
try:
    import mitsuba as mi
    import drjit as dr
    if not dr.has_backend(dr.JitBackend.LLVM):
        sys.exit(4)
    mi.set_variant("llvm_ad_rgb")
    dr.eval(dr.maximum(mi.Float([1, 2]), 0))
except Exception as error:
    # Dr.Jit's handler of a failed import fails itself: the first error is the one that says why.
    while error.__context__ is not None:
        error = error.__context__
    print(error)
    sys.exit(5)
PROBE
}

status() { # run the probe; the last line of its output is left in $answer, its exit status in $state
    state=0
    answer=$(probe) || state=$?
    answer=$(printf '%s\n' "$answer" | tail -n 1)
}

install_missing_library() { # for an import that failed because a shared library of the system is not there
    library=$(printf '%s\n' "$answer" | sed -n 's/^\(lib[^ ]*\.so[.0-9]*\): cannot open shared object.*/\1/p')
    case $library in
        libatomic.so.*) package=libatomic1 ;;
        libgcc_s.so.*) package=libgcc-s1 ;;
        libstdc++.so.*) package=libstdc++6 ;;
        libz.so.*) package=zlib1g ;;
        libgomp.so.*) package=libgomp1 ;;
        *) package= ;;
    esac
    if [ -z "$package" ] || ! has_apt; then
        say "Mitsuba cannot be imported: $answer"
        [ -z "$library" ] || say "install the system package that brings $library, then run make again."
        exit 2
    fi
    provide "Mitsuba needs the system library $library, which is not there." "$package" "$package"
}

llvm_packages() { # newest first; Ubuntu names some of them with the suffix t64
    for major in 20 19 18 17 16 15 14; do echo "libllvm$major libllvm${major}t64"; done
}

llvm_elsewhere() { # an LLVM library in a place where Dr.Jit does not look, and that it can load
    { PATH=$PATH:/sbin:/usr/sbin ldconfig -p 2>/dev/null | sed -n 's/.*=> \(.*libLLVM.*\)/\1/p'
      for found in /usr/lib/llvm-*/lib/libLLVM*.so* /usr/lib64/libLLVM*.so* /usr/lib64/llvm*/lib/libLLVM*.so* \
                   /usr/local/lib/libLLVM*.so* /opt/homebrew/opt/llvm/lib/libLLVM.dylib \
                   /usr/local/opt/llvm/lib/libLLVM.dylib; do
          [ ! -e "$found" ] || echo "$found"
      done; } | while read -r found; do
        if DRJIT_LIBLLVM_PATH=$found probe >/dev/null; then
            echo "$found"
            break
        fi
    done
}

install_llvm() { # install_llvm WHAT: what is wrong
    what=$1
    if [ -n "${DRJIT_LIBLLVM_PATH:-}" ]; then
        need "$what DRJIT_LIBLLVM_PATH=$DRJIT_LIBLLVM_PATH asks for it." "unset DRJIT_LIBLLVM_PATH"
    fi
    if ! has_apt || ! can_install; then
        found=$(llvm_elsewhere)
        if [ -n "$found" ]; then need "$what" "export DRJIT_LIBLLVM_PATH=$found"; fi
    fi
    if has_apt; then
        # shellcheck disable=SC2046  # a list of words
        provide "$what" llvm $(llvm_packages)
    elif [ "$(uname -s)" = Darwin ]; then
        need "$what" "brew install llvm"
    elif command -v dnf >/dev/null 2>&1; then
        need "$what" "sudo dnf install llvm-libs"
    elif command -v pacman >/dev/null 2>&1; then
        need "$what" "sudo pacman -S llvm-libs"
    else
        say "$what"
        say "install your system's LLVM library (libLLVM, version 14 to 20), or set DRJIT_LIBLLVM_PATH to it."
        exit 2
    fi
}

make_llvm() {
    python=$1/bin/python
    if [ ! -x "$python" ]; then need "$1 is not there yet." "make install"; fi
    status
    while [ "$state" -ne 0 ] && [ "$state" -ne 4 ] && [ "$state" -lt 128 ]; do # each round installs one library: the loader names only the first
        before=$answer
        install_missing_library
        status
        if [ "$answer" = "$before" ]; then
            say "Mitsuba still cannot be imported: $answer"
            exit 2
        fi
    done
    if [ "$state" -eq 4 ]; then
        install_llvm "Dr.Jit finds no shared LLVM library, which the variants llvm_* need."
        status
    elif [ "$state" -ge 128 ]; then
        install_llvm "The LLVM library that Dr.Jit finds is too old for this processor: it aborts on Dr.Jit's kernels."
        status
    fi
    if [ "$state" -ge 128 ]; then
        say "LLVM still aborts on Dr.Jit's kernels: install libLLVM 17 or newer, or set DRJIT_LIBLLVM_PATH to one."
        exit 2
    fi
    if [ "$state" -ne 0 ]; then
        say "Dr.Jit still finds no LLVM library; set DRJIT_LIBLLVM_PATH to a libLLVM shared library. $answer"
        exit 2
    fi
}

case ${1:-} in
    venv) make_venv "${2:-.venv}" ;;
    llvm) make_llvm "${2:-.venv}" ;;
    *)
        say "usage: scripts/bootstrap.sh venv|llvm [DIRECTORY]"
        exit 2
        ;;
esac
