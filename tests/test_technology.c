/* Files of prices: what is read, mistakes by line and key, prices between points, the installed ones. */
#include "ck_run.h"
#include "tests/technology_fixture.h"

TEST(file_is_read)
{
  const sf_technology t = plain_technology();
  static const struct {
    const char *key;
    uint64_t fj;
  } wanted[] = {{"fp32_mac", 4600},     {"fp32_add", 900},         {"int_add.8", 8}, {"int_add.32", 32},
                {"int_multiply.8", 64}, {"int_multiply.32", 1024}, {"sram.64", 80},  {"sram.16384", 80},
                {"dram", 8000},         {"register", 32}};
  ck_assert_str_eq(t.name, "plain");
  ck_assert_str_eq(t.title, "A plain technology");
  ck_assert_int_eq(t.count, 10);
  for (int i = 0; i < t.count; i++) { /* in order of family and point, whatever the file's */
    ck_assert_str_eq(t.price[i].key, wanted[i].key);
    ck_assert_uint_eq(t.price[i].fj, wanted[i].fj);
  }
  ck_assert_str_eq(t.price[5].text, "1.024 pJ");
  ck_assert_str_eq(t.price[5].source, "made up");
}

/* Each mistake, put in place of a line of the plain file, and what the message says behind the in("t.tech"). */
TEST(mistakes_are_named_with_line_and_key)
{
  static const struct {
    const char *line, *instead, *message;
  } mistakes[] = {
      {"fp32_add 0.9 pJ paper", "fp23_add 0.9 pJ paper", ":6: unknown key 'fp23_add'"},
      {"fp32_add 0.9 pJ paper", "fp32_add", ":6: key 'fp32_add' has no value"},
      {"fp32_add 0.9 pJ paper", "fp32_add 0.9 mJ paper", ":6: key 'fp32_add': unit 'mJ' is not fJ, pJ or nJ"},
      {"fp32_add 0.9 pJ paper", "fp32_add 0.9", ":6: key 'fp32_add': unit '' is not fJ, pJ or nJ"},
      {"fp32_add 0.9 pJ paper", "fp32_add 0.9 pJ", ":6: key 'fp32_add' has no source behind its price"},
      {"fp32_add 0.9 pJ paper", "fp32_add -0.9 pJ x", ":6: key 'fp32_add': '-0.9 pJ' is not a whole number of fJ"},
      {"fp32_add 0.9 pJ paper", "fp32_add 1e3 pJ x", ":6: key 'fp32_add': '1e3 pJ' is not a whole number of fJ"},
      {"fp32_add 0.9 pJ paper", "fp32_add . pJ x", ":6: key 'fp32_add': '. pJ' is not a whole number of fJ"},
      {"fp32_add 0.9 pJ paper", "fp32_add 0.9001 pJ x", ":6: key 'fp32_add': '0.9001 pJ' is not a whole number of fJ"},
      {"fp32_add 0.9 pJ paper", "fp32_add 1000001 nJ x", ":6: key 'fp32_add': 1000001 nJ is more than 1 mJ"},
      {"fp32_add 0.9 pJ paper", "fp32_add 99999999999999999999999 fJ x",
       ":6: key 'fp32_add': '99999999999999999999999 fJ' is not"},
      {"fp32_add 0.9 pJ paper", "fp32_add.8 0.9 pJ x", ":6: key 'fp32_add.8' takes no '.8'"},
      {"int_add.8 8 fJ made up", "int_add 8 fJ x", ":8: key 'int_add': expected int_add.BITS, 1 to 256"},
      {"int_add.8 8 fJ made up", "int_add.x 8 fJ x", ":8: key 'int_add.x': expected int_add.BITS"},
      {"int_add.8 8 fJ made up", "int_add.257 8 fJ x", ":8: key 'int_add.257': expected int_add.BITS"},
      {"int_add.8 8 fJ made up", "int_add.32 8 fJ x", ":8: key 'int_add.32' is there twice, first as 'int_add.32'"},
      {"int_add.8 8 fJ made up", "int_add.032 8 fJ x", ":8: key 'int_add.032' is there twice, first as 'int_add.32'"},
      {"fp32_add 0.9 pJ paper", "fp32_mac 0.9 pJ x", ":6: key 'fp32_mac' is there twice"},
      {"sram.64 80 fJ made up", "sram.0 80 fJ x", ":12: key 'sram.0': expected sram.BYTES"},
      {"int_add.8 8 fJ made up", "", ": key 'int_add' needs two points to interpolate between"},
      {"dram 0.008 nJ made up", "", ": key 'dram' is missing"},
      {"name plain", "", ": key 'name' is missing"},
      {"name plain", "name", ":2: key 'name' has no text"},
      {"title  A plain technology  ", "", ": key 'title' is missing"}};
  for (size_t i = 0; i < sizeof mistakes / sizeof *mistakes; i++) {
    char text[2000], expected[500];
    sf_technology tech;
    const char *at = strstr(plain, mistakes[i].line);
    ck_assert_ptr_nonnull(at);
    snprintf(text, sizeof text, "%.*s%s%s", (int)(at - plain), plain, mistakes[i].instead,
             at + strlen(mistakes[i].line));
    const sf_status status = load_text(&tech, text);
    snprintf(expected, sizeof expected, "%s%s", in("t.tech"), mistakes[i].message);
    ck_assert_msg(status.code == SF_E_FORMAT || status.code == SF_E_RANGE, "%s: accepted", mistakes[i].instead);
    ck_assert_msg(!strncmp(status.message, expected, strlen(expected)), "%s\n  expected %s", status.message, expected);
  }
  unlink(in("t.tech"));
  sf_technology tech;
  ck_assert_int_eq(sf_technology_load(&tech, in("t.tech")).code, SF_E_IO);
}

