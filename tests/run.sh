#!/usr/bin/env bash
# Everything that must hold: style, types, the rule of who imports whom, and the tests.
# Installs what it needs: Debian packages where it may, and the project with its `test` extra.
# Arguments go to pytest; `--all` adds the long tests (tests/long.txt). At the end it prints how long each phase took.
set -euo pipefail
cd "$(dirname "$0")/.."

phases=()
phase() { # phase NAME COMMAND...: runs it and keeps its seconds
    local name=$1 begun=$SECONDS status=0
    shift
    "$@" || status=$?
    phases+=("$(printf '%5d s  %s' $((SECONDS - begun)) "$name")")
    return "$status"
}
show_phases() {
    [ "${#phases[@]}" = 0 ] || printf '%s\n' "${phases[@]}" "$(printf '%5d s  in all' "$SECONDS")"
}
trap show_phases EXIT

# The tests start hundreds of processes: each reads the bytecode that the first has written.
unset PYTHONDONTWRITEBYTECODE

packages=(libegl1 libgl1 libgl1-mesa-dri libosmesa6 xvfb glslang-tools)
install_packages() {
    command -v apt-get >/dev/null && [ "$(id -u)" = 0 ] || return 0
    local missing=() package
    for package in "${packages[@]}"; do
        dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q "ok installed" || missing+=("$package")
    done
    [ "${#missing[@]}" -gt 0 ] || return 0
    apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends \
        "${missing[@]}" >/dev/null
}

# uv installs in a tenth of pip's time. Where it cannot be had or finds no index, pip does it.
install_project() {
    if command -v uv >/dev/null || python -m pip install --quiet --disable-pip-version-check uv; then
        # pyrr's text warns when it is compiled first; in a test a warning is an error.
        uv pip install --quiet --python "$(command -v python)" -e '.[test]' && python -W ignore -c "import pyrr" && return
    fi
    python -m pip install --quiet --disable-pip-version-check -e '.[test]'
}

style() {
    ruff check . && ruff format --check . && lint-imports
}

phase "Debian packages" install_packages

python=${PYTHON:-python3}
if [ -z "${VIRTUAL_ENV:-}" ]; then
    [ -x .venv/bin/python ] || "$python" -m venv .venv
    export VIRTUAL_ENV=$PWD/.venv PATH=$PWD/.venv/bin:$PATH
fi
phase "Python packages" install_project
phase "style and imports" style

types=$(mktemp)
{ # on a core of its own while the tests are collected
    begun=$SECONDS status=0
    python -m tests.platforms || status=$?
    echo "$((SECONDS - begun)) $status" >"$types"
} &
checker=$!
others=$(mktemp)
{ # other interpreters, and the lowest versions of all dependencies
    begun=$SECONDS status=0
    python -m tests.interpreters >"$others.txt" 2>&1 || status=$?
    echo "$((SECONDS - begun)) $status" >"$others"
} &
commands=$!
# A process draws and computes with one thread: there are as many processes as cores. Each takes neighbouring tests,
# which share what their fixtures made, until it has none left; then it takes some of another's.
export LP_NUM_THREADS=${LP_NUM_THREADS:-1} OPENBLAS_NUM_THREADS=${OPENBLAS_NUM_THREADS:-1}
# Most shaders of the tests draw one small picture: the software renderer compiles them without its optimizer in less
# time than that saves. `--all` draws as users do.
[[ " $* " == *" --all "* ]] || export GALLIVM_PERF=${GALLIVM_PERF-nopt}
status=0
phase "tests" python -m pytest -n 2 --dist worksteal "$@" || status=$?
wait "$checker" "$commands" || true
cat "$others.txt"
read -r seconds typed <"$types"
phases+=("$(printf '%5d s  types, beside the tests' "$seconds")")
read -r seconds commanded <"$others"
phases+=("$(printf '%5d s  other interpreters and lowest versions, beside the tests' "$seconds")")
rm "$types" "$others" "$others.txt"
[ "$typed" = 0 ] && [ "$commanded" = 0 ] || exit 1
exit "$status"
