#!/usr/bin/env bash
# Imports modules whose wheels load libraries of the system.   usage: system_libraries.sh PYTHON MODULE...
# What is missing is installed where that is possible without a question (as root on Debian or Ubuntu, as in a container);
# elsewhere one line says what to install. It ends with 1 if the first module still cannot be imported.
set -euo pipefail
python="$1"
shift

missing() {
    "$python" -c 'import sys; from drake_tc.system_libraries import missing_packages as m; print(*m(sys.argv[1:]))' "$@"
}

packages="$(missing "$@")"
[ -n "$packages" ] || exit 0
if [ "$(id -u)" = 0 ] && command -v apt-get > /dev/null; then
    echo "apt-get install $packages   # libraries that $* load" >&2
    apt-get update -qq
    # shellcheck disable=SC2086 # a list of packages
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $packages > /dev/null
    packages="$(missing "$@")"
    [ -n "$packages" ] || exit 0
fi
echo "system libraries are missing; on Debian and Ubuntu: sudo apt install --no-install-recommends $packages" >&2
[ -z "$(missing "$1")" ]
