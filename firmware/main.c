/* Bare-metal program for RV32IM: programs the accelerator from a net in memory, pushes samples through it by a
 * memory-mapped stream window, prints results and the audit's counters over a UART register.
 * The addresses are those of the reference system-on-chip; link.ld places the memory. */
#include "firmware/sf_blob.h"

enum { ACCELERATOR = 0x40000000, STREAM = 0x40010000, UART = 0x40020000 };
/* Stream window, 32-bit registers: writes of LOW, HIGH prepare a beat, CONTROL sends it (bit 0 tuser, bit 1 tlast);
 * STATUS bit 0: ready for a beat, bit 1: a result beat waits in RESULT_LOW, RESULT_HIGH; reading HIGH takes it. */
enum { LOW = 0x0, HIGH = 0x4, CONTROL = 0x8, STATUS = 0xc, RESULT_LOW = 0x10, RESULT_HIGH = 0x14 };
enum { CAN_SEND = 1, HAS_RESULT = 2, FIRST = 1, LAST = 2, PACKET_BEATS_MAX = (SF_DIR_MAX + SF_FEATURE_MAX) / 4 };

/* Placed by the loader: the net, then packets: word 0 beats (0 ends the list), word 1 tuser, then 2 words per beat. */
extern const uint8_t sf_net_image[];
extern const uint32_t sf_net_image_size;
extern const uint32_t sf_packets[];

static uint32_t mmio_read(void *context, uint32_t offset)
{
  return *(volatile uint32_t *)((uintptr_t)context + offset);
}

static void mmio_write(void *context, uint32_t offset, uint32_t value)
{
  *(volatile uint32_t *)((uintptr_t)context + offset) = value;
}

static const sf_bus accelerator = {mmio_read, mmio_write, (void *)ACCELERATOR};
static const sf_bus stream = {mmio_read, mmio_write, (void *)STREAM};

static uint32_t get(const sf_bus *bus, uint32_t offset)
{
  return bus->read(bus->context, offset);
}
static void put(const sf_bus *bus, uint32_t offset, uint32_t value)
{
  bus->write(bus->context, offset, value);
}

static void print(const char *text)
{
  while (*text) mmio_write((void *)UART, 0, (uint32_t)*text++);
}

static void print_hex(const char *label, uint64_t value)
{
  print(label);
  for (int shift = 60; shift >= 0; shift -= 4)
    mmio_write((void *)UART, 0, (uint32_t) "0123456789abcdef"[value >> shift & 15]);
  print("\n");
}

static void send(const uint32_t *packet)
{
  const uint32_t beats = packet[0] < PACKET_BEATS_MAX ? packet[0] : PACKET_BEATS_MAX;
  for (uint32_t i = 0; i < beats; i++) {
    while (!(get(&stream, STATUS) & CAN_SEND)) continue;
    put(&stream, LOW, packet[2 + 2 * i]);
    put(&stream, HIGH, packet[3 + 2 * i]);
    put(&stream, CONTROL, (i == 0 && packet[1] ? FIRST : 0) | (i == beats - 1 ? LAST : 0));
  }
}

static uint64_t receive_beat(void)
{
  while (!(get(&stream, STATUS) & HAS_RESULT)) continue;
  const uint32_t low = get(&stream, RESULT_LOW);
  return (uint64_t)get(&stream, RESULT_HIGH) << 32 | low;
}

static void run_samples(void)
{
  for (const uint32_t *packet = sf_packets; packet[0]; packet += 2 + 2 * packet[0]) {
    send(packet);
    print_hex("colour0.density ", receive_beat());
    print_hex("colour2.colour1 ", receive_beat());
  }
}

static uint64_t total(const sf_driver_counters *counters, int event)
{
  uint64_t sum = 0;
  for (int l = 0; l < SF_LAYERS; l++)
    for (int t = 0; t < SF_T_MAX; t++) sum += counters->event[event][l][t];
  return sum;
}

static void print_audit(const sf_driver_counters *counters)
{
  static const char *const name[SF_DRIVER_EVENTS] = {"mac     ", "sop     ", "spikes  ", "updates ",
                                                     "weight  ", "state_r ", "state_w ", "special "};
  for (int e = 0; e < SF_DRIVER_EVENTS; e++) print_hex(name[e], total(counters, e));
  print_hex("samples ", counters->samples);
  print_hex("cycles  ", counters->cycles);
}

int main(void)
{
  static sf_driver_counters counters;
  sf_net_blob net;
  if (sf_blob_open(sf_net_image, sf_net_image_size, &net)) {
    print("no net in memory\n");
    return 1;
  }
  sf_driver_code code = sf_driver_probe(&accelerator);
  if (code == SF_DRIVER_OK) code = sf_driver_load(&accelerator, &net);
  if (code == SF_DRIVER_OK) code = sf_driver_clear(&accelerator);
  if (code == SF_DRIVER_OK) {
    run_samples();
    code = sf_driver_read_counters(&accelerator, &counters);
  }
  if (code == SF_DRIVER_OK)
    print_audit(&counters);
  else
    print(sf_driver_text(code)), print("\n");
  return code != SF_DRIVER_OK;
}
