/* Status, files, JSON, safetensors, command lines. */
#include "ck_run.h"
#include "cli/cli.h"
#include "base/io.h"
#include "folder_fixture.h"
#include "base/rng.h"
#include <math.h>
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
  char *big = calloc(1, 100000), *data;
  size_t n;
  ck_ok(sf_write_file(in("a"), "old", 3));
  limit_file_size(50000);
  ck_bad(sf_write_file(in("a"), big, 100000), SF_E_IO, "/a", "large");
  ck_ok(sf_read_file(in("a"), 10, &data, &n));
  ck_assert_str_eq(data, "old");
  free(data);
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
  char *data;
  size_t size;
  ck_ok(sf_read_file(in("a"), 100, &data, &size));
  ck_assert_str_eq(data, "1");
  free(data);
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

/* ---- safetensors ---- */

TEST(tensors_round_trip)
{
  float f[6] = {1, -2, 3.5f, NAN, INFINITY, 0};
  int8_t b[3] = {-128, 0, 127};
  int64_t q[2] = {INT64_MIN, INT64_MAX};
  int16_t s[1] = {-7};
  uint8_t nothing[1];
  sf_tensor t[] = {{"bytes", SF_I8, 1, {3}, b},
                   {"m", SF_F32, 2, {2, 3}, f},
                   {"long", SF_I64, 1, {2}, q},
                   {"scalar", SF_I16, 0, {0}, s},
                   {"empty", SF_U8, 3, {4, 0, 2}, nothing}};
  cJSON *meta = cJSON_CreateObject();
  cJSON_AddStringToObject(meta, "version", "1 \"x\"\n");
  ck_ok(sf_tensors_save(t, 5, meta, in("t")));
  cJSON_Delete(meta);

  OWNED(sf_tensors) set;
  ck_ok(sf_tensors_load(&set, in("t")));
  ck_assert_int_eq(set.count, 5);
  ck_assert_str_eq(sf_tensors_meta(&set, "version"), "1 \"x\"\n");
  ck_assert_ptr_null(sf_tensors_meta(&set, "other"));
  const sf_tensor *got;
  for (int i = 0; i < 5; i++) {
    ck_ok(sf_tensors_get(&set, t[i].name, t[i].type, t[i].dims, t[i].shape, &got));
    size_t n = sf_dtype_size(t[i].type);
    ck_assert_uint_eq((uintptr_t)got->data % n, 0);
    for (int k = 0; k < t[i].dims; k++) n *= (size_t)t[i].shape[k];
    if (n) ck_assert_mem_eq(got->data, t[i].data, n);
  }
  const int64_t any[2] = {-1, 3}, wrong[2] = {3, 2};
  ck_ok(sf_tensors_get(&set, "m", SF_F32, 2, any, &got));
  ck_bad(sf_tensors_get(&set, "m", SF_F32, 2, wrong, &got), SF_E_FORMAT, "expected F32[3,2], found F32[2,3]", "/t");
  ck_bad(sf_tensors_get(&set, "m", SF_I32, 2, any, &got), SF_E_FORMAT, "expected I32[*,3]", "'m'");
  ck_bad(sf_tensors_get(&set, "gone", SF_I32, 2, any, &got), SF_E_FORMAT, "'gone' is missing", "/t");
  ck_ok(sf_tensors_get(&set, "m", SF_F32, 2, any, &got));
  ck_bad(sf_tensor_finite("file", got), SF_E_RANGE, "element 3 is NaN", "file: tensor 'm'");
  ((float *)got->data)[3] = 0;
  ck_bad(sf_tensor_finite("file", got), SF_E_RANGE, "element 4 is infinite", "'m'");
  ((float *)got->data)[4] = 0;
  ck_ok(sf_tensor_finite("file", got));
}

