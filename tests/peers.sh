#!/usr/bin/env bash
# What the tests talk to and pip cannot install: a real Prometheus, a real browser, and a gRPC client in another language.
set -euo pipefail
cd "$(dirname "$0")"

packages=()
command -v prometheus promtool >/dev/null || packages+=(prometheus)
command -v chromium >/dev/null || packages+=(chromium)
command -v node >/dev/null || packages+=(nodejs)
command -v npm >/dev/null || packages+=(npm)
if [ ${#packages[@]} -gt 0 ]; then
    root=()
    [ "$(id -u)" = 0 ] || root=(sudo)
    "${root[@]}" apt-get update -qq
    DEBIAN_FRONTEND=noninteractive "${root[@]}" apt-get install -y -qq --no-install-recommends "${packages[@]}" >/dev/null
fi
npm ci --prefix strangers --no-audit --no-fund --ignore-scripts --loglevel=error
