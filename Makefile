# `make demo` and `make test` are all that a fresh machine with Python 3.11+ and make needs.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
OUT := out/demo

.PHONY: demo test test-all lint bench schemas clean

demo: $(STAMP)
	mkdir -p $(OUT)
	$(BIN)/replay simulate recordings/drive/scenario.toml -o $(OUT)/input.mcap
	$(BIN)/replay run gnss-ins-lc $(OUT)/input.mcap -o $(OUT)/run.mcap --rrd $(OUT)/run.rrd
	$(BIN)/replay evaluate $(OUT)/run.mcap
	$(BIN)/replay report $(OUT)/run.mcap -o $(OUT)/report.html
	$(BIN)/replay verify $(OUT)/run.mcap --input $(OUT)/input.mcap
	$(BIN)/replay simulate recordings/tang-short/scenario.toml -o $(OUT)/town.mcap
	for method in spp tdcp-ins rtk; do \
	  $(BIN)/replay run $$method $(OUT)/town.mcap -o $(OUT)/town-$$method.mcap || exit; done
	$(BIN)/replay compare $(OUT)/town-spp.mcap $(OUT)/town-tdcp-ins.mcap $(OUT)/town-rtk.mcap \
	  -o $(OUT)/methods.html --rrd $(OUT)/methods.rrd

test: $(STAMP)
	$(BIN)/python -m pytest -n auto

test-all: $(STAMP)
	$(BIN)/python -m pytest -n auto -m ""

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python tools/generate_schemas.py --check

bench: $(STAMP)
	$(BIN)/python -m tools.bench

schemas: $(STAMP)
	$(BIN)/python tools/generate_schemas.py

clean:
	rm -rf out $(VENV)

# The constraints file keeps the set-up the same tomorrow as today.
$(STAMP): pyproject.toml constraints.txt
	test -d $(VENV) || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet -c constraints.txt -e ".[dev]"
	touch $@
