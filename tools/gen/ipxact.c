/* The block as an IP-XACT component (IEEE 1685-2014): bus interfaces, memory maps, ports of sf_top, files. AXI bus
 * definitions are Arm's (amba.com), those of clock, reset and interrupt the common ones of xilinx.com. */
#include "tools/gen/gen.h"
#include "base/arch.h"
#include <inttypes.h>
#include <string.h>

/* Ports of sf_top in its order. logical: name in the bus definition of the interface, NULL for a port of no bus. */
typedef struct port {
  const char *name, *direction;
  int width;
  const char *bus, *logical;
} port;
static const port ports[] = {
    {"clk_i", "in", 1, "clk", "CLK"},
    {"rst_ni", "in", 1, "rst", "RST"},
    {"s_axil_awvalid_i", "in", 1, "s_axil", "AWVALID"},
    {"s_axil_awready_o", "out", 1, "s_axil", "AWREADY"},
    {"s_axil_awaddr_i", "in", 13, "s_axil", "AWADDR"},
    {"s_axil_wvalid_i", "in", 1, "s_axil", "WVALID"},
    {"s_axil_wready_o", "out", 1, "s_axil", "WREADY"},
    {"s_axil_wdata_i", "in", 32, "s_axil", "WDATA"},
    {"s_axil_wstrb_i", "in", 4, "s_axil", "WSTRB"},
    {"s_axil_bvalid_o", "out", 1, "s_axil", "BVALID"},
    {"s_axil_bready_i", "in", 1, "s_axil", "BREADY"},
    {"s_axil_bresp_o", "out", 2, "s_axil", "BRESP"},
    {"s_axil_arvalid_i", "in", 1, "s_axil", "ARVALID"},
    {"s_axil_arready_o", "out", 1, "s_axil", "ARREADY"},
    {"s_axil_araddr_i", "in", 13, "s_axil", "ARADDR"},
    {"s_axil_rvalid_o", "out", 1, "s_axil", "RVALID"},
    {"s_axil_rready_i", "in", 1, "s_axil", "RREADY"},
    {"s_axil_rdata_o", "out", 32, "s_axil", "RDATA"},
    {"s_axil_rresp_o", "out", 2, "s_axil", "RRESP"},
    {"s_axis_tvalid_i", "in", 1, "s_axis", "TVALID"},
    {"s_axis_tready_o", "out", 1, "s_axis", "TREADY"},
    {"s_axis_tdata_i", "in", 64, "s_axis", "TDATA"},
    {"s_axis_tuser_i", "in", 1, "s_axis", "TUSER"},
    {"s_axis_tlast_i", "in", 1, "s_axis", "TLAST"},
    {"m_axis_tvalid_o", "out", 1, "m_axis", "TVALID"},
    {"m_axis_tready_i", "in", 1, "m_axis", "TREADY"},
    {"m_axis_tdata_o", "out", 64, "m_axis", "TDATA"},
    {"m_axis_tlast_o", "out", 1, "m_axis", "TLAST"},
    {"irq_o", "out", 1, "irq", "INTERRUPT"},
    {"tap_valid_o", "out", 1, NULL, NULL},
    {"tap_layer_o", "out", 3, NULL, NULL},
    {"tap_step_o", "out", 3, NULL, NULL},
    {"tap_spikes_o", "out", SF_LANES, NULL, NULL},
    {"tap_rows_o", "out", SF_LANES, NULL, NULL},
    {"tap_membrane_o", "out", SF_LANES *SF_MEMBRANE_BITS, NULL, NULL},
};
enum { PORTS = sizeof ports / sizeof *ports };

