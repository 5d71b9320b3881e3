/* The emulated system: programs by hand that misbehave, the firmware against the core, and the firmware with an
 * accelerator, a bus or an image that is not as it should be. */
#include "tests/soc_fixture.h"

/* ---- programs by hand ---- */

enum { T0 = 5, T1 = 6, LOAD = 0x03, STORE = 0x23, WORD = 2, BYTE = 0 };

static uint32_t lui(int rd, uint32_t value)
{
  return (value & 0xfffff000) | (uint32_t)rd << 7 | 0x37;
}
static uint32_t addi(int rd, int rs, int value)
{
  return (uint32_t)value << 20 | (uint32_t)rs << 15 | (uint32_t)rd << 7 | 0x13;
}
static uint32_t load(int rd, int rs, int offset)
{
  return (uint32_t)offset << 20 | (uint32_t)rs << 15 | WORD << 12 | (uint32_t)rd << 7 | LOAD;
}
static uint32_t store(int width, int rs2, int rs1, int offset)
{
  return (uint32_t)(offset >> 5) << 25 | (uint32_t)rs2 << 20 | (uint32_t)rs1 << 15 | (uint32_t)width << 12 |
         (uint32_t)(offset & 31) << 7 | STORE;
}
enum {
  JUMP_HERE = 0x6f,
  JUMP_BACK = (int)0xffdff06f,
  JUMP_T0 = 0x28067,
  ECALL = 0x73,
  EBREAK = 0x100073,
  WFI = 0x10500073
};

static bool stop_at_once(void *user, uint64_t done)
{
  (void)user, (void)done;
  return false;
}

static sf_status run_words(const uint32_t *word, int n, bool stopped, uint32_t *exit_status)
{
  sf_dut *dut;
  sf_soc *soc;
  const sf_soc_options options = {.instructions = 4000000, .uart = keep_output, .tick = stopped ? stop_at_once : NULL};
  ck_ok(sf_soc_open_dut(&dut, false, &(sf_dut_options){.seed = 3}));
  ck_ok(sf_soc_open(&soc, dut, &options));
  memcpy(sf_soc_memory(soc, SF_SOC_RAM, (uint64_t)n * 4), word, (size_t)n * 4);
  sf_soc_begin_at(soc, SF_SOC_RAM);
  const sf_status status = sf_soc_explain(soc, sf_soc_run(soc, exit_status));
  sf_soc_close(soc);
  sf_dut_close(dut);
  return status;
}

LOOP_TEST(bad_programs_end_with_a_reason, 17)
{
  const struct {
    uint32_t word[4];
    const char *reason;
  } bad[] = {
      {{JUMP_HERE}, "no end after 400"},
      {{0xa001a001}, "no end after 400"}, /* compressed jumps here, of two bytes */
      {{addi(T0, T0, 1), 0xffffffff}, "trap: illegal instruction (cause 2), in the block of code at 0x80000000"},
      {{ECALL}, "environment call"},
      {{EBREAK}, "Invalid instruction"},
      {{WFI}, "sleeps for ever"},
      {{load(T1, 0, 16)}, "load of 4 bytes at 0x00000010, where there is nothing"},
      {{lui(T0, 0x90000000), store(WORD, T1, T0, 8)}, "store of 4 bytes at 0x90000008"},
      {{lui(T0, 0x20000000), JUMP_T0}, "fetch"},
      {{lui(T0, SF_SOC_IMAGE), JUMP_T0}, "fetch"},
      {{lui(T0, SF_SOC_ACCELERATOR), store(BYTE, T1, T0, 12)}, "accelerator: access of 1 bytes at offset 0xc"},
      {{lui(T0, SF_SOC_ACCELERATOR), store(WORD, T1, T0, SF_CSR_RAY_CTRL), store(WORD, T1, T0, SF_CSR_ID), ECALL},
       "in the block of code at 0x80000000; first bad access: register 400 refused (SLVERR or DECERR) at cycle "},
      {{lui(T0, SF_SOC_STREAM), load(T1, T0, SF_STREAM_RESULT_HIGH)}, "a result was taken that is not there"},
      {{lui(T0, SF_SOC_STREAM), load(T1, T0, 0x40)}, "offset 0x40: read of a register that is not there"},
      {{lui(T0, SF_SOC_STREAM), store(WORD, T1, T0, 0x40)}, "offset 0x40: write to a register that is not there"},
      {{lui(T0, SF_SOC_STREAM), store(WORD, T1, T0, SF_STREAM_CONTROL), JUMP_BACK}, "sent into a full FIFO"},
      {{lui(T0, SF_SOC_UART), store(WORD, T0, T0, 0), JUMP_BACK}, "endless output"},
  };
  ck_assert_int_eq(COUNT(bad), 17);
  uint32_t exit_status;
  ck_bad(run_words(bad[_i].word, 4, false, &exit_status), SF_E_UNSUPPORTED, bad[_i].reason, "");
}