TEST(prices_between_points)
{
  sf_technology t = plain_technology();
  bool between = false;
  ck_assert_uint_eq(sf_price_add(&t, 8, &between), 8);
  ck_assert_uint_eq(sf_price_add(&t, 32, &between), 32);
  ck_assert_uint_eq(sf_price_multiply(&t, 8, 8, &between), 64);
  ck_assert_uint_eq(sf_price_multiply(&t, 64, 16, &between), 1024);
  ck_assert_uint_eq(sf_price_access(&t, 64, &between), 80);
  ck_assert_uint_eq(sf_price_access(&t, 3, &between), 80); /* smaller than the smallest: its price */
  ck_assert_uint_eq(sf_price_access(&t, 16384, &between), 80);
  ck_assert_uint_eq(sf_price_access(&t, 16385, &between), 8000);
  ck_assert_uint_eq(sf_price_register(&t, 24, &between), 24);
  ck_assert(!between);
  ck_assert_uint_eq(sf_price_add(&t, 15, &between), 15);
  ck_assert(between);
  between = false;
  ck_assert_uint_eq(sf_price_multiply(&t, 12, 8, &between), 96);
  ck_assert(between);
  ck_assert_uint_eq(sf_price_add(&t, 40, NULL), 40); /* beyond the last: the same line */
  ck_assert_uint_eq(sf_price_add(&t, 2, NULL), 2);
  t.price[7].fj = 5120; /* 64 times the price for 256 times the size: the power 3/4 */
  ck_assert_uint_eq(sf_price_access(&t, 1024, NULL), 640);
  t.price[2].fj = 40; /* 40 at 8 bits, 32 at 32: where the line falls to nothing, the price of the last point */
  ck_assert_uint_eq(sf_price_add(&t, 120, NULL), 3);
  ck_assert_uint_eq(sf_price_add(&t, 200, NULL), 32);
  t.price[4].fj = 64, t.price[5].fj = 2000; /* 64 at 8 x 8 bits, 2000 at 32 x 32: nothing at 33 */
  ck_assert_uint_eq(sf_price_multiply(&t, 6, 6, NULL), 8);
  ck_assert_uint_eq(sf_price_multiply(&t, 4, 4, NULL), 64);
}

/* A file of before has none: an eighth of the smallest memory's access is 8 bits. */
TEST(register_files_may_have_no_price)
{
  char text[2000];
  sf_technology t;
  bool between = false;
  snprintf(text, sizeof text, "%.*s", (int)(strstr(plain, "register") - plain), plain);
  ck_ok(load_text(&t, text));
  ck_assert_int_eq(t.count, 9);
  ck_assert_uint_eq(sf_price_register(&t, 24, &between), 30);
  ck_assert(between);
}

/* The file that is installed: Horowitz's figure, and what the paper makes of it. */
TEST(installed_prices)
{
  sf_technology t;
  ck_ok(sf_technology_load(&t, "share/tech/45nm.tech"));
  static const uint64_t wanted[] = {SF_MAC_FJ, SF_SOP_FJ, 30, 100, 200, 3100, 10000, 20000, 100000, 1950000, 1000};
  ck_assert_int_eq(t.count, 11);
  for (int i = 0; i < t.count; i++) {
    ck_assert_uint_eq(t.price[i].fj, wanted[i]);
    ck_assert_ptr_nonnull(strstr(t.price[i].source, "Horowitz"));
  }
  ck_assert_uint_eq(sf_price_add(&t, 15, NULL), 50);              /* 30 + 7/24 * 70 = 50.4 */
  ck_assert_uint_eq(sf_price_multiply(&t, 12, 8, NULL), 297);     /* 200 + 32/960 * 2900 = 296.7 */
  ck_assert_uint_eq(sf_price_access(&t, 128 * 128, NULL), 14142); /* 10 * sqrt 2 pJ */
}

/* Prices of netlists: an operation costs more than its arithmetic alone, a MAC of 12 bits more than one of 8. */
TEST(installed_prices_from_netlists)
{
  static const char *const files[] = {"share/tech/sky130.tech", "share/tech/osu018.tech"};
  for (int i = 0; i < 2; i++) {
    sf_technology t;
    uint64_t fj[SF_PRICE_KEYS];
    ck_ok(sf_technology_load(&t, files[i]));
    for (int f = SF_PRICE_MAC; f < SF_PRICE_KEYS; f++)
      ck_assert_msg(sf_price_measured(&t, f, &fj[f]), "%s: family %d is missing", files[i], f);
    ck_assert_uint_gt(fj[SF_PRICE_MAC], fj[SF_PRICE_TWIN_MAC]);
    ck_assert_uint_gt(fj[SF_PRICE_TWIN_MAC], sf_price_multiply(&t, 8, 8, NULL) + sf_price_add(&t, 32, NULL));
    ck_assert_uint_gt(fj[SF_PRICE_SOP], sf_price_add(&t, 16, NULL));
    ck_assert_uint_gt(fj[SF_PRICE_MAC], 3 * fj[SF_PRICE_SOP]);
    for (int p = 0; p < t.count; p++)
      ck_assert(strstr(t.price[p].source, "netlist: ") || strstr(t.price[p].source, "Horowitz"));
  }
}

ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};