/* The layout on disk, byte for byte: wide types first, then by name; header padded to 8 bytes. */
TEST(tensors_layout)
{
  uint8_t b[2] = {5, 6};
  float f[1] = {1};
  sf_tensor t[] = {{"b", SF_U8, 1, {2}, b}, {"a", SF_U8, 1, {1}, b}, {"f", SF_F32, 1, {1}, f}};
  ck_ok(sf_tensors_save(t, 3, NULL, in("t")));
  static const char header[] = "{\"f\":{\"dtype\":\"F32\",\"shape\":[1],\"data_offsets\":[0,4]},"
                               "\"a\":{\"dtype\":\"U8\",\"shape\":[1],\"data_offsets\":[4,5]},"
                               "\"b\":{\"dtype\":\"U8\",\"shape\":[2],\"data_offsets\":[5,7]}}";
  char *data;
  size_t n, padded = (sizeof header - 1 + 7) / 8 * 8;
  uint64_t length;
  ck_ok(sf_read_file(in("t"), 10000, &data, &n));
  memcpy(&length, data, 8);
  ck_assert_uint_eq(length, padded);
  ck_assert_mem_eq(data + 8, header, sizeof header - 1);
  for (size_t i = sizeof header - 1; i < padded; i++) ck_assert_int_eq(data[8 + i], ' ');
  ck_assert_uint_eq(n, 8 + padded + 7);
  ck_assert_mem_eq(data + 8 + padded, "\0\0\x80\x3f\x05\x05\x06", 7);
  free(data);
}

static void put_tensors(const char *header, size_t data_bytes)
{
  char file[2000] = {0};
  uint64_t n = strlen(header);
  memcpy(file, &n, 8);
  memcpy(file + 8, header, n);
  put_file(in("bad"), file, 8 + n + data_bytes);
}

#define W(shape, offsets) "{\"w\":{\"dtype\":\"F32\",\"shape\":" shape ",\"data_offsets\":" offsets "}}"
#define PAIR(a, b)                                                                                                     \
  "{\"w\":{\"dtype\":\"U8\",\"shape\":[4],\"data_offsets\":" a                                                         \
  "},\"v\":{\"dtype\":\"U8\",\"shape\":[4],\"data_offsets\":" b "}}"
static const struct {
  const char *header;
  size_t data;
  sf_code code;
  const char *problem, *where;
} bad_tensors[] = {
    {W("[2]", "[0,8]"), 7, SF_E_FORMAT, "outside the data of 7 bytes", "'w'"},
    {W("[2]", "[0,8]"), 9, SF_E_FORMAT, "1 bytes behind the last tensor", "/bad"},
    {W("[3]", "[0,8]"), 8, SF_E_FORMAT, "8 bytes of data, its shape needs 12", "'w'"},
    {W("[2]", "[8,0]"), 8, SF_E_FORMAT, "outside", "'w'"},
    {W("[-2]", "[0,8]"), 8, SF_E_FORMAT, "shape[0] is not a count", "'w'"},
    {W("[1.5]", "[0,6]"), 6, SF_E_FORMAT, "shape[0] is not a count", "'w'"},
    {W("[2,1e300]", "[0,8]"), 8, SF_E_FORMAT, "shape[1] is not a count", "'w'"},
    {W("[4503599627370496,4503599627370496]", "[0,8]"), 8, SF_E_FORMAT, "shape overflows", "'w'"},
    {W("\"2\"", "[0,8]"), 8, SF_E_FORMAT, "shape is missing", "'w'"},
    {W("[1,1,1,1,2]", "[0,8]"), 8, SF_E_UNSUPPORTED, "more than 4 dimensions", "'w'"},
    {W("[2]", "[0]"), 8, SF_E_FORMAT, "not a pair", "'w'"},
    {W("[2]", "[-4,4]"), 8, SF_E_FORMAT, "not a pair", "'w'"},
    {W("[2]", "[0,8]") "x", 8, SF_E_FORMAT, "text behind the JSON header", "/bad"},
    {PAIR("[0,4]", "[2,6]"), 6, SF_E_FORMAT, "overlaps", "'v'"},
    {PAIR("[0,4]", "[5,9]"), 9, SF_E_FORMAT, "hole of 1 bytes", "'v'"},
    {PAIR("[1,5]", "[5,9]"), 9, SF_E_FORMAT, "hole of 1 bytes", "'w'"},
    {"{\"w\":{\"dtype\":\"U8\",\"shape\":[1],\"data_offsets\":[0,1]},\"w\":{\"dtype\":\"U8\",\"shape\":[1],\"data_"
     "offsets\":[1,2]}}",
     2, SF_E_FORMAT, "appears twice", "'w'"},
    {"{\"w\":{\"dtype\":\"F33\",\"shape\":[1],\"data_offsets\":[0,1]}}", 1, SF_E_FORMAT, "unknown dtype 'F33'", "'w'"},
    {"{\"w\":{\"dtype\":\"BF16\",\"shape\":[1],\"data_offsets\":[0,2]}}", 2, SF_E_UNSUPPORTED, "BF16", "'w'"},
    {"{\"w\":{\"shape\":[1],\"data_offsets\":[0,2]}}", 2, SF_E_FORMAT, "dtype is missing", "'w'"},
    {"{\"w\":3}", 0, SF_E_FORMAT, "not an object", "'w'"},
    {"{\"__metadata__\":{\"a\":1}}", 0, SF_E_FORMAT, "'a' is not a string", "/bad"},
    {"{\"__metadata__\":[]}", 0, SF_E_FORMAT, "not an object", "/bad"},
    {"[]", 0, SF_E_FORMAT, "not a JSON object", "/bad"},
    {"", 0, SF_E_FORMAT, "not a JSON object", "/bad"},
    {"{\"w\":", 0, SF_E_FORMAT, "malformed JSON header", "/bad"},
};