/* clock, reset: the bus definition's names of the signals that time the bus, NULL where it is itself one of them. */
typedef struct bus {
  const char *name, *vlnv, *abstraction, *mode, *clock, *reset, *parameter, *value, *meaning;
} bus;
#define AMBA(name, version) "vendor=\"amba.com\" library=\"AMBA4\" name=\"" name "\" version=\"" version "\""
#define SIGNAL(name) "vendor=\"xilinx.com\" library=\"signal\" name=\"" name "\" version=\"1.0\""
static const bus buses[] = {
    {"s_axil", AMBA("AXI4Lite", "r0p0_0"), AMBA("AXI4Lite_rtl", "r0p0_0"), "slave", "ACLK", "ARESETn", NULL, NULL,
     "registers, whole-word writes only"},
    {"s_axis", AMBA("AXI4Stream", "r0p0_1"), AMBA("AXI4Stream_rtl", "r0p0_1"), "slave", "ACLK", "ARESETn", NULL, NULL,
     "samples in: one packet per ray direction or sample"},
    {"m_axis", AMBA("AXI4Stream", "r0p0_1"), AMBA("AXI4Stream_rtl", "r0p0_1"), "master", "ACLK", "ARESETn", NULL, NULL,
     "results out: two beats per sample"},
    {"clk", SIGNAL("clock"), SIGNAL("clock_rtl"), "slave", NULL, NULL, "ASSOCIATED_BUSIF", "s_axil:s_axis:m_axis",
     "the one clock"},
    {"rst", SIGNAL("reset"), SIGNAL("reset_rtl"), "slave", NULL, NULL, "POLARITY", "ACTIVE_LOW",
     "asynchronous reset, active low"},
    {"irq", SIGNAL("interrupt"), SIGNAL("interrupt_rtl"), "master", NULL, NULL, "SENSITIVITY", "LEVEL_HIGH",
     "interrupt: any enabled bit of IRQ_PENDING"},
};
enum { BUSES = sizeof buses / sizeof *buses };

static void put_text(FILE *out, const char *text)
{
  for (; *text; text++) switch (*text) {
    case '&':
      fputs("&amp;", out);
      break;
    case '<':
      fputs("&lt;", out);
      break;
    case '>':
      fputs("&gt;", out);
      break;
    default:
      fputc(*text, out);
    }
}

/* One element per line, two blanks per level; the name is written without its prefix. */
static void leaf(FILE *out, int level, const char *element, const char *text)
{
  fprintf(out, "%*s<ipxact:%s>", 2 * level, "", element);
  put_text(out, text);
  fprintf(out, "</ipxact:%s>\n", element);
}
static void number(FILE *out, int level, const char *element, uint32_t value)
{
  fprintf(out, "%*s<ipxact:%s>%" PRIu32 "</ipxact:%s>\n", 2 * level, "", element, value, element);
}
/* The standard writes hexadecimal as SystemVerilog does. */
static void hex(FILE *out, int level, const char *element, uint32_t value)
{
  fprintf(out, "%*s<ipxact:%s>'h%" PRIx32 "</ipxact:%s>\n", 2 * level, "", element, value, element);
}
static void begin(FILE *out, int level, const char *element)
{
  fprintf(out, "%*s<ipxact:%s>\n", 2 * level, "", element);
}
static void end(FILE *out, int level, const char *element)
{
  fprintf(out, "%*s</ipxact:%s>\n", 2 * level, "", element);
}

static void write_port_map(FILE *out, const char *logical, const char *physical)
{
  fprintf(out,
          "            <ipxact:portMap>\n"
          "              <ipxact:logicalPort><ipxact:name>%s</ipxact:name></ipxact:logicalPort>\n"
          "              <ipxact:physicalPort><ipxact:name>%s</ipxact:name></ipxact:physicalPort>\n"
          "            </ipxact:portMap>\n",
          logical, physical);
}

