# make reproduce   the paper's study, from a bare checkout to results/
# make robustness  the claims again on further draws of the arm; their shares go into claims.parquet
# make public-robots  every measured arm in examples/data calibrated blind, and the page about it
# make check       lint, types and the fast tests, in under a minute; for while one works
# make test        everything a change has to pass
# make test-all    also every page as typed, the site, runs on a Slurm, browser, research; with Debian's slurm-wlm, chromium
#                  and chromium-driver
# make size        AST nodes and lines of every room, words of the docs, beside their budgets
# make bench       times beside other libraries, and the page about them: ten minutes
# make docs        the pages as a site, docs/_build/index.html; make docs-links asks the network for links
# make audit       known vulnerabilities of every locked package, asked of their database
# make sbom        the packages of a run as a bill of materials, sbom.cdx.json (CycloneDX)
# make lock        renew requirements/*.txt (needs uv)
# make clean       remove results/ and public-robots/; make distclean removes .venv as well
#
# Needs make, git and Python 3.11, 3.12 or 3.13 with its venv module (PYTHON=... to choose one).
# Each set-up step leaves a stamp named after the content it depends on: finished steps cost nothing.

.PHONY: reproduce robustness public-robots lint check test test-all size bench docs docs-links \
  audit sbom lock clean distclean
CORES = 2
PY = .venv/bin/python
# Each file to one worker, which makes what its tests share once; tests/conftest.py orders the files.
PYTEST = $(PY) -m pytest -n $(CORES) --dist loadfile --no-loadscope-reorder
PIP = $(PY) -m pip install -qq --disable-pip-version-check

# More BLAS threads change the last bits of a sum, and two jobs already fill two cores.
export OPENBLAS_NUM_THREADS = 1
export OMP_NUM_THREADS = 1
export MKL_NUM_THREADS = 1
# Bytecode that is kept spares every start a second, and the tests the rewriting of their assertions.
unexport PYTHONDONTWRITEBYTECODE

key = $(shell { cat $(1); pwd; } | cksum | tr -d ' ')
PACKAGES := .venv/.packages-$(call key,requirements/run.txt)
KINACC := .venv/.kinacc-$(call key,requirements/run.txt pyproject.toml)
TOOLS := .venv/.tools-$(call key,requirements/test.txt)
CLUSTER := .venv/.cluster-$(call key,requirements/cluster.txt)
AUDIT := .venv-audit/.audit-$(call key,requirements/audit.txt)
ROBOTKINECAL := .venv-robotkinecal/.peer-$(call key,requirements/robotkinecal.txt)
PEERS := .venv-bench/.peers-$(call key,requirements/run.txt requirements/bench.txt pyproject.toml)

reproduce: $(KINACC)
	@$(PY) -m snakemake --cores $(CORES)

robustness: $(KINACC)
	@$(PY) -m snakemake --cores $(CORES) robustness

public-robots: $(KINACC)
	@$(PY) tools/public_robots.py $(CORES)

lint: $(KINACC) $(TOOLS)
	$(PY) -m ruff check .
	$(PY) -m ruff format --check .
	.venv/bin/lint-imports --no-cache --no-logo
	$(PY) -m mypy -n $(CORES)

check: lint
	$(PYTEST) -m "not slow and not night"

test: lint
	$(PY) -m snakefmt --check Snakefile workflow
	$(PY) -m snakemake --lint
	$(PYTEST) -m "not night"

test-all: lint $(CLUSTER)
	$(PYTEST) --hypothesis-profile=night

# Needs no package: the standard library counts.
size:
	@$$(sh requirements/find-python $(PYTHON)) tools/size.py

# The other libraries have environments of their own: nothing else needs them.
bench: $(PEERS) $(ROBOTKINECAL)
	@.venv-bench/bin/python benchmarks/run.py $(TOPICS)

SITE = $(PY) -m sphinx -q -W --keep-going -c docs
docs: $(KINACC) $(TOOLS)
	@$(SITE) . docs/_build
	@echo "docs/_build/index.html"

docs-links: $(KINACC) $(TOOLS)
	$(SITE) -b linkcheck . docs/_build/links

# A package that the database does not answer for fails the audit as well.
audit: $(AUDIT)
	@for each in run test cluster bench robotkinecal audit; do echo "requirements/$$each.txt"; \
	  .venv-audit/bin/pip-audit --strict --require-hashes --disable-pip --progress-spinner off \
	    -r requirements/$$each.txt || exit 1; done

