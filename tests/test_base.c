/* Status, files, JSON, random numbers, hashes. */
#include "ck_run.h"
#include "base/io.h"
#include "base/sha256.h"
#include "folder_fixture.h"
#include "base/rng.h"
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>

/* ---- status ---- */

TEST(status_is_one_line_and_fits)
{
  ck_ok(sf_ok());
  ck_assert_str_eq(sf_ok().message, "");
  sf_status s = sf_fail(SF_E_IO, "a\nb\tc\x1b %d", 7);
  ck_assert_str_eq(s.message, "a b c  7");
  ck_assert_int_eq(s.code, SF_E_IO);
  char big[2000];
  memset(big, 'x', sizeof big);
  big[sizeof big - 1] = 0;
  s = sf_fail(SF_E_RANGE, "%s", big);
  ck_assert_uint_eq(strlen(s.message), sizeof s.message - 1);
  ck_assert_str_eq(s.message + sizeof s.message - 4, "...");
}

static sf_status fails_first(int *reached)
{
  SF_TRY(sf_ok());
  SF_TRY(sf_fail(SF_E_RANGE, "first"));
  *reached = 1;
  return sf_ok();
}

TEST(try_returns_the_failure)
{
  int reached = 0;
  ck_bad(fails_first(&reached), SF_E_RANGE, "first", "");
  ck_assert_int_eq(reached, 0);
}

/* ---- files ---- */

TEST(file_round_trip)
{
  char *data;
  size_t n;
  const char bytes[] = {1, 0, 2, '\n', (char)255};
  ck_ok(sf_write_file(in("a"), bytes, sizeof bytes));
  ck_ok(sf_read_file(in("a"), 5, &data, &n));
  ck_assert_uint_eq(n, sizeof bytes);
  ck_assert_mem_eq(data, bytes, n);
  ck_assert_int_eq(data[n], 0);
  free(data);
  ck_bad(sf_read_file(in("a"), 4, &data, &n), SF_E_FORMAT, "/a", "limit");
  ck_ok(sf_write_file(in("a"), NULL, 0));
  ck_ok(sf_read_file(in("a"), 0, &data, &n));
  ck_assert_uint_eq(n, 0);
  free(data);
  ck_assert_int_eq(entries(), 1);
}

TEST(unreadable_files)
{
  char *data;
  size_t n;
  ck_bad(sf_read_file(in("none"), 100, &data, &n), SF_E_IO, "none", "No such file");
  ck_bad(sf_read_file(folder, 100, &data, &n), SF_E_IO, folder, "folder");
  ck_bad(sf_read_file("/dev/zero", 100000, &data, &n), SF_E_IO, "/dev/zero", "it is a device");
  ck_assert_int_eq(symlink("/dev/null", in("link")), 0);
  ck_bad(sf_read_file(in("link"), 100, &data, &n), SF_E_IO, "/link", "it is a device");
}

/* A program that writes as many zeros as are taken, at most `total`; path: its pipe, as a shell's <(...) hands it over.
 */
static pid_t zeros(size_t total, int *end, char path[32])
{
  static const char block[1 << 16];
  int ends[2];
  ck_assert_int_eq(pipe(ends), 0);
  const pid_t writer = fork();
  ck_assert_int_ge(writer, 0);
  if (!writer) {
    close(ends[0]);
    for (ssize_t n = 1; total && n > 0; total -= (size_t)n)
      n = write(ends[1], block, total < sizeof block ? total : sizeof block);
    _exit(0);
  }
  close(ends[1]);
  *end = ends[0];
  snprintf(path, 32, "/dev/fd/%d", ends[0]);
  return writer;
}

static sf_status read_zeros(size_t total, size_t limit, size_t *size)
{
  char path[32], *data;
  int end;
  const pid_t writer = zeros(total, &end, path);
  const sf_status status = sf_read_file(path, limit, &data, size);
  free(data);
  close(end);
  ck_assert_int_eq(waitpid(writer, NULL, 0), writer);
  return status;
}

TEST(pipes_are_read_up_to_a_limit)
{
  const size_t sizes[] = {0, 1, 4096, 4097, 8194, 99999, 100000};
  size_t n;
  for (int i = 0; i < 7; i++) {
    ck_ok(read_zeros(sizes[i], 100000, &n));
    ck_assert_uint_eq(n, sizes[i]);
  }
  ck_bad(read_zeros(100001, 100000, &n), SF_E_FORMAT, "/dev/fd/", "limit of 100000 bytes");
  ck_bad(read_zeros(SIZE_MAX, (size_t)1 << 34, &n), SF_E_FORMAT, "/dev/fd/", "limit of 268435456 bytes");
}

