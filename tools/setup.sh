#!/usr/bin/env bash
# Makes .venv with the pinned packages, and sees to it that the loader finds EGL and OpenGL. Does nothing when done before.
set -euo pipefail
cd "$(dirname "$0")/.."
ready=.venv/.ready
inputs=(constraints.txt pyproject.toml tools/setup.sh)
key=$(pwd; cat "${inputs[@]}" | cksum)
if [ -x .venv/bin/impostor ] && [ "$(cat "$ready" 2>/dev/null)" = "$key" ]; then exit 0; fi

say() { printf 'setup: %s\n' "$*" >&2; }
apt_may() { command -v apt-get >/dev/null && { [ "$(id -u)" = 0 ] || sudo -n true 2>/dev/null; }; }
apt_install() {
    local sudo=""
    [ "$(id -u)" = 0 ] || sudo="sudo -n"
    say "installing $* with apt"
    $sudo apt-get update -qq >/dev/null && DEBIAN_FRONTEND=noninteractive $sudo apt-get install -y -qq "$@" >/dev/null
}

python=""
for candidate in "${PYTHON:-}" python3 python3.13 python3.12 python3.11; do
    if [ -n "$candidate" ] && "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
        python=$candidate
        break
    fi
done
if [ -z "$python" ]; then
    say "no Python 3.11 or newer found; install one, or name it: make setup PYTHON=/path/to/python3"
    exit 1
fi
if ! "$python" -c 'import ensurepip, venv' 2>/dev/null; then
    package="python$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')-venv"
    if apt_may; then apt_install "$package"; else
        say "this Python makes no virtual environments; type: sudo apt-get install -y $package"
        exit 1
    fi
fi

[ -x .venv/bin/python ] && .venv/bin/python -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || {
    rm -rf .venv
    say "making .venv"
    "$python" -m venv .venv
}
say "installing the pinned packages (a minute or two the first time)"
pip=(.venv/bin/python -m pip -qq --disable-pip-version-check install -c constraints.txt)
"${pip[@]}" setuptools
"${pip[@]}" --no-build-isolation -e '.[dev]'

finds_gl='import ctypes
for name in ("libEGL.so.1", "libGL.so.1"): ctypes.CDLL(name)
import moderngl
moderngl.create_context(standalone=True, backend="egl", libgl="libGL.so.1", libegl="libEGL.so.1").release()'
gl_packages=(libegl1 libgl1 libegl-mesa0 libgl1-mesa-dri)
if [ "$(uname -s)" = Linux ] && ! .venv/bin/python -c "$finds_gl" >/dev/null 2>&1; then
    if apt_may; then apt_install "${gl_packages[@]}"; fi
    if ! problem=$(.venv/bin/python -c "$finds_gl" 2>&1); then
        say "no OpenGL through EGL (${problem##*$'\n'}); type: sudo apt-get install -y ${gl_packages[*]}"
        exit 1
    fi
fi
printf '%s' "$key" > "$ready"
say "ready: .venv/bin/impostor"
