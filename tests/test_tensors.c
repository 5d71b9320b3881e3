/* Safetensors: the layout on disk, what is refused, damage. */
#include "ck_run.h"
#include "base/io.h"
#include "folder_fixture.h"
#include "base/rng.h"
#include <math.h>

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

static sf_status load_tensors(const char *path)
{
  OWNED(sf_tensors) set;
  return sf_tensors_load(&set, path);
}

TEST(tensors_survive_damage)
{
  float f[5] = {1, 2, 3, 4, 5};
  sf_tensor t[] = {{"a", SF_F32, 1, {5}, f}, {"b", SF_U8, 2, {2, 2}, f}};
  ck_ok(sf_tensors_save(t, 2, NULL, in("t")));
  ck_damage(in("t"), load_tensors, false);
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

ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};