TEST(a_program_ends_with_its_status)
{
  const uint32_t word[] = {lui(T0, SF_SOC_POWER), addi(T1, 0, 7), store(WORD, T1, T0, 0), JUMP_HERE};
  const uint32_t endless[] = {JUMP_HERE};
  uint32_t exit_status = 0;
  ck_ok(run_words(word, 4, false, &exit_status));
  ck_assert_uint_eq(exit_status, 7);
  ck_assert_int_eq(run_words(endless, 1, true, &exit_status).code, SF_E_STOPPED);
}

/* ---- the firmware, of fixture_ingp if a test asks for no other ---- */

static scenario *make_scenario(const fixture_sizes *sizes)
{
  fx_scene scene = fixture_scene(sizes, 5);
  memset(scene.occupancy, 0xf7, 64);
  return make_scenario_of(scene);
}

static void set_up(void)
{
  s = make_scenario(&fixture_ingp);
}

static void tear_down(void)
{
  free_scenario(s);
}

LOOP_TEST(the_firmware_renders_what_the_core_renders, 3)
{
  same_as_core(make_scenario(&fixture_ingp), 30 * _i);
}

LOOP_TEST(so_it_does_for_other_nets, 3)
{
  static const fixture_sizes sizes[] = {{5, 77, 16, 3, 33, 128, 1, FX_DECAY, {0}},
                                        {1, 1, 2, 0, 5, 1, 8, FX_NODECAY, {0}},
                                        {3, 128, 1, 16, 128, 40, 3, FX_HYBRID, {0}}};
  same_as_core(make_scenario(&sizes[_i]), 20);
}

/* Three cascades and growing steps. */
TEST(and_in_a_large_box)
{
  static const fixture_sizes sizes = {5, 77, 16, 3, 33, 128, 2, FX_HYBRID, {0}};
  fx_scene scene = fixture_box(&sizes, 6, 2, 150000);
  memset(scene.occupancy, 0xf7, 3 * 64);
  same_as_core(make_scenario_of(scene), 20);
}

/* Each ends with exit status 1 and the line, or is seen by the comparison. */
static const struct {
  bus_fault fault;
  uint32_t offset, to;
  const char *line;
} wrong_device[] = {
    {READ_AS, SF_CSR_ID, 0, "error: probe: no accelerator at this address\n"},
    {READ_AS, SF_CSR_VERSION, 9 << 16, "error: probe: interface version differs from the driver's\n"},
    {READ_AS, SF_CSR_CONFIG, 0x08410780, "error: probe: built with other sizes than the driver\n"},
    {READ_AS, SF_CSR_STATUS, SF_CSR_STATUS_COUNTERS, "error: clear counters: no answer\n"},
    {REPLACE, SF_CSR_STEPS, 9, "error: load: programming refused: STEPS: "},
    {REPLACE, SF_CSR_WEIGHT_DATA, 0x80, "error: load: programming refused: WEIGHT: "},
    {REDIRECT, SF_CSR_MODE, SF_CSR_STATUS, "error: load: programming refused: ADDRESS: "},
    {LOSE, SF_CSR_CTRL, 0, "error: render: no answer\n"},
    {REPLACE, SF_CSR_D1_N_IN, 4, "error: render: no answer: PACKET: "},
};

