#!/usr/bin/env bash
# Everything that must hold before a change goes in, by one command.
#
#   ./test.sh              all steps
#   ./test.sh lint test    only these
#   ./test.sh --list       what there is
#
# It fetches what it needs: Debian packages where it may (as root or by sudo without a password), Python packages
# into a virtual environment and cargo's tools into a folder, both under the target folder. A step whose
# tool cannot be had is named at the end; with CI=true it is a failure.
set -euo pipefail
shopt -s inherit_errexit # a failing command inside $(...) ends the step too
cd "$(dirname "${BASH_SOURCE[0]}")"

STEPS=(format lint docs dependencies unused scripts page test contract clients programs dockerfile packaging attack)
declare -A ABOUT=(
  [format]="rustfmt"
  [lint]="clippy over everything, warnings denied"
  [docs]="rustdoc, warnings denied"
  [dependencies]="licences, sources and banned packages against deny.toml"
  [unused]="cargo-machete: dependencies that nothing uses"
  [scripts]="shellcheck"
  [page]="the workbench without a browser: its parts, their form and rules (biome.jsonc), and the types of all of it"
  [test]="unit, property and HTTP tests"
  [contract]="openapi/precut.json is what the program prints, and nothing that Redocly, Spectral or a validator calls an error"
  [clients]="the clients in Python and TypeScript: built, their tests, documentation and notebooks against the service"
  [programs]="programs for machines, read by LinuxCNC's own interpreter"
  [dockerfile]="hadolint over the Dockerfile; compose.yaml against the Compose specification"
  [packaging]="the Debian package goes in, over itself and out; systemd's unit; Kubernetes' manifests and their settings"
  [attack]="schemathesis against the running service, all checks"
)
MACHETE=0.9.2
# What the tests build: all but the unit tests of the calculators, which are built by themselves.
WORKSPACE=(--workspace --exclude precut-calc --locked)
UNITS=(--package precut-calc --lib --locked --config 'profile.dev.package.precut-calc.opt-level=0')
ABSENT=77 # exit code of a step whose tool is not to be had

export CARGO_TERM_COLOR=${CARGO_TERM_COLOR:-auto}
if [ "${CI:-}" = true ]; then
  # Nothing is built twice there, and the folder stays smaller; a panic says its place by itself.
  export CARGO_INCREMENTAL=0 CARGO_PROFILE_DEV_DEBUG=none
fi

target() { # the folder of build products
  cargo metadata --format-version 1 --no-deps --locked | sed 's/.*"target_directory":"\([^"]*\)".*/\1/'
}

absent() { # absent WHAT: says so and leaves the step
  echo "NOT CHECKED: $1 is not here and cannot be installed" >&2
  exit "$ABSENT"
}

as_root() {
  if [ "$(id -u)" = 0 ]; then "$@"; else sudo -n "$@"; fi
}

packages() { # packages PACKAGE...: installs them, or says why it cannot
  local install=(env DEBIAN_FRONTEND=noninteractive apt-get -q -o DPkg::Lock::Timeout=120 install -y --no-install-recommends)
  command -v apt-get >/dev/null || absent "$*"
  if ! as_root "${install[@]}" "$@" >/dev/null 2>&1; then
    # The lists may be old, or not there at all.
    { as_root apt-get -q -o DPkg::Lock::Timeout=120 update && as_root "${install[@]}" "$@"; } || absent "$*"
  fi
}

need() { # need COMMAND PACKAGE...: installs the packages unless the command is there
  local command=$1
  shift
  command -v "$command" >/dev/null || packages "$@"
}

browser() { # Chromium: the small one that draws no window, or else the whole one
  (need chromium-headless-shell chromium-headless-shell) || (need chromium chromium) || true
}

python_tools() { # python_tools [REQUIREMENTS NAME]: prints the folder of Python tools, made from their list once
  local requirements=${1:-tests/tools/requirements.txt} venv stamp
  venv=$(target)/tools/${2:-python}
  stamp=$venv/requirements.txt
  if ! cmp -s "$requirements" "$stamp"; then
    need python3 python3 >&2
    # Debian splits what a virtual environment needs from python3 itself.
    python3 -c "import ensurepip, venv" 2>/dev/null || packages python3-venv >&2
    rm -rf "$venv"
    python3 -m venv "$venv" >&2
    "$venv/bin/pip" install --quiet --disable-pip-version-check --requirement "$requirements" >&2 ||
      absent "a package of $requirements"
    cp "$requirements" "$stamp"
  fi
  echo "$venv/bin"
}