LOOP_TEST(tensors_refused, COUNT(bad_tensors))
{
  sf_tensors set;
  put_tensors(bad_tensors[_i].header, bad_tensors[_i].data);
  ck_bad(sf_tensors_load(&set, in("bad")), bad_tensors[_i].code, bad_tensors[_i].problem, bad_tensors[_i].where);
  ck_assert_ptr_null(set.buffer);
}

TEST(tensors_header_length)
{
  sf_tensors set;
  uint64_t n = 100000001;
  put_file(in("bad"), "1234567", 7);
  ck_bad(sf_tensors_load(&set, in("bad")), SF_E_FORMAT, "too short", "/bad");
  put_file(in("bad"), &n, 8);
  ck_bad(sf_tensors_load(&set, in("bad")), SF_E_FORMAT, "limit", "/bad");
  n = 10;
  put_file(in("bad"), &n, 8);
  ck_bad(sf_tensors_load(&set, in("bad")), SF_E_FORMAT, "cut short", "/bad");
}

/* Every shorter file and every damaged header byte is refused or read, never a crash; shorter is always refused. */
TEST(tensors_survive_damage)
{
  float f[5] = {1, 2, 3, 4, 5};
  sf_tensor t[] = {{"a", SF_F32, 1, {5}, f}, {"b", SF_U8, 2, {2, 2}, f}};
  ck_ok(sf_tensors_save(t, 2, NULL, in("t")));
  char *data;
  size_t n;
  sf_tensors set;
  ck_ok(sf_read_file(in("t"), 10000, &data, &n));
  for (size_t i = 0; i < n; i++) {
    put_file(in("bad"), data, i);
    sf_status s = sf_tensors_load(&set, in("bad"));
    ck_assert_msg(s.code == SF_E_FORMAT, "cut to %zu bytes: code %d", i, s.code);
  }
  for (uint64_t i = 0; i < 4 * n; i++) {
    char *copy = malloc(n);
    memcpy(copy, data, n);
    copy[sf_random_below(1, 0, i, n)] = (char)sf_random_u64(1, 1, i);
    put_file(in("bad"), copy, n);
    if (sf_tensors_load(&set, in("bad")).code == SF_OK) sf_tensors_free(&set);
    free(copy);
  }
  free(data);
}

