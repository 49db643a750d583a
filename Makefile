# make setup     the virtual environment .venv (the other targets call it); with LOCKED=1
#                only files whose digests are in hashes.txt
# make demo      runs gauze_dynamic: figures, plots and a replay in out/
# make test      style, types and all tests, JOBS at a time
# make studies   what takes too long for it; ONLY=DIR_OR_FILE for some of them
# make golden    the figures of all scenarios against the table of golden ones
# make bench     benchmarks, side by side (SEED=N for other scenes, ONLY=NAME for one)
# make docs      the site, in out/site: pages, notebooks run, docstrings, a gallery
# make notebook  opens the notebooks in Jupyter

PYTHON ?= python3.12
BIN := .venv/bin
SEED ?= 1
JOBS ?= 2
export OMP_NUM_THREADS ?= 1

GALLERY := gauze_dynamic gauze_breathing gauze_press pwe_arc_breathing nav_three_moving \
	nav_crowd snake_circle resect_auto_small keyhole_approach

.PHONY: setup demo test studies golden bench docs notebook clean

setup: .venv/ready

.venv/ready: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
ifdef LOCKED
	$(BIN)/python -m pip install --quiet --require-hashes --requirement hashes.txt
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation --editable .
else
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dev]'
endif
	touch $@

demo: setup
	$(BIN)/trocar run gauze_dynamic
	@echo
	@echo "Open out/gauze_dynamic/replay.html in a browser, and report.html beside it. Then try:"
	@echo "  $(BIN)/trocar run gauze_dynamic --set behaviour=field --out out/field"
	@echo "  $(BIN)/trocar compare out/gauze_dynamic out/field"
	@echo "  $(BIN)/trocar scenarios"

test: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy & types=$$!; \
	$(BIN)/python -m pytest -m "not study" -n $(JOBS) --no-loadscope-reorder \
		&& wait $$types

studies: setup
	$(BIN)/python -m pytest -m study -n $(JOBS) --no-loadscope-reorder $(ONLY)

golden: setup
	$(BIN)/python -m tests.golden $(ONLY)

bench: setup
	$(BIN)/python -m tests.benchmarks --seed $(SEED) $(ONLY)

docs: setup $(GALLERY:%=out/%/replay.html)
	$(BIN)/python -m diagrams.site.build out/site --notebooks --runs $(GALLERY:%=out/%)

out/%/replay.html: | setup
	$(BIN)/trocar run $*

notebook: setup
	$(BIN)/python -m pip install --quiet --constraint constraints.txt jupyterlab
	$(BIN)/jupyter lab notebooks

clean:
	rm -rf .venv out