node_tools() { # node_tools FROM FOLDER: installs into the folder what FROM/package-lock.json lists, once
  need node nodejs
  need npm npm
  if ! cmp -s "$1/package-lock.json" "$2/.installed"; then
    mkdir -p "$2"
    cp "$1/package.json" "$1/package-lock.json" "$2/"
    npm ci --prefix "$2" --no-audit --no-fund --silent || absent "a package of $1/package-lock.json"
    cp "$1/package-lock.json" "$2/.installed"
  fi
}

binary() { # prints the path of the debug build, made now
  # Beside a test, as the tests' step builds it: alone its dependencies have fewer features, and are built once more.
  cargo test "${WORKSPACE[@]}" --no-run --test contract >&2
  echo "$(target)/debug/precut"
}

step_format() { cargo fmt --all --check; }

step_lint() { cargo clippy --workspace --all-targets --locked -- -D warnings; }

step_docs() { RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --document-private-items --locked; }

step_dependencies() {
  need python3 python3
  python3 tests/tools/dependencies.py
}

step_unused() {
  local root
  root=$(target)/tools/machete-$MACHETE
  if [ ! -x "$root/bin/cargo-machete" ]; then
    # It runs for seconds: optimised it would take longer to build than it saves.
    CARGO_PROFILE_DEV_DEBUG=none cargo install --quiet --locked --debug --root "$root" --target-dir "$root/build" \
      "cargo-machete@$MACHETE" || absent "cargo-machete"
    rm -rf "$root/build"
  fi
  "$root/bin/cargo-machete" --skip-target-dir
}

step_scripts() {
  need shellcheck shellcheck
  find . \( -path ./target -o -name node_modules \) -prune -o -name '*.sh' -print0 | xargs -0 shellcheck .ci/run packaging/debian/*
}

step_page() {
  local tools said
  need node nodejs
  node --test tests/workbench/*.test.mjs
  tools=$(target)/tools/workbench
  node_tools tests/workbench "$tools"
  "$tools/node_modules/.bin/biome" ci --error-on-warnings
  # What others wrote has no types, and is not ours to mend.
  said=$("$tools/node_modules/.bin/tsc" --project tests/workbench/tsconfig.json | grep -v '^ui/app/vendor/' | grep 'error TS' || true)
  [ -z "$said" ] || {
    echo "$said" >&2
    return 1
  }
}

postgres_installed() { [ -n "$(find /usr/lib/postgresql -path '*/bin/initdb' 2>/dev/null)" ] || command -v initdb >/dev/null; }

step_test() {
  local folder port
  # The documentation's commands are run as they stand; without curl its test fails, the others run.
  (need curl curl) || true
  # So is the workbench in a browser; without one its tests say so and pass, in CI they fail.
  browser
  # Those of many processes give some of them clocks that are wrong by minutes.
  [ -n "$(find /usr/lib -path '*/faketime/libfaketimeMT.so.1' 2>/dev/null)" ] || (packages faketime) || true
  # The tests of the store run over a PostgreSQL, too, and those of many processes start and break one of their own.
  # Debian's package starts a server by itself where it may: that one is not touched.
  if postgres_installed || (packages postgresql); then
    folder=$(mktemp -d /tmp/precut-postgres.XXXXXX)
    # shellcheck disable=SC2064 # the folder as it is now
    trap "tests/tools/postgres.sh remove '$folder'" EXIT
    need python3 python3
    port=$(python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])')
    PRECUT_TEST_POSTGRES=$(tests/tools/postgres.sh start "$folder" "$port")
    export PRECUT_TEST_POSTGRES
  elif [ "${CI:-}" = true ]; then
    absent postgresql
  fi
  run_tests
}

