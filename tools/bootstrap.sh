# Sourced by ./run and ./test: finds Python, makes the virtual environment, installs once.
# shellcheck shell=sh

fail() {
    printf '%s: %s\n' "$(basename "$0")" "$1" >&2
    shift
    for line in "$@"; do printf '  %s\n' "$line" >&2; done
    exit 3
}

# Succeeds when the interpreter $1 starts and is Python 3.10 or newer.
python_is_usable() {
    "$1" -c 'import sys; sys.exit(sys.version_info < (3, 10))' >/dev/null 2>&1
}

# Prints the first usable interpreter: $PYTHON, python3, then the versions by name.
find_python() {
    if [ -n "${PYTHON:-}" ]; then
        python_is_usable "$PYTHON" && { printf '%s\n' "$PYTHON"; return; }
        fail "PYTHON=$PYTHON is not a Python 3.10 or newer" \
            "found: $("$PYTHON" --version 2>&1 || true)" "next: point PYTHON at another interpreter, or unset it"
    fi
    for candidate in python3 python3.13 python3.12 python3.11 python3.10 python; do
        if python_is_usable "$candidate"; then printf '%s\n' "$candidate"; return; fi
    done
    if command -v python3 >/dev/null 2>&1; then
        fail "Python is too old: found $(python3 --version 2>&1), needed 3.10 or newer" \
            "next: install a newer Python, or name one: PYTHON=/path/to/python3.11 $0"
    fi
    fail "Python is not installed" "needed: Python 3.10 or newer with pip and venv" \
        "next: sudo apt install python3 python3-venv (Debian, Ubuntu), or see python.org"
}

# Sets $venv: the active virtual environment, else .venv beside this file, which is made when missing.
ensure_venv() {
    if [ -n "${VIRTUAL_ENV:-}" ] && [ -x "$VIRTUAL_ENV/bin/python" ]; then
        python_is_usable "$VIRTUAL_ENV/bin/python" ||
            fail "the active virtual environment is older than Python 3.10: $VIRTUAL_ENV" \
                "next: deactivate it, then run $0 again"
        venv=$VIRTUAL_ENV
        return
    fi
    venv=$root/.venv
    python_is_usable "$venv/bin/python" && return
    python=$(find_python) || exit 3
    printf 'Making the virtual environment .venv with %s …\n' "$("$python" --version)" >&2
    "$python" -m venv --clear "$venv" >&2 ||
        fail "the virtual environment could not be made; the reason stands above" \
            "next: on Debian and Ubuntu the module is a package of its own: sudo apt install python3-venv"
}

# Installs into $venv unless the same request was installed before: install_once LABEL ARGUMENT…
install_once() {
    label=$1
    shift
    stamp=$venv/.joshua-$label
    wanted=$(cd "$root" && printf '%s\n' "$root" "$@" | cat - constraints.txt pyproject.toml joshua-*/pyproject.toml joshua-plugins/*/pyproject.toml | cksum)
    if [ -f "$stamp" ] && [ "$(cat "$stamp")" = "$wanted" ]; then return; fi
    printf 'Installing %s into %s (once; about half a minute) …\n' "$label" "$venv" >&2
    (cd "$root" && "$venv/bin/python" -m pip install --quiet --disable-pip-version-check -c constraints.txt "$@" >&2) ||
        fail "the installation failed; pip's reason stands above" \
            "next: check the network and pip's configuration (pip config list), then run $0 again"
    # Compiled once here: where PYTHONDONTWRITEBYTECODE is set, every start would compile the sources anew.
    "$venv/bin/python" -m compileall -q "$root/joshua-core/src" >&2 || true
    printf '%s\n' "$wanted" >"$stamp"
}

# Installs plugins of this clone, named as in «sts3215,emulator», with everything of this clone that they need:
# in one call of pip, so that it takes these names from here and asks no package index for them.
install_plugins() {
    folders=$("$venv/bin/python" "$root/tools/local_plugins.py" "$1") || exit $?
    set -f -- # an extra such as emulator[spike] is no pattern of file names
    for folder in $folders; do set -- "$@" -e "$folder"; done
    set +f
    install_once plugins "$@"
}
