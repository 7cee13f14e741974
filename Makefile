.PHONY: setup demo test lint bench figures clean
python := .venv/bin/python

setup:
	@tools/setup.sh

demo: setup
	@$(python) examples/demo.py

test: setup
	@$(python) -m pytest -n 2

lint: setup
	@$(python) -m ruff check .
	@$(python) -m ruff format --check .
	@$(python) -m pyright

bench: setup
	@$(python) -m benchmarks

figures: setup
	@$(python) -m docs.figures

clean:
	rm -rf .venv demo_output tests/output
