# make setup     the virtual environment .venv (the other targets call it)
# make demo      runs gauze_dynamic: figures, plots and a replay in out/
# make test      style, types and all tests
# make bench     benchmarks, side by side (SEED=N for other scenes, ONLY=NAME for one)
# make notebook  opens the notebooks in Jupyter

PYTHON ?= python3.12
BIN := .venv/bin
SEED ?= 1
export OMP_NUM_THREADS ?= 1

.PHONY: setup demo test bench notebook clean

setup: .venv/ready

.venv/ready: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dev]'
	touch $@

demo: setup
	$(BIN)/trocar run gauze_dynamic

test: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m pytest -m "not study"

bench: setup
	$(BIN)/python -m tests.benchmarks --seed $(SEED) $(ONLY)

notebook: setup
	$(BIN)/python -m pip install --quiet --constraint constraints.txt jupyterlab
	$(BIN)/jupyter lab notebooks

clean:
	rm -rf .venv out