TEST(unwritable_targets_are_left_alone)
{
  ck_bad(sf_write_file(in("none/x"), "1", 1), SF_E_IO, "none/x", "No such file");
  ck_ok(sf_write_file(in("plain"), "1", 1));
  ck_bad(sf_write_file(in("plain/x"), "1", 1), SF_E_IO, "plain/x", "Not a directory");
  ck_bad(sf_write_file(folder, "1", 1), SF_E_IO, folder, "folder");
  ck_bad(sf_write_file("/dev/full", "1", 1), SF_E_IO, "/dev/full", "regular");
  ck_bad(sf_write_file("", "1", 1), SF_E_IO, "empty name", "");
  ck_assert_int_eq(entries(), 1);
}

/* A limit on the size of files behaves as a full disk: writes fail part of the way. */
static void limit_file_size(rlim_t bytes)
{
  struct rlimit limit = {bytes, bytes};
  signal(SIGXFSZ, SIG_IGN);
  ck_assert_int_eq(setrlimit(RLIMIT_FSIZE, &limit), 0);
}

TEST(full_disk_keeps_the_old_file)
{
  char *big = calloc(1, 100000);
  ck_ok(sf_write_file(in("a"), "old", 3));
  limit_file_size(50000);
  ck_bad(sf_write_file(in("a"), big, 100000), SF_E_IO, "/a", "large");
  ck_text(in("a"), "old");
  sf_tensor t = {.name = "w", .type = SF_U8, .dims = 1, .shape = {100000}, .data = big};
  ck_bad(sf_tensors_save(&t, 1, NULL, in("t")), SF_E_IO, "/t", "large");
  ck_assert_int_eq(entries(), 1);
  free(big);
}

/* A program that is killed while it saves leaves one file, which the next save of the same target takes; programs that
 * save at once do not write into each other's. */
TEST(what_a_killed_save_left_is_taken)
{
  for (int i = 0; i < 3; i++) {
    const pid_t child = fork();
    ck_assert_int_ge(child, 0);
    if (!child) {
      sf_writer w;
      if (sf_writer_open(&w, in("a")).code) _exit(1);
      for (int n = 0; n < 5000; n++) fputs("half", w.file);
      fflush(w.file);
      raise(SIGKILL);
    }
    int end;
    ck_assert_int_eq(waitpid(child, &end, 0), child);
    ck_assert(WIFSIGNALED(end));
    ck_assert_int_eq(entries(), 1);
  }
  sf_writer first, second;
  ck_ok(sf_writer_open(&first, in("a")));
  ck_ok(sf_writer_open(&second, in("a")));
  ck_assert_str_ne(first.aside, second.aside);
  fputs("1", first.file), fputs("2", second.file);
  ck_ok(sf_writer_commit(&second));
  ck_ok(sf_writer_commit(&first));
  ck_assert_int_eq(entries(), 1);
  ck_text(in("a"), "1");
}

/* Trying an output makes its file for a moment; a program that is ended meanwhile leaves none. */
TEST(a_signal_waits_while_an_output_is_tried)
{
  signal(SIGUSR1, SIG_DFL);
  for (int i = 0; i < 40; i++) {
    const pid_t child = fork();
    ck_assert_int_ge(child, 0);
    while (!child)
      if (sf_writable(in("a")).code) _exit(1);
    int status;
    usleep(1000 + 97 * (useconds_t)i);
    ck_assert_int_eq(kill(child, SIGUSR1), 0);
    ck_assert_int_eq(waitpid(child, &status, 0), child);
    ck_assert(WIFSIGNALED(status));
    ck_assert_int_eq(entries(), 0);
  }
}

TEST(writer_abort_and_links)
{
  sf_writer w;
  ck_ok(sf_writer_open(&w, in("a")));
  fputs("half", w.file);
  ck_assert_int_eq(entries(), 1);
  sf_writer_abort(&w);
  sf_writer_abort(&w);
  ck_assert_int_eq(entries(), 0);
  ck_bad(sf_writer_commit(&w), SF_E_IO, "/a", "open");

  ck_ok(sf_write_file(in("a"), "1", 1));
  ck_assert_int_eq(symlink("a", in("link")), 0);
  ck_ok(sf_write_file(in("link"), "22", 2));
  struct stat info;
  ck_assert_int_eq(lstat(in("link"), &info), 0);
  ck_assert(S_ISLNK(info.st_mode));
  ck_assert_int_eq(stat(in("a"), &info), 0);
  ck_assert_int_eq(info.st_size, 2);
  umask(022);
  ck_ok(sf_write_file(in("b"), "1", 1));
  ck_assert_int_eq(stat(in("b"), &info), 0);
  ck_assert_int_eq(info.st_mode & 0777, 0644);
}