/* A foreign writer need not pad its header: the data is moved to aligned places. */
TEST(tensors_unaligned_file)
{
  static const char header[] = "{\"b\":{\"dtype\":\"U8\",\"shape\":[1],\"data_offsets\":[0,1]},"
                               "\"f\":{\"dtype\":\"F32\",\"shape\":[1],\"data_offsets\":[1,5]}}";
  char file[300];
  uint64_t n = sizeof header - 1;
  memcpy(file, &n, 8);
  memcpy(file + 8, header, n);
  memcpy(file + 8 + n, "\x07\0\0\x80\x3f", 5);
  put_file(in("t"), file, 8 + n + 5);
  OWNED(sf_tensors) set;
  const sf_tensor *t;
  const int64_t one = 1;
  ck_ok(sf_tensors_load(&set, in("t")));
  ck_ok(sf_tensors_get(&set, "f", SF_F32, 1, &one, &t));
  ck_assert_uint_eq((uintptr_t)t->data % 4, 0);
  ck_assert(*(float *)t->data == 1.0f);
  ck_ok(sf_tensors_get(&set, "b", SF_U8, 1, &one, &t));
  ck_assert_int_eq(*(uint8_t *)t->data, 7);
}

TEST(tensors_not_saved)
{
  float f[1] = {0};
  sf_tensor twice[] = {{"a", SF_F32, 1, {1}, f}, {"a", SF_U8, 1, {1}, f}};
  ck_bad(sf_tensors_save(twice, 2, NULL, in("t")), SF_E_RANGE, "two tensors", "'a'");
  sf_tensor bad = {"a", SF_F32, 1, {-1}, f};
  ck_bad(sf_tensors_save(&bad, 1, NULL, in("t")), SF_E_RANGE, "shape[0]", "'a'");
  bad = (sf_tensor){"__metadata__", SF_F32, 1, {1}, f};
  ck_bad(sf_tensors_save(&bad, 1, NULL, in("t")), SF_E_RANGE, "cannot name", "/t");
  bad = (sf_tensor){"a", SF_F32, 1, {1}, NULL};
  ck_bad(sf_tensors_save(&bad, 1, NULL, in("t")), SF_E_RANGE, "no data", "'a'");
  cJSON *meta = cJSON_CreateObject();
  cJSON_AddNumberToObject(meta, "n", 1);
  bad.data = f;
  ck_bad(sf_tensors_save(&bad, 1, meta, in("t")), SF_E_RANGE, "'n' is not a string", "/t");
  cJSON_Delete(meta);
  ck_assert_int_eq(entries(), 0);
}

/* Driven by tests/chain/read_safetensors.py: reads what the format's own library wrote, writes what it will read. */
REGISTERED_TEST(tensors_crosscheck, if (getenv("SF_CROSSCHECK")) tcase_add_test(ck_case(), tensors_crosscheck))
{
  const char *where = getenv("SF_CROSSCHECK");
  char theirs[500], ours[500];
  snprintf(theirs, sizeof theirs, "%s/theirs.safetensors", where);
  snprintf(ours, sizeof ours, "%s/ours.safetensors", where);
  OWNED(sf_tensors) set;
  const sf_tensor *t;
  const int64_t shape[2] = {3, 5}, three = 3;
  ck_ok(sf_tensors_load(&set, theirs));
  ck_assert_int_eq(set.count, 8);
  ck_assert_str_eq(sf_tensors_meta(&set, "version"), "1");
  ck_ok(sf_tensors_get(&set, "f32", SF_F32, 2, shape, &t));
  for (int i = 0; i < 15; i++) ck_assert(((float *)t->data)[i] == (float)i / 4 - 1);
  ck_ok(sf_tensors_get(&set, "i8", SF_I8, 1, &three, &t));
  ck_assert_mem_eq(t->data, "\x80\0\x7f", 3);
  ck_ok(sf_tensors_get(&set, "u64", SF_U64, 0, NULL, &t));
  ck_assert_uint_eq(*(uint64_t *)t->data, UINT64_MAX);
  ck_ok(sf_tensors_save(set.tensor, set.count, set.metadata, ours));
}

/* ---- command lines ---- */

typedef struct values {
  bool flag;
  int number, choice;
  uint64_t seed;
  double beta;
  const char *text;
} values;