# All programs of tests, whatever fails, so that one look at the log shows all of it.
run_tests() {
  local name code=0
  local -a others=() beside=()
  for name in tests/*.rs tests/*/main.rs; do
    name=${name#tests/}
    name=${name%/main.rs}
    name=${name%.rs}
    [ "$name" = browser ] || others+=(--test "$name")
  done
  others+=(--test library)
  cargo test "${WORKSPACE[@]}" --no-run
  # Its own unit tests are small and run for moments: optimised as their crate is, they would build for minutes.
  cargo test "${UNITS[@]}" --no-run
  # The calculators' own tests only compute: they get what the others leave of the cores, which wait for processes and
  # pages. The pages of a browser leave nothing to those that wait for a process, so they come after them.
  run_beside calc nice -n 19
  cargo test "${UNITS[@]}" --no-fail-fast || code=1
  cargo test "${WORKSPACE[@]}" --no-fail-fast --lib --bins "${others[@]}" || code=1
  cargo test "${WORKSPACE[@]}" --no-fail-fast --test browser || code=1
  for name in "${beside[@]}"; do
    wait "${name%% *}" || code=1
    cat "${name#* }"
    rm -f "${name#* }"
  done
  cargo test --workspace --locked --no-fail-fast --doc || code=1
  return "$code"
}

run_beside() { # run_beside PROGRAM [COMMAND...]: runs a program of tests in the background, its words into a file
  local log program=$1
  shift
  log=$(mktemp)
  "$@" cargo test "${WORKSPACE[@]}" --no-fail-fast --test "$program" >"$log" 2>&1 &
  beside+=("$! $log")
}

step_contract() {
  local precut tools linters
  precut=$(binary)
  "$precut" openapi | diff --unified openapi/precut.json - | head -n 60 || {
    echo "openapi/precut.json is stale: precut openapi > openapi/precut.json" >&2
    return 1
  }
  tools=$(python_tools)
  "$tools/openapi-spec-validator" openapi/precut.json
  linters=$(target)/tools/contract
  node_tools tests/tools/contract "$linters"
  # They ask for newer versions of themselves, and tell who uses them; not here.
  REDOCLY_TELEMETRY=off REDOCLY_SUPPRESS_UPDATE_NOTICE=true "$linters/node_modules/.bin/redocly" lint openapi/precut.json \
    --extends recommended --format summary
  "$linters/node_modules/.bin/spectral" lint openapi/precut.json --ruleset tests/tools/contract/spectral.json \
    --fail-severity error --quiet
}

step_clients() {
  local precut stage python log beside code=0
  precut=$(realpath "$(binary)")
  python=$(realpath "$(python_tools clients/python/requirements.txt python-client)")
  # They are built in a copy: what is made from the contract stays out of the sources.
  stage=$(target)/clients
  rm -rf "$stage"/clients/{python,typescript}/{src,dist,tests,test,notebooks}
  mkdir -p "$stage"
  tar --create --exclude={node_modules,dist,build,models.py,contract.ts} clients docs/api.md openapi README.md LICENSE |
    tar --extract --directory "$stage"
  node_tools clients/typescript "$stage/clients/typescript"
  # The page of the test in a browser; without one it says so, in CI it fails.
  browser
  log=$(mktemp)
  python_client "$stage/clients/python" "$python" "$precut" >"$log" 2>&1 &
  beside=$!
  typescript_client "$stage/clients/typescript" "$precut" || code=1
  wait "$beside" || code=1
  cat "$log"
  rm -f "$log"
  return "$code"
}

python_client() { # python_client SOURCES TOOLS PRECUT
  set -e
  cd "$1"
  "$2/ruff" format --check .
  "$2/ruff" check .
  "$2/python" -m build --no-isolation
  "$2/pip" install --quiet --disable-pip-version-check --no-deps --force-reinstall dist/*.whl
  # The wheel without what it is built from is what is tested.
  "$2/mypy" src/precut tests/typed.py
  PRECUT=$3 "$2/python" -m pytest --quiet
}

typescript_client() { # typescript_client SOURCES PRECUT
  (cd "$1" && PRECUT=$2 npm test --silent && npm pack --silent)
}

step_programs() {
  local precut
  need rs274 linuxcnc-uspace
  need python3 python3
  precut=$(binary)
  python3 tests/tools/rs274_check.py self-test
  python3 tests/tools/rs274_check.py examples "$precut"
  python3 tests/tools/rs274_check.py random "$precut" 40
}

step_dockerfile() {
  local tools
  tools=$(python_tools)
  "$tools/hadolint" docker/Dockerfile
  "$tools/check-jsonschema" --quiet --builtin-schema vendor.compose-spec docker/compose.yaml
}

step_packaging() {
  local tools precut folder package file said
  tools=$(python_tools)
  precut=$(binary)
  folder=$(mktemp -d)
  # shellcheck disable=SC2064 # the folder as it is now
  trap "rm -rf '$folder'" EXIT

  for file in packaging/kubernetes/*.yaml; do
    "$tools/kubernetes-validate" --strict --quiet "$file"
    "$tools/python" -c '
import sys, yaml
for part in yaml.safe_load_all(sys.stdin):
    print(part.get("data", {}).get("precut.toml", "") if part["kind"] == "ConfigMap" else "")
' <"$file" >"$folder/settings.toml"
    grep --quiet admin_listen "$folder/settings.toml"
    "$precut" --config "$folder/settings.toml" --print-config >/dev/null
  done

  need dpkg-deb dpkg
  need readelf binutils
  package=$(packaging/deb.sh "$precut" "$folder" -Znone 2>/dev/null)
  mkdir -p "$folder"/root/var/lib/dpkg/{info,updates,triggers}
  touch "$folder"/root/var/lib/dpkg/{status,available}
  # Into a folder of its own; its scripts run outside of it, where they see that they have nothing to start.
  in_folder() {
    dpkg --root="$folder/root" --force-script-chrootless --force-not-root --force-depends "$@" </dev/null >"$folder/log" 2>&1 ||
      { cat "$folder/log" >&2 && return 1; }
  }
  in_folder --install "$package"
  "$folder/root/usr/bin/precut" --config "$folder/root/etc/precut/precut.toml" --print-config >/dev/null
  echo "# mine" >>"$folder/root/etc/precut/precut.toml"
  in_folder --install "$package"
  grep --quiet "# mine" "$folder/root/etc/precut/precut.toml"

  need systemd-analyze systemd
  sed "s|^ExecStart=precut|ExecStart=$folder/root/usr/bin/precut|" packaging/precut.service >"$folder/precut.service"
  # A name that it does not know is only said, and passed over.
  said=$(systemd-analyze verify "$folder/precut.service" 2>&1 | grep precut.service || true)
  [ -z "$said" ] || {
    echo "$said" >&2
    return 1
  }
  # Of 100: what it may do beyond what it needs.
  systemd-analyze security --offline=true --threshold=20 "$folder/precut.service" >/dev/null

  in_folder --remove precut
  [ ! -e "$folder/root/usr/bin/precut" ]
  in_folder --purge precut
  [ ! -e "$folder/root/etc/precut" ]
}

step_attack() {
  local tools precut
  tools=$(python_tools)
  precut=$(binary)
  python3 tests/tools/attack.py "$precut" "$tools/schemathesis"
}

list() {
  local step
  for step in "${STEPS[@]}"; do printf '%-13s %s\n' "$step" "${ABOUT[$step]}"; done
}

processor_seconds() { # of all processes that have ended under this one
  # The name in brackets may hold spaces. Behind it, fields 14 and 15 are its children's time in hundredths of a second.
  sed 's/.*) //' "/proc/$$/stat" | awk '{ print int(($14 + $15) / 100) }'
}

main() {
  local step code said seconds processor failed=0
  local -a summary=()
  for step in "$@"; do
    if [ -z "${ABOUT[$step]:-}" ]; then
      echo "no step '$step'; there are:" >&2
      list >&2
      exit 2
    fi
  done
  # Rust links with it, and SQLite is compiled by it.
  (need cc gcc libc6-dev) || exit 1
  for step in "$@"; do
    printf '\n== %s: %s\n' "$step" "${ABOUT[$step]}"
    seconds=$SECONDS
    processor=$(processor_seconds)
    # A process of its own: there, every failing command ends the step.
    code=0
    "$BASH" "${BASH_SOURCE[0]}" --step "$step" || code=$?
    said=ok
    if [ "$code" = "$ABSENT" ] && [ "${CI:-}" != true ]; then
      said="NOT CHECKED"
    elif [ "$code" != 0 ]; then
      said=FAILED
      failed=1
    fi
    summary+=("$(printf '%-11s %5d s %6d s  %s' "$said" $((SECONDS - seconds)) $(($(processor_seconds) - processor)) "$step")")
  done
  printf '\n== summary: %s s, %s s of the processor\n' "$SECONDS" "$(processor_seconds)"
  printf '%s\n' "${summary[@]}"
  exit "$failed"
}

case "${1:-}" in
  --step) "step_$2" ;;
  --list | --help | -h) list ;;
  "") main "${STEPS[@]}" ;;
  *) main "$@" ;;
esac
