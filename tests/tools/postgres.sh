#!/usr/bin/env bash
# A PostgreSQL for tests: a data folder of its own, loopback only, a port of its own, gone when it is stopped.
#
#   postgres.sh start FOLDER PORT [SETTING=VALUE ...]   makes it where it is absent, starts it, prints its address
#   postgres.sh stop FOLDER [MODE]                      smart, fast (default) or immediate: as if it were killed
#   postgres.sh running FOLDER                          whether it runs
#   postgres.sh remove FOLDER                           stops it and removes its folder
#
# The database refuses to be run by root: then it is run by the user that Debian's package has made for it.
set -euo pipefail

die() {
  echo "postgres.sh: $1" >&2
  exit 1
}

bin() { # the newest that is installed
  local found
  found=$(find /usr/lib/postgresql -path '*/bin/initdb' 2>/dev/null | sort -V | tail -n 1)
  if [ -z "$found" ]; then found=$(command -v initdb || true); fi
  [ -n "$found" ] || die "no PostgreSQL is installed (Debian: apt-get install postgresql)"
  dirname "$found"
}

BIN=$(bin)
PASSWORD=loopback

as_user() {
  if [ "$(id -u)" = 0 ]; then
    # A folder that the user cannot enter would only make noise.
    (cd / && setpriv --reuid=postgres --regid=postgres --init-groups -- "$@")
  else
    "$@"
  fi
}

start() {
  local folder=$1 port=$2 setting
  shift 2
  if [ ! -f "$folder/data/PG_VERSION" ]; then
    mkdir -p "$folder"
    chmod 755 "$folder"
    printf '%s' "$PASSWORD" >"$folder/password"
    chmod 644 "$folder/password"
    mkdir -m 700 "$folder/data"
    mkdir -m 755 "$folder/socket"
    if [ "$(id -u)" = 0 ]; then chown -R postgres "$folder"; fi
    as_user "$BIN/initdb" --pgdata "$folder/data" --username precut --pwfile "$folder/password" --auth scram-sha-256 \
      --encoding UTF8 --no-locale --no-sync >/dev/null
    {
      echo "listen_addresses = '127.0.0.1'"
      echo "unix_socket_directories = '$folder/socket'"
      echo "max_connections = 200"
      # A test is no power cut.
      echo "fsync = off"
      echo "logging_collector = off"
      for setting in "$@"; do echo "${setting%%=*} = '${setting#*=}'"; done
    } | as_user tee -a "$folder/data/postgresql.conf" >/dev/null
  fi
  as_user "$BIN/pg_ctl" --pgdata "$folder/data" --log "$folder/log" --options "-p $port" --wait start >/dev/null ||
    die "it does not start: $(tail -n 5 "$folder/log")"
  echo "postgres://precut:$PASSWORD@127.0.0.1:$port/postgres"
}

stop() { as_user "$BIN/pg_ctl" --pgdata "$1/data" --mode "${2:-fast}" --wait stop >/dev/null; }

case "${1:-}" in
  start) start "${@:2}" ;;
  stop) stop "${@:2}" ;;
  running) as_user "$BIN/pg_ctl" --pgdata "$2/data" status >/dev/null ;;
  remove)
    stop "$2" immediate || true
    rm -rf "$2"
    ;;
  *) die "start, stop, running or remove" ;;
esac
