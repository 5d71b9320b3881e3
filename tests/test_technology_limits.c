/* Technology files at their limits: lengths, digits, points, how many prices. */
#include "ck_run.h"
#include "tests/technology_fixture.h"

static void refused(const char *text, sf_code code, const char *word)
{
  sf_technology t;
  ck_bad(load_text(&t, text), code, word, "t.tech");
}

TEST(lengths_of_a_technology_file)
{
  static const struct {
    const char *before, *after;
    int most;
    const char *word;
  } rows[] = {{"name ", "\n", 39, "key 'name': more than 39 characters"},
              {"title ", "\n", 159, "key 'title': more than 159 characters"},
              {"register 1 fJ ", "\n", 199, "key 'register': more than 199 characters"},
              {"register 0.", " fJ x\n", 0, "not a whole number"}};
  char text[4000], line[400];
  sf_technology t;
  for (int i = 0; i < COUNT(rows); i++)
    for (int more = 0; more < 2; more++) {
      if (!rows[i].most && !more) continue;
      const int n = rows[i].most ? rows[i].most + more : 12;
      memset(line, 'x', sizeof line);
      if (!rows[i].most) memset(line, '0', sizeof line);
      snprintf(text, sizeof text, "%s%s%.*s%s", crooked, rows[i].before, n, line, rows[i].after);
      if (more)
        refused(text, rows[i].most ? SF_E_RANGE : SF_E_FORMAT, rows[i].word);
      else
        ck_ok(load_text(&t, text));
    }
}

/* Nine decimals are read, whole or not; 1 mJ and no more. */
TEST(digits_of_a_price)
{
  char text[4000];
  sf_technology t;
  static const struct {
    const char *value;
    uint64_t fj; /* UINT64_MAX: refused */
  } values[] = {{"1.000000000 nJ", 1000000},
                {"0.000001 nJ", 1},
                {"0.0000010 nJ", 1},
                {"0.0000001 nJ", UINT64_MAX},
                {"1.0000000000 nJ", UINT64_MAX},
                {"1000000 nJ", 1000000000000},
                {"1000000000000 fJ", 1000000000000},
                {"1000000000000.0 fJ", 1000000000000},
                {"1000000000001 fJ", UINT64_MAX},
                {"10000000000001 fJ", UINT64_MAX},
                {"1..0 fJ", UINT64_MAX},
                {"7. fJ", 7},
                {".5 pJ", 500},
                {"00012 fJ", 12},
                {"0 fJ", 0},
                {"1/ fJ", UINT64_MAX},
                {"1: fJ", UINT64_MAX},
                {"2.5 fJ", UINT64_MAX}};
  for (int i = 0; i < COUNT(values); i++) {
    snprintf(text, sizeof text, "%sregister %s x\n", crooked, values[i].value);
    const sf_status status = load_text(&t, text);
    ck_assert_msg((status.code == SF_OK) == (values[i].fj != UINT64_MAX), "%s: %s", values[i].value, status.message);
    if (!status.code) ck_assert_uint_eq(t.price[t.count - 1].fj, values[i].fj);
  }
}

TEST(points_of_a_price)
{
  char text[4000];
  sf_technology t;
  static const struct {
    const char *key;
    bool good;
  } keys[] = {{"int_add.256", true},
              {"int_add.257", false},
              {"int_add.1", true},
              {"int_add.0", false},
              {"sram.2147483648", true},
              {"sram.2147483649", false},
              {"sram.1", true},
              {"sram.-1", false},
              {"sram.+1", false},
              {"sram. 1", false},
              {"sram.", false},
              {"sram.12x", false},
              {"int_multiply.256", true},
              {"int_multiply.257", false},
              {"dram.", false},
              {"mac.1", false},
              {"sramx", false},
              {"int_add.000000000000000000000000000003", true},
              {"int_add.00000000000000000000000000000003", false}};
  for (int i = 0; i < COUNT(keys); i++) {
    snprintf(text, sizeof text, "%s%s 1 fJ x\n", crooked, keys[i].key);
    const sf_status status = load_text(&t, text);
    ck_assert_msg((status.code == SF_OK) == keys[i].good, "%s: %s", keys[i].key, status.message);
  }
}

TEST(as_many_prices_as_there_is_room_for)
{
  char text[4000];
  sf_technology t;
  for (int more = 0; more < 2; more++) {
    int used = snprintf(text, sizeof text, "%s", crooked);
    for (int i = 0; i < SF_PRICES_MAX - 12 + more; i++) /* the largest comes first, so each is put before the others */
      used += snprintf(text + used, sizeof text - (size_t)used, "int_add.%d %d fJ x\n", 250 - i, 1000 + i);
    const sf_status status = load_text(&t, text);
    if (more) {
      ck_bad(status, SF_E_RANGE, "more than 48 prices", "t.tech");
      break;
    }
    ck_ok(status);
    ck_assert_int_eq(t.count, SF_PRICES_MAX);
    for (int i = 1; i < t.count; i++)
      ck_assert(t.price[i].at > t.price[i - 1].at || strncmp(t.price[i].key, t.price[i - 1].key, 6));
    for (int i = 5; i < 40; i++) ck_assert_uint_eq(t.price[i].fj, 1250 - t.price[i].at);
  }
}

TEST(what_else_is_no_technology_file)
{
  char path[600], text[3000];
  sf_technology t;
  put_file(in("t.tech"), "name x\0", 7);
  ck_bad(sf_technology_load(&t, in("t.tech")), SF_E_FORMAT, "not a text file", "t.tech");
  memset(path, 'p', sizeof path);
  path[512] = 0;
  ck_bad(sf_technology_load(&t, path), SF_E_RANGE, "the path is too long", "ppp");
  path[511] = 0;
  ck_assert_int_eq(sf_technology_load(&t, path).code, SF_E_IO);
  static const char *const missing[] = {"fp32_mac", "fp32_add", "dram"};
  for (int i = 0; i < COUNT(missing); i++) {
    snprintf(text, sizeof text, "%s", crooked);
    *strstr(text, missing[i]) = '#';
    char word[60];
    snprintf(word, sizeof word, "key '%s' is missing", missing[i]);
    refused(text, SF_E_FORMAT, word);
  }
  /* Tabs, blanks and carriage returns around words; no new line at the end. */
  snprintf(text, sizeof text, "%s\t \r\n\tregister\t 2 \tfJ \t some  words\t \r", crooked);
  ck_ok(load_text(&t, text));
  ck_assert_str_eq(t.price[t.count - 1].source, "some  words");
  ck_assert_str_eq(t.price[t.count - 1].text, "2 fJ");
  for (int i = 0; i < 3; i++) {
    static const char *const lines[] = {"register", "register 2 fJ", "register 2 fJ  \t"};
    snprintf(text, sizeof text, "%s%s", crooked, lines[i]);
    refused(text, SF_E_FORMAT, i ? "no source behind its price" : "has no value");
  }
}

ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};
