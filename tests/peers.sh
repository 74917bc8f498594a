#!/usr/bin/env bash
# What the tests talk to and pip cannot install: a real Prometheus and browser, systemd's checks, a clock that can be
# set back, message brokers, a database, readers of maps, reverse proxies, and gRPC clients in other languages. Installs
# what it can: Debian's packages as root, npm's packages wherever there is npm, grpcurl where there is Go. The tests that
# need what is missing are skipped, and say so.
set -uo pipefail
cd "$(dirname "$0")"

skipped() { echo "tests/peers.sh: $1; some tests will be skipped" >&2; }

packages=()
command -v prometheus >/dev/null && command -v promtool >/dev/null || packages+=(prometheus)
command -v chromium-headless-shell >/dev/null || packages+=(chromium-headless-shell)
command -v systemd-analyze >/dev/null || packages+=(systemd)
command -v faketime >/dev/null || packages+=(faketime)
command -v mosquitto >/dev/null || packages+=(mosquitto)
command -v nats-server >/dev/null || packages+=(nats-server)
command -v ogrinfo >/dev/null && command -v ogr2ogr >/dev/null || packages+=(gdal-bin)
ls /usr/lib/postgresql/*/bin/postgres >/dev/null 2>&1 || command -v postgres >/dev/null || packages+=(postgresql)
command -v nginx >/dev/null || packages+=(nginx-light)
command -v caddy >/dev/null || packages+=(caddy)
command -v node >/dev/null || packages+=(nodejs)
command -v npm >/dev/null || packages+=(npm)
if [ ${#packages[@]} -gt 0 ]; then
    if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
        { apt-get update -qq && DEBIAN_FRONTEND=noninteractive \
            apt-get install -y -qq --no-install-recommends "${packages[@]}" >/dev/null; } \
            || skipped "could not install ${packages[*]}"
    else
        skipped "root on Debian could install ${packages[*]}"
    fi
fi
if command -v go >/dev/null && ! command -v grpcurl >/dev/null; then
    GOBIN="$PWD/../.venv/bin" go install github.com/fullstorydev/grpcurl/cmd/grpcurl@v1.9.3 \
        || skipped "could not build grpcurl"
fi
if command -v npm >/dev/null; then
    for folder in javascript ../clients/typescript; do
        npm ci --prefix "$folder" --no-audit --no-fund --ignore-scripts --loglevel=error \
            || skipped "could not install the npm packages of $folder"
    done
fi