TEST(folders_with_parents)
{
  struct stat info;
  ck_ok(sf_make_dir(in("x/y//z/")));
  ck_assert(!stat(in("x/y/z"), &info) && S_ISDIR(info.st_mode));
  ck_ok(sf_make_dir(in("x/y")));
  ck_ok(sf_write_file(in("file"), "", 0));
  ck_bad(sf_make_dir(in("file")), SF_E_IO, "/file", "Not a directory");
  ck_bad(sf_make_dir(in("file/below")), SF_E_IO, "/file", "Not a directory");
  ck_bad(sf_make_dir(""), SF_E_IO, "empty name", "");
}

/* ---- JSON ---- */

TEST(json_round_trip)
{
  cJSON *json = cJSON_CreateObject(), *back;
  cJSON_AddNumberToObject(json, "x", 0.1);
  ck_ok(sf_json_save(json, in("a.json")));
  ck_ok(sf_json_load(in("a.json"), &back));
  ck_assert(cJSON_Compare(json, back, 1));
  cJSON_Delete(json);
  cJSON_Delete(back);
}

static const struct {
  const char *text, *place, *problem;
} bad_json[] = {
    {"", "bad.json:1:1", "empty"},
    {" \n ", "bad.json:2:2", "empty"},
    {"{\"a\": 1", "bad.json:1:8", "early"},
    {"{\"a\": 1}\n x", "bad.json:2:2", "after the end"},
    {"{\n\"a\": NaN}", "bad.json:2:6", "malformed JSON: NaN is not JSON"},
    {"[1,\n2, -Infinity]", "bad.json:2:4", "-Infinity is not JSON"},
    {"[1, nan", "bad.json:1:5", "nan is not JSON"},
    {"[nano]", "bad.json:1:2", "malformed JSON"},
    {"[1,\n 2,,]", "bad.json:2:4", "malformed"},
    {"nul", "bad.json:1:1", "malformed"},
};

LOOP_TEST(json_faults_name_line_and_column, COUNT(bad_json))
{
  cJSON *json;
  put_file(in("bad.json"), bad_json[_i].text, strlen(bad_json[_i].text));
  ck_bad(sf_json_load(in("bad.json"), &json), SF_E_FORMAT, bad_json[_i].place, bad_json[_i].problem);
  ck_assert_ptr_null(json);
}

TEST(json_with_a_zero_byte)
{
  cJSON *json;
  put_file(in("bad.json"), "{}\0{}", 5);
  ck_bad(sf_json_load(in("bad.json"), &json), SF_E_FORMAT, "bad.json:1:3", "NUL");
}

/* ---- random numbers ---- */

/* First outputs of SplitMix64 with seed 0 (Vigna's splitmix64.c), which sf_mix64 must mix as. */
TEST(mixing_is_splitmix64)
{
  ck_assert_uint_eq(sf_mix64(0x9e3779b97f4a7c15u), 0xe220a8397b1dcdafu);
  ck_assert_uint_eq(sf_mix64(2 * 0x9e3779b97f4a7c15u), 0x6e789e6aa1b965f4u);
  for (uint64_t i = 0; i < 1000; i++) {
    float x = sf_random_float(3, 1, i);
    ck_assert(x >= 0 && x < 1);
    ck_assert_uint_lt(sf_random_below(3, 2, i, 7), 7);
  }
}

TEST(sha256_of_known_texts)
{
  char hex[65], long_text[1000];
  sf_sha256("", 0, hex);
  ck_assert_str_eq(hex, "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  sf_sha256("abc", 3, hex);
  ck_assert_str_eq(hex, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  sf_sha256("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq", 56, hex);
  ck_assert_str_eq(hex, "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  memset(long_text, 'a', sizeof long_text);
  sf_sha256(long_text, 1000, hex);
  ck_assert_str_eq(hex, "41edece42d63e8d9bf515a9ba6932e1c20cbc9f5a5d134645adb5db1b9737ea3");
}

ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};
