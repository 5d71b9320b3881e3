/* Waveform files that were cut short, by a full disk or otherwise, are named with their cause; whole ones pass. */
#include "ck_run.h"
#include "folder_fixture.h"
#include "sim/dut.h"
#include "sim/pins.h"
#include "sim/wave_file.h"
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>

/* Some cycles of reset, as Verilator writes them. Returns the bytes. */
static long write_wave(const char *path)
{
  struct stat info;
  sf_pins_in in = {0};
  sf_pins_out out;
  sf_pins *pins = sf_pins_open(1, path, NULL);
  ck_assert_ptr_nonnull(pins);
  sf_pins_dump(pins);
  for (int i = 0; i < 20; i++) sf_pins_cycle(pins, &in, &out);
  sf_pins_close(pins);
  ck_assert_int_eq(stat(path, &info), 0);
  return (long)info.st_size;
}

TEST(a_whole_file_passes_and_stays_as_it_is)
{
  struct stat info;
  const char *path = in("a.fst");
  const long size = write_wave(path);
  ck_assert_int_gt(size, 1000);
  ck_ok(sf_wave_file_check(path));
  ck_assert_int_eq(stat(path, &info), 0);
  ck_assert_int_eq(info.st_size, size);
}

TEST(a_file_that_is_cut_short_is_named)
{
  const char *path = in("a.fst");
  const long size = write_wave(path);
  const long cuts[] = {0, 5, 9, 300, size / 2, size - 1};
  for (int i = 0; i < COUNT(cuts); i++) {
    write_wave(path);
    ck_assert_int_eq(truncate(path, cuts[i]), 0);
    ck_bad(sf_wave_file_check(path), SF_E_IO, path, "cut short");
  }
  ck_bad(sf_wave_file_check(in("absent.fst")), SF_E_IO, "absent.fst", "No such file");
}

/* Its length is written last: a section that was never finished has none. */
TEST(a_section_without_a_length_is_named)
{
  static const char none[8];
  const char *path = in("a.fst");
  write_wave(path);
  FILE *file = fopen(path, "r+b");
  ck_assert_ptr_nonnull(file);
  ck_assert_int_eq(fseek(file, 1, SEEK_SET), 0);
  ck_assert_uint_eq(fwrite(none, 1, sizeof none, file), sizeof none);
  ck_assert_int_eq(fclose(file), 0);
  ck_bad(sf_wave_file_check(path), SF_E_IO, path, "cut short");
}

/* The section at a place: where the next one begins. */
static long behind_section(const char *path, long at)
{
  unsigned char head[9];
  uint64_t length = 0;
  FILE *file = fopen(path, "rb");
  ck_assert_ptr_nonnull(file);
  ck_assert_int_eq(fseek(file, at, SEEK_SET), 0);
  ck_assert_uint_eq(fread(head, 1, sizeof head, file), sizeof head);
  ck_assert_int_eq(fclose(file), 0);
  for (int i = 1; i < COUNT(head); i++) length = length << 8 | head[i];
  return at + 1 + (long)length;
}

/* Without widths and names of the nets, which stand at the end, nothing can be read back. */
TEST(a_file_that_ends_behind_a_section_is_named)
{
  const char *path = in("a.fst");
  const long size = write_wave(path);
  int cuts = 0;
  for (long end = behind_section(path, 0); end < size; end = behind_section(path, end), cuts++) {
    ck_assert_int_eq(truncate(path, end), 0);
    ck_bad(sf_wave_file_check(path), SF_E_IO, path, "cut short");
    write_wave(path);
  }
  ck_assert_int_ge(cuts, 3); /* behind header, values, widths */
}

/* No room, here for larger files: the system's words. */
TEST(the_cause_is_the_systems)
{
  const char *path = in("a.fst");
  const long size = write_wave(path);
  const struct rlimit room = {(rlim_t)size, (rlim_t)size};
  ck_assert_int_eq(truncate(path, size - 100), 0);
  signal(SIGXFSZ, SIG_IGN);
  ck_assert_int_eq(setrlimit(RLIMIT_FSIZE, &room), 0);
  ck_bad(sf_wave_file_check(path), SF_E_IO, path, "File too large");
}

ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};