static sf_status parse_line(const sf_cli *cli, const char **positional, const char *line)
{
  static char copy[500];
  char *argv[20] = {"prog"};
  int argc = 1;
  snprintf(copy, sizeof copy, "%s", line);
  for (char *word = strtok(copy, " "); word; word = strtok(NULL, " ")) argv[argc++] = strcmp(word, "''") ? word : "";
  return sf_cli_parse(cli, argc, argv, positional);
}

static sf_status parse(values *v, const char **positional, const char *line)
{
  const sf_option options[] = {{"--flag", 'f', SF_ARG_FLAG, &v->flag, 0, 0, NULL, NULL, "a flag"},
                               {"--number", 'n', SF_ARG_INT, &v->number, -5, 10, NULL, "N", "a number"},
                               {"--any", 0, SF_ARG_INT, &v->number, 0, 0, NULL, "N", "any number"},
                               {"--seed", 0, SF_ARG_U64, &v->seed, 0, 0, NULL, "N", "a seed"},
                               {"--beta", 'b', SF_ARG_DOUBLE, &v->beta, 0, 1, NULL, "B", "a weight"},
                               {"--mode", 0, SF_ARG_CHOICE, &v->choice, 0, 0, "hybrid|decay|no-decay", NULL, "a mode"},
                               {"--out", 'o', SF_ARG_STRING, &v->text, 0, 0, NULL, "FILE", "a file"},
                               {0}};
  const sf_cli cli = {"prog", "prog IN [OUT] [options]", "Does it.", NULL, options, 1, 2, false, NULL, NULL};
  return parse_line(&cli, positional, line);
}

static sf_status parse_paths(const char *line, const char **positional)
{
  const char *output = NULL, *log = NULL, *start = NULL, *word = NULL;
  const sf_option options[] = {{"--output", 'o', SF_ARG_OUTPUT, &output, 0, 0, NULL, "FILE", "a file"},
                               {"--log", 0, SF_ARG_PLACE, &log, 0, 0, NULL, "FILE", "a log"},
                               {"--start", 0, SF_ARG_INPUT, &start, 0, 0, NULL, "FILE", "an input"},
                               {"--word", 0, SF_ARG_STRING, &word, 0, 0, NULL, "WORD", "no file"},
                               {0}};
  const sf_cli cli = {"prog", "prog IN", "Does it.", NULL, options, 1, 2, false, NULL, NULL};
  return parse_line(&cli, positional, line);
}

TEST(cli_values)
{
  values v = {0};
  const char *p[2];
  ck_ok(parse(&v, p, "in -f -n -5 --seed 18446744073709551615 --beta=1e-7 --mode no-decay out -o file"));
  ck_assert(v.flag);
  ck_assert_int_eq(v.number, -5);
  ck_assert_uint_eq(v.seed, UINT64_MAX);
  ck_assert(v.beta == 1e-7);
  ck_assert_int_eq(v.choice, 2);
  ck_assert_str_eq(v.text, "file");
  ck_assert_str_eq(p[0], "in");
  ck_assert_str_eq(p[1], "out");
  ck_ok(parse(&v, p, "-n10 --seed=0x10 --any -2147483648 -- -in"));
  ck_assert_int_eq(v.number, INT32_MIN);
  ck_assert_uint_eq(v.seed, 16);
  ck_assert_str_eq(p[0], "-in");
  ck_assert_ptr_null(p[1]);
  ck_ok(parse(&v, p, "-"));
  ck_assert_str_eq(p[0], "-");
}

