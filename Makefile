# make setup   .venv with pinned dependencies and the release module
# make demo    the main job: lift a cylinder and turn it without end
# make test    every test
# make check   formats, lints and types; warnings fail
# make docs    the documentation, with its pictures, as pages in site/
# make bench   how long a control step takes
# make recordings  the runs that the benches and tests of the core replay, anew: after each change of what is commanded
# make reference   what `fingergait bench` compares with, anew: after each change that is meant to change it
# make picture  the picture of the live page in docs/: after each change of what it looks like; needs Chromium
# make fuzz    the core's steps and parsers on anything at all, under AddressSanitizer; needs a nightly toolchain
# make miri    the core's unit tests in an interpreter that knows undefined behaviour; needs a nightly toolchain
# make daqp    the force QP beside DAQP's C code, in one program; needs a C compiler
# Each starts from a bare checkout.

SHELL := bash
.SHELLFLAGS := -euo pipefail -c
.DELETE_ON_ERROR:

PYTHON ?= python3
BIN := .venv/bin
missing = { echo "make: expected $(1), found none; get it: $(2)" >&2; exit 1; }
SOURCES := $(shell find crates -name '*.rs' -o -name Cargo.toml) Cargo.toml Cargo.lock pyproject.toml

.PHONY: setup demo test wheel check docs bench recordings reference picture daqp fuzz miri clean

setup: .venv/.module

demo: setup
	$(BIN)/fingergait run lift-and-rotate
	@echo "see it live, and play with it: .venv/bin/fingergait play"

test: setup wheel
	cargo test --workspace --locked --quiet
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -q -n 2 --dist loadfile

# The installed wheel, away from the checkout, finds its models.
wheel: setup
	folder=$$(mktemp -d) && trap 'rm -rf "$$folder"' EXIT; \
	$(BIN)/pip wheel --quiet --no-deps --no-build-isolation --wheel-dir "$$folder" .; \
	$(BIN)/pip install --quiet --no-deps --target "$$folder/site" "$$folder"/fingergait-*.whl; \
	python="$$PWD/$(BIN)/python"; cd "$$folder"; \
	PYTHONPATH="$$folder/site" "$$python" -c 'import sys, fingergait; assert fingergait.__file__.startswith(sys.argv[1])' "$$folder"; \
	PYTHONPATH="$$folder/site" "$$python" -m fingergait.cli run hold --duration 0.5 --json --out out > /dev/null; \
	echo "wheel: 1 passed, 0 failed"

check: setup
	cargo fmt --all --check
	cargo clippy --workspace --all-targets --locked --quiet -- -D warnings
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# The pictures are drawn and rustdoc's pages added by docs/hooks.py; a warning is an error.
docs: setup
	RUSTDOCFLAGS='-D warnings' cargo doc --no-deps --locked --quiet --package fg-core
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

bench: setup
	cargo bench --workspace --locked
	$(BIN)/fingergait bench

RECORD := $(BIN)/python -m fingergait.run.record lift-and-rotate
RECORDINGS := crates/fg-core/benches/data
# The sensors that users have: noise, encoders of 12 bits, a pose at 60 Hz that is 30 ms late.
SENSORS := position_noise=2e-4 orientation_noise=2e-3 contact_place_noise=3e-4 contact_force_noise=0.05 \
           pose_rate_hz=60 pose_delay_s=0.03 encoder_bits=12

recordings: setup
	$(RECORD) $(RECORDINGS)/rotate.rec --set duration=6
	$(RECORD) $(RECORDINGS)/noisy.rec --set duration=6 $(SENSORS:%=--set sensors.%)

reference: setup
	MATURIN_PEP517_ARGS=--locked $(BIN)/pip install --quiet --no-build-isolation --editable '.[video,view,docs,peers]'
	$(BIN)/fingergait bench --out runs/reference
	cp runs/reference/bench.json models/bench/reference.json

picture: setup
	$(BIN)/python -m fingergait.view.screenshot docs/live.png

# AddressSanitizer is in all three; what they find new stays in target/.
FUZZ_SECONDS ?= 60
fuzz:
	@command -v cargo-fuzz > /dev/null || $(call missing,cargo-fuzz and a nightly toolchain,cargo install cargo-fuzz)
	cd crates/fg-core && for name in parsers step step_any_config; do \
	mkdir -p ../../target/fuzz/$$name; \
	cargo +nightly fuzz run $$name ../../target/fuzz/$$name fuzz/corpus/$$name -- -max_total_time=$(FUZZ_SECONDS); done

# Miri's own sines and cosines differ from call to call unless told not to.
miri:
	@cargo +nightly miri --version > /dev/null || $(call missing,miri,rustup component add --toolchain nightly miri rust-src)
	MIRIFLAGS=-Zmiri-deterministic-floats cargo +nightly miri test --locked --package fg-core --lib

daqp: setup
	folder=$$(mktemp -d) && trap 'rm -rf "$$folder"' EXIT; \
	$(BIN)/pip download --quiet --no-deps --no-binary daqp --dest "$$folder" daqp==0.11.0; \
	tar -xzf "$$folder"/daqp-0.11.0.tar.gz -C "$$folder"; \
	DAQP_SOURCE="$$folder/daqp-0.11.0" cargo run --release --locked --quiet --manifest-path crates/fg-core/daqp/Cargo.toml

clean:
	rm -rf .venv target site docs/pictures

# The pinned dependencies are there already, or, on Python 3.10, come with the module by the ranges of pyproject.toml.
.venv/.module: .venv/.dependencies $(SOURCES)
	@command -v cargo > /dev/null || $(call missing,a stable Rust toolchain,https://rustup.rs or: apt-get install cargo)
	MATURIN_PEP517_ARGS=--locked $(BIN)/pip install --quiet --no-build-isolation --editable '.[video,view,docs]'
	@touch $@

.venv/.dependencies: requirements.lock pyproject.toml
	@command -v $(PYTHON) > /dev/null || $(call missing,Python 3.10 or later,apt-get install python3 python3-venv)
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' || $(call missing,Python 3.10 or later,make PYTHON=python3.11)
	@$(PYTHON) -c 'import ensurepip, venv' 2> /dev/null || $(call missing,the venv module of Python,apt-get install python3-venv)
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check --upgrade 'pip>=25.1'
	@if $(BIN)/python -c 'import sys; sys.exit(sys.version_info < (3, 11))'; \
	then $(BIN)/pip install --quiet --requirement requirements.lock; \
	else $(BIN)/pip install --quiet --group dev; fi
	@touch $@
