#!/usr/bin/env bash
# Everything that must hold: style, types, the rule of who imports whom, and the tests.
# Installs what it needs: Debian packages where it may, and the project with its `test` extra.
# Arguments go to pytest; `--all` adds the long tests (tests/long.txt).
set -euo pipefail
cd "$(dirname "$0")/.."

packages=(libegl1 libgl1 libgl1-mesa-dri libosmesa6 xvfb glslang-tools)
if command -v apt-get >/dev/null && [ "$(id -u)" = 0 ]; then
    missing=()
    for package in "${packages[@]}"; do
        dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q "ok installed" || missing+=("$package")
    done
    if [ "${#missing[@]}" -gt 0 ]; then
        apt-get update -qq
        DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
    fi
fi

python=${PYTHON:-python3}
if [ -z "${VIRTUAL_ENV:-}" ]; then
    [ -x .venv/bin/python ] || "$python" -m venv .venv
    export VIRTUAL_ENV=$PWD/.venv PATH=$PWD/.venv/bin:$PATH
fi
python -m pip install --quiet --disable-pip-version-check -e '.[test]'

ruff check .
ruff format --check .
lint-imports
mypy &  # on a core of its own while the tests are collected
types=$!
# A process draws with one thread: there are as many processes as cores. Each takes neighbouring tests, which share
# what their fixtures made, until it has none left; then it takes some of another's.
export LP_NUM_THREADS=${LP_NUM_THREADS:-1}
status=0
python -m pytest -n 2 --dist worksteal "$@" || status=$?
wait "$types" || exit 1
exit "$status"