static const struct {
  const char *line, *name, *problem;
} bad_lines[] = {
    {"in --nope", "--nope", "unknown option"},     {"in -x", "-x", "unknown option"},
    {"in --numbe 3", "--numbe", "unknown"},        {"in --number", "--number", "needs a value"},
    {"in -n --flag", "--number", "needs a value"}, {"in --number 11", "--number", "out of range"},
    {"in -n -6", "--number", "-5 to 10"},          {"in -n 3x", "--number", "not a whole number"},
    {"in -n 1.5", "--number", "not a whole"},      {"in -n 99999999999999999999", "--number", "out of range"},
    {"in --any 2147483648", "--any", "32 bits"},   {"in --number ''", "--number", "not a whole number"},
    {"in --seed -1", "--seed", "not a whole"},     {"in --seed 18446744073709551616", "--seed", "64 bits"},
    {"in --seed 0x", "--seed", "not a whole"},     {"in --beta nan", "--beta", "not a finite number"},
    {"in --beta inf", "--beta", "not a finite"},   {"in --beta 1e999", "--beta", "not a finite"},
    {"in --beta 1.01", "--beta", "out of range"},  {"in --beta one", "--beta", "not a number"},
    {"in --mode sum", "--mode", "hybrid|decay"},   {"in --mode hyb", "--mode", "unknown"},
    {"in --flag=1", "--flag", "takes no value"},   {"in --out=", "--out", "empty"},
    {"a b c", "'c'", "unexpected argument"},       {"-f", "missing argument", "prog IN"},
};

LOOP_TEST(cli_refused, COUNT(bad_lines))
{
  values v = {0};
  const char *p[2];
  ck_bad(parse(&v, p, bad_lines[_i].line), SF_E_USAGE, bad_lines[_i].name, bad_lines[_i].problem);
}

/* What would be lost at the end is refused at the start; nothing stays behind, and no file is changed. */
TEST(cli_outputs)
{
  static const char *const lines[][3] = {
      {"a -o a", "--output", "is the input"},        {"b -o ./a", "--output", "is the input"},
      {"a --log b", "--log", "is the input"},        {"in --start a -o b", "--output", "also --start"},
      {"in -o c --log c", "--output", "also --log"}, {"in --log d/../c -o c", "--output", "also --log"}};
  static const char *const unwritable[] = {"in -o none/c", "in -o d", "in -o a/c", "in -o /dev/null"};
  static const char *const good[] = {"a -o c --log d",  "d --log d -o d/a", "in --start c -o x",
                                     "in --log none/c", "in --word c -o c", "in --start c -o c"};
  const char *p[2];
  ck_assert_int_eq(chdir(folder), 0);
  ck_ok(sf_write_file("a", "a", 1));
  ck_assert_int_eq(symlink("a", "b"), 0);
  ck_ok(sf_make_dir("d"));
  for (int i = 0; i < COUNT(lines); i++) ck_bad(parse_paths(lines[i][0], p), SF_E_USAGE, lines[i][1], lines[i][2]);
  for (int i = 0; i < COUNT(unwritable); i++)
    ck_bad(parse_paths(unwritable[i], p), SF_E_IO, "cannot write", strrchr(unwritable[i], ' ') + 1);
  for (int i = 0; i < COUNT(good); i++) ck_ok(parse_paths(good[i], p));
  ck_assert_int_eq(entries(), 3);
}

/* How a process ends that does this. */
static int end_of(void (*act)(void))
{
  int status;
  const pid_t child = fork();
  if (child == 0) {
    act();
    _exit(9);
  }
  ck_assert_int_eq(waitpid(child, &status, 0), child);
  return status;
}

static void ask_for_help(void)
{
  values v = {0};
  const char *p[2];
  if (freopen(in("help"), "w", stdout)) parse(&v, p, "--help");
}

