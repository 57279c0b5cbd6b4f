#!/usr/bin/env bash
# Resolves all dependencies and extras for other Pythons, from wheels for x86-64 Linux alone; nothing is installed.
# usage: resolve.sh PYTHON [VERSION...]
set -euo pipefail
cd "$(dirname "$0")/.."
python="$1"
shift
room="$(mktemp -d)"
trap 'rm -rf "$room"' EXIT

# pip builds the project itself from source, so its requirements are asked for by name.
"$python" - > "$room/requirements.txt" << 'EOF'
import tomllib

project = tomllib.load(open("pyproject.toml", "rb"))["project"]
print(*project["dependencies"], *sum(project["optional-dependencies"].values(), []), sep="\n")
EOF
# glibc 2.41, of Debian 13, takes wheels for every older one.
platforms=(--platform linux_x86_64 --platform manylinux2014_x86_64)
for minor in $(seq 17 41); do platforms+=(--platform "manylinux_2_${minor}_x86_64"); done
[ $# -gt 0 ] || set -- 3.12 3.13 3.14
# pip compares Requires-Python with the Python that runs it, so that is left out; the tags of the wheels decide instead.
failed=0
for one in "$@"; do
    if "$python" -m pip install --quiet --disable-pip-version-check --dry-run --ignore-installed --ignore-requires-python \
        --only-binary=:all: --python-version "$one" "${platforms[@]}" --target "$room/none" \
        --report "$room/report.json" --requirement "$room/requirements.txt" 2> "$room/errors"; then
        "$python" - "$one" "$room/report.json" << 'EOF'
import json
import sys

found = {one["metadata"]["name"].lower(): one["metadata"]["version"] for one in json.load(open(sys.argv[2]))["install"]}
print(f"Python {sys.argv[1]}: {len(found)} wheels, drake {found['drake']}, numpy {found['numpy']}")
EOF
    else
        echo "Python $one: does not resolve from wheels" >&2
        grep '^ERROR' "$room/errors" >&2 || tail -n 3 "$room/errors" >&2
        failed=1
    fi
done
exit $failed
