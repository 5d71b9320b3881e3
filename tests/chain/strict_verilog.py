#!/usr/bin/env python3
"""The RTL and the benches that users compile, through slang, which follows IEEE 1800-2017 more closely than Verilator, Icarus
and Yosys do: names are declared before they are used, either every module has a time scale or none has.

usage: strict_verilog.py BUILD
Exits 0 when slang accepts all, 1 when not, 77 (skipped) where the Python module is not installed.
"""
import glob
import os
import subprocess
import sys
import tempfile

try:
    import pyslang
except ImportError as missing:
    print(f"strict_verilog: skipped: {missing} (make python installs it)")
    sys.exit(77)


def accepted(*arguments):
    """Whether slang finds no error; it prints what it finds."""
    driver = pyslang.driver.Driver()
    driver.addStandardArgs()
    good = driver.parseCommandLine(" ".join(("slang", "-Wno-unconnected-output-port") + arguments))
    good = good and driver.processOptions() and driver.parseAllSources() and driver.reportParseDiags()
    if not good:
        return False
    driver.reportCompilation(driver.createCompilation(), True)
    return driver.reportDiagnostics(True)


def main(build):
    build = os.path.abspath(build)
    root = os.getcwd()
    packages = ["rtl/gen/sf_arch_pkg.sv", "rtl/gen/sf_csr_pkg.sv", "rtl/sf_op_pkg.sv"]
    rtl = packages + sorted(set(glob.glob("rtl/gen/*.sv") + glob.glob("rtl/*.sv")) - set(packages))
    failed = []

    def check(top, *arguments):
        if not accepted("-Irtl", "--top", top, *arguments):
            failed.append(top)

    for top in ("sf_top", "sf_ray_top"):
        check(top, *rtl)
        check(top, "-DSF_NO_TAP", *rtl)
    for folder in sorted(glob.glob("rtl/board/*/")):
        top = os.path.basename(folder.rstrip("/"))
        check(top, "-DSF_NO_TAP", *rtl, *sorted(glob.glob("rtl/board/*.sv")), f"{folder}{top}.sv", "tests/board/vendor.sv")
    check("sf_registers_tb", *rtl, "sim/sf_registers_tb.sv")
    check("golden_tb", *rtl, "src/lib/sf_golden_dpi.sv", "docs/golden_tb.sv")
    # cocotb's simulators are given a time scale, because it waits in nanoseconds
    check("sf_cocotb_top", "--timescale", "1ns/1ns", "-DSF_DUT=sf_top", *rtl, *glob.glob("share/cocotb/*.sv"))
    with tempfile.TemporaryDirectory(prefix="sf-strict-") as work:
        run = [[f"{build}/bin/sf_scene", "simple", "-o", "data", "--size", "16", "--train", "4", "--test", "1"],
               [f"{build}/bin/sf_train", "data", "-o", "m.safetensors", "--stage1", "4", "--stage2", "4", "--samples", "256", "--quiet"],
               [f"{build}/bin/sf_export", "m.safetensors", "-o", "scene.snn"],
               [f"{build}/bin/sf_export", "scene.snn", "--vectors", "kit", "--data", "data", "--samples", "4"]]
        for command in run:
            done = subprocess.run(command, cwd=work, capture_output=True, text=True)
            if done.returncode:
                print(f"strict_verilog: {os.path.basename(command[0])}: {done.stderr.strip()}")
                return 1
        os.chdir(f"{work}/kit")  # as kit.md says
        for top in ("sf_kit_tb", "sf_ray_kit_tb"):
            check(top, "-I.", "-F", "rtl.f", f"{top}.sv")
        os.chdir(root)
    print("strict_verilog: " + (f"slang refuses {', '.join(failed)}" if failed else "slang accepts the RTL and its benches"))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
