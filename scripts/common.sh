# What scripts/run and scripts/test share; to be sourced. Needs bash.
set -euo pipefail
root=$(dirname "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")")

# Run scripts/setup unless everything is there. What setup says goes to stderr: stdout is for results.
set_up() {
  local needed library
  for needed in .venv/bin/fpm .venv/bin/python deps/test-drive/fpm.toml include/hdf5/hdf5.mod include/fftw3.f03 \
    include/dmumps_struc.h; do
    [ -e "$root/$needed" ] || { "$root/scripts/setup" >&2; return; }
  done
  for library in openblas fftw3 hdf5_serial dmumps_seq arpack; do
    # gfortran answers with a path where it knows the library, and with the bare name where not.
    [ "$(gfortran -print-file-name=lib$library.so 2>/dev/null)" != "lib$library.so" ] || { "$root/scripts/setup" >&2; return; }
  done
}

# Build with a section of fpm.rsp and set `program` to the executable. fpm can keep a stale library after modules came
# or went, which ends in undefined references: then once more without it.
build() {
  local log built=yes
  log=$(mktemp)
  run_fpm "$1" "$log" || built=no
  if [ $built = no ] && grep -q 'undefined reference' "$log"; then
    rm -f "$root"/build/gfortran_*/microslip/libmicroslip.a*
    built=yes
    run_fpm "$1" "$log" || built=no
  fi
  # The runner `echo` gives the executable's name in place of running it.
  program=$root/$(grep -o 'build/gfortran_[^ ]*$' "$log" | tail -n 1 || true)
  rm -f "$log"
  [ $built = yes ] && [ -f "$program" ] || { echo "the build failed" >&2; return 1; }
}

# Floating-point traps in the program's own code (test/sanitised/fp_traps.c): sets `traps` to what has to be preloaded,
# empty where this machine has none. fp_traps FOLDER
fp_traps() {
  traps=''
  if [ "$(uname -s -m)" = 'Linux x86_64' ] && command -v gcc >/dev/null; then
    traps=$1/fp_traps.so
    gcc -shared -fPIC -O1 -o "$traps" "$root/test/sanitised/fp_traps.c" -ldl -lm
  fi
}

# run_fpm SECTION LOG: progress goes to stderr, but nothing where nothing is to be built.
run_fpm() {
  (cd "$root" && .venv/bin/fpm "@$1" --runner echo) 2>&1 | tee "$2" |
    sed -u -E '/^Project is up to date$|^build\/gfortran_[^ ]*$/d' >&2
}
