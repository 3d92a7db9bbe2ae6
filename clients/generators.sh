#!/usr/bin/env bash
# Makes a client by each of six generators from the contract, openapi/precut.json, and lets it solve the first example of
# every calculator against the running service.
#
#   clients/generators.sh PRECUT [FOLDER]
#
# PRECUT is the program of the service; FOLDER keeps tools and clients (a temporary one unless given). Needs Python, npm
# and the package registries. docs/clients.md has the commands.
# shellcheck disable=SC2317 # the generators' own functions are called by their names
set -euo pipefail
shopt -s inherit_errexit

precut=$(realpath "${1:?which program of the service?}")
folder=${2:-}
here=$(cd "$(dirname "${BASH_SOURCE[0]}")/generators" && pwd)
if [ -z "$folder" ]; then folder=$(mktemp -d); fi
mkdir -p "$folder"
cd "$folder"

tools() { # both once for as long as what they are made of stays the same
  if ! cmp -s "$here/requirements.txt" python/requirements.txt; then
    rm -rf python
    python3 -m venv python
    python/bin/pip install --quiet --disable-pip-version-check --requirement "$here/requirements.txt"
    cp "$here/requirements.txt" python/
  fi
  if ! cmp -s "$here/package-lock.json" package-lock.json; then
    cp "$here/package.json" "$here/package-lock.json" .
    npm ci --no-audit --no-fund --silent || { rm -f package-lock.json && return 1; }
  fi
  # One of them looks here whether imports need the ends of names.
  cp "$here/tsconfig.json" .
  PATH=$PWD/python/bin:$PWD/node_modules/.bin:$PATH
}

serve() { # starts the service on a free port and waits for its address
  "$precut" serve --listen 127.0.0.1:0 --data "$PWD/data" >service.log 2>&1 &
  service=$!
  trap 'kill "$service" 2>/dev/null; wait "$service" 2>/dev/null || true' EXIT
  local _
  for _ in $(seq 300); do
    url=$(grep -o 'listens on http://[^[:space:]]*' service.log | sed 's/.* //' || true)
    [ -z "$url" ] || return 0
    sleep 0.1
  done
  cat service.log >&2
  return 1
}

# Each makes a client from openapi.json into its own folder.

make_openapi-generator() {
  openapi-generator-cli generate --input-spec openapi.json --generator-name python --package-name made --output "$1" >"$1.log" 2>&1
}

make_openapi-python-client() {
  openapi-python-client generate --path openapi.json --meta none --output-path "$1/made" --overwrite
}

make_datamodel-code-generator() {
  datamodel-codegen --input openapi.json --input-file-type openapi --preset standard-py310-20261027 \
    --naming-strategy full-path --enum-field-as-literal all --output "$1/made.py"
}

make_openapi-typescript() {
  openapi-typescript openapi.json --default-non-nullable false --empty-objects-unknown --output "$1/made.ts" >/dev/null 2>&1
}

make_hey-api() { openapi-ts --input openapi.json --client @hey-api/client-fetch --output "$1/made" --silent --no-log-file; }

make_orval() {
  echo "module.exports = { precut: { input: { target: '$PWD/openapi.json' },
    output: { target: '$PWD/$1/made.ts', client: 'fetch', mode: 'single', baseUrl: '$url' } } };" >"$1/orval.config.cjs" &&
    orval --config "$1/orval.config.cjs" >/dev/null
}

solve_python() { PYTHONPATH=$1 python3 "$here/solve.py" "$1" "$url" questions.json; }

solve_typescript() { # compiled first: the jobs are held against the types of the client
  python3 "$here/program.py" "$1" "$url" questions.json >"$1/solve.ts" &&
    echo '{ "type": "module" }' >"$1/package.json" &&
    cp tsconfig.json "$1/" &&
    tsc --project "$1/tsconfig.json" &&
    node "$1/out/solve.js"
}

try() { # try LANGUAGE GENERATOR
  rm -rf "$2" && mkdir "$2"
  # The words of a generator are of interest where it fails.
  if { "make_$2" "$2" && "solve_$1" "$2"; } >"$2.said" 2>&1; then
    printf '%-26s%s of %s solved\n' "$2" "$(grep -c ' solved$' "$2.said")" "$questions"
  else
    printf '%-26sFAILED\n' "$2"
    cat "$2.said"
    failed=1
  fi
}

tools
serve
python3 "$here/questions.py" "$url" >questions.json
questions=$(python3 -c 'import json; print(len(json.load(open("questions.json"))))')
cp "$here/../../openapi/precut.json" openapi.json
failed=0
try python openapi-generator
try python openapi-python-client
try python datamodel-code-generator
try typescript openapi-typescript
try typescript hey-api
try typescript orval
exit "$failed"