static void write_bus(FILE *out, const bus *b)
{
  begin(out, 2, "busInterface");
  leaf(out, 3, "name", b->name);
  leaf(out, 3, "description", b->meaning);
  fprintf(out, "      <ipxact:busType %s/>\n", b->vlnv);
  begin(out, 3, "abstractionTypes");
  begin(out, 4, "abstractionType");
  fprintf(out, "          <ipxact:abstractionRef %s/>\n", b->abstraction);
  begin(out, 5, "portMaps");
  if (b->clock) write_port_map(out, b->clock, "clk_i");
  if (b->reset) write_port_map(out, b->reset, "rst_ni");
  for (int i = 0; i < PORTS; i++)
    if (ports[i].bus && !strcmp(ports[i].bus, b->name)) write_port_map(out, ports[i].logical, ports[i].name);
  end(out, 5, "portMaps");
  end(out, 4, "abstractionType");
  end(out, 3, "abstractionTypes");
  if (!strcmp(b->name, "s_axil"))
    fprintf(out, "      <ipxact:slave><ipxact:memoryMapRef memoryMapRef=\"csr\"/></ipxact:slave>\n");
  else
    fprintf(out, "      <ipxact:%s/>\n", b->mode);
  if (b->parameter)
    fprintf(out,
            "      <ipxact:parameters><ipxact:parameter parameterId=\"%s_%s\"><ipxact:name>%s</ipxact:name>"
            "<ipxact:value>\"%s\"</ipxact:value></ipxact:parameter></ipxact:parameters>\n",
            b->name, b->parameter, b->parameter, b->value);
  end(out, 2, "busInterface");
}

static const char *access_of(const gen_register *r)
{
  return r->access == GEN_RO ? "read-only" : r->access == GEN_WO ? "write-only" : "read-write";
}

static void write_field(FILE *out, int level, const gen_register *r, const gen_field *f)
{
  fprintf(out, "%*s<ipxact:field fieldID=\"%s_%s\">\n", 2 * level, "", r->name, f->name);
  leaf(out, level + 1, "name", f->name);
  leaf(out, level + 1, "description", f->meaning);
  number(out, level + 1, "bitOffset", (uint32_t)f->lsb);
  if (r->access != GEN_WO) {
    begin(out, level + 1, "resets");
    begin(out, level + 2, "reset");
    hex(out, level + 3, "value", r->reset >> f->lsb & (uint32_t)((UINT64_C(1) << f->width) - 1));
    end(out, level + 2, "reset");
    end(out, level + 1, "resets");
  }
  number(out, level + 1, "bitWidth", (uint32_t)f->width);
  if (gen_volatile(r)) leaf(out, level + 1, "volatile", "true");
  leaf(out, level + 1, "access", access_of(r));
  if (r->access == GEN_W1C) leaf(out, level + 1, "modifiedWriteValue", "oneToClear");
  if (!gen_testable(r)) leaf(out, level + 1, "testable", "false");
  end(out, level, "field");
}

/* The address register of a memory once more as one number: what reaches the memory is a single field. */
static void write_whole_address(FILE *out, const gen_register *r)
{
  gen_field whole = gen_whole(r), fields[32];
  const int count = gen_all_fields(r, fields);
  whole.width = 0;
  for (int i = 0; i < count; i++)
    if (fields[i].lsb + fields[i].width > whole.width) whole.width = fields[i].lsb + fields[i].width;
  begin(out, 5, "alternateRegisters");
  begin(out, 6, "alternateRegister");
  fprintf(out, "              <ipxact:name>%s_ALL</ipxact:name>\n", r->name);
  fprintf(out, "              <ipxact:alternateGroups><ipxact:alternateGroup>whole</ipxact:alternateGroup>"
               "</ipxact:alternateGroups>\n");
  write_field(out, 7, r, &whole);
  end(out, 6, "alternateRegister");
  end(out, 5, "alternateRegisters");
}

static void write_register(FILE *out, const gen_register *r)
{
  gen_field fields[32];
  const int count = gen_all_fields(r, fields);
  begin(out, 4, "register");
  leaf(out, 5, "name", r->name);
  leaf(out, 5, "description", r->meaning);
  hex(out, 5, "addressOffset", r->offset);
  number(out, 5, "size", 32);
  if (gen_volatile(r)) leaf(out, 5, "volatile", "true");
  leaf(out, 5, "access", access_of(r));
  for (int i = 0; i < count; i++) write_field(out, 5, r, &fields[i]);
  for (int i = 0; i < gen_memory_count; i++)
    if (gen_memories[i].address && !strcmp(gen_memories[i].address, r->name) &&
        strcmp(fields[0].name, gen_whole(r).name)) /* without fields it is one number already */
      write_whole_address(out, r);
  end(out, 4, "register");
}