sbom: $(AUDIT)
	@PYTHONWARNINGS=ignore .venv-audit/bin/cyclonedx-py requirements --pyproject pyproject.toml --output-reproducible \
	  --output-file sbom.cdx.json requirements/run.txt
	@echo "sbom.cdx.json"

# A .venv that another folder or an unsupported Python left here is made anew.
$(PACKAGES):
	@if ! { sh requirements/find-python $(PY) && grep -qF "$$(pwd)/.venv" .venv/bin/activate; } >/dev/null 2>&1; then \
	  python=$$(sh requirements/find-python $(PYTHON)) || exit 1; \
	  echo "kinacc: creating .venv with $$python"; \
	  "$$python" -m venv --clear .venv; \
	fi
	@echo "kinacc: installing the packages pinned in requirements/run.txt (a minute or two)"
	@$(PIP) --require-hashes -r requirements/run.txt
	@touch $@

$(KINACC): $(PACKAGES)
	@echo "kinacc: installing kinacc itself and compiling its kernels"
	@$(PIP) --no-build-isolation --no-deps --editable .
	@.venv/bin/kinacc --version >/dev/null 2>&1 || { \
	  echo "kinacc: programs in .venv do not start in $$(pwd): give the folder a plain name" >&2; exit 1; \
	}
	@$(PY) -m compileall -q src
	@touch $@

$(TOOLS): $(PACKAGES)
	@echo "kinacc: installing the test tools pinned in requirements/test.txt"
	@$(PIP) --require-hashes -r requirements/test.txt
	@touch $@

# Apart from the environment: Snakemake imports every plugin it finds, at every start.
$(CLUSTER): $(PACKAGES)
	@echo "kinacc: installing the plugins pinned in requirements/cluster.txt into .venv/cluster"
	@rm -rf .venv/cluster
	@$(PIP) --require-hashes --no-deps --target .venv/cluster -r requirements/cluster.txt
	@touch $@

PEERS_PIP = .venv-bench/bin/python -m pip install -qq --disable-pip-version-check
$(PEERS):
	@echo "kinacc: installing kinacc and the other libraries into .venv-bench (some minutes)"
	@"$$(sh requirements/find-python $(PYTHON))" -m venv --clear .venv-bench
	@$(PEERS_PIP) --require-hashes -r requirements/run.txt
	@$(PEERS_PIP) --require-hashes -r requirements/bench.txt || \
	  echo "kinacc: the other libraries cannot be installed here, and are left out"
	@$(PEERS_PIP) --no-build-isolation --no-deps --editable .
	@.venv-bench/bin/python -m compileall -q src
	@touch $@

# It needs numpy below 2.
$(ROBOTKINECAL):
	@echo "kinacc: installing robotkinecal into .venv-robotkinecal"
	@"$$(sh requirements/find-python $(PYTHON))" -m venv --clear .venv-robotkinecal
	@.venv-robotkinecal/bin/python -m pip install -qq --disable-pip-version-check \
	  --require-hashes -r requirements/robotkinecal.txt || { rm -rf .venv-robotkinecal/bin; \
	  echo "kinacc: robotkinecal cannot be installed here, and is left out"; }
	@touch $@

$(AUDIT):
	@echo "kinacc: installing the tools of an audit into .venv-audit"
	@"$$(sh requirements/find-python $(PYTHON))" -m venv --clear .venv-audit
	@.venv-audit/bin/python -m pip install -qq --disable-pip-version-check \
	  --require-hashes -r requirements/audit.txt
	@touch $@

# One lock for every supported Python and platform: names, versions and hashes, nothing else.
LOCK = uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --fork-strategy fewest \
  --no-header --no-emit-index-url --no-emit-find-links
lock:
	$(LOCK) requirements/test.in --output-file requirements/test.txt
	$(LOCK) requirements/run.in --constraints requirements/test.txt --output-file requirements/run.txt
	$(LOCK) requirements/bench.in --constraints requirements/test.txt --output-file requirements/bench.txt
	$(LOCK) requirements/robotkinecal.in --output-file requirements/robotkinecal.txt
	$(LOCK) requirements/audit.in --output-file requirements/audit.txt
	$(LOCK) requirements/cluster.in --constraints requirements/run.txt \
	  $$(sed -n 's/^\([a-z0-9-]*\)==.*/--no-emit-package \1/p' requirements/run.txt) \
	  --output-file requirements/cluster.txt

clean:
	rm -rf results public-robots .snakemake docs/_build

distclean: clean
	rm -rf .venv .venv-bench .venv-robotkinecal .venv-audit
