"""What puts a netlist into a simulation in the place of the module it was made of: a shell with the module's name, ports and parameters."""
import os
import re

from hdl_flow import Stop, module_of as named, sources_of, write

SUFFIX = "_netlist"  # of the modules inside


def module_of(text, root):
    """NAME[:PARAMETER=N,...] as the module's name and {parameter: value}; the module must have them."""
    module, parameters = named(text, root)
    with open(os.path.join(root, "rtl", module + ".sv"), encoding="utf-8") as file:
        source = file.read()
    for name in parameters:
        if not re.search(rf"\bparameter\s+{re.escape(name)}\s*=", source):
            raise Stop(f"rtl/{module}.sv: the module has no parameter {name}", 2)
    return module, parameters


def with_defaults(text, parameters):
    """The source with other defaults of its module's parameters; TAP has one for builds with the ports and one without."""
    for name, value in parameters.items():
        text = re.sub(rf"(\bparameter\s+{re.escape(name)}\s*=\s*)[^,/\n)]+", rf"\g<1>{value}", text)
    return text


def read_source(module, folder):
    with open(os.path.join(folder, "rtl", module + ".sv"), encoding="utf-8") as file:
        return file.read()


def write_shell(module, parameters, ports, folder):
    """folder/shell.sv. ports: names of the netlist's; one that the netlist lacks is the tap of a build without it."""
    source = with_defaults(read_source(module, folder), parameters)
    header = re.search(rf"^module {module}\b.*?^\);", source, re.M | re.S)
    if not header:
        raise Stop(f"rtl/{module}.sv: 'module {module}' with its ports, and ');' at the beginning of a line, are not there")
    checks = ""
    # Of the two defaults of TAP the second one: the netlist was made without the macro that chooses the first.
    for name, default in dict(re.findall(r"^\s*parameter\s+(\w+)\s*=\s*([^,/\n)]+)", header.group(0), re.M)).items():
        checks += f"  `SF_REFUSE({name} != ({default.strip()}), \"{module}: the netlist was made with another {name}\")\n"
    tied = "  assign tap_valid_o = 1'b0;\n" if "tap_valid_o" in header.group(0) and "tap_valid_o" not in ports else ""
    connected = ", ".join(f".{name}({name})" for name in ports)
    write(os.path.join(folder, "shell.sv"), f"`include \"sf_refuse.svh\"\n{header.group(0)}\n{checks}{tied}  {module}{SUFFIX} u_netlist ({connected});\nendmodule\n")


def listed(check, top):
    """Lines of the list: include folder, packages, the netlist in its shell, and the RTL around a module that is not the block."""
    names = [name for name in sources_of(check.folder) if name.endswith("_pkg.sv")]
    around = []
    if check.module != top:
        source = with_defaults(read_source(top, check.folder), check.block)
        write(os.path.join(check.folder, "block.sv"), source)
        around = [name for name in sources_of(check.folder) if name not in names and os.path.basename(name) not in (check.module + ".sv", top + ".sv")]
        around.append("block.sv")
    return ["+incdir+rtl"] + names + ["cells.v", "netlist.v", "shell.sv"] + around