/* Groups in the order of the table, lines of at most 80 columns, defaults under their columns. */
TEST(cli_help_in_groups)
{
  static const char wanted[] =
      "Usage: prog\n\nFirst:\n  -o, --out FILE            a file\n"
      "      --an-option-with-a-long-name NUMBER\n                            what does not fit beside its name "
      "stands below, and\n"
      "                            goes on in the next line\n"
      "\nSizes:                                                              one      two\n"
      "      --size N              words of a help that goes on in          16       32\n"
      "                            the next line\n"
      "      --both N              the same for both                         7        7\n"
      "\nHelp:\n  -h, --help                show this text\n      --version             show the version\n";
  const char *out;
  int n;
  const sf_option options[] = {
      SF_GROUP("First"),
      {"--out", 'o', SF_ARG_STRING, &out, 0, 0, NULL, "FILE", "a file"},
      {"--an-option-with-a-long-name", 0, SF_ARG_INT, &n, 0, 0, NULL, "NUMBER",
       "what does not fit beside its name stands below, and goes on in the next line"},
      SF_GROUP("Sizes"),
      {"--size", 0, SF_ARG_INT, &n, 0, 0, NULL, "N", "words of a help that goes on in the next line\t16\t32"},
      {"--both", 0, SF_ARG_INT, &n, 0, 0, NULL, "N", "the same for both\t7"},
      {0}};
  const sf_cli cli = {.program = "prog", .options = options, .columns = "\tone\ttwo"};
  ck_assert_ptr_nonnull(freopen(in("help"), "w", stdout));
  sf_cli_help(&cli);
  fclose(stdout);
  char *text;
  size_t size;
  ck_ok(sf_read_file(in("help"), 4000, &text, &size));
  ck_assert_str_eq(text, wanted);
  free(text);
  ck_bad(parse_line(&cli, (const char *[]){NULL}, "Sizes"), SF_E_USAGE, "unexpected", "Sizes"); /* no option */
}

TEST(cli_help_exits_zero)
{
  ck_assert_int_eq(end_of(ask_for_help), 0);
}

TEST(cli_exit_status)
{
  const sf_cli cli = {.program = "prog"};
  ck_assert_ptr_nonnull(freopen(in("err"), "w", stderr));
  ck_assert_int_eq(sf_cli_finish(&cli, sf_ok()), 0);
  ck_assert_int_eq(ftell(stderr), 0);
  ck_assert_int_eq(sf_cli_finish(&cli, sf_fail(SF_E_USAGE, "u")), 2);
  ck_assert_int_eq(sf_cli_finish(&cli, sf_fail(SF_E_STOPPED, "s")), 130);
  ck_assert_int_eq(sf_cli_finish(&cli, sf_fail(SF_E_IO, "i")), 1);
  ck_assert_int_eq(sf_cli_finish(&cli, sf_fail(SF_E_DIFFERENCE, "d")), 1);
  fclose(stderr);
  char *text;
  size_t n;
  ck_ok(sf_read_file(in("err"), 1000, &text, &n));
  ck_assert_str_eq(text, "prog: u (see prog --help)\nprog: s\nprog: i\nprog: d\n");
  free(text);
}

TEST(cli_full_standard_output_is_an_error)
{
  const sf_cli cli = {.program = "prog"};
  ck_assert_ptr_nonnull(freopen("/dev/full", "w", stdout));
  ck_assert_ptr_nonnull(freopen("/dev/null", "w", stderr));
  printf("text");
  ck_assert_int_eq(sf_cli_finish(&cli, sf_ok()), 1);
}

TEST(first_signal_asks_to_stop)
{
  sf_cli_catch_signals();
  ck_assert(!sf_cli_interrupted());
  raise(SIGINT);
  ck_assert(sf_cli_interrupted());
}

static void two_signals(void)
{
  sf_cli_catch_signals();
  raise(SIGTERM);
  raise(SIGTERM);
}

TEST(second_signal_kills)
{
  const int status = end_of(two_signals);
  ck_assert(WIFSIGNALED(status) && WTERMSIG(status) == SIGTERM);
}

TEST(progress_is_sparse_in_logs)
{
  sf_progress p;
  ck_assert_ptr_nonnull(freopen(in("err"), "w", stderr));
  sf_progress_begin(&p, false);
  ck_assert(!p.terminal);
  for (int i = 0; i < 100; i++) sf_progress_show(&p, "step %d", i);
  p.last -= 6;
  ck_assert(sf_progress_due(&p));
  sf_progress_show(&p, "shown");
  sf_progress_show(&p, "not shown");
  sf_progress_end(&p);
  sf_progress_begin(&p, true);
  p.last -= 6;
  ck_assert(!sf_progress_due(&p));
  sf_progress_show(&p, "quiet");
  fclose(stderr);
  char *text;
  size_t n;
  ck_ok(sf_read_file(in("err"), 1000, &text, &n));
  ck_assert_str_eq(text, "shown\n");
  free(text);
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

ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};
