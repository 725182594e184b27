#!/usr/bin/env bash
# Runs the project's checks one after the other, all of them even when one fails, and says at the end which passed.
#
#   tools/check.sh quick    layout, types, engine tests, Python tests but the slow ones (make test)
#   tools/check.sh format   lay out the C++ files, and nothing else (make format)
#   tools/check.sh all      the same with the slow tests, clang-tidy, the sanitizers and the wheel (make test-all)
set -uo pipefail
cd "$(dirname "$0")/.."
bin=$PWD/.venv/bin
summary=()
failed=0

# check NAME COMMAND...: runs the command, shows its output, remembers how it ended.
check() {
    local name=$1 start=$SECONDS status=0
    shift
    printf '\n==> %s\n' "$name"
    "$@" || status=$?
    if [ "$status" = 0 ]; then
        summary+=("$(printf '  ok      %-24s %4d s' "$name" $((SECONDS - start)))")
    else
        summary+=("$(printf '  FAILED  %-24s %4d s' "$name" $((SECONDS - start)))")
        failed=$((failed + 1))
    fi
}

cpp_files() {
    git ls-files --cached --others --exclude-standard -- 'engine/*.h' 'engine/*.cpp' 'tests/engine/*.cpp' |
        grep -v '^engine/src/gl/'
}

# Only clang-format 14 is asked: versions lay out the same code differently.
clang_format=$(command -v clang-format-14 || command -v clang-format)

cpp_layout() {
    if ! "${clang_format:-false}" --version 2>/dev/null | grep -q 'version 14\.'; then
        echo "clang-format 14 is not installed: C++ layout not checked"
        return
    fi
    cpp_files | xargs -r "$clang_format" --dry-run -Werror && echo "C++ layout: $(cpp_files | wc -l) files as .clang-format has them"
}

sanitizer() {
    cmake --preset "$1" >/dev/null && cmake --build --preset "$1" && ctest --preset "$1"
}

clang_tidy() {
    if ! command -v clang-tidy >/dev/null; then
        echo "clang-tidy is not installed: C++ not checked by it"
        return
    fi
    cmake --preset dev >/dev/null && cpp_files | grep '^engine/src/.*\.cpp$' | xargs -r -P 2 -n 1 clang-tidy --quiet -p build/dev
}

wheel() {
    rm -rf build/wheel-check
    "$bin/pip" wheel --quiet --no-deps --no-build-isolation --wheel-dir build/wheel-check . &&
        "$bin/python" -m zipfile -l build/wheel-check/transom-*.whl | grep -E 'transom/(_engine|cli|py.typed)'
}

mode=${1:-quick}
if [ "$mode" = format ]; then
    cpp_files | xargs -r "$clang_format" -i
    exit
fi
check "ruff" "$bin/ruff" check
check "ruff format" "$bin/ruff" format --check
check "C++ layout" cpp_layout
check "mypy" "$bin/mypy"
check "engine tests" ctest --preset release
if [ "$mode" = all ]; then
    check "Python tests" "$bin/pytest"
    check "clang-tidy" clang_tidy
    for preset in asan tsan; do
        check "$preset" sanitizer "$preset"
    done
    check "wheel" wheel
else
    check "Python tests" "$bin/pytest" -m "not slow"
fi

printf '\nChecks:\n'
printf '%s\n' "${summary[@]}"
printf '%d checks passed, %d failed\n' $((${#summary[@]} - failed)) "$failed"
[ "$failed" = 0 ]
