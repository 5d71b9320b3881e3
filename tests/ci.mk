# What only some tests need: a browser, and readers of our files from PyPI. `make deps check` goes on without; continuous
# integration has both. Included by the Makefile.

deps-ci: ## install with apt what `make check` needs to leave no test out (Chromium and its driver, man, OpenSTA, Slurm, Tcl, COLMAP, FFmpeg, exiftran, libclang for Python), and `make deb`
	@DEPS="chromium chromium-driver python3-selenium libxml2-utils opensta slurmctld slurmd slurm-client munge python3 python3-venv python3-clang-14 man-db tcl colmap ffmpeg exiftran $(DEB_PACKAGES)" tools/deps.sh

# In an environment of its own, which tests/run.sh puts first: nothing is installed on the system.
REQUIREMENTS := tests/requirements.txt
python: $B/python/.done $B/cocotb/.done ## from PyPI: readers of our files, for the tests that compare with them, and what the cocotb bench needs: build/python, build/cocotb
$B/python/.done: $(REQUIREMENTS)
$B/cocotb/.done: share/cocotb/requirements.txt
$B/python/.done $B/cocotb/.done:
	$(call say,PIP   $(@D))
	$Qrm -rf $(@D)
	$Qpython3 -m venv $(@D) || { echo "python: no environment in $(@D): is python3-venv installed? (make deps-ci)" >&2; exit 1; }
	$Q$(@D)/bin/python3 -m pip install --quiet --disable-pip-version-check -r $< || { \
	  rm -rf $(@D); echo "python: the package index cannot be reached, or lacks what $< lists: the tests read_nir, read_safetensors and cocotb are skipped, and package leaves parts out" >&2; exit 1; }
	@touch $@
.PHONY: deps-ci python
