#!/bin/sh
# kinacc behind a gate, on one machine: study, check and gate of one commit.
#
#     sh pipeline.sh REPOSITORY COMMIT
#
# of a git repository that is laid out as docs/pipeline.md says, from a hook, a timer or by hand.
# Exit codes are those of `kinacc gate`. For commits of people you trust: what they say is run.
set -eu
repository=$1 commit=$2
study=${STUDY:-tracker.yaml}
run=${RUN:-calibrate} # the models; or study: maps, assessors and figures as well
kept=${KEPT:-$HOME/.cache/kinacc-pipeline} # of one repository
export CI=true SNAKEMAKE_OUTPUT_CACHE="$kept/fits"

mkdir -p "$kept/fits" "$kept/runs"
exec 9> "$kept/lock"
flock 9 # of two pushes the second waits

# The folder stays from run to run, with what was computed: what did not change is not run again.
unset $(git rev-parse --local-env-vars) # a hook sets them
test -d "$kept/clone/.git" || git clone -q --no-checkout "$repository" "$kept/clone"
cd "$kept/clone"
git fetch -q --prune origin
git checkout -q --force --detach "$commit"
git ls-files -z | xargs -0 touch -c -t 200001010000 # content tells what changed, not today's date

# One environment for each list of packages and Python.
version=$(python3 -c 'import platform; print(platform.python_version())')
environment=$kept/environment-$version-$(cat requirements/*.txt | sha256sum | cut -c1-16)
if ! test -e "$environment/ready"; then
  python3 -m venv --clear "$environment"
  "$environment/bin/python" -m pip install -q --require-hashes --no-deps \
    -r requirements/run.txt -r requirements/wheel.txt
  "$environment/bin/python" -m kinacc.workflow.warm_up
  touch "$environment/ready"
fi
PATH=$environment/bin:$PATH

# Report and results are kept for people, whatever the gate says.
leave() {
  mkdir -p "$kept/runs/$commit"
  for each in gate.* results; do
    test ! -e "$each" || cp -RL "$each" "$kept/runs/$commit/"
  done
}
rm -f gate.*
trap leave EXIT
kinacc "$run" "$study" -- --cache
kinacc check-results results --config "$study"
kinacc gate results --config "$study" --against accepted --out gate.json --out gate.xml --out gate.md