static void write_memory(FILE *out, const gen_memory *m, uint32_t base, uint32_t range, const char *access)
{
  begin(out, 3, "addressBlock");
  leaf(out, 4, "name", m->name);
  leaf(out, 4, "description", m->meaning);
  hex(out, 4, "baseAddress", base);
  number(out, 4, "range", range);
  number(out, 4, "width", (uint32_t)m->bits);
  leaf(out, 4, "usage", "memory");
  leaf(out, 4, "access", access);
  end(out, 3, "addressBlock");
}

/* The registers up to the first window are one block, each window is another. */
static void write_csr_map(FILE *out)
{
  uint32_t range = 0;
  for (int i = 0; i < gen_register_count; i++)
    if (!gen_window(&gen_registers[i]) && gen_registers[i].offset + 4 > range) range = gen_registers[i].offset + 4;
  begin(out, 2, "memoryMap");
  leaf(out, 3, "name", "csr");
  begin(out, 3, "addressBlock");
  leaf(out, 4, "name", "registers");
  hex(out, 4, "baseAddress", 0);
  number(out, 4, "range", range);
  number(out, 4, "width", 32);
  leaf(out, 4, "usage", "register");
  for (int i = 0; i < gen_register_count; i++)
    if (!gen_window(&gen_registers[i])) write_register(out, &gen_registers[i]);
  end(out, 3, "addressBlock");
  for (int i = 0; i < gen_register_count; i++) {
    const gen_memory *m = gen_window(&gen_registers[i]);
    if (m)
      write_memory(out, m, gen_registers[i].offset, m->words * (uint32_t)m->bits / 8, access_of(&gen_registers[i]));
  }
  number(out, 3, "addressUnitBits", 8);
  end(out, 2, "memoryMap");
}

/* Their address is the number of a word. */
static void write_indirect_maps(FILE *out)
{
  for (int i = 0; i < gen_memory_count; i++) {
    const gen_memory *m = &gen_memories[i];
    if (!m->address) continue;
    begin(out, 2, "memoryMap");
    fprintf(out, "      <ipxact:name>indirect_%s</ipxact:name>\n", m->name);
    write_memory(out, m, 0, m->words, "write-only");
    number(out, 3, "addressUnitBits", (uint32_t)m->bits);
    end(out, 2, "memoryMap");
  }
}

static void write_indirect_interfaces(FILE *out)
{
  begin(out, 1, "indirectInterfaces");
  for (int i = 0; i < gen_memory_count; i++) {
    const gen_memory *m = &gen_memories[i];
    if (!m->address) continue;
    begin(out, 2, "indirectInterface");
    leaf(out, 3, "name", m->name);
    fprintf(out,
            "      <ipxact:indirectAddressRef>%s_VALUE</ipxact:indirectAddressRef>\n"
            "      <ipxact:indirectDataRef>%s_VALUE</ipxact:indirectDataRef>\n"
            "      <ipxact:memoryMapRef>indirect_%s</ipxact:memoryMapRef>\n",
            m->address, m->data, m->name);
    number(out, 3, "bitsInLau", (uint32_t)m->bits);
    end(out, 2, "indirectInterface");
  }
  end(out, 1, "indirectInterfaces");
}

static void write_port(FILE *out, const port *p)
{
  begin(out, 3, "port");
  leaf(out, 4, "name", p->name);
  begin(out, 4, "wire");
  leaf(out, 5, "direction", p->direction);
  if (p->width > 1)
    fprintf(out,
            "          <ipxact:vectors><ipxact:vector><ipxact:left>%d</ipxact:left><ipxact:right>0</ipxact:right>"
            "</ipxact:vector></ipxact:vectors>\n",
            p->width - 1);
  end(out, 4, "wire");
  end(out, 3, "port");
}

