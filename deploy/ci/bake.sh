#!/usr/bin/env bash
# Bakes every order (*.json) of a folder, one after the other, into a folder of its own under RESULTS.
# All are tried; the exit code is that of the first that failed, so that a build fails when light
# cannot be baked, and 6 when a result is less exact than MAX_ERROR.
#
#   deploy/ci/bake.sh ORDERS RESULTS [MAX_ERROR]
#
# With LIGHTKILN_SERVER set the orders go to that daemon; without it this machine bakes. What is kept in
# LIGHTKILN_STORE (the private daemon's store) between runs is not baked again.
set -uo pipefail

if [ "$#" -lt 2 ] || [ "$#" -gt 3 ]; then
  echo "usage: deploy/ci/bake.sh ORDERS RESULTS [MAX_ERROR]" >&2
  exit 2
fi
orders=$1 results=$2
options=(--quiet)
[ "$#" -eq 3 ] && options+=(--max-error "$3")
[ -n "${LIGHTKILN_STORE:-}" ] && [ -z "${LIGHTKILN_SERVER:-}" ] && options+=(--store "$LIGHTKILN_STORE")

first_failure=0 baked=0
for order in "$orders"/*.json; do
  [ -e "$order" ] || break
  name=$(basename "$order" .json)
  echo "== $name"
  kiln bake "$order" -o "$results/$name" "${options[@]}"
  code=$?
  baked=$((baked + 1))
  if [ "$code" -ne 0 ]; then
    echo "$name ended with exit code $code" >&2
    [ "$first_failure" -eq 0 ] && first_failure=$code
  fi
done
if [ "$baked" -eq 0 ]; then
  echo "There is no order in $orders." >&2
  exit 2
fi
exit "$first_failure"