LOOP_TEST(a_wrong_device_is_reported, COUNT(wrong_device))
{
  expect_line(wrong_device[_i].fault, wrong_device[_i].offset, wrong_device[_i].to, wrong_device[_i].line);
}

static const struct {
  bus_fault fault;
  uint32_t offset, to;
} wrong_write[] = {{REDIRECT, SF_CSR_D1_K, SF_CSR_D2_K},
                   {REPLACE, SF_CSR_D1_THETA, 30000},
                   {REPLACE, SF_CSR_STEPS, 3},
                   {LOSE_ONE, SF_CSR_WEIGHT_DATA, 100},
                   {LOSE, SF_CSR_EXP_BIAS, 0}};

LOOP_TEST(a_driver_that_writes_wrongly_is_seen, COUNT(wrong_write))
{
  expect_difference(wrong_write[_i].fault, wrong_write[_i].offset, wrong_write[_i].to);
}

TEST(a_bus_without_an_answer_ends_the_run)
{
  fault = DEAF, s->offset = SF_CSR_CONFIG;
  ck_bad(run_firmware(), SF_E_UNSUPPORTED, "read of register 0x008 not answered", "");
}

/* ---- images ---- */

TEST(a_damaged_image_is_refused)
{
  s->image[s->image_size - 1] ^= 1;
  ck_ok(run_firmware());
  ck_assert_uint_eq(exit_status, 1);
  ck_assert_str_eq(output, "spikefield firmware\nerror: image: damaged: wrong checksum\n");
}

/* Every word of the header takes extreme values, with a right checksum: the parts stay inside or the image is refused.
 * The block ends where memory ends, so that the sanitizer sees every step beyond. */
TEST(an_image_stays_inside_its_memory)
{
  static const uint32_t extreme[] = {0, 1, 7, 8, 255, 256, 257, 0x7fffffff, 0x80000000, 0xfffffff8, 0xffffffff};
  const size_t space = sf_tile_pixels_at((uint32_t)s->image_size) + sizeof s->core;
  uint8_t *block = malloc(space);
  ck_assert_ptr_null(open_edited(s, block, space, -1, 0));
  ck_assert_str_eq(open_edited(s, block, space - 1, -1, 0), "the tile does not fit");
  ck_assert_str_eq(open_edited(s, block, space, 0, 1), "none in memory");
  ck_assert_str_eq(open_edited(s, block, space, 1, SF_TILE_VERSION + 1), "of another version than this firmware's");
  for (int word = 4; word < 18; word++) /* width .. lines */
    for (size_t i = 0; i < sizeof extreme / sizeof *extreme; i++) {
      uint32_t now;
      memcpy(&now, s->image + 4 * word, 4);
      if (extreme[i] == now || (word == 7 && extreme[i] > now && extreme[i] < s->image_size)) continue;
      /* A smaller tile is one, too, and the image is long enough for another cascade. */
      const bool less = (word <= 5 || word == 14) && extreme[i] == 1;
      const char *why = open_edited(s, block, space, word, extreme[i]);
      ck_assert_msg((why == NULL) == less, "word %d = %u: %s", word, extreme[i], why ? why : "taken");
    }
  free(block);
}

TEST(checksums_are_zlibs)
{
  ck_assert_uint_eq(sf_crc32(0, "123456789", 9), 0xcbf43926);
  ck_assert_uint_eq(sf_crc32(sf_crc32(0, "1234", 4), "56789", 5), 0xcbf43926);
}

TEST(a_tile_that_is_too_large_is_refused)
{
  uint8_t *image = NULL;
  size_t size;
  ck_assert_int_eq(sf_soc_image_make(&s->scene, s->ray, 4096, 4096, &image, &size).code, SF_E_RANGE);
  ck_assert_ptr_null(image);
}

/* ---- comparison ---- */

