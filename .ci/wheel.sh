#!/usr/bin/env bash
# Build the wheel, install it in an empty environment, run the demo from there.   usage: wheel.sh PYTHON
set -euo pipefail
cd "$(dirname "$0")/.."
python="$(cd "$(dirname "$1")" && pwd)/$(basename "$1")"
room="$(mktemp -d)"
trap 'rm -rf "$room"' EXIT

rm -rf build drake_tc.egg-info # what an older build left would go into the wheel
"$python" -m build --quiet --wheel --outdir "$room/dist" .
"$python" -m venv "$room/venv"
"$room/venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-compile "$room"/dist/*.whl # most modules are never loaded here
cd "$room"
PYTHONPATH= "$room/venv/bin/drake-tc" demo | tee said
test "$(tail -n 1 said)" = demo/report.html || { echo "the wheel's demo did not end with the path of its report" >&2; exit 1; }
for file in report.html report.json model_before.yaml model_after.yaml; do
    test -s "demo/$file" || { echo "the wheel's demo wrote no $file" >&2; exit 1; }
done
grep -q '"verdict": "effects_found"' demo/report.json || { echo "the wheel's demo found no effect" >&2; exit 1; }
PYTHONPATH= "$room/venv/bin/drake-tc" simulate hrp2_leg --duration 0.3 --out "$room/leg" > /dev/null
test -s "$room/leg/log.csv" || { echo "the wheel's leg simulation wrote no log" >&2; exit 1; }
PYTHONPATH= "$room/venv/bin/drake-tc" graph hrp2_leg_contact --out "$room/leg.svg" > /dev/null
said="$(PYTHONPATH= "$room/venv/bin/drake-tc" reproduce A.table2 2>&1)" && { echo "the wheel reproduced a table" >&2; exit 1; }
grep -q 'are in the repository' <<< "$said" || { echo "the wheel's reproduce said: $said" >&2; exit 1; }
echo "wheel: installed, closed the loop, simulated and drew the leg outside the source tree"
