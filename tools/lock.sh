#!/usr/bin/env bash
# Resolves requirements.in into requirements.lock with pip-tools, in an environment of its own. No index is written down:
# where packages come from is pip's own setting on each machine.
set -euo pipefail
cd "$(dirname "$0")/.."
tools_venv=build/lock-venv
"$(tools/setup.sh --python)" -m venv "$tools_venv"
"$tools_venv/bin/pip" install --quiet pip-tools
"$tools_venv/bin/pip-compile" --quiet --upgrade --generate-hashes --strip-extras --no-header --no-annotate \
    --no-emit-index-url --no-emit-find-links --no-emit-trusted-host --no-emit-options \
    --output-file build/requirements.lock requirements.in
{
    echo "# Exact versions and hashes of everything in requirements.in, resolved for Python 3.11 on Linux by \`make lock\`."
    grep -v '^#' build/requirements.lock
} >requirements.lock.new
mv requirements.lock.new requirements.lock
