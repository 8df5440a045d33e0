# Shared by quickstart, test, bench and the container; sourced, never run. Debian package names live here only.

set -euo pipefail

project=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

build_packages=(
  ca-certificates cmake g++ ninja-build ccache pkg-config
  libcpp-httplib-dev libdraco-dev libembree-dev libcli11-dev libmeshoptimizer-dev libopenexr-dev
  libseccomp-dev libsqlite3-dev libssl-dev libstb-dev libtbb-dev libtinygltf-dev
  nlohmann-json3-dev zlib1g-dev
)
# What the programs load; everything else is for building them.
runtime_packages=(
  ca-certificates libcpp-httplib0.11 libdraco7 libembree3-3 libmeshoptimizer2d libopenexr-3-1-30
  libseccomp2 libsqlite3-0 libssl3 libstdc++6 libtbb12 zlib1g
)
test_packages=(
  chromium curl libbenchmark-dev libgtest-dev librapidcheck-dev openexr openimageio-tools pfstools
  strace wrk
)

say() { printf '%s\n' "$*" >&2; }
fail() { say "error: $*"; exit 1; }

as_root() {
  if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo "$@"; fi
}

# Installs whichever of the named Debian packages are missing; asks nothing and touches nothing else.
install_packages() {
  local missing=() package
  for package in "$@"; do
    dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q 'ok installed' || missing+=("$package")
  done
  [ "${#missing[@]}" -eq 0 ] && return
  say "Installing ${#missing[@]} Debian packages: ${missing[*]}"
  as_root apt-get update -qq
  as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends \
    "${missing[@]}" >/dev/null
}

# Node.js and npm as they are on the machine, else Debian's.
install_node() {
  command -v node >/dev/null && command -v npm >/dev/null || install_packages nodejs npm
}

# The locked npm packages of a folder with a package-lock.json, once per lock file.
install_npm() {
  local folder=$1 stamp
  stamp=$folder/node_modules/.lock-installed
  cmp -s "$folder/package-lock.json" "$stamp" && return
  (cd "$folder" && npm ci --no-audit --no-fund --ignore-scripts >/dev/null)
  cp "$folder/package-lock.json" "$stamp"
}

# build FOLDER TARGET... -- CMAKE-ARGUMENT...
build() {
  local folder=$1 targets=() ; shift
  while [ "$#" -gt 0 ] && [ "$1" != -- ]; do targets+=("$1"); shift; done
  [ "$#" -gt 0 ] && shift
  cmake -S "$project" -B "$folder" -G Ninja "$@" >"$folder.configure.log" 2>&1 ||
    { cat "$folder.configure.log" >&2; fail "CMake could not configure $folder"; }
  cmake --build "$folder" ${targets[@]:+--target "${targets[@]}"}
}

# The three programs, optimised and without tests, in FOLDER. CMake arguments may follow.
build_release() {
  local folder=$1; shift
  install_packages "${build_packages[@]}"
  install_node
  install_npm "$project/server/web"
  mkdir -p "$(dirname "$folder")"
  build "$folder" kilnd kiln kiln-oven -- -DCMAKE_BUILD_TYPE=Release -DLIGHTKILN_TESTS=OFF "$@"
}
