# Everything lives in .venv/; nothing else of the machine is touched.
PYTHON ?= python3
BIN := .venv/bin
export PATH := $(CURDIR)/$(BIN):$(PATH)
export PLAYWRIGHT_BROWSERS_PATH ?= $(CURDIR)/.venv/browsers

.PHONY: setup repro browser test check ui real bench clean lock

setup: .venv/ready

.venv/ready: requirements/lock.txt pyproject.toml
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile -r requirements/lock.txt
	@# On all cores, which pip does not use; what is no Python of this version fails, and is not needed.
	@$(BIN)/python -m compileall -qq -j 0 .venv/lib || true
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	@# DVC's experiments are commits; where git knows nobody, this clone gets a name of its own.
	@git config user.name >/dev/null || git config --local user.name pcrdiff
	@git config user.email >/dev/null || git config --local user.email pcrdiff@localhost
	touch $@

repro: setup  ## the main job: raw clouds to report, on synthetic data
	$(BIN)/pcrdiff repro
	@echo
	@echo "report:    $(CURDIR)/reports/index.html   (tables: reports/tables/results.md)"
	@echo "MLflow UI: make ui   (then http://127.0.0.1:5000)"

browser: setup  # for the tests that look at pages; without one they are skipped, and say why
	@command -v chromium >/dev/null || command -v google-chrome >/dev/null || \
	  timeout 300 $(BIN)/playwright install --only-shell chromium >.venv/browser.log 2>&1 || \
	  echo "no browser could be installed, see .venv/browser.log: tests that need one are skipped"

test: browser  ## the whole suite; tests on real data run where it is found
	$(BIN)/python -m pytest -n 3 --dist loadfile

check: setup  ## format, lint, types, layers
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

ui: setup  ## browse the runs
	$(BIN)/pcrdiff mlflow ui

real: setup  ## the pipeline on real data: PCRDIFF_REAL_DATA, or ../shared/data
	$(BIN)/pcrdiff real

bench: setup  ## speed beside others on this machine, to benchmarks/*.csv; leave it alone meanwhile
	$(BIN)/pcrdiff repro $$($(BIN)/python -m benchmarks --stages)
	$(BIN)/python -m benchmarks

clean:
	rm -rf .venv

lock:  ## needs uv and a CPU build of torch 2.13.0 that it can find
	uv pip compile --universal --python-version 3.11 --extra dev --constraint requirements/torch.txt \
	  --no-header --no-annotate pyproject.toml | sed 's/+cpu//' > requirements/lock.txt
