"""The library that is taken where none is named, and what of a library is not used."""
import os

from hdl_flow import Stop

LIBERTY = "/usr/share/qflow/tech/osu018/osu018_stdcells.lib"
SKIPPED = ["lpflow", "probe", "sparecell", "dly"]  # of sky130: cells for more than one supply, for probing, for delay


def must_exist(path):
    """Raises Stop with status 77 where Debian's library is not installed, with 1 where another is not there."""
    if os.path.exists(path):
        return
    if path == LIBERTY:
        raise Stop(f"{path}: not there; it is in Debian's package qflow-tech-osu018 (make deps-asic)", 77)
    raise Stop(f"{path}: not there")