static void expect_audit(const scenario *s, const char *text, const char *reason)
{
  ck_bad(sf_soc_compare_audit(&s->counts, s->field, s->core, PIXELS, text), SF_E_DIFFERENCE, reason, "");
}

TEST(the_comparison_sees_every_change)
{
  char text[OUTPUT_MAX];
  ck_ok(run_firmware());
  for (char *at = strstr(output, "audit "); at; at = strstr(at + 1, "audit "))
    for (char *c = at; *c != '\n'; c++) {
      const char was = *c;
      *c = was == '1' ? '2' : '1';
      ck_assert_int_eq(sf_soc_compare_audit(&s->counts, s->field, s->core, PIXELS, output).code, SF_E_DIFFERENCE);
      *c = was;
    }
  ck_ok(sf_soc_compare_audit(&s->counts, s->field, s->core, PIXELS, output));
  expect_audit(s, "", "firmware \"nothing\"");
  snprintf(text, sizeof text, "%.16000saudit more\n", output);
  expect_audit(s, text, "one line too many: \"audit more\"");
  for (size_t i = 0; i < sizeof s->core[0].colour + 20; i += 4) {
    uint8_t *byte = (uint8_t *)&s->firmware[4] + i;
    *byte ^= 1;
    ck_bad(sf_soc_compare_pixels(s->core, s->firmware, PIXELS, WIDTH), SF_E_DIFFERENCE, "pixel 1,1 of the tile", "");
    *byte ^= 1;
  }
  ck_ok(sf_soc_compare_pixels(s->core, s->firmware, PIXELS, WIDTH));
}

/* ---- programs from files ---- */

TEST(a_bad_program_file_is_refused)
{
  char folder[] = "/tmp/sf_test_soc.XXXXXX", path[64], firmware[4096], whole[1 << 16];
  ck_assert_ptr_nonnull(mkdtemp(folder));
  snprintf(path, sizeof path, "%s/a.elf", folder);
  firmware_path(firmware);
  FILE *in = fopen(firmware, "rb");
  ck_assert_ptr_nonnull(in);
  const size_t size = fread(whole, 1, sizeof whole, in);
  fclose(in);
  const struct {
    size_t keep;
    int at;
    char value;
    const char *reason;
  } bad[] = {{0, 0, 0x7f, "not an ELF file"},
             {40, 0, 0x7f, "not an ELF file"},
             {size, 4, 2, "not a 32-bit RISC-V"},
             {size, 18, 3, "not a 32-bit RISC-V"},
             {size, 36, 1, "built with compressed instructions: the system is RV32IM"},
             {size, 36, 4, "built for floating-point registers: the system is RV32IM"},
             {size, 31, 0x7f, "segments is cut short"},
             {60, 0, 0x7f, "segments is cut short"},
             {5000, 0, 0x7f, "is cut short"}};
  OWNED(sf_dut) *dut = NULL;
  sf_soc *soc;
  ck_ok(sf_soc_open_dut(&dut, false, &(sf_dut_options){.seed = 3}));
  ck_ok(sf_soc_open(&soc, dut, &(sf_soc_options){0}));
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
    const char was = whole[bad[i].at];
    whole[bad[i].at] = bad[i].value;
    FILE *out = fopen(path, "wb");
    ck_assert_uint_eq(fwrite(whole, 1, bad[i].keep, out), bad[i].keep);
    fclose(out);
    whole[bad[i].at] = was;
    const sf_status status = sf_soc_load_elf(soc, path);
    ck_assert_msg(status.code != SF_OK && strstr(status.message, bad[i].reason) && strstr(status.message, path),
                  "file %zu: '%s' is not in '%s'", i, bad[i].reason, status.message);
  }
  ck_assert_int_eq(sf_soc_load_elf(soc, "/nowhere/a.elf").code, SF_E_IO);
  sf_soc_close(soc);
  unlink(path);
  rmdir(folder);
}

ck_options ck_program = {.set_up = set_up, .tear_down = tear_down};
