#!/usr/bin/env bash
# The page's own tests, then the page in Debian's Chromium. What is missing is installed where that is allowed (as root,
# on Debian); otherwise nothing is tested, and that is said.
set -euo pipefail
cd "$(dirname "$0")"

missing() {
    command -v node >/dev/null || echo nodejs
    command -v npm >/dev/null || echo npm
    [ -x "${CHROMIUM:-/usr/bin/chromium}" ] || echo chromium
}

if [ -n "$(missing)" ] && [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
    # shellcheck disable=SC2046  one package for each word
    apt-get install --yes --quiet --no-install-recommends $(missing) || true
fi
if [ -n "$(missing)" ]; then
    echo "SKIPPED: the page is not tested in a browser, since this machine lacks:" $(missing)
    exit 0
fi
make --no-print-directory -C .. frontend/node_modules/.made
npm run --silent types
npm test --silent
node --test --test-reporter=spec e2e/*.mjs