static void write_model(FILE *out)
{
  fprintf(out, "  <ipxact:model>\n    <ipxact:views>\n      <ipxact:view>\n        <ipxact:name>rtl</ipxact:name>\n"
               "        <ipxact:componentInstantiationRef>sf_top</ipxact:componentInstantiationRef>\n"
               "      </ipxact:view>\n    </ipxact:views>\n    <ipxact:instantiations>\n"
               "      <ipxact:componentInstantiation>\n        <ipxact:name>sf_top</ipxact:name>\n"
               "        <ipxact:language>SystemVerilog</ipxact:language>\n"
               "        <ipxact:moduleName>sf_top</ipxact:moduleName>\n"
               "        <ipxact:moduleParameters>\n          <ipxact:moduleParameter parameterId=\"sf_top_TAP\">\n"
               "            <ipxact:name>TAP</ipxact:name>\n"
               "            <ipxact:description>1: tap ports for observation; 0 removes them</ipxact:description>\n"
               "            <ipxact:value>1</ipxact:value>\n          </ipxact:moduleParameter>\n"
               "        </ipxact:moduleParameters>\n        <ipxact:fileSetRef>\n"
               "          <ipxact:localName>rtl</ipxact:localName>\n        </ipxact:fileSetRef>\n"
               "      </ipxact:componentInstantiation>\n    </ipxact:instantiations>\n    <ipxact:ports>\n");
  for (int i = 0; i < PORTS; i++) write_port(out, &ports[i]);
  fprintf(out, "    </ipxact:ports>\n  </ipxact:model>\n");
}

/* The component lies in rtl/gen/: its files are named from there. */
static void write_file(FILE *out, const char *path)
{
  const char *suffix = strrchr(path, '.');
  const bool include = suffix && !strcmp(suffix, ".svh");
  if (suffix && !strcmp(suffix, ".vlt")) return;
  begin(out, 3, "file");
  if (!strncmp(path, "rtl/gen/", 8))
    leaf(out, 4, "name", path + 8);
  else
    fprintf(out, "        <ipxact:name>../%s</ipxact:name>\n", !strncmp(path, "rtl/", 4) ? path + 4 : path);
  leaf(out, 4, "fileType", "systemVerilogSource");
  if (include) leaf(out, 4, "isIncludeFile", "true");
  end(out, 3, "file");
}

void gen_write_ipxact(FILE *out, const gen_sources *sources)
{
  fprintf(out, "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
               "<!-- Generated by tools/sf_gen.c from include/spikefield/csr.def: do not edit. -->\n"
               "<ipxact:component xmlns:ipxact=\"http://www.accellera.org/XMLSchema/IPXACT/1685-2014\"\n"
               "                  xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\"\n"
               "                  xsi:schemaLocation=\"http://www.accellera.org/XMLSchema/IPXACT/1685-2014 "
               "http://www.accellera.org/XMLSchema/IPXACT/1685-2014/index.xsd\">\n"
               "  <ipxact:vendor>spikefield</ipxact:vendor>\n  <ipxact:library>accelerator</ipxact:library>\n"
               "  <ipxact:name>sf_top</ipxact:name>\n  <ipxact:version>1.0</ipxact:version>\n");
  begin(out, 1, "busInterfaces");
  for (int i = 0; i < BUSES; i++) write_bus(out, &buses[i]);
  end(out, 1, "busInterfaces");
  write_indirect_interfaces(out);
  begin(out, 1, "memoryMaps");
  write_csr_map(out);
  write_indirect_maps(out);
  end(out, 1, "memoryMaps");
  write_model(out);
  begin(out, 1, "fileSets");
  begin(out, 2, "fileSet");
  leaf(out, 3, "name", "rtl");
  for (int i = 0; i < sources->count; i++) write_file(out, sources->path[i]);
  end(out, 2, "fileSet");
  end(out, 1, "fileSets");
  leaf(out, 1, "description", "Spiking radiance field accelerator: samples of a ray in, density and colour out.");
  fprintf(out, "</ipxact:component>\n");
}
